//! Free flight against mechanics by hand.

use std::f64::consts::PI;

use onecycle_plant::Noise;
use onecycle_plant::multirotor::{
    Attitude, Command, Flight, GRAVITY_M_PER_S2, Nudge, Parts, Vec3, Vehicle, VehicleError,
    VehicleState, Wind,
};

/// So high that the ground effect, (0.0762 / 4 z)^2, is below rounding.
const HIGH: Vec3 = Vec3::new(0.0, 0.0, 1e6);

/// The quadrotor without drag, noise and delay, with a battery of constant nominal voltage.
fn ideal() -> Parts {
    let mut parts = Parts::quadrotor();
    parts.body.linear_drag_n_s_per_m = Vec3::ZERO;
    parts.body.quadratic_drag_n_s2_per_m2 = Vec3::ZERO;
    parts.rotors.axial_drag_n_s2_per_m = 0.0;
    parts.rotors.lateral_drag_n_s2_per_m = 0.0;
    parts.battery.resistance_ohm = 0.0;
    parts.battery.full_v = parts.rotors.nominal_v;
    parts.battery.empty_v = parts.rotors.nominal_v;
    parts.sensors = Default::default();
    parts
}

fn falling(parts: Parts) -> Flight {
    let vehicle = Vehicle::new(parts).unwrap();
    let state = VehicleState {
        position_m: HIGH,
        ..VehicleState::standing(&vehicle)
    };
    Flight::new(vehicle, state).unwrap()
}

fn hovering(parts: Parts) -> (Flight, Command) {
    let vehicle = Vehicle::new(parts).unwrap();
    let hover = vehicle.hover(1.0, Vec3::ZERO).unwrap();
    let command = Command {
        thrust: hover.thrust_command(),
        ..Command::default()
    };
    (Flight::new(vehicle, hover.state(HIGH)).unwrap(), command)
}

fn fly(flight: &mut Flight, command: Command, duration_s: f64) {
    let mut noise = Noise::from_seed(1);
    for _ in 0..(duration_s / 1e-3).round() as usize {
        flight.step(command, 1e-3, &mut noise);
    }
}

// v = g t: 2 s at 9.80665. A parabola is exact for Runge-Kutta, so only 2000 roundings are left. The position is
// rounded to 1e-10 at a height of 1000 km.
#[test]
fn it_falls_freely() {
    let mut flight = falling(ideal());
    fly(&mut flight, Command::default(), 2.0);
    let state = flight.state();
    assert!((state.velocity_m_per_s.z + 2.0 * GRAVITY_M_PER_S2).abs() < 1e-11);
    assert!((state.position_m.z - HIGH.z + 2.0 * GRAVITY_M_PER_S2).abs() < 1e-6);
}

// Four times k omega^2 is the weight up to rounding; after a second at that command the vehicle has not moved.
#[test]
fn thrust_balances_weight_at_hover() {
    let (mut flight, command) = hovering(ideal());
    let (state, parts) = (*flight.state(), *flight.vehicle().parts());
    let omega = state.rotors_rad_per_s[0];
    let lift_n = 4.0 * parts.rotors.thrust_n_s2 * omega * omega;
    assert!((lift_n / parts.body.weight_n() - 1.0).abs() < 1e-12);
    fly(&mut flight, command, 1.0);
    assert!(flight.state().velocity_m_per_s.norm() < 1e-11);
    assert!(flight.state().rates_rad_per_s.norm() < 1e-12);
}

// A quarter of the thrust is half the speed: omega = 902 (1 - exp(-t / T)). The error of Runge-Kutta is (h/T)^5
// / 120 = 2.6e-9 per step, with 20 steps per lag: 2e-8 of the final speed after one lag.
#[test]
fn motors_lag() {
    let mut flight = falling(ideal());
    let quarter = Command {
        thrust: 0.25,
        ..Command::default()
    };
    for lags in 1..=4 {
        fly(&mut flight, quarter, 0.02);
        let expected = 902.0 * (1.0 - (-f64::from(lags)).exp());
        let speed = flight.state().rotors_rad_per_s[2];
        assert!((speed - expected).abs() < 3e-8 * 902.0, "{speed}");
    }
}

