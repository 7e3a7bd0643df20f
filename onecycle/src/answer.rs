//! The answer of a report, made of what was identified, the controllers to choose from and the gains of a log.

use onecycle_design::cascade::Cascade;
use onecycle_design::{Assessment, Comparison, Controller, Model, Pid, assess};
use onecycle_identify::{Identification, Identified};
use onecycle_link::{ControlLoop, LoopGains, Recording};

use crate::design::DesignReport;
use crate::log_gains::{LogLoop, pid};
use crate::request::HALF_STEP;
use crate::results::answer::{Advice, Answer, Columns, Gain};
use crate::results::controllers::Controllers;
use crate::results::log_gains::LogGains;
use crate::words::answer as words;
use crate::words::controllers::{action as action_of, advice};
use crate::words::log_gains::broken;
use crate::words::recording::input_stops;
use crate::words::remark::reasons;
use crate::words::sentence;
use crate::words::units::Units;

/// Draws on which the gains in force and the proposed ones are compared.
const DRAWS: usize = 24;

/// What an answer is about.
pub(crate) struct Subject<'a> {
    pub(crate) file: &'a str,
    pub(crate) units: &'a Units,
    pub(crate) choice: Option<&'a Controllers>,
    pub(crate) of_log: Option<&'a LogLoop>,
    pub(crate) gains: Option<&'a LogGains>,
    /// Share of the way to the proposed gains that is written.
    pub(crate) share: f64,
}

/// The answer to a recording.
pub(crate) fn of(found: &Identification, recording: &Recording, subject: &Subject<'_>) -> Answer {
    let identified = match &found.outcome {
        Ok(identified) => identified,
        Err(verdict) => {
            let (reason, next) = words::refused(verdict);
            return Answer {
                watch: input_stops(recording),
                ..not_yet(reason, next, None)
            };
        }
    };
    let watch = reasons(found).first().map(|(_, sentence)| sentence.clone());
    let answer = of_identified(identified, subject);
    Answer {
        watch: watch.or(answer.watch),
        ..answer
    }
}

/// The answer to a process that was identified.
pub(crate) fn of_identified(identified: &Identified, subject: &Subject<'_>) -> Answer {
    let overlay = subject.gains.and_then(|gains| gains.overlay.as_ref());
    let sure = words::sure(identified, overlay.map(|overlay| overlay.explained));
    if subject.of_log.is_some_and(LogLoop::is_contradicted) {
        let (reason, next) = words::contradicted();
        return not_yet(reason, next, Some(sure));
    }
    let Some((choice, design)) = subject
        .choice
        .and_then(|choice| Some((choice, choice.design()?)))
    else {
        if subject.choice.is_none() {
            let next = sentence(words::ASK_FOR_CONTROLLERS);
            return not_yet(words::NONE_ASKED.to_owned(), next, Some(sure));
        }
        let row = subject.choice.and_then(Controllers::chosen);
        let error = row.and_then(|row| row.proposal.outcome.as_ref().err());
        let next = error.map_or(String::new(), |error| sentence(&advice(error)));
        return not_yet(words::NO_DESIGN.to_owned(), next, Some(sure));
    };
    let (model, _) = identified.for_design(0);
    let draws = || identified.posterior.models(DRAWS);
    let designed = (choice, &design.0.controller, Some(design.1));
    proposal((&model, &draws), designed, subject, Some(sure))
}

impl DesignReport {
    /// The answer: what to do, what to type in, what comes next.
    #[must_use]
    pub fn answer(&self) -> Answer {
        let subject = Subject {
            file: "",
            units: &Units::default(),
            choice: Some(&self.choice),
            of_log: None,
            gains: None,
            share: HALF_STEP,
        };
        let family = self.oscillation.as_ref().map(|of| &of.family);
        let members = || family.map_or(vec![], |family| family.members.clone());
        let full = self.choice.design().map(|(_, figures)| figures);
        let designed = (&self.choice, &self.best.controller, full);
        proposal((&self.model, &members), designed, &subject, None)
    }
}

/// A process, and those that it may be instead.
type Likely<'a> = (&'a Model, &'a dyn Fn() -> Vec<Model>);

