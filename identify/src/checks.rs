//! Checks of a result against what its fit cannot see.
//!
//! ```text
//! sampling       samples that were not taken at their stamps scatter more where the output is steep             sampling
//! clocks         an input that was logged late looks like less dead time: the relay's own law tells     clock
//! frequencies    a resonance above the frequencies that the recording excites does not show             extrapolation
//! amplitudes     a fit does not show how an actuator's gain depends on its size, unless two are compared  amplitude
//! limits         what the controller asks for: gain margin, noise at the actuator, input of a step      limits
//! ```

use std::f64::consts::TAU;

use onecycle_design::{Controller, Model, loop_response, margins, noise_amplification};
use onecycle_onboard::pack::Pack;

use crate::assumed::MOST_EXTRAPOLATION;
use crate::excitation::{Excitation, Switching};
use crate::outcome::{Identification, Identified};
use crate::relay::law::Law;
use crate::remark::Remark;
use crate::sampling;
use crate::settings::Options;
use crate::signals::Signals;
use crate::thresholds::{
    EXTRAPOLATED, LEADING, LEAST_ASYMMETRY, LEAST_GAIN_MARGIN, MOST_LATE_S, MOST_NOISE,
    MUCH_BETWEEN_RAD,
};
use crate::verdict::Verdict;

/// How early and how late a relay may switch after the output has reached its ratio, with both columns on one clock.
#[derive(Clone, Copy)]
struct Tolerance {
    /// Largest lead in a recording without noise, as a share of the period.
    early: f64,
    /// Lead for each unit of noise over amplitude, as a share of the period: noise makes a relay without averaging switch
    /// early. Near the ratio -0.72 the output moves by the amplitude in 0.23 of a period, and the first of some samples to
    /// exceed the ratio is 2.5 standard deviations off.
    early_per_noise: f64,
    /// Largest lag, as a share of the period: a relay that averages the error over 3 % of its half period lags by that.
    late: f64,
}

/// No remark is needed.
const USUAL: Tolerance = Tolerance {
    early: 0.002,
    early_per_noise: 0.6,
    late: 0.0085,
};
/// Beyond it both columns are not on one clock.
const AT_MOST: Tolerance = Tolerance {
    early: 0.02,
    early_per_noise: 1.0,
    late: 0.015,
};
/// Rounding of the limit of a crossover.
const ROUNDING: f64 = 1.01;

/// Adds to a result what its fit cannot see, and withdraws what rests on too little.
pub(crate) fn check(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
    found: &mut Identification,
) {
    let oscillation = found.oscillation().copied();
    let Ok(identified) = &mut found.outcome else {
        return;
    };
    let Some(excitation) = &found.excitation else {
        return;
    };
    // The relay's law holds over its steady oscillation, or else over the part of the recording that was used.
    let seen = match (oscillation, excitation) {
        (Some(found), _) => Some(((found.start_s, found.end_s), found.amplitude)),
        (None, Excitation::Recorded(used)) => {
            Some(((used.start_s, used.end_s), used.output_deviation))
        }
        (None, Excitation::Relay { .. }) => None,
    };
    let rises = identified.model.linear().gain() > 0.0;
    let law = seen.and_then(|(span_s, _)| Law::find(signals, span_s, rises));
    let leads = law.as_ref().is_some_and(|law| law.mean_beta() < LEADING);
    found.switching = law.as_ref().and_then(Law::switching);
    if let Some((switching, pack)) = found.switching.zip(pack) {
        without_family(&switching, pack, &mut found.remarks);
    }
    let symmetric = law.filter(Law::is_symmetric).zip(found.switching);
    if let Some((law, switching)) = symmetric {
        let sigma = oscillation.map_or_else(
            || (identified.specification.noise).map_or(0.0, |noise| noise.std),
            |oscillation| oscillation.noise_sigma,
        );
        let noise = seen.map_or(0.0, |(_, size)| sigma / size);
        let clock = Clock {
            law,
            switching,
            noise,
        };
        match clock.judge(options, pack, identified) {
            Ok(remark) => found.remarks.extend(remark),
            Err(verdict) => {
                found.refuse(verdict);
                return;
            }
        }
    } else if options.input_late_s.is_none() {
        found.remarks.extend(unchecked(identified));
    }
    if found.switching.is_some() && options.hold.is_none() && options.input_late_s.is_none() {
        let crossover = identified
            .design
            .map(|design| design.margins.gain_crossover_rad_per_s);
        let cost_rad = crossover.map(|crossover| crossover * signals.sample_period_s);
        let much = cost_rad.filter(|cost| *cost > MUCH_BETWEEN_RAD);
        found
            .remarks
            .extend(much.map(Remark::SwitchesBetweenSamples));
    }
    if let Some(excited) = excitation.highest_rad_per_s() {
        found
            .remarks
            .extend(extrapolation(excited, leads, identified));
    }
    // Two amplitudes are compared where there are two: see `judge`.
    found.remarks.push(Remark::OneAmplitude);
    let period_s = excitation.highest_rad_per_s().map(|omega| TAU / omega);
    let jitter = period_s.and_then(|period_s| sampling::jitter(signals, period_s));
    found.remarks.extend(jitter.map(Remark::Jitter));
    limits(excitation, identified, &mut found.remarks);
}

