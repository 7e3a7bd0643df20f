//! Last cycle of an oscillation, read by the network of a pack.

use onecycle_onboard::classify::classify_by;
use onecycle_onboard::cycle::Cycle;
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::Signature;
use onecycle_onboard::window::Window;

use super::input::RelayInput;
use super::oscillation::{Beginning, FitWindow, Stretch};
use crate::reading::Reading;
use crate::signals::Signals;

/// Rows of the window of one cycle: 256 bins, at least four in each of the 32 intervals of the signature if the cycle
/// has enough samples, and 5 rows that the window reserves for the estimator.
const BINS: usize = 261;
/// Room for edges of the input. A signature does not use the input, so none is stored.
const EDGES: usize = 1;

/// Reads the last cycle of `stretch`, whose noise `window` has measured. `None` if the cycle has no signature or the
/// pack returns no estimate.
pub(super) fn read(
    signals: &Signals<'_>,
    relay: &RelayInput,
    stretch: &Stretch,
    window: &FitWindow,
    pack: &Pack<'_>,
) -> Option<Reading> {
    let last = stretch.last();
    let cycle = last.cycles[0];
    let points = last.points(signals);
    let sample_s = window.sample_s();
    let start_s = *signals.time_s.get(points.start)?;
    // A signature begins with a rise. A process answers the mirrored input with the mirrored output.
    let (sign, duty) = match stretch.beginning {
        Beginning::Rise => (1.0, cycle.duty),
        Beginning::Fall => (-1.0, 1.0 - cycle.duty),
    };
    let mut of_cycle =
        Window::<BINS, EDGES>::of_groups(start_s, sample_s, signals.samples_per_point);
    for index in points.clone() {
        of_cycle.push_output(signals.time_s[index], sign * signals.output[index]);
    }
    let signature = Signature::new(&of_cycle, &Cycle { duty, ..cycle }).ok()?;
    let period_s = cycle.period_s;
    let classification = classify_by(pack, &signature, period_s, window.noise_sigma()).ok()?;
    let (low, high) = relay.means(&signals.input[points]);
    let relay_amplitude = 0.5 * (high - low);
    Some(Reading {
        classification,
        period_s,
        relay_amplitude,
        mean_input: 0.5 * (high + low) + relay_amplitude * (2.0 * cycle.duty - 1.0),
    })
}
