//! From a request to its report.

use onecycle_design::Specification;
use onecycle_identify::progress::part;
use onecycle_identify::{About, Identification, Remark, Verdict};
use onecycle_link::{Recording, Span};
use onecycle_onboard::pack::{Pack, SELF_TEST_TOLERANCE};

use crate::answer;
use crate::builder::Identify;
use crate::error::Error;
use crate::in_force::InForce;
use crate::log_gains::{self, LogLoop};
use crate::report::Report;
use crate::request::{PackFile, Request};
use crate::results::controllers::Controllers;
use crate::results::flight::Survey;
use crate::source::{self, LogFile, Source};
use crate::survey::{self, Manner};
use crate::words::units::Units;

/// Shares of the time: of the choice of a part of a flight in the whole, of the identification in a report.
const CHOSEN: f64 = 0.6;
const IDENTIFIED: f64 = 0.9;

/// What a source gives: the recording, the loop of the flight log that it is, and how and what was identified from it to choose its
/// part.
struct Taken {
    recording: Recording,
    of_log: Option<LogLoop>,
    found: Option<(Identify<'static>, Identification)>,
}

impl From<Recording> for Taken {
    fn from(recording: Recording) -> Self {
        Self {
            recording,
            of_log: None,
            found: None,
        }
    }
}

impl Request {
    /// Identifies from a table or from a loop of a flight log, without a choice of the part from the one that tells most. Files with
    /// parameters are made, not written.
    ///
    /// # Errors
    /// One sentence: the settings contradict each other, or the source makes no recording.
    pub fn identify(&self, source: &dyn Source) -> Result<Report, Error> {
        let asked = self.specification()?;
        let is_part_given = self.from_s.is_some() || self.to_s.is_some();
        let read = match source::is_flight_log(source) && !is_part_given {
            true => CHOSEN,
            false => 0.0,
        };
        let taken = part(0.0..read, || self.recording(source, asked))?;
        let in_force = InForce::of(&self.requirements, Some((source, &taken.recording)))?;
        part(read..1.0, || {
            self.report(source.name(), taken, asked, in_force)
        })
    }

    /// Identifies from a recording in memory; `name` stands in the report.
    ///
    /// # Errors
    /// One sentence: the settings contradict each other, or are those of a file.
    pub fn identify_recording(&self, name: &str, recording: Recording) -> Result<Report, Error> {
        self.check_samples()?;
        let in_force = InForce::of(&self.requirements, None)?;
        self.report(
            name.to_owned(),
            Taken::from(recording),
            self.specification()?,
            in_force,
        )
    }

    /// Identifies every loop of a flight log, each from the parts of the flight worth using.
    ///
    /// # Errors
    /// One sentence: the settings contradict each other, or the source is no flight log.
    pub fn survey(&self, source: &dyn Source) -> Result<Survey, Error> {
        self.survey_for(source, false, &|_, _| ())
    }

