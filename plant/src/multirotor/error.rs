//! What is no vehicle, no wind, no flight: errors that name the parameter.

use onecycle_onboard::process::SoiptdError;

use super::frames::Vec3;

/// Why something is no vehicle, no wind or no flight: the parameter and its value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VehicleError {
    /// It has to be above zero and finite.
    #[error("the {name} must be above zero and finite, but is {value}")]
    NotPositive {
        /// Which.
        name: &'static str,
        /// Its value (SI unit).
        value: f64,
    },
    /// It has to be zero or more, and finite.
    #[error("the {name} must be zero or more and finite, but is {value}")]
    Negative {
        /// Which.
        name: &'static str,
        /// Its value (SI unit).
        value: f64,
    },
    /// It has to be finite.
    #[error("the {name} must be finite")]
    NotFinite {
        /// Which.
        name: &'static str,
    },
    /// A battery is between empty and full.
    #[error("the charge must be between 0 and 1, but is {0}")]
    Charge(f64),
    /// The empty battery has a higher voltage than the full one.
    #[error("the battery must have at most its full {full_v} V when empty, but has {empty_v} V")]
    BatteryRises {
        /// Open-circuit voltage when full (V).
        full_v: f64,
        /// Open-circuit voltage when empty (V).
        empty_v: f64,
    },
    /// No body can have these moments of inertia: each is at most the sum of the other two.
    #[error("no body has moments of inertia of {x}, {y} and {z} kg m^2")]
    Inertia {
        /// About forward (kg m^2).
        x: f64,
        /// About left (kg m^2).
        y: f64,
        /// About up (kg m^2).
        z: f64,
    },
    /// Full thrust does not carry it.
    #[error("hovering would take {thrust} of full thrust")]
    CannotHover {
        /// Thrust command that hovering would take (1).
        thrust: f64,
    },
    /// Its response at hover is no process.
    #[error("the response at hover is no process: {0}")]
    NoProcess(#[from] SoiptdError),
}

pub(super) fn positive(name: &'static str, value: f64) -> Result<(), VehicleError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(VehicleError::NotPositive { name, value })
    }
}

pub(super) fn at_least_zero(name: &'static str, value: f64) -> Result<(), VehicleError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(VehicleError::Negative { name, value })
    }
}

pub(super) fn finite(name: &'static str, value: Vec3) -> Result<(), VehicleError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(VehicleError::NotFinite { name })
    }
}

pub(super) fn charged(charge: f64) -> Result<(), VehicleError> {
    if (0.0..=1.0).contains(&charge) {
        Ok(())
    } else {
        Err(VehicleError::Charge(charge))
    }
}
