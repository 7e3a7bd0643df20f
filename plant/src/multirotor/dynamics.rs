//! Equations of motion of the rigid vehicle, and one step of their integration.
//!
//! ```text
//! m dv/dt = m g + R (drag + sum of rotor forces) + contact + nudge            (world)
//! I dw/dt = sum of (arm x force) + reactions + contact + nudge - w x I w      (body)
//! dq/dt   = q w / 2,   dx/dt = v,   motors and battery as in their own files
//! ```
//!
//! Not modelled: angular momentum of the rotors (gyroscopic moments, and the lead that their acceleration gives
//! yaw), dynamics of the inflow, vortex ring state in a fast descent, wind that varies in space.
//!
//! Integration by the classical Runge-Kutta rule with the command held. Its error over a motor's lag `T` is
//! `(h / T)^5 / 120` per step, 3e-9 at 1 ms and 20 ms.

use super::body::GRAVITY_M_PER_S2;
use super::frames::{Attitude, Axes, Vec3};
use super::ground::ground_effect;
use super::rotor::ROTOR_POSITIONS;
use super::vehicle::{Parts, Vehicle};

/// State of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleState {
    /// Centre of mass (m, world); the ground is at `z = 0`.
    pub position_m: Vec3,
    /// Velocity of the centre of mass (m/s, world).
    pub velocity_m_per_s: Vec3,
    /// Attitude.
    pub world_from_body: Attitude,
    /// Rates about the axes of the body (rad/s).
    pub rates_rad_per_s: Vec3,
    /// Speeds of the rotors (rad/s), in the order of [`ROTOR_POSITIONS`].
    pub rotors_rad_per_s: [f64; 4],
    /// Charge of the battery, 0..1.
    pub charge: f64,
}

impl VehicleState {
    /// On its feet, level, facing east, rotors at rest, battery full.
    #[must_use]
    pub fn standing(vehicle: &Vehicle) -> Self {
        let centre_of_mass_m = vehicle.parts().body.centre_of_mass_m;
        Self {
            position_m: Vec3::new(0.0, 0.0, vehicle.standing_height_m()) + centre_of_mass_m,
            velocity_m_per_s: Vec3::ZERO,
            world_from_body: Attitude::LEVEL,
            rates_rad_per_s: Vec3::ZERO,
            rotors_rad_per_s: [0.0; 4],
            charge: 1.0,
        }
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position_m.is_finite()
            && self.velocity_m_per_s.is_finite()
            && self.world_from_body.norm().is_finite()
            && self.rates_rad_per_s.is_finite()
            && self.rotors_rad_per_s.iter().all(|speed| speed.is_finite())
            && self.charge.is_finite()
    }

    /// `self + slope * dt_s`; the attitude is not normalised.
    fn plus(&self, slope: &Self, dt_s: f64) -> Self {
        Self {
            position_m: self.position_m + slope.position_m * dt_s,
            velocity_m_per_s: self.velocity_m_per_s + slope.velocity_m_per_s * dt_s,
            world_from_body: self.world_from_body.plus(&slope.world_from_body, dt_s),
            rates_rad_per_s: self.rates_rad_per_s + slope.rates_rad_per_s * dt_s,
            rotors_rad_per_s: std::array::from_fn(|i| {
                self.rotors_rad_per_s[i] + slope.rotors_rad_per_s[i] * dt_s
            }),
            charge: self.charge + slope.charge * dt_s,
        }
    }
}

/// Constants of a step.
pub(super) struct Held<'a> {
    pub(super) parts: &'a Parts,
    /// Square roots of the motors' commands: their share of full speed.
    pub(super) speed_shares: [f64; 4],
    /// Wind with its gust (m/s, world).
    pub(super) wind_m_per_s: Vec3,
    /// External force at the centre of mass (N, world) and torque (N m, body).
    pub(super) force_n: Vec3,
    pub(super) torque_nm: Vec3,
}

