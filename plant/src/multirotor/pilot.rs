//! Vehicle with a tuner on each axis, for missions.
//!
//! From the first tick on each axis is controlled by its own [`Tuner`]: by the poor controller that a builder
//! would begin with, then by the relay, then by the controller found.

use std::fmt;

use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::{Abort, Limits};
use onecycle_onboard::identification::TuningResult;
use onecycle_onboard::tuner::{
    Consent, TakeOffSettings, Tuner, TunerError, TunerPhase, TunerSettings,
};
use onecycle_onboard::{RelaySettings, Soiptd};

use super::body::GRAVITY_M_PER_S2;
use super::error::VehicleError;
use super::flight::Flight;
use super::frames::Vec3;
use super::hover::Axis;
use super::mixer::Command;
use super::sensors::SensorReading;
use super::vehicle::Vehicle;
use crate::Noise;

/// Time between ticks (s): the paper's 1 kHz.
pub const TICK_S: f64 = 0.001;

impl Axis {
    /// All axes, in the order in which a vehicle is tuned.
    pub const ALL: [Self; 4] = [Self::Altitude, Self::Roll, Self::Pitch, Self::Yaw];

    /// Name of the axis.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Altitude => "altitude",
            Self::Roll => "roll",
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
        }
    }

    /// Index in [`Axis::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Output of the axis in a reading (m or rad), and its rate.
    #[must_use]
    pub fn of(self, reading: &SensorReading) -> (f64, f64) {
        let SensorReading {
            position_m,
            velocity_m_per_s,
            angles_rad,
            rates_rad_per_s,
        } = reading;
        match self {
            Self::Altitude => (position_m.z, velocity_m_per_s.z),
            Self::Roll => (angles_rad.x, rates_rad_per_s.x),
            Self::Pitch => (angles_rad.y, rates_rad_per_s.y),
            Self::Yaw => (angles_rad.z, rates_rad_per_s.z),
        }
    }

    /// Settings for a quadrotor of one to two kilograms before anything is known about it. Commands are
    /// fractions of a motor's full static thrust; one unit gives about 20 m/s^2 of altitude, 300 rad/s^2 of roll
    /// and pitch and 25 rad/s^2 of yaw.
    #[must_use]
    pub fn settings(self) -> TunerSettings {
        // Relay: a quarter of g, 10 rad/s^2 of roll and pitch, 9 rad/s^2 of yaw. Noise: half a millimetre of a
        // camera, three hundredths of a degree of angles.
        let (amplitude, noise_sigma) = match self {
            Self::Altitude => (0.12, 5e-4),
            Self::Roll | Self::Pitch => (0.03, 5e-4),
            Self::Yaw => (0.35, 5e-4),
        };
        // Poor controller: damped, with poles of 1.5 to 4.5 1/s, a quarter of those after tuning.
        let (kp, kd) = match self {
            Self::Altitude => (0.11, 0.14),
            Self::Roll | Self::Pitch => (0.06, 0.02),
            Self::Yaw => (0.2, 0.12),
        };
        let (excursion, rate) = match self {
            Self::Altitude => (1.0, 3.0),
            Self::Roll | Self::Pitch | Self::Yaw => (0.7, 8.0),
        };
        let new = TunerSettings::new(amplitude, TICK_S as f32);
        let (output_lowest, output_highest) = match self {
            Self::Altitude => (0.0, 1.0),
            Self::Roll | Self::Pitch | Self::Yaw => (-0.45, 0.45),
        };
        TunerSettings {
            relay: RelaySettings {
                noise_sigma,
                ..new.relay
            },
            limits: Limits {
                excursion,
                rate,
                duration_s: 40.0,
                no_switch_s: 5.0,
                stale_s: 0.01,
            },
            output_lowest,
            output_highest,
            safe: PdLaw {
                kp,
                kd,
                offset: 0.0,
            },
            bias_filter_s: 0.5,
            consent: Consent::Automatic,
            ..new
        }
    }

    /// Like [`Axis::settings`], for a vehicle on the ground.
    #[must_use]
    pub fn settings_for_take_off(self) -> TunerSettings {
        let settings = self.settings();
        TunerSettings {
            take_off: Some(TakeOffSettings {
                gain: 0.3,
                climb: 0.2,
            }),
            relay: RelaySettings {
                plain_switches: 1,
                ramp_switches: 2,
                ..settings.relay
            },
            safe: PdLaw::ZERO,
            bias_filter_s: 0.0,
            ..settings
        }
    }
}

