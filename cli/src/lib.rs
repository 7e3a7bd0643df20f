//! The program `onecycle`: identify a process from a relay test and design its optimal controller.
//!
//! Stages: `args` parses the command line, `commands` computes `results`, `report` shows them as text, JSON or HTML
//! (`pages`), and `failure` turns an error into one sentence and an exit code.
//!
//! Without the feature `program` it is the reports alone, which the Python package shows. [`studio`] is for the page of the
//! studio. The other public names are for the program `onecycle-lab`, so that both read arguments and show results in the
//! same way; nothing else may rely on them.

#[cfg(feature = "program")]
#[doc(hidden)]
pub mod args;
#[cfg(feature = "program")]
mod commands;
#[doc(hidden)]
pub mod failure;
#[doc(hidden)]
pub mod output;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod packs;
#[doc(hidden)]
pub mod pages;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod reading;
#[doc(hidden)]
pub mod report;
mod results;
#[cfg(feature = "program")]
pub mod studio;
#[doc(hidden)]
pub mod style;
#[doc(hidden)]
pub mod words;
#[cfg(feature = "program")]
#[doc(hidden)]
pub mod workers;

#[cfg(feature = "program")]
mod run;

#[cfg(feature = "program")]
pub use run::{ended, run};
