//! Controllers of a process to choose from: designs and figures, on the threads of the machine.

use onecycle_design::oscillation::Family;
use onecycle_design::{
    Controller, Design, Execution, Limit, Model, Pid, Proposal, Spans, Specification, Style,
    Vendor, assess, design, least_margins, proposals, reference_filter_s,
};
use onecycle_identify::Identified;

use crate::device_model;
use crate::results::controllers::{Against, Controllers, Row, Source};
use crate::threads::each;

/// Draws over which the gains in force are judged.
const DRAWS: usize = 200;

/// Limits of `Ms` of a curve.
const PEAKS: [f64; 10] = [1.2, 1.25, 1.3, 1.4, 1.5, 1.6, 1.8, 2.0, 2.25, 2.5];

impl Controllers {
    /// Controllers of an identified process.
    #[must_use]
    pub fn of_identified(identified: &Identified, against: Option<Pid>) -> Self {
        let draws = identified.posterior.models(DRAWS);
        let (model, _) = identified.for_design(0);
        let asked = &identified.specification;
        Self {
            source: Source::Recording,
            ..controllers(&model, &draws, asked, against, identified.proposals())
        }
    }

    /// Controllers of a known process.
    #[must_use]
    pub fn of_model(model: &Model, asked: &Specification, against: Option<Pid>) -> Self {
        let choices = Proposal::choices(model.structure(), asked);
        let proposals = each(choices, |choice| Proposal::new(model, &[], &choice));
        controllers(model, &[], asked, against, proposals)
    }

    /// Controllers that keep their limits on all members of a family.
    #[must_use]
    pub fn of_family(family: &Family, asked: &Specification, against: Option<Pid>) -> Self {
        let mut asked = *asked;
        asked.coverage = 1.0;
        let (middle, members) = (&family.middle, &family.members);
        let proposals = proposals(middle, members, &asked, None);
        Self {
            source: Source::Oscillation,
            ..controllers(middle, members, &asked, against, proposals)
        }
    }

    /// With the gains as this controller of a process control system takes them.
    #[must_use]
    pub fn in_plant(self, plant: Option<(Vendor, Spans)>) -> Self {
        Self { plant, ..self }
    }

    /// With the model as the devices of this controller take it.
    #[must_use]
    pub(crate) fn with_device_model(self, identified: &Identified) -> Self {
        let device_model = device_model::of(identified, self.plant);
        Self {
            device_model,
            ..self
        }
    }

    /// With the designs for `model` over limits of `Ms`; the other limits are those of the chosen controller.
    #[must_use]
    pub fn with_trade_off(self, model: &Model) -> Self {
        let base = match self.asked.style {
            Style::Paper => self.asked.in_style(Style::Balanced),
            _ => self.asked,
        };
        let at = |peak: f64| {
            let design = design(model, &base.with_peak(peak)).ok()?;
            let figures = assess(model, &design.controller, base.noise.as_ref())?;
            Some((peak, figures, design.controller))
        };
        Self {
            trade_off: each(PEAKS.into(), at).into_iter().flatten().collect(),
            ..self
        }
    }
}

fn controllers(
    model: &Model,
    draws: &[Model],
    asked: &Specification,
    against: Option<Pid>,
    mut proposals: Vec<Proposal>,
) -> Controllers {
    let noise = asked.noise.as_ref();
    let is_asked = |proposal: &Proposal| proposal.specification.style == asked.style;
    if !proposals.iter().any(is_asked) {
        // The paper's style for a structure that it does not cover: the row says so.
        proposals.insert(0, Proposal::new(model, &[], asked));
    }
    let row = |proposal: Proposal| {
        let design = proposal.outcome.as_ref().ok();
        Row {
            figures: design.and_then(|design| assess(model, &design.controller, noise)),
            proposal,
        }
    };
    let rows = each(proposals, row);
    let chosen = rows
        .iter()
        .find(|row| row.proposal.specification.style == asked.style);
    let design = chosen.and_then(|row| row.proposal.outcome.as_ref().ok());
    let against = against.map(|pid| {
        let filter_s = needed_filter_s((model, draws), &pid, &asked.execution, design);
        let pid = pid
            .with_filter_s(filter_s.unwrap_or(pid.filter_s))
            .with_execution(asked.execution);
        let controller = Controller::from(pid);
        Against {
            controller,
            filter_s,
            figures: assess(model, &controller, noise),
            least: least_margins(draws, &controller),
        }
    });
    let figures = chosen.and_then(|row| row.figures.as_ref());
    let missed = figures.map_or(vec![], |figures| asked.missed(figures));
    let overshoots = missed.iter().any(|missed| missed.limit == Limit::Overshoot);
    let reference_filter_s = (design.filter(|_| overshoots))
        .and_then(|design| reference_filter_s(model, &design.controller, asked.overshoot));
    Controllers {
        asked: *asked,
        rows,
        against,
        missed,
        reference_filter_s,
        trade_off: vec![],
        source: Source::Process,
        plant: None,
        device_model: None,
    }
}

/// Time (s) of a measurement filter for gains with a derivative and without filter, where neither the processes nor a known
/// filter attenuate the derivative: the filter of the chosen controller, or a tenth of the derivative time.
fn needed_filter_s(
    (model, draws): (&Model, &[Model]),
    pid: &Pid,
    execution: &Execution,
    chosen: Option<&Design>,
) -> Option<f64> {
    let filters = [
        execution.sensor_filter,
        execution.recorded_filter,
        execution.derivative_filter,
    ];
    let is_lagged = |model: &Model| model.structure().stages().states() > 1;
    let is_attenuated =
        is_lagged(model) && draws.iter().all(is_lagged) || filters.iter().any(Option::is_some);
    if pid.kd == 0.0 || pid.filter_s > 0.0 || is_attenuated {
        return None;
    }
    let own = chosen.map(|design| design.controller.pid().filter_s);
    let tenth = 0.1 * (pid.kd / pid.kp).abs();
    (own.into_iter().chain([tenth])).find(|time_s| time_s.is_normal())
}
