//! The test as a function of the samples: limits, relay, recording. It knows no messages under way and no clock but the
//! vehicle's.

use mavlink::dialects::common::{ATTITUDE_TARGET_DATA, LOCAL_POSITION_NED_DATA};
use onecycle_onboard::{Relay, RelayError, RelayPhase, RelaySettings};

use super::{AltitudeAbort, AltitudeTest, ThrustSource};

/// Time over which the noise of the height is measured, with the thrust of the hover (s).
const PREROLL_S: f32 = 1.0;
/// Least standard deviation of the noise (m): position and velocity of an estimator wander by more than their second
/// differences tell.
const LEAST_NOISE_M: f32 = 5e-4;
/// Switches before the cycles count: the plain ones, the ramp, and one cycle of the trim.
const SETTLING: u32 = 9;
/// Longest time without a switch (s).
const NO_SWITCH_S: f64 = 5.0;
/// A height that differs by more from its integrated rate has jumped (m in one sample).
const JUMP_M: f64 = 0.3;
/// A longer time between two samples (s) is no time for a relay.
const GAP_S: f64 = 0.5;

/// A sample of the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Sample {
    /// Time since the start of the test, by the clock of the vehicle (s).
    pub time_s: f64,
    /// Height above the start: integral of the climb rate (m).
    pub height_m: f64,
    /// Climb rate (m/s).
    pub climb_m_per_s: f64,
    /// Thrust less that of the hover, from this sample to the next one (part of the full thrust).
    pub thrust: f64,
}

/// A test that runs.
pub(super) struct Run {
    test: AltitudeTest,
    relay: Relay,
    hover: f64,
    start: LOCAL_POSITION_NED_DATA,
    last: LOCAL_POSITION_NED_DATA,
    samples: Vec<Sample>,
    /// Thrust that the vehicle reports, with the time since the start (s).
    reports: Vec<(f64, f64)>,
    switches: u32,
    switched_s: f64,
}

impl Run {
    /// A test from this place. `wander_m`: standard deviation of the height in the hover.
    pub(super) fn new(
        test: AltitudeTest,
        hover: f64,
        start: &LOCAL_POSITION_NED_DATA,
        wander_m: f64,
    ) -> Result<Self, RelayError> {
        let mut relay = Relay::new(RelaySettings {
            preroll_s: PREROLL_S,
            noise_sigma: LEAST_NOISE_M,
            trim_gain: RelaySettings::TRIM_GAIN,
            ..RelaySettings::new(test.amplitude as f32, RelaySettings::DISTINGUISHING_BETA)
        })?;
        // What the vehicle wanders in the hover is rest, but no more than a tenth of what it may move.
        relay.begin_within((3.0 * wander_m).min(0.1 * test.band_m) as f32);
        Ok(Self {
            test,
            relay,
            hover,
            start: start.clone(),
            last: start.clone(),
            samples: Vec::new(),
            reports: Vec::new(),
            switches: 0,
            switched_s: 0.0,
        })
    }

    /// Takes a sample in. The thrust to set, as a part of the full one; `None`: it is not a new sample.
    pub(super) fn sample(
        &mut self,
        position: &LOCAL_POSITION_NED_DATA,
    ) -> Result<Option<f64>, AltitudeAbort> {
        let between_ms = i64::from(position.time_boot_ms) - i64::from(self.last.time_boot_ms);
        if between_ms == 0 && !self.samples.is_empty() {
            return Ok(None);
        }
        let dt_s = 1e-3 * between_ms as f64;
        if dt_s < 0.0 || !is_finite(position) {
            return Err(AltitudeAbort::Reset);
        }
        if dt_s > GAP_S {
            return Err(AltitudeAbort::Stale(dt_s));
        }
        let climbed_m = -0.5 * f64::from(position.vz + self.last.vz) * dt_s;
        let rise_m = f64::from(self.last.z - position.z);
        if (rise_m - climbed_m).abs() > JUMP_M {
            return Err(AltitudeAbort::Reset);
        }
        let before_m = self.samples.last().map_or(0.0, |last| last.height_m);
        let height_m = before_m + climbed_m;
        let time_s = 1e-3 * f64::from(position.time_boot_ms - self.start.time_boot_ms);
        self.check(position, height_m, time_s)?;
        let thrust = f64::from(self.relay.step(-height_m as f32, dt_s as f32));
        if self.relay.switches() != self.switches || self.relay.phase() == RelayPhase::Preroll {
            self.switches = self.relay.switches();
            self.switched_s = time_s;
        }
        self.samples.push(Sample {
            time_s,
            height_m,
            climb_m_per_s: -f64::from(position.vz),
            thrust,
        });
        self.last = position.clone();
        Ok(Some((self.hover + thrust).clamp(0.0, 1.0)))
    }

