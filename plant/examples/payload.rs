//! A tuned quadrotor under a payload, a steady force and a steady torque, with and without the integral beside its
//! controllers: `cargo run -p onecycle-plant --example payload`.
//!
//! Altitude, roll and pitch are tuned in flight, then the disturbance begins and stays. Medians over the flights of: the
//! largest error of the axis, its mean error from 4 to 6 s after the beginning, and the ISE of these 6 s.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle_onboard::integral::USUAL_PHASE_RAD;
use onecycle_plant::Noise;
use onecycle_plant::multirotor::pilot::TICK_S;
use onecycle_plant::multirotor::{Axis, Flight, Nudge, Pilot, Vec3, Vehicle};

const FLIGHTS: u64 = 20;
/// Time under the disturbance (s), and the part of it in which the offset is measured.
const LASTS_S: f64 = 6.0;
const SETTLED_S: f64 = 4.0;

/// What begins.
#[derive(Clone, Copy)]
enum Event {
    /// A fifth of the mass.
    Payload,
    /// A downdraught of 1 N, 8 % of the weight.
    Downdraught,
    /// 0.03 N m: the payload 1.1 cm off the middle.
    Torque,
    /// A step of the reference by 0.1 m.
    Step,
}

impl Event {
    const ALL: [(Self, Axis, &'static str); 4] = [
        (
            Self::Payload,
            Axis::Altitude,
            "payload of 20 %, altitude (mm)",
        ),
        (
            Self::Downdraught,
            Axis::Altitude,
            "force of 1 N, altitude (mm)",
        ),
        (Self::Torque, Axis::Roll, "torque of 0.03 N m, roll (mrad)"),
        (Self::Step, Axis::Altitude, "step of 100 mm, altitude (mm)"),
    ];

    fn begin(self, pilot: &mut Pilot) -> Result<(), Box<dyn Error>> {
        let flight = &mut pilot.flight;
        let steady = |force_n, torque_nm| Nudge {
            force_n,
            torque_nm,
            duration_s: 2.0 * LASTS_S,
        };
        match self {
            Self::Payload => {
                let vehicle = *flight.vehicle();
                let mass_kg = vehicle.parts().body.mass_kg;
                flight.set_vehicle(vehicle.with_payload(0.2 * mass_kg, 0.0)?);
            }
            Self::Downdraught => flight.nudge(steady(Vec3::new(0.0, 0.0, -1.0), Vec3::ZERO))?,
            Self::Torque => flight.nudge(steady(Vec3::ZERO, Vec3::new(0.03, 0.0, 0.0)))?,
            Self::Step => pilot.references[Axis::Altitude.index()] += 0.1,
        }
        Ok(())
    }
}

/// Largest error, offset, and ISE, in thousandths (of a metre or a radian; of their squares times seconds).
fn fly(event: Event, axis: Axis, phase_rad: f32, seed: u64) -> Result<[f64; 3], Box<dyn Error>> {
    let vehicle = Vehicle::quadrotor();
    let hover = vehicle.hover(1.0, Vec3::ZERO)?;
    let mut settings = Axis::ALL.map(Axis::settings);
    settings[Axis::Altitude.index()].safe.offset = hover.thrust_command() as f32;
    for settings in &mut settings {
        settings.integral_phase_rad = phase_rad;
    }
    let flight = Flight::new(vehicle, hover.state(Vec3::new(0.0, 0.0, 1.0)))?;
    let mut pilot = Pilot::new(flight, &settings, Noise::from_seed(seed))?;
    pilot.references[Axis::Altitude.index()] = 1.0;
    pilot.run(3.0);
    pilot.tune(&[Axis::Altitude])?;
    pilot.tune(&[Axis::Roll, Axis::Pitch])?;
    pilot.run(5.0);
    event.begin(&mut pilot)?;
    let [mut largest, mut offset, mut ise] = [0.0_f64; 3];
    for tick in 0..(LASTS_S / TICK_S) as usize {
        pilot.tick();
        let (value, _) = axis.of(&pilot.flight.reading());
        let error = 1e3 * (pilot.references[axis.index()] - value);
        let from_s = tick as f64 * TICK_S;
        largest = match event {
            Event::Step => largest.max(-error),
            _ => largest.max(error.abs()),
        };
        ise += 1e-3 * error * error * TICK_S;
        if from_s >= SETTLED_S {
            offset += error * TICK_S / (LASTS_S - SETTLED_S);
        }
    }
    Ok([largest, offset, ise])
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("{FLIGHTS} flights, medians: without and with the integral");
    for (event, axis, name) in Event::ALL {
        print!("{name:32}");
        for phase_rad in [0.0, USUAL_PHASE_RAD] {
            let flown: Result<Vec<[f64; 3]>, _> = (1..=FLIGHTS)
                .map(|seed| fly(event, axis, phase_rad, seed))
                .collect();
            let flown = flown?;
            let [largest, offset, ise] =
                [0, 1, 2].map(|k| median(flown.iter().map(|one| one[k]).collect()));
            print!("  largest {largest:7.2}  offset {offset:7.3}  ISE {ise:8.4}");
        }
        println!();
    }
    Ok(())
}