impl Held<'_> {
    /// State `dt_s` later. The centre of mass never ends below the ground: in a crash that compresses the legs
    /// so far, it stops there.
    pub(super) fn step(&self, state: &VehicleState, dt_s: f64) -> VehicleState {
        let first = self.slope(state);
        let second = self.slope(&state.plus(&first, 0.5 * dt_s));
        let third = self.slope(&state.plus(&second, 0.5 * dt_s));
        let fourth = self.slope(&state.plus(&third, dt_s));
        let mut next = state
            .plus(&first, dt_s / 6.0)
            .plus(&second, dt_s / 3.0)
            .plus(&third, dt_s / 3.0)
            .plus(&fourth, dt_s / 6.0);
        next.world_from_body = next.world_from_body.normalised();
        next.charge = next.charge.max(0.0);
        if next.position_m.z < 0.0 {
            next.position_m.z = 0.0;
            next.velocity_m_per_s.z = next.velocity_m_per_s.z.max(0.0);
        }
        next
    }

    /// Time derivatives, in the fields of the quantities.
    fn slope(&self, state: &VehicleState) -> VehicleState {
        let parts = self.parts;
        let axes = state.world_from_body.axes();
        let rates = state.rates_rad_per_s;
        let air = axes.body_from_world(state.velocity_m_per_s - self.wind_m_per_s);
        let mut force = parts.body.drag_n(air);
        let mut torque = self.torque_nm;
        let mut power_w = 0.0;
        for (place, speed) in ROTOR_POSITIONS.into_iter().zip(state.rotors_rad_per_s) {
            let arm = parts.rotors.hub_m(place) - parts.body.centre_of_mass_m;
            let height_m = state.position_m.z + axes.world_from_body(arm).z;
            let ratio = ground_effect(parts.rotors.radius_m, height_m);
            let pull = parts.rotors.force_n(speed, air + rates.cross(arm), ratio);
            force += pull;
            torque += arm.cross(pull);
            torque.z += parts.rotors.reaction_nm(place, speed);
            power_w += parts.rotors.power_w(speed);
        }
        let (push_n, push_nm) = self.contact(state, &axes);
        torque += push_nm;
        let acceleration = (axes.world_from_body(force) + push_n + self.force_n)
            * (1.0 / parts.body.mass_kg)
            - Vec3::new(0.0, 0.0, GRAVITY_M_PER_S2);

        let inertia = parts.body.inertia_kg_m2;
        let net = torque - rates.cross(inertia.scaled_by(rates));
        let voltage_v = parts.battery.voltage_v(state.charge, power_w);
        let full_speed = parts.rotors.full_speed_at_rad_per_s(voltage_v);
        VehicleState {
            position_m: state.velocity_m_per_s,
            velocity_m_per_s: acceleration,
            world_from_body: state.world_from_body.derivative(rates),
            rates_rad_per_s: Vec3::new(net.x / inertia.x, net.y / inertia.y, net.z / inertia.z),
            rotors_rad_per_s: std::array::from_fn(|i| {
                (full_speed * self.speed_shares[i] - state.rotors_rad_per_s[i]) / parts.rotors.lag_s
            }),
            charge: -power_w / (voltage_v * parts.battery.capacity_a_s),
        }
    }

    /// Force (N, world) and torque (N m, body) of the ground on feet and guards.
    fn contact(&self, state: &VehicleState, axes: &Axes) -> (Vec3, Vec3) {
        let (rotors, legs) = (&self.parts.rotors, &self.parts.legs);
        let centre = self.parts.body.centre_of_mass_m;
        let (mut force, mut torque) = (Vec3::ZERO, Vec3::ZERO);
        let reach_m = rotors.hub_forward_m + rotors.hub_left_m + legs.height_m + legs.guard_m;
        if state.position_m.z > reach_m + centre.norm() {
            return (force, torque);
        }
        for place in ROTOR_POSITIONS {
            for height_m in [-legs.height_m, legs.guard_m] {
                let arm = rotors.hub_m(place) + Vec3::new(0.0, 0.0, height_m) - centre;
                let above_m = state.position_m.z + axes.world_from_body(arm).z;
                if above_m < 0.0 {
                    let turning = axes.world_from_body(state.rates_rad_per_s.cross(arm));
                    let push = legs.force_n(above_m, state.velocity_m_per_s + turning);
                    force += push;
                    torque += arm.cross(axes.body_from_world(push));
                }
            }
        }
        (force, torque)
    }
}
