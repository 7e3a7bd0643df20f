//! Gains of a flight log: the loop as the firmware runs it, the gains in force, and the files that change them.

use std::path::{Path, PathBuf};

use onecycle_design::{
    Assessment, Controller, Execution, Form, LeastMargins, LowPass, Pid, Specification, Structure,
    Style, assess, least_margins,
};
use onecycle_identify::{Identification, Identified};
use onecycle_link::{
    Agreement, Change, ControlLoop, Flight, LoopGains, LowPassSetting, ParameterFiles, RateLaw,
    ReadBack, Recording, Signals, changes, files,
};

use crate::error::Error;
use crate::overlay::{overlay, overshoot};
use crate::request::{Request, Write};
use crate::results::answer::Gain;
use crate::results::controllers::Controllers;
use crate::results::log_gains::{LogGains, NamedFiles, Written};
use crate::source::LogFile;
use crate::words::limits::{broken, is_worse};
use crate::words::log::of_firmware;
use crate::words::log_gains as words;

/// Draws over which the gains to write are judged.
const DRAWS: usize = 200;

/// Least share of the draws on which the gains to write must be stable.
const LEAST_STABLE: f64 = 0.99;

/// Share of the draws on which the gains in force are stable, below which the model is wrong: what the central 90 % leave out at
/// one end.
const MOST_STABLE_IF_WRONG: f64 = 0.05;

/// The loop of a log that is identified.
pub struct LogLoop {
    flight: Flight,
    control_loop: ControlLoop,
    read_back: Option<ReadBack>,
}

impl LogLoop {
    /// A loop without a read-back of its gains.
    pub(crate) fn new(flight: Flight, control_loop: ControlLoop) -> Self {
        Self {
            flight,
            control_loop,
            read_back: None,
        }
    }

    /// The loop that the arguments choose, with its signals. The loop is `None` if the log has no such flight.
    pub(crate) fn of(
        file: &LogFile<'_>,
        request: &Request,
    ) -> Result<(Signals, Option<Self>), Error> {
        let number = file.flight(request.flight);
        let control_loop = request.loop_of_log();
        let signals = file.signals(number, control_loop)?;
        let flight = file.log.flights.get(number.saturating_sub(1)).cloned();
        let of_log = flight.map(|flight| Self::new(flight, control_loop));
        let of_log = of_log.map(|of_log| of_log.with_read_back(file, number));
        Ok((signals, of_log.transpose()?))
    }

    /// With the gains of a rate loop read back from the signals of a flight, by its number; the log is read once.
    pub(crate) fn with_read_back(self, file: &LogFile<'_>, number: usize) -> Result<Self, Error> {
        let ControlLoop::Rate(axis) = self.control_loop else {
            return Ok(self);
        };
        let mut all = file.read_back(number)?.into_iter();
        let read_back = all.find(|read| read.axis == axis);
        Ok(Self { read_back, ..self })
    }

    /// The flight.
    pub(crate) fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Which loop of which flight it is, behind the name of the file.
    pub(crate) fn title(&self) -> String {
        let firmware = of_firmware(&self.flight.firmware);
        format!("  {} loop, {firmware}", self.control_loop)
    }

