//! Missions: the flights of the paper (section IV-D) as scripts.

use onecycle_onboard::RelaySettings;
use onecycle_onboard::tuner::TunerSettings;

use super::flight::Flight;
use super::frames::Vec3;
use super::hover::Axis;
use super::pilot::{FlightRecord, MissionError, Pilot, Tuned, hovering};
use super::vehicle::{Parts, Vehicle};
use super::wind::{Nudge, Wind};
use crate::Noise;

/// Payload of the paper (kg): 30 % of the vehicle.
pub const PAYLOAD_KG: f64 = 0.4;
/// Reference of the altitude (m).
const ALTITUDE_M: f64 = 1.0;
/// Step of the reference that shows the new controller (m, rad).
const STEP_M: f64 = 0.1;
/// Offset of the centre of mass to the left in the missions with a bias of roll (m): a third of the relay's
/// torque.
const OFF_CENTRE_M: f64 = 3e-4;

/// A mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mission {
    /// From the ground without a controller of the altitude, until a step of the altitude.
    Altitude,
    /// The same with the payload of the paper.
    Payload,
    /// Altitude under the relay long enough to look at five single cycles.
    Cycles,
    /// Roll with the centre of mass off the middle; the relay is offset by the mean output before.
    Roll,
    /// The same with the relay about zero.
    RollUncompensated,
    /// Weight, a blow and wind on the tuned vehicle.
    Disturbed,
    /// The same on the vehicle before tuning.
    DisturbedUntuned,
    /// From the ground until all four axes are tuned.
    Vehicle,
}

impl Mission {
    /// All missions.
    pub const ALL: [Self; 8] = [
        Self::Altitude,
        Self::Payload,
        Self::Cycles,
        Self::Roll,
        Self::RollUncompensated,
        Self::Disturbed,
        Self::DisturbedUntuned,
        Self::Vehicle,
    ];

    /// Name in arguments and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Altitude => "altitude",
            Self::Payload => "payload",
            Self::Cycles => "cycles",
            Self::Roll => "roll",
            Self::RollUncompensated => "roll-uncompensated",
            Self::Disturbed => "disturbed",
            Self::DisturbedUntuned => "disturbed-untuned",
            Self::Vehicle => "vehicle",
        }
    }
}

/// A flown mission.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Flown {
    /// All ticks.
    pub records: Vec<FlightRecord>,
    /// Tuned axes, in order.
    pub tuned: Vec<Tuned>,
    /// Events and their times (s).
    pub events: Vec<(f64, &'static str)>,
    /// Why the mission ended early, if it did.
    pub failure: Option<MissionError>,
}

/// Flies a mission with the sensor noise and the gusts of this seed.
///
/// # Errors
/// If the vehicle or its settings are invalid. A test that ends early is not an error but a
/// [`failure`](Flown::failure).
pub fn fly(mission: Mission, seed: u64) -> Result<Flown, MissionError> {
    let noise = Noise::from_seed(seed);
    match mission {
        Mission::Altitude => from_the_ground(Vehicle::quadrotor(), noise, &[]),
        Mission::Payload => {
            let vehicle = Vehicle::quadrotor().with_payload(PAYLOAD_KG, 0.0)?;
            from_the_ground(vehicle, noise, &[])
        }
        Mission::Vehicle => from_the_ground(
            Vehicle::quadrotor(),
            noise,
            &[&[Axis::Roll, Axis::Pitch, Axis::Yaw]],
        ),
        Mission::Cycles => cycles(noise),
        Mission::Roll => roll(noise, true),
        Mission::RollUncompensated => roll(noise, false),
        Mission::Disturbed => disturbed(noise, true),
        Mission::DisturbedUntuned => disturbed(noise, false),
    }
}

/// A mission in progress.
struct Script {
    pilot: Pilot,
    tuned: Vec<Tuned>,
    events: Vec<(f64, &'static str)>,
}

impl Script {
    fn new(
        flight: Flight,
        settings: &[TunerSettings; 4],
        references: [f64; 4],
        noise: Noise,
    ) -> Result<Self, MissionError> {
        let mut pilot = Pilot::new(flight, settings, noise)?;
        pilot.references = references;
        pilot.holds_position = true;
        Ok(Self {
            pilot,
            tuned: vec![],
            events: vec![],
        })
    }

    fn event(&mut self, name: &'static str) {
        self.events.push((self.pilot.time_s(), name));
    }

    fn tune(&mut self, axes: &[Axis]) -> Result<(), MissionError> {
        self.event("test begins");
        let tuned = self.pilot.tune(axes)?;
        self.tuned.extend(tuned);
        self.event("tuned");
        Ok(())
    }

