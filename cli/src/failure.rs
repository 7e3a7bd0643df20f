//! Errors of commands: one sentence on the error output and an exit code.

use std::io;
use std::path::{Path, PathBuf};

use onecycle::{Error, shown};
use onecycle_link::ReadError;

/// Exit codes, as `--help` lists them.
pub mod exit {
    /// Done; `identify`: a process was identified.
    pub const DONE: u8 = 0;
    /// Bad arguments; the argument parser uses the same code.
    pub const USAGE: u8 = 2;
    /// An input file cannot be read.
    pub const INPUT: u8 = 3;
    /// Finished, with a negative result such as "no process identified".
    pub const NO_PROCESS: u8 = 4;
    /// The output cannot be written.
    pub const OUTPUT: u8 = 5;
    /// The time stamps of a recording can be read in more than one way.
    pub const AMBIGUOUS: u8 = 6;
}

/// The reason why a command did not finish.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Arguments that contradict each other or describe no process.
    #[error("{0}")]
    Usage(String),
    /// A request that the library cannot answer.
    #[error(transparent)]
    Request(#[from] Error),
    /// Any other file that cannot be read or has the wrong content.
    #[error("{file}: {reason}", file = shown(path))]
    Unreadable { path: PathBuf, reason: String },
    /// A vehicle that is not heard, refuses, or has changed by half, with the exit code.
    #[cfg(not(target_family = "wasm"))]
    #[error("{reason}")]
    Vehicle { code: u8, reason: String },
    /// A file or the terminal that cannot be written.
    #[error("cannot write {target}: {reason}")]
    Output {
        target: String,
        #[source]
        reason: io::Error,
    },
}

impl Failure {
    #[expect(
        clippy::needless_pass_by_value,
        reason = "map_err hands errors over by value"
    )]
    pub fn usage(reason: impl ToString) -> Self {
        Self::Usage(reason.to_string())
    }

    #[expect(
        clippy::needless_pass_by_value,
        reason = "map_err hands errors over by value"
    )]
    pub fn unreadable(path: &Path, reason: impl ToString) -> Self {
        Self::Unreadable {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }

    pub fn output(target: &Path, reason: io::Error) -> Self {
        Self::Output {
            target: shown(target),
            reason,
        }
    }

    /// Whether the reader of the output has closed the pipe, as `head` does; this is not an error.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output { reason, .. } if reason.kind() == io::ErrorKind::BrokenPipe)
    }

    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => exit::USAGE,
            Self::Request(Error::Request(_)) => exit::USAGE,
            Self::Request(Error::Recording { reason, .. }) => match **reason {
                ReadError::AmbiguousTime { .. } | ReadError::AmbiguousDate { .. } => {
                    exit::AMBIGUOUS
                }
                _ => exit::INPUT,
            },
            Self::Request(_) => exit::INPUT,
            #[cfg(not(target_family = "wasm"))]
            Self::Vehicle { code, .. } => *code,
            Self::Unreadable { .. } => exit::INPUT,
            Self::Output { .. } => exit::OUTPUT,
        }
    }
}