// Without drag and torque, energy and angular momentum in the world stay constant while the vehicle tumbles for
// ten seconds about its middle axis of inertia, the unstable one.
#[test]
fn tumbling_keeps_energy_and_angular_momentum() {
    let vehicle = Vehicle::new(ideal()).unwrap();
    let inertia = vehicle.parts().body.inertia_kg_m2;
    let state = VehicleState {
        position_m: HIGH,
        rates_rad_per_s: Vec3::new(6.0, 0.1, 0.2),
        world_from_body: Attitude::from_angles(0.4, -0.3, 2.0),
        ..VehicleState::standing(&vehicle)
    };
    let energy_j = |state: &VehicleState| {
        0.5 * state
            .rates_rad_per_s
            .dot(inertia.scaled_by(state.rates_rad_per_s))
    };
    let momentum = |state: &VehicleState| {
        let in_body = inertia.scaled_by(state.rates_rad_per_s);
        state.world_from_body.axes().world_from_body(in_body)
    };
    let mut flight = Flight::new(vehicle, state).unwrap();
    let mut lowest = f64::INFINITY;
    for _ in 0..100 {
        fly(&mut flight, Command::default(), 0.1);
        lowest = lowest.min(flight.state().rates_rad_per_s.x);
    }
    let later = flight.state();
    assert!((energy_j(later) / energy_j(&state) - 1.0).abs() < 1e-10);
    assert!((momentum(later) - momentum(&state)).norm() < 1e-10 * momentum(&state).norm());
    assert!((later.world_from_body.norm() - 1.0).abs() < 1e-15);
    // It did tumble: the rate about the middle axis changed from 6 rad/s through zero.
    assert!(lowest < -5.0, "{lowest}");
}

// d1 v + d2 v^2 = m g: v = (-0.267 + sqrt(0.267^2 + 4 0.031 13.0755)) / 0.062 = 16.68 m/s. The approach has the
// time constant m / (d1 + 2 d2 v) = 1.02 s and is complete after 40 s.
#[test]
fn it_reaches_terminal_velocity() {
    let mut flight = falling(Parts::quadrotor());
    fly(&mut flight, Command::default(), 40.0);
    let weight_n = 0.4 / 0.3 * GRAVITY_M_PER_S2;
    let expected = ((0.267_f64 * 0.267 + 0.124 * weight_n).sqrt() - 0.267) / 0.062;
    let speed = -flight.state().velocity_m_per_s.z;
    assert!((expected - 16.68).abs() < 0.01);
    assert!((speed - expected).abs() < 1e-10, "{speed}");
}