    /// The flight up to its end, successful or not.
    fn end(self, outcome: Result<(), MissionError>) -> Flown {
        Flown {
            records: self.pilot.into_records(),
            tuned: self.tuned,
            events: self.events,
            failure: outcome.err(),
        }
    }
}

fn in_the_air() -> [TunerSettings; 4] {
    Axis::ALL.map(Axis::settings)
}

fn from_the_ground(
    vehicle: Vehicle,
    noise: Noise,
    then: &[&[Axis]],
) -> Result<Flown, MissionError> {
    let [_, roll, pitch, yaw] = in_the_air();
    let altitude = Axis::Altitude.settings_for_take_off();
    let settings = [altitude, roll, pitch, yaw];
    let flight = Flight::standing(vehicle);
    let mut script = Script::new(flight, &settings, [ALTITUDE_M, 0.0, 0.0, 0.0], noise)?;
    let outcome = (|| {
        // A moment to settle on the ground.
        script.pilot.run(0.1);
        script.tune(&[Axis::Altitude])?;
        for axes in then {
            script.tune(axes)?;
        }
        script.pilot.run(2.0);
        script.event("step");
        script.pilot.references[Axis::Altitude.index()] += STEP_M;
        script.pilot.run(4.0);
        Ok(())
    })();
    Ok(script.end(outcome))
}

/// A poor controller of the altitude with the right hover thrust.
fn hovering_settings(vehicle: &Vehicle) -> Result<[TunerSettings; 4], MissionError> {
    let mut settings = in_the_air();
    let hover = vehicle.hover(1.0, Vec3::ZERO)?;
    settings[Axis::Altitude.index()].safe.offset = hover.thrust_command() as f32;
    Ok(settings)
}

fn cycles(noise: Noise) -> Result<Flown, MissionError> {
    let vehicle = Vehicle::quadrotor();
    let mut settings = hovering_settings(&vehicle)?;
    // The maximum number of cycles; with the three before them that must be alike there are seven.
    settings[Axis::Altitude.index()].cycles = onecycle_onboard::identification::MOST_CYCLES;
    let flight = hovering(vehicle, ALTITUDE_M)?;
    let mut script = Script::new(flight, &settings, [ALTITUDE_M, 0.0, 0.0, 0.0], noise)?;
    script.pilot.run(3.0);
    let outcome = script.tune(&[Axis::Altitude]);
    Ok(script.end(outcome))
}

fn roll(noise: Noise, is_compensated: bool) -> Result<Flown, MissionError> {
    let mut parts = Parts::quadrotor();
    parts.body.centre_of_mass_m = Vec3::new(0.0, OFF_CENTRE_M, 0.0);
    let vehicle = Vehicle::new(parts)?;
    let mut settings = hovering_settings(&vehicle)?;
    let roll = &mut settings[Axis::Roll.index()];
    // The relay of the paper has no trim; only its offset compensates the bias.
    roll.relay = RelaySettings {
        trim_gain: 0.0,
        ..roll.relay
    };
    if !is_compensated {
        roll.bias_filter_s = 0.0;
    }
    let flight = hovering(vehicle, ALTITUDE_M)?;
    let mut script = Script::new(flight, &settings, [ALTITUDE_M, 0.0, 0.0, 0.0], noise)?;
    let outcome = (|| {
        script.pilot.run(4.0);
        script.tune(&[Axis::Roll])?;
        script.pilot.run(3.0);
        Ok(())
    })();
    Ok(script.end(outcome))
}

fn disturbed(noise: Noise, is_tuned: bool) -> Result<Flown, MissionError> {
    let vehicle = Vehicle::quadrotor();
    let settings = hovering_settings(&vehicle)?;
    let flight = hovering(vehicle, ALTITUDE_M)?;
    let mut script = Script::new(flight, &settings, [ALTITUDE_M, 0.0, 0.0, 0.0], noise)?;
    let outcome = (|| {
        script.pilot.run(3.0);
        if is_tuned {
            script.tune(&[Axis::Altitude])?;
            script.tune(&[Axis::Roll, Axis::Pitch])?;
        }
        script.pilot.run(2.0);
        script.event("+200 g");
        let loaded = vehicle.with_payload(0.5 * PAYLOAD_KG, 0.0)?;
        script.pilot.flight.set_vehicle(loaded);
        script.pilot.run(3.0);
        script.event("-200 g");
        script.pilot.flight.set_vehicle(vehicle);
        script.pilot.run(3.0);
        script.event("nudge");
        script.pilot.flight.nudge(Nudge {
            force_n: Vec3::new(0.0, 2.0, 2.0),
            torque_nm: Vec3::new(0.1, 0.1, 0.0),
            duration_s: 0.1,
        })?;
        script.pilot.run(3.0);
        script.event("wind of 5 m/s");
        script.pilot.flight.set_wind(Wind {
            steady_m_per_s: Vec3::new(0.0, 5.0, 0.0),
            gust_sigma_m_per_s: Vec3::new(0.5, 0.5, 0.25),
            gust_correlation_s: 1.0,
        })?;
        script.pilot.run(5.0);
        Ok(())
    })();
    Ok(script.end(outcome))
}
