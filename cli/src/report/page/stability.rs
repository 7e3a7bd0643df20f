//! How far the loop is from instability: Nyquist's and Bode's plots.

mod bode;
mod nyquist;

use std::f64::consts::TAU;

use onecycle_design::bands::{LoopBands, loop_bands};
use onecycle_design::soiptd_pd::loop_response::{LoopResponse, loop_response};
use onecycle_design::soiptd_pd::margins::Margins;
use onecycle_identify::Harmonic;
use onecycle_identify::Interval;
use onecycle_onboard::{Pd, Soiptd};

use crate::pages::page::{self, Section};
use crate::pages::plot::Figure;
use crate::report::number::seconds;

/// Points of a curve.
const POINTS: usize = 400;
/// Frequencies are shown from the gain crossover over this to the crossover times this.
const AROUND: f64 = 20.0;

/// The open loop of a controller on a process, and on all that the process may be.
pub(crate) struct Loop<'a> {
    process: &'a Soiptd,
    pd: Pd,
    margins: Margins,
    phase_margin_rad: Option<Interval>,
    omegas_rad_per_s: Vec<f64>,
    own: Vec<LoopResponse>,
    bands: Option<LoopBands>,
    /// Frequencies (rad/s) and what was measured there, times the controller.
    measured: Vec<(f64, LoopResponse)>,
    truth: Vec<LoopResponse>,
}

impl<'a> Loop<'a> {
    /// Of a controller on a process, with its margins there.
    pub(crate) fn new(process: &'a Soiptd, pd: Pd, margins: Margins) -> Self {
        let crossover = margins.gain_crossover_rad_per_s;
        let exponent = |k: usize| 2.0 * k as f64 / POINTS as f64 - 1.0;
        let omegas_rad_per_s: Vec<f64> = (0..=POINTS)
            .map(|k| crossover * AROUND.powf(exponent(k)))
            .collect();
        Self {
            process,
            pd,
            margins,
            phase_margin_rad: None,
            own: curve(process, pd, &omegas_rad_per_s),
            omegas_rad_per_s,
            bands: None,
            measured: vec![],
            truth: vec![],
        }
    }

    /// With the interval of the phase margin, and a band about all that the process may be.
    pub(super) fn within(self, draws: &[Soiptd], phase_margin_rad: Interval) -> Self {
        let bands = loop_bands(self.process, draws, self.pd, &self.omegas_rad_per_s);
        Self {
            bands,
            phase_margin_rad: Some(phase_margin_rad),
            ..self
        }
    }

    /// With what a recording says of the process itself; phases are turned to the model's.
    pub(super) fn measured(self, harmonics: &[Harmonic]) -> Self {
        let point = |harmonic: &Harmonic| {
            let omega = harmonic.omega_rad_per_s;
            let (kp, kd) = (self.pd.kp, self.pd.kd * omega);
            let magnitude = harmonic.response.norm() * kp.hypot(kd);
            let phase_rad = harmonic.response.arg() + kd.atan2(kp);
            let expected_rad = loop_response(self.process, self.pd, omega)?.phase_rad;
            let turns = ((expected_rad - phase_rad) / TAU).round();
            let phase_rad = phase_rad + turns * TAU;
            Some((
                omega,
                LoopResponse {
                    magnitude,
                    phase_rad,
                },
            ))
        };
        Self {
            measured: harmonics.iter().filter_map(point).collect(),
            ..self
        }
    }

    /// With the loop of the process that was simulated.
    pub(crate) fn beside(self, truth: &Soiptd) -> Self {
        Self {
            truth: curve(truth, self.pd, &self.omegas_rad_per_s),
            ..self
        }
    }

    pub(super) fn section(&self) -> Section {
        Section {
            id: "stability".to_owned(),
            title: "Stability".to_owned(),
            body: page::figure(&self.nyquist())
                + &page::figure(&bode::figure(self))
                + &page::facts(&self.facts()),
        }
    }

    pub(crate) fn nyquist(&self) -> Figure {
        nyquist::figure(self)
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        let Margins {
            delay_margin_s,
            gain_crossover_rad_per_s,
            phase_crossover_rad_per_s,
            ..
        } = self.margins;
        let at = |omega: f64| format!("at {omega:.2} rad/s");
        let crossover = at(gain_crossover_rad_per_s);
        let mut facts = vec![
            (
                "phase margin",
                format!("{} {crossover}", self.phase_margin()),
            ),
            (
                "delay margin",
                format!("{} more dead time", seconds(delay_margin_s)),
            ),
        ];
        if let (Some(gain_margin), Some(omega)) = (self.gain_margin(), phase_crossover_rad_per_s) {
            facts.push(("gain margin", format!("{gain_margin} {}", at(omega))));
        }
        facts
    }

    fn phase_margin(&self) -> String {
        phase_margin(&self.margins, self.phase_margin_rad.as_ref())
    }

    fn gain_margin(&self) -> Option<String> {
        let factor = self.margins.gain_margin?;
        Some(format!("{factor:.2} ({:.1} dB)", 20.0 * factor.log10()))
    }
}

/// The phase margin with its interval.
pub(super) fn phase_margin(margins: &Margins, within_rad: Option<&Interval>) -> String {
    let margin = margins.phase_margin_rad.to_degrees();
    match within_rad {
        Some(Interval {
            low: Some(low),
            high: Some(high),
            ..
        }) => format!(
            "{margin:.1} deg ({:.1} .. {:.1})",
            low.to_degrees(),
            high.to_degrees()
        ),
        _ => format!("{margin:.1} deg"),
    }
}

fn curve(process: &Soiptd, pd: Pd, omegas_rad_per_s: &[f64]) -> Vec<LoopResponse> {
    let at = |&omega: &f64| loop_response(process, pd, omega);
    omegas_rad_per_s.iter().filter_map(at).collect()
}

/// Names in the legends of both plots.
const OWN: &str = "open loop";
const TRUTH: &str = "on the true process";
const BAND: &str = "90 % band";
const MEASURED: &str = "measured under the relay";
