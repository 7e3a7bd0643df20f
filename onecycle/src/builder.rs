//! The builder of an identification.

use onecycle_identify::{Identification, Method, Options, Signals, identify_by};
use onecycle_link::Recording;
use onecycle_onboard::pack::Pack;

/// An identification to run: settings, and the pack that reads the last cycle.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
/// let found = onecycle::Identify::new()
///     .cycles(2)
///     .phase_margin_rad(45_f64.to_radians())
///     .run(&recording);
/// let used = found.oscillation().map(|oscillation| oscillation.cycles_used);
/// assert_eq!(used, Some(2));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[must_use = "nothing is identified until `run` is called"]
pub struct Identify<'a> {
    options: Options,
    pack: Option<Pack<'a>>,
}

impl Default for Identify<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'a> Identify<'a> {
    /// With the default settings: the last eight cycles, [`Method::Map`], a PD with 20 degrees of phase margin, and the
    /// built-in pack.
    pub fn new() -> Self {
        Self {
            options: Options::default(),
            pack: Pack::embedded().ok(),
        }
    }

    /// Fits the last `cycles` steady cycles, 1 to 50; values beyond are brought to the nearest of these.
    pub fn cycles(self, cycles: usize) -> Self {
        Self {
            options: self.options.cycles(cycles),
            ..self
        }
    }

    /// Asks for a controller with at least this phase margin (rad), between 0 and `pi/2`. With a value out of this range
    /// the result is the verdict [`NoController`](crate::Verdict::NoController).
    pub fn phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            options: self.options.phase_margin_rad(phase_margin_rad),
            ..self
        }
    }

    /// Finds the process by `method`.
    pub fn method(self, method: Method) -> Self {
        Self {
            options: self.options.method(method),
            ..self
        }
    }

    /// Reads the last cycle with this pack instead of the built-in one.
    pub fn pack(self, pack: Pack<'a>) -> Self {
        Self {
            pack: Some(pack),
            ..self
        }
    }

    /// Does not read the last cycle: [`Method::Map`] then fits without a prior, [`Method::Classify`] refuses.
    pub fn without_pack(self) -> Self {
        Self { pack: None, ..self }
    }

    /// Identifies the process behind `recording`. No cycle that has a gap is used.
    #[must_use]
    pub fn run(&self, recording: &Recording) -> Identification {
        with_signals(recording, |signals| {
            identify_by(signals, &self.options, self.pack.as_ref())
        })
    }
}

/// Calls `read` with the columns of a recording, as functions of `onecycle-identify` take them.
pub fn with_signals<T>(recording: &Recording, read: impl FnOnce(&Signals<'_>) -> T) -> T {
    let breaks: Vec<usize> = recording.gaps().iter().map(|gap| gap.index).collect();
    read(&Signals {
        time_s: recording.time_s(),
        input: recording.input(),
        output: recording.output(),
        // A power of two: above u32 after 2^54 samples.
        samples_per_point: recording.samples_per_point() as u32,
        sample_period_s: recording.sample_period_s(),
        breaks: &breaks,
    })
}
