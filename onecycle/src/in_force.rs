//! The gains in force and the controller that has them: as given, or as they stand in a configuration or a log.

use onecycle_design::{Execution, Pid, Spans, Specification, Style, Vendor};
use onecycle_link::{Recording, TypedGains, typed_gains};

use crate::error::Error;
use crate::request::{Against, Requirements};
use crate::source::Source;

/// Bytes of a configuration or a log in which gains are looked for: `klippy.log` begins with its configuration.
const MOST_BYTES: u64 = 1 << 22;

/// The controller that runs the loop, and its gains.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InForce {
    pub(crate) against: Option<Pid>,
    pub(crate) plant: Option<(Vendor, Spans)>,
}

impl InForce {
    /// Of the requirements, and of the source of a recording with its configuration in it.
    pub(crate) fn of(
        asked: &Requirements,
        recording: Option<(&dyn Source, &Recording)>,
    ) -> Result<Self, Error> {
        let plant = asked.plant()?;
        if let (Some((vendor, _)), Some((_, recording)), None) =
            (plant, recording, asked.input_range)
        {
            check_range(vendor, recording)?;
        }
        let control_loop = recording.and_then(|(_, recording)| loop_of(recording));
        let without = Self {
            against: None,
            plant,
        };
        let (from, named): (&dyn Source, _) = match (&asked.against, recording) {
            (Some(Against::Gains(pid)), _) => {
                let against = Some(*pid);
                return Ok(Self { against, plant });
            }
            (Some(Against::File(path, name)), _) => (path, name.as_deref().or(control_loop)),
            (None, Some((source, recording))) if recording.is_of_a_tool() => (source, control_loop),
            (None, _) => return Ok(without),
        };
        let is_asked = asked.against.is_some();
        let refused = |reason: String| Error::Unreadable {
            name: from.name(),
            reason,
        };
        if is_asked && from.open().is_err() {
            return Err(refused("it cannot be read".to_owned()));
        }
        let bytes = from.head(MOST_BYTES);
        let text = String::from_utf8_lossy(&bytes);
        let of_vendor =
            |of: &TypedGains| plant.is_none_or(|(vendor, _)| vendor.name() == of.controller);
        let all: Vec<TypedGains> = typed_gains(&text).into_iter().filter(of_vendor).collect();
        let found = match chosen(&all, named) {
            Some(found) => found,
            None if is_asked => return Err(refused(none_of(&all))),
            None => return Ok(without),
        };
        let vendor = Vendor::from_name(found.controller);
        let plant = plant.or(vendor.map(|vendor| (vendor, asked.spans(vendor))));
        let against = plant.and_then(|(vendor, spans)| vendor.pid(found.values, &spans).ok());
        Ok(Self { against, plant })
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

/// Ripple and rounding of a full output.
const RIPPLE: f64 = 1.05;

/// Least full scale of usual devices that holds a recorded input.
#[must_use]
pub fn full_scale(input: &[f64]) -> f64 {
    let usual = [
        1.0, 100.0, 127.0, 255.0, 1000.0, 1023.0, 4095.0, 32767.0, 65535.0,
    ];
    let most = most(input);
    let holds = usual.into_iter().find(|full| most <= RIPPLE * full);
    holds.unwrap_or(most.ceil())
}

fn most(input: &[f64]) -> f64 {
    input.iter().fold(0.0, |most, input| most.max(input.abs()))
}

/// Refuses a recording whose input leaves the range that it has if none is given, or one of 0 to 1 where that is larger: the gains would be wrong by their ratio.
fn check_range(vendor: Vendor, recording: &Recording) -> Result<(), Error> {
    let full = vendor.full_input();
    let (most, such) = (most(recording.input()), full_scale(recording.input()));
    // An input that stays within 1 of a hundred is a share.
    let is_share = full > 1.0 && most <= 1.0;
    if !vendor.counts_output() || (most <= RIPPLE * full && !is_share) {
        return Ok(());
    }
    let only = if is_share { "only " } else { "" };
    Err(Error::Request(format!(
        "the input {only}reaches {most}, and `vendor={}` takes 0..{full} for its range: give the range of the recorded input, such as `input_range=0..{such}`",
        vendor.name()
    )))
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
               give them as `against=KP,KI,KD`"
            .to_owned(),
        names => format!(
            "it has gains of several loops, {}: name one as in `against=FILE:{}`",
            names.join(", "),
            names[0]
        ),
    }
}
