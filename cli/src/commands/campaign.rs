//! `onecycle campaign`: many random experiments and a table of their outcomes.

use std::path::Path;
use std::process::ExitCode;

use onecycle_lab::experiments::{
    Campaign, DefectKind, ExperimentError, HonestyCampaign, Measure, RecordingCampaign,
    RelayExperiment,
};
use onecycle_lab::judge::honesty::honesty_outcome;
use onecycle_lab::judge::out_of_family::{CycleClassifier, evaluate};
use onecycle_lab::judge::outcome::{identification_outcome, relay_outcome};
use onecycle_lab::judge::recording::recording_outcome;
use onecycle_onboard::classify::{Calibration, ClassifyError};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::Signature;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::workers::Workers;
use crate::failure::{Failure, exit};
use crate::journal::Journal;
use crate::output::{print, write_text};
use crate::report::campaign as report;
use crate::results::campaign::{IdentificationCase, OutsiderCase, RelayCase};
use crate::{args, settings};

pub(crate) fn run(arguments: &args::Campaign) -> Result<ExitCode, Failure> {
    let (table, journal) = match settings::read::<Head>(&arguments.file)?.measure {
        Measure::Recording => of_recordings(arguments)?,
        Measure::Honesty => of_wrong_data(arguments)?,
        measure => of_relay_tests(arguments, measure)?,
    };
    if let Some(out) = &arguments.out {
        write_text(out, &table)?;
    }
    print(&table)?;
    journal.map_or(Ok(()), Journal::remove)?;
    Ok(ExitCode::from(exit::DONE))
}

/// What decides which other fields a file has.
#[derive(Deserialize)]
struct Head {
    measure: Measure,
}

/// The table of a campaign, and the journal to remove once it is written.
type Table = (String, Option<Journal>);

/// What is printed: the table, or the outcomes of all cases as JSON.
fn shown<T: Serialize>(
    arguments: &args::Campaign,
    cases: &[T],
    table: impl FnOnce() -> String,
) -> Result<String, Failure> {
    if !arguments.json {
        return Ok(table());
    }
    let shown = json!({ "settings": settings(arguments)?, "cases": cases });
    Ok(format!("{shown:#}\n"))
}

/// The table of relay tests on the paper's multirotors.
fn of_relay_tests(arguments: &args::Campaign, measure: Measure) -> Result<Table, Failure> {
    let campaign = campaign(arguments)?;
    Ok(match measure {
        Measure::Relay => {
            let case =
                |experiment: &RelayExperiment| relay_outcome(experiment).map(RelayCase::from);
            let (cases, journal) = of_family(arguments, &campaign, case)?;
            let text = shown(arguments, &cases, || report::relay(&campaign, &cases))?;
            (text, journal)
        }
        Measure::Unknown => of_kinds(arguments, &campaign)?,
        _ => {
            let case = |experiment: &RelayExperiment| {
                identification_outcome(&campaign, experiment)
                    .map(|outcome| IdentificationCase::of(&outcome))
            };
            let (cases, journal) = of_family(arguments, &campaign, case)?;
            let text = shown(arguments, &cases, || {
                report::identification(&campaign, &cases)
            })?;
            (text, journal)
        }
    })
}

/// The cases of a campaign one by one, for programs that share them out.
pub(crate) enum Cases {
    Relay(Campaign),
    Identification(Campaign),
    Recording(RecordingCampaign),
}

impl Cases {
    pub(crate) fn read(file: &Path) -> Result<Self, Failure> {
        let of_relays = || -> Result<Campaign, Failure> {
            let campaign: Campaign = settings::read(file)?;
            let fault = |error| Failure::unreadable(file, error);
            campaign.validate().map_err(fault)?;
            Ok(campaign)
        };
        match settings::read::<Head>(file)?.measure {
            Measure::Relay => of_relays().map(Self::Relay),
            Measure::Identification => of_relays().map(Self::Identification),
            Measure::Recording => {
                let campaign: RecordingCampaign = settings::read(file)?;
                let fault = |error| Failure::unreadable(file, error);
                campaign.validate().map_err(fault)?;
                Ok(Self::Recording(campaign))
            }
            Measure::Unknown | Measure::Honesty => Err(Failure::unreadable(
                file,
                "campaigns of this measure are not shared out: run `onecycle campaign` on one machine",
            )),
        }
    }

