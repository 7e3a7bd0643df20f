//! The altitude of the scripted vehicle: an exact process, held by a controller of its own or by the thrust that it is told.

use std::time::Duration;

use mavlink::dialects::common::*;
use onecycle_onboard::Soiptd;
use onecycle_plant::FixedStepProcess;

/// Step of the simulation.
const STEP: Duration = Duration::from_millis(1);
/// Height of the origin of the process (m), and thrust of the hover.
pub(crate) const HEIGHT_M: f64 = 10.0;
pub(crate) const HOVER: f64 = 0.5;
/// Time for which the vehicle is on, when the connection is opened.
const ON_FOR: Duration = Duration::from_secs(100);

pub(crate) struct Hovering {
    process: FixedStepProcess,
    now: Duration,
    thrust: f64,
    command: f64,
    place_m: f64,
    pub(crate) has_attitude_target: bool,
    pub(crate) stick_us: u16,
    /// Speed of a wind that carries the vehicle away (m/s).
    pub(crate) wind_m_per_s: f32,
    /// Whether it reports the thrust that it sets.
    pub(crate) reports: bool,
    /// Every how many rounds of 20 ms the position is sent.
    pub(crate) every: u64,
    /// Whether a report has the time of the set-point, as that of PX4, or its own.
    pub(crate) reports_when_set: bool,
    set_ms: u32,
    /// Factor of the thrust in the air, such as 0.7 after a motor has failed.
    pub(crate) lift: f64,
    /// What its clock is ahead of the time.
    pub(crate) on_for: Duration,
}

impl Hovering {
    pub(crate) fn new(process: &Soiptd) -> Self {
        Self {
            process: FixedStepProcess::new(process, STEP.as_secs_f64()),
            now: Duration::ZERO,
            thrust: HOVER,
            command: HOVER,
            place_m: HEIGHT_M,
            has_attitude_target: false,
            stick_us: 1500,
            wind_m_per_s: 0.0,
            reports: true,
            every: 1,
            reports_when_set: false,
            set_ms: ON_FOR.as_millis() as u32,
            lift: 1.0,
            on_for: ON_FOR,
        }
    }

    pub(crate) fn height_m(&self) -> f64 {
        HEIGHT_M + self.process.output()
    }

    pub(crate) fn set_thrust(&mut self, thrust: f64) {
        self.command = thrust;
        self.set_ms = self.boot_ms();
        self.has_attitude_target = true;
    }

    pub(crate) fn set_place(&mut self, height_m: f64) {
        self.place_m = height_m;
        self.has_attitude_target = false;
    }

    pub(crate) fn advance(&mut self, to: Duration, is_testing: bool) {
        while self.now + STEP <= to {
            self.thrust = match is_testing {
                true => self.command,
                false => {
                    let error_m = self.place_m - self.height_m();
                    HOVER + 0.15 * error_m - 0.1 * self.process.rate()
                }
            };
            self.process.step(self.lift * self.thrust - HOVER);
            self.now += STEP;
        }
    }

    fn boot_ms(&self) -> u32 {
        (self.on_for + self.now).as_millis() as u32
    }

    pub(crate) fn position(&self) -> MavMessage {
        MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA {
            time_boot_ms: self.boot_ms(),
            x: self.wind_m_per_s * self.now.as_secs_f32(),
            z: -self.height_m() as f32,
            vx: self.wind_m_per_s,
            vz: -self.process.rate() as f32,
            ..LOCAL_POSITION_NED_DATA::DEFAULT
        })
    }

    /// Messages that it sends by itself every 20 ms.
    pub(crate) fn streams(&self, round: u64) -> Vec<MavMessage> {
        let mut messages = Vec::new();
        if round.is_multiple_of(self.every) {
            messages.push(self.position());
        }
        if self.reports {
            let time_boot_ms = match self.reports_when_set && self.has_attitude_target {
                true => self.set_ms,
                false => self.boot_ms(),
            };
            messages.push(MavMessage::ATTITUDE_TARGET(ATTITUDE_TARGET_DATA {
                time_boot_ms,
                thrust: self.thrust as f32,
                ..ATTITUDE_TARGET_DATA::DEFAULT
            }));
        }
        if round.is_multiple_of(5) {
            messages.push(MavMessage::ATTITUDE(ATTITUDE_DATA {
                time_boot_ms: self.boot_ms(),
                yaw: 1.0,
                ..ATTITUDE_DATA::DEFAULT
            }));
            messages.push(MavMessage::RC_CHANNELS(RC_CHANNELS_DATA {
                chan1_raw: 1500,
                chan2_raw: 1500,
                chan3_raw: self.stick_us,
                chan4_raw: 1500,
                ..RC_CHANNELS_DATA::DEFAULT
            }));
        }
        messages
    }
}
