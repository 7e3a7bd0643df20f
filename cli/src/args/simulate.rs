//! Arguments of `simulate`.

mod values;

use std::path::PathBuf;

use clap::Args;

use super::{Share, StructureArguments, share_within};

pub(crate) use values::NamedDisturbance;
use values::{Band, Gust, LoopGains, Outliers};

/// Default of `--beta`: the distinguishing phase of the paper.
pub(crate) const BETA: f64 = -0.73;

/// Simulate a test of a process and write its recording as CSV.
///
/// The process and its disturbances are simulated exactly, whatever the sample period and the dead time; the relay is that
/// of the on-board library. Comments at the head of the file state the true process, the test and the disturbances.
#[derive(Clone, Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle simulate --k 1 --t-prop 0.0321 --t-body 1.6886 --tau 0.0237 --out hover.csv\n",
    "  onecycle simulate --k-over-t-body 40 --t-prop 0.05 --t-body inf --tau 0.015 --noise 1% \\\n",
    "      --bias 30% --seed 7 | onecycle identify -\n",
    "  onecycle simulate --process foptd --k 2 --t-body 30 --tau 5 --excitation step --preroll 10 \\\n",
    "      --duration 200 --sample-rate 2 --noise 1% --out tank.csv\n",
    "  onecycle simulate --k-over-t-body 40 --t-prop 0.05 --t-body 1 --tau 0.015 \\\n",
    "      --excitation chirp --band 0.5,10 --amplitude 0.2 --duration 20 --loop 0.5,0.1 \\\n",
    "      --noise 1% --gust 5%,0.5 --sample-rate 250 --out roll.csv\n",
    "  onecycle simulate --process foptd --k 2 --t-body 30 --tau 5 --excitation prbs --pulse 15 \\\n",
    "      --duration 600 --sample-rate 1 --noise 0.05 --expect\n\n",
    "Processes (T1, or T alone, is --t-body, T2 --t-prop, T3 --t-prop2; T of integrator_lag and resonant_lag is --t-prop; K/T_body may\nreplace K where there is a --t-body; w0 is --natural-frequency):\n",
    "  soiptd                 K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))\n",
    "  toiptd                 K e^(-tau s) / (s (T_prop s + 1)(T_prop2 s + 1)(T_body s + 1))\n",
    "  iptd                   K e^(-tau s) / s\n",
    "  integrator_lag         K e^(-tau s) / (s (T s + 1))\n",
    "  double_integrator_lag  K/T_body e^(-tau s) / (s^2 (T_prop s + 1))\n",
    "  foptd                  K e^(-tau s) / (T s + 1)\n",
    "  soptd                  K e^(-tau s) / ((T1 s + 1)(T2 s + 1))\n",
    "  toptd                  K e^(-tau s) / ((T1 s + 1)(T2 s + 1)(T3 s + 1))\n",
    "  resonant               K e^(-tau s) / (s^2/w0^2 + 2 zeta s/w0 + 1)\n",
    "  resonant_lag           K e^(-tau s) / ((T s + 1)(s^2/w0^2 + 2 zeta s/w0 + 1))\n\n",
    "Disturbances (--disturbance), each by its strength:\n",
    "  walk         random walk at the input: standard deviation after 1 s (input unit, or % of --amplitude)\n",
    "  white        white noise at the input: standard deviation of its mean over 1 s (as walk)\n",
    "  output-walk  random walk of the measured output: standard deviation after 1 s (output unit,\n",
    "               or % of the noise-free amplitude)\n",
    "  w1, w0, wy   the same three relative to --noise, as a frequency in rad/s below which they are stronger\n",
    "Those at the input enter behind the actuator lags, as wind does."
))]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) process: StructureArguments,
    /// Test signal
    #[arg(long, value_name = "NAME", value_enum, default_value_t = Excitation::Relay)]
    pub(crate) excitation: Excitation,
    /// Amplitude of the test signal (input unit; output unit with --inject setpoint)
    #[arg(
        long,
        value_name = "H",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    pub(crate) amplitude: f64,
    /// Amplitude of the relay in the second half of the test: two amplitudes show whether the actuator is linear; 0.6 of
    /// --amplitude is usual
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    pub(crate) second_amplitude: Option<f64>,
    /// Length of one half of a doublet, of the unit of 3-2-1-1 or of one bit of a PRBS, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) pulse: Option<f64>,
    /// Lowest and highest frequency of a chirp or a multisine, in hertz
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub(crate) band: Option<Band>,
    /// Number of sines of a multisine (2 to 1000) [default: 12]
    #[arg(long, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub(crate) sines: Option<u32>,
    /// Close the loop with the PD controller u = KP (r - y) - KD dy/dt; FILTER is the time constant of the filtered
    /// derivative in seconds [default: KD / (10 KP)]
    #[arg(
        long = "loop",
        value_name = "KP,KD[,FILTER]",
        allow_hyphen_values = true
    )]
    pub(crate) closed: Option<LoopGains>,
    /// Where the test signal enters the closed loop: added to the controller's output, or to its set-point
    /// [default: input]
    #[arg(long, value_name = "PLACE", value_enum, requires = "closed")]
    pub(crate) inject: Option<Inject>,
    /// Relay parameter beta: the sine of the phase at which the process oscillates
    #[arg(long, value_name = "BETA", default_value_t = BETA, allow_negative_numbers = true)]
    pub(crate) beta: f64,
    /// Keep the centre of the relay fixed: do not trim the input bias
    #[arg(long)]
    pub(crate) no_trim: bool,
    /// Difference of the high and the low time that the trim leaves, as a share of the cycle, 0 to 50 %, such
    /// as 20% or 0.2, which gives about twice the information of a symmetric cycle
    #[arg(long, value_name = "SHARE", default_value = "0", conflicts_with = "no_trim",
          allow_negative_numbers = true, value_parser = asymmetry)]
    pub(crate) asymmetry: f64,
    /// Plain relay, without smoothing of the error and minimum switching time
    #[arg(long)]
    pub(crate) bare: bool,
    /// Time before the test signal, in seconds; the relay measures the noise in it
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.1,
        allow_negative_numbers = true
    )]
    pub(crate) preroll: f64,
    /// Constant input disturbance, not recorded (input unit, or % of --amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) bias: Share,
    /// Gusts at the input: standard deviation (input unit, or % of --amplitude) and correlation time in seconds, the
    /// length of the gusts over the airspeed
    #[arg(long, value_name = "SIGMA,S", allow_hyphen_values = true)]
    pub(crate) gust: Option<Gust>,
    /// Further disturbances, such as walk=5% or w1=3; --help lists them
    #[arg(
        long,
        value_name = "NAME=VALUE",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    pub(crate) disturbance: Vec<NamedDisturbance>,
    /// Standard deviation of the measurement noise (output unit, or % of the noise-free amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) noise: Share,
    /// Resolution of the sensor (output unit, or % of the noise-free amplitude)
    #[arg(long, default_value = "0", allow_hyphen_values = true)]
    pub(crate) quantum: Share,
    /// Share of the samples with an outlier, such as 1% or 0.01, and the size of an outlier (output unit, or % of the noise-free
    /// amplitude) [default size: 100%]
    #[arg(long, value_name = "SHARE[,SIZE]", allow_hyphen_values = true)]
    pub(crate) outliers: Option<Outliers>,
    /// Share of the samples that the sensor drops, such as 1% or 0.01; their rows are missing
    #[arg(long, value_name = "SHARE", default_value = "0", allow_hyphen_values = true,
          value_parser = drop_outs)]
    pub(crate) drop_outs: f64,
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
    /// Duration, in seconds [default: 20 periods of the oscillation of a relay on a soiptd]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) duration: Option<f64>,
    /// Seed of noise, disturbances and jitter; the same seed gives the same recording
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Print the 90 % intervals to expect from this test, and write no recording
    ///
    /// The intervals are the Cramer-Rao bound of the test: those that an efficient estimator reaches on average. An error
    /// of the model is not in them.
    #[arg(long, conflicts_with = "out")]
    pub(crate) expect: bool,
    /// Print them as JSON
    #[arg(long, requires = "expect")]
    pub(crate) json: bool,
    /// File to write [default: the standard output]
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// Test signals by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Excitation {
    /// Relay in the place of the controller, or beside it
    Relay,
    /// Step
    Step,
    /// Two pulses of opposite sign
    Doublet,
    /// Four pulses of 3, 2, 1 and 1 units
    #[value(name = "3-2-1-1", alias = "3211")]
    ThreeTwoOneOne,
    /// Pseudo-random binary sequence that does not repeat within the test
    Prbs,
    /// Sine with a frequency that rises exponentially over the test
    Chirp,
    /// Sum of sines with the power of one sine of the amplitude; its peak is higher
    Multisine,
}

impl Excitation {
    /// The name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Relay => "relay",
            Self::Step => "step",
            Self::Doublet => "doublet",
            Self::ThreeTwoOneOne => "3-2-1-1",
            Self::Prbs => "prbs",
            Self::Chirp => "chirp",
            Self::Multisine => "multisine",
        }
    }
}

/// Where a test signal enters a closed loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Inject {
    /// Added to the output of the controller
    Input,
    /// Added to the reference
    Setpoint,
}

/// Drop-outs of the sensor.
fn drop_outs(text: &str) -> Result<f64, String> {
    let otherwise = "drop-outs are a share from 0% to below 100%, such as 1% or 0.01";
    share_within(text, 0.0..1.0, otherwise)
}

/// An asymmetry of the relay.
fn asymmetry(text: &str) -> Result<f64, String> {
    let otherwise = "an asymmetry lies between 0 % and 50 %, such as 20% or 0.2";
    share_within(text, 0.0..=0.5, otherwise)
}