    fn check(
        &self,
        position: &LOCAL_POSITION_NED_DATA,
        height_m: f64,
        time_s: f64,
    ) -> Result<(), AltitudeAbort> {
        let estimated_m = f64::from(self.start.z - position.z);
        let away_m = height_m.abs().max(estimated_m.abs());
        let climb = f64::from(position.vz.abs());
        let drift_m = f64::from((position.x - self.start.x).hypot(position.y - self.start.y));
        let quiet_s = time_s - self.switched_s;
        if away_m > self.test.band_m {
            Err(AltitudeAbort::Height(away_m))
        } else if climb > self.test.climb_m_per_s {
            Err(AltitudeAbort::Climb(climb))
        } else if drift_m > self.test.drift_m {
            Err(AltitudeAbort::Drift(drift_m))
        } else if time_s > self.test.duration_s {
            Err(AltitudeAbort::Duration(time_s))
        } else if quiet_s > NO_SWITCH_S {
            Err(AltitudeAbort::NoOscillation(quiet_s))
        } else {
            Ok(())
        }
    }

    /// Takes in what the vehicle says that it sets.
    pub(super) fn report(&mut self, target: &ATTITUDE_TARGET_DATA) {
        let since_ms = i64::from(target.time_boot_ms) - i64::from(self.start.time_boot_ms);
        let time_s = 1e-3 * since_ms as f64;
        let is_later = self
            .reports
            .last()
            .is_none_or(|(last_s, _)| time_s > *last_s);
        if is_later && target.thrust.is_finite() {
            self.reports
                .push((time_s, f64::from(target.thrust) - self.hover));
        }
    }

    /// Whether all cycles are recorded.
    pub(super) fn is_complete(&self) -> bool {
        self.relay.switches() >= SETTLING + 2 * self.test.cycles
    }

    pub(super) fn beta(&self) -> f64 {
        RelaySettings::DISTINGUISHING_BETA.into()
    }

    /// The recording. The thrust is the one that the vehicle reported, if there are enough reports; a switch belongs to the
    /// sample that is nearest in time. `reports_when_set`: the stamp of a report is that of the set-point (PX4), and not that
    /// of the report itself (ArduPilot), before which the switch was by half the time between two reports in the mean.
    pub(super) fn recorded(self, reports_when_set: bool) -> (Vec<Sample>, ThrustSource) {
        let mut samples = self.samples;
        if self.reports.len() * 10 < samples.len() * 9 || samples.len() < 2 {
            return (samples, ThrustSource::Commanded);
        }
        let begin_s = |at: usize| {
            let (time_s, _) = self.reports[at];
            match at.checked_sub(1).filter(|_| !reports_when_set) {
                Some(before) => 0.5 * (self.reports[before].0 + time_s),
                None => time_s,
            }
        };
        let ends_s: Vec<f64> = (samples.windows(2))
            .map(|pair| 0.5 * (pair[0].time_s + pair[1].time_s))
            .chain([f64::INFINITY])
            .collect();
        let mut at = 0;
        for (sample, end_s) in samples.iter_mut().zip(ends_s) {
            while at + 1 < self.reports.len() && begin_s(at + 1) < end_s {
                at += 1;
            }
            sample.thrust = self.reports[at].1;
        }
        (samples, ThrustSource::Reported)
    }
}

fn is_finite(position: &LOCAL_POSITION_NED_DATA) -> bool {
    let all = [
        position.x,
        position.y,
        position.z,
        position.vx,
        position.vy,
        position.vz,
    ];
    all.iter().all(|value| value.is_finite())
}