/// Result for an axis, and the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tuned {
    /// The axis.
    pub axis: Axis,
    /// Start of its test (s).
    pub from_s: f64,
    /// Time at which its controller was proven (s).
    pub until_s: f64,
    /// Result of the test.
    pub identified: TuningResult,
    /// Process of the vehicle at that time.
    pub truth: Soiptd,
}

/// One tick of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FlightRecord {
    /// Time (s).
    pub time_s: f64,
    /// True values.
    pub reading: SensorReading,
    /// Measurements of the tuners, in the order of [`Axis::ALL`] (m or rad).
    pub measured: [f64; 4],
    /// Commands held from then on.
    pub commands: [f64; 4],
    /// Phases of the tuners.
    pub phases: [TunerPhase; 4],
}

/// Why a mission ended early.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MissionError {
    /// A parameter of the vehicle is out of range, or it cannot hover.
    Vehicle(VehicleError),
    /// A setting of a tuner is out of range.
    Settings(TunerError),
    /// An axis was not tuned: the reason, or `None` if it took too long.
    NotTuned(Axis, Option<Abort>),
}

impl fmt::Display for MissionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vehicle(error) => error.fmt(f),
            Self::Settings(error) => error.fmt(f),
            Self::NotTuned(axis, Some(reason)) => write!(f, "{}: {reason}", axis.name()),
            Self::NotTuned(axis, None) => write!(f, "{}: the test takes too long", axis.name()),
        }
    }
}

impl std::error::Error for MissionError {}

impl From<VehicleError> for MissionError {
    fn from(error: VehicleError) -> Self {
        Self::Vehicle(error)
    }
}

impl From<TunerError> for MissionError {
    fn from(error: TunerError) -> Self {
        Self::Settings(error)
    }
}

/// Four tuners and a vehicle in flight.
pub struct Pilot {
    /// The vehicle.
    pub flight: Flight,
    /// References of the axes (m or rad).
    pub references: [f64; 4],
    /// Whether roll and pitch are steered to keep the vehicle above its starting point. While they are tuned
    /// they are not: a tuner keeps the reference of its start.
    pub holds_position: bool,
    noise: Noise,
    tuners: [Tuner<'static>; 4],
    ticks: u64,
    records: Vec<FlightRecord>,
}

impl Pilot {
    /// A pilot with the settings of each axis, in the order of [`Axis::ALL`].
    ///
    /// # Errors
    /// [`MissionError::Settings`] if a setting is out of range.
    pub fn new(
        flight: Flight,
        settings: &[TunerSettings; 4],
        noise: Noise,
    ) -> Result<Self, MissionError> {
        let [altitude, roll, pitch, yaw] = settings.each_ref().map(Tuner::new);
        Ok(Self {
            flight,
            references: [0.0; 4],
            holds_position: false,
            noise,
            tuners: [altitude?, roll?, pitch?, yaw?],
            ticks: 0,
            records: Vec::new(),
        })
    }

    /// The tuner of an axis.
    #[must_use]
    pub fn tuner(&self, axis: Axis) -> &Tuner<'static> {
        &self.tuners[axis.index()]
    }

