//! What a campaign computes: cases that depend on the file and their number only, and a table of all of them.

use std::path::{Path, PathBuf};

use onecycle::Model;
use onecycle_cli::failure::Failure;
use onecycle_lab::experiments::honesty::{Columns, FaultyRecording};
use onecycle_lab::experiments::recording::SimulatedRecording;
use onecycle_lab::experiments::{
    Campaign, DefectKind, HonestyCampaign, IDENTIFICATION_PERIODS, Measure, Recipe,
    RecordingCampaign, RelayExperiment,
};
use onecycle_lab::judge::honesty::{HonestyOutcome, honesty_outcome};
use onecycle_lab::judge::out_of_family::{CycleClassifier, PERIODS, evaluate};
use onecycle_lab::judge::outcome::{RELAY_PERIODS, identification_outcome, relay_outcome};
use onecycle_lab::judge::recording::{RecordingOutcome, recording_outcome};
use onecycle_onboard::classify::{Calibration, ClassifyError};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::Signature;
use onecycle_plant::Trace;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Table, finished};
use crate::report::campaign as report;
use crate::results::campaign::{IdentificationCase, OutsiderCase, RelayCase};
use crate::{args, settings};

/// A campaign of some measure.
trait Plan: Send + Sync {
    /// Outcome of a case.
    type Case: Serialize + DeserializeOwned + Send;

    /// Number of cases.
    fn count(&self) -> u64;

    /// Simulates and judges case `n`: its outcome and its truth.
    fn case(&self, n: u64) -> Result<(Self::Case, Value), Failure>;

    /// Simulates case `n`: its recording, unless it has none, and its truth.
    fn recording(&self, n: u64) -> Result<(Option<Columns>, Value), Failure>;

    /// The table of all cases.
    fn table(&self, cases: &[Self::Case]) -> String;

    /// All cases as `--json` prints them.
    fn listed(&self, cases: &[Self::Case]) -> Value {
        json!(cases)
    }
}

/// A campaign whose cases are computed here, or by others who know them as JSON.
pub(crate) trait Shared: Send + Sync {
    /// Number of cases.
    fn count(&self) -> u64;

    /// The outcome of case `n` and its truth, each as JSON on one line.
    fn line(&self, n: u64) -> Result<[String; 2], Failure>;

    /// The recording of case `n`, unless it has none, and its truth as JSON on one line.
    fn recording(&self, n: u64) -> Result<(Option<Columns>, String), Failure>;

    /// The table of the outcomes of all cases, in the order of their numbers; with the settings of the campaign, the JSON
    /// report.
    fn text(
        &self,
        settings: Option<&Value>,
        lines: &mut dyn Iterator<Item = String>,
    ) -> Result<String, Failure>;

    /// Computes all cases in the threads of this machine.
    fn run(&self, arguments: &args::Campaign) -> Result<Table, Failure>;
}

impl<P: Plan> Shared for P {
    fn count(&self) -> u64 {
        Plan::count(self)
    }

    fn line(&self, n: u64) -> Result<[String; 2], Failure> {
        let (case, truth) = self.case(n)?;
        let case = serde_json::to_string(&case).map_err(Failure::usage)?;
        Ok([case, truth.to_string()])
    }

    fn recording(&self, n: u64) -> Result<(Option<Columns>, String), Failure> {
        let (columns, truth) = Plan::recording(self, n)?;
        Ok((columns, truth.to_string()))
    }

    fn text(
        &self,
        settings: Option<&Value>,
        lines: &mut dyn Iterator<Item = String>,
    ) -> Result<String, Failure> {
        let cases = lines.map(|line| serde_json::from_str(&line));
        let cases: Vec<P::Case> = cases.collect::<Result<_, _>>().map_err(Failure::usage)?;
        let (found, count) = (cases.len() as u64, Plan::count(self));
        if found != count {
            return Err(Failure::usage(format!("{found} outcomes of {count} cases")));
        }
        Ok(printed(self, settings, &cases))
    }

    fn run(&self, arguments: &args::Campaign) -> Result<Table, Failure> {
        let settings = super::settings(arguments)?;
        let shown = arguments.json.then_some(&settings);
        let (cases, journal) = finished(arguments, &settings, Plan::count(self), |n| {
            Ok(self.case(n)?.0)
        })?;
        Ok((printed(self, shown, &cases), journal))
    }
}

fn printed<P: Plan>(plan: &P, settings: Option<&Value>, cases: &[P::Case]) -> String {
    match settings {
        Some(settings) => {
            let shown = json!({ "settings": settings, "cases": plan.listed(cases) });
            format!("{shown:#}\n")
        }
        None => plan.table(cases),
    }
}

