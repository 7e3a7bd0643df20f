//! The test in flight: what is sent and awaited, in the order of time.

use std::time::Duration;

use mavlink::MessageData;
use mavlink::dialects::common::{
    ATTITUDE_DATA, ATTITUDE_TARGET_DATA, EXTENDED_SYS_STATE_DATA, LOCAL_POSITION_NED_DATA, MavCmd,
    MavLandedState, MavMessage, RC_CHANNELS_DATA,
};

use super::pilot::{Hover, Pilot, set_thrust};
use super::samples::Run;
use super::{
    AltitudeAbort, AltitudeFlight, AltitudeRefusal, AltitudeTest, HandBack, LEAST_RATE_HZ, STALE,
};
use crate::error::LiveError;
use crate::vehicle::Vehicle;

/// How long the hover is averaged.
const MEASURE: Duration = Duration::from_secs(3);
/// Time between two set-points while no sample comes.
const REPEAT: Duration = Duration::from_millis(50);
/// How long the mode of the test is awaited; PX4 wants a second of set-points before.
const TAKE: Duration = Duration::from_secs(5);
const BEFORE: Duration = Duration::from_millis(1200);
/// Time between two commands of a mode.
const AGAIN: Duration = Duration::from_millis(400);
/// How long it is awaited that the vehicle holds its place.
const HOLD: Duration = Duration::from_secs(8);
/// Speed below which it holds (m/s).
const HOLDS_M_PER_S: f32 = 0.3;
/// How long it is awaited that the vehicle hovers.
const SETTLE: Duration = Duration::from_secs(20);
/// A vehicle that moves faster does not hover (m/s).
const MOST_HOVER_M_PER_S: f64 = 0.5;
/// Deflection of a stick that ends the test (us of the pulse, of 500).
const STICK_US: u16 = 100;
/// Rates that are asked for (Hz), by message. A slow link carries less.
const STREAMS: [(u32, f32); 4] = [
    (LOCAL_POSITION_NED_DATA::ID, 100.0),
    (ATTITUDE_TARGET_DATA::ID, 100.0),
    (ATTITUDE_DATA::ID, 10.0),
    (RC_CHANNELS_DATA::ID, 10.0),
];