// 0.0202 N m on 0.0101 kg m^2 about roll: 2 rad/s^2, after 0.5 s 1 rad/s and 0.25 rad.
#[test]
fn a_torque_is_integrated_twice() {
    let mut flight = falling(ideal());
    let nudge = Nudge {
        force_n: Vec3::ZERO,
        torque_nm: Vec3::new(0.0202, 0.0, 0.0),
        duration_s: 0.5,
    };
    flight.nudge(nudge).unwrap();
    fly(&mut flight, Command::default(), 0.5);
    let reading = flight.reading();
    assert!((reading.angles_rad - Vec3::new(0.25, 0.0, 0.0)).norm() < 1e-10);
    assert!((reading.rates_rad_per_s - Vec3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
}

// Drag of the rotors at hover, with the hubs level with the centre of mass, against one motion at a time:
// exp(-rate t) with the rates 4 k_d omega / m sideways, 4 k_z omega / m in climb, 4 k_z omega y^2 / I_x in roll
// and 4 k_d omega (x^2 + y^2) / I_z in yaw. After a second, to a thousand roundings.
#[test]
fn the_rotors_damp_every_motion() {
    let parts = Parts {
        rotors: Parts::quadrotor().rotors,
        ..ideal()
    };
    let (flight, command) = hovering(parts);
    let hover = *flight.state();
    let (rotors, inertia) = (parts.rotors, parts.body.inertia_kg_m2);
    let (x, y) = (rotors.hub_forward_m, rotors.hub_left_m);
    let axial = 4.0 * rotors.axial_drag_n_s2_per_m * hover.rotors_rad_per_s[0];
    let lateral = 4.0 * rotors.lateral_drag_n_s2_per_m * hover.rotors_rad_per_s[0];
    let mass_kg = parts.body.mass_kg;
    let (velocity, rates) = (Vec3::new(0.0, 0.1, 0.0), Vec3::ZERO);
    for (velocity, rates, damping) in [
        (velocity, rates, lateral / mass_kg),
        (Vec3::new(0.0, 0.0, 0.1), rates, axial / mass_kg),
        (
            Vec3::ZERO,
            Vec3::new(0.1, 0.0, 0.0),
            axial * y * y / inertia.x,
        ),
        (
            Vec3::ZERO,
            Vec3::new(0.0, 0.0, 0.1),
            lateral * (x * x + y * y) / inertia.z,
        ),
    ] {
        let state = VehicleState {
            velocity_m_per_s: velocity,
            rates_rad_per_s: rates,
            ..hover
        };
        let mut flight = Flight::new(*flight.vehicle(), state).unwrap();
        fly(&mut flight, command, 1.0);
        let left = if rates == Vec3::ZERO {
            flight.state().velocity_m_per_s.norm()
        } else {
            flight.state().rates_rad_per_s.norm()
        };
        assert!((left - 0.1 * (-damping).exp()).abs() < 1e-11, "{left}");
    }
}

// 3 N for 12.34 ms, which is not a multiple of the step, on 4/3 kg: 27.765 mm/s, constant afterwards. The middle
// moves on at that velocity.
#[test]
fn a_nudge_is_its_impulse() {
    let mut flight = falling(ideal());
    let nudge = Nudge {
        force_n: Vec3::new(0.0, 3.0, 0.0),
        torque_nm: Vec3::ZERO,
        duration_s: 0.012_34,
    };
    flight.nudge(nudge).unwrap();
    fly(&mut flight, Command::default(), 0.1);
    assert!((flight.state().velocity_m_per_s.y - 0.027_765).abs() < 1e-14);
    assert_eq!(
        flight
            .nudge(Nudge {
                duration_s: f64::NAN,
                ..nudge
            })
            .map_err(|error| error.to_string()),
        Err("the duration of the nudge must be zero or more and finite, but is NaN".to_owned())
    );
}

// Ten seconds of hover draw 252 W at 16.2 V: 15.6 A, 1.17 % of 13320 A s. At each instant the charge falls by P
// / (V C), so the result from the voltage before and after agrees within the change of V. At full thrust the
// motors settle at 1804 V / 14.8 of the falling voltage; the lag of 20 ms trails it by less than 1e-4.
#[test]
fn the_battery_runs_down_and_sags() {
    let (mut flight, command) = hovering(Parts::quadrotor());
    let before_v = flight.voltage_v();
    let omega = flight.state().rotors_rad_per_s[0];
    let power_w = 4.0 * flight.vehicle().parts().rotors.power_w(omega);
    fly(&mut flight, command, 10.0);
    let used = 1.0 - flight.state().charge;
    let expected = power_w * 10.0 / (before_v * 13_320.0);
    assert!((expected - 0.0117).abs() < 1e-4, "{expected}");
    assert!((used / expected - 1.0).abs() < 5e-3, "{used} {expected}");
    assert!(flight.voltage_v() < before_v);

    let full = Command {
        thrust: 1.0,
        ..Command::default()
    };
    fly(&mut flight, full, 1.0);
    let speed = flight.state().rotors_rad_per_s[0];
    let expected = 1804.0 * flight.voltage_v() / 14.8;
    assert!((speed / expected - 1.0).abs() < 1e-4, "{speed} {expected}");
    assert!(flight.voltage_v() < before_v - 0.5);
}

// Falling from rest at inner steps of 1 ms: with a delay of 37 ms the reading is exactly that of 37 steps ago,
// with 37.4 ms it is 0.6 of that and 0.4 of the step before. Before that it is the initial value.
#[test]
fn readings_are_as_old_as_the_delay() {
    for (delay_s, share) in [(0.037, 0.0), (0.0374, 0.4)] {
        let mut parts = ideal();
        parts.sensors.velocity.delay_s = delay_s;
        let mut flight = falling(parts);
        let mut noise = Noise::from_seed(1);
        let mut climbs = vec![0.0];
        for step in 1..100_usize {
            flight.step(Command::default(), 1e-3, &mut noise);
            climbs.push(flight.state().velocity_m_per_s.z);
            let late = flight.sense(&mut noise).velocity_m_per_s.z;
            let at = |ago: usize| step.checked_sub(ago).map_or(0.0, |i| climbs[i]);
            let expected = (1.0 - share) * at(37) + share * at(38);
            assert!((late - expected).abs() < 1e-14, "{late} {expected}");
        }
    }
}

// Yaw passes from pi to -pi at 1 rad/s between two inner steps: with a delay of 0.4 ms the reading is the angle
// of that time, by the shorter way; the mean of 3.14 and -3.14 would be far off.
#[test]
fn late_angles_go_the_short_way_round() {
    let mut parts = ideal();
    parts.sensors.angles.delay_s = 4e-4;
    let vehicle = Vehicle::new(parts).unwrap();
    let state = VehicleState {
        position_m: HIGH,
        world_from_body: Attitude::from_angles(0.0, 0.0, PI - 0.0505),
        rates_rad_per_s: Vec3::new(0.0, 0.0, 1.0),
        ..VehicleState::standing(&vehicle)
    };
    let mut flight = Flight::new(vehicle, state).unwrap();
    let mut noise = Noise::from_seed(1);
    for step in 1..100 {
        flight.step(Command::default(), 1e-3, &mut noise);
        let past_pi = f64::from(step) * 1e-3 - 4e-4 - 0.0505;
        let expected = past_pi - PI * past_pi.signum();
        let yaw_rad = flight.sense(&mut noise).angles_rad.z;
        assert!((yaw_rad - expected).abs() < 1e-12, "{yaw_rad} {expected}");
    }
}

// White noise of 2 cm on one channel: the variance of 10,000 readings is within three standard errors sqrt(2 /
// n); the other channels read the truth.
#[test]
fn readings_carry_noise() {
    const READINGS: usize = 10_000;
    let mut parts = ideal();
    parts.sensors.position.sensor.noise_sigma = 0.02;
    let (flight, mut noise) = (
        Flight::standing(Vehicle::new(parts).unwrap()),
        Noise::from_seed(4),
    );
    let mut power = 0.0;
    for _ in 0..READINGS {
        let reading = flight.sense(&mut noise);
        power += reading.position_m.z * reading.position_m.z;
        assert_eq!(reading.rates_rad_per_s, Vec3::ZERO);
    }
    let variance = power / READINGS as f64;
    assert!((variance / 4e-4 - 1.0).abs() < 3.0 * (2.0 / READINGS as f64).sqrt());
}

// 0.4 kg more at the thrust of hover: the vehicle falls with g 0.4 / 1.7333 = 2.2631 m/s^2; when the payload is
// dropped after 0.1 s it keeps its 0.2263 m/s. Without drag, to rounding.
#[test]
fn a_payload_is_taken_up_and_dropped() {
    let (mut flight, command) = hovering(ideal());
    let bare = *flight.vehicle();
    flight.set_vehicle(bare.with_payload(0.4, 0.05).unwrap());
    fly(&mut flight, command, 0.1);
    let expected = -0.1 * GRAVITY_M_PER_S2 * 0.4 / (0.4 + 0.4 / 0.3);
    assert!((flight.state().velocity_m_per_s.z - expected).abs() < 1e-12);
    flight.set_vehicle(bare);
    fly(&mut flight, command, 0.1);
    assert!((flight.state().velocity_m_per_s.z - expected).abs() < 1e-12);
}

// While the vehicle rolls at 2 rad/s the centre of mass jumps when the payload is dropped; the middle does not.
#[test]
fn the_middle_does_not_jump_with_the_payload() {
    let bare = Vehicle::new(ideal()).unwrap();
    let loaded = bare.with_payload(0.4, 0.05).unwrap();
    let state = VehicleState {
        position_m: Vec3::new(1.0, 2.0, 3.0),
        velocity_m_per_s: Vec3::new(0.3, -0.2, 0.1),
        world_from_body: Attitude::from_angles(0.3, 0.2, 0.1),
        rates_rad_per_s: Vec3::new(2.0, -1.0, 0.5),
        ..VehicleState::standing(&loaded)
    };
    let mut flight = Flight::new(loaded, state).unwrap();
    let before = flight.reading();
    flight.set_vehicle(bare);
    let after = flight.reading();
    assert!((after.position_m - before.position_m).norm() < 1e-15);
    assert!((after.velocity_m_per_s - before.velocity_m_per_s).norm() < 1e-15);
    assert!((flight.state().position_m - state.position_m).norm() > 0.01);
}

// Centre of mass 1 mm to the left: at hover the lift turns the left side down with m g c / I_x = 1.2946 rad/s^2,
// so -1.62 mrad after 50 ms. A roll command of thrust times c / y balances it: with the motors at that command
// from the start, the vehicle does not rotate for a second.
#[test]
fn an_offset_centre_of_mass_is_a_bias_of_roll() {
    let mut parts = ideal();
    let (offset_m, hub_m) = (0.001, parts.rotors.hub_left_m);
    parts.body.centre_of_mass_m.y = offset_m;
    let (mut flight, command) = hovering(parts);
    fly(&mut flight, command, 0.05);
    let expected = -0.5 * 0.05 * 0.05 * parts.body.weight_n() * offset_m / 0.0101;
    let roll_rad = flight.reading().angles_rad.x;
    assert!(
        (roll_rad / expected - 1.0).abs() < 1e-5,
        "{roll_rad} {expected}"
    );

    let (flight, command) = hovering(parts);
    let mut state = *flight.state();
    for (speed, sign) in state
        .rotors_rad_per_s
        .iter_mut()
        .zip([1.0, 1.0, -1.0, -1.0])
    {
        *speed *= (1.0_f64 + sign * offset_m / hub_m).sqrt();
    }
    let mut flight = Flight::new(*flight.vehicle(), state).unwrap();
    let trimmed = Command {
        roll: command.thrust * offset_m / hub_m,
        ..command
    };
    fly(&mut flight, trimmed, 1.0);
    assert!(flight.reading().angles_rad.norm() < 1e-11);
}

// Values out of range are named; a vehicle that is twice too heavy cannot hover.
#[test]
fn errors_name_the_parameter() {
    let mut parts = Parts::quadrotor();
    parts.rotors.lag_s = 0.0;
    assert_eq!(
        Vehicle::new(parts),
        Err(VehicleError::NotPositive {
            name: "lag of a motor",
            value: 0.0
        })
    );
    parts = Parts::quadrotor();
    parts.body.inertia_kg_m2.z = 1.0;
    assert!(matches!(
        Vehicle::new(parts),
        Err(VehicleError::Inertia { z: 1.0, .. })
    ));
    let vehicle = Vehicle::quadrotor();
    assert!(matches!(
        vehicle.with_payload(f64::NAN, 0.0),
        Err(VehicleError::Negative { .. })
    ));
    assert_eq!(
        vehicle.hover(1.5, Vec3::ZERO).map(|_| ()),
        Err(VehicleError::Charge(1.5))
    );
    let heavy = vehicle.with_payload(2.0, 0.0).unwrap();
    assert!(matches!(
        heavy.hover(1.0, Vec3::ZERO),
        Err(VehicleError::CannotHover { .. })
    ));
}

// The same commands and the same seed give the same bits, however a second is divided into ticks of whole inner
// steps.
#[test]
fn ticks_of_whole_steps_are_the_same_flight() {
    let run = |steps: usize| {
        let (mut flight, command) = hovering(Parts::quadrotor());
        let mut noise = Noise::from_seed(2);
        flight
            .set_wind(Wind::CALM.with_gusts(Vec3::new(1.0, 1.0, 1.0), 1.0))
            .unwrap();
        let inner_s = 2.0_f64.powi(-10);
        for _ in 0..1024 / steps {
            flight.step(command, steps as f64 * inner_s, &mut noise);
        }
        *flight.state()
    };
    assert_eq!(run(1), run(8));
}
