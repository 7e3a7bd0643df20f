//! One oscillation of a process in place of its parameters: ultimate gain and period, a relay test, gains of a rule.

use std::f64::consts::FRAC_1_PI;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use onecycle::Pid;
use onecycle_design::oscillation::{DEAD_TIME_SHARE, Oscillation, RelayTest};
use onecycle_design::rules::Ultimate;

use super::{share, share_within};
use crate::failure::Failure;
use crate::report::number::significant;
use crate::results::family::{Known, Rule};
use crate::words::oscillation::not_of_rule;
use onecycle::request::values::number;

/// `KU` that differs by more than this share from that of the relay contradicts it.
const ROUNDING: f64 = 0.05;

/// Half of Klipper's power of 0 to 255, and half of the 5 degrees between the thresholds of its relay.
const KLIPPER_RELAY: f64 = 127.5;
const KLIPPER_HYSTERESIS: f64 = 2.5;

/// Range of gains, amplitudes and times.
const RANGE: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// Options of a process, which say the same in another way.
const PROCESS: [&str; 9] = [
    "process",
    "k",
    "k_over_t_body",
    "t_prop",
    "t_prop2",
    "t_body",
    "natural_frequency",
    "zeta",
    "tau",
];

/// What is known of a process that oscillates.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "One oscillation instead of a process")]
pub(crate) struct OscillationArguments {
    /// Ultimate gain KU, with which a P controller makes the process oscillate, in input unit / output unit. The design keeps its
    /// limits on all processes of first and second order with this KU and TU
    #[arg(long, value_name = "KU", allow_negative_numbers = true, value_parser = positive, conflicts_with_all = PROCESS)]
    ultimate_gain: Option<f64>,
    /// Ultimate period TU, or period under the relay, in seconds
    #[arg(long, value_name = "TU", allow_negative_numbers = true, value_parser = positive, conflicts_with_all = PROCESS)]
    ultimate_period: Option<f64>,
    /// Half of the distance between the two levels of the relay, in the unit of the input. The processes then oscillate exactly
    /// as in the relay test; --ultimate-gain may be left out if --amplitude is given
    #[arg(long, value_name = "H", allow_negative_numbers = true, value_parser = positive, conflicts_with_all = PROCESS)]
    relay: Option<f64>,
    /// With --relay: half of the peak-to-peak output, in the unit of the output [default: that of --ultimate-gain]
    #[arg(long, value_name = "A", allow_negative_numbers = true, value_parser = positive, conflicts_with_all = PROCESS)]
    amplitude: Option<f64>,
    /// With --relay: half of the distance between the thresholds of the relay, in the unit of the output [default: 0]
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = zero_or_more, conflicts_with_all = PROCESS)]
    hysteresis: Option<f64>,
    /// With a relay: share of the period for which it was high, such as 35% or 0.35 [default: 50%]
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true, value_parser = duty, conflicts_with_all = PROCESS)]
    duty: Option<f64>,
    /// The gains of --against come from this rule: marlin (hot end), marlin-bed, klipper, ziegler-nichols or tyreus-luyben. KU and
    /// TU are those behind the gains
    #[arg(long, value_name = "NAME", value_parser = rule(), hide_possible_values = true,
          conflicts_with_all = [&PROCESS[..], &["ultimate_gain", "ultimate_period", "amplitude"]].concat())]
    rule: Option<Rule>,
    /// Share of the dead time in the sum of dead time and lags of the processes, within 0 and 0.95; 0 is an integrator
    /// [default: 0..0.7]
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true, value_parser = dead_time_share, conflicts_with_all = PROCESS)]
    dead_time_share: Option<(f64, f64)>,
}

