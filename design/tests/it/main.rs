//! Tests of the public interface: exact solutions against hand calculations, quadrature and random processes.

#![expect(
    clippy::unwrap_used,
    reason = "the lint does not recognise helper functions as parts of tests"
)]

mod campaign;
mod cost;
mod designs;
mod loops;
mod properties;
mod random;
mod robust;
mod step_response;
mod values;
