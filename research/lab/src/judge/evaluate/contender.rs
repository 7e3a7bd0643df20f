//! The methods: ours and the [baselines](crate::judge::baselines).

use std::sync::LazyLock;

use super::{Answer, PHASE_MARGIN_DEG};
use crate::experiments::{CYCLES_KEPT, Recorded, RelayTest};
use crate::judge::baselines::rules::Rule;
use crate::judge::baselines::{BaselineAnswer, BaselineError, arx, asymmetric, gmvc, pem, rules};
use crate::space::Space;
use onecycle_design::rules::Homogeneous;
use onecycle_design::{Specification, Structure};
use onecycle_identify::{Method, Options, Signals, identify};

/// A method of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contender {
    /// Our estimator of steady oscillations, from this number of cycles.
    OneCycle(usize),
    /// The same from one cycle, with the controller of the most probable process in place of that of least expected cost.
    OneCyclePoint,
    /// The same from one cycle, by least squares without the prior of the pack.
    OneCycleRefine,
    /// Our likelihood, from the whole recording, structure given.
    OneCycleWhole,
    /// The network of the pack alone, from the last cycle.
    Network,
    /// The prediction error method of the paper on its estimation set I, one steady cycle.
    Pem,
    /// The same with the input's offset estimated, as a toolbox does for a model with an integrator.
    PemOffset,
    /// The same method on the paper's estimation set II: 20 s of a relay with a swept phase.
    PemSweep,
    /// The same on set II with the input's offset estimated.
    PemSweepOffset,
    /// The same method on one cycle with a bias, an initial state and 27 starts.
    PemFair,
    /// The paper's tuning rule, from half the peak-to-peak output of a cycle.
    Rules,
    /// The same rule with its numbers from the exact limit cycles of the paper's domain.
    RulesExact,
    /// The tuning rule for the phase of the first harmonics of a cycle.
    RulesHarmonic,
    /// PX4's ARX(2,2) by recursive least squares, with its own filters.
    Arx,
    /// The same estimator with filters scaled with the oscillation.
    ArxScaled,
    /// The same model with PX4's own gains, scaled with the oscillation: a PID of the rate in a
    /// cascade.
    ArxGmvc,
    /// The asymmetric relay with the model of an integrator with dead time.
    Asymmetric,
}

/// A recording, and what a method is told of the relay.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The recording.
    pub signals: Signals<'a>,
    /// Hysteresis of the relay (output unit); zero for a relay without one.
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

/// Most cycles over which the half periods of the asymmetric relay are averaged: as many as the other
/// recordings hold.
const ASYMMETRIC_CYCLES: usize = CYCLES_KEPT;

/// Rows and columns of shapes for the exact rule: twice as many change its two numbers by less than 2
/// %.
const RULE_SHAPES: usize = 8;

/// The exact rule, computed once by the first experiment that needs it.
static EXACT_RULE: LazyLock<Result<Homogeneous, BaselineError>> =
    LazyLock::new(|| rules::calibrated(&Space::MULTIROTOR, RULE_SHAPES, RULE_SHAPES));

impl Contender {
    /// All methods.
    pub const ALL: [Self; 19] = [
        Self::OneCycle(1),
        Self::OneCycle(2),
        Self::OneCycle(4),
        Self::OneCyclePoint,
        Self::OneCycleRefine,
        Self::OneCycleWhole,
        Self::Network,
        Self::Pem,
        Self::PemOffset,
        Self::PemFair,
        Self::Rules,
        Self::RulesExact,
        Self::RulesHarmonic,
        Self::Arx,
        Self::ArxScaled,
        Self::ArxGmvc,
        Self::PemSweep,
        Self::PemSweepOffset,
        Self::Asymmetric,
    ];

