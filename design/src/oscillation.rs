//! Processes of which one oscillation is known: under a proportional controller at its ultimate gain, or under a relay.
//!
//! ```text
//! P(s) = k e^(-tau s) / ((s + a)(T2 s + 1)),     a = 1/T1 >= 0,     0 <= T2 <= T1
//! ```
//!
//! | symbol | meaning | unit |
//! |--------|---------|------|
//! | `k` | slope: gain at rest over `T1` | output unit / (input unit s) |
//! | `T1`, `T2` | longer and shorter lag; `T1` infinite for an integrator | s |
//! | `tau` | dead time | s |
//!
//! An oscillation has two figures, a ratio of amplitudes and a period. They determine `k` and `tau` once the lags are chosen
//! ([`Oscillation::process`]), so a family of processes is left: [`Oscillation::family`]. Its coordinates are the phase lags
//! `atan(w T1)` and `atan(w T2)` at `w = 2 pi/period`, which are bounded for an integrator too.
//!
//! - [`Ultimate`]: `|P(jw)| = 1/KU` and the phase is -180 deg at `w = 2 pi/TU`.
//! - [`RelayTest`]: the exact limit cycle has the period and the peak-to-peak output of the test. No describing function is
//!   used, which errs by -19 % (integrator) to +27 % (dead time alone) in `KU`.
//!
//! References: K. J. Astrom, T. Hagglund, "Automatic tuning of simple regulators with specifications on phase and amplitude
//! margins", Automatica 20 (1984), 645: the relay test. K. J. Astrom, "Oscillations in systems with relay feedback", IMA Vol.
//! Math. Appl. 74 (1995): exact limit cycles.

mod relay_test;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::closed_loop::{margins, sensitivity};
use crate::controller::Controller;
use crate::model::{Linear, Model, Parameter, Structure};
use crate::roots::edge;
use crate::rules::Ultimate;

pub use relay_test::RelayTest;

/// What is known of a process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oscillation {
    /// Ultimate gain and period.
    Ultimate(Ultimate),
    /// Steady oscillation under a relay.
    Relay(RelayTest),
}

/// Share of the dead time in the sum of dead time and lags that [`Oscillation::family`] spans unless asked otherwise: from an
/// integrator (0) to a process dominated by its dead time. It is the normalised dead time of K. J. Astrom, T. Hagglund,
/// "Advanced PID Control" (ISA, 2006), section 2.4, who call 0.6 and more dead-time dominated.
pub const DEAD_TIME_SHARE: (f64, f64) = (0.0, 0.7);

/// Largest second lag of a family, in dead times. Between heater and sensor there is one of 2 to 8.
const SECOND_LAG: f64 = 10.0;

/// Members inside of a family and along its edges: without a second lag, with the longest one, and integrators.
const INSIDE: usize = 120;
const ALONG_FIRST_ORDER: usize = 32;
const ALONG_LONGEST: usize = 32;
const ALONG_INTEGRATORS: usize = 16;

/// Steps of the sequence that spreads points evenly over a square: powers of `1/g` with `g^3 = g + 1`. M. Roberts, "The
/// unreasonable effectiveness of quasirandom sequences" (2018).
const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Shortest first lag: its phase lag (rad) at the frequency of the oscillation. A dead time beside it has a share of 0.997.
const SHORTEST: f64 = 0.01;

/// Halvings of the way to an edge of a family.
const HALVINGS: usize = 16;

/// A lag that turns the phase by all but this share of 90 deg is an integrator.
const ROUNDING: f64 = 1e-9;

/// Processes that agree with an [`Oscillation`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Family {
    /// The member in the middle.
    pub middle: Model,
    /// At most 200 members: first those inside, evenly spread, then those along the edges.
    pub members: Vec<Model>,
}

/// Least and largest margins of a controller over a family.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MarginRanges {
    /// Phase margin (rad).
    pub phase_margin_rad: (f64, f64),
    /// Gain margin (1). Infinite if nothing limits the gain.
    pub gain_margin: (f64, f64),
    /// Delay margin (s).
    pub delay_margin_s: (f64, f64),
    /// Maximum sensitivity (1).
    pub ms: (f64, f64),
    /// Maximum complementary sensitivity (1).
    pub mt: (f64, f64),
}

impl Family {
    /// Least and largest value of a parameter of a process of second order, in its [unit](Structure::unit). A member of first
    /// order has a second lag of zero, an integrator an infinite `K` and `T_body`.
    #[must_use]
    pub fn range(&self, parameter: Parameter) -> (f64, f64) {
        ends(
            self.members
                .iter()
                .map(|member| member.parameter(parameter).unwrap_or(0.0)),
        )
    }

