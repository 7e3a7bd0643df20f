//! The truth of a simulation, as comment lines at the head of its recording.

use onecycle_design::{Model, Parameter, Structure};

use super::plan::Plan;
use crate::args::{Excitation, Inject, Simulate};

/// The true process, the test and the disturbances, one subject a line.
pub(super) fn head(arguments: &Simulate, plan: &Plan) -> String {
    let experiment = &plan.experiment;
    let mut lines = vec![
        format!(
            "simulated {} test: onecycle {}",
            arguments.excitation.name(),
            env!("CARGO_PKG_VERSION")
        ),
        format!("process: {}", process(&plan.model)),
        excitation(arguments),
        format!(
            "input_bias {}, noise_sigma {}, quantum {}, jitter {}, seed {}",
            experiment.input_bias,
            experiment.sensor.noise_sigma,
            experiment.sensor.quantum,
            experiment.jitter,
            arguments.seed
        ),
    ];
    if let Some(gains) = arguments.closed {
        let place = match arguments.inject.unwrap_or(Inject::Input) {
            Inject::Input => "input",
            Inject::Setpoint => "setpoint",
        };
        lines.push(format!(
            "loop: kp {}, kd {}, filter_s {}, reference {}, test signal at the {place}",
            gains.kp, gains.kd, gains.filter_s, experiment.reference
        ));
    }
    let disturbances = &experiment.disturbances;
    if !disturbances.is_none() {
        lines.push(format!(
            "disturbance: input_walk {}, input_white {}, output_walk {}, gust_sigma {}, gust_correlation_s {}",
            disturbances.input_walk,
            disturbances.input_white,
            disturbances.output_walk,
            disturbances.gust_sigma,
            disturbances.gust_correlation_s
        ));
    }
    let (process, sensor) = (plan.model.linear(), &experiment.sensor);
    let relative = disturbances.bandwidths(&process, sensor.noise_sigma, experiment.sample_s);
    if let Some(w) = relative.filter(|w| *w != Default::default()) {
        lines.push(format!(
            "disturbance relative to the noise: w1_rad_per_s {}, w0_rad_per_s {}, wy_rad_per_s {}",
            w.w1_rad_per_s, w.w0_rad_per_s, w.wy_rad_per_s
        ));
    }
    if sensor.outlier_share > 0.0 || sensor.drop_out_share > 0.0 {
        lines.push(format!(
            "sensor: outlier_share {}, outlier_size {}, drop_out_share {}",
            sensor.outlier_share, sensor.outlier_size, sensor.drop_out_share
        ));
    }
    lines.join("\n")
}

fn process(model: &Model) -> String {
    let number = |parameter: &Parameter| {
        let value = model.parameter(*parameter).unwrap_or(f64::NAN);
        let text = if value.is_finite() {
            value.to_string()
        } else {
            "infinite".to_owned()
        };
        format!("{} {text}", parameter.key())
    };
    let numbers: Vec<_> = model.structure().parameters().iter().map(number).collect();
    match model.structure() {
        Structure::Soiptd => numbers.join(", "),
        structure => format!("structure {}, {}", structure.name(), numbers.join(", ")),
    }
}

fn excitation(arguments: &Simulate) -> String {
    let amplitude = arguments.amplitude;
    if arguments.excitation == Excitation::Relay {
        let trim = if arguments.no_trim { "off" } else { "on" };
        let second = (arguments.second_amplitude).map_or(String::new(), |second| {
            format!(", second_amplitude {second}")
        });
        return format!(
            "relay: amplitude {amplitude}{second}, beta {}, trim {trim}",
            arguments.beta
        );
    }
    let name = arguments.excitation.name();
    let mut text = format!(
        "{name}: amplitude {amplitude}, start_s {}",
        arguments.preroll
    );
    if let Some(pulse_s) = arguments.pulse {
        text += &format!(", pulse_s {pulse_s}");
    }
    if let Some(band) = arguments.band {
        text += &format!(", low_hz {}, high_hz {}", band.low_hz, band.high_hz);
    }
    text
}
