//! The estimator with any signals, and the design with any process.

use onecycle::{
    DesignRequest, Linear, Parameter, Recording, Request, Structure, design as design_of, margins,
    sensitivity,
};
use onecycle_cli::report::{identify as shown, tune};

use crate::numbers::Numbers;

/// Most samples: one call takes a tenth of a second.
const MOST_SAMPLES: usize = 200;

/// What is found is finite, an interval holds its estimate, and what is shown says so.
pub(crate) fn estimator(bytes: &[u8]) {
    let mut numbers = Numbers(bytes);
    let mode = numbers.byte();
    let period_s = numbers.between(1e-9, 1e6);
    let scale = [numbers.between(1e-12, 1e12), numbers.between(1e-12, 1e12)];
    let (mut time_s, mut input, mut output) = (Vec::new(), Vec::new(), Vec::new());
    let (mut now_s, mut level, mut value) = (0.0, 0.0, 0.0);
    while !numbers.is_empty() && time_s.len() < MOST_SAMPLES {
        now_s += match mode & 1 {
            0 => period_s,
            _ => period_s * (0.1 + numbers.share()),
        };
        if mode & 2 == 0 || time_s.len() % 8 == 0 {
            level = f64::from(numbers.byte()) - 128.0;
        }
        // A first-order process beside any output.
        value += 0.1 * (level - value);
        let own = f64::from(numbers.byte()) - 128.0;
        let made = if mode & 4 == 0 {
            own
        } else {
            value + 0.02 * own
        };
        time_s.push(now_s);
        input.push(scale[0] * level);
        output.push(scale[1] * made);
    }
    let Ok(recording) = Recording::from_samples(&time_s, &input, &output) else {
        return;
    };
    let mut request = Request::default();
    request.without_controllers = mode & 8 == 0;
    let Ok(report) = request.identify_recording("samples", recording) else {
        return;
    };
    if let Ok(found) = &report.identification.outcome {
        for (parameter, interval) in found.estimate.iter() {
            let ends = [interval.low, interval.estimate, interval.high];
            let known: Vec<f64> = ends.into_iter().flatten().collect();
            let is_sound = known.is_sorted() && known.iter().all(|value| value.is_finite());
            assert!(is_sound, "{}: {interval:?}", parameter.symbol());
        }
        if let Some(design) = &found.design {
            let of = design.controller.pid();
            assert!([of.kp, of.ki, of.kd].iter().all(|gain| gain.is_finite()));
        }
    }
    assert!(!shown::text(&report, true).contains("NaN"));
}

const PARAMETERS: [Parameter; 9] = [
    Parameter::K,
    Parameter::KOverTBody,
    Parameter::TProp,
    Parameter::TProp2,
    Parameter::TBody,
    Parameter::InverseTBody,
    Parameter::NaturalFrequency,
    Parameter::Zeta,
    Parameter::Tau,
];

const STRUCTURES: [&str; 9] = [
    "iptd",
    "integrator_lag",
    "double_integrator_lag",
    "soiptd",
    "toiptd",
    "foptd",
    "soptd",
    "resonant",
    "resonant_lag",
];

/// A controller keeps what it promises: it is finite, and stable with its margins.
pub(crate) fn design(bytes: &[u8]) {
    let mut numbers = Numbers(bytes);
    let mode = numbers.byte();
    let structure = Structure::from_name(STRUCTURES[usize::from(mode) % STRUCTURES.len()]);
    let Some(structure) = structure else {
        unreachable!("the structures have these names");
    };
    let is_usual = numbers.byte() & 1 == 0;
    let values = PARAMETERS.map(|_| match is_usual {
        true => numbers.between(1e-6, 1e6),
        false => numbers.double(),
    });
    let value = |of| {
        let at = PARAMETERS.iter().position(|parameter| *parameter == of)?;
        // One of two names for the same.
        let is_second = matches!(of, Parameter::KOverTBody | Parameter::InverseTBody);
        (!is_second || mode & 128 != 0).then_some(values[at])
    };
    let Ok(process) = Linear::from_parameters(structure, value) else {
        return;
    };
    let mut request = DesignRequest::default();
    let text = String::from_utf8_lossy(numbers.0).into_owned();
    for (name, value) in text.lines().filter_map(|line| line.split_once('=')) {
        if name != "against" {
            let _ = request.set(name, value);
        }
    }
    let model = process.into();
    if let Ok(asked) = request.specification()
        && let Ok(made) = design_of(&model, &asked)
    {
        let of = made.controller.pid();
        assert!([of.kp, of.ki, of.kd].iter().all(|gain| gain.is_finite()));
        let found = margins(&model, &made.controller);
        assert!(found.is_some_and(|found| found.phase_margin_rad > 0.0));
        assert!(sensitivity(&model, &made.controller).is_some_and(|peaks| peaks.ms >= 1.0));
    }
    if mode & 64 != 0
        && let Ok(report) = request.design(model)
    {
        assert!(!tune::text(&report).contains("NaN"));
    }
}
