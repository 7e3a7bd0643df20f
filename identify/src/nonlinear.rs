//! Nonlinear forces of a process.

/// Nonlinear forces that act where the disturbance does. Each is `None` unless the recording asks for it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Nonlinear {
    /// Coefficient `c` of a drag `-c v |v|` on the rate `v` of the output, beside the linear damping (1/output unit).
    pub drag: Option<f64>,
    /// Dry friction: the input (input unit) that it takes to overcome it.
    pub friction: Option<f64>,
    /// Coefficient `c` of a thrust `d + c d^2`, where `d` is the lagged input less [`middle`](Self::middle) (1/input unit).
    pub thrust: Option<f64>,
    /// Mean input, at which the gain is the slope of the thrust (input unit).
    pub middle: f64,
}
