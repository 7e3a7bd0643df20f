//! Recordings as the estimator reads them.

use onecycle_lab::identify::Signals;
use onecycle_link::Recording;

/// Index of the first point behind each gap.
pub(super) fn breaks(recording: &Recording) -> Vec<usize> {
    recording.gaps().iter().map(|gap| gap.index).collect()
}

/// A recording with its [`breaks`].
pub(super) fn signals<'a>(recording: &'a Recording, breaks: &'a [usize]) -> Signals<'a> {
    Signals {
        time_s: recording.time_s(),
        input: recording.input(),
        output: recording.output(),
        samples_per_point: recording.samples_per_point() as u32,
        sample_period_s: recording.sample_period_s(),
        breaks,
    }
}