impl Vehicle {
    /// Flies the relay test of the altitude. `is_over` is asked all the time: true ends the test.
    ///
    /// # Errors
    /// The test cannot begin; the vehicle hovers in its mode as before. What happens later is in the result.
    pub fn altitude_test(
        &mut self,
        test: AltitudeTest,
        is_over: &dyn Fn() -> bool,
    ) -> Result<AltitudeFlight, AltitudeRefusal> {
        let pilot = Pilot::of(self)?;
        self.check_flying()?;
        for (message, rate_hz) in STREAMS {
            // Not every firmware has each of them.
            let interval_us = 1e6 / rate_hz;
            let parameters = [message as f32, interval_us, 0.0];
            match self.command(
                "the message rates",
                MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
                parameters,
            ) {
                Ok(()) | Err(LiveError::Refused { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let hover = self.await_hover(is_over)?;
        let room = test.amplitude..=1.0 - test.amplitude;
        if !room.contains(&hover.thrust) {
            return Err(AltitudeRefusal::Thrust(hover.thrust));
        }
        let restoring = pilot.prepare(self)?;
        let flown = self.fly(pilot, &hover, test, is_over);
        let is_restored = restoring.map(|plan| Pilot::restore(self, &plan));
        let not_restored = || AltitudeRefusal::Options("its bit 3 is left set".to_owned());
        let mut flight = match is_restored {
            Some(false) => flown.map_err(|_| not_restored())?,
            _ => flown?,
        };
        flight.is_restored = is_restored;
        Ok(flight)
    }

    fn check_flying(&mut self) -> Result<(), AltitudeRefusal> {
        self.request(EXTENDED_SYS_STATE_DATA::ID);
        let until = self.now() + MEASURE;
        while self.seen.extended.is_none() && self.receive(until).is_some() {}
        let state = self.seen.extended.as_ref().map(|of| of.landed_state);
        let is_on_ground = state == Some(MavLandedState::MAV_LANDED_STATE_ON_GROUND);
        match self.is_armed() && !is_on_ground {
            true => Ok(()),
            false => Err(AltitudeRefusal::NotFlying),
        }
    }

    /// Averages of the hover, as soon as the vehicle has come to rest.
    fn await_hover(&mut self, is_over: &dyn Fn() -> bool) -> Result<Hover, AltitudeRefusal> {
        let end = self.now() + SETTLE;
        loop {
            match self.measure_hover() {
                Err(AltitudeRefusal::Moving(_)) if self.now() < end && !is_over() => {}
                measured => return measured,
            }
        }
    }

    /// Averages of the hover.
    fn measure_hover(&mut self) -> Result<Hover, AltitudeRefusal> {
        let (mut thrusts, mut heights) = (Vec::new(), Vec::new());
        let mut fastest = 0.0_f64;
        let (mut sines, mut cosines) = ([0.0; 3], [0.0; 3]);
        let begin = self.now();
        while let Some(message) = self.receive(begin + MEASURE) {
            match message {
                MavMessage::LOCAL_POSITION_NED(of) => {
                    let speed = of.vx.hypot(of.vy).hypot(of.vz);
                    fastest = fastest.max(speed.into());
                    heights.push(f64::from(-of.z));
                }
                MavMessage::ATTITUDE_TARGET(of) => thrusts.push(f64::from(of.thrust)),
                MavMessage::ATTITUDE(of) => {
                    for (axis, angle) in [of.roll, of.pitch, of.yaw].into_iter().enumerate() {
                        sines[axis] += f64::from(angle).sin();
                        cosines[axis] += f64::from(angle).cos();
                    }
                }
                _ => {}
            }
        }
        let rate_hz = heights.len() as f64 / MEASURE.as_secs_f64();
        let Some(place) = self
            .seen
            .position
            .clone()
            .filter(|_| rate_hz >= LEAST_RATE_HZ)
        else {
            return Err(AltitudeRefusal::Rate(rate_hz));
        };
        if fastest > MOST_HOVER_M_PER_S {
            return Err(AltitudeRefusal::Moving(fastest));
        }
        let thrust = mean(&thrusts).unwrap_or(f64::NAN);
        if self.seen.attitude.is_none() || !thrust.is_finite() {
            return Err(AltitudeRefusal::Thrust(thrust));
        }
        let height_m = mean(&heights).unwrap_or_default();
        let squares: Vec<f64> = heights.iter().map(|own| (own - height_m).powi(2)).collect();
        Ok(Hover {
            thrust,
            angles_rad: [0, 1, 2].map(|axis| f64::atan2(sines[axis], cosines[axis])),
            place_m: [place.x, place.y, place.z],
            wander_m: mean(&squares).unwrap_or_default().sqrt(),
        })
    }

    /// From taking over to handing back.
    fn fly(
        &mut self,
        pilot: Pilot,
        hover: &Hover,
        test: AltitudeTest,
        is_over: &dyn Fn() -> bool,
    ) -> Result<AltitudeFlight, AltitudeRefusal> {
        let taken = self.take_over(pilot, hover);
        let start = self.seen.position.clone();
        let run = (start.as_ref().ok_or(AltitudeRefusal::Rate(0.0)))
            .and_then(|start| Ok(Run::new(test, hover.thrust, start, hover.wander_m)?));
        let mut run = match (taken, run) {
            (Ok(()), Ok(run)) => run,
            (Err(refusal), _) | (_, Err(refusal)) => {
                self.hand_back(pilot, hover);
                return Err(refusal);
            }
        };
        let abort = self.oscillate(pilot, hover, &mut run, is_over).err();
        let hand_back = self.hand_back(pilot, hover);
        let beta = run.beta();
        let (samples, source) = run.recorded(pilot == Pilot::Px4);
        Ok(AltitudeFlight {
            test,
            firmware: pilot.firmware(),
            samples,
            hover_thrust: hover.thrust,
            beta,
            source,
            abort,
            hand_back,
            is_restored: None,
        })
    }

    /// Sends the thrust of the hover until the vehicle is in the mode of the test.
    fn take_over(&mut self, pilot: Pilot, hover: &Hover) -> Result<(), AltitudeRefusal> {
        let begin = self.now();
        let mut asked = begin + BEFORE;
        if pilot.is_testing(self) {
            set_thrust(self, hover, hover.thrust);
            return Ok(());
        }
        while self.now() < begin + TAKE {
            set_thrust(self, hover, hover.thrust);
            if self.now() >= asked {
                asked = self.now() + AGAIN;
                pilot.take(self);
            }
            let until = self.now() + REPEAT;
            while self.receive(until).is_some() {}
            if pilot.is_testing(self) {
                return Ok(());
            }
            if pilot.is_taken(self) {
                break;
            }
        }
        Err(AltitudeRefusal::NoMode(pilot.testing_name()))
    }

    /// Answers every sample with a thrust until the cycles are complete.
    fn oscillate(
        &mut self,
        pilot: Pilot,
        hover: &Hover,
        run: &mut Run,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(), AltitudeAbort> {
        let mut thrust = hover.thrust;
        let (mut sampled, mut sent) = (self.now(), self.now());
        let mut sticks: Option<[u16; 4]> = None;
        while !run.is_complete() {
            match self.receive(sent + REPEAT) {
                Some(MavMessage::LOCAL_POSITION_NED(position)) => {
                    if let Some(set) = run.sample(&position)? {
                        (sampled, sent, thrust) = (self.now(), self.now(), set);
                        set_thrust(self, hover, thrust);
                    }
                }
                Some(MavMessage::ATTITUDE_TARGET(target)) => run.report(&target),
                Some(MavMessage::RC_CHANNELS(now)) => {
                    let first = *sticks.get_or_insert_with(|| channels(&now));
                    let moved = |(now, first): (u16, u16)| now.abs_diff(first) > STICK_US;
                    if channels(&now).into_iter().zip(first).any(moved) {
                        return Err(AltitudeAbort::Stick);
                    }
                }
                Some(MavMessage::HEARTBEAT(heartbeat)) if !pilot.is_testing(self) => {
                    return Err(AltitudeAbort::Mode(crate::mode::name(&heartbeat)));
                }
                Some(MavMessage::HEARTBEAT(_)) if !self.is_armed() => {
                    return Err(AltitudeAbort::Disarmed);
                }
                _ => {}
            }
            let silent = self.now() - sampled;
            if silent > STALE {
                return Err(AltitudeAbort::Stale(silent.as_secs_f64()));
            }
            if is_over() {
                return Err(AltitudeAbort::Operator);
            }
            if self.now() >= sent + REPEAT {
                sent = self.now();
                set_thrust(self, hover, thrust);
            }
        }
        Ok(())
    }

    /// Lets the vehicle hold its place, unless the pilot has it; and waits until it does.
    fn hand_back(&mut self, pilot: Pilot, hover: &Hover) -> HandBack {
        let end = self.now() + HOLD;
        let mut still_since = None;
        while self.now() < end {
            if pilot.is_taken(self) || !self.is_armed() {
                return HandBack::NotOurs;
            }
            pilot.hand_back(self, hover);
            let until = self.now() + AGAIN;
            while let Some(message) = self.receive(until) {
                let MavMessage::LOCAL_POSITION_NED(position) = message else {
                    continue;
                };
                let is_still = pilot.is_holding(self) && position.vz.abs() < HOLDS_M_PER_S;
                still_since = still_since
                    .filter(|_| is_still)
                    .or(is_still.then(|| self.now()));
            }
            // A second of rest; the turning point of an oscillation is shorter.
            let is_held = |since| self.now() - since >= Duration::from_secs(1);
            if still_since.is_some_and(is_held) {
                return HandBack::Holds;
            }
        }
        HandBack::Unconfirmed
    }
}

fn channels(of: &RC_CHANNELS_DATA) -> [u16; 4] {
    [of.chan1_raw, of.chan2_raw, of.chan3_raw, of.chan4_raw]
}

fn mean(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}