/// The pack does not know the cycles of a relay with another ratio: that they are unlike those of its family says nothing.
fn without_family(switching: &Switching, pack: &Pack<'_>, remarks: &mut [Remark]) {
    /// Distance of the ratio from those of the pack. Averaging and noise change it by less.
    const FAR: f64 = 0.2;
    let [lowest, highest] = pack.domain().beta.map(f64::from);
    if (lowest - FAR..=highest + FAR).contains(&switching.beta) {
        return;
    }
    for remark in remarks {
        if matches!(remark, Remark::Unknown(_)) {
            *remark = Remark::Unread;
        }
    }
}

/// Nothing shows whether both columns are on one clock, which a controller would feel.
fn unchecked(identified: &Identified) -> Option<Remark> {
    let design = identified.design?;
    Some(Remark::ClockUnchecked {
        rad_per_s: design.margins.gain_crossover_rad_per_s,
    })
}

/// The relay's law, against what is known of the relay.
struct Clock<'a> {
    law: Law<'a>,
    switching: Switching,
    /// Noise over the amplitude of the output.
    noise: f64,
}

impl Clock<'_> {
    /// A remark, or the reason to refuse the recording.
    fn judge(
        &self,
        options: &Options,
        pack: Option<&Pack<'_>>,
        identified: &Identified,
    ) -> Result<Option<Remark>, Verdict> {
        if options.input_late_s.is_some() {
            return Ok(None);
        }
        let seen = self.switching.beta;
        if let Some(beta) = options.beta {
            return match self.is_that_of(beta, AT_MOST) {
                true if self.is_that_of(beta, USUAL) => Ok(None),
                false if !self.has_halved(beta) => Err(Verdict::ClockOffset {
                    seen,
                    beta,
                    late_s: self.law.late_s(beta),
                }),
                _ => Ok(Some(self.remark(beta, identified))),
            };
        }
        let leading =
            pack.map(|pack| f64::from(0.5 * (pack.domain().beta[0] + pack.domain().beta[1])));
        let mut usual = leading.into_iter().chain([0.0]);
        if usual.any(|beta| self.is_that_of(beta, USUAL)) {
            return Ok(None);
        }
        // Of a slow process, hysteresis and no clock.
        let late_s = self.law.late_s(0.0).unwrap_or(self.law.period_s());
        if seen > 0.0 && late_s > MOST_LATE_S {
            return Ok(unchecked(identified));
        }
        let has_hysteresis = seen > LEADING;
        let beta = leading.filter(|_| !has_hysteresis).unwrap_or(0.0);
        let remark = self.remark(beta, identified);
        match remark {
            // Only a relay that leads is made by few other programs than ours.
            Remark::ClockUnknown {
                late_s: Some(late_s),
                phase_margin_rad: None,
                ..
            } if !has_hysteresis && identified.design.is_some() && !self.has_halved(beta) => {
                Err(Verdict::ClockOffset {
                    seen,
                    beta,
                    late_s: Some(late_s),
                })
            }
            remark => Ok(Some(remark)),
        }
    }

    /// What it means if the relay has this `beta`.
    fn remark(&self, beta: f64, identified: &Identified) -> Remark {
        let late_s = self.law.late_s(beta);
        let later = late_s.map(|late_s| delayed(&identified.model, late_s));
        let controller = identified.design.map(|design| design.controller);
        Remark::ClockUnknown {
            seen: self.switching.beta,
            beta,
            late_s,
            phase_margin_rad: (later.zip(controller))
                .and_then(|(model, controller)| margin_rad(&model, &controller)),
            rad_per_s: (identified.design).map(|design| design.margins.gain_crossover_rad_per_s),
        }
    }

    /// Whether a relay that began with this `beta` may have halved it: that of the board does where the output turns back
    /// before it has crossed zero, against a bias on one side only. The ratio of a cycle is then the mean of both sides.
    fn has_halved(&self, beta: f64) -> bool {
        const MOST_HALVINGS: i32 = 3;
        let is_one_sided = self.law.asymmetry() > LEAST_ASYMMETRY;
        let is_that = |share: f64| self.is_that_of(share * beta, USUAL);
        beta < LEADING
            && (1..=MOST_HALVINGS).any(|n| {
                let share = 0.5_f64.powi(n);
                is_that(share) || (is_one_sided && is_that(0.5 * (1.0 + share)))
            })
    }

    /// Whether a relay with this `beta` may have made the recording, with both columns on one clock.
    fn is_that_of(&self, beta: f64, tolerance: Tolerance) -> bool {
        let (period_s, sample_s) = (self.law.period_s(), self.law.sample_s());
        let early = tolerance.early + tolerance.early_per_noise * self.noise;
        let late_s = self.law.late_s(beta);
        late_s.is_some_and(|late_s| {
            late_s > -(early * period_s + sample_s) && late_s < tolerance.late * period_s + sample_s
        })
    }
}

