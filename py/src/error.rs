//! The exception of the package, and sentences with its keywords.

use std::cell::RefCell;

use onecycle::Error;
use onecycle::words::{Named, named};
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    _onecycle,
    OnecycleError,
    PyValueError,
    "Input that cannot be used. The message says what is wrong and what to do.\n\n\
     `kind` is 'request' (settings, arguments), 'recording' (samples or a table) or 'unreadable' (a file); `setting` the keyword \
     that the message names first, or None; `file` the file that cannot be used, or None."
);

/// The exception for a sentence.
pub(crate) fn raised(kind: &str, sentence: &str, file: Option<&str>) -> PyErr {
    let setting = RefCell::new(None);
    named(sentence, |of| {
        if let Named::Setting(name, _) = of {
            setting.borrow_mut().get_or_insert_with(|| keyword(name));
        }
        String::new()
    });
    Python::attach(|py| {
        let error = OnecycleError::new_err(with_keywords(sentence));
        let value = error.value(py);
        let set = (value.setattr("kind", kind))
            .and_then(|()| value.setattr("setting", setting.into_inner()))
            .and_then(|()| value.setattr("file", file));
        set.err().unwrap_or(error)
    })
}

pub(crate) fn refused(error: &Error) -> PyErr {
    let sentence = error.to_string();
    match error {
        Error::Recording { name, .. } => raised("recording", &sentence, Some(name)),
        Error::Unreadable { name, .. } => raised("unreadable", &sentence, Some(name)),
        _ => raised("request", &sentence, None),
    }
}

/// `from` is a word of Python.
fn keyword(name: &str) -> String {
    match name {
        "from" => "from_".to_owned(),
        name => name.to_owned(),
    }
}

/// A text of the library with what its sentences name as one calls it in Python: `` `style=calm` `` is `` `style="calm"` ``.
pub(crate) fn with_keywords(text: &str) -> String {
    named(text, as_keyword).into_owned()
}

/// A setting as a keyword.
pub(crate) fn as_keyword(of: Named<'_>) -> String {
    match of {
        Named::Setting("details", _) => "`summary()`".to_owned(),
        Named::Setting(name, None) => format!("`{}`", keyword(name)),
        Named::Setting("against", Some("KP,KI,KD")) => "`against=(kp, ki, kd)`".to_owned(),
        Named::Setting("design", Some("false" | "False")) => "`design=False`".to_owned(),
        Named::Setting(name, Some(value)) => {
            // A text that was wrapped has its keywords already.
            let is_plain = value.parse::<f64>().is_ok() || value.starts_with(['"', '(']);
            let quote = if is_plain { "" } else { "\"" };
            format!("`{}={quote}{value}{quote}`", keyword(name))
        }
        Named::Identify(file) => format!("`identify(\"{file}\")`"),
        Named::Log(file) => format!("`onecycle log {file}`"),
        _ => String::new(),
    }
}
