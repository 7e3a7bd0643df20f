//! Sentences about an oscillation from which a controller is designed.

use onecycle_design::DesignError;
use onecycle_design::oscillation::{Oscillation, RelayTest};
use onecycle_design::rules::NotOfRule;

use super::controllers::refusal;
use crate::results::family::{Known, Rule};
use crate::words::number::significant;

/// The relay and its output. Of Marlin's relay only the ratio of the amplitudes is known.
pub fn relay(test: &RelayTest, rule: Option<Rule>) -> String {
    let RelayTest {
        relay,
        amplitude,
        hysteresis,
        duty,
        ..
    } = *test;
    format!(
        "H {}, output amplitude A {}{}, hysteresis E {}, high for {:.0} % of the period",
        significant(relay),
        significant(amplitude),
        match rule {
            Some(Rule::Marlin | Rule::MarlinBed) => " (their ratio counts)",
            _ => "",
        },
        significant(hysteresis),
        100.0 * duty
    )
}

/// How the figures were taken.
pub fn taken_as(known: &Known) -> String {
    let Oscillation::Relay(test) = &known.oscillation else {
        return "the true ultimate point. The KU of a relay test, 4H/(pi A), may be 19 % below to 27 % above it: then state the \
                test by `relay` and `amplitude`"
            .to_owned();
    };
    let exact = format!(
        "the exact oscillation of each process under this relay; its describing function has KU {}",
        significant(test.describing_function().gain)
    );
    match known.rule {
        Some(Rule::Klipper) => format!(
            "{exact}. Klipper computes twice 4H/(pi A); thresholds 5 degrees apart and max_power 1, else add `relay` (127.5 times \
             max_power)"
        ),
        Some(rule) => format!(
            "{exact}. KU and TU follow from the gains by the rule {}",
            rule.name()
        ),
        None => exact,
    }
}

/// Why gains are not those of a rule.
pub fn not_of_rule(rule: Rule, error: &NotOfRule) -> String {
    let why = match error {
        NotOfRule::Derivative { expected, given } => format!(
            "with these Kp and Ki it gives Kd {}, but Kd is {}",
            significant(*expected),
            significant(*given)
        ),
        other => other.to_string(),
    };
    format!(
        "the gains of `against` are not those of `rule={}`: {why}",
        rule.name()
    )
}

/// Which processes agree with the figures.
pub fn processes(known: &Known) -> String {
    let (low, high) = known.dead_time_share;
    format!(
        "all of first and second order that agree, with a dead time of {low} to {high} of the sum of dead time and lags \
         (`dead_time_share`) and a second lag of up to ten dead times"
    )
}

/// Why no process agrees.
pub fn none_agrees(known: &Known) -> String {
    let (low, high) = known.dead_time_share;
    format!(
        "no process of first or second order with a dead time share of {low} to {high} oscillates so: check `hysteresis`, \
         `amplitude` and `dead_time_share`"
    )
}

/// Why no controller serves all processes that agree, and what to do.
pub fn refusal_of_family(error: &DesignError) -> String {
    match error {
        DesignError::Infeasible { .. } => format!(
            "{error} on all processes that agree with the oscillation. Ask for a higher `ms` or `style=sharp`, narrow \
             `dead_time_share`, or choose another `controller`"
        ),
        DesignError::Structure(_) => {
            "`style=paper` designs for one known process: choose sharp, balanced or calm".to_owned()
        }
        other => refusal(other),
    }
}
