//! Why a request cannot be answered.

use onecycle_link::{LogError, ReadError};

use crate::words;

/// Why a request cannot be answered, in one sentence. Settings stand in backticks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Settings that contradict each other, or do not go with the recording.
    #[error("{0}")]
    Request(String),
    /// A table that makes no recording.
    #[error("{}{}", located(name, reason), words::recording::refusal(reason))]
    Recording {
        /// Name of the source.
        name: String,
        /// What is wrong with it.
        #[source]
        reason: Box<ReadError>,
    },
    /// A file that cannot be read, or has the wrong content.
    #[error("{name}: {reason}")]
    Unreadable {
        /// Name of the file.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
}

impl Error {
    pub(crate) fn request(reason: impl Into<String>) -> Self {
        Self::Request(reason.into())
    }

    pub(crate) fn of_log(name: &str, error: &LogError) -> Self {
        Self::Unreadable {
            name: name.to_owned(),
            reason: words::log::refusal(error),
        }
    }
}

/// The name, unless the reason contains it.
fn located(name: &str, reason: &ReadError) -> String {
    match reason {
        ReadError::Open { .. } => String::new(),
        _ => format!("{name}: "),
    }
}
