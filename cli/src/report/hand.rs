//! Gains that somebody moves by hand, as JSON for a page that follows.

use onecycle::json::controller as controller_json;
use onecycle::json::controllers::{Figures, Least};
use onecycle::{Assessment, Controller, Model, Specification, least_margins};
use onecycle_design::bands::{StepBands, load_bands, step_bands};
use onecycle_design::{assess_and_simulate, loop_response};
use serde_json::{Value, json};

use crate::words::limits::broken;
use crate::words::sentence;

/// Frequencies of the curves of the open loop, over three and a half decades about the gain crossover.
const FREQUENCIES: u32 = 240;
/// Times at which responses are drawn.
const TIMES: u32 = 240;

/// Gains on the most probable process and on draws from its posterior.
pub(crate) struct ByHand<'a> {
    pub(crate) model: &'a Model,
    pub(crate) controller: &'a Controller,
    pub(crate) asked: &'a Specification,
    pub(crate) draws: &'a [Model],
    pub(crate) with_bands: bool,
    /// End (s) of the responses; by default after the step has settled.
    pub(crate) end_s: Option<f64>,
}

/// Figures and curves.
///
/// `step` has rows of time (s), output and controller's output, `load` of time and output, `open_loop` of frequency (rad/s),
/// real and imaginary part. With bands, each row of `step_band` is the ends for the output and for the controller's output,
/// each row of `load_band` the ends for the output, at the times of the rows.
pub(crate) fn judged(of: &ByHand<'_>) -> Value {
    let (model, controller) = (of.model, of.controller);
    let found = assess_and_simulate(model, controller, of.asked.noise.as_ref());
    let (figures, responses) = found.unzip();
    let least = least_margins(of.draws, controller).map(|least| Least::from(&least));
    let mut answer = json!({
        "is_stable": figures.is_some(),
        "figures": Figures::of(figures.as_ref()),
        "least": least,
        "asks": broken(of.asked, figures.as_ref()).map(|question| sentence(&question)),
    });
    let (Some(figures), Some((step, load))) = (figures, responses) else {
        return answer;
    };
    let settled_s = figures.step.map(|step| 1.4 * step.settling_time_s);
    let end_s = of.end_s.or(settled_s).filter(|end_s| *end_s > 0.0);
    let times_s: Vec<f64> = (0..=TIMES)
        .map(|k| end_s.unwrap_or(1.0) * f64::from(k) / f64::from(TIMES))
        .collect();
    answer["end_s"] = json!(end_s);
    answer["step"] = json!(step.map(|response| {
        let at = |&t_s: &f64| (t_s, response.at(t_s));
        let rows = times_s.iter().map(at).map(|(t_s, (y, u))| [t_s, y, u]);
        rows.collect::<Vec<_>>()
    }));
    answer["load"] = json!(load.map(|response| {
        let rows = times_s.iter().map(|&t_s| [t_s, response.at(t_s).0]);
        rows.collect::<Vec<_>>()
    }));
    answer["open_loop"] = json!(open_loop(model, controller, &figures));
    if of.with_bands {
        let step = step_bands(of.draws, controller, &times_s);
        answer["step_band"] = json!(step.as_ref().map(|bands| rows(bands, 2)));
        let load = load_bands(of.draws, controller, &times_s);
        answer["load_band"] = json!(load.as_ref().map(|bands| rows(bands, 1)));
    }
    answer
}

/// Ends of the bands of the first `count` of output and input, a row for each time.
fn rows(bands: &StepBands, count: usize) -> Vec<Vec<f64>> {
    let bands = [&bands.output, &bands.input];
    (0..bands[0].low.len())
        .map(|k| {
            let ends = bands[..count]
                .iter()
                .map(|band| [band.low[k], band.high[k]]);
            ends.flatten().collect()
        })
        .collect()
}

fn open_loop(model: &Model, controller: &Controller, figures: &Assessment) -> Vec<[f64; 3]> {
    let crossover = figures.margins.gain_crossover_rad_per_s;
    let at = |k: u32| {
        let decades = 3.5 * f64::from(k) / f64::from(FREQUENCIES - 1) - 1.5;
        let omega = crossover * 10_f64.powf(decades);
        let at = loop_response(model, controller, omega)?;
        let (sin, cos) = at.phase_rad.sin_cos();
        Some([omega, at.magnitude * cos, at.magnitude * sin])
    };
    (0..FREQUENCIES).filter_map(at).collect()
}

/// Designs over limits of `Ms`, from calm to sharp.
pub(crate) fn trade_off(designs: &[(f64, Assessment, Controller)]) -> Value {
    let of = |(peak, figures, controller): &(f64, Assessment, Controller)| {
        json!({
            "ms_limit": peak,
            "controller": controller_json(controller),
            "figures": Figures::of(Some(figures)),
        })
    };
    designs.iter().map(of).collect()
}
