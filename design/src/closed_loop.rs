//! Any model under any controller: margins, cost, open loop, step response.
//!
//! Each function chooses the method by structure and form. An integrator with two lags and a delay under a PD has exact
//! solutions of its own, in [`soiptd_pd`].

use onecycle_onboard::{Pd, Soiptd};

use crate::controller::Controller;
use crate::model::Model;
use crate::soiptd_pd::loop_response::LoopResponse;
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::step_response::{StepResponse, StepResponseError};
use crate::soiptd_pd::{self};

/// The pair that has exact solutions.
fn soiptd_pd(model: &Model, controller: &Controller) -> (Soiptd, Pd) {
    let (Model::Soiptd(process), Controller::Pd(pd)) = (model, controller);
    (*process, *pd)
}

/// Margins of the loop, stable or not.
///
/// `None` where the proportional gain is zero or of the wrong sign: the loop is unstable and need not cross `|L| = 1`.
#[must_use]
pub fn margins(model: &Model, controller: &Controller) -> Option<Margins> {
    let (process, pd) = soiptd_pd(model, controller);
    soiptd_pd::margins(&process, pd)
}

/// Integral of the squared error of a unit step of the reference (output unit^2 s); `None` where the loop is unstable.
#[must_use]
pub fn ise(model: &Model, controller: &Controller) -> Option<f64> {
    let (process, pd) = soiptd_pd(model, controller);
    soiptd_pd::ise(&process, pd)
}

/// The open loop at a positive frequency (rad/s); `None` where [`margins`] has none or the frequency is not positive.
#[must_use]
pub fn loop_response(
    model: &Model,
    controller: &Controller,
    omega_rad_per_s: f64,
) -> Option<LoopResponse> {
    let (process, pd) = soiptd_pd(model, controller);
    soiptd_pd::loop_response(&process, pd, omega_rad_per_s)
}

/// Response of the continuous closed loop to a unit step of the reference, from rest.
///
/// # Errors
/// [`StepResponseError::Unstable`] where it grows without bound, [`StepResponseError::TooSlow`] where it takes over a
/// million steps to settle.
pub fn step_response(
    model: &Model,
    controller: &Controller,
) -> Result<StepResponse, StepResponseError> {
    let (process, pd) = soiptd_pd(model, controller);
    soiptd_pd::step_response(&process, pd)
}

#[cfg(test)]
mod tests {
    use super::*;

    // L = C G by the frequency responses of both, to 1e-12: the same loop as the exact road's.
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
