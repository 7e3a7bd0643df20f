//! The closed loop with the gains in force, driven by the logged set-point, beside the logged output.

use onecycle_design::{Assessment, LowPass, Model, Pid};
use onecycle_identify::{Excitation, Identification, Identified};
use onecycle_link::{
    Axis, ControlLoop, FirmwareKind, Flight, LoggedLoop, MarkKind, Recording, Term,
};
use onecycle_plant::FollowedLoop;

use crate::results::log_gains::Overlay;

/// Time (s) after which the state of the loop at the start is forgotten.
const START_S: f64 = 0.5;

/// Samples of a response to a step, over this many settling times.
const STEP_SAMPLES: usize = 2000;
const SETTLING_TIMES: f64 = 2.0;

/// Fewest samples of an overlay.
const LEAST_SAMPLES: usize = 50;

/// The overlay of a rate loop over the part of the recording that was used. `None`: no set-point is logged, the excitation
/// entered elsewhere (SYSTEMID), other gains were in force, or the loop is unstable.
pub(crate) fn overlay(
    flight: &Flight,
    axis: Axis,
    in_force: Pid,
    recording: &Recording,
    found: &Identification,
) -> Option<Overlay> {
    let identified: &Identified = found.outcome.as_ref().ok()?;
    let set_point = recording.set_point()?;
    let times_s = recording.time_s();
    let (from_s, to_s) = match &found.excitation {
        Some(Excitation::Recorded(used)) => (used.start_s, used.end_s),
        _ => (*times_s.first()?, *times_s.last()?),
    };
    let entered_elsewhere = flight.marks.iter().any(|mark| {
        let overlaps = mark.span.from_s < to_s && mark.span.to_s > from_s;
        mark.kind == MarkKind::ArduPilotSystemId && mark.axis == Some(axis) && overlaps
    });
    let logged = flight.logged_loop(ControlLoop::Rate(axis));
    let has_other_gains = logged
        .and_then(LoggedLoop::gains_changed_s)
        .is_some_and(|changed_s| changed_s > from_s);
    if entered_elsewhere || has_other_gains {
        return None;
    }
    let rows: Vec<usize> = (0..times_s.len())
        .filter(|&row| (from_s..=to_s).contains(&times_s[row]))
        .collect();
    let of = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&row| values[row]).collect() };
    let [time_s, set_point, logged] = [of(times_s), of(set_point), of(recording.output())];
    if time_s.len() < LEAST_SAMPLES {
        return None;
    }
    let (model, _) = identified.for_design(0);
    let simulated = as_flown(flight, axis, in_force).follow(&model, &time_s, &set_point)?;
    let explained = explained(&time_s, &logged, &simulated)?;
    Some(Overlay {
        time_s,
        set_point,
        logged,
        simulated,
        explained,
    })
}

/// Overshoot after a step of the set-point, in the law of the firmware: P and I on the error, its filters, and its derivative
/// and feed-forward, but for one on the derivative of the set-point, which a step does not have. `None`: the response has no
/// end, or is too long to simulate.
pub(crate) fn overshoot(
    flight: &Flight,
    axis: Axis,
    pid: Pid,
    model: &Model,
    figures: &Assessment,
) -> Option<f64> {
    let mut followed = as_flown(flight, axis, pid);
    followed.feed_forward_rate = 0.0;
    let settled_s = figures.step?.settling_time_s;
    let time_s: Vec<f64> = (0..=STEP_SAMPLES)
        .map(|row| SETTLING_TIMES * settled_s * row as f64 / STEP_SAMPLES as f64)
        .collect();
    let output = followed.follow(model, &time_s, &vec![1.0; time_s.len()])?;
    Some(output.into_iter().fold(1.0, f64::max) - 1.0)
}

/// The loop as the firmware runs it, feed-forward included.
fn as_flown(flight: &Flight, axis: Axis, in_force: Pid) -> FollowedLoop {
    let law = flight.rate_law(axis);
    let mut followed = FollowedLoop::new(in_force);
    followed.derivative_on_error = law.derivative_on_error;
    followed.target = law
        .target
        .map(|filter| LowPass::first_order(filter.cutoff_hz));
    let logged = flight.logged_loop(ControlLoop::Rate(axis));
    let gain = logged.and_then(|of| of.gains.iter().find(|gain| gain.term == Term::FeedForward));
    let feed_forward = gain.and_then(|gain| gain.si).unwrap_or(0.0);
    match flight.firmware.kind {
        // That of Betaflight acts on the derivative of the set-point.
        FirmwareKind::Betaflight => followed.feed_forward_rate = feed_forward,
        _ => followed.feed_forward = feed_forward,
    }
    followed
}

/// Share of the variance explained after the start. `None`: the output does not move.
fn explained(time_s: &[f64], logged: &[f64], simulated: &[f64]) -> Option<f64> {
    let first_s = *time_s.first()?;
    let rows: Vec<usize> = (0..time_s.len())
        .filter(|&row| time_s[row] > first_s + START_S)
        .collect();
    let variance = |value: &dyn Fn(usize) -> f64| {
        let mean = rows.iter().map(|&row| value(row)).sum::<f64>() / rows.len() as f64;
        rows.iter()
            .map(|&row| (value(row) - mean).powi(2))
            .sum::<f64>()
    };
    let total = variance(&|row| logged[row]);
    let left = variance(&|row| logged[row] - simulated[row]);
    (total > 0.0 && left.is_finite()).then(|| 1.0 - left / total)
}

#[cfg(test)]
mod tests {
    use super::*;

    // The same signal explains all, half of it 1 - 1/4, and none of it nothing; what does not move has no share.
    #[test]
    fn shares() {
        let time_s: Vec<f64> = (0..1000).map(|row| 0.01 * f64::from(row)).collect();
        let logged: Vec<f64> = time_s.iter().map(|t| t.sin()).collect();
        let scaled = |factor: f64| -> Vec<f64> { logged.iter().map(|y| factor * y).collect() };
        for (factor, share) in [(1.0, 1.0), (0.5, 0.75), (0.0, 0.0)] {
            let found = explained(&time_s, &logged, &scaled(factor)).unwrap();
            assert!((found - share).abs() < 1e-12, "{factor} {found}");
        }
        assert_eq!(explained(&time_s, &vec![1.0; 1000], &logged), None);
        assert_eq!(explained(&[], &[], &[]), None);
    }
}
