//! PX4's gains for the model of [`arx`](super::arx), by the law of [`Gmvc`].

use onecycle_design::cascade::Cascade;
use onecycle_design::rules::Gmvc;
use onecycle_identify::{MOST_CYCLES, Signals};

use super::arx::Model;
use super::{BaselineError, steady_cycles};

/// PX4's numbers scaled with the oscillation of a recording.
///
/// # Errors
/// [`BaselineError::NoOscillation`], [`BaselineError::Uneven`].
pub fn scaled_to_oscillation(signals: &Signals<'_>) -> Result<Gmvc, BaselineError> {
    let (found, _) = steady_cycles(signals, MOST_CYCLES)?;
    Ok(Gmvc::scaled_to(
        found.period_s,
        found.amplitude / found.relay_amplitude,
    ))
}

/// The gains for a model.
///
/// # Errors
/// [`BaselineError::NotThisProcess`] if proportional or integral gain is not positive.
pub fn cascade(law: &Gmvc, model: &Model) -> Result<Cascade, BaselineError> {
    let found = law.cascade(&model.coefficients, model.sample_s);
    found.ok_or(BaselineError::NotThisProcess(
        "the gains that follow from it are not positive",
    ))
}
