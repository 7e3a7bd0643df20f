//! Writing parameters as a whole: all of them are in force afterwards, or none.
//!
//! 1. [`Plan::new`] reads every old value and refuses what cannot be written. Nothing is changed.
//! 2. The caller keeps the old values, for example in a file.
//! 3. [`Plan::run`] sets each parameter, reads it back, and at the end reads all of them once more, because the vehicle may
//!    have restarted meanwhile.
//! 4. On a mismatch, a lost link or motors that are armed meanwhile, the old values are set and read back, for as long as the
//!    link needs to return, up to a limit.

use std::time::Duration;

use crate::error::LiveError;
use crate::parameters::Parameter;
use crate::vehicle::Vehicle;

/// A parameter to write.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Name in the firmware.
    pub name: String,
    /// New value.
    pub value: f64,
}

/// A parameter with its old and its new value.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Step {
    /// Name in the firmware.
    pub name: String,
    /// Value when the plan was made.
    pub old: f64,
    /// Value to write, as the vehicle can store it.
    pub new: f64,
    /// Whether the vehicle stores it as an integer.
    pub is_integer: bool,
    kind: Parameter,
}

/// Why nothing is written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The motors are armed.
    #[error("the vehicle is armed")]
    Armed,
    /// A value is not finite.
    #[error("the value of {0} is not a finite number")]
    NotFinite(String),
    /// The old value is not finite, so that it could not be restored.
    #[error(
        "the vehicle reports {0} as not a finite number, which could not be restored: set it first"
    )]
    OldNotFinite(String),
    /// The vehicle stores an integer.
    #[error("{0} is an integer in the vehicle, but {1} is not one")]
    NotInteger(String, f64),
    /// The firmware does not have these parameters.
    #[error("the firmware has no parameter {}", .0.join(", "))]
    Missing(Vec<String>),
    /// The vehicle cannot be asked.
    #[error(transparent)]
    Live(#[from] LiveError),
}

/// Why a write was rolled back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Cause {
    /// The vehicle has another value than the one that was written.
    #[error("the vehicle did not take {wanted} for {name}: it has {found}")]
    Mismatch {
        /// Name of the parameter.
        name: String,
        /// Value that was written.
        wanted: f64,
        /// Value that was read back.
        found: f64,
    },
    /// The motors were armed during the write.
    #[error("the vehicle was armed during the write")]
    Armed,
    /// The link or the vehicle failed.
    #[error("{1} while {0} was written")]
    Live(String, #[source] LiveError),
}

/// Value of a parameter after a roll-back that failed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct InForce {
    /// Name in the firmware.
    pub name: String,
    /// Old value.
    pub old: f64,
    /// Value that was to be written.
    pub new: f64,
    /// Value that was read back last. `None`: unknown, it is the old or the new one.
    pub now: Option<f64>,
}

/// How a write ended.
#[derive(Debug)]
#[non_exhaustive]
pub enum Outcome {
    /// Every new value was written and read back.
    Written,
    /// Every old value was read back: nothing has changed.
    RolledBack(Cause),
    /// The old values could not all be restored: these parameters may have another value than the old one.
    Uncertain(Cause, Vec<InForce>),
}

/// Parameters to write, with their old values.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    steps: Vec<Step>,
    may_be_armed: bool,
}

impl Plan {
    /// Reads the old values. Changes nothing. `may_be_armed`: write to a vehicle whose motors are armed too.
    ///
    /// # Errors
    /// The motors are armed, the firmware lacks a parameter, a value cannot be stored, or the link is lost.
    pub fn new(
        vehicle: &mut Vehicle,
        wanted: &[Assignment],
        may_be_armed: bool,
    ) -> Result<Self, Refusal> {
        if vehicle.is_armed() && !may_be_armed {
            return Err(Refusal::Armed);
        }
        let is_bad = |one: &&Assignment| !(one.value as f32).is_finite();
        if let Some(bad) = wanted.iter().find(is_bad) {
            return Err(Refusal::NotFinite(bad.name.clone()));
        }
        let names: Vec<String> = wanted.iter().map(|one| one.name.clone()).collect();
        let old = vehicle.parameters(&names)?;
        let there = |name: &String| old.get(name).copied().flatten();
        let missing: Vec<String> = (names.iter())
            .filter(|name| there(name).is_none())
            .cloned()
            .collect();
        if !missing.is_empty() {
            return Err(Refusal::Missing(missing));
        }
        let is_bad = |name: &&String| there(name).is_some_and(|old| !old.value.is_finite());
        if let Some(bad) = names.iter().find(is_bad) {
            return Err(Refusal::OldNotFinite(bad.clone()));
        }
        let step = |one: &Assignment| {
            let kind = there(&one.name)?;
            let new = kind.stored(one.value);
            let new = new.ok_or_else(|| Refusal::NotInteger(one.name.clone(), one.value));
            Some(new.map(|new| Step {
                name: one.name.clone(),
                old: kind.value,
                new,
                is_integer: kind.is_integer(),
                kind,
            }))
        };
        let steps: Result<Vec<Step>, Refusal> = wanted.iter().filter_map(step).collect();
        Ok(Self {
            steps: steps?,
            may_be_armed,
        })
    }

