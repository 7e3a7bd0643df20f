//! The processes that one oscillation leaves possible, in JSON.

use onecycle_design::Model;
use onecycle_design::oscillation::{MarginRanges, Oscillation};
use onecycle_identify::Interval;
use serde::Serialize;

use super::Parameters;
use crate::results::family::OfOscillation;

/// What is known, and what follows for the processes that agree with it.
#[derive(Serialize)]
pub(super) struct FamilyReport {
    known: Known,
    dead_time_share: [f64; 2],
    members: usize,
    process: Parameters<Interval>,
    margins: Option<MarginRangesReport>,
}

/// An ultimate point, or a relay test with the `KU` of its describing function.
#[derive(Serialize)]
struct Known {
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    rule: Option<&'static str>,
    ultimate_gain: f64,
    period_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    relay: Option<Relay>,
}

#[derive(Serialize)]
struct Relay {
    relay: f64,
    amplitude: f64,
    hysteresis: f64,
    duty: f64,
}

/// Least and largest margins.
#[derive(Serialize)]
struct MarginRangesReport {
    ms: Ends,
    mt: Ends,
    phase_margin_deg: Ends,
    gain_margin: Ends,
    delay_margin_s: Ends,
}

#[derive(Serialize)]
struct Ends {
    low: f64,
    /// `None` if nothing bounds it.
    high: Option<f64>,
}

impl Ends {
    fn of((low, high): (f64, f64), factor: f64) -> Self {
        Self {
            low: factor * low,
            high: Some(factor * high).filter(|high| high.is_finite()),
        }
    }
}

impl From<&MarginRanges> for MarginRangesReport {
    fn from(of: &MarginRanges) -> Self {
        Self {
            ms: Ends::of(of.ms, 1.0),
            mt: Ends::of(of.mt, 1.0),
            phase_margin_deg: Ends::of(of.phase_margin_rad, 1_f64.to_degrees()),
            gain_margin: Ends::of(of.gain_margin, 1.0),
            delay_margin_s: Ends::of(of.delay_margin_s, 1.0),
        }
    }
}

pub(super) fn family(middle: &Model, of: &OfOscillation) -> FamilyReport {
    let finite = |value: f64| value.is_finite().then_some(value);
    let parameters = middle.structure().parameters().iter().map(|&parameter| {
        let (low, high) = of.family.range(parameter);
        let range = Interval {
            estimate: middle.parameter(parameter).and_then(finite),
            low: Some(low),
            high: finite(high),
        };
        (parameter.key(), range)
    });
    let (low, high) = of.known.dead_time_share;
    FamilyReport {
        known: known(of),
        dead_time_share: [low, high],
        members: of.family.members.len(),
        process: Parameters(parameters.collect()),
        margins: of.margins.as_ref().map(Into::into),
    }
}

fn known(of: &OfOscillation) -> Known {
    let rule = of.known.rule.map(|rule| rule.name());
    let (kind, ultimate, relay) = match &of.known.oscillation {
        Oscillation::Relay(test) => {
            let relay = Relay {
                relay: test.relay,
                amplitude: test.amplitude,
                hysteresis: test.hysteresis,
                duty: test.duty,
            };
            ("relay", test.describing_function(), Some(relay))
        }
        Oscillation::Ultimate(ultimate) => ("ultimate", *ultimate, None),
    };
    Known {
        kind,
        rule,
        ultimate_gain: ultimate.gain,
        period_s: ultimate.period_s,
        relay,
    }
}
