//! Flight: a vehicle with its state and the air around it.

use super::dynamics::{Held, VehicleState};
use super::error::{VehicleError, charged};
use super::frames::Vec3;
use super::mixer::Command;
use super::sensors::{History, SensorReading};
use super::vehicle::Vehicle;
use super::wind::{Gusts, Nudge, Wind};
use crate::NoiseSource;

/// Longest inner step (s): a twentieth of the quadrotor's motor lag, a tenth of the time constant of a leg.
pub const LONGEST_STEP_S: f64 = 1e-3;

/// Relative difference of step lengths that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// A vehicle in flight.
#[derive(Clone, Debug)]
pub struct Flight {
    vehicle: Vehicle,
    state: VehicleState,
    time_s: f64,
    wind: Wind,
    gusts: Gusts,
    nudge: Nudge,
    /// Height of the middle at altitude zero (m).
    ground_height_m: f64,
    history: History,
}

impl Flight {
    /// A vehicle on the ground, at rest, in calm air.
    #[must_use]
    pub fn standing(vehicle: Vehicle) -> Self {
        Self::begin(vehicle, VehicleState::standing(&vehicle))
    }

    /// A vehicle in any state, in calm air. Altitude zero is where the vehicle would stand.
    ///
    /// # Errors
    /// [`VehicleError::NotFinite`] if a number of the state is not finite, [`VehicleError::Charge`] for a charge
    /// outside 0..1.
    pub fn new(vehicle: Vehicle, state: VehicleState) -> Result<Self, VehicleError> {
        if !state.is_finite() {
            return Err(VehicleError::NotFinite { name: "state" });
        }
        charged(state.charge)?;
        Ok(Self::begin(vehicle, state))
    }

    fn begin(vehicle: Vehicle, state: VehicleState) -> Self {
        let ground_height_m = vehicle.standing_height_m();
        let reading = reading_of(&vehicle, &state, ground_height_m);
        Self {
            vehicle,
            state,
            time_s: 0.0,
            wind: Wind::CALM,
            gusts: Gusts::default(),
            nudge: Nudge::default(),
            ground_height_m,
            history: History::new(0.0, reading),
        }
    }

    /// Advances by `dt_s` with a held command, in equal inner steps of at most [`LONGEST_STEP_S`]. Takes numbers
    /// from `noise` only if there are gusts. A time that is not positive and finite is ignored. See
    /// [`Command::clamped`] for commands out of range.
    pub fn step(&mut self, command: Command, dt_s: f64, noise: &mut impl NoiseSource) {
        if !(dt_s > 0.0 && dt_s.is_finite()) {
            return;
        }
        let speed_shares = command.motors().map(f64::sqrt);
        let mut left_s = dt_s;
        while left_s > ROUNDING * dt_s {
            // A nudge ends between two inner steps.
            let until_s = if self.nudge.duration_s > 0.0 {
                left_s.min(self.nudge.duration_s)
            } else {
                left_s
            };
            let count = (until_s / LONGEST_STEP_S * (1.0 - ROUNDING))
                .ceil()
                .max(1.0);
            self.inner_step(speed_shares, until_s / count, noise);
            left_s -= until_s / count;
        }
    }

    fn inner_step(&mut self, speed_shares: [f64; 4], dt_s: f64, noise: &mut impl NoiseSource) {
        let gust = self.gusts.velocity_m_per_s();
        let held = Held {
            parts: self.vehicle.parts(),
            speed_shares,
            wind_m_per_s: self.wind.steady_m_per_s + gust,
            force_n: self.nudge.force_n,
            torque_nm: self.nudge.torque_nm,
        };
        self.state = held.step(&self.state, dt_s);
        self.time_s += dt_s;
        self.gusts.step(&self.wind, dt_s, noise);
        self.nudge.duration_s -= dt_s;
        if self.nudge.duration_s <= ROUNDING * dt_s {
            self.nudge = Nudge::default();
        }
        let reading = self.reading();
        self.history
            .push(self.time_s, reading, &self.vehicle.parts().sensors);
    }

    /// Measurements of the sensors now, with noise and delay.
    pub fn sense(&self, noise: &mut impl NoiseSource) -> SensorReading {
        self.history.read(&self.vehicle.parts().sensors, noise)
    }

    /// True values of the measured quantities now.
    #[must_use]
    pub fn reading(&self) -> SensorReading {
        reading_of(&self.vehicle, &self.state, self.ground_height_m)
    }

    /// Present state.
    #[must_use]
    pub fn state(&self) -> &VehicleState {
        &self.state
    }

    /// Time since the start (s).
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The vehicle.
    #[must_use]
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// Voltage of the battery under the present load (V).
    #[must_use]
    pub fn voltage_v(&self) -> f64 {
        let parts = self.vehicle.parts();
        let speeds = self.state.rotors_rad_per_s;
        let power_w = speeds
            .iter()
            .map(|&speed| parts.rotors.power_w(speed))
            .sum();
        parts.battery.voltage_v(self.state.charge, power_w)
    }

    /// Takes up or drops a payload: continues with another vehicle, with the middle, the attitude and the rates
    /// unchanged. A payload that is taken up already moves with the vehicle; when one is dropped the vehicle
    /// keeps its velocity.
    pub fn set_vehicle(&mut self, vehicle: Vehicle) {
        let axes = self.state.world_from_body.axes();
        let moved_m =
            vehicle.parts().body.centre_of_mass_m - self.vehicle.parts().body.centre_of_mass_m;
        self.state.position_m += axes.world_from_body(moved_m);
        self.state.velocity_m_per_s +=
            axes.world_from_body(self.state.rates_rad_per_s.cross(moved_m));
        self.vehicle = vehicle;
    }

    /// Sets the wind from now on; gusts develop from their present value.
    ///
    /// # Errors
    /// The first parameter that is out of range.
    pub fn set_wind(&mut self, wind: Wind) -> Result<(), VehicleError> {
        wind.check()?;
        self.wind = wind;
        Ok(())
    }

    /// Applies a force and a torque from now on for their duration; a nudge in progress ends.
    ///
    /// # Errors
    /// The first parameter that is out of range.
    pub fn nudge(&mut self, nudge: Nudge) -> Result<(), VehicleError> {
        nudge.check()?;
        self.nudge = if nudge.duration_s > 0.0 {
            nudge
        } else {
            Nudge::default()
        };
        Ok(())
    }
}

fn reading_of(vehicle: &Vehicle, state: &VehicleState, ground_height_m: f64) -> SensorReading {
    let axes = state.world_from_body.axes();
    let arm = -vehicle.parts().body.centre_of_mass_m;
    let turning = state.rates_rad_per_s.cross(arm);
    SensorReading {
        position_m: state.position_m + axes.world_from_body(arm)
            - Vec3::new(0.0, 0.0, ground_height_m),
        velocity_m_per_s: state.velocity_m_per_s + axes.world_from_body(turning),
        angles_rad: state.world_from_body.angles_rad(),
        rates_rad_per_s: state.rates_rad_per_s,
    }
}
