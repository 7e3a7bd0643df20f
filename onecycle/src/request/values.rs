//! Values of settings, read from text and checked.

use std::fs::File;
use std::io::Read;
use std::ops::RangeBounds;
use std::path::{Path, PathBuf};

use onecycle_design::Pid;
use onecycle_identify::{Hold, Method};
use onecycle_link::{Axis, SAMPLE_RATES_HZ, TimeUnit};

use super::{Against, LoopKind};

/// Largest DBC file, in bytes: those of cars have some hundred thousand.
const MOST_OF_A_DBC: u64 = 1 << 24;

/// Methods for a steady relay oscillation by name.
pub const METHODS: [(&str, Method); 3] = [
    ("classify", Method::Classify),
    ("refine", Method::Refine),
    ("map", Method::Map),
];
/// What the input does between two samples, by name.
pub const HOLDS: [(&str, Hold); 2] = [("held", Hold::Held), ("interpolated", Hold::Interpolated)];
/// Axes by name.
pub const AXES: [(&str, Axis); 3] = [
    ("roll", Axis::Roll),
    ("pitch", Axis::Pitch),
    ("yaw", Axis::Yaw),
];
/// What the loops of a vehicle control, by name.
pub const LOOPS: [(&str, LoopKind); 3] = [
    ("rate", LoopKind::Rate),
    ("attitude", LoopKind::Attitude),
    ("altitude", LoopKind::Altitude),
];

/// The value of a name.
pub(super) fn choice<T: Copy>(name: &str, all: &[(&str, T)]) -> Result<T, String> {
    let found = all.iter().find(|(known, _)| *known == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
        format!("{name:?} is none of {}", names.join(", "))
    })
}

/// A finite number.
pub fn number(text: &str) -> Option<f64> {
    text.trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
}

fn within(text: &str, is_allowed: impl Fn(f64) -> bool, otherwise: &str) -> Result<f64, String> {
    let value = number(text).filter(|value| is_allowed(*value));
    value.ok_or_else(|| otherwise.to_owned())
}

/// A number, or a percentage of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Share {
    /// A number.
    Value(f64),
    /// A percentage.
    Percent(f64),
}

impl Share {
    /// The value; a percentage is taken of `whole`.
    #[must_use]
    pub fn of(self, whole: f64) -> f64 {
        match self {
            Self::Value(value) => value,
            Self::Percent(percent) => 0.01 * percent * whole,
        }
    }
}

impl std::str::FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (of, share): (_, fn(f64) -> Self) = match text.strip_suffix('%') {
            Some(number) => (number.trim_end(), Self::Percent),
            None => (text, Self::Value),
        };
        let value = of.parse().ok().filter(|value: &f64| value.is_finite());
        value
            .map(share)
            .ok_or_else(|| format!("'{text}' is neither a number nor a percentage such as 30%"))
    }
}

/// A share of a whole: `5%` or `0.05`. A larger number than 1 without a percent sign may mean either, so it is refused.
///
/// # Errors
/// One sentence, as of all functions here.
pub fn share(text: &str) -> Result<f64, String> {
    match text.trim().parse::<Share>()? {
        Share::Value(value) if value.abs() > 1.0 => Err(format!(
            "a share is written as 5% or 0.05: write {value}% or {}",
            value / 100.0
        )),
        share => Ok(share.of(1.0)),
    }
}

/// A share within a range; `otherwise` says which it is.
///
/// # Errors
/// One sentence.
pub fn share_within(
    text: &str,
    range: impl RangeBounds<f64>,
    otherwise: &str,
) -> Result<f64, String> {
    let share = share(text)?;
    range
        .contains(&share)
        .then_some(share)
        .ok_or_else(|| otherwise.to_owned())
}

/// A phase margin in degrees, as radians.
///
/// # Errors
/// One sentence.
pub fn phase_margin(text: &str) -> Result<f64, String> {
    let is_allowed = |degrees| degrees > 0.0 && degrees < 90.0;
    within(
        text,
        is_allowed,
        "a phase margin lies between 0 and 90 degrees",
    )
    .map(f64::to_radians)
}

/// A sample rate in hertz, in the range of recordings.
///
/// # Errors
/// One sentence.
pub fn sample_rate(text: &str) -> Result<f64, String> {
    let is_allowed = |rate_hz| SAMPLE_RATES_HZ.contains(&rate_hz);
    within(
        text,
        is_allowed,
        "a sample rate lies between 1e-6 and 1e9 Hz",
    )
}

/// A unit of time.
///
/// # Errors
/// One sentence.
pub fn time_unit(text: &str) -> Result<TimeUnit, String> {
    TimeUnit::from_name(text)
        .ok_or_else(|| "a unit of time is d, h, min, s, ms, us or ns".to_owned())
}

/// The text of a DBC file of at most 16 MiB.
///
/// # Errors
/// One sentence.
pub fn dbc(path: &str) -> Result<String, String> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| error.to_string())?;
    let read = file.take(MOST_OF_A_DBC + 1).read_to_end(&mut bytes);
    match read.map_err(|error| error.to_string())? as u64 {
        0..=MOST_OF_A_DBC => Ok(String::from_utf8_lossy(&bytes).into_owned()),
        _ => Err(format!("the file has more than {MOST_OF_A_DBC} bytes")),
    }
}