    /// The plan that writes the old values.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let turned = |step: &Step| Step {
            old: step.new,
            new: step.old,
            ..step.clone()
        };
        Self {
            steps: self.steps.iter().map(turned).collect(),
            may_be_armed: self.may_be_armed,
        }
    }

    /// Every parameter, with its old value.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Writes. If that fails, restores the old values, and waits for a lost link for at most `patience`. `progress` is told
    /// each parameter that is written.
    pub fn run(
        &self,
        vehicle: &mut Vehicle,
        patience: Duration,
        mut progress: impl FnMut(&Step),
    ) -> Outcome {
        for (at, step) in self.steps.iter().enumerate() {
            if let Err(cause) = self.write(vehicle, step) {
                return roll_back(vehicle, &self.steps[..=at], cause, patience);
            }
            progress(step);
        }
        match self.check(vehicle) {
            Ok(()) => Outcome::Written,
            Err(cause) => roll_back(vehicle, &self.steps, cause, patience),
        }
    }

    fn write(&self, vehicle: &mut Vehicle, step: &Step) -> Result<(), Cause> {
        let failed = |error| Cause::Live(step.name.clone(), error);
        let found = vehicle.set(&step.name, step.kind.with(step.new));
        matches(&step.name, step.new, found.map_err(failed)?)?;
        match vehicle.is_armed() && !self.may_be_armed {
            true => Err(Cause::Armed),
            false => Ok(()),
        }
    }

    fn check(&self, vehicle: &mut Vehicle) -> Result<(), Cause> {
        for (step, value) in self.steps.iter().zip(read(vehicle, &self.steps)) {
            let lost = || Cause::Live(step.name.clone(), LiveError::Lost);
            matches(&step.name, step.new, value.ok_or_else(lost)?)?;
        }
        Ok(())
    }
}

fn matches(name: &str, wanted: f64, found: f64) -> Result<(), Cause> {
    match wanted == found {
        true => Ok(()),
        false => Err(Cause::Mismatch {
            name: name.to_owned(),
            wanted,
            found,
        }),
    }
}

/// Sets the old values, the last one first, reads all of them back, and repeats what fails until the time is over.
fn roll_back(vehicle: &mut Vehicle, steps: &[Step], cause: Cause, patience: Duration) -> Outcome {
    let until = vehicle.now() + patience;
    let mut values: Vec<Option<f64>> = vec![None; steps.len()];
    loop {
        for (step, value) in steps.iter().zip(&mut values).rev() {
            if *value != Some(step.old) {
                *value = vehicle.set(&step.name, step.kind.with(step.old)).ok();
            }
            if value.is_none() {
                // The link is away: the others would fail too.
                break;
            }
        }
        let is_old = |(step, value): (&Step, &Option<f64>)| *value == Some(step.old);
        if steps.iter().zip(&values).all(is_old) {
            values = read(vehicle, steps);
            if steps.iter().zip(&values).all(is_old) {
                return Outcome::RolledBack(cause);
            }
        }
        if vehicle.now() >= until {
            let in_force = |(step, now): (&Step, &Option<f64>)| InForce {
                name: step.name.clone(),
                old: step.old,
                new: step.new,
                now: *now,
            };
            let left = steps.iter().zip(&values).filter(|one| !is_old(*one));
            return Outcome::Uncertain(cause, left.map(in_force).collect());
        }
    }
}

/// The values in the vehicle; `None`: not read.
fn read(vehicle: &mut Vehicle, steps: &[Step]) -> Vec<Option<f64>> {
    let names: Vec<String> = steps.iter().map(|step| step.name.clone()).collect();
    let read = vehicle.parameters(&names).unwrap_or_default();
    let value = |step: &Step| Some(read.get(&step.name).copied().flatten()?.value);
    steps.iter().map(value).collect()
}
