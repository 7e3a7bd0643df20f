//! Limits of a style that a loop breaks.

use crate::{Assessment, Specification};

use crate::words::number::short;

/// The digits that a firmware stores may take this share of a limit.
const TOLERANCE: f64 = 0.01;

/// A figure of a loop, and its limit.
struct Limit {
    name: &'static str,
    value: f64,
    limit: f64,
    bound: &'static str,
    /// Unit of the text, and how many of them a value of one is.
    unit: (&'static str, f64),
}

impl Limit {
    /// Above 1: the limit is broken.
    fn excess(&self) -> f64 {
        match self.bound {
            AT_LEAST => self.limit / self.value,
            _ => self.value / self.limit,
        }
    }

    fn is_broken(&self) -> bool {
        self.excess() > 1.0 + TOLERANCE
    }
}

const AT_LEAST: &str = "at least";
const AT_MOST: &str = "at most";

/// Sentence that names the limits of `asked` that a loop with these figures breaks, each with its value. `None`: it keeps
/// them. Without figures the loop is unstable.
pub fn broken(asked: &Specification, figures: Option<&Assessment>) -> Option<String> {
    let Some(figures) = figures else {
        return Some("the loop is unstable with these gains".to_owned());
    };
    let text = |of: &Limit| {
        let (unit, times) = of.unit;
        let [value, limit] = [of.value, of.limit].map(|value| short(times * value));
        format!("{} {value}{unit} ({} {limit}{unit})", of.name, of.bound)
    };
    let limits = limits(asked, figures);
    let broken: Vec<String> = (limits.iter())
        .filter(|of| of.is_broken())
        .map(text)
        .collect();
    let style = asked.style.name();
    (!broken.is_empty()).then(|| {
        format!(
            "these gains break limits of the style {style}: {}",
            broken.join(", ")
        )
    })
}

/// Whether a loop breaks a limit of `asked` by more than another one.
pub fn is_worse(asked: &Specification, figures: &Assessment, than: &Assessment) -> bool {
    let pairs = limits(asked, figures).into_iter().zip(limits(asked, than));
    let mut pairs = pairs.filter(|(new, _)| new.is_broken());
    pairs.any(|(new, old)| new.excess() > old.excess())
}

fn limits(asked: &Specification, figures: &Assessment) -> [Limit; 7] {
    let of = |name, value, bound, limit, unit| Limit {
        name,
        value,
        limit,
        bound,
        unit,
    };
    let margins = &figures.margins;
    let phase_rad = asked.implied_phase_margin_rad();
    let gain = asked.gain_margin.max(asked.ms / (asked.ms - 1.0));
    let crossover = asked.crossover_rad_per_s.unwrap_or(f64::INFINITY);
    let noise = figures.noise_share.unwrap_or(0.0);
    let own_gain = margins.gain_margin.unwrap_or(f64::INFINITY);
    let (degrees, none) = ((" deg", 1_f64.to_degrees()), ("", 1.0));
    let own_crossover = margins.gain_crossover_rad_per_s;
    [
        of(
            "phase margin",
            margins.phase_margin_rad,
            AT_LEAST,
            phase_rad,
            degrees,
        ),
        of("gain margin", own_gain, AT_LEAST, gain, none),
        of(
            "delay margin",
            margins.delay_margin_s,
            AT_LEAST,
            asked.delay_margin_s,
            (" ms", 1e3),
        ),
        of("Ms", figures.ms, AT_MOST, asked.ms, none),
        of("Mt", figures.mt, AT_MOST, asked.mt, none),
        of(
            "gain crossover",
            own_crossover,
            AT_MOST,
            crossover,
            (" rad/s", 1.0),
        ),
        of(
            "noise at the actuator",
            noise,
            AT_MOST,
            asked.noise_share,
            (" %", 100.0),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use crate::{Form, Linear, Parameter, Pid, Structure, Style, assess};

    use super::*;

    // K = 1, T = 1 s, tau = 0.1 s under a PI: with Ti = T the loop is kp exp(-0.1 s) / s, whose phase margin is
    // 90 deg - 0.1 kp rad and whose gain margin is pi / (0.2 kp). By hand: kp 10: 32.7 deg and 1.57; kp 4: 67.1 deg and 3.93.
    #[test]
    fn limits_by_hand() {
        let value = |of| Some(if of == Parameter::Tau { 0.1 } else { 1.0 });
        let model = Linear::from_parameters(Structure::Foptd, value)
            .unwrap()
            .into();
        let of = |kp: f64| assess(&model, &Pid::new(kp, kp, 0.0).into(), None).unwrap();
        let asked = Specification::new(Form::Pi, Style::Balanced);
        let sentence = broken(&asked, Some(&of(10.0))).unwrap();
        for part in [
            "style balanced: phase margin 32.7 deg (at least 36.4 deg), gain margin 1.57 (at least 2.67), Ms ",
            "(at most 1.60)",
        ] {
            assert!(sentence.contains(part), "{sentence}");
        }
        assert_eq!(broken(&asked, Some(&of(4.0))), None);
        assert!(broken(&asked, None).unwrap().contains("unstable"));
        assert!(is_worse(&asked, &of(10.0), &of(9.0)) && !is_worse(&asked, &of(9.0), &of(10.0)));
        assert!(!is_worse(&asked, &of(4.0), &of(3.0)));
    }
}