    /// Margins of `controller` over the members. `None` if it is unstable on one of them.
    #[must_use]
    pub fn margins(&self, controller: &Controller) -> Option<MarginRanges> {
        let of = |member: &Model| {
            Some((
                margins(member, controller)?,
                sensitivity(member, controller)?,
            ))
        };
        let found: Option<Vec<_>> = self.members.iter().map(of).collect();
        let found = found?;
        let gain_margin = found
            .iter()
            .map(|(of, _)| of.gain_margin.unwrap_or(f64::INFINITY));
        Some(MarginRanges {
            phase_margin_rad: ends(found.iter().map(|(of, _)| of.phase_margin_rad)),
            gain_margin: ends(gain_margin),
            delay_margin_s: ends(found.iter().map(|(of, _)| of.delay_margin_s)),
            ms: ends(found.iter().map(|(_, of)| of.ms)),
            mt: ends(found.iter().map(|(_, of)| of.mt)),
        })
    }
}

/// Least and largest of the values.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

impl Oscillation {
    /// Period (s).
    #[must_use]
    pub fn period_s(&self) -> f64 {
        match self {
            Self::Ultimate(ultimate) => ultimate.period_s,
            Self::Relay(test) => test.period_s,
        }
    }

    /// The process with these lags `T1 >= T2` (s) that oscillates so. `T1` may be infinite; of first order if `T2` is zero.
    /// `None` if no dead time makes it do so.
    #[must_use]
    pub fn process(&self, [first_s, second_s]: [f64; 2]) -> Option<Model> {
        let structure = if second_s > 0.0 {
            Structure::Soptd
        } else {
            Structure::Foptd
        };
        let process = Linear::new(structure)
            .with_lags_s([second_s, 1.0])
            .with_pole_per_s(1.0 / first_s);
        let found = match self {
            Self::Ultimate(ultimate) => complete(&process, ultimate),
            Self::Relay(test) => test.complete(&process),
        };
        found.map(Model::from)
    }

    /// Processes that oscillate so and whose dead time is this share, between 0 and 1, of the sum of dead time and lags; 0 is
    /// an integrator. The second lag is at most ten dead times. `None` if no
    /// process agrees.
    #[must_use]
    pub fn family(&self, dead_time_share: (f64, f64)) -> Option<Family> {
        let region = Region::new(self, dead_time_share)?;
        let middle = region.member([0.5, 0.5])?;
        let along = |count: usize| (0..count).map(move |k| k as f64 / (count - 1) as f64);
        let inside = (1..=INSIDE).map(|k| STEPS.map(|step| (0.5 + step * k as f64).fract()));
        let points = (inside.chain(along(ALONG_FIRST_ORDER).map(|u| [u, 0.0])))
            .chain(along(ALONG_LONGEST).map(|u| [u, 1.0]))
            .chain(along(ALONG_INTEGRATORS).map(|v| [1.0, v]));
        Some(Family {
            middle,
            members: points.filter_map(|point| region.member(point)).collect(),
        })
    }
}

/// Where a pair of lags lies.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// The dead time has a larger share than asked for: longer lags come nearer.
    Late,
    Inside,
    /// The lags are longer than asked for, or than any dead time allows.
    Slow,
}

/// The phase lags `[atan(w T1), atan(w T2)]` of a family.
struct Region<'a> {
    oscillation: &'a Oscillation,
    share: (f64, f64),
    /// Range of the first.
    first: (f64, f64),
}

impl<'a> Region<'a> {
    /// `None` if it is empty.
    fn new(oscillation: &'a Oscillation, share: (f64, f64)) -> Option<Self> {
        let mut region = Self {
            oscillation,
            share,
            first: (SHORTEST, FRAC_PI_2),
        };
        // No second lag leaves the longest first one, the longest second lag the shortest.
        let is_left = |first: f64| region.place([first, 0.0]) != Place::Slow;
        let high = edge(SHORTEST, FRAC_PI_2, HALVINGS, is_left)?;
        let is_reached = |first: f64| {
            let second = region.longest(first);
            second.is_some_and(|second| region.place([first, second]) != Place::Late)
        };
        let low = edge(high, SHORTEST, HALVINGS, is_reached)?;
        region.first = (low, high);
        Some(region)
    }

    fn lags_s(&self, angles: [f64; 2]) -> [f64; 2] {
        let omega = TAU / self.oscillation.period_s();
        angles.map(|angle| match angle {
            integrates if integrates >= FRAC_PI_2 * (1.0 - ROUNDING) => f64::INFINITY,
            other => other.tan() / omega,
        })
    }

