//! The gains in force and the controller that has them: as given, or as they stand in a configuration or a log.

use std::path::Path;

use onecycle::{Execution, Pid, Recording, Specification, Style};
use onecycle_design::{Spans, Vendor};
use onecycle_link::{TypedGains, typed_gains};

use crate::args::{Against, DesignArguments};
use crate::failure::Failure;
use crate::reading::head;

/// Bytes of a configuration or a log in which gains are looked for: `klippy.log` begins with its configuration.
const MOST_BYTES: u64 = 1 << 22;

/// The controller that runs the loop, and its gains.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InForce {
    pub(crate) against: Option<Pid>,
    pub(crate) plant: Option<(Vendor, Spans)>,
}

impl InForce {
    /// Of the arguments, and of the file of a recording with its configuration in it.
    pub(crate) fn of(
        arguments: &DesignArguments,
        recording: Option<(&Path, &Recording)>,
    ) -> Result<Self, Failure> {
        let plant = arguments.plant()?;
        let control_loop = recording.and_then(|(_, recording)| loop_of(recording));
        let from = match (arguments.against(), recording) {
            (Some(Against::Gains(pid)), _) => {
                let against = Some(*pid);
                return Ok(Self { against, plant });
            }
            (Some(Against::File(path, _)), _) => path.as_path(),
            (None, Some((path, recording))) if recording.is_of_a_tool() => path,
            (None, _) => {
                return Ok(Self {
                    against: None,
                    plant,
                });
            }
        };
        let is_asked = arguments.against().is_some();
        let bytes = head(from, MOST_BYTES);
        if bytes.is_none() && is_asked {
            return Err(Failure::unreadable(from, "it cannot be read"));
        }
        let text = String::from_utf8_lossy(&bytes.unwrap_or_default()).into_owned();
        let of_vendor =
            |of: &TypedGains| plant.is_none_or(|(vendor, _)| vendor.name() == of.controller);
        let all: Vec<TypedGains> = typed_gains(&text).into_iter().filter(of_vendor).collect();
        let named = match arguments.against() {
            Some(Against::File(_, Some(name))) => Some(name.as_str()),
            _ => control_loop,
        };
        let found = match chosen(&all, named) {
            Some(found) => found,
            None if is_asked => return Err(Failure::unreadable(from, none_of(&all))),
            None => {
                return Ok(Self {
                    against: None,
                    plant,
                });
            }
        };
        let vendor = Vendor::from_name(found.controller);
        let plant = plant.or(vendor.map(|vendor| (vendor, arguments.spans(vendor))));
        let pid = plant.and_then(|(vendor, spans)| vendor.pid(found.values, &spans).ok());
        Ok(Self {
            against: pid,
            plant,
        })
    }

    /// The requirements on the controller as this one runs it, where the user does not say otherwise.
    pub(crate) fn law(&self, asked: Specification) -> Specification {
        let Some((vendor, _)) = self.plant.filter(|_| asked.style != Style::Paper) else {
            return asked;
        };
        let law = vendor.law();
        let asked = law
            .setpoint_weight
            .map_or(asked, |weight| asked.with_setpoint_weight(weight));
        match law
            .sample_period_s
            .filter(|_| asked.execution == Execution::default())
        {
            Some(period_s) => asked.with_execution(Execution::sampled(period_s)),
            None => asked,
        }
    }
}

/// The loop in the names of a recording's columns: `extruder` of `extruder.pwm`.
fn loop_of(recording: &Recording) -> Option<&str> {
    let (control_loop, _) = recording.columns().input.name.rsplit_once('.')?;
    Some(control_loop)
}

/// The gains of the loop, or the only ones.
fn chosen<'a>(all: &'a [TypedGains], control_loop: Option<&str>) -> Option<&'a TypedGains> {
    // Marlin has one set of gains for `T` and the tools `T0`, `T1`.
    let is_of = |of: &&TypedGains| {
        control_loop.is_some_and(|name| {
            name == of.control_loop || name.starts_with('T') && of.control_loop == "T"
        })
    };
    let named = all.iter().find(is_of);
    match (named, all) {
        (Some(found), _) => Some(found),
        (None, [only]) => Some(only),
        _ => None,
    }
}

fn none_of(all: &[TypedGains]) -> String {
    let names: Vec<&str> = all.iter().map(|of| of.control_loop.as_str()).collect();
    match names.as_slice() {
        [] => "it has no gains of Klipper (pid_kp), Marlin (M301), ESPHome (control_parameters) or an Arduino (Kp = 2); \
               give them as --against KP,KI,KD"
            .to_owned(),
        names => format!(
            "it has gains of several loops, {}: name one as in --against FILE:{}",
            names.join(", "),
            names[0]
        ),
    }
}
