//! Tests of the reader through its public interface.

mod averaging;
mod dialects;
mod hostile;
mod refusals;