/// What decides which other fields a file has.
#[derive(Deserialize)]
struct Head {
    measure: Measure,
}

/// The campaign of the file, changed by the arguments.
pub(crate) fn of(arguments: &args::Campaign) -> Result<Box<dyn Shared>, Failure> {
    let file = &arguments.file;
    Ok(match settings::read::<Head>(file)?.measure {
        Measure::Relay => Box::new(Relay(of_relay_tests(arguments)?)),
        Measure::Identification => Box::new(Identification(of_relay_tests(arguments)?)),
        Measure::Unknown => Box::new(Unknown::new(of_relay_tests(arguments)?, file)?),
        Measure::Recording => {
            check_options(arguments)?;
            let mut campaign: RecordingCampaign = settings::read(file)?;
            campaign.cases = arguments.cases.unwrap_or(campaign.cases);
            campaign
                .validate()
                .map_err(|error| Failure::unreadable(file, error))?;
            Box::new(Recordings(campaign, file.clone()))
        }
        Measure::Honesty => {
            check_options(arguments)?;
            let mut campaign: HonestyCampaign = settings::read(file)?;
            campaign.cases = arguments.cases.unwrap_or(campaign.cases);
            campaign
                .validate()
                .map_err(|error| Failure::unreadable(file, error))?;
            Box::new(WrongData(campaign, file.clone()))
        }
    })
}

/// Refuses options of the campaigns of relay tests.
fn check_options(arguments: &args::Campaign) -> Result<(), Failure> {
    let of_relays = [
        ("--cycles", arguments.cycles.is_some()),
        ("--method", arguments.method.is_some()),
        ("--sigma", arguments.sigma.is_some()),
        ("--time-scale", arguments.time_scale.is_some()),
    ];
    match of_relays.iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::usage(format!(
            "{option} has no effect on a campaign of recordings: leave it out and change the file"
        ))),
        None => Ok(()),
    }
}

/// A campaign of relay tests.
fn of_relay_tests(arguments: &args::Campaign) -> Result<Campaign, Failure> {
    let mut campaign: Campaign = settings::read(&arguments.file)?;
    // A fault from here on is one of the file, after this of the arguments.
    campaign
        .validate()
        .map_err(|error| Failure::unreadable(&arguments.file, error))?;
    campaign.cases = arguments.cases.unwrap_or(campaign.cases);
    campaign.cycles = arguments
        .cycles
        .map_or(campaign.cycles, |cycles| cycles as usize);
    campaign.time_scale = arguments.time_scale.unwrap_or(campaign.time_scale);
    campaign.method = arguments.method.unwrap_or(campaign.method);
    if let Some(sigma) = arguments.sigma {
        (campaign.sigma, campaign.sigma_uniform) = (sigma, false);
    }
    campaign.validate().map_err(Failure::usage)?;
    Ok(campaign)
}

fn experiment(campaign: &Campaign, n: u64) -> Result<RelayExperiment, Failure> {
    campaign.experiment(n).map_err(Failure::usage)
}

/// The recording of a relay test of this many periods.
fn recorded(experiment: &RelayExperiment, periods: f64) -> Result<Columns, Failure> {
    let (trace, _) = experiment.run(periods).map_err(Failure::usage)?;
    Ok(columns(trace, experiment.sample_s))
}

fn columns(trace: Trace, sample_s: f64) -> Columns {
    Columns {
        sample_s,
        time_s: trace.time_s,
        input: trace.input,
        output: trace.output,
    }
}

/// Structure and parameters of a process by their keys, and what else a case was made of.
fn truth<const N: usize>(model: &Model, more: [(&str, Value); N]) -> Value {
    let structure = model.structure();
    let parameters = structure.parameters().iter();
    let parameters = parameters.filter_map(|&of| Some((of.key(), json!(model.parameter(of)?))));
    let named = [("structure", json!(structure.name()))].into_iter();
    named.chain(parameters).chain(more).collect()
}

fn truth_of_relay_test(experiment: &RelayExperiment) -> Value {
    let more = [
        ("input_bias", json!(experiment.input_bias)),
        ("noise_sigma", json!(experiment.noise_sigma)),
    ];
    truth(&Model::Soiptd(experiment.process), more)
}

/// The relay alone.
struct Relay(Campaign);

impl Plan for Relay {
    type Case = RelayCase;

    fn count(&self) -> u64 {
        self.0.cases
    }

