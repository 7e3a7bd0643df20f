//! The methods, ours and the [rivals](crate::judge::baselines).

use std::sync::LazyLock;

use super::{Answer, PHASE_MARGIN_DEG};
use crate::experiments::{CYCLES_KEPT, Recorded, RelayTest};
use crate::judge::baselines::rules::Rule;
use crate::judge::baselines::{BaselineAnswer, BaselineError, arx, asymmetric, gmvc, pem, rules};
use crate::space::Space;
use crate::space::rule::TuningRule;
use onecycle_identify::{Method, Options, Signals, identify};

/// A method as it enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contender {
    /// Ours, from so many cycles.
    OneCycle(usize),
    /// The network of the pack alone, from the last cycle.
    Network,
    /// The prediction error method of the paper on its estimation set I, one steady cycle.
    Pem,
    /// The same on its estimation set II, 20 s of a relay with a swept phase.
    PemSweep,
    /// The same on one cycle with a bias, an initial state and 27 starts.
    PemFair,
    /// The paper's tuning rule, from half the peak-to-peak output of a cycle.
    Rules,
    /// The same with its numbers from the exact limit cycles of the paper's domain.
    RulesExact,
    /// The rule for the phase that the first harmonics of a cycle tell.
    RulesHarmonic,
    /// PX4's ARX(2,2) by recursive least squares, with its own filters.
    Arx,
    /// The same with filters in proportion to the oscillation.
    ArxScaled,
    /// The same with the gains that PX4 makes of it, in proportion to the oscillation: a PID of the rate
    /// in a cascade.
    ArxGmvc,
    /// The asymmetric relay with the model of an integrator with dead time.
    Asymmetric,
}

/// A recording and what its reader knows of the relay.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The recording.
    pub signals: Signals<'a>,
    /// Hysteresis of the relay (output unit); zero where it has none.
    pub hysteresis: f64,
}

impl<'a> Seen<'a> {
    /// A recording of a relay without hysteresis.
    #[must_use]
    pub fn of(signals: Signals<'a>) -> Self {
        Self {
            signals,
            hysteresis: 0.0,
        }
    }

    /// A recording of a relay test.
    #[must_use]
    pub fn of_recorded(recorded: &'a Recorded) -> Self {
        Self {
            signals: recorded.signals(),
            hysteresis: recorded.hysteresis,
        }
    }
}

/// Most cycles that the asymmetric relay's half periods are the means of: as many as the recordings of
/// the others hold.
const ASYMMETRIC_CYCLES: usize = CYCLES_KEPT;

/// Rows and columns of the shapes that the exact rule is made for: twice as many change its two numbers by
/// less than 2 %.
const RULE_SHAPES: usize = 8;

/// The exact rule, made once: by the first experiment that asks for it.
static EXACT_RULE: LazyLock<Result<TuningRule, BaselineError>> =
    LazyLock::new(|| rules::calibrated(&Space::MULTIROTOR, RULE_SHAPES, RULE_SHAPES));

impl Contender {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::OneCycle(1),
        Self::OneCycle(2),
        Self::OneCycle(4),
        Self::Network,
        Self::Pem,
        Self::PemFair,
        Self::Rules,
        Self::RulesExact,
        Self::RulesHarmonic,
        Self::Arx,
        Self::ArxScaled,
        Self::ArxGmvc,
        Self::PemSweep,
        Self::Asymmetric,
    ];

    /// Its name in tables and arguments.
    #[must_use]
    pub fn name(self) -> String {
        let name = match self {
            Self::OneCycle(cycles) => return format!("onecycle-{cycles}"),
            Self::Network => "network",
            Self::Pem => "pem",
            Self::PemSweep => "pem-sweep",
            Self::PemFair => "pem-fair",
            Self::Rules => "rules",
            Self::RulesExact => "rules-exact",
            Self::RulesHarmonic => "rules-harmonic",
            Self::Arx => "arx",
            Self::ArxScaled => "arx-scaled",
            Self::ArxGmvc => "arx-gmvc",
            Self::Asymmetric => "asymmetric",
        };
        name.to_owned()
    }

    /// The one of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.name() == name)
    }

    /// The experiment it reads.
    #[must_use]
    pub fn relay_test(self) -> RelayTest {
        match self {
            Self::PemSweep => RelayTest::Swept,
            Self::Asymmetric => RelayTest::Asymmetric,
            _ => RelayTest::Recorded,
        }
    }

    /// What it makes of a recording, or in a sentence why it has no answer.
    ///
    /// # Errors
    /// That sentence.
    pub fn answer(self, seen: &Seen<'_>) -> Result<Answer, String> {
        let (signals, margin_rad) = (&seen.signals, PHASE_MARGIN_DEG.to_radians());
        let by_pem = |settings: &pem::PemSettings| pem::identify(signals, settings, margin_rad);
        let by_rule = |rule: &Rule| rules::identify(signals, rule, 1);
        let rival = match self {
            Self::OneCycle(cycles) => return ours(signals, cycles, Method::Map),
            Self::Network => return ours(signals, 1, Method::Classify),
            Self::Pem => by_pem(&pem::PemSettings::paper(pem::Data::LastCycle)),
            Self::PemSweep => by_pem(&pem::PemSettings::paper(pem::Data::Whole)),
            Self::PemFair => by_pem(&pem::PemSettings::fair()),
            Self::Rules => by_rule(&Rule::of_relay(Space::MULTIROTOR.beta, margin_rad)),
            Self::RulesExact => EXACT_RULE
                .clone()
                .and_then(|rule| by_rule(&Rule::Amplitude(rule))),
            Self::RulesHarmonic => by_rule(&Rule::FirstHarmonic {
                phase_margin_rad: margin_rad,
            }),
            Self::Arx => arx::identify(signals, &arx::ArxSettings::PX4, margin_rad),
            Self::ArxScaled => arx::ArxSettings::scaled_to_oscillation(signals)
                .and_then(|settings| arx::identify(signals, &settings, margin_rad)),
            Self::ArxGmvc => return by_gmvc(signals).map_err(|error| error.to_string()),
            Self::Asymmetric => {
                asymmetric::identify(signals, seen.hysteresis, ASYMMETRIC_CYCLES, margin_rad)
            }
        };
        of_rival(rival)
    }
}

/// Our road from a recording to a controller.
fn ours(signals: &Signals<'_>, cycles: usize, method: Method) -> Result<Answer, String> {
    let options = Options::default()
        .cycles(cycles)
        .phase_margin_rad(PHASE_MARGIN_DEG.to_radians())
        .method(method);
    let identified = identify(signals, &options).outcome;
    let identified = identified.map_err(|verdict| verdict.to_string())?;
    let pd = identified.design.controller.pd();
    Ok(Answer {
        process: identified.model.soiptd(),
        feedback: pd.ok_or("the controller is not a PD")?.into(),
    })
}

/// PX4's whole road from a recording to gains.
fn by_gmvc(signals: &Signals<'_>) -> Result<Answer, BaselineError> {
    let settings = arx::ArxSettings::scaled_to_oscillation(signals)?;
    let model = arx::Model::of_differences(signals, &settings)?;
    let design = gmvc::Design::scaled_to_oscillation(signals)?;
    Ok(Answer::of_gains(design.cascade(&model)?))
}

/// A process gets the same controller whoever found it.
fn of_rival(rival: Result<BaselineAnswer, BaselineError>) -> Result<Answer, String> {
    let rival = rival.map_err(|error| error.to_string())?;
    match rival.process {
        Some(process) => Answer::of_process(process).map_err(|error| error.to_string()),
        None => Ok(Answer::of_gains(rival.pd)),
    }
}
