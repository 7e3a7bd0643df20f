//! What the likelihood adds to the report of an identification.

use onecycle_identify as identify;
use onecycle_identify::{Hold, Innovations, Recorded};
use serde::Serialize;

use super::Parameters;

/// The part of a recording that was used.
#[derive(Serialize)]
pub(super) struct Record {
    start_s: f64,
    end_s: f64,
    sample_s: f64,
    samples: usize,
    absent: usize,
    outliers: usize,
    samples_per_row: usize,
    hold: &'static str,
    input_deviation: f64,
    output_deviation: f64,
    informative_from_rad_per_s: Option<f64>,
    informative_to_rad_per_s: Option<f64>,
}

impl From<&Recorded> for Record {
    fn from(of: &Recorded) -> Self {
        Self {
            start_s: of.start_s,
            end_s: of.end_s,
            sample_s: of.sample_s,
            samples: of.samples,
            absent: of.absent,
            outliers: of.outliers,
            samples_per_row: of.samples_per_row,
            hold: Hold::name(of.hold),
            input_deviation: of.input_deviation,
            output_deviation: of.output_deviation,
            informative_from_rad_per_s: of.informative_rad_per_s.map(|(low, _)| low),
            informative_to_rad_per_s: of.informative_rad_per_s.map(|(_, high)| high),
        }
    }
}

/// Intensities in rad/s, null where there is no such noise.
#[derive(Serialize)]
pub(super) struct Noise {
    kind: String,
    sigma: f64,
    w1: Option<f64>,
    w0: Option<f64>,
    wy: Option<f64>,
}

impl From<&identify::Noise> for Noise {
    fn from(of: &identify::Noise) -> Self {
        Self {
            kind: of.kind(),
            sigma: of.sigma,
            w1: of.w1_rad_per_s,
            w0: of.w0_rad_per_s,
            wy: of.wy_rad_per_s,
        }
    }
}

/// Best fit of a structure.
#[derive(Serialize)]
pub(super) struct Alternative {
    structure: &'static str,
    bic: f64,
    process: Parameters<Option<f64>>,
    noise: Noise,
}

impl From<&identify::Alternative> for Alternative {
    fn from(of: &identify::Alternative) -> Self {
        Self {
            structure: of.model.structure().name(),
            bic: of.bic,
            process: Parameters::of_model(&of.model),
            noise: Noise::from(&of.noise),
        }
    }
}

/// Tests of the innovations.
#[derive(Serialize)]
pub(super) struct Tests {
    log_likelihood: f64,
    autocorrelation: f64,
    ljung_box: f64,
    input_share: f64,
    input_f: f64,
    widened: f64,
    drag: Option<f64>,
    friction: Option<f64>,
    thrust: Option<f64>,
    thrust_about: Option<f64>,
}

impl From<&Innovations> for Tests {
    fn from(of: &Innovations) -> Self {
        Self {
            log_likelihood: of.log_likelihood,
            autocorrelation: of.whiteness.autocorrelation,
            ljung_box: of.whiteness.ljung_box,
            input_share: of.whiteness.input_share,
            input_f: of.whiteness.input_f,
            widened: of.widened,
            drag: of.nonlinear.drag,
            friction: of.nonlinear.friction,
            thrust: of.nonlinear.thrust,
            thrust_about: of.nonlinear.thrust.map(|_| of.nonlinear.middle),
        }
    }
}

/// The fit row by row.
#[derive(Serialize)]
pub(super) struct Rows {
    time_s: Vec<f64>,
    measured: Vec<f64>,
    simulated: Vec<f64>,
    predicted: Vec<f64>,
    innovation: Vec<f64>,
    disturbance: Vec<f64>,
}

impl From<&Innovations> for Rows {
    fn from(of: &Innovations) -> Self {
        let rows = &of.rows;
        Self {
            time_s: rows.iter().map(|row| row.time_s).collect(),
            measured: rows.iter().map(|row| row.measured).collect(),
            simulated: rows.iter().map(|row| row.simulated).collect(),
            predicted: rows.iter().map(|row| row.predicted).collect(),
            innovation: rows.iter().map(|row| row.innovation).collect(),
            disturbance: rows.iter().map(|row| row.disturbance).collect(),
        }
    }
}
