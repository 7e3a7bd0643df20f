//! Four rotors with their motors.
//!
//! ```text
//! lag      d(omega)/dt = (omega_ref - omega) / T
//! speed    omega_ref = omega_full V / V_nominal sqrt(u),   u: what the mixer asks for, 0..1
//! thrust   k omega^2 - k_z omega v_z
//! drag     -k_d omega v_x, -k_d omega v_y
//! torque   -+ q k omega^2 about the axis, against the spin
//! power    q k |omega|^3 / efficiency
//! ```
//!
//! `v` is the velocity of the hub through the air, so rotations are damped like climbs. `k_z` describes the loss
//! of thrust with inflow, `k_d` the H-force.
//!
//! References for both first-order forms: P. Martin and E. Salaun, "The true role of accelerometer feedback in
//! quadrotor control", ICRA 2010; J. Svacha et al., "Improving quadrotor trajectory tracking by compensating for
//! aerodynamic effects", ICUAS 2017.

use super::frames::Vec3;

/// Position of a rotor as signs. The order is front left, rear left, rear right, front right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorPosition {
    /// +1 in front, -1 at the rear.
    pub forward: f64,
    /// +1 on the left, -1 on the right.
    pub left: f64,
    /// +1 turns anticlockwise seen from above, -1 clockwise.
    pub spin: f64,
}

/// Positions of the four rotors.
pub const ROTOR_POSITIONS: [RotorPosition; 4] = [
    RotorPosition::new(1.0, 1.0, 1.0),
    RotorPosition::new(-1.0, 1.0, -1.0),
    RotorPosition::new(-1.0, -1.0, 1.0),
    RotorPosition::new(1.0, -1.0, -1.0),
];

impl RotorPosition {
    const fn new(forward: f64, left: f64, spin: f64) -> Self {
        Self {
            forward,
            left,
            spin,
        }
    }
}

/// The rotors; they differ only in position and spin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotors {
    /// Distance of a hub ahead of or behind the middle (m).
    pub hub_forward_m: f64,
    /// Distance of a hub left or right of the middle (m).
    pub hub_left_m: f64,
    /// Radius of a rotor (m).
    pub radius_m: f64,
    /// `k`, thrust over squared speed (N s^2/rad^2).
    pub thrust_n_s2: f64,
    /// `q`, torque over thrust (m).
    pub torque_per_thrust_m: f64,
    /// `k_z`, loss of thrust over speed and climb (N s^2/(rad m)).
    pub axial_drag_n_s2_per_m: f64,
    /// `k_d`, lateral force over speed and lateral motion (N s^2/(rad m)).
    pub lateral_drag_n_s2_per_m: f64,
    /// `T`, lag of the speed (s).
    pub lag_s: f64,
    /// Speed at full command and nominal voltage (rad/s).
    pub full_speed_rad_per_s: f64,
    /// Nominal voltage, at which that speed is reached (V).
    pub nominal_v: f64,
    /// Mechanical power over electrical power (1).
    pub efficiency: f64,
}

impl Rotors {
    /// Position of a rotor's hub (m, body, from the middle).
    #[must_use]
    #[inline]
    pub fn hub_m(&self, place: RotorPosition) -> Vec3 {
        Vec3::new(
            place.forward * self.hub_forward_m,
            place.left * self.hub_left_m,
            0.0,
        )
    }

    /// Force of a rotor (N, body), from its speed (rad/s), the velocity of its hub through the air (m/s, body)
    /// and the factor of the ground effect on the static thrust.
    #[must_use]
    #[inline]
    pub fn force_n(&self, speed_rad_per_s: f64, hub_air_m_per_s: Vec3, ground_ratio: f64) -> Vec3 {
        let lateral = -self.lateral_drag_n_s2_per_m * speed_rad_per_s;
        let static_n = self.thrust_n_s2 * speed_rad_per_s * speed_rad_per_s * ground_ratio;
        Vec3::new(
            lateral * hub_air_m_per_s.x,
            lateral * hub_air_m_per_s.y,
            static_n - self.axial_drag_n_s2_per_m * speed_rad_per_s * hub_air_m_per_s.z,
        )
    }

    /// Torque of a rotor on the body about its up axis (N m).
    #[must_use]
    #[inline]
    pub fn reaction_nm(&self, place: RotorPosition, speed_rad_per_s: f64) -> f64 {
        let thrust_n = self.thrust_n_s2 * speed_rad_per_s * speed_rad_per_s;
        -place.spin * self.torque_per_thrust_m * thrust_n
    }

    /// Electrical power of a rotor (W).
    #[must_use]
    #[inline]
    pub fn power_w(&self, speed_rad_per_s: f64) -> f64 {
        let thrust_n = self.thrust_n_s2 * speed_rad_per_s * speed_rad_per_s;
        self.torque_per_thrust_m * thrust_n * speed_rad_per_s.abs() / self.efficiency
    }

    /// Speed at full command and this voltage (rad/s).
    #[must_use]
    #[inline]
    pub fn full_speed_at_rad_per_s(&self, voltage_v: f64) -> f64 {
        self.full_speed_rad_per_s * voltage_v / self.nominal_v
    }
}
