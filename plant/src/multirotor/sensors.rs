//! Sensors of the multirotor, with delay and noise.
//!
//! A channel reads the true value of `delay_s` ago, by linear interpolation between the inner steps of the
//! flight. That is exact if the delay is a multiple of the step; otherwise the error is below an eighth of the
//! second derivative times the squared step, 2.5 micrometres at 20 m/s^2 and 1 ms. Before the flight is as old
//! as the delay, a channel reads the initial value.

use std::collections::VecDeque;
use std::f64::consts::PI;

use super::error::{VehicleError, at_least_zero};
use super::frames::Vec3;
use crate::{NoiseSource, Sensor};

/// A channel; all its components have the same noise and delay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Channel {
    /// Noise and quantum.
    pub sensor: Sensor,
    /// Delay (s).
    pub delay_s: f64,
}

impl Channel {
    fn check(&self, name: &'static str) -> Result<(), VehicleError> {
        at_least_zero(name, self.delay_s)?;
        at_least_zero(name, self.sensor.noise_sigma)?;
        at_least_zero(name, self.sensor.quantum)
    }

    fn read(&self, at: Vec3, noise: &mut impl NoiseSource) -> Vec3 {
        Vec3::new(
            self.sensor.read(at.x, noise),
            self.sensor.read(at.y, noise),
            self.sensor.read(at.z, noise),
        )
    }
}

/// All channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Position (m).
    pub position: Channel,
    /// Velocity (m/s).
    pub velocity: Channel,
    /// Roll, pitch, yaw (rad).
    pub angles: Channel,
    /// Rates about the axes of the body (rad/s).
    pub rates: Channel,
}

impl Sensors {
    /// The same delays without noise and rounding.
    #[must_use]
    pub fn without_noise(&self) -> Self {
        let quiet = |channel: Channel| Channel {
            sensor: Sensor::default(),
            ..channel
        };
        Self {
            position: quiet(self.position),
            velocity: quiet(self.velocity),
            angles: quiet(self.angles),
            rates: quiet(self.rates),
        }
    }

    pub(super) fn check(&self) -> Result<(), VehicleError> {
        self.position.check("position sensor")?;
        self.velocity.check("velocity sensor")?;
        self.angles.check("sensor of the angles")?;
        self.rates.check("sensor of the rates")
    }

    fn longest_delay_s(&self) -> f64 {
        let position_s = self.position.delay_s.max(self.velocity.delay_s);
        position_s.max(self.angles.delay_s).max(self.rates.delay_s)
    }
}

/// Measured quantities, of the middle of the vehicle between the hubs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorReading {
    /// Position (m, world). `z` is the altitude, zero where the vehicle stood.
    pub position_m: Vec3,
    /// Velocity (m/s, world). `z` is the climb.
    pub velocity_m_per_s: Vec3,
    /// Roll, pitch and yaw (rad) as x, y and z.
    pub angles_rad: Vec3,
    /// Rates about the axes of the body (rad/s).
    pub rates_rad_per_s: Vec3,
}

/// The last true readings, as far back as the longest delay.
#[derive(Clone, Debug)]
pub(super) struct History {
    past: VecDeque<(f64, SensorReading)>,
    latest: (f64, SensorReading),
}

impl History {
    pub(super) fn new(time_s: f64, reading: SensorReading) -> Self {
        Self {
            past: VecDeque::new(),
            latest: (time_s, reading),
        }
    }

    /// Adds the reading of a later time and removes those that no sensor needs any more.
    pub(super) fn push(&mut self, time_s: f64, reading: SensorReading, sensors: &Sensors) {
        self.past.push_back(self.latest);
        self.latest = (time_s, reading);
        let oldest_s = time_s - sensors.longest_delay_s();
        while self.past.get(1).is_some_and(|(t, _)| *t <= oldest_s) {
            self.past.pop_front();
        }
    }

    /// Present readings of the sensors.
    pub(super) fn read(&self, sensors: &Sensors, noise: &mut impl NoiseSource) -> SensorReading {
        let ago = |channel: &Channel| self.ago(channel.delay_s);
        let Sensors {
            position,
            velocity,
            angles,
            rates,
        } = sensors;
        SensorReading {
            position_m: position.read(ago(position).position_m, noise),
            velocity_m_per_s: velocity.read(ago(velocity).velocity_m_per_s, noise),
            angles_rad: angles.read(ago(angles).angles_rad, noise),
            rates_rad_per_s: rates.read(ago(rates).rates_rad_per_s, noise),
        }
    }

    fn ago(&self, delay_s: f64) -> SensorReading {
        let time_s = self.latest.0 - delay_s;
        let after = self.past.partition_point(|(t, _)| *t <= time_s);
        let Some(before) = after.checked_sub(1).and_then(|i| self.past.get(i)) else {
            return self.past.front().unwrap_or(&self.latest).1;
        };
        let next = self.past.get(after).unwrap_or(&self.latest);
        let share = ((time_s - before.0) / (next.0 - before.0)).min(1.0);
        between(&before.1, &next.1, share)
    }
}

fn between(a: &SensorReading, b: &SensorReading, share: f64) -> SensorReading {
    let mix = |a: Vec3, b: Vec3| a + (b - a) * share;
    // By the shorter way, and back into -pi..pi.
    let wrapped = |angle: f64| angle - 2.0 * PI * (angle / (2.0 * PI)).round();
    let angle = |a: f64, b: f64| wrapped(a + share * wrapped(b - a));
    SensorReading {
        position_m: mix(a.position_m, b.position_m),
        velocity_m_per_s: mix(a.velocity_m_per_s, b.velocity_m_per_s),
        angles_rad: Vec3::new(
            angle(a.angles_rad.x, b.angles_rad.x),
            angle(a.angles_rad.y, b.angles_rad.y),
            angle(a.angles_rad.z, b.angles_rad.z),
        ),
        rates_rad_per_s: mix(a.rates_rad_per_s, b.rates_rad_per_s),
    }
}