    /// Usual ending of a file with parameters of its firmware.
    pub(crate) fn parameter_ending(&self) -> Option<&'static str> {
        self.flight.firmware.kind.parameter_ending()
    }

    /// Which loop it is.
    pub(crate) fn control_loop(&self) -> ControlLoop {
        self.control_loop
    }

    /// `asked` for the loop as the firmware runs it: its set-point weight, its filters and rate of execution where the user
    /// gave none, and only P around an attitude loop.
    pub(crate) fn specification(&self, asked: Specification, is_form_given: bool) -> Specification {
        if asked.style == Style::Paper {
            return asked;
        }
        // The firmwares have the proportional term on the error.
        let asked = asked.with_setpoint_weight(1.0);
        match self.control_loop {
            ControlLoop::Rate(axis) => {
                let law = self.flight.rate_law(axis);
                let mut asked = asked.with_execution(execution(&law, asked.execution));
                if asked.execution.derivative_filter.is_some() {
                    // The firmware has no other filter.
                    asked.filter_s = Some(0.0);
                }
                asked
            }
            ControlLoop::Attitude(_) if !is_form_given => {
                // A bare gain: there is no filter to choose.
                let mut asked = asked;
                asked.form = Form::P;
                asked.filter_s = Some(0.0);
                asked
            }
            _ => asked,
        }
    }

    /// The gains in force. `None`: the log has none.
    pub(crate) fn in_force(&self) -> Option<Pid> {
        LoopGains::in_force(&self.flight, self.control_loop).map(pid)
    }

    /// Whether a model is wrong because it calls the loop unstable under the gains that flew, on nearly every process of its
    /// posterior. Gains that the signals contradict are not those that flew.
    pub(crate) fn contradicts(&self, choice: &Controllers) -> bool {
        let is_known = !self.is_contradicted();
        let against = choice.against.as_ref().filter(|_| is_known);
        against.is_some_and(|against| {
            let stable = against.least.map_or(0.0, |least| least.stable);
            against.figures.is_none() && stable < MOST_STABLE_IF_WRONG
        })
    }

    /// Whether the gains that were read back from the signals are others than the parameters of the log.
    pub(crate) fn is_contradicted(&self) -> bool {
        let read = self.read_back.as_ref();
        read.is_some_and(|read| read.agreement() == Agreement::Differs)
    }

    /// What the report says, after writing parameters if that was asked for.
    pub(crate) fn report(
        &self,
        asked: &Write,
        recording: &Recording,
        found: &Identification,
        choice: Option<&Controllers>,
    ) -> Result<LogGains, Error> {
        let identified = found.outcome.as_ref().ok();
        let written = match &asked.file {
            None => None,
            Some(path) => Some(match self.judged(asked, identified, choice) {
                Err(reason) => Err(reason),
                Ok(to_write) => Ok(self.with_files(path, to_write)?),
            }),
        };
        Ok(LogGains {
            written,
            ..self.gains(recording, found, choice)
        })
    }

    /// The gains in force, and what the loop with them and the model explains.
    pub(super) fn gains(
        &self,
        recording: &Recording,
        found: &Identification,
        choice: Option<&Controllers>,
    ) -> LogGains {
        let overlay = match (self.control_loop, self.in_force(), choice) {
            (ControlLoop::Rate(axis), Some(pid), Some(choice)) => {
                let as_run = pid.with_execution(choice.asked.execution);
                overlay(&self.flight, axis, as_run, recording, found)
            }
            _ => None,
        };
        LogGains {
            control_loop: self.control_loop,
            read_back: self.read_back.clone(),
            overlay,
            written: None,
        }
    }

    /// The parameters to write with their margins, or the reason why nothing is written.
    pub(crate) fn judged(
        &self,
        asked: &Write,
        identified: Option<&Identified>,
        choice: Option<&Controllers>,
    ) -> Result<Written, String> {
        let (Some(identified), Some(choice)) = (identified, choice) else {
            return Err(words::NOTHING_IDENTIFIED.to_owned());
        };
        let Some((design, _)) = choice.design() else {
            return Err(words::NO_DESIGN.to_owned());
        };
        if matches!(design.controller, Controller::Autopilot(_)) {
            return Err(words::NOT_ITS_FORM.to_owned());
        }
        let to_write = self.to_write(design.controller.pid(), asked.step, identified, choice)?;
        match to_write.question() {
            Some(broken) if !asked.below_limits => Err(words::below_limits(broken)),
            _ => Ok(to_write),
        }
    }

    /// The parameters for this share of the way from the gains in force to those of `goal` with their margins, or the reason why
    /// they must not be written. Whoever exports them asks the [`Written::question`] first.
    pub fn to_write(
        &self,
        goal: Pid,
        share: f64,
        identified: &Identified,
        choice: &Controllers,
    ) -> Result<Written, String> {
        if self.is_contradicted() {
            return Err(words::CONTRADICTED.to_owned());
        }
        let no_gains = || words::no_gains(self.control_loop);
        let old = LoopGains::in_force(&self.flight, self.control_loop).ok_or_else(no_gains)?;
        if goal.filter_s > 0.0 {
            return Err(words::NOT_ITS_FILTER.to_owned());
        }
        let wanted = old.toward(LoopGains::new(goal.kp, goal.ki, goal.kd), share);
        let changes = changes(&self.flight, self.control_loop, wanted)
            .map_err(|error| words::unwritable(&error))?;
        if changes.is_empty() {
            return Err(words::NO_CHANGE.to_owned());
        }
        let execution = choice.asked.execution;
        let new = pid(old.changed(&changes)).with_execution(execution);
        let controller = Controller::from(new);
        let (model, _) = identified.for_design(0);
        let (figures, least) = judged_gains(&controller, identified, choice)?;
        let simulated = match self.control_loop {
            ControlLoop::Rate(axis) => overshoot(&self.flight, axis, new, &model, &figures),
            _ => figures.step.map(|step| step.overshoot),
        };
        Ok(Written {
            files: None,
            changes,
            share,
            overshoot: simulated,
            broken: broken(&choice.asked, Some(&figures)),
            needs_consent: needs_consent(&[pid(old), goal], &figures, identified, choice),
            figures,
            least,
        })
    }

    /// The parameters that change on the way to `goal` with this share of the step and with all of it, and the controller of that
    /// share; without those that the firmware cannot take. `None`: it cannot take that share either, or the log does not tell those in force.
    pub(crate) fn named(
        &self,
        goal: Pid,
        share: f64,
        choice: &Controllers,
    ) -> Option<(Vec<Gain>, Controller)> {
        if goal.filter_s > 0.0 {
            return None;
        }
        let old = LoopGains::in_force(&self.flight, self.control_loop)?;
        let goal = LoopGains::new(goal.kp, goal.ki, goal.kd);
        let toward = |share| {
            let wanted = old.toward(goal, share);
            changes(&self.flight, self.control_loop, wanted).ok()
        };
        let (part, all) = (toward(share)?, toward(1.0));
        let new = |of: &[Change], name: &str| {
            let found = of.iter().find(|change| change.name == name);
            found.map(|change| change.new)
        };
        let gains = all.as_ref().unwrap_or(&part).iter().map(|change| Gain {
            name: change.name.clone(),
            unit: String::new(),
            now: Some(change.old),
            half: Some(new(&part, &change.name).unwrap_or(change.old)),
            full: all.as_ref().and_then(|all| new(all, &change.name)),
        });
        let half = pid(old.changed(&part)).with_execution(choice.asked.execution);
        Some((gains.collect(), half.into()))
    }

    /// The files that put the new values in force, and the old ones again; or the reason why the firmware has no such file.
    pub fn files(&self, to_write: &Written) -> Result<ParameterFiles, String> {
        let files = files(&self.flight, &to_write.changes);
        files.ok_or_else(|| words::no_gains(self.control_loop))
    }

    fn with_files(&self, path: &Path, to_write: Written) -> Result<Written, Error> {
        let files = named_files(path, &self.flight, &to_write.changes);
        let files = files.ok_or_else(|| Error::Request(words::no_gains(self.control_loop)))?;
        Ok(Written {
            files: Some(files),
            ..to_write
        })
    }
}

