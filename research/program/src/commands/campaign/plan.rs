//! What a campaign computes: cases that depend on the file and their number only, and a table of all of them.

use std::path::{Path, PathBuf};

use onecycle_cli::failure::Failure;
use onecycle_lab::experiments::{
    Campaign, DefectKind, HonestyCampaign, Measure, Recipe, RecordingCampaign, RelayExperiment,
};
use onecycle_lab::judge::honesty::{HonestyOutcome, honesty_outcome};
use onecycle_lab::judge::out_of_family::{CycleClassifier, evaluate};
use onecycle_lab::judge::outcome::{identification_outcome, relay_outcome};
use onecycle_lab::judge::recording::{RecordingOutcome, recording_outcome};
use onecycle_onboard::classify::{Calibration, ClassifyError};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::Signature;
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

    /// Simulates and judges case `n`.
    fn case(&self, n: u64) -> Result<Self::Case, Failure>;

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

    /// The outcome of case `n`, as JSON on one line.
    fn line(&self, n: u64) -> Result<String, Failure>;

    /// The table of these outcomes, which are in the order of their numbers; with the settings of the campaign, the JSON
    /// report.
    fn text(&self, settings: Option<&Value>, lines: &[String]) -> Result<String, Failure>;

    /// Computes all cases in the threads of this machine.
    fn run(&self, arguments: &args::Campaign) -> Result<Table, Failure>;
}

impl<P: Plan> Shared for P {
    fn count(&self) -> u64 {
        Plan::count(self)
    }

    fn line(&self, n: u64) -> Result<String, Failure> {
        let case = self.case(n)?;
        serde_json::to_string(&case).map_err(Failure::usage)
    }

    fn text(&self, settings: Option<&Value>, lines: &[String]) -> Result<String, Failure> {
        let cases = lines.iter().map(|line| serde_json::from_str(line));
        let cases: Vec<P::Case> = cases.collect::<Result<_, _>>().map_err(Failure::usage)?;
        Ok(printed(self, settings, &cases))
    }

    fn run(&self, arguments: &args::Campaign) -> Result<Table, Failure> {
        let settings = super::settings(arguments)?;
        let shown = arguments.json.then_some(&settings);
        let (cases, journal) = finished(arguments, &settings, Plan::count(self), |n| self.case(n))?;
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

/// The relay alone.
struct Relay(Campaign);

impl Plan for Relay {
    type Case = RelayCase;

    fn count(&self) -> u64 {
        self.0.cases
    }

    fn case(&self, n: u64) -> Result<RelayCase, Failure> {
        let outcome = relay_outcome(&experiment(&self.0, n)?);
        outcome.map(RelayCase::from).map_err(Failure::usage)
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

    fn case(&self, n: u64) -> Result<IdentificationCase, Failure> {
        identification_outcome(&self.0, &experiment(&self.0, n)?)
            .map(|outcome| IdentificationCase::of(&outcome))
            .map_err(Failure::usage)
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

    /// Kind of case `n`, and its number among those of the kind.
    fn kind(&self, n: u64) -> (DefectKind, u64) {
        match n.checked_sub(IN_FAMILY * self.campaign.cases) {
            None => (DefectKind::InFamily, n),
            Some(beyond) => {
                let kind = (beyond / self.campaign.cases) as usize;
                (DefectKind::OUTSIDE[kind], beyond % self.campaign.cases)
            }
        }
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
        (IN_FAMILY + DefectKind::OUTSIDE.len() as u64) * self.campaign.cases
    }

    fn case(&self, n: u64) -> Result<Option<OutsiderCase>, Failure> {
        let network = |signature: &Signature| self.pack.outputs(&signature.values);
        let classifier = CycleClassifier {
            network: &network,
            calibration: self.calibration,
        };
        let (kind, n) = self.kind(n);
        let judged = evaluate(&self.recipe, kind, n, Some(&classifier)).map_err(Failure::usage)?;
        Ok(judged.map(OutsiderCase::from))
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

impl Plan for Recordings {
    type Case = RecordingOutcome;

    fn count(&self) -> u64 {
        self.0.cases
    }

    fn case(&self, n: u64) -> Result<RecordingOutcome, Failure> {
        let recording = self.0.record(n);
        let recording = recording.map_err(|error| Failure::unreadable(&self.1, error))?;
        Ok(recording_outcome(&recording, &self.0.options()))
    }

    fn table(&self, cases: &[RecordingOutcome]) -> String {
        report::recording::table(&self.0, cases)
    }
}

/// Wrong data, and the file that describes them.
struct WrongData(HonestyCampaign, PathBuf);

impl Plan for WrongData {
    type Case = HonestyOutcome;

    fn count(&self) -> u64 {
        self.0.cases * self.0.kinds.len() as u64
    }

    fn case(&self, n: u64) -> Result<HonestyOutcome, Failure> {
        let (kind, n) = ((n / self.0.cases) as usize, n % self.0.cases);
        let recording = self.0.record(kind, n);
        let recording = recording.map_err(|error| Failure::unreadable(&self.1, error))?;
        Ok(honesty_outcome(recording.as_ref()))
    }

    fn table(&self, cases: &[HonestyOutcome]) -> String {
        report::honesty::table(&self.0, cases)
    }

    fn listed(&self, cases: &[HonestyOutcome]) -> Value {
        json!(report::honesty::named(&self.0, cases))
    }
}
