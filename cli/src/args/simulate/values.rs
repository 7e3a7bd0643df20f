//! Values of the options of `simulate` that hold more than one number.

use std::str::FromStr;

use crate::args::{self, Share};

/// Lowest and highest frequency (Hz): `1,20`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Band {
    pub(crate) low_hz: f64,
    pub(crate) high_hz: f64,
}

/// Gains of a PD controller and the time constant of its filter: `0.5,0.1` or `0.5,0.1,0.02`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LoopGains {
    pub(crate) kp: f64,
    pub(crate) kd: f64,
    pub(crate) filter_s: f64,
}

/// Standard deviation and correlation time (s) of gusts: `5%,0.5`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gust {
    pub(crate) sigma: Share,
    pub(crate) correlation_s: f64,
}

/// Share and size of outliers: `1%` or `1%,20%`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Outliers {
    pub(crate) share: f64,
    pub(crate) size: Share,
}

/// A disturbance with its strength: `walk=5%`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NamedDisturbance {
    /// Random walk at the input, after one second.
    Walk(Share),
    /// White noise at the input, its mean over one second.
    White(Share),
    /// Random walk of the measured output, after one second.
    OutputWalk(Share),
    /// Random walk at the input relative to the noise (rad/s).
    W1(f64),
    /// White noise at the input relative to the noise (rad/s).
    W0(f64),
    /// Random walk of the measured output relative to the noise (rad/s).
    Wy(f64),
}

/// Numbers separated by commas; all finite.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |word: &str| word.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    text.split(',').map(number).collect()
}

impl FromStr for Band {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match numbers(text).as_deref() {
            Some(&[low_hz, high_hz]) if 0.0 < low_hz && low_hz < high_hz => {
                Ok(Self { low_hz, high_hz })
            }
            _ => Err("a band is two rising frequencies in hertz, such as 1,20".to_owned()),
        }
    }
}

/// Time constant of the filter of a derivative as a part of `KD / KP`. K. J. Astrom and R. M. Murray, "Feedback Systems"
/// (2008), section 10.5: one part in 2 to 20.
const FILTER: f64 = 0.1;

impl FromStr for LoopGains {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kp, kd, filter_s) = match numbers(text).as_deref() {
            Some(&[kp, kd]) => (kp, kd, FILTER * kd / kp),
            Some(&[kp, kd, filter_s]) => (kp, kd, filter_s),
            _ => (f64::NAN, f64::NAN, f64::NAN),
        };
        if kp != 0.0 && kp * kd >= 0.0 && filter_s >= 0.0 && filter_s.is_finite() {
            return Ok(Self { kp, kd, filter_s });
        }
        Err("a controller is KP,KD or KP,KD,FILTER with gains of the same sign and a filter in seconds, such as 0.5,0.1,0.02"
            .to_owned())
    }
}

impl FromStr for Gust {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused = || {
            "gusts are a standard deviation and a positive correlation time in seconds, such as 5%,0.5"
                .to_owned()
        };
        let (sigma, time) = text.split_once(',').ok_or_else(refused)?;
        let sigma = sigma.trim().parse::<Share>()?;
        match numbers(time).as_deref() {
            Some(&[correlation_s]) if correlation_s > 0.0 && sigma.of(1.0) >= 0.0 => Ok(Self {
                sigma,
                correlation_s,
            }),
            _ => Err(refused()),
        }
    }
}

impl FromStr for Outliers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (share, size) = text.split_once(',').unwrap_or((text, "100%"));
        let part = args::share(share)?;
        let size = size.trim().parse::<Share>()?;
        if (0.0..1.0).contains(&part) && size.of(1.0) >= 0.0 {
            return Ok(Self { share: part, size });
        }
        Err("outliers are a share below 100% and a size, such as 1%, 0.01 or 1%,50%".to_owned())
    }
}

impl FromStr for NamedDisturbance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').unwrap_or((text, ""));
        let share = || match value.trim().parse::<Share>() {
            Ok(share) if share.of(1.0) >= 0.0 => Ok(share),
            Ok(_) => Err(format!(
                "the disturbance {name} must be zero or positive, but is {value}"
            )),
            Err(reason) => Err(reason),
        };
        let frequency = || match numbers(value).as_deref() {
            Some(&[w]) if w >= 0.0 => Ok(w),
            _ => Err(format!("{name} is a frequency in rad/s, such as {name}=3")),
        };
        match name.trim() {
            "walk" => share().map(Self::Walk),
            "white" => share().map(Self::White),
            "output-walk" => share().map(Self::OutputWalk),
            "w1" => frequency().map(Self::W1),
            "w0" => frequency().map(Self::W0),
            "wy" => frequency().map(Self::Wy),
            _ => Err(format!(
                "there is no disturbance '{name}': choose from walk, white, output-walk, w1, w0 and wy, such as walk=5%"
            )),
        }
    }
}