/// The model with more dead time (s), at least zero.
fn delayed(model: &Model, late_s: f64) -> Model {
    let linear = model.linear();
    Model::from(linear.with_tau_s((linear.tau_s() + late_s).max(0.0)))
}

/// Phase margin (rad). `None` if the loop is unstable.
fn margin_rad(model: &Model, controller: &Controller) -> Option<f64> {
    margins(model, controller)
        .map(|margins| margins.phase_margin_rad)
        .filter(|margin| *margin > 0.0)
}

/// Compares the crossover with the highest excited frequency (rad/s). A controller too far beyond is withdrawn, unless the
/// relay `leads`.
fn extrapolation(excited: f64, leads: bool, identified: &mut Identified) -> Option<Remark> {
    let design = identified.design?;
    identified.resonance = resonance(&identified.model, &design.controller, excited);
    let ratio = design.margins.gain_crossover_rad_per_s / excited;
    let is_withdrawn = ratio > ROUNDING * MOST_EXTRAPOLATION && !leads;
    if is_withdrawn {
        identified.design = None;
        identified.phase_margin_rad = None;
        identified.step = None;
        identified.resonance = None;
    }
    (ratio > EXTRAPOLATED).then_some(Remark::Extrapolated {
        ratio,
        is_withdrawn,
    })
}

/// Largest factor by which a resonance above 1.5 times the frequency `excited` (rad/s) may raise the response of the
/// process before the loop becomes unstable: `1 + 1/|T|`, by the small-gain theorem.
fn resonance(model: &Model, controller: &Controller, excited: f64) -> Option<f64> {
    const DECADES: f64 = 1.5;
    const POINTS: i32 = 150;
    let ratio = |point: i32| {
        let omega =
            EXTRAPOLATED * excited * 10_f64.powf(DECADES * f64::from(point) / f64::from(POINTS));
        let l = loop_response(model, controller, omega)?;
        // |1 + L|^2 by the law of cosines.
        let distance_sq = 1.0 + l.magnitude * (l.magnitude + 2.0 * l.phase_rad.cos());
        Some(l.magnitude / distance_sq.sqrt())
    };
    let largest = (0..=POINTS).filter_map(ratio).fold(0.0, f64::max);
    (largest > 0.0).then(|| 1.0 + 1.0 / largest)
}

/// Remarks on what the controller asks for.
fn limits(excitation: &Excitation, identified: &Identified, remarks: &mut Vec<Remark>) {
    let Some(design) = &identified.design else {
        return;
    };
    remarks.extend(
        (design.margins.gain_margin)
            .filter(|margin| *margin < LEAST_GAIN_MARGIN / ROUNDING)
            .map(Remark::LittleGainMargin),
    );
    if let Some(noise) = identified.specification.noise {
        let period_s = noise.sample_period_s;
        let share = noise_amplification(&identified.model, &design.controller, period_s)
            .map(|factor| factor * noise.std / noise.input_amplitude);
        remarks.extend(
            share
                .filter(|share| *share > MOST_NOISE)
                .map(Remark::NoiseAtActuator),
        );
    }
    let (input, output) = match excitation {
        Excitation::Relay { oscillation, .. } => {
            (oscillation.relay_amplitude, oscillation.amplitude)
        }
        Excitation::Recorded(recorded) => (
            identified
                .specification
                .noise
                .map_or(f64::INFINITY, |noise| noise.input_amplitude),
            recorded.output_deviation,
        ),
    };
    let largest_step = identified.step.map(|step| input / step.peak_input.abs());
    remarks.extend(
        largest_step
            .filter(|step| *step < output)
            .map(|step| Remark::InputPeak { step, input }),
    );
}
