//! `onecycle identify`: a recording in, the process and its controller out.

use std::io::Read;
use std::path::Path;
use std::process::ExitCode;

use onecycle::{
    ColumnRef, CsvOptions, Hold, Identification, ReadError, Recording, Road, Specification,
    Structure, Style, Verdict,
};
use onecycle_link::{LogError, Span};

use super::in_force::InForce;
use super::log::{self, Piped, Source};
use super::log_gains::{self, LogLoop};
use super::{answer, controllers, flight};
use crate::args::{Between, Estimator, Identify, PAPER_HAS_NO_NOISE};
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, write_text};
use crate::reading::open_with_bar;
use crate::report::units::Units;
use crate::report::{json, log_gains as log_report, page, text};
use crate::results::answer::Answer;
use crate::results::controllers::Controllers;
use crate::results::log_gains::LogGains;
use crate::words;

/// A recording, what was identified from it, and the controllers to choose from.
pub(crate) struct Found {
    name: String,
    pub(crate) recording: Recording,
    pub(crate) identification: Identification,
    pub(crate) choice: Option<Controllers>,
    pub(crate) of_log: Option<LogLoop>,
    gains: Option<LogGains>,
    answer: Answer,
}

impl Found {
    /// The report of docs/identify-json.md.
    pub(crate) fn json(&self, has_rows: bool) -> String {
        json::identification(
            &self.name,
            &self.recording,
            &self.identification,
            (self.choice.as_ref(), &self.answer),
            self.gains.as_ref(),
            has_rows,
        )
    }

    /// The page, for which designs over limits of `Ms` are made on first use.
    pub(crate) fn page(&mut self) -> String {
        self.make_trade_off();
        page::identification(
            &self.title(),
            &self.recording,
            &self.identification,
            (self.choice.as_ref(), &self.answer),
            self.gains.as_ref(),
        )
    }

    /// Makes the designs over limits of `Ms`, once.
    pub(crate) fn make_trade_off(&mut self) {
        self.choice = (self.choice.take()).map(|choice| match &self.identification.outcome {
            Ok(identified) if choice.trade_off.is_empty() => {
                choice.with_trade_off(&identified.for_design(0).0)
            }
            _ => choice,
        });
    }

    /// Whether a process was identified, and the parameters were written if that was asked for.
    fn exit_code(&self) -> u8 {
        let is_refused = |gains: &LogGains| matches!(gains.written, Some(Err(_)));
        match self.identification.outcome.is_ok() && !self.gains.as_ref().is_some_and(is_refused) {
            true => exit::DONE,
            false => exit::NO_PROCESS,
        }
    }

    /// The answer, and with details all else.
    pub(crate) fn text(&self, has_details: bool) -> String {
        let (recording, found) = (&self.recording, &self.identification);
        let card = text::card(&self.title(), recording, found, &self.answer, has_details);
        if !has_details {
            return card;
        }
        let choice = self.choice.as_ref();
        let details = text::identification(&self.name, recording, found, choice);
        let gains = self.gains.as_ref().map(log_report::text);
        format!("{card}\n{details}{}", gains.unwrap_or_default())
    }

    /// The file, and the loop of a flight log.
    fn title(&self) -> String {
        let of_log = self.of_log.as_ref().map(LogLoop::title);
        format!("{}{}", self.name, of_log.unwrap_or_default())
    }
}

pub(crate) fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.report {
        check_page(path, &arguments.file)?;
    }
    if flight::is_asked(arguments) {
        let asked = checked(arguments)?;
        refuse_columns(arguments)?;
        return flight::run(arguments, &asked);
    }
    let mut found = find(arguments, None)?;
    show(arguments, &mut found)?;
    Ok(ExitCode::from(found.exit_code()))
}

/// Prints the report, and writes the page.
pub(crate) fn show(arguments: &Identify, found: &mut Found) -> Result<(), Failure> {
    if let Some(path) = &arguments.report {
        let _waiting = Waiting::on("drawing");
        write_text(path, &found.page())?;
    }
    print(&if arguments.json {
        found.json(arguments.rows)
    } else {
        found.text(arguments.details)
    })
}

/// Refuses arguments that contradict each other; the requirements on the controller.
pub(crate) fn checked(arguments: &Identify) -> Result<Specification, Failure> {
    check_estimator(arguments)?;
    log_gains::check(arguments)?;
    specification(arguments)
}