    fn case(&self, n: u64) -> Result<(RelayCase, Value), Failure> {
        let experiment = experiment(&self.0, n)?;
        let outcome = relay_outcome(&experiment).map_err(Failure::usage)?;
        Ok((outcome.into(), truth_of_relay_test(&experiment)))
    }

    fn recording(&self, n: u64) -> Result<(Option<Columns>, Value), Failure> {
        let experiment = experiment(&self.0, n)?;
        let columns = recorded(&experiment, RELAY_PERIODS)?;
        Ok((Some(columns), truth_of_relay_test(&experiment)))
    }

    fn table(&self, cases: &[RelayCase]) -> String {
        report::relay(&self.0, cases)
    }
}

/// Identification from relay tests of the paper's multirotors.
struct Identification(Campaign);

impl Plan for Identification {
    type Case = IdentificationCase;

    fn count(&self) -> u64 {
        self.0.cases
    }

    fn case(&self, n: u64) -> Result<(IdentificationCase, Value), Failure> {
        let experiment = experiment(&self.0, n)?;
        let outcome = identification_outcome(&self.0, &experiment).map_err(Failure::usage)?;
        let case = IdentificationCase::of(&outcome);
        Ok((case, truth_of_relay_test(&experiment)))
    }

    fn recording(&self, n: u64) -> Result<(Option<Columns>, Value), Failure> {
        let experiment = experiment(&self.0, n)?;
        let columns = recorded(&experiment, IDENTIFICATION_PERIODS)?;
        Ok((Some(columns), truth_of_relay_test(&experiment)))
    }

    fn table(&self, cases: &[IdentificationCase]) -> String {
        report::identification(&self.0, cases)
    }
}

/// Cases of the family for one case of each kind out of it: false alarms are rare and count most.
const IN_FAMILY: u64 = 5;

/// Processes in and out of the family.
struct Unknown {
    campaign: Campaign,
    recipe: Recipe,
    pack: Pack<'static>,
    calibration: Calibration,
}

impl Unknown {
    /// Cases in which every kind has had its turn.
    const ROUND: u64 = IN_FAMILY + DefectKind::OUTSIDE.len() as u64;

    fn new(campaign: Campaign, file: &Path) -> Result<Self, Failure> {
        let recipe = campaign.recipe();
        recipe
            .validate()
            .map_err(|error| Failure::unreadable(file, error))?;
        let pack = Pack::embedded().map_err(Failure::usage)?;
        let calibration =
            Calibration::of_pack(&pack).ok_or_else(|| Failure::usage(ClassifyError::Pack))?;
        Ok(Self {
            campaign,
            recipe,
            pack,
            calibration,
        })
    }

    /// Kind of case `n`, and its number among those of the kind. The kinds take turns: case `n` is the same for any number of cases.
    fn kind(&self, n: u64) -> (DefectKind, u64) {
        let (round, turn) = (n / Self::ROUND, n % Self::ROUND);
        match turn.checked_sub(IN_FAMILY) {
            None => (DefectKind::InFamily, IN_FAMILY * round + turn),
            Some(kind) => (DefectKind::OUTSIDE[kind as usize], round),
        }
    }

    /// The experiment of case `n`, if the process oscillates, and its truth.
    fn experiment(&self, n: u64) -> Result<(Option<RelayExperiment>, Value), Failure> {
        let (kind, n) = self.kind(n);
        let experiment = self.recipe.experiment_with_defect(kind, n);
        let experiment = experiment.map_err(Failure::usage)?;
        let mut truth = experiment.as_ref().map_or(json!({}), truth_of_relay_test);
        truth["kind"] = json!(kind.name());
        Ok((experiment, truth))
    }

    /// The cases of each kind. Processes that do not oscillate even without their defect are left out.
    fn rows(&self, cases: &[Option<OutsiderCase>]) -> Vec<(DefectKind, Vec<OutsiderCase>)> {
        let numbered = || (0..).zip(cases);
        let of = |kind| {
            let own = numbered().filter(|(n, _)| self.kind(*n).0 == kind);
            (kind, own.filter_map(|(_, case)| *case).collect())
        };
        let kinds = std::iter::once(DefectKind::InFamily).chain(DefectKind::OUTSIDE);
        kinds.map(of).collect()
    }
}

impl Plan for Unknown {
    type Case = Option<OutsiderCase>;

    fn count(&self) -> u64 {
        Self::ROUND * self.campaign.cases
    }

