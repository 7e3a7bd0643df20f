//! Results as text for people and as JSON for programs.

pub(crate) mod json;
pub(crate) mod number;
pub(crate) mod text;