/// Identifies from the recording that is given, or else from the file of the arguments.
pub(crate) fn find(arguments: &Identify, given: Option<Recording>) -> Result<Found, Failure> {
    let asked = checked(arguments)?;
    let (recording, of_log) = match given {
        Some(recording) => (recording, None),
        None => read(arguments, &asked)?,
    };
    check_span(arguments, &recording)?;
    let set = InForce::of(&arguments.design, Some((&arguments.file, &recording)))?;
    let asked = set.law(asked);
    let _waiting = Waiting::on("identifying");
    let bytes = arguments.pack.bytes()?;
    let pack = arguments.pack.usable(&bytes)?;
    let asked = of_log.as_ref().map_or(asked, |of_log| {
        of_log.specification(asked, arguments.design.is_form_given())
    });
    let structure = of_log
        .as_ref()
        .and_then(|of_log| log_gains::structure(of_log.control_loop()));
    let mut identification = settings(arguments, asked)
        .structure(arguments.structure.or(structure))
        .pack(pack)
        .run(&recording);
    let in_force = || of_log.as_ref().and_then(LogLoop::in_force);
    let against = set.against.or_else(in_force);
    let identified = identification.outcome.as_ref().ok();
    let choice = identified
        .map(|identified| controllers::of_identified(identified, against))
        .map(|choice| choice.in_plant(set.plant));
    let choice = match (&of_log, set.against, choice) {
        (Some(of_log), None, Some(choice)) if of_log.contradicts(&choice) => {
            identification.refuse(Verdict::UnstableInForce);
            None
        }
        (_, _, choice) => choice,
    };
    let gains = (of_log.as_ref())
        .map(|of_log| {
            of_log.report(
                &arguments.write,
                &recording,
                &identification,
                choice.as_ref(),
            )
        })
        .transpose()?;
    let name = arguments.file.display().to_string();
    let answer = answer::of(
        &identification,
        &answer::Subject {
            file: &name,
            units: &Units::of(&recording),
            choice: choice.as_ref(),
            of_log: of_log.as_ref(),
            gains: gains.as_ref(),
            share: arguments.write.step,
        },
    );
    Ok(Found {
        name,
        answer,
        recording,
        identification,
        choice,
        of_log,
        gains,
    })
}

/// The settings of the arguments.
fn settings<'a>(arguments: &Identify, asked: Specification) -> onecycle::Identify<'a> {
    onecycle::Identify::new()
        .cycles(arguments.cycles as usize)
        .specification(asked)
        .method(arguments.method.into())
        .road(Road::from(arguments.estimator))
        .output_filter_hz(arguments.output_filter)
        .span_s(arguments.from, arguments.to)
        .hold(arguments.hold.map(Hold::from))
        .beta(arguments.beta)
        .input_late_s(arguments.input_late)
        .input_before(arguments.input_before)
}

/// The requirements on the controller.
fn specification(arguments: &Identify) -> Result<Specification, Failure> {
    let mut asked = arguments.design.specification()?;
    if let Some(share) = arguments.noise {
        if asked.style == Style::Paper {
            return Err(Failure::usage(PAPER_HAS_NO_NOISE));
        }
        asked.noise_share = share;
    }
    Ok(asked)
}

/// Refuses the standard output and the recording itself as names of the page.
fn check_page(path: &Path, recording: &Path) -> Result<(), Failure> {
    if path == Path::new("-") {
        return Err(Failure::usage(
            "--report needs the name of a file; it cannot be -",
        ));
    }
    let there = |path: &Path| path.canonicalize().ok();
    if there(path).is_some_and(|page| Some(page) == there(recording)) {
        return Err(Failure::usage(format!(
            "--report {} would overwrite the recording: name another file for the page",
            path.display()
        )));
    }
    Ok(())
}

/// Refuses options that the estimator for steady relay oscillations does not have.
fn check_estimator(arguments: &Identify) -> Result<(), Failure> {
    if arguments.estimator != Estimator::Relay {
        return Ok(());
    }
    let is_other = |structure| structure != Structure::Soiptd;
    let refused = [
        ("--structure", arguments.structure.is_some_and(is_other)),
        ("--from", arguments.from.is_some()),
        ("--to", arguments.to.is_some()),
        (
            "--hold interpolated",
            arguments.hold == Some(Between::Interpolated),
        ),
    ];
    match refused.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(Failure::usage(format!(
            "{option} needs the general estimator: leave out {option} or --estimator relay"
        ))),
        None => Ok(()),
    }
}

/// Refuses a part of the recording that is empty.
fn check_span(arguments: &Identify, recording: &Recording) -> Result<(), Failure> {
    let times_s = recording.time_s();
    let (Some(&start_s), Some(&end_s)) = (times_s.first(), times_s.last()) else {
        return Ok(());
    };
    let from_s = arguments.from.unwrap_or(start_s);
    let to_s = arguments.to.unwrap_or(end_s);
    if from_s >= to_s || from_s >= end_s || to_s <= start_s {
        return Err(Failure::usage(format!(
            "--from {from_s} --to {to_s} leaves nothing: the recording runs from {start_s:.3} to {end_s:.3} s"
        )));
    }
    Ok(())
}

