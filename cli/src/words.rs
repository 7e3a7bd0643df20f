//! Sentences of the program: those of the library with the options of the program, and its own.

#[cfg(all(feature = "program", not(target_family = "wasm")))]
pub(crate) mod live;

use std::borrow::Cow;
use std::sync::OnceLock;

use onecycle::words::{Named, named};
pub(crate) use onecycle::words::{
    answer, controllers, flight, log_gains, oscillation, recording, remark, sentence, verdict,
};
#[cfg(feature = "program")]
pub(crate) use onecycle::words::{limits, log};

/// Something named in a text of the library, as one asks for it.
pub type Shown = fn(Named<'_>) -> String;

/// How text reports show it, where that is not by the options of the program.
static SHOWN: OnceLock<Shown> = OnceLock::new();

/// Has the text reports of this process show settings in this way, as a package for another language calls them. The first call
/// counts.
pub fn show_settings(shown: Shown) {
    // A second call asks for the same.
    let _ = SHOWN.set(shown);
}

/// A text of the library as the text reports of this process show it.
pub(crate) fn as_shown(text: &str) -> Cow<'_, str> {
    named(text, SHOWN.get().copied().unwrap_or(option))
}

/// A text of the library with the options of the program: `` `style=calm` `` is `--style calm`.
pub fn with_options(text: &str) -> Cow<'_, str> {
    named(text, option)
}

pub(crate) fn option(of: Named<'_>) -> String {
    match of {
        Named::Setting(name, value) => {
            let value = value.map_or(String::new(), |value| format!(" {value}"));
            format!("--{}{value}", name.replace('_', "-"))
        }
        Named::Identify(file) => format!("onecycle identify {file}"),
        Named::Log(file) => format!("onecycle log {file}"),
        _ => String::new(),
    }
}