impl OscillationArguments {
    /// What is known; `None` if no option says so. `against`: the gains in force.
    pub(crate) fn known(&self, against: Option<&Pid>) -> Result<Option<Known>, Failure> {
        let oscillation = match (self.rule, against) {
            (Some(rule), Some(gains)) => self.of_rule(rule, gains)?,
            (Some(_), None) => {
                return Err(Failure::usage("--rule needs the gains: --against KP,KI,KD"));
            }
            (None, _) => match self.of_test()? {
                Some(oscillation) => oscillation,
                None => return Ok(None),
            },
        };
        if let Oscillation::Relay(RelayTest {
            amplitude,
            hysteresis,
            ..
        }) = oscillation
            && hysteresis >= amplitude
        {
            return Err(Failure::usage(format!(
                "the output swings over the thresholds: the hysteresis of {} must be less than the amplitude of {}",
                significant(hysteresis),
                significant(amplitude)
            )));
        }
        Ok(Some(Known {
            oscillation,
            rule: self.rule,
            dead_time_share: self.dead_time_share.unwrap_or(DEAD_TIME_SHARE),
        }))
    }

    /// The oscillation of a relay test or of an ultimate point.
    fn of_test(&self) -> Result<Option<Oscillation>, Failure> {
        let Some(relay) = self.relay else {
            return match (self.ultimate_gain, self.ultimate_period) {
                (Some(gain), Some(period_s)) => {
                    self.without_a_relay()?;
                    Ok(Some(Oscillation::Ultimate(Ultimate::new(gain, period_s))))
                }
                (Some(_), None) => Err(Failure::usage("--ultimate-gain needs --ultimate-period")),
                (None, Some(_)) => Err(Failure::usage(
                    "--ultimate-period needs --ultimate-gain, or --relay with --amplitude",
                )),
                (None, None) => {
                    self.without_a_relay()?;
                    match self.dead_time_share {
                        Some(_) => Err(Failure::usage(
                            "--dead-time-share needs --ultimate-gain, --relay or --rule",
                        )),
                        None => Ok(None),
                    }
                }
            };
        };
        let Some(period_s) = self.ultimate_period else {
            return Err(Failure::usage(
                "--relay needs --ultimate-period, the period of its oscillation",
            ));
        };
        let hysteresis = self.hysteresis.unwrap_or(0.0);
        let amplitude = match (self.amplitude, self.ultimate_gain) {
            (Some(amplitude), Some(gain)) => {
                agree(relay, amplitude, hysteresis, gain)?;
                amplitude
            }
            (Some(amplitude), None) => amplitude,
            (None, Some(gain)) => amplitude_of(relay, gain).hypot(hysteresis),
            (None, None) => {
                return Err(Failure::usage(
                    "--relay needs --amplitude, or --ultimate-gain",
                ));
            }
        };
        let test = RelayTest::new(relay, amplitude, period_s).with_hysteresis(hysteresis);
        Ok(Some(Oscillation::Relay(self.with_duty(test))))
    }

    fn with_duty(&self, test: RelayTest) -> RelayTest {
        test.with_duty(self.duty.unwrap_or(test.duty))
    }

