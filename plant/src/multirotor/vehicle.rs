//! Vehicle: its checked parts, and a quadrotor of the paper's size.
//!
//! The paper flies a Quanser QDrone. It gives only `T_prop`, `T_body` and `tau` of altitude (0.0321, 1.6886,
//! 0.0237 s) and roll (0.02, 1.6889, 0.0121 s), and a payload of 400 g, 30 % of the mass. [`Parts::quadrotor`]
//! is a vehicle of that class. Its numbers follow from those values or, where the paper gives none, from the
//! physics noted beside each. They were not measured on a QDrone.

use super::battery::Battery;
use super::body::Body;
use super::error::{VehicleError, at_least_zero, finite, positive};
use super::frames::Vec3;
use super::ground::Legs;
use super::rotor::Rotors;
use super::sensors::{Channel, Sensors};
use crate::Sensor;

/// Parts of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// Airframe.
    pub body: Body,
    /// Rotors and motors.
    pub rotors: Rotors,
    /// Battery.
    pub battery: Battery,
    /// Legs and guards.
    pub legs: Legs,
    /// Sensors.
    pub sensors: Sensors,
}

impl Parts {
    /// A quadrotor of the class of the paper's QDrone. See the [module](self).
    #[must_use]
    pub fn quadrotor() -> Self {
        Self {
            body: Body {
                // The paper's 400 g are 30 % of the mass.
                mass_kg: 0.4 / 0.3,
                // Radii of gyration of 8.7, 7.9 and 10.5 cm for a frame with 21 by 18 cm between hubs. With the
                // damping of the rotors the first gives the paper's T_body of roll.
                inertia_kg_m2: Vec3::new(0.0101, 0.0083, 0.0148),
                centre_of_mass_m: Vec3::ZERO,
                // Along z: what the paper's T_body of altitude needs beyond the rotors' 0.522. Along x and y a
                // third of it, because the side is less exposed to the wake.
                linear_drag_n_s_per_m: Vec3::new(0.09, 0.09, 0.267),
                // rho C_D A / 2 with C_D = 1: 200 cm^2 from the side, 500 cm^2 from above.
                quadratic_drag_n_s2_per_m2: Vec3::new(0.012, 0.012, 0.031),
            },
            rotors: Rotors {
                // A vehicle of 40 cm with propellers of 6 inch.
                hub_forward_m: 0.088,
                hub_left_m: 0.107,
                radius_m: 0.0762,
                // C_T rho D^4 / 4 pi^2 with C_T = 0.12, typical for a 6x4.5 propeller.
                thrust_n_s2: 2.0087e-6,
                // C_P D / (2 pi C_T) with C_P = 0.06.
                torque_per_thrust_m: 0.0121,
                // Values of rotorpy's Hummingbird (radius 0.1 m: k_z 2.32e-4, k_d 1.19e-4) scaled by the cube of
                // the diameter: 1.026e-4 and 0.526e-4. 0.2 % less gives the paper's T_body of roll.
                axial_drag_n_s2_per_m: 1.024e-4,
                lateral_drag_n_s2_per_m: 5.26e-5,
                // The paper's T_prop of roll.
                lag_s: 0.02,
                // sqrt(2) times the 1276 rad/s of hover: twice the weight at nominal voltage.
                full_speed_rad_per_s: 1804.0,
                nominal_v: 14.8,
                // Motor and motor controller.
                efficiency: 0.8,
            },
            battery: Battery {
                // Four lithium-polymer cells: 4.2 V full, 3.3 V empty, without load.
                full_v: 16.8,
                empty_v: 13.2,
                // Cells of 7 milliohm, and 12 milliohm for leads and connectors.
                resistance_ohm: 0.04,
                // 3.7 Ah: 13 minutes of hover.
                capacity_a_s: 13_320.0,
            },
            legs: Legs {
                height_m: 0.1,
                guard_m: 0.05,
                // All four legs yield by 1 mm under the weight and are critically damped: 99 rad/s.
                stiffness_n_per_m: 3269.0,
                damping_n_s_per_m: 66.0,
                // Rubber on a floor.
                friction: 0.6,
            },
            sensors: Self::quadrotor_sensors(),
        }
    }

