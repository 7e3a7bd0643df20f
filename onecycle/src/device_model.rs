//! Models as devices take them, beside gains.
//!
//! | controller | typed | of `K e^(-tau s) / (T s + 1)`, or with an integrator | source |
//! |------------|-------|------------------------------------------------------|--------|
//! | WPILib | `kS`, `kV`, `kA` | dry friction, `1/K`, `T/K`: input = kS sign(v) + kV v + kA dv/dt | WPILib, "Feedforward Control in WPILib" |
//! | RepRapFirmware | `M307 R K D E` | `K/T` at full power, `100/T` (cooling at 100 degrees), `tau`, 1 | Duet3D, G-code dictionary, M307; `HeaterModel.h` |

use onecycle_design::{Spans, Vendor};
use onecycle_identify::{Identified, Interval};

use crate::words::number::{short, significant};
use crate::{Parameter, Structure};

/// Least dead time (s) that RepRapFirmware takes.
const LEAST_DEAD_TIME_S: f64 = 0.1;

/// The model as the devices of a vendor take it: a name, and what is typed. `None`: they take none.
pub(crate) fn of(
    identified: &Identified,
    plant: Option<(Vendor, Spans)>,
) -> Option<(&'static str, String)> {
    let (vendor, spans) = plant?;
    let heater = match vendor {
        Vendor::WpiLib => return Some(("feedforward", feedforward(identified))),
        Vendor::Marlin => 1,
        Vendor::MarlinBed => 0,
        _ => return None,
    };
    Some(("RepRap", heater_model(identified, heater, spans.output)))
}

/// Gains of a feed-forward with 90 % intervals.
fn feedforward(identified: &Identified) -> String {
    let stages = identified.model.structure().stages();
    let of = |parameter| inverse(&identified.estimate.get(parameter)?);
    let (1, 0, Some(velocity), Some(acceleration)) = (
        stages.poles,
        stages.pairs,
        of(Parameter::K),
        of(Parameter::KOverTBody),
    ) else {
        return "none: kV and kA are those of one lag; `structure=foptd` fits it to a velocity"
            .to_owned();
    };
    let friction = identified
        .fit
        .innovations()
        .and_then(|fit| fit.nonlinear.friction);
    let friction = friction.map_or("0 (no dry friction seen)".to_owned(), significant);
    format!("kS {friction}, kV {velocity}, kA {acceleration} (90 %); kS and kV with their signs")
}

/// The inverse of a gain: the estimate, and its interval where it has ends of one sign.
fn inverse(gain: &Interval) -> Option<String> {
    let estimate = gain.estimate.filter(|gain| *gain != 0.0)?;
    let value = significant(1.0 / estimate);
    Some(match (gain.low, gain.high) {
        (Some(low), Some(high)) if low * high > 0.0 => {
            format!("{value} ({} .. {})", short(1.0 / high), short(1.0 / low))
        }
        _ => format!("{value} (no interval)"),
    })
}

/// The command `M307`; the firmware designs its own controller for this model.
fn heater_model(identified: &Identified, heater: u8, full: f64) -> String {
    let is_one_lag = identified.model.structure() == Structure::Foptd;
    let of = |parameter| identified.model.parameter(parameter);
    let values = (
        of(Parameter::KOverTBody),
        of(Parameter::TBody),
        of(Parameter::Tau),
    );
    match values {
        (Some(rate), Some(lag_s), Some(tau_s))
            if is_one_lag && rate * full > 0.0 && lag_s > 0.0 =>
        {
            format!(
                "M307 H{heater} R{:.3} K{:.3}:0 D{:.2} E1.00 S1.00",
                rate * full,
                100.0 / lag_s,
                tau_s.max(LEAST_DEAD_TIME_S)
            )
        }
        _ => "none: M307 takes one lag and a dead time; fit them with `structure=foptd`".to_owned(),
    }
}
