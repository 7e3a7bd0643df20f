//! Errors of vehicle, wind and flight; each names the parameter.

use onecycle_onboard::process::SoiptdError;

use super::frames::Vec3;

/// Parameter of a vehicle, a wind or a flight that is out of range, with its value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VehicleError {
    /// The parameter must be above zero and finite.
    #[error("the {name} must be above zero and finite, but is {value}")]
    NotPositive {
        /// Name.
        name: &'static str,
        /// Value (SI unit).
        value: f64,
    },
    /// The parameter must be zero or more, and finite.
    #[error("the {name} must be zero or more and finite, but is {value}")]
    Negative {
        /// Name.
        name: &'static str,
        /// Value (SI unit).
        value: f64,
    },
    /// The parameter must be finite.
    #[error("the {name} must be finite")]
    NotFinite {
        /// Name.
        name: &'static str,
    },
    /// The charge must be between 0 (empty) and 1 (full).
    #[error("the charge must be between 0 and 1, but is {0}")]
    Charge(f64),
    /// The empty battery has a higher voltage than the full one.
    #[error(
        "the voltage of the empty battery must not exceed that of the full one, {full_v} V, but is {empty_v} V"
    )]
    BatteryRises {
        /// Open-circuit voltage when full (V).
        full_v: f64,
        /// Open-circuit voltage when empty (V).
        empty_v: f64,
    },
    /// Impossible moments of inertia: each is at most the sum of the other two.
    #[error(
        "moments of inertia of {x}, {y} and {z} kg m^2 are impossible: each is at most the sum of the others"
    )]
    Inertia {
        /// About forward (kg m^2).
        x: f64,
        /// About left (kg m^2).
        y: f64,
        /// About up (kg m^2).
        z: f64,
    },
    /// Full thrust does not carry the vehicle.
    #[error("the vehicle cannot hover: it would need {thrust} of its full thrust")]
    CannotHover {
        /// Thrust command that hover would need (1).
        thrust: f64,
    },
    /// The response at hover is not a process.
    #[error("the response at hover is not a process: {0}")]
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
