//! Hover, and the linear process of each axis there.
//!
//! Level, at rest, far from the ground, held in place in a wind `w`. Symbols: `omega` speed of the rotors
//! (rad/s), `u` thrust command (1), `P` power (W), `V` voltage (V), `k' = 2 k omega + k_z w_z` derivative of the
//! thrust by the speed, `d = omega / 2 u` derivative of the speed by the command:
//!
//! ```text
//! altitude   b = (dV/dP) 3 P / V          how the battery's sag pulls the speed back, negative
//!            T_prop = T / (1 - b),   K/T_body = 4 k' d / ((1 - b) m)
//!            1/T_body = (4 k_z omega + d(drag)/dv_z) / m
//! roll       T_prop = T,   K/T_body = 4 k' d y / I_x,   1/T_body = 4 omega (k_z y^2 + k_d h^2) / I_x
//! pitch      the same with x and I_y
//! yaw        K/T_body = 4 q 2 k omega d / I_z,   1/T_body = 4 omega k_d (x^2 + y^2) / I_z
//! ```
//!
//! `x, y` are the distances of the hubs from the middle and `h` their height above the centre of mass. Roll and
//! pitch do not change the total power, so the sag of the battery is of second order there. The formulas are
//! derivatives of the equations of flight; the delay is that of the channel.
//!
//! Not part of the linear process: the ground effect, a spring of `-2 g (R/4)^2 / z^3` (-0.057 /s^2 at 0.5 m for
//! the quadrotor); the discharge of the battery; the second-order thrust (`onboard::distortion`); with a centre
//! of mass below the hubs, the torque of lateral motion (roll tilts the vehicle, it slides, the drag of the
//! rotors rights it); with a centre of mass off to the side, or in a horizontal wind, the coupling of the axes.

use onecycle_onboard::Soiptd;

use super::dynamics::VehicleState;
use super::error::{VehicleError, charged, finite};
use super::frames::{Attitude, Vec3};
use super::vehicle::Vehicle;

/// Steered axis, with the command of the same name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// From the thrust command to the altitude (m).
    Altitude,
    /// From the roll command to roll (rad).
    Roll,
    /// From the pitch command to pitch (rad).
    Pitch,
    /// From the yaw command to yaw (rad).
    Yaw,
}

/// A vehicle at hover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hover {
    vehicle: Vehicle,
    charge: f64,
    wind_m_per_s: Vec3,
    rotor_rad_per_s: f64,
    power_w: f64,
    voltage_v: f64,
    thrust_command: f64,
}

impl Vehicle {
    /// Hover at a charge of 0..1 in a steady wind (m/s, world).
    ///
    /// # Errors
    /// [`VehicleError::CannotHover`] if full thrust is not enough; [`VehicleError::Charge`] for a charge outside
    /// 0..1; [`VehicleError::NotFinite`] for a wind that is not finite.
    pub fn hover(&self, charge: f64, wind_m_per_s: Vec3) -> Result<Hover, VehicleError> {
        charged(charge)?;
        finite("wind", wind_m_per_s)?;
        let parts = self.parts();
        let rotors = &parts.rotors;
        // 4 (k omega^2 + k_z w_z omega) = weight minus the vertical force of the wind.
        let load_n = parts.body.weight_n() - parts.body.drag_n(-wind_m_per_s).z;
        let half = 0.5 * rotors.axial_drag_n_s2_per_m * wind_m_per_s.z;
        let root = (half * half + 0.25 * rotors.thrust_n_s2 * load_n).max(0.0);
        let rotor_rad_per_s = ((root.sqrt() - half) / rotors.thrust_n_s2).max(0.0);
        let power_w = 4.0 * rotors.power_w(rotor_rad_per_s);
        let voltage_v = parts.battery.voltage_v(charge, power_w);
        let share = rotor_rad_per_s / rotors.full_speed_at_rad_per_s(voltage_v);
        let thrust_command = share * share;
        if thrust_command > 1.0 {
            return Err(VehicleError::CannotHover {
                thrust: thrust_command,
            });
        }
        Ok(Hover {
            vehicle: *self,
            charge,
            wind_m_per_s,
            rotor_rad_per_s,
            power_w,
            voltage_v,
            thrust_command,
        })
    }

    /// Process of an axis at hover with a full battery in calm air.
    ///
    /// # Errors
    /// Those of [`Vehicle::hover`] and [`Hover::linearised`].
    pub fn linearised(&self, axis: Axis) -> Result<Soiptd, VehicleError> {
        self.hover(1.0, Vec3::ZERO)?.linearised(axis)
    }
}