    /// Time of the next tick (s).
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.ticks as f64 * TICK_S
    }

    /// One tick of sensors, tuners and vehicle.
    pub fn tick(&mut self) {
        let (time_s, sensed) = (self.time_s(), self.flight.sense(&mut self.noise));
        if self.holds_position {
            let [roll_rad, pitch_rad] = tilt(&sensed);
            self.references[Axis::Roll.index()] = roll_rad;
            self.references[Axis::Pitch.index()] = pitch_rad;
        }
        let mut record = FlightRecord {
            time_s,
            reading: self.flight.reading(),
            measured: [0.0; 4],
            commands: [0.0; 4],
            phases: [TunerPhase::Idle; 4],
        };
        for axis in Axis::ALL {
            let (index, (value, rate)) = (axis.index(), axis.of(&sensed));
            let measurement = Measurement::of(value as f32).with_rate(rate as f32);
            let reference = self.references[index] as f32;
            let tuner = &mut self.tuners[index];
            record.measured[index] = value;
            record.commands[index] = f64::from(tuner.step(time_s, &measurement, reference));
            record.phases[index] = tuner.phase();
        }
        let [thrust, roll, pitch, yaw] = record.commands;
        let command = Command {
            thrust,
            roll,
            pitch,
            yaw,
        };
        self.flight.step(command, TICK_S, &mut self.noise);
        self.records.push(record);
        self.ticks += 1;
    }

    /// Runs ticks for this time (s).
    pub fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / TICK_S).round() as u64 {
            self.tick();
        }
    }

    /// Tunes axes at the same time until each controller has proven itself.
    ///
    /// # Errors
    /// [`MissionError::NotTuned`] with the axis and the reason.
    pub fn tune(&mut self, axes: &[Axis]) -> Result<Vec<Tuned>, MissionError> {
        // Twice the time that the guards allow for a test.
        const MOST_S: f64 = 80.0;
        let from_s = self.time_s();
        for axis in axes {
            self.tuners[axis.index()].start();
        }
        let mut tuned: Vec<Tuned> = Vec::new();
        while tuned.len() < axes.len() {
            self.tick();
            for &axis in axes {
                let tuner = self.tuner(axis);
                if tuner.phase() == TunerPhase::Aborted || self.time_s() - from_s > MOST_S {
                    return Err(MissionError::NotTuned(axis, tuner.reason()));
                }
                if tuner.is_proven()
                    && let Some(&identified) = tuner.identified()
                    && tuned.iter().all(|other| other.axis != axis)
                {
                    tuned.push(Tuned {
                        axis,
                        from_s,
                        until_s: self.time_s(),
                        identified,
                        truth: self.truth(axis)?,
                    });
                }
            }
        }
        Ok(tuned)
    }

    /// Process of an axis of the present vehicle in calm air.
    ///
    /// # Errors
    /// If the vehicle cannot hover.
    pub fn truth(&self, axis: Axis) -> Result<Soiptd, VehicleError> {
        let charge = self.flight.state().charge;
        let hover = self.flight.vehicle().hover(charge, Vec3::ZERO)?;
        hover.linearised(axis)
    }

    /// All ticks of the flight.
    #[must_use]
    pub fn into_records(self) -> Vec<FlightRecord> {
        self.records
    }
}

/// Roll and pitch (rad) that return the vehicle to the point above its start, with a double pole at 0.8 1/s. A
/// tilt of `a` accelerates by `g a`, to the right or forward.
fn tilt(sensed: &SensorReading) -> [f64; 2] {
    const POLE_PER_S: f64 = 0.8;
    const MOST_RAD: f64 = 0.25;
    let (at, speed) = (sensed.position_m, sensed.velocity_m_per_s);
    let wanted = |at: f64, speed: f64| -POLE_PER_S * (POLE_PER_S * at + 2.0 * speed);
    let tilt = |acceleration: f64| (acceleration / GRAVITY_M_PER_S2).clamp(-MOST_RAD, MOST_RAD);
    [-tilt(wanted(at.y, speed.y)), tilt(wanted(at.x, speed.x))]
}

/// A flight at hover at this altitude (m) with a full battery.
pub(super) fn hovering(vehicle: Vehicle, altitude_m: f64) -> Result<Flight, VehicleError> {
    let hover = vehicle.hover(1.0, Vec3::ZERO)?;
    Flight::new(vehicle, hover.state(Vec3::new(0.0, 0.0, altitude_m)))
}
