//! Sentences of the program: those of the library with the options of the program, and its own.

#[cfg(all(feature = "program", not(target_family = "wasm")))]
pub(crate) mod live;

use std::borrow::Cow;

use onecycle::words::{Named, named};
pub(crate) use onecycle::words::{
    answer, capital, controllers, flight, log_gains, oscillation, recording, remark, sentence,
    verdict,
};
#[cfg(feature = "program")]
pub(crate) use onecycle::words::{limits, log};

/// A text of the library with the options of the program: `` `style=calm` `` is `--style calm`.
pub fn with_options(text: &str) -> Cow<'_, str> {
    named(text, |of| match of {
        Named::Setting(name, value) => {
            let value = value.map_or(String::new(), |value| format!(" {value}"));
            format!("--{}{value}", name.replace('_', "-"))
        }
        Named::Identify(file) => format!("onecycle identify {file}"),
        Named::Log(file) => format!("onecycle log {file}"),
        _ => String::new(),
    })
}