/// The recording, and the loop of the flight log that it is: without a choice of the part, the part that tells most.
pub(crate) fn read(
    arguments: &Identify,
    asked: &Specification,
) -> Result<(Recording, Option<LogLoop>), Failure> {
    let path = arguments.file.as_path();
    let piped = match path == Path::new("-") {
        true => Some(log::piped()?),
        false => None,
    };
    let (bytes, head) = match piped {
        Some(Piped::Log(bytes)) => (Some(bytes), vec![]),
        Some(Piped::Other(head)) => (None, head),
        None => (None, vec![]),
    };
    if bytes.is_some() || log::is_log(path) {
        refuse_columns(arguments)?;
        let bytes = bytes.as_deref();
        let source = Source { path, bytes };
        let (signals, of_log) = LogLoop::of(&source, arguments)?;
        let is_cut = arguments.from.is_some() || arguments.to.is_some();
        let part = match is_cut {
            // As the table of all loops cuts its parts: what is not asked for does not matter.
            true => Some(Span::new(
                arguments.from.unwrap_or(f64::NEG_INFINITY),
                arguments.to.unwrap_or(f64::INFINITY),
            )),
            false => of_log.as_ref().and_then(|of_log| {
                let _waiting = Waiting::on("comparing the parts of the flight");
                let asked = of_log.specification(*asked, arguments.design.is_form_given());
                flight::best_part(&signals, of_log.flight(), &asked)
            }),
        };
        let signals = part.map_or_else(|| signals.clone(), |part| signals.part(part));
        return Ok((log::recording(&source, &signals)?, of_log));
    }
    let option = arguments.write.given().or(arguments.log.given());
    if option.is_some() && path != Path::new("-") {
        // A file that is not there is no table either.
        open_with_bar(path).map_err(|error| Failure::unreadable(path, error))?;
    }
    if let Some(option) = arguments.write.given() {
        return Err(Failure::usage(format!(
            "{option} writes parameters of an autopilot, and {} is not a flight log: leave out {option}",
            path.display()
        )));
    }
    if let Some(option) = arguments.log.given() {
        return Err(Failure::usage(format!(
            "{option} is for flight logs, and {} is not a flight log: leave out {option}",
            path.display()
        )));
    }
    match read_table(arguments, &head) {
        Err(Failure::Recording { reason, .. })
            if matches!(*reason, ReadError::NotText { .. }) && log::is_named_log(path) =>
        {
            let reason = words::log::refusal(&LogError::UnknownFormat);
            Err(Failure::unreadable(path, reason))
        }
        table => Ok((table?, None)),
    }
}

/// Refuses the names of columns, which a flight log does not have.
fn refuse_columns(arguments: &Identify) -> Result<(), Failure> {
    let options = [
        ("--time", arguments.time.is_some()),
        ("--input", arguments.input.is_some()),
        ("--output", arguments.output.is_some()),
        ("--set-point", arguments.set_point.is_some()),
        ("--tag", arguments.tag.is_some()),
        ("--sample-rate", arguments.sample_rate.is_some()),
        ("--time-unit", arguments.time_unit.is_some()),
    ];
    match options.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(Failure::usage(format!(
            "{option} is for tables, and {} is a flight log: choose its signals with --axis and --loop",
            arguments.file.display()
        ))),
        None => Ok(()),
    }
}

/// `head`: the first bytes of the standard input, which have been read.
pub(crate) fn read_table(arguments: &Identify, head: &[u8]) -> Result<Recording, Failure> {
    let column = |name: &Option<String>| name.as_deref().map(ColumnRef::from);
    let mut options = CsvOptions::default();
    options.time_column = column(&arguments.time);
    options.input_column = column(&arguments.input);
    options.output_column = column(&arguments.output);
    options.set_point_column = column(&arguments.set_point);
    options.control_loop.clone_from(&arguments.tag);
    options.sample_rate_hz = arguments.sample_rate;
    options.time_unit = arguments.time_unit;
    let result = if arguments.file == Path::new("-") {
        let _waiting = Waiting::on("reading the standard input");
        onecycle::read_from(head.chain(std::io::stdin().lock()), &options)
    } else {
        match open_with_bar(&arguments.file) {
            Ok(file) => onecycle::read_from(file, &options),
            // The library's error names the file.
            Err(_) => onecycle::read(&arguments.file, &options),
        }
    };
    result.map_err(|reason| Failure::Recording {
        path: arguments.file.clone(),
        reason: Box::new(reason),
    })
}