/// A time in seconds.
///
/// # Errors
/// One sentence.
pub fn time_s(text: &str) -> Result<f64, String> {
    within(text, |_| true, "a time is a number of seconds")
}

/// An input.
///
/// # Errors
/// One sentence.
pub fn finite(text: &str) -> Result<f64, String> {
    within(text, |_| true, "an input is a finite number")
}

/// A cutoff in hertz, 0 for none.
///
/// # Errors
/// One sentence.
pub fn cutoff_hz(text: &str) -> Result<f64, String> {
    within(
        text,
        |hz| hz >= 0.0,
        "a cutoff is a number of Hz, 0 for none",
    )
}

/// `beta` of a relay.
///
/// # Errors
/// One sentence.
pub fn beta(text: &str) -> Result<f64, String> {
    within(
        text,
        |beta| beta.abs() < 1.0,
        "beta is a number between -1 and 1",
    )
}

/// A limit of `Ms`.
///
/// # Errors
/// One sentence.
pub fn peak(text: &str) -> Result<f64, String> {
    let is_allowed = |peak| (1.05..=10.0).contains(&peak);
    within(
        text,
        is_allowed,
        "Ms lies between 1.05 and 10; usual are 1.2 to 2.0",
    )
}

/// A gain margin, as a factor.
///
/// # Errors
/// One sentence.
pub fn gain_margin(text: &str) -> Result<f64, String> {
    let is_allowed = |factor| (1.0..=100.0).contains(&factor);
    within(
        text,
        is_allowed,
        "a gain margin is a factor between 1 and 100; 2 is 6 dB",
    )
}

/// A positive number.
///
/// # Errors
/// One sentence.
pub fn positive(text: &str) -> Result<f64, String> {
    within(text, |value| value > 0.0, "this is a positive number")
}

/// A share of a step, as a number or a percentage.
///
/// # Errors
/// One sentence.
pub fn overshoot(text: &str) -> Result<f64, String> {
    let otherwise = "an overshoot lies between 0 % and 100 %, such as 15% or 0.15";
    share_within(text, 0.0..=1.0, otherwise)
}

/// A share of noise, as a number or a percentage.
///
/// # Errors
/// One sentence.
pub fn noise(text: &str) -> Result<f64, String> {
    let otherwise = "a share of noise lies between 0.0001 % and 10000 %, such as 25% or 0.25";
    share_within(text, 1e-6..=100.0, otherwise)
}

/// A share of the way to the proposed gains.
///
/// # Errors
/// One sentence.
pub fn step(text: &str) -> Result<f64, String> {
    let step = share(text)?;
    let otherwise =
        "a step lies above 0 %, up to 100 %, such as 25% or 0.25; 100% goes all the way";
    (step > 0.0 && step <= 1.0)
        .then_some(step)
        .ok_or_else(|| otherwise.to_owned())
}

/// The span of a range such as `0..200`.
///
/// # Errors
/// One sentence.
pub fn span(text: &str) -> Result<f64, String> {
    let ends = text.split_once("..");
    let ends = ends.and_then(|(low, high)| Some((number(low)?, number(high)?)));
    ends.map(|(low, high)| high - low)
        .filter(|span| span.is_normal() && *span > 0.0)
        .ok_or_else(|| "write a range as LOW..HIGH, such as 0..200".to_owned())
}

/// Gains in parallel form, or the name of a file with gains: `FILE`, or `FILE:LOOP`.
///
/// # Errors
/// One sentence.
pub fn against(text: &str) -> Result<Against, String> {
    let is_name = !text.contains(',') && number(text).is_none() && !text.trim().is_empty();
    if !is_name {
        return gains(text).map(Against::Gains);
    }
    let parts = text
        .rsplit_once(':')
        .filter(|(path, _)| Path::new(path).is_file());
    let (path, name) = parts.map_or((text, None), |(path, name)| (path, Some(name.to_owned())));
    Ok(Against::File(PathBuf::from(path), name))
}

/// Gains in parallel form: `Kp,Ki,Kd` or `Kp,Ki,Kd,Tf`.
///
/// # Errors
/// One sentence.
pub fn gains(text: &str) -> Result<Pid, String> {
    let values: Option<Vec<f64>> = text.split(',').map(number).collect();
    let wanted = "write the gains as Kp,Ki,Kd or Kp,Ki,Kd,Tf, such as 40,5,12 or 40,0,12,0.002";
    let (gains, filter_s) = match values.as_deref() {
        Some([kp, ki, kd]) => ([*kp, *ki, *kd], 0.0),
        Some([kp, ki, kd, filter_s]) => ([*kp, *ki, *kd], *filter_s),
        _ => return Err(wanted.to_owned()),
    };
    if gains.iter().all(|gain| *gain == 0.0) {
        return Err("at least one of the gains Kp,Ki,Kd is not zero".to_owned());
    }
    if filter_s < 0.0 {
        return Err("the time Tf of the filter is zero or positive".to_owned());
    }
    Ok(Pid::new(gains[0], gains[1], gains[2]).with_filter_s(filter_s))
}
