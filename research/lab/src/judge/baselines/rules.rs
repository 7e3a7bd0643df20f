//! Homogeneous tuning rules, applied to the cycle that was measured (the paper's equations 11 to 13 and
//! its section IV-C; M. Chehadeh, I. Boiko, "Design of rules for in-flight non-parametric tuning of
//! unmanned aerial vehicles", J. Franklin Inst. 356, 2019).
//!
//! ```text
//! |G(j Omega0)| = pi a0 / (4 h),   lead = PM - asin(beta),   (Kp, Kd) by the rule with that lead
//! ```
//!
//! `a0` is half the peak-to-peak output with its noise, averaged over the cycles used. At the paper's
//! `beta` of -0.73 the rule costs at most 3.7 % over the whole domain by the describing function, which
//! takes output and input for sines, the relay for one without delay and the bias for zero.
//!
//! Two rules make weaker assumptions. [`calibrated`] takes its two numbers from the exact limit cycles
//! of the domain, so it is right about the waveform. [`Rule::FirstHarmonic`] takes magnitude and phase
//! of `G` from the first harmonics of output and input, and as lead the difference between the measured
//! phase and the phase of the margin. Its PD has that margin at the frequency of the oscillation,
//! whatever the relay did.
//!
//! All rules assume a symmetric oscillation, so their relay should trim the bias. Costs (mean, worst)
//! on 50 random processes of the paper's domain at up to half the relay's amplitude of bias and 3 %
//! noise:
//!
//! | relay     | paper's rule | calibrated | first harmonic |
//! |-----------|--------------|------------|----------------|
//! | trimmed   | 8.3, 12.6 %  | 4.3, 8.2 % | 2.7, 6.9 %     |
//! | untrimmed | 37, 93 %     | 30, 82 %   | 30, 84 %       |

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use onecycle_onboard::{Pd, Soiptd};

use super::{BaselineAnswer, BaselineError, steady_cycles};
use crate::space::Space;
use crate::space::limit_cycle::symmetric;
use onecycle_design::Pid;
use onecycle_design::rules::Homogeneous;
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;
use onecycle_identify::Signals;

/// How a controller follows from an oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// A rule for the relay of the recording, from half the peak-to-peak output.
    Amplitude(Homogeneous),
    /// The same from the amplitude of the first harmonic of the output.
    OutputHarmonic(Homogeneous),
    /// The rule for the measured phase, from the first harmonics of output and input.
    FirstHarmonic {
        /// Phase margin of the controller (rad).
        phase_margin_rad: f64,
    },
}

impl Rule {
    /// The paper's rule, with the lead that the describing function gives for a relay with this `beta`.
    #[must_use]
    pub fn of_relay(beta: f64, phase_margin_rad: f64) -> Self {
        Self::Amplitude(Homogeneous::from_lead(
            phase_margin_rad - beta.asin(),
            phase_margin_rad,
        ))
    }
}

/// The rule that fits the exact limit cycles of a space best: the geometric means of `c1` and `c3` of
/// the optima of `rows` by `columns` shapes. The rule is homogeneous, so one process represents its
/// shape.
///
/// # Errors
/// [`BaselineError::NotThisProcess`] if no shape has a limit cycle; a process may have no controller.
pub fn calibrated(
    space: &Space,
    rows: usize,
    columns: usize,
) -> Result<Homogeneous, BaselineError> {
    let (mut ln_c1, mut ln_c3, mut count) = (0.0, 0.0, 0.0);
    for shape in space.shapes(rows, columns) {
        let Some((_, radius_s)) = space.radius_range_s(shape) else {
            continue;
        };
        let [t_prop_s, t_body_s, tau_s] = shape.at(radius_s);
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let Some(cycle) = symmetric(&process, space.beta) else {
            continue;
        };
        let best = pd_at_phase_margin(&process, space.phase_margin_rad())?.pd;
        ln_c1 += (best.kp * describing_function_ratio(cycle.amplitude, 1.0)).ln();
        ln_c3 += (best.kd / (best.kp * cycle.period_s())).ln();
        count += 1.0;
    }
    if count == 0.0 {
        return Err(BaselineError::NotThisProcess(
            "no ratio of its time constants has a limit cycle",
        ));
    }
    let mut rule = Homogeneous::from_lead(0.0, space.beta.asin());
    rule.c1 = (ln_c1 / count).exp();
    rule.c3 = (ln_c3 / count).exp();
    Ok(rule)
}

/// `|G|` by the describing function, from the amplitudes of the output and of the relay.
fn describing_function_ratio(amplitude: f64, relay_amplitude: f64) -> f64 {
    PI * amplitude / (4.0 * relay_amplitude)
}

/// The PD of the rule, from the last steady cycles, `cycles` at most; the paper uses one.
///
/// # Errors
/// [`BaselineError::NoOscillation`], [`BaselineError::Uneven`]; [`BaselineError::Setting`] for a rule
/// with gains that are not positive; [`BaselineError::NotThisProcess`] if the output is constant or the
/// measured phase leaves no lead between 0 and `pi/2`.
pub fn identify(
    signals: &Signals<'_>,
    rule: &Rule,
    cycles: usize,
) -> Result<BaselineAnswer, BaselineError> {
    let (found, window) = steady_cycles(signals, cycles)?;
    let harmonic = |signal: &[f64]| harmonic(&signal[window.clone()], found.cycles_used);
    let (rule, ratio) = match *rule {
        Rule::Amplitude(rule) => (
            rule,
            describing_function_ratio(found.amplitude, found.relay_amplitude),
        ),
        Rule::OutputHarmonic(rule) => {
            let amplitude = 2.0 * harmonic(signals.output).norm() / window.len() as f64;
            (
                rule,
                describing_function_ratio(amplitude, found.relay_amplitude),
            )
        }
        Rule::FirstHarmonic { phase_margin_rad } => {
            let response = harmonic(signals.output) / harmonic(signals.input);
            // The input is held after its sample: half a sample of delay and a little less amplitude.
            let hold_rad = PI * signals.sample_period_s / found.period_s;
            let lead_rad = phase_margin_rad - (-response).arg() - hold_rad;
            if !(lead_rad > 0.0 && lead_rad < 0.5 * PI) {
                return Err(BaselineError::NotThisProcess(
                    "the measured phase gives a lead outside 0 to pi/2",
                ));
            }
            let rule = Homogeneous::from_lead(lead_rad, phase_margin_rad);
            (rule, response.norm() * hold_rad / hold_rad.sin())
        }
    };
    if !(rule.c1 > 0.0 && rule.c3 >= 0.0) {
        return Err(BaselineError::Setting("c1 or c3 of the rule", rule.c1));
    }
    if !(ratio.is_finite() && ratio > 0.0) {
        return Err(BaselineError::NotThisProcess("its output is constant"));
    }
    let Pid { kp, kd, .. } = rule.pid(ratio, found.period_s);
    Ok(BaselineAnswer {
        process: None,
        pd: Pd { kp, kd },
    })
}

/// Fourier sum of a signal over a number of whole cycles, at the frequency of the cycles.
fn harmonic(signal: &[f64], cycles: usize) -> Complex64 {
    let step_rad = TAU * cycles as f64 / signal.len() as f64;
    let turned = |(k, &value): (usize, &f64)| Complex64::from_polar(value, -step_rad * k as f64);
    signal.iter().enumerate().map(turned).sum()
}
