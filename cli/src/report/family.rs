//! The processes that one oscillation leaves possible, as facts for text and page.

use onecycle::{Model, Parameter};
use onecycle_design::oscillation::{MarginRanges, Oscillation};

use super::number::{bounded, seconds, significant};
use super::record::Fact;
use crate::results::family::OfOscillation;
use crate::words::oscillation as words;

/// What is known, and how it was taken.
pub(super) fn known(of: &OfOscillation) -> Vec<Fact> {
    let mut facts = match &of.known.oscillation {
        Oscillation::Relay(test) => vec![
            ("relay", words::relay(test, of.known.rule)),
            ("period", format!("{} s", significant(test.period_s))),
        ],
        Oscillation::Ultimate(ultimate) => {
            let (gain, period) = (significant(ultimate.gain), significant(ultimate.period_s));
            vec![("ultimate", format!("gain KU {gain}, period TU {period} s"))]
        }
    };
    facts.push(("taken as", words::taken_as(&of.known)));
    facts.push(("processes", words::processes(&of.known)));
    facts
}

/// A parameter of the middle process and its range over all that agree; the range is in the unit of the parameter.
pub(super) fn parameters(middle: &Model, of: &OfOscillation) -> Vec<(Parameter, String, String)> {
    let finite = |value: f64| value.is_finite().then_some(value);
    let row = |&parameter: &Parameter| {
        let (low, high) = of.family.range(parameter);
        let value = middle.parameter(parameter).and_then(finite);
        (
            parameter,
            value.map_or("infinite".to_owned(), significant),
            format!("{} .. {}", significant(low), bounded(finite(high))),
        )
    };
    middle.structure().parameters().iter().map(row).collect()
}

/// Margins over all processes that agree.
pub(super) fn margins(ranges: Option<&MarginRanges>) -> String {
    let Some(of) = ranges else {
        return "unstable on one of the processes that agree with the oscillation".to_owned();
    };
    let two = |(low, high): (f64, f64)| format!("{low:.2} .. {high:.2}");
    let (low, high) = of.phase_margin_rad;
    let gain_margin = match of.gain_margin {
        (low, high) if high.is_infinite() => format!("{low:.2} .. unbounded"),
        ends => two(ends),
    };
    format!(
        "over all of them: phase margin {:.1} .. {:.1} deg, gain margin {gain_margin}, delay margin {} .. {}, Ms {}, Mt {}",
        low.to_degrees(),
        high.to_degrees(),
        seconds(of.delay_margin_s.0),
        seconds(of.delay_margin_s.1),
        two(of.ms),
        two(of.mt)
    )
}
