//! Names and sentences of verdicts and remarks.

use onecycle_design::{DesignError, Parameter};
use onecycle_identify::{Interval, Remark, Verdict};
use onecycle_onboard::refine::DomainEdge;

/// Every verdict with its name in JSON.
fn verdicts() -> Vec<(Verdict, &'static str)> {
    let too_short = |cycles| (Verdict::TooShort { cycles }, "too_short");
    let no_relay = |output_is_relay| (Verdict::NoRelay { output_is_relay }, "no_relay");
    let few = |switches| (Verdict::FewSwitches { switches }, "no_relay");
    let unknown = |score| (Verdict::Unknown { score }, "unknown");
    let edge = |edge| (Verdict::EdgeOfDomain(edge), "edge_of_domain");
    let (cycles, alike, needed) = (119, 10, 30);
    let not_steady = Verdict::NotSteady {
        cycles,
        alike,
        needed,
    };
    vec![
        (Verdict::ConstantInput, "no_relay"),
        no_relay(true),
        no_relay(false),
        few(1),
        few(2),
        (Verdict::ConstantOutput, "no_response"),
        (Verdict::Units, "unusable_units"),
        too_short(0),
        too_short(1),
        too_short(3),
        (Verdict::TooCoarse { points: 12 }, "too_short"),
        (not_steady, "not_steady"),
        (Verdict::Saturated { part: 0.2 }, "saturated"),
        (Verdict::NotThisProcess { misfit: 0.08 }, "not_this_process"),
        (Verdict::NoFit, "not_this_process"),
        unknown(None),
        unknown(Some(3.0)),
        (Verdict::TooUncertain, "too_uncertain"),
        edge(DomainEdge::SlowLags),
        edge(DomainEdge::FastLag),
        edge(DomainEdge::LongDelay),
        (
            Verdict::NoController(DesignError::PhaseMargin(2.0)),
            "no_controller",
        ),
    ]
}

// Programs compare `kind`. The clause says what is wrong: it starts in lower case, has no full stop, differs from all
// others and is more than the name.
#[test]
fn verdicts_have_a_stable_name_and_a_clause_each() {
    let mut clauses: Vec<String> = Vec::new();
    for (verdict, kind) in verdicts() {
        assert_eq!(verdict.kind(), kind);
        let clause = verdict.to_string();
        assert!(clause.starts_with(char::is_lowercase), "{clause}");
        assert!(!clause.ends_with('.') && clause.len() > 25, "{clause}");
        assert!(!clauses.contains(&clause), "{clause}");
        clauses.push(clause);
    }
}

#[test]
fn a_verdict_names_its_numbers() {
    let clause = |index: usize| verdicts()[index].0.to_string();
    assert_eq!(
        clause(4),
        "no relay in the input: it switches 2 times and then stays at one value"
    );
    assert_eq!(
        clause(11),
        "no steady oscillation: at most 10 of 119 cycles in a row are alike, and 30 are needed"
    );
    assert_eq!(
        clause(21),
        "no controller: the phase margin must lie between 0 and pi/2 rad, but is 2 rad"
    );
}

#[test]
fn remarks_have_a_stable_unique_name() {
    let parameter = Parameter::TProp;
    let (low_s, high_s) = (0.01, 0.02);
    let relative_half_width = 0.4;
    let mean_s = Interval {
        estimate: Some(1.0),
        low: Some(0.9),
        high: Some(1.1),
    };
    let names = [
        (Remark::Disturbed(0.1), "disturbed"),
        (Remark::OneCycle { is_known: true }, "one_cycle"),
        (Remark::FewCycles { used: 2 }, "few_cycles"),
        (Remark::Unknown(2.0), "unknown"),
        (Remark::Unread, "unread"),
        (Remark::NegativeGain, "negative_gain"),
        (Remark::DampingNotSeen(None), "damping_not_seen"),
        (Remark::Unstable(1.0), "unstable"),
        (
            Remark::EqualLags {
                lags: vec![Parameter::TBody, Parameter::TProp],
                mean_s,
            },
            "equal_lags",
        ),
        (
            Remark::Weak {
                parameter,
                relative_half_width,
            },
            "weak_parameter",
        ),
        (Remark::WeakDelay { low_s, high_s }, "weak_delay"),
        (Remark::Noisy(0.1), "noisy"),
        (Remark::Biased(0.3), "biased"),
        (Remark::Coarse(20.0), "coarse"),
        (Remark::Misfit(0.02), "misfit"),
        (Remark::MarginMayBeLess(0.1), "margin_may_be_less"),
    ];
    for (index, (remark, name)) in names.iter().enumerate() {
        assert_eq!(remark.kind(), *name);
        assert!(names[..index].iter().all(|(_, other)| other != name));
    }
}
