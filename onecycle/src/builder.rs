//! Builder of an identification.

use onecycle_design::{Specification, Structure};
use onecycle_identify::{
    About, Hold, Identification, Method, Options, Remark, Signals, identify_by,
};
use onecycle_link::Recording;
use onecycle_onboard::pack::Pack;

use crate::feedback;

/// Identification to run: settings, and the pack whose network reads the last cycle.
///
/// ```
/// use onecycle::{Identify, Method, Pack};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
/// let found = Identify::new()
///     .cycles(2)
///     .phase_margin_rad(45_f64.to_radians())
///     .pack(Pack::embedded()?)
///     .method(Method::Map)
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
    /// Default settings: the whole recording, a PID in the style [`Balanced`](crate::Style::Balanced), the built-in pack.
    pub fn new() -> Self {
        Self {
            options: Options::default(),
            pack: Pack::embedded().ok(),
        }
    }

    /// Whether both have the same settings; their packs are not compared.
    pub(crate) fn is_set_like(&self, other: &Identify<'_>) -> bool {
        self.options == other.options
    }

    /// Fits the last `cycles` steady cycles of a relay test instead of the whole recording. Values outside 1 to 50 are set to the
    /// nearest limit. More cycles narrow the intervals; fewer follow a process that drifts.
    pub fn cycles(self, cycles: usize) -> Self {
        Self {
            options: self.options.cycles(cycles),
            ..self
        }
    }

    /// Designs the controller to these requirements. The recording completes them with its noise and its sample period,
    /// unless they have their own.
    pub fn specification(self, specification: Specification) -> Self {
        Self {
            options: self.options.specification(specification),
            ..self
        }
    }

    /// Requires at least this phase margin (rad) of the controller. It must lie between 0 and `pi/2`; otherwise the
    /// outcome is the verdict [`NoController`](crate::Verdict::NoController).
    pub fn phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            options: self.options.phase_margin_rad(phase_margin_rad),
            ..self
        }
    }

    /// Estimates the process from cycles by `method`.
    pub fn method(self, method: Method) -> Self {
        Self {
            options: self.options.method(method),
            ..self
        }
    }

    /// Fits this structure. `None` (default): the simplest one that explains the recording.
    pub fn structure(self, structure: impl Into<Option<Structure>>) -> Self {
        Self {
            options: self.options.structure(structure.into()),
            ..self
        }
    }

    /// Uses the recording from `from_s` to `to_s` (s) only. `None`: from its start, to its end.
    pub fn span_s(self, from_s: impl Into<Option<f64>>, to_s: impl Into<Option<f64>>) -> Self {
        Self {
            options: self.options.span_s(from_s.into(), to_s.into()),
            ..self
        }
    }

    /// Fits a process that is known to be unstable without its controller. Default: a recording that shows one is refused.
    pub fn unstable(self, is_unstable: bool) -> Self {
        Self {
            options: self.options.unstable(is_unstable),
            ..self
        }
    }

    /// Takes the input between two samples as held or as interpolated. `None` (default): the likelihood decides.
    pub fn hold(self, hold: impl Into<Option<Hold>>) -> Self {
        Self {
            options: self.options.hold(hold.into()),
            ..self
        }
    }

    /// `beta` of the relay that made the recording. Without it, the one that the recording states
    /// ([`Recording::relay_beta`]). A recording whose switches contradict it is refused.
    pub fn beta(self, beta: impl Into<Option<f64>>) -> Self {
        Self {
            options: self.options.beta(beta.into()),
            ..self
        }
    }

    /// The input was logged this much late (s), negative if early: the recording is corrected by it. With a value, zero too,
    /// the clocks are not judged by the relay's law.
    pub fn input_late_s(self, input_late_s: impl Into<Option<f64>>) -> Self {
        Self {
            options: self.options.input_late_s(input_late_s.into()),
            ..self
        }
    }

    /// Input before the first row, under which the process was at rest: for a step in the first row. Without it the likelihood
    /// decides whether the process was at rest.
    pub fn input_before(self, input_before: impl Into<Option<f64>>) -> Self {
        Self {
            options: self.options.input_before(input_before.into()),
            ..self
        }
    }

    /// Cutoff (Hz) of a second-order Butterworth low-pass through which the output was recorded. Without it, the one that the
    /// recording states ([`Recording::output_filter_hz`]); 0 for none.
    pub fn output_filter_hz(self, output_filter_hz: impl Into<Option<f64>>) -> Self {
        Self {
            options: self.options.output_filter_hz(output_filter_hz.into()),
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

    /// Uses no pack. [`Method::Map`] then fits without a prior; [`Method::Classify`] returns the verdict
    /// [`Unknown`](crate::Verdict::Unknown).
    pub fn without_pack(self) -> Self {
        Self { pack: None, ..self }
    }

    /// Identifies the process from `recording`. Cycles with a gap are not used.
    #[must_use]
    pub fn run(&self, recording: &Recording) -> Identification {
        let options = self.options_for(recording);
        let pack = self.pack.as_ref();
        with_signals(recording, |signals| {
            let found = match recording.set_point() {
                Some(set_point) if recording.is_of_a_flight_log() && !options.is_of_cycles() => {
                    feedback::identify(signals, set_point, (&options, pack))
                }
                _ => identify_by(signals, &options, pack),
            };
            judged(recording, signals, found)
        })
    }

    /// Identifies the process of a flight from the response to its set-point alone. `None` if the set-point is no instrument.
    pub(crate) fn run_on_response(&self, recording: &Recording) -> Option<Identification> {
        let options = self.options_for(recording);
        with_signals(recording, |signals| {
            let found = feedback::identify_response(signals, recording.set_point()?, &options)?;
            Some(judged(recording, signals, found))
        })
    }

    /// The options with what a recording states itself.
    fn options_for(&self, recording: &Recording) -> Options {
        let filter_hz = self.options.output_filter_hz;
        (self.options)
            .beta(self.options.beta.or(recording.relay_beta()))
            .output_filter_hz(filter_hz.or(recording.output_filter_hz()))
            .under_way(recording.is_of_a_flight_log())
    }
}

/// Refuses a flight that was too calm, and proposes nothing of a refused model.
fn judged(
    recording: &Recording,
    signals: &Signals<'_>,
    mut found: Identification,
) -> Identification {
    let calm = feedback::calm(recording, signals);
    if let Some(verdict) = calm.filter(|_| found.outcome.is_ok()) {
        found.outcome = Err(verdict);
    }
    if found.outcome.is_err() {
        found.remarks.retain(|remark| {
            remark.about() != About::Controller && !matches!(remark, Remark::NoController(_))
        });
    }
    found
}

/// Calls `read` with the columns of a recording, in the form that the functions of `onecycle-identify` take.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
/// let response = onecycle::with_signals(&recording, |signals| {
///     let oscillation = onecycle_identify::find_oscillation(signals, 8)?;
///     // Frequency response at the first three harmonics, without a model.
///     Ok::<_, onecycle::Verdict>(onecycle_identify::harmonics(signals, &oscillation, 3))
/// })?;
/// assert_eq!(response[0].order, 1);
/// # Ok(())
/// # }
/// ```
pub fn with_signals<T>(recording: &Recording, read: impl FnOnce(&Signals<'_>) -> T) -> T {
    let breaks: Vec<usize> = recording.gaps().iter().map(|gap| gap.index).collect();
    read(&Signals {
        time_s: recording.time_s(),
        input: recording.input(),
        output: recording.output(),
        // A power of two: above u32 only after 2^54 samples.
        samples_per_point: recording.samples_per_point() as u32,
        sample_period_s: recording.sample_period_s(),
        breaks: &breaks,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_options_and_the_built_in_pack() {
        for identify in [Identify::new(), Identify::default()] {
            assert_eq!(identify.options, Options::default());
            let card = identify.pack.as_ref().map(Pack::card);
            assert_eq!(card, Pack::embedded().ok().as_ref().map(Pack::card));
            assert!(card.is_some());
        }
    }

    // Each setter changes its own setting and leaves the others as they are.
    #[test]
    fn setters_are_those_of_the_options() {
        let default = Options::default();
        assert_eq!(Identify::new().cycles(3).options, default.cycles(3));
        assert_eq!(Identify::new().cycles(0).options.cycles, Some(1));
        let larger = Identify::new().phase_margin_rad(1.0);
        assert_eq!(larger.options, default.phase_margin_rad(1.0));
        let refined = Identify::new().method(Method::Refine);
        assert_eq!(refined.options, default.method(Method::Refine));
        let named = Identify::new().structure(Structure::Soptd);
        assert_eq!(named.options, default.structure(Some(Structure::Soptd)));
        assert_eq!(named.structure(None).options, default);
        let cut = Identify::new().span_s(1.0, None);
        assert_eq!(cut.options, default.span_s(Some(1.0), None));
        let held = Identify::new().hold(Hold::Held);
        assert_eq!(held.options, default.hold(Some(Hold::Held)));
        assert!(larger.pack.is_some() && refined.without_pack().pack.is_none());
    }

    // A phase margin out of range is a verdict that names the value, not a panic.
    #[test]
    fn a_phase_margin_out_of_range_has_no_controller() {
        let recording = onecycle_link::read("../examples/simulated_hover.csv", &Default::default());
        let recording = recording.unwrap();
        for margin_rad in [-0.1, 1.6, f64::NAN] {
            let found = Identify::new().phase_margin_rad(margin_rad).run(&recording);
            let verdict = found.outcome.unwrap_err();
            assert_eq!(verdict.kind(), "no_controller");
            assert!(
                verdict
                    .to_string()
                    .contains(&format!("is {margin_rad} rad"))
            );
        }
    }
}