    /// Like [`survey`](Self::survey). `has_pages`: with all that a page shows of the gains. `progress` is told the number of loops
    /// that are done, of how many.
    ///
    /// # Errors
    /// As [`survey`](Self::survey).
    pub fn survey_for(
        &self,
        source: &dyn Source,
        has_pages: bool,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Survey, Error> {
        let asked = self.specification()?;
        self.check_log(&source.name())?;
        if self.without_controllers {
            let reason = "`design=false` is for one loop: choose it with `axis` and `loop`";
            return Err(Error::request(reason));
        }
        let manner = Manner {
            has_pages,
            progress,
        };
        survey::survey(source, self, &asked, &manner)
    }

    /// Reads a recording as [`identify`](Self::identify) does.
    ///
    /// # Errors
    /// As [`identify`](Self::identify).
    pub fn read(&self, source: &dyn Source) -> Result<Recording, Error> {
        Ok(self.recording(source, self.specification()?)?.recording)
    }

    fn recording(&self, source: &dyn Source, asked: Specification) -> Result<Taken, Error> {
        let name = source.name();
        if !source::is_flight_log(source) {
            self.check_table(source)?;
            return Ok(Taken::from(source::table(source, &self.columns)?));
        }
        self.check_log(&name)?;
        let file = LogFile::scan(source)?;
        let (signals, of_log) = LogLoop::of(&file, self)?;
        let part = match self.from_s.is_some() || self.to_s.is_some() {
            // As the table of all loops cuts its parts: what is not asked for does not matter.
            true => {
                let from_s = self.from_s.unwrap_or(f64::NEG_INFINITY);
                Some((Span::new(from_s, self.to_s.unwrap_or(f64::INFINITY)), None))
            }
            false => of_log.as_ref().and_then(|of_log| {
                let asked = of_log.specification(asked, self.requirements.controller.is_some());
                survey::best_part(&signals, of_log.flight(), &asked)
            }),
        };
        let (signals, found) = match part {
            Some((span, found)) => (signals.part(span), found),
            None => (signals, None),
        };
        Ok(Taken {
            recording: file.recording(&signals)?,
            of_log,
            found,
        })
    }

    fn report(
        &self,
        name: String,
        taken: Taken,
        asked: Specification,
        set: InForce,
    ) -> Result<Report, Error> {
        let Taken {
            recording,
            of_log,
            found,
        } = taken;
        self.check_span(recording.time_s())?;
        let asked = set.law(asked);
        let asked = of_log.as_ref().map_or(asked, |of_log| {
            of_log.specification(asked, self.requirements.controller.is_some())
        });
        // Without controllers the paper's alone, which needs no search, judges whether the process is known well enough; of a log, what
        // has chosen the part did.
        let asked = match self.without_controllers && of_log.is_none() {
            true => Specification::paper(),
            false => asked,
        };
        let structure =
            (of_log.as_ref()).and_then(|of_log| log_gains::structure(of_log.control_loop()));
        let mut identify = self.settings(asked).structure(self.structure.or(structure));
        if let Some(file) = &self.pack {
            identify = identify.pack(usable(file)?);
        }
        // As for the choice of the part, unless something else is asked for.
        let is_known = |how: &Identify<'_>| self.pack.is_none() && identify.is_set_like(how);
        let mut identification = match found.filter(|(how, _)| is_known(how)) {
            Some((_, found)) => found,
            None => part(0.0..IDENTIFIED, || identify.run(&recording)),
        };
        let in_force = || of_log.as_ref().and_then(LogLoop::in_force);
        let against = set.against.or_else(in_force);
        if self.without_controllers {
            leave_controllers(&mut identification);
        }
        let identified = identification.outcome.as_ref().ok();
        let choice = identified
            .filter(|_| !self.without_controllers)
            .map(|identified| {
                Controllers::of_identified(identified, against)
                    .in_plant(set.plant)
                    .with_device_model(identified)
            });
        let choice = match (&of_log, set.against, choice) {
            (Some(of_log), None, Some(choice)) if of_log.contradicts(&choice) => {
                identification.refuse(Verdict::UnstableInForce);
                None
            }
            (_, _, choice) => choice,
        };
        let gains = (of_log.as_ref())
            .map(|of_log| of_log.report(&self.write, &recording, &identification, choice.as_ref()))
            .transpose()?;
        let answer = answer::of(
            &identification,
            &recording,
            &answer::Subject {
                file: &name,
                units: &Units::of(&recording),
                choice: choice.as_ref(),
                of_log: of_log.as_ref(),
                gains: gains.as_ref(),
                share: self.write.step,
            },
        );
        Ok(Report {
            name,
            recording,
            identification,
            choice,
            of_log,
            gains,
            answer,
        })
    }

    fn settings<'a>(&self, asked: Specification) -> Identify<'a> {
        let whole = Identify::new();
        (self.of_cycles().into_iter())
            .fold(whole, Identify::cycles)
            .specification(asked)
            .method(self.method)
            .output_filter_hz(self.output_filter_hz)
            .span_s(self.from_s, self.to_s)
            .unstable(self.is_unstable)
            .hold(self.hold)
            .beta(self.beta)
            .input_late_s(self.input_late_s)
            .input_before(self.input_before)
    }
}

/// Takes the controller out of a result, and what there is to say about it.
fn leave_controllers(found: &mut Identification) {
    if let Ok(identified) = &mut found.outcome {
        identified.design = None;
        identified.phase_margin_rad = None;
        identified.step = None;
        identified.resonance = None;
        let is_on_design = |remark: &Remark| {
            remark.about() == About::Controller || matches!(remark, Remark::NoController(_))
        };
        found.remarks.retain(|remark| !is_on_design(remark));
    }
}

/// A pack to identify with: its network gives the outputs that the pack stores.
fn usable(file: &PackFile) -> Result<Pack<'_>, Error> {
    let unusable = |reason: String| Error::Unreadable {
        name: file.name.clone(),
        reason,
    };
    let pack = Pack::read(&file.bytes).map_err(|error| unusable(error.to_string()))?;
    // A difference that is not a number fails.
    if (pack.self_test()).is_none_or(|worst| worst <= SELF_TEST_TOLERANCE) {
        return Ok(pack);
    }
    Err(unusable(
        "the pack fails its self-test, so it was changed after it was made (see onecycle-lab pack verify): take the original, or \
         train a new one"
            .to_owned(),
    ))
}