    fn case(&self, n: u64) -> Result<(Option<OutsiderCase>, Value), Failure> {
        let (_, truth) = self.experiment(n)?;
        let network = |signature: &Signature| self.pack.outputs(&signature.values);
        let classifier = CycleClassifier {
            network: &network,
            calibration: self.calibration,
        };
        let (kind, n) = self.kind(n);
        let judged = evaluate(&self.recipe, kind, n, Some(&classifier)).map_err(Failure::usage)?;
        Ok((judged.map(OutsiderCase::from), truth))
    }

    fn recording(&self, n: u64) -> Result<(Option<Columns>, Value), Failure> {
        let (experiment, truth) = self.experiment(n)?;
        let recording = experiment.map(|experiment| recorded(&experiment, PERIODS));
        Ok((recording.transpose()?, truth))
    }

    fn table(&self, cases: &[Option<OutsiderCase>]) -> String {
        report::unknown(&self.campaign, &self.rows(cases))
    }

    fn listed(&self, cases: &[Option<OutsiderCase>]) -> Value {
        let rows = self.rows(cases);
        let named: Vec<(&str, &OutsiderCase)> = (rows.iter())
            .flat_map(|(kind, cases)| cases.iter().map(|case| (kind.name(), case)))
            .collect();
        json!(named)
    }
}

/// Recordings of any kind, and the file that describes them.
struct Recordings(RecordingCampaign, PathBuf);

impl Recordings {
    fn record(&self, n: u64) -> Result<(SimulatedRecording, Value), Failure> {
        let recording = self.0.record(n);
        let recording = recording.map_err(|error| Failure::unreadable(&self.1, error))?;
        let at = self.0.combination(n);
        let more = [
            ("input_bias", json!(recording.input_bias)),
            (
                "signal",
                json!(self.0.excitations[at.excitation].signal.name()),
            ),
            ("duration_s", json!(self.0.durations_s[at.duration])),
        ];
        let truth = truth(&recording.model, more);
        Ok((recording, truth))
    }
}

impl Plan for Recordings {
    type Case = RecordingOutcome;

    fn count(&self) -> u64 {
        self.0.cases
    }

    fn case(&self, n: u64) -> Result<(RecordingOutcome, Value), Failure> {
        let (recording, truth) = self.record(n)?;
        Ok((recording_outcome(&recording, &self.0.options()), truth))
    }

    fn recording(&self, n: u64) -> Result<(Option<Columns>, Value), Failure> {
        let (recording, truth) = self.record(n)?;
        let columns = columns(recording.trace, recording.sample_s);
        Ok((Some(columns), truth))
    }

    fn table(&self, cases: &[RecordingOutcome]) -> String {
        report::recording::table(&self.0, cases)
    }
}

/// Wrong data, and the file that describes them.
struct WrongData(HonestyCampaign, PathBuf);

impl WrongData {
    /// The recording, unless its output runs away, and its truth.
    fn record(&self, n: u64) -> Result<(Option<FaultyRecording>, Value), Failure> {
        // The kinds take turns: case `n` is the same for any number of cases.
        let kinds = self.0.kinds.len() as u64;
        let (kind, n) = ((n % kinds) as usize, n / kinds);
        let recording = self.0.record(kind, n);
        let recording = recording.map_err(|error| Failure::unreadable(&self.1, error))?;
        let of = |recording: &FaultyRecording| {
            let more = [
                ("input_bias", json!(recording.input_bias)),
                ("noise_sigma", json!(recording.noise_sigma)),
                ("strength", json!(recording.strength)),
            ];
            truth(&recording.truth.process.into(), more)
        };
        let mut truth = recording.as_ref().map_or(json!({}), of);
        truth["kind"] = json!(self.0.kinds[kind].name);
        Ok((recording, truth))
    }
}

impl Plan for WrongData {
    type Case = HonestyOutcome;

    fn count(&self) -> u64 {
        self.0.cases * self.0.kinds.len() as u64
    }

    fn case(&self, n: u64) -> Result<(HonestyOutcome, Value), Failure> {
        let (recording, truth) = self.record(n)?;
        Ok((honesty_outcome(recording.as_ref()), truth))
    }

    fn recording(&self, n: u64) -> Result<(Option<Columns>, Value), Failure> {
        let (recording, truth) = self.record(n)?;
        Ok((recording.map(|recording| recording.columns), truth))
    }

    fn table(&self, cases: &[HonestyOutcome]) -> String {
        report::honesty::table(&self.0, cases)
    }

    fn listed(&self, cases: &[HonestyOutcome]) -> Value {
        json!(report::honesty::named(&self.0, cases))
    }
}
