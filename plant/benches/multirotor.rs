//! Steps per second of the six-degree-of-freedom vehicle.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use onecycle_plant::Noise;
use onecycle_plant::multirotor::{Command, Flight, Vec3, Vehicle, Wind};

const STEPS: usize = 20_000;

fn main() {
    divan::main();
}

fn hovering() -> (Flight, Command) {
    let vehicle = Vehicle::quadrotor();
    let hover = vehicle.hover(1.0, Vec3::ZERO).expect("it can hover");
    let state = hover.state(Vec3::new(0.0, 0.0, 2.0));
    let command = Command {
        thrust: hover.thrust_command(),
        ..Command::default()
    };
    (Flight::new(vehicle, state).expect("finite"), command)
}

/// 1 ms of flight in calm air.
#[divan::bench]
fn step(bencher: Bencher) {
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let ((mut flight, command), mut noise) = (hovering(), Noise::from_seed(1));
        for _ in 0..STEPS {
            flight.step(black_box(command), 1e-3, &mut noise);
        }
        flight.state().position_m.z
    });
}

/// 1 ms in gusts, then all sensors.
#[divan::bench]
fn step_in_gusts_and_sense(bencher: Bencher) {
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let ((mut flight, command), mut noise) = (hovering(), Noise::from_seed(1));
        let gusts = Wind::CALM.with_gusts(Vec3::new(1.0, 1.0, 0.5), 1.0);
        flight.set_wind(gusts).expect("in range");
        let mut sum = 0.0;
        for _ in 0..STEPS {
            flight.step(black_box(command), 1e-3, &mut noise);
            sum += flight.sense(&mut noise).position_m.z;
        }
        sum
    });
}

/// 1 ms standing on four feet.
#[divan::bench]
fn step_on_the_ground(bencher: Bencher) {
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let (mut flight, mut noise) = (Flight::standing(Vehicle::quadrotor()), Noise::from_seed(1));
        for _ in 0..STEPS {
            flight.step(black_box(Command::default()), 1e-3, &mut noise);
        }
        flight.state().position_m.z
    });
}