    /// Refuses options that describe a relay test if `--relay` is not given.
    fn without_a_relay(&self) -> Result<(), Failure> {
        let options = [
            ("--amplitude", self.amplitude.is_some()),
            ("--hysteresis", self.hysteresis.is_some()),
            ("--duty", self.duty.is_some()),
        ];
        match options.iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => Err(Failure::usage(format!(
                "{option} is that of a relay: add --relay"
            ))),
            None => Ok(()),
        }
    }

    /// The oscillation from which a rule has computed these gains.
    fn of_rule(&self, rule: Rule, gains: &Pid) -> Result<Oscillation, Failure> {
        let found = rule
            .formula()
            .ultimate(gains)
            .map_err(|error| Failure::usage(not_of_rule(rule, &error)))?;
        let Ultimate { gain, period_s, .. } = found;
        let test = match rule {
            // Gain and output are in units of the power of 255; KU is twice that of the describing function.
            Rule::Klipper => {
                let relay = self.relay.unwrap_or(KLIPPER_RELAY);
                RelayTest::new(relay, 2.0 * amplitude_of(relay, gain), period_s)
                    .with_hysteresis(self.hysteresis.unwrap_or(KLIPPER_HYSTERESIS))
            }
            // Without hysteresis only the ratio of the amplitudes counts, which is that of KU.
            Rule::Marlin | Rule::MarlinBed => {
                self.no_hysteresis(rule)?;
                let relay = self.relay.unwrap_or(1.0);
                RelayTest::new(relay, amplitude_of(relay, gain), period_s)
            }
            Rule::ZieglerNichols | Rule::TyreusLuyben => match self.relay {
                Some(relay) => {
                    let hysteresis = self.hysteresis.unwrap_or(0.0);
                    RelayTest::new(relay, amplitude_of(relay, gain).hypot(hysteresis), period_s)
                        .with_hysteresis(hysteresis)
                }
                None => {
                    self.without_a_relay()?;
                    return Ok(Oscillation::Ultimate(found));
                }
            },
        };
        Ok(Oscillation::Relay(self.with_duty(test)))
    }

    fn no_hysteresis(&self, rule: Rule) -> Result<(), Failure> {
        match self.hysteresis {
            Some(hysteresis) if hysteresis > 0.0 => Err(Failure::usage(format!(
                "the relay of --rule {} has no hysteresis: leave out --hysteresis",
                rule.name()
            ))),
            _ => Ok(()),
        }
    }
}

/// `A` of `KU = 4H/(pi A)`.
fn amplitude_of(relay: f64, ultimate_gain: f64) -> f64 {
    4.0 * FRAC_1_PI * relay / ultimate_gain
}

/// Refuses a `KU` that is not that of the relay's describing function, with or without the hysteresis in it.
fn agree(relay: f64, amplitude: f64, hysteresis: f64, gain: f64) -> Result<(), Failure> {
    let without = 4.0 * FRAC_1_PI * relay / amplitude;
    let with = RelayTest::new(relay, amplitude, 1.0)
        .with_hysteresis(hysteresis)
        .describing_function()
        .gain;
    let is_near = |other: f64| (gain / other - 1.0).abs() <= ROUNDING;
    // Not a number where E is above A: that is refused with a sentence of its own.
    if is_near(without) || is_near(with) || with.is_nan() {
        return Ok(());
    }
    let hint = if is_near(2.0 * without) {
        "; it is twice as large, as in Klipper's log: state half of the distance of the levels, or leave out --ultimate-gain"
    } else {
        ": leave one out"
    };
    Err(Failure::usage(format!(
        "the relay has 4H/(pi A) = {}, which contradicts --ultimate-gain {}{hint}",
        significant(without),
        significant(gain)
    )))
}

fn rule() -> impl TypedValueParser<Value = Rule> {
    PossibleValuesParser::new(Rule::ALL.map(Rule::name))
        .try_map(|name| Rule::from_name(&name).ok_or("there is no such rule"))
}

fn positive(text: &str) -> Result<f64, String> {
    number(text)
        .filter(|value| RANGE.contains(value))
        .ok_or_else(|| "this is a positive number between 1e-9 and 1e9".to_owned())
}

fn zero_or_more(text: &str) -> Result<f64, String> {
    number(text)
        .filter(|value| *value == 0.0 || RANGE.contains(value))
        .ok_or_else(|| "this is zero, or a positive number between 1e-9 and 1e9".to_owned())
}

fn duty(text: &str) -> Result<f64, String> {
    let otherwise = "a share of the period lies between 5 % and 95 %, such as 35% or 0.35";
    share_within(text, 0.05..=0.95, otherwise)
}

fn dead_time_share(text: &str) -> Result<(f64, f64), String> {
    let ends = text.split_once("..");
    let ends = ends.and_then(|(low, high)| Some((share(low).ok()?, share(high).ok()?)));
    ends.filter(|(low, high)| *low >= 0.0 && low < high && *high <= 0.95)
        .ok_or_else(|| {
            "write two shares as LOW..HIGH within 0 and 0.95, such as 0.05..0.5".to_owned()
        })
}
