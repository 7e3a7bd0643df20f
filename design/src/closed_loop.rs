//! Margins, cost, open loop and responses of a model under a controller.
//!
//! Each function chooses its method by the structure of the model and the form of the controller. An integrator with two
//! lags and dead time under a PD without filter has exact solutions: [`soiptd_pd`]. All other pairs go through one set of
//! numerics that keeps the dead time exact: margins to rounding, integrals of responses to a relative 1e-8.

use onecycle_onboard::{Pd, Soiptd};

use crate::analysis::evaluation::Loop;
use crate::analysis::sensitivity::Sensitivity;
use crate::controller::Controller;
use crate::model::Model;
use crate::soiptd_pd;
use crate::soiptd_pd::loop_response::LoopResponse;
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::step_metrics::StepMetrics;
use crate::soiptd_pd::step_response::{StepResponse, StepResponseError};

pub use crate::analysis::evaluation::LoadResponse;

/// Parameters and gains of the pair that has exact solutions. `None` for another pair.
fn process_and_pd(model: &Model, controller: &Controller) -> Option<(Soiptd, Pd)> {
    match (model, controller) {
        (Model::Soiptd(process), Controller::Pd(pd)) => Some((*process, *pd)),
        _ => None,
    }
}

/// Stability margins of the loop. For an integrator with two lags under a PD without filter, an unstable loop has margins
/// too: its phase margin is not positive.
///
/// `None` if the proportional gain of such a PD is zero or has the wrong sign, and for any other pair if the loop is
/// unstable.
#[must_use]
pub fn margins(model: &Model, controller: &Controller) -> Option<Margins> {
    match process_and_pd(model, controller) {
        Some((process, pd)) => soiptd_pd::margins(&process, pd),
        None => Loop::new(model, controller)?.margins(),
    }
}

/// Peaks of sensitivity and complementary sensitivity, `Ms` and `Mt`. `None` if the loop is unstable.
#[must_use]
pub fn sensitivity(model: &Model, controller: &Controller) -> Option<Sensitivity> {
    Loop::new(model, controller)?.sensitivity()
}

/// Integral of the squared error (ISE) of a unit step of the reference (output unit^2 s). `None` if the loop is
/// unstable, or does not reach the reference.
#[must_use]
pub fn ise(model: &Model, controller: &Controller) -> Option<f64> {
    match process_and_pd(model, controller) {
        Some((process, pd)) => soiptd_pd::ise(&process, pd),
        None => Some(Loop::new(model, controller)?.reference_integrals()?.1),
    }
}

/// Integral of the absolute error (IAE) of a unit step of the reference (output unit s). `None` if the loop is unstable,
/// or does not reach the reference.
#[must_use]
pub fn reference_iae(model: &Model, controller: &Controller) -> Option<f64> {
    Some(Loop::new(model, controller)?.reference_integrals()?.0)
}

/// Integral of the absolute error (IAE) of a unit step of the load, at the input of the process (output unit s). `None` if
/// the loop is unstable, or has no integral term: then the error stays.
#[must_use]
pub fn load_iae(model: &Model, controller: &Controller) -> Option<f64> {
    Some(Loop::new(model, controller)?.load_integrals()?.0)
}

/// Standard deviation of the output of the controller per standard deviation of white measurement noise that is sampled
/// every `sample_period_s` seconds (input unit / output unit). `None` if the loop is unstable or the period is not
/// positive.
#[must_use]
pub fn noise_amplification(
    model: &Model,
    controller: &Controller,
    sample_period_s: f64,
) -> Option<f64> {
    Loop::new(model, controller)?.noise_amplification(sample_period_s)
}

/// Open loop at a frequency (rad/s). `None` if the frequency is not positive and finite, or if the gains or the
/// parameters of the model are out of range. For an integrator with two lags under a PD without filter: `None` also if
/// [`margins`] returns `None`.
#[must_use]
pub fn loop_response(
    model: &Model,
    controller: &Controller,
    omega_rad_per_s: f64,
) -> Option<LoopResponse> {
    match process_and_pd(model, controller) {
        Some((process, pd)) => soiptd_pd::loop_response(&process, pd, omega_rad_per_s),
        None => Loop::new(model, controller)?.response_at(omega_rad_per_s),
    }
}

/// Response of the closed loop to a unit step of the reference, from rest. If the loop settles at another value than the
/// reference, the metrics refer to that value and the ISE is infinite.
///
/// # Errors
/// - [`StepResponseError::Unstable`]: the response grows without bound.
/// - [`StepResponseError::NoMethod`]: the parameters of the loop are out of range.
/// - [`StepResponseError::TooSlow`]: the response takes more than 2^20 simulation steps to settle.
pub fn step_response(
    model: &Model,
    controller: &Controller,
) -> Result<StepResponse, StepResponseError> {
    match process_and_pd(model, controller) {
        Some((process, pd)) => soiptd_pd::step_response(&process, pd),
        None => Loop::new(model, controller)
            .ok_or(StepResponseError::NoMethod)?
            .step_response(),
    }
}

/// Characteristics of [`step_response`] alone, several times as fast.
///
/// # Errors
/// The errors of [`step_response`].
pub fn step_metrics(
    model: &Model,
    controller: &Controller,
) -> Result<StepMetrics, StepResponseError> {
    match process_and_pd(model, controller) {
        Some((process, pd)) => Ok(soiptd_pd::step_response(&process, pd)?.metrics),
        None => Loop::new(model, controller)
            .ok_or(StepResponseError::NoMethod)?
            .step_metrics(),
    }
}

/// Response of the closed loop to a unit step of the load, at the input of the process, from rest.
///
/// # Errors
/// The errors of [`step_response`].
pub fn load_response(
    model: &Model,
    controller: &Controller,
) -> Result<LoadResponse, StepResponseError> {
    Loop::new(model, controller)
        .ok_or(StepResponseError::NoMethod)?
        .load_response()
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