/// The answer with a controller, and its figures, for a process.
fn proposal(
    process: Likely<'_>,
    (choice, controller, full): (&Controllers, &Controller, Option<&Assessment>),
    subject: &Subject<'_>,
    sure: Option<String>,
) -> Answer {
    let to_type = ToType::of(choice, controller, subject);
    let (verdict, reason) = verdict(process, choice, controller);
    let of_loops = |full| columns(process.0, choice, full, to_type.half.as_ref());
    Answer {
        verdict,
        reason,
        step: Some(subject.share),
        figures: full.map(of_loops),
        sure,
        watch: words::not_kept(choice),
        next: next(verdict, subject, to_type.is_of_firmware),
        gains: to_type.gains,
    }
}

fn not_yet(reason: String, next: String, sure: Option<String>) -> Answer {
    Answer {
        next,
        sure,
        ..Answer::not_yet(reason)
    }
}

/// What to do about the gains, and why.
fn verdict(
    (model, draws): Likely<'_>,
    choice: &Controllers,
    proposed: &Controller,
) -> (Advice, String) {
    let compared = choice.against.as_ref().and_then(|now| {
        Comparison::new(model, &draws(), [&now.controller, proposed], &choice.asked)
    });
    match compared {
        Some(compared) if compared.pays() => (Advice::Change, words::compared(choice, &compared)),
        Some(compared) => (Advice::Keep, words::compared(choice, &compared)),
        None => (Advice::FirstGains, words::first(choice)),
    }
}

/// What to type in for a controller.
pub(super) fn typed(controller: &Controller, subject: &Subject<'_>) -> Vec<Gain> {
    let of = |choice| ToType::of(choice, controller, subject).gains;
    subject.choice.map(of).unwrap_or_default()
}

/// What to type in.
struct ToType {
    gains: Vec<Gain>,
    /// The controller half of the way. `None` without gains in force.
    half: Option<Controller>,
    /// Whether the gains are parameters of the firmware.
    is_of_firmware: bool,
}

impl ToType {
    fn of(choice: &Controllers, proposed: &Controller, subject: &Subject<'_>) -> Self {
        let goal = proposed.pid();
        let of_log = subject.of_log;
        if let Some((gains, half)) =
            of_log.and_then(|of_log| of_log.named(goal, subject.share, choice))
        {
            return Self {
                gains,
                half: Some(half),
                is_of_firmware: true,
            };
        }
        if let Controller::Autopilot(of) = proposed {
            return Self {
                gains: cascade(&of.gains),
                half: None,
                is_of_firmware: false,
            };
        }
        let now = (choice.against.as_ref()).map(|against| against.controller.pid());
        let half = now.map(|now| between(&now, &goal, subject.share));
        let all = [now, half, Some(goal)];
        Self {
            gains: in_plant(choice, all).unwrap_or_else(|| parallel(&all, subject.units)),
            half: half.map(Controller::from),
            is_of_firmware: false,
        }
    }
}

/// The gains of an autopilot's cascade, those that are used.
fn cascade(of: &Cascade) -> Vec<Gain> {
    let terms = [
        ("angle P", "1/s", of.angle_p),
        ("rate P", "", of.rate_p),
        ("rate I", "1/s", of.rate_i),
        ("rate D", "s", of.rate_d),
    ];
    let used = terms.into_iter().filter(|term| term.2 != 0.0);
    used.map(|(name, unit, full)| gain(name, unit, [None, None, Some(full)]))
        .collect()
}

/// The gains of the parallel form, those that are used, and what belongs to them.
fn parallel(all: &[Option<Pid>; 3], units: &Units) -> Vec<Gain> {
    let gains = [
        used("Kp", &units.controller(""), all, &|pid| pid.kp),
        used("Ki", &units.integral(), all, &|pid| pid.ki),
        used("Kd", &units.controller(" s"), all, &|pid| pid.kd),
    ];
    gains.into_iter().flatten().chain(beside(all)).collect()
}

/// The filter of the measurement, if there is one, and the set-point weight of an integral controller.
fn beside(all: &[Option<Pid>; 3]) -> impl Iterator<Item = Gain> {
    let weight = |pid: &Pid| match pid.ki == 0.0 {
        true => 0.0,
        false => pid.setpoint_weight,
    };
    let values = all.map(|pid| pid.as_ref().map(weight));
    let is_integral = all[2].is_some_and(|goal| goal.ki != 0.0);
    let filter = used("filter Tf", "s", all, &|pid| pid.filter_s);
    let weight = (is_integral || is_used(&values)).then(|| gain("set-point weight b", "", values));
    filter.into_iter().chain(weight)
}