    pub(crate) fn count(&self) -> u64 {
        match self {
            Self::Relay(campaign) | Self::Identification(campaign) => campaign.cases,
            Self::Recording(campaign) => campaign.cases,
        }
    }

    /// The outcome of case `n`, as `onecycle campaign --json` prints it.
    pub(crate) fn case(&self, n: u64) -> Result<Value, Failure> {
        let shown = match self {
            Self::Relay(campaign) => {
                let outcome = (campaign.experiment(n)).and_then(|of| relay_outcome(&of));
                serde_json::to_value(RelayCase::from(outcome.map_err(Failure::usage)?))
            }
            Self::Identification(campaign) => {
                let outcome = (campaign.experiment(n))
                    .and_then(|of| identification_outcome(campaign, &of))
                    .map_err(Failure::usage)?;
                serde_json::to_value(IdentificationCase::of(&outcome))
            }
            Self::Recording(campaign) => {
                let recording = campaign.record(n).map_err(Failure::usage)?;
                serde_json::to_value(recording_outcome(&recording, &campaign.options()))
            }
        };
        shown.map_err(Failure::usage)
    }
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

/// The table of wrong data.
fn of_wrong_data(arguments: &args::Campaign) -> Result<Table, Failure> {
    check_options(arguments)?;
    let mut campaign: HonestyCampaign = settings::read(&arguments.file)?;
    campaign.cases = arguments.cases.unwrap_or(campaign.cases);
    campaign
        .validate()
        .map_err(|error| Failure::unreadable(&arguments.file, error))?;
    let count = campaign.cases * campaign.kinds.len() as u64;
    let (cases, journal) = finished(arguments, count, |piece| {
        let kind = (piece / campaign.cases) as usize;
        let recording = campaign
            .record(kind, piece % campaign.cases)
            .map_err(|error| Failure::unreadable(&arguments.file, error))?;
        Ok(honesty_outcome(recording.as_ref()))
    })?;
    let named = report::honesty::named(&campaign, &cases);
    let text = shown(arguments, &named, || {
        report::honesty::table(&campaign, &cases)
    })?;
    Ok((text, journal))
}

/// The table of recordings of any kind.
fn of_recordings(arguments: &args::Campaign) -> Result<Table, Failure> {
    check_options(arguments)?;
    let mut campaign: RecordingCampaign = settings::read(&arguments.file)?;
    campaign.cases = arguments.cases.unwrap_or(campaign.cases);
    campaign
        .validate()
        .map_err(|error| Failure::unreadable(&arguments.file, error))?;
    let options = campaign.options();
    let (cases, journal) = finished(arguments, campaign.cases, |n| {
        let recording = campaign
            .record(n)
            .map_err(|error| Failure::unreadable(&arguments.file, error))?;
        Ok(recording_outcome(&recording, &options))
    })?;
    let text = shown(arguments, &cases, || {
        report::recording::table(&campaign, &cases)
    })?;
    Ok((text, journal))
}

/// The campaign of the file, changed by the arguments.
fn campaign(arguments: &args::Campaign) -> Result<Campaign, Failure> {
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
    campaign.method = arguments.method.map_or(campaign.method, Into::into);
    if let Some(sigma) = arguments.sigma {
        (campaign.sigma, campaign.sigma_uniform) = (sigma, false);
    }
    campaign.validate().map_err(Failure::usage)?;
    Ok(campaign)
}

/// Outcomes of all cases of the campaign's family.
fn of_family<T: Send + Serialize + DeserializeOwned>(
    arguments: &args::Campaign,
    campaign: &Campaign,
    outcome: impl Fn(&RelayExperiment) -> Result<T, ExperimentError> + Sync,
) -> Result<(Vec<T>, Option<Journal>), Failure> {
    finished(arguments, campaign.cases, |n| {
        let outcome = campaign
            .experiment(n)
            .and_then(|experiment| outcome(&experiment));
        outcome.map_err(Failure::usage)
    })
}

/// Cases of the family for one case of each kind out of it: false alarms are rare and count most.
const IN_FAMILY: u64 = 5;

/// The table of processes in and out of the family.
fn of_kinds(arguments: &args::Campaign, campaign: &Campaign) -> Result<Table, Failure> {
    let recipe = campaign.recipe();
    recipe
        .validate()
        .map_err(|error| Failure::unreadable(&arguments.file, error))?;
    let pack = Pack::embedded().map_err(Failure::usage)?;
    let network = |signature: &Signature| pack.outputs(&signature.values);
    let classifier = CycleClassifier {
        network: &network,
        calibration: Calibration::of_pack(&pack)
            .ok_or_else(|| Failure::usage(ClassifyError::Pack))?,
    };
    let kinds: Vec<DefectKind> = std::iter::once(DefectKind::InFamily)
        .chain(DefectKind::OUTSIDE)
        .collect();
    let in_family = IN_FAMILY * campaign.cases;
    let outside = campaign.cases * (kinds.len() as u64 - 1);
    let (cases, journal) = finished(arguments, in_family + outside, |piece| {
        let (kind, n) = match piece.checked_sub(in_family) {
            None => (DefectKind::InFamily, piece),
            Some(beyond) => {
                let kind = kinds[1 + (beyond / campaign.cases) as usize];
                (kind, beyond % campaign.cases)
            }
        };
        let judged = evaluate(&recipe, kind, n, Some(&classifier)).map_err(Failure::usage)?;
        Ok(judged.map(OutsiderCase::from))
    })?;
    let mut rest = &cases[..];
    let rows: Vec<(DefectKind, Vec<OutsiderCase>)> = kinds
        .into_iter()
        .map(|kind| {
            let count = match kind {
                DefectKind::InFamily => in_family,
                _ => campaign.cases,
            };
            let (own, others) = rest.split_at(count as usize);
            rest = others;
            // Processes that do not oscillate even without their defect are left out.
            (kind, own.iter().copied().flatten().collect())
        })
        .collect();
    let named: Vec<(&str, &OutsiderCase)> = (rows.iter())
        .flat_map(|(kind, cases)| cases.iter().map(|case| (kind.name(), case)))
        .collect();
    let text = shown(arguments, &named, || report::unknown(campaign, &rows))?;
    Ok((text, journal))
}

/// Cases of each thread between two writes to the journal: a few seconds of work.
const LOT: usize = 64;

/// Outcomes of all cases, in order for any number of threads. With an output file, finished cases are kept in its
/// journal.
fn finished<T: Send + Serialize + DeserializeOwned>(
    arguments: &args::Campaign,
    count: u64,
    case: impl Fn(u64) -> Result<T, Failure> + Send + Sync,
) -> Result<(Vec<T>, Option<Journal>), Failure> {
    let mut done: Vec<T> = Vec::new();
    let mut journal = match &arguments.out {
        None => None,
        Some(out) => {
            let settings = settings(arguments)?;
            let take = |lot: Vec<T>| {
                done.extend(lot);
                Ok(())
            };
            let folder = Journal::folder_of(out);
            Some(Journal::open(
                &folder,
                "campaign",
                &settings,
                arguments.restart,
                take,
            )?)
        }
    };
    if !done.is_empty()
        && let Some(journal) = &journal
    {
        journal.tell_resumed(&format!("{} of {count} cases", done.len()));
    }
    let workers = Workers::new(None)?;
    let count = count as usize;
    workers.expect(count, done.len());
    while done.len() < count {
        let first = done.len();
        let lot = (LOT * workers.threads()).min(count - first);
        let lot = workers.run(lot, |k| case((first + k) as u64));
        let lot: Vec<T> = lot.into_iter().collect::<Result<_, Failure>>()?;
        if let Some(journal) = &mut journal {
            journal.add(&lot)?;
        }
        done.extend(lot);
    }
    workers.finish();
    Ok((done, journal))
}

/// Everything that decides the outcomes: the file and the arguments that change it.
fn settings(arguments: &args::Campaign) -> Result<Value, Failure> {
    let file: toml::Table = settings::read(&arguments.file)?;
    let method = arguments.method.map(|method| format!("{method:?}"));
    Ok(json!({
        "file": file,
        "cases": arguments.cases,
        "cycles": arguments.cycles,
        "method": method,
        "sigma": arguments.sigma,
        "time_scale": arguments.time_scale,
    }))
}