    /// Motion capture for the position, an inertial unit for the attitude.
    fn quadrotor_sensors() -> Sensors {
        let channel = |noise_sigma, delay_s| Channel {
            sensor: Sensor::noisy(noise_sigma),
            delay_s,
        };
        // T_prop + tau of altitude as in the paper, 0.0558 s; the motors contribute 0.0179 s at hover. A motor
        // has a single lag, while the paper's classifier found 0.0321 s for altitude and 0.02 s for roll.
        let position_delay_s = 0.0379;
        // The paper's tau of roll.
        let attitude_delay_s = 0.0121;
        Sensors {
            // Resolution of half a millimetre for markers; the velocity is fused with accelerometers.
            position: channel(5e-4, position_delay_s),
            velocity: channel(0.01, position_delay_s),
            // Three hundredths of a degree, because the estimate relies on gyroscopes; these have 0.01
            // deg/s/sqrt(Hz) over 250 Hz.
            angles: channel(5e-4, attitude_delay_s),
            rates: channel(2.8e-3, attitude_delay_s),
        }
    }

    fn check(&self) -> Result<(), VehicleError> {
        let Self {
            body,
            rotors,
            battery,
            legs,
            sensors,
        } = self;
        let Vec3 { x, y, z } = body.inertia_kg_m2;
        for (name, value) in [
            ("mass", body.mass_kg),
            ("inertia of roll", x),
            ("inertia of pitch", y),
            ("inertia of yaw", z),
            (
                "distance of a hub ahead of the middle",
                rotors.hub_forward_m,
            ),
            ("distance of a hub left of the middle", rotors.hub_left_m),
            ("radius of a rotor", rotors.radius_m),
            ("thrust coefficient", rotors.thrust_n_s2),
            ("torque over thrust", rotors.torque_per_thrust_m),
            ("lag of a motor", rotors.lag_s),
            ("full speed of a rotor", rotors.full_speed_rad_per_s),
            ("nominal voltage", rotors.nominal_v),
            ("efficiency", rotors.efficiency),
            ("voltage of the empty battery", battery.empty_v),
            ("capacity of the battery", battery.capacity_a_s),
            ("stiffness of a leg", legs.stiffness_n_per_m),
        ] {
            positive(name, value)?;
        }
        finite("centre of mass", body.centre_of_mass_m)?;
        let (linear, quadratic) = (body.linear_drag_n_s_per_m, body.quadratic_drag_n_s2_per_m2);
        for (name, value) in [
            ("linear drag forward", linear.x),
            ("linear drag to the left", linear.y),
            ("linear drag upward", linear.z),
            ("quadratic drag forward", quadratic.x),
            ("quadratic drag to the left", quadratic.y),
            ("quadratic drag upward", quadratic.z),
            ("axial drag of a rotor", rotors.axial_drag_n_s2_per_m),
            ("lateral drag of a rotor", rotors.lateral_drag_n_s2_per_m),
            ("resistance of the battery", battery.resistance_ohm),
            ("height of the legs", legs.height_m),
            ("height of the guards", legs.guard_m),
            ("damping of a leg", legs.damping_n_s_per_m),
            ("friction", legs.friction),
        ] {
            at_least_zero(name, value)?;
        }
        if x > y + z || y > x + z || z > x + y {
            return Err(VehicleError::Inertia { x, y, z });
        }
        let (full_v, empty_v) = (battery.full_v, battery.empty_v);
        if !(full_v.is_finite() && full_v >= empty_v) {
            return Err(VehicleError::BatteryRises { full_v, empty_v });
        }
        sensors.check()
    }
}

/// Vehicle whose parts have been checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vehicle {
    parts: Parts,
}

impl Vehicle {
    /// A vehicle of these parts.
    ///
    /// # Errors
    /// The first parameter that is out of range.
    pub fn new(parts: Parts) -> Result<Self, VehicleError> {
        parts.check()?;
        Ok(Self { parts })
    }

    /// A quadrotor of the class of the paper's. See the [module](self).
    #[must_use]
    pub fn quadrotor() -> Self {
        Self {
            parts: Parts::quadrotor(),
        }
    }

    /// Parts of the vehicle.
    #[must_use]
    #[inline]
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// The vehicle with a point mass `mass_kg` fixed `below_m` below its centre of mass.
    ///
    /// # Errors
    /// [`VehicleError::Negative`] if a value is below zero or not finite.
    pub fn with_payload(&self, mass_kg: f64, below_m: f64) -> Result<Self, VehicleError> {
        at_least_zero("mass of the payload", mass_kg)?;
        at_least_zero("distance of the payload", below_m)?;
        Self::new(Parts {
            body: self.parts.body.with_payload(mass_kg, below_m),
            ..self.parts
        })
    }

    /// Height of the middle when the vehicle stands on level ground (m).
    #[must_use]
    pub fn standing_height_m(&self) -> f64 {
        let legs = &self.parts.legs;
        legs.height_m - self.parts.body.weight_n() / (4.0 * legs.stiffness_n_per_m)
    }
}
