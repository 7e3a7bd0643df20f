//! Margins, cost, open loop and step response of a model under a controller.
//!
//! Each function chooses its method by the structure of the model and the form of the controller. An integrator with two
//! lags and dead time under a PD has exact solutions: [`soiptd_pd`]. Other pairs have none yet.

use onecycle_onboard::{Pd, Soiptd};

use crate::controller::Controller;
use crate::model::Model;
use crate::soiptd_pd;
use crate::soiptd_pd::loop_response::LoopResponse;
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::step_response::{StepResponse, StepResponseError};

/// Parameters and gains of the pair that has exact solutions. `None` for another pair.
fn process_and_pd(model: &Model, controller: &Controller) -> Option<(Soiptd, Pd)> {
    match (model, controller) {
        (Model::Soiptd(process), Controller::Pd(pd)) => Some((*process, *pd)),
        (Model::Linear(_), _) => None,
    }
}

/// Stability margins of the loop. An unstable loop has margins too: its phase margin is not positive.
///
/// `None` if the structure of the model has no method, or if the proportional gain is zero or has the wrong sign. Such a loop is unstable, and its magnitude may never
/// cross 1.
#[must_use]
pub fn margins(model: &Model, controller: &Controller) -> Option<Margins> {
    let (process, pd) = process_and_pd(model, controller)?;
    soiptd_pd::margins(&process, pd)
}

/// Integral of the squared error (ISE) of a unit step of the reference (output unit^2 s). `None` if the loop is
/// unstable, or if the structure of the model has no method.
#[must_use]
pub fn ise(model: &Model, controller: &Controller) -> Option<f64> {
    let (process, pd) = process_and_pd(model, controller)?;
    soiptd_pd::ise(&process, pd)
}

/// Open loop at a frequency (rad/s). `None` if the frequency is not positive and finite, or if [`margins`] returns
/// `None` for this loop.
#[must_use]
pub fn loop_response(
    model: &Model,
    controller: &Controller,
    omega_rad_per_s: f64,
) -> Option<LoopResponse> {
    let (process, pd) = process_and_pd(model, controller)?;
    soiptd_pd::loop_response(&process, pd, omega_rad_per_s)
}

/// Response of the continuous closed loop to a unit step of the reference, from rest.
///
/// # Errors
/// - [`StepResponseError::Unstable`]: the response grows without bound.
/// - [`StepResponseError::NoMethod`]: the structure of the model has no method.
/// - [`StepResponseError::TooSlow`]: the response takes more than 2^20 simulation steps to settle.
pub fn step_response(
    model: &Model,
    controller: &Controller,
) -> Result<StepResponse, StepResponseError> {
    let (process, pd) = process_and_pd(model, controller).ok_or(StepResponseError::NoMethod)?;
    soiptd_pd::step_response(&process, pd)
}

#[cfg(test)]
mod tests {
    use super::*;

    // The product of the frequency responses of controller and model, L = C G, to a relative 1e-12.
    #[test]
    fn the_open_loop_is_the_product_of_the_frequency_responses() {
        let model = Model::from(Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap());
        let controller = Controller::from(Pd {
            kp: 192.918,
            kd: 29.523,
        });
        for omega in [0.1, 1.0, 10.0, 40.0] {
            let found = loop_response(&model, &controller, omega).unwrap();
            let product = controller.frequency_response(omega) * model.frequency_response(omega);
            let polar = num_complex::Complex64::from_polar(found.magnitude, found.phase_rad);
            assert!((polar - product).norm() < 1e-12 * product.norm(), "{omega}");
        }
    }
}
