//! How far the loop is from instability: Nyquist's and Bode's plots.

mod bode;
mod four;
mod nyquist;

use std::f64::consts::TAU;

use onecycle::{Controller, Interval, Margins, Model};
use onecycle_design::bands::{LoopBands, loop_bands};
use onecycle_design::{LoopResponse, loop_response};
use onecycle_identify::Harmonic;

use crate::pages::page::{self, Section};
use crate::pages::plot::Figure;
use crate::report::number::seconds;

/// Points of a curve.
const POINTS: usize = 400;
/// Frequencies are shown from the gain crossover over this to the crossover times this.
const AROUND: f64 = 20.0;

/// The open loop of a controller on a model and on draws from the posterior.
pub(crate) struct Loop {
    model: Model,
    controller: Controller,
    margins: Margins,
    phase_margin_rad: Option<Interval>,
    /// Maximum sensitivity: the locus stays out of the circle of radius `1/Ms` about -1.
    ms: Option<f64>,
    omegas_rad_per_s: Vec<f64>,
    own: Vec<LoopResponse>,
    bands: Option<LoopBands>,
    /// Frequencies (rad/s) and what was measured there, times the controller.
    measured: Vec<(f64, LoopResponse)>,
    truth: Vec<LoopResponse>,
}

impl Loop {
    /// Of a controller on a model, with its margins there.
    pub(crate) fn new(model: Model, controller: Controller, margins: Margins) -> Self {
        let crossover = margins.gain_crossover_rad_per_s;
        let exponent = |k: usize| 2.0 * k as f64 / POINTS as f64 - 1.0;
        let omegas_rad_per_s: Vec<f64> = (0..=POINTS)
            .map(|k| crossover * AROUND.powf(exponent(k)))
            .collect();
        Self {
            model,
            controller,
            margins,
            phase_margin_rad: None,
            ms: None,
            own: curve(&model, &controller, &omegas_rad_per_s),
            omegas_rad_per_s,
            bands: None,
            measured: vec![],
            truth: vec![],
        }
    }

    /// With the interval of the phase margin, and a band over draws from the posterior.
    pub(super) fn within(self, draws: &[Model], phase_margin_rad: Option<Interval>) -> Self {
        let bands = loop_bands(&self.model, draws, &self.controller, &self.omegas_rad_per_s);
        Self {
            bands,
            phase_margin_rad,
            ..self
        }
    }

    /// With the circle of the maximum sensitivity.
    pub(super) fn outside(self, ms: Option<f64>) -> Self {
        Self { ms, ..self }
    }

    /// With the harmonics measured in the recording; whole turns bring their phases near the model's.
    pub(super) fn measured(self, harmonics: &[Harmonic]) -> Self {
        let point = |harmonic: &Harmonic| {
            let omega = harmonic.omega_rad_per_s;
            let feedback = self.controller.frequency_response(omega);
            let magnitude = harmonic.response.norm() * feedback.norm();
            let phase_rad = harmonic.response.arg() + feedback.arg();
            let expected_rad = loop_response(&self.model, &self.controller, omega)?.phase_rad;
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
    #[cfg(feature = "program")]
    pub(crate) fn beside(self, truth: &Model) -> Self {
        Self {
            truth: curve(truth, &self.controller, &self.omegas_rad_per_s),
            ..self
        }
    }

    pub(super) fn section(&self) -> Section {
        Section {
            id: "stability".to_owned(),
            title: "Stability".to_owned(),
            body: page::figure(&self.nyquist())
                + &page::figure(&bode::figure(self))
                + &page::row(&four::figures(self))
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

fn curve(model: &Model, controller: &Controller, omegas_rad_per_s: &[f64]) -> Vec<LoopResponse> {
    let at = |&omega: &f64| loop_response(model, controller, omega);
    omegas_rad_per_s.iter().filter_map(at).collect()
}

/// Names in the legends of both plots.
const OWN: &str = "open loop";
const TRUTH: &str = "on the true process";
const BAND: &str = "90 % band";
const MEASURED: &str = "measured under the relay";