    /// Name in tables and arguments.
    #[must_use]
    pub fn name(self) -> String {
        let name = match self {
            Self::OneCycle(cycles) => return format!("onecycle-{cycles}"),
            Self::OneCyclePoint => "onecycle-1-point",
            Self::OneCycleRefine => "onecycle-1-refine",
            Self::OneCycleWhole => "onecycle-whole",
            Self::Network => "network",
            Self::Pem => "pem",
            Self::PemOffset => "pem-offset",
            Self::PemSweep => "pem-sweep",
            Self::PemSweepOffset => "pem-sweep-offset",
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

    /// The method with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.name() == name)
    }

    /// The relay test that the method reads.
    #[must_use]
    pub fn relay_test(self) -> RelayTest {
        match self {
            Self::PemSweep | Self::PemSweepOffset => RelayTest::Swept,
            Self::Asymmetric => RelayTest::Asymmetric,
            _ => RelayTest::Recorded,
        }
    }

    /// Answer of the method to a recording.
    ///
    /// # Errors
    /// A sentence that says why there is no answer.
    pub fn answer(self, seen: &Seen<'_>) -> Result<Answer, String> {
        let (signals, margin_rad) = (&seen.signals, PHASE_MARGIN_DEG.to_radians());
        let by_pem = |settings: &pem::PemSettings| pem::identify(signals, settings, margin_rad);
        let by_rule = |rule: &Rule| rules::identify(signals, rule, 1);
        let found = match self {
            Self::OneCycle(cycles) => return ours(signals, steady(cycles, Method::Map)),
            Self::OneCyclePoint => return most_probable(signals, steady(1, Method::Map)),
            Self::OneCycleRefine => return ours(signals, steady(1, Method::Refine)),
            Self::OneCycleWhole => return ours(signals, whole()),
            Self::Network => return ours(signals, steady(1, Method::Classify)),
            Self::Pem => by_pem(&pem::PemSettings::paper(pem::Data::LastCycle)),
            Self::PemOffset => by_pem(&pem::PemSettings::with_offset(pem::Data::LastCycle)),
            Self::PemSweep => by_pem(&pem::PemSettings::paper(pem::Data::Whole)),
            Self::PemSweepOffset => by_pem(&pem::PemSettings::with_offset(pem::Data::Whole)),
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
        of_baseline(found)
    }
}

/// Our estimator of steady oscillations on the last cycles, and nothing else of the recording.
fn steady(cycles: usize, method: Method) -> Options {
    Options::default().cycles(cycles).method(method)
}

/// Our likelihood on the whole recording. Every method is told the structure.
fn whole() -> Options {
    Options::default().structure(Some(Structure::Soiptd))
}

/// Our method, from a recording to a controller.
fn ours(signals: &Signals<'_>, options: Options) -> Result<Answer, String> {
    let paper = Specification::paper().with_phase_margin_rad(PHASE_MARGIN_DEG.to_radians());
    let identified = identify(signals, &options.specification(paper)).outcome;
    let identified = identified.map_err(|verdict| verdict.to_string())?;
    let pd = identified.design.and_then(|design| design.controller.pd());
    Ok(Answer {
        process: identified.model.soiptd(),
        feedback: pd.ok_or("there is no PD controller")?.into(),
        intervals: Some(identified.estimate),
    })
}

/// Our method, with the controller of the most probable process.
fn most_probable(signals: &Signals<'_>, options: Options) -> Result<Answer, String> {
    let found = ours(signals, options)?;
    let process = found
        .process
        .ok_or("there is no process of this structure")?;
    let best = Answer::of_process(process).map_err(|error| error.to_string())?;
    Ok(Answer {
        feedback: best.feedback,
        ..found
    })
}

/// PX4's method, from a recording to gains.
fn by_gmvc(signals: &Signals<'_>) -> Result<Answer, BaselineError> {
    let settings = arx::ArxSettings::scaled_to_oscillation(signals)?;
    let model = arx::Model::of_differences(signals, &settings)?;
    let law = gmvc::scaled_to_oscillation(signals)?;
    Ok(Answer::of_gains(gmvc::cascade(&law, &model)?))
}

/// The answer of a baseline: a process gets the same controller as those of all methods.
fn of_baseline(found: Result<BaselineAnswer, BaselineError>) -> Result<Answer, String> {
    let found = found.map_err(|error| error.to_string())?;
    match found.process {
        Some(process) => Answer::of_process(process).map_err(|error| error.to_string()),
        None => Ok(Answer::of_gains(found.pd)),
    }
}