    fn place(&self, angles: [f64; 2]) -> Place {
        let lags_s = self.lags_s(angles);
        let process = self.oscillation.process(lags_s);
        let Some(tau_s) = process.and_then(|process| process.parameter(Parameter::Tau)) else {
            return Place::Slow;
        };
        let share = tau_s / (tau_s + lags_s[0] + lags_s[1]);
        if share > self.share.1 {
            Place::Late
        } else if share < self.share.0 || lags_s[1] > SECOND_LAG * tau_s {
            Place::Slow
        } else {
            Place::Inside
        }
    }

    /// The longest second phase lag beside this first one.
    fn longest(&self, first: f64) -> Option<f64> {
        edge(0.0, first, HALVINGS, |second| {
            self.place([first, second]) != Place::Slow
        })
    }

    /// The member at these shares of the ranges of the first and the second phase lag.
    fn member(&self, [u, v]: [f64; 2]) -> Option<Model> {
        let (low, high) = self.first;
        let first = low + u * (high - low);
        let high = self.longest(first)?;
        let low = edge(high, 0.0, HALVINGS, |second| {
            self.place([first, second]) != Place::Late
        })?;
        self.oscillation
            .process(self.lags_s([first, low + v * (high - low)]))
    }
}

/// `process` with the slope and the dead time (s) by which its response is `-1/KU` at the ultimate frequency. `None` if its
/// lags turn the phase too far.
fn complete(process: &Linear, ultimate: &Ultimate) -> Option<Linear> {
    let omega = TAU / ultimate.period_s;
    let lags = process
        .with_gain(1.0)
        .with_tau_s(0.0)
        .frequency_response(omega);
    // The phase of two lags lies between 0 and -180 deg.
    let tau_s = (PI - lags.arg().abs()) / omega;
    (tau_s >= 0.0).then(|| {
        process
            .with_gain(1.0 / (ultimate.gain * lags.norm()))
            .with_tau_s(tau_s)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::Form;
    use crate::tuning::{Specification, design_over};

    const ULTIMATE: Oscillation = Oscillation::Ultimate(Ultimate {
        gain: 35.0,
        period_s: 28.0,
    });

    fn relay(hysteresis: f64, duty: f64) -> RelayTest {
        RelayTest::new(90.0, 3.28, 28.0)
            .with_hysteresis(hysteresis)
            .with_duty(duty)
    }

    fn near(found: f64, exact: f64) {
        assert!((found / exact - 1.0).abs() < 1e-11, "{found} {exact}");
    }

    fn slope_and_dead_time(process: Model) -> (f64, f64) {
        let of = |parameter| process.parameter(parameter).unwrap();
        (of(Parameter::KOverTBody), of(Parameter::Tau))
    }

    // An integrator k e^(-tau s)/s has -90 deg and the dead time the other 90: tau = TU/4, k = (2 pi/TU)/KU.
    #[test]
    fn an_integrator_at_its_ultimate_point() {
        let (slope, tau_s) = slope_and_dead_time(ULTIMATE.process([f64::INFINITY, 0.0]).unwrap());
        near(slope, TAU / 28.0 / 35.0);
        near(tau_s, 7.0);
    }

    // Every member has the response -1/KU at 2 pi/TU, and no other ultimate point below it.
    #[test]
    fn members_go_through_the_point() {
        let family = ULTIMATE.family(DEAD_TIME_SHARE).unwrap();
        assert_eq!(family.members.len(), 200);
        for member in family.members.iter().chain([&family.middle]) {
            let response = member.frequency_response(TAU / 28.0) * 35.0;
            assert!((response + 1.0).norm() < 1e-12, "{response}");
            let found = Ultimate::of(member).unwrap();
            assert!((found.gain / 35.0 - 1.0).abs() < 1e-9, "{member:?}");
        }
    }

    // By hand, an integrator under an ideal relay: the output is a triangle of amplitude k H tau and period 4 tau. With hysteresis
    // and duty D it rises with 2 k H (1 - D) for D P, so 2A = 2 k H D (1 - D) P; it overshoots the threshold for tau on either
    // side, so 2A = 2E + 2 k H tau.
    #[test]
    fn an_integrator_under_a_relay() {
        for (e, d) in [(0.0, 0.5), (1.2, 0.5), (1.2, 0.3)] {
            let process = Oscillation::Relay(relay(e, d)).process([f64::INFINITY, 0.0]);
            let (slope, tau_s) = slope_and_dead_time(process.unwrap());
            near(slope, 3.28 / (90.0 * d * (1.0 - d) * 28.0));
            near(tau_s, (3.28 - e) / (slope * 90.0));
        }
    }

    // First order, duty 1/2, half-period h: A = K H tanh(h/2T), and the output rises from -A to E in h - tau:
    // tau = h - T ln((K H + A)/(K H - E)).
    #[test]
    fn a_first_order_process_under_a_relay() {
        let (first_s, e) = (20.0, 1.2);
        let process = Oscillation::Relay(relay(e, 0.5))
            .process([first_s, 0.0])
            .unwrap();
        let (slope, tau_s) = slope_and_dead_time(process);
        let kh = 3.28 / (14.0 / (2.0 * first_s)).tanh();
        near(slope * first_s * 90.0, kh);
        near(tau_s, 14.0 - first_s * ((kh + 3.28) / (kh - e)).ln());
    }

    // A short second lag acts as a dead time of the same length, to second order; a dead time alone is a relay of 4/pi.
    #[test]
    fn limits_of_a_second_order_process_under_a_relay() {
        let oscillation = Oscillation::Relay(relay(0.0, 0.5));
        let (_, without_s) = slope_and_dead_time(oscillation.process([20.0, 0.0]).unwrap());
        let (_, with_s) = slope_and_dead_time(oscillation.process([20.0, 1e-4]).unwrap());
        assert!(
            (without_s - with_s - 1e-4).abs() < 1e-7,
            "{without_s} {with_s}"
        );
        let alone = oscillation.process([1e-2, 1e-3]).unwrap();
        near(alone.parameter(Parameter::K).unwrap(), 3.28 / 90.0);
        let error = relay(0.0, 0.5).describing_function().gain / Ultimate::of(&alone).unwrap().gain;
        assert!((error - 4.0 / PI).abs() < 1e-3, "{error}");
    }

    // Nearly equal lags are no special case: the dead times of lags of 5 s and of 5 s (1 -+ 1e-6) agree.
    #[test]
    fn equal_lags_under_a_relay() {
        let of = |lags_s| {
            slope_and_dead_time(Oscillation::Relay(relay(1.2, 0.4)).process(lags_s).unwrap())
        };
        let (equal, apart) = (of([5.0, 5.0]), of([5.0 * (1.0 + 1e-6), 5.0 * (1.0 - 1e-6)]));
        assert!(
            (equal.1 / apart.1 - 1.0).abs() < 1e-9,
            "{equal:?} {apart:?}"
        );
    }

    // Lags too long for the hysteresis are no members; the shares are those asked for.
    #[test]
    fn a_family_keeps_its_range() {
        let hysteresis = Oscillation::Relay(relay(3.0, 0.5));
        assert_eq!(hysteresis.process([f64::INFINITY, 20.0]), None);
        for (oscillation, asked) in [
            (ULTIMATE, (0.1, 0.4)),
            (hysteresis, (0.1, 0.4)),
            (ULTIMATE, (0.002, 0.01)),
            (ULTIMATE, (0.5, 0.95)),
        ] {
            let family = oscillation.family(asked).unwrap();
            let share = |member: &Model| {
                let of = |parameter| member.parameter(parameter).unwrap_or(0.0);
                let tau_s = of(Parameter::Tau);
                tau_s / (tau_s + of(Parameter::TBody) + of(Parameter::TProp))
            };
            let (low, high) = ends(family.members.iter().map(share));
            assert_eq!(family.members.len(), 200);
            assert!(
                (low - asked.0).abs() < 1e-3 && (high - asked.1).abs() < 1e-3,
                "{low} {high} {asked:?}"
            );
        }
    }

    // Ms of 1.6 on all members. Without the others, the middle one alone allows more integral gain.
    #[test]
    fn a_design_keeps_its_limits_over_the_family() {
        for oscillation in [ULTIMATE, Oscillation::Relay(relay(1.2, 0.4))] {
            let family = oscillation.family(DEAD_TIME_SHARE).unwrap();
            for form in [Form::Pi, Form::Pid] {
                let mut asked = Specification {
                    form,
                    ..Specification::default()
                };
                asked.coverage = 1.0;
                let found = design_over(&family.middle, &family.members, &asked).unwrap();
                let alone = design_over(&family.middle, &[], &asked).unwrap();
                let ranges = family.margins(&found.controller).unwrap();
                assert!(ranges.ms.1 < 1.605 && ranges.mt.1 < 1.605, "{ranges:?}");
                assert!(found.controller.pid().ki < 0.5 * alone.controller.pid().ki);
                assert_eq!(family.range(Parameter::K).1, f64::INFINITY);
            }
        }
    }
}