/// The file with changed parameters and the one with the old values. `None`: the firmware has no such file, or nothing changes.
pub(crate) fn named_files(path: &Path, flight: &Flight, changes: &[Change]) -> Option<NamedFiles> {
    let text = files(flight, changes).filter(|_| !changes.is_empty())?;
    Some(NamedFiles {
        path: path.to_owned(),
        restore: restore_path(path, text.ending),
        text,
    })
}

/// Figures of gains to write, on the most probable process and over the posterior; or why they must not be written.
pub fn judged_gains(
    controller: &Controller,
    identified: &Identified,
    choice: &Controllers,
) -> Result<(Assessment, Option<LeastMargins>), String> {
    let (model, _) = identified.for_design(0);
    let least = least_margins(&identified.posterior.models(DRAWS), controller);
    let figures = assess(&model, controller, choice.asked.noise.as_ref());
    let is_stable = least.is_none_or(|least| least.stable >= LEAST_STABLE);
    match figures.filter(|_| is_stable) {
        Some(figures) => Ok((figures, least)),
        None => Err(words::unstable(least.map(|least| least.stable))),
    }
}

/// Whether gains with these figures are exported on demand only: they break limits of the style, and are not on the way from
/// gains in force that break them more to a goal that keeps them.
pub fn needs_consent(
    [before, goal]: &[Pid; 2],
    figures: &Assessment,
    identified: &Identified,
    choice: &Controllers,
) -> bool {
    let asked = &choice.asked;
    let (model, _) = identified.for_design(0);
    let judged = |pid: &Pid| {
        let controller = Controller::from(pid.with_execution(asked.execution));
        assess(&model, &controller, asked.noise.as_ref())
    };
    match (judged(before), broken(asked, judged(goal).as_ref())) {
        (Some(before), None) => is_worse(asked, figures, &before),
        _ => broken(asked, Some(figures)).is_some(),
    }
}