fn used(
    name: &str,
    unit: &str,
    all: &[Option<Pid>; 3],
    value: &dyn Fn(&Pid) -> f64,
) -> Option<Gain> {
    let values = all.map(|pid| pid.as_ref().map(value));
    is_used(&values).then(|| gain(name, unit.trim(), values))
}

fn is_used(values: &[Option<f64>; 3]) -> bool {
    values.iter().flatten().any(|value| *value != 0.0)
}

/// The gains as a controller of a process control system takes them. `None`: none is named, or it cannot take them.
fn in_plant(choice: &Controllers, all: [Option<Pid>; 3]) -> Option<Vec<Gain>> {
    let (vendor, spans) = choice.plant?;
    let typed = all.map(|pid| vendor.typed(&pid?, &spans).ok());
    let value = |of: usize, name: &str| {
        let gains = typed[of].as_ref()?;
        let gain = gains.iter().find(|gain| gain.name == name)?;
        Some(gain.value.abs()).filter(|value| value.is_finite() && *value != 0.0)
    };
    let full = typed[2].as_ref()?;
    let named = full.iter().filter_map(|of| {
        let values = [
            value(0, of.name),
            value(1, of.name),
            Some(value(2, of.name)?),
        ];
        Some(gain(of.name, of.unit, values))
    });
    // A controller that fixes neither has both as settings of their own.
    let is_settable = vendor.law().setpoint_weight.is_none();
    let beside = beside(&all).filter(|_| is_settable);
    Some(named.chain(beside).collect())
}

fn gain(name: &str, unit: &str, [now, half, full]: [Option<f64>; 3]) -> Gain {
    Gain {
        name: name.to_owned(),
        unit: unit.to_owned(),
        now,
        half,
        full,
    }
}

/// A controller between two, with the filter and the execution of the second.
fn between(now: &Pid, goal: &Pid, share: f64) -> Pid {
    let of = |pid: &Pid| LoopGains::new(pid.kp, pid.ki, pid.kd);
    let half = pid(of(now).toward(of(goal), share));
    half.with_filter_s(goal.filter_s)
        .with_setpoint_weight(goal.setpoint_weight)
        .with_execution(goal.execution)
}

fn columns(
    model: &Model,
    choice: &Controllers,
    full: &Assessment,
    half: Option<&Controller>,
) -> Columns {
    let noise = choice.asked.noise.as_ref();
    let now = choice.against.as_ref().and_then(|now| now.figures);
    let half = half.and_then(|half| assess(model, half, noise));
    Columns {
        now: now.as_ref().map(Into::into),
        half: half.as_ref().map(Into::into),
        full: full.into(),
    }
}

fn next(of: Advice, subject: &Subject<'_>, is_of_firmware: bool) -> String {
    let written = subject.gains.and_then(|gains| gains.written.as_ref());
    match (written, of, subject.of_log) {
        (Some(Ok(written)), _, _) => {
            let broken = broken(written).map_or(String::new(), |broken| format!(" {broken}"));
            let files = written.files.as_ref();
            files.map_or(String::new(), words::written) + &broken
        }
        (Some(Err(reason)), _, _) => format!("Nothing is written: {reason}"),
        (None, Advice::Keep, _) => words::NOTHING.to_owned(),
        (None, Advice::Change, Some(of_log)) if is_of_firmware => words::write(
            subject.file,
            &settings(of_log.control_loop()),
            (of_log.parameter_ending(), subject.share),
        ),
        (None, Advice::Change, _) => words::type_in(subject.share) + &action(subject),
        _ => words::COMPARE.to_owned() + &action(subject),
    }
}

/// The action of a process control system's controller, which is a setting of its own beside the gains.
fn action(subject: &Subject<'_>) -> String {
    let choice = subject.choice;
    let says = choice.and_then(|choice| {
        let (vendor, spans) = choice.plant?;
        let (design, _) = choice.design()?;
        let is_set = vendor.has_range_of_measurement();
        let gains = vendor.typed(&design.controller.pid(), &spans).ok()?;
        is_set.then(|| format!(" The action of the controller is {}.", action_of(&gains)))
    });
    says.unwrap_or_default()
}

/// Settings that choose a loop.
fn settings(of: ControlLoop) -> String {
    match of {
        ControlLoop::Rate(axis) => format!(" `axis={}`", axis.name()),
        ControlLoop::Attitude(axis) => format!(" `axis={}` `loop=attitude`", axis.name()),
        _ => " `loop=altitude`".to_owned(),
    }
}
