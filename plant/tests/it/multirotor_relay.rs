//! Relay test on the vehicle and on its linear process: the data of an identification.

use onecycle_onboard::{Pd, Relay, RelaySettings, Soiptd};
use onecycle_plant::multirotor::{Axis, Command, Flight, Hover, Parts, Vec3, Vehicle};
use onecycle_plant::{Controller, Experiment, Noise, SampledPd, Sensed, Trace};

const TICK_S: f64 = 1e-3;
const SAMPLES: usize = 6000;
/// Samples that are compared: the last two seconds.
const TAIL: usize = 2000;

fn relay(amplitude: f64) -> Relay {
    let settings = RelaySettings {
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(amplitude as f32, RelaySettings::DISTINGUISHING_BETA)
    };
    Relay::new(settings).unwrap()
}

/// The relay on one axis from hover at 1 m, with ground effect and battery; the angles that it does not steer
/// are held by a PD controller.
fn flown(vehicle: Vehicle, hover: &Hover, axis: Axis, amplitude: f64) -> Trace {
    let mut flight = Flight::new(vehicle, hover.state(Vec3::new(0.0, 0.0, 1.0))).unwrap();
    let begin_m = flight.reading().position_m.z;
    let (mut relay, mut noise) = (relay(amplitude), Noise::from_seed(1));
    let mut trace = Trace::default();
    for sample in 0..SAMPLES {
        let (reading, truth) = (flight.sense(&mut noise), flight.reading());
        // Crossover at 331 rad/s^2 times 0.06: 20 rad/s.
        let hold = |angle: f64, rate: f64| {
            let sensed = Sensed {
                output: angle,
                rate,
            };
            SampledPd(Pd { kp: 0.5, kd: 0.06 }).step(TICK_S, 0.0, sensed)
        };
        let (angles, rates) = (reading.angles_rad, reading.rates_rad_per_s);
        let mut command = Command {
            thrust: hover.thrust_command(),
            roll: hold(angles.x, rates.x),
            pitch: hold(angles.y, rates.y),
            yaw: hold(angles.z, rates.z),
        };
        let (output, true_output) = if axis == Axis::Altitude {
            (reading.position_m.z - begin_m, truth.position_m.z - begin_m)
        } else {
            (angles.x, truth.angles_rad.x)
        };
        let input = f64::from(relay.step(-output as f32, TICK_S as f32));
        if axis == Axis::Altitude {
            command.thrust += input;
        } else {
            command.roll = input;
        }
        trace.push(sample as f64 * TICK_S, input, output, true_output);
        flight.step(command, TICK_S, &mut noise);
    }
    trace
}

fn simulated(process: Soiptd, amplitude: f64) -> Trace {
    let experiment = Experiment::new(process, TICK_S, SAMPLES as f64 * TICK_S);
    experiment.run(&mut relay(amplitude), &mut Noise::from_seed(1))
}

/// Mean period of the relay in the tail (s): upward edges that lie within two samples of a multiple of the
/// period.
fn period_s(trace: &Trace) -> f64 {
    let tail = &trace.input[SAMPLES - TAIL..];
    let edges: Vec<usize> = (1..TAIL).filter(|&i| tail[i] > tail[i - 1]).collect();
    (edges[edges.len() - 1] - edges[0]) as f64 * TICK_S / (edges.len() - 1) as f64
}

// The same relay at 0.08 of the thrust, a sixth of hover, and at 0.05 of roll. Period: switches are at ticks,
// and the tail has 3 (altitude, 0.46 s) or 6 (roll, 0.26 s) whole periods, so 2 ms of 1.4 s: 0.2 %; 0.5 % are
// allowed. Amplitude: the speed of the motors lags, not their thrust. The fundamental of x + c x^2 is that of x
// up to terms of second order in the fraction of hover, (0.17)^2 = 3 %, halved.
#[test]
fn the_relay_oscillates_as_on_the_process() {
    let mut parts = Parts::quadrotor();
    parts.sensors = parts.sensors.without_noise();
    let vehicle = Vehicle::new(parts).unwrap();
    let hover = vehicle.hover(1.0, Vec3::ZERO).unwrap();
    for (axis, amplitude) in [(Axis::Altitude, 0.08), (Axis::Roll, 0.05)] {
        let flown = flown(vehicle, &hover, axis, amplitude);
        let simulated = simulated(hover.linearised(axis).unwrap(), amplitude);
        let period = period_s(&flown) / period_s(&simulated);
        assert!((period - 1.0).abs() < 5e-3, "{axis:?}: {period}");
        // Half the peak-to-peak output over one and a half periods, with a contribution of the drift.
        let amplitude = flown.amplitude_of_last(600) / simulated.amplitude_of_last(600);
        assert!((amplitude - 1.0).abs() < 0.015, "{axis:?}: {amplitude}");
    }
}