/// Structure of the process of a loop. `None`: the recording decides.
///
/// An angle integrates the rate, a climb rate the thrust, behind a loop or motors with a lag.
pub(crate) fn structure(of: ControlLoop) -> Option<Structure> {
    match of {
        ControlLoop::Rate(_) => None,
        _ => Some(Structure::IntegratorLag),
    }
}

/// `NAME.restore.EXT` beside `NAME.EXT`.
#[must_use]
pub fn restore_path(path: &Path, ending: &str) -> PathBuf {
    let own = path
        .extension()
        .map(|own| own.to_string_lossy().into_owned());
    let stem = match own {
        Some(_) => path.with_extension(""),
        None => path.to_owned(),
    };
    let ending = own.unwrap_or_else(|| ending.to_owned());
    let mut name = stem.into_os_string();
    name.push(format!(".restore.{ending}"));
    name.into()
}

/// A controller with these gains.
#[must_use]
pub fn pid(gains: LoopGains) -> Pid {
    Pid::new(gains.proportional, gains.integral, gains.derivative)
}

/// What the firmware does between measurement and output, beside what `own` says.
fn execution(law: &RateLaw, own: Execution) -> Execution {
    let mut execution = own;
    if own.sample_period_s == 0.0 {
        execution.sample_period_s = law.sample_period_s.unwrap_or(0.0);
    }
    execution.derivative_filter = in_series(&law.derivative);
    // In the loop, filters of the error and of the output are filters of the measurement.
    let others: Vec<LowPassSetting> = law.error.into_iter().chain(law.output).collect();
    execution.sensor_filter = in_series(&others);
    execution
}

/// One filter for several in series, with the same delay at low frequencies.
fn in_series(filters: &[LowPassSetting]) -> Option<LowPass> {
    let low_pass = |filter: &LowPassSetting| match filter.order {
        1 => LowPass::first_order(filter.cutoff_hz),
        _ => LowPass::second_order(filter.cutoff_hz),
    };
    match filters {
        [] => None,
        [one] => Some(low_pass(one)),
        several => {
            let times_s = several.iter().map(|filter| low_pass(filter).time_s());
            Some(LowPass::SecondOrder(times_s.sum()))
        }
    }
}
