//! `onecycle simulate --expect`: the intervals to expect from a test.

use std::ops::ControlFlow;

use onecycle_identify::{Hold, Noise, expected};
use onecycle_plant::Noise as Source;

use super::plan::{self, LARGEST, Plan};
use crate::args::Simulate;
use crate::failure::Failure;
use crate::report::{json, text};

/// Largest number of samples of a test to plan.
const MOST_SAMPLES: f64 = 4e6;

/// Table of the parameters with the intervals to expect, or JSON.
pub(super) fn text(arguments: &Simulate, plan: &Plan) -> Result<String, Failure> {
    let sigma = plan.experiment.sensor.noise_sigma;
    if sigma <= 0.0 {
        return Err(Failure::usage(
            "--expect needs the noise of the measurement: without noise every interval is zero; give --noise",
        ));
    }
    if plan.experiment.duration_s * arguments.sample_rate > MOST_SAMPLES {
        return Err(Failure::usage(
            "--expect computes tests of at most 4 million samples: lower --sample-rate or --duration",
        ));
    }
    if arguments.gust.is_some() {
        return Err(Failure::usage(
            "--expect knows the disturbances of --disturbance only: give the gusts as walk or white there",
        ));
    }
    let input = input(arguments, plan)?;
    let linear = plan.model.linear();
    let sample_s = plan.experiment.sample_s;
    let disturbances = plan.experiment.disturbances;
    let frequencies = disturbances
        .bandwidths(&linear, sigma, sample_s)
        .unwrap_or_default();
    let positive = |w: f64| Some(w).filter(|w| *w > 0.0);
    let noise = Noise::new(
        sigma,
        positive(frequencies.w1_rad_per_s),
        positive(frequencies.w0_rad_per_s),
        positive(frequencies.wy_rad_per_s),
    );
    let estimate = expected(&plan.model, &noise, &input, sample_s, Hold::Held).ok_or_else(|| {
        Failure::usage(
            "this test does not tell the parameters: excite the process longer, stronger or at more frequencies",
        )
    })?;
    Ok(match arguments.json {
        true => json::to_text(&onecycle::json::parameters(&estimate)),
        false => text::expected(&plan.model, &estimate),
    })
}

/// Input of the process during the test with its bias, one value a sample: a loop cancels the bias, and a mean of the
/// commanded input alone would tell more than the test does.
fn input(arguments: &Simulate, plan: &Plan) -> Result<Vec<f64>, Failure> {
    let mut input = Vec::new();
    let mut end = Ok(());
    let mut controller = plan.controller(arguments)?;
    let mut noise = Source::from_seed(arguments.seed);
    plan.experiment.observe(&mut controller, &mut noise, |row| {
        if row.input.abs() <= LARGEST {
            input.push(row.input + plan.experiment.input_bias);
            ControlFlow::Continue(())
        } else {
            end = Err(plan::diverged(arguments, row.time_s));
            ControlFlow::Break(())
        }
    });
    end.map(|()| input)
}
