//! Numerics of a loop of any model under any controller, with the exact dead time.
//!
//! ```text
//! L(s) = N(s)/D(s) e^(-tau s),      P = K e^(-tau s)/den(s),     C = (ki/s + kp + kd s + (kf s + k2 s^2) H(s)) F(s)
//! ```
//!
//! Time counts in units of the process, gain in units of its gain: [`Process`] holds both units. So a process of
//! microseconds and one of days give the same numbers.
//!
//! | file | content |
//! |------|---------|
//! | `polynomial` | polynomials of at most degree 13 |
//! | `process` | the process as stages; its units |
//! | `law` | the controller as gains and filters |
//! | `open_loop` | `L(jw)`, the frequencies of interest, the frequency grid |
//! | `stability` | Mikhailov's criterion |
//! | `sensitivity` | `Ms`, `Mt`, phase, gain and delay margins |
//! | `noise` | noise at the actuator |
//! | `realisation` | the loop as a state space |
//! | `propagator` | one exact step of a state space under a polynomial input |
//! | `simulation` | the loop in steps, with delayed feedback |
//! | `response` | IAE and ISE |
//! | `metrics` | overshoot, rise and settling time |
//! | `evaluation` | all of this for a given loop, in the units of the user |

pub(crate) mod evaluation;
pub(crate) mod law;
mod metrics;
pub(crate) mod noise;
pub(crate) mod open_loop;
mod polynomial;
pub(crate) mod process;
pub(crate) mod propagator;
pub(crate) mod realisation;
pub(crate) mod response;
pub(crate) mod sensitivity;
mod simulation;
pub(crate) mod stability;

#[cfg(test)]
pub(crate) mod vectors;

pub(crate) use law::Law;
pub(crate) use open_loop::OpenLoop;
pub(crate) use process::Process;
