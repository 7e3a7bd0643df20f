//! Which estimator a recording takes.
//!
//! ```text
//! a steady relay oscillation                     that of the board (relay)
//! the same, but with an error of the model, or   both; the general one replaces it if its innovations are white and no
//! with a stretch refused                         controller is lost
//! anything else                                  the general one (innovations)
//! ```

use onecycle_design::Structure;
use onecycle_onboard::pack::Pack;

use crate::innovations;
use crate::outcome::Identification;
use crate::relay;
use crate::remark::Remark;
use crate::settings::{Method, Options, Road};
use crate::signals::Signals;
use crate::verdict::Verdict;

/// Largest autocorrelation of the innovations of a fit that may replace that of a steady oscillation.
const WHITE: f64 = 0.1;

pub(crate) fn identify(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
) -> Identification {
    match road(options) {
        Road::Relay => relay::identify(signals, options, pack),
        Road::General => innovations::identify(signals, options),
        Road::Automatic => automatic(signals, options, pack),
    }
}

/// The road that `options` leave: the relay's estimator knows one structure and the whole recording, and the methods
/// without a fit or without a pack are its own.
fn road(options: &Options) -> Road {
    let is_relays = matches!(options.structure, None | Some(Structure::Soiptd))
        && options.span_s == (None, None)
        && options.hold.is_none();
    match options.road {
        Road::Automatic if !is_relays => Road::General,
        Road::Automatic if options.method != Method::Map => Road::Relay,
        road => road,
    }
}

fn automatic(signals: &Signals<'_>, options: &Options, pack: Option<&Pack<'_>>) -> Identification {
    let steady = relay::identify(signals, options, pack);
    match &steady.outcome {
        Ok(_) if !is_doubtful(&steady) => steady,
        Ok(_) => {
            let general = innovations::identify(signals, options);
            if is_white(&general) && has_controller(&general) >= has_controller(&steady) {
                replaced(general, &steady)
            } else {
                steady
            }
        }
        Err(verdict) if is_final(verdict) => steady,
        Err(verdict) => {
            let mut general = innovations::identify(signals, options);
            if general.outcome.is_err() && steady.excitation.is_some() {
                // There is a relay oscillation: its verdict tells more.
                return steady;
            }
            let verdict = Box::new(verdict.clone());
            if general.outcome.is_ok() {
                general.remarks.push(Remark::NotASteadyOscillation(verdict));
            }
            general
        }
    }
}

/// Whether an accepted fit of a steady oscillation has left something unexplained.
fn is_doubtful(found: &Identification) -> bool {
    let is_disturbed = |remark: &Remark| matches!(remark, Remark::Disturbed(_) | Remark::Misfit(_));
    found.remarks.iter().any(is_disturbed)
}

/// Whether the general estimator explains the recording up to white innovations.
fn is_white(found: &Identification) -> bool {
    let innovations = found
        .outcome
        .as_ref()
        .ok()
        .and_then(|found| found.fit.innovations());
    innovations.is_some_and(|innovations| innovations.whiteness.autocorrelation < WHITE)
}

fn has_controller(found: &Identification) -> bool {
    (found.outcome.as_ref()).is_ok_and(|identified| identified.design.is_some())
}

/// The general result in place of that of the steady oscillation.
fn replaced(mut general: Identification, steady: &Identification) -> Identification {
    let misfit = steady
        .outcome
        .as_ref()
        .map_or(0.0, |found| found.fit.misfit);
    general.remarks.push(Remark::RelayReplaced(misfit));
    general
}

/// Whether no estimator can do better: the columns hold no experiment, or the request cannot be met.
fn is_final(verdict: &Verdict) -> bool {
    matches!(
        verdict,
        Verdict::ConstantInput
            | Verdict::ConstantOutput
            | Verdict::Units
            | Verdict::NoRelay {
                output_is_relay: true
            }
            | Verdict::NoController(_)
            | Verdict::Saturated { .. }
    )
}