impl Hover {
    /// Thrust command at hover (1).
    #[must_use]
    pub fn thrust_command(&self) -> f64 {
        self.thrust_command
    }

    /// Speed of the rotors at hover (rad/s).
    #[must_use]
    pub fn rotor_rad_per_s(&self) -> f64 {
        self.rotor_rad_per_s
    }

    /// Voltage under the load (V).
    #[must_use]
    pub fn voltage_v(&self) -> f64 {
        self.voltage_v
    }

    /// State at hover, with the middle at `position_m` (m, world).
    #[must_use]
    pub fn state(&self, position_m: Vec3) -> VehicleState {
        VehicleState {
            position_m: position_m + self.vehicle.parts().body.centre_of_mass_m,
            velocity_m_per_s: Vec3::ZERO,
            world_from_body: Attitude::LEVEL,
            rates_rad_per_s: Vec3::ZERO,
            rotors_rad_per_s: [self.rotor_rad_per_s; 4],
            charge: self.charge,
        }
    }

    /// Process of an axis, from its command (1) to its output (m or rad). See the [module](self).
    ///
    /// # Errors
    /// [`VehicleError::NoProcess`] if the command has no effect, for example when an updraft carries the
    /// vehicle.
    pub fn linearised(&self, axis: Axis) -> Result<Soiptd, VehicleError> {
        let parts = self.vehicle.parts();
        let (rotors, body, sensors) = (&parts.rotors, &parts.body, &parts.sensors);
        let omega = self.rotor_rad_per_s;
        let force_per_speed =
            2.0 * rotors.thrust_n_s2 * omega + rotors.axial_drag_n_s2_per_m * self.wind_m_per_s.z;
        let speed_per_command = 0.5 * omega / self.thrust_command;
        let (x, y, h) = (
            rotors.hub_forward_m,
            rotors.hub_left_m,
            body.centre_of_mass_m.z,
        );
        let axial = rotors.axial_drag_n_s2_per_m;
        let lateral = rotors.lateral_drag_n_s2_per_m;
        let tilt_damping = |arm_m: f64| axial * arm_m * arm_m + lateral * h * h;
        let inertia = body.inertia_kg_m2;
        let (force, damping, inertia, t_prop_s, channel) = match axis {
            Axis::Altitude => {
                let slowed = 1.0 - self.sag_feedback();
                (
                    force_per_speed / slowed,
                    axial * omega + 0.25 * self.vertical_drag_n_s_per_m(),
                    body.mass_kg,
                    rotors.lag_s / slowed,
                    &sensors.position,
                )
            }
            Axis::Roll => (
                force_per_speed * y,
                tilt_damping(y) * omega,
                inertia.x,
                rotors.lag_s,
                &sensors.angles,
            ),
            Axis::Pitch => (
                force_per_speed * x,
                tilt_damping(x) * omega,
                inertia.y,
                rotors.lag_s,
                &sensors.angles,
            ),
            Axis::Yaw => (
                2.0 * rotors.torque_per_thrust_m * rotors.thrust_n_s2 * omega,
                lateral * (x * x + y * y) * omega,
                inertia.z,
                rotors.lag_s,
                &sensors.angles,
            ),
        };
        Ok(Soiptd::from_acceleration_gain(
            4.0 * force * speed_per_command / inertia,
            t_prop_s,
            4.0 * damping / inertia,
            channel.delay_s,
        )?)
    }

    /// `b`: relative change of the motors' target speed per relative change of their speed.
    fn sag_feedback(&self) -> f64 {
        let battery = &self.vehicle.parts().battery;
        battery.sag_v_per_w(self.charge, self.power_w) * 3.0 * self.power_w / self.voltage_v
    }

    /// Derivative of the airframe's drag by the climb (N s/m): `linear + quadratic (|w| + w_z^2 / |w|)`.
    fn vertical_drag_n_s_per_m(&self) -> f64 {
        let body = &self.vehicle.parts().body;
        let (speed, climb) = (self.wind_m_per_s.norm(), self.wind_m_per_s.z);
        let along = if speed > 0.0 {
            speed + climb * climb / speed
        } else {
            0.0
        };
        body.linear_drag_n_s_per_m.z + body.quadratic_drag_n_s2_per_m2.z * along
    }
}
