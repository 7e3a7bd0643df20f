//! Arguments of `simulate`.

use std::path::PathBuf;

use clap::Args;

use super::{ProcessArguments, Share};

/// Simulate a relay test and write its recording as CSV.
///
/// The process is simulated exactly, with the relay of the on-board library. Comments at the head of the
/// file state the true process, bias and noise.
#[derive(Clone, Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle simulate --k 1 --t-prop 0.0321 --t-body 1.6886 --tau 0.0237 --out hover.csv\n",
    "  onecycle simulate --k-over-t-body 40 --t-prop 0.05 --t-body inf --tau 0.015 --noise 1% \\\n",
    "      --bias 30% --seed 7 | onecycle identify -\n"
))]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) process: ProcessArguments,
    /// Amplitude of the relay (input unit)
    #[arg(
        long,
        value_name = "H",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    pub(crate) amplitude: f64,
    /// Relay parameter beta: the sine of the phase at which the process oscillates
    #[arg(long, value_name = "BETA", default_value_t = -0.73, allow_negative_numbers = true)]
    pub(crate) beta: f64,
    /// Keep the centre of the relay fixed: do not trim the input bias
    #[arg(long)]
    pub(crate) no_trim: bool,
    /// Difference of the high and the low time that the trim leaves, as a fraction of the cycle (0 to 0.5);
    /// 0.2 gives about twice the information of a symmetric cycle
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, conflicts_with = "no_trim",
          allow_negative_numbers = true, value_parser = asymmetry)]
    pub(crate) asymmetry: f64,
    /// Plain relay, without smoothing of the error and minimum switching time
    #[arg(long)]
    pub(crate) bare: bool,
    /// Duration of the noise measurement before the test, in seconds
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.1,
        allow_negative_numbers = true
    )]
    pub(crate) preroll: f64,
    /// Constant input disturbance, not recorded (input unit, or % of the relay's amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) bias: Share,
    /// Standard deviation of the measurement noise (output unit, or % of the noise-free amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) noise: Share,
    /// Resolution of the sensor (output unit, or % of the noise-free amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) quantum: Share,
    /// Standard deviation of the sample period (s, or % of it)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) jitter: Share,
    /// Initial output (output unit, or % of the noise-free amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) offset: Share,
    /// Reference of the output (output unit)
    #[arg(
        long,
        value_name = "R",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub(crate) reference: f64,
    /// Sample rate, in hertz
    #[arg(
        long,
        value_name = "HZ",
        default_value_t = 1000.0,
        allow_negative_numbers = true
    )]
    pub(crate) sample_rate: f64,
    /// Duration, in seconds [default: 20 periods of the oscillation]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) duration: Option<f64>,
    /// Seed of noise and jitter; the same seed gives the same recording
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// File to write [default: the standard output]
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// An asymmetry of the relay.
fn asymmetry(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(part) if (0.0..=0.5).contains(&part) => Ok(part),
        _ => Err("an asymmetry lies between 0 and 0.5".to_owned()),
    }
}
