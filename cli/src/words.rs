//! The sentences of the program: libraries return facts, these functions add what to do about them.

pub(crate) mod recording;
