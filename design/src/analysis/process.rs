//! The process of a loop as a cascade of stages, in its own units of time and gain.
//!
//! ```text
//! P(s) = K e^(-tau s)/den(s)
//! ```
//!
//! The unit of time is the sum of dead time and lags, the unit of gain is `K` in that unit of time. The dead time of
//! sampling is part of `tau`.

use crate::controller::{Execution, LowPass};
use crate::model::Linear;

use super::polynomial::Polynomial;

/// A damping ratio below this counts as this: the peak of the resonance is then 5e5 times the gain.
const LEAST_DAMPING_RATIO: f64 = 1e-6;

/// One stage of the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stage {
    /// `1/(T s + 1)`.
    Lag(f64),
    /// `1/(s + a)`; an integrator with `a = 0`.
    Pole(f64),
    /// `1/(s^2 + c1 s + c0)`.
    Pair(f64, f64),
}

impl Stage {
    fn denominator(self) -> Polynomial {
        match self {
            Self::Lag(lag) => Polynomial::new(&[1.0, lag]),
            Self::Pole(pole) => Polynomial::new(&[pole, 1.0]),
            Self::Pair(c1, c0) => Polynomial::new(&[c0, c1, 1.0]),
        }
    }

    /// The stage in another unit of time, up to its gain.
    fn in_unit(self, unit_s: f64) -> Self {
        match self {
            Self::Lag(lag_s) => Self::Lag(lag_s / unit_s),
            Self::Pole(pole) => Self::Pole(pole * unit_s),
            Self::Pair(c1, c0) => Self::Pair(c1 * unit_s, c0 * unit_s * unit_s),
        }
    }

    /// Power of time in the unit of the gain of the stage.
    fn powers_of_time(self) -> i32 {
        match self {
            Self::Lag(_) => 0,
            Self::Pole(_) => 1,
            Self::Pair(..) => 2,
        }
    }

    /// Time constants, the longer one first. Infinite for an integrator and for an unstable pole, which a loop must cross as fast as
    /// an integrator; zero for a missing second one.
    pub(crate) fn times(self) -> [f64; 2] {
        match self {
            Self::Lag(lag) => [lag, 0.0],
            Self::Pole(pole) => [1.0 / pole.max(0.0), 0.0],
            Self::Pair(c1, c0) if c1 * c1 > 4.0 * c0 => {
                let larger = 0.5 * (c1 + (c1 * c1 - 4.0 * c0).sqrt());
                [larger / c0, 1.0 / larger]
            }
            Self::Pair(_, c0) => [1.0 / c0.sqrt(); 2],
        }
    }

    /// Number of poles right of the imaginary axis.
    fn unstable_poles(self) -> usize {
        match self {
            Self::Lag(lag) => usize::from(lag <= 0.0),
            Self::Pole(pole) => usize::from(pole < 0.0),
            Self::Pair(_, c0) if c0 < 0.0 => 1,
            Self::Pair(c1, _) => 2 * usize::from(c1 < 0.0),
        }
    }
}

/// A pole below this, times the dead time and the lags, is an integrator: a loop crosses at some tenths.
pub(crate) const SLOWEST_POLE: f64 = 1e-6;

/// The stages with integrators in place of poles that are slower than any loop.
fn with_integrators(list: &[Stage], tau_s: f64) -> Vec<Stage> {
    let lag_s = |stage: &Stage| match stage {
        Stage::Lag(lag_s) => *lag_s,
        Stage::Pole(_) | Stage::Pair(..) => 0.0,
    };
    let fast_s = tau_s + list.iter().map(lag_s).sum::<f64>();
    let is_slow = |pole: f64| fast_s > 0.0 && pole.abs() * fast_s < SLOWEST_POLE;
    let integrator = |stage: &Stage| match *stage {
        Stage::Pole(pole) if is_slow(pole) => Stage::Pole(0.0),
        other => other,
    };
    list.iter().map(integrator).collect()
}

/// Process with the known filters of the measurement, in its own units. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Process {
    stages: [Stage; 6],
    count: usize,
    /// Dead time, that of sampling included.
    pub tau: f64,
    /// Filters of the measurement, in series.
    pub sensors: [Option<LowPass>; 2],
    /// Filter of the derivative term.
    pub derivative_filter: Option<LowPass>,
    /// Unit of time (s).
    pub unit_s: f64,
    /// Gain of the process in this unit of time, with its sign (output unit / input unit).
    pub gain: f64,
}

impl Process {
    /// Process of `model` with the filters and the sampling of `execution`. `None` if a parameter is not finite, or so
    /// large or small that a unit overflows.
    pub(crate) fn new(model: &Linear, execution: &Execution) -> Option<Self> {
        let stages = model.structure().stages();
        let mut list = Vec::with_capacity(6);
        list.extend(model.lags_s().iter().map(|&lag_s| Stage::Lag(lag_s)));
        list.extend((stages.poles > 0).then(|| Stage::Pole(model.pole_per_s())));
        let [c1, c0] = model.pair();
        list.extend((stages.pairs > 0).then(|| {
            let damped = 2.0 * LEAST_DAMPING_RATIO * c0.max(0.0).sqrt();
            Stage::Pair(if c1 >= 0.0 { c1.max(damped) } else { c1 }, c0)
        }));
        list.extend(std::iter::repeat_n(Stage::Pole(0.0), stages.integrators));
        Self::of_stages(model.gain(), &list, model.tau_s(), execution)
    }

    /// Process of at most six stages, gain `gain` in front of them. `None` as for [`Self::new`].
    pub(crate) fn of_stages(
        gain: f64,
        list: &[Stage],
        tau_s: f64,
        execution: &Execution,
    ) -> Option<Self> {
        let is_valid = tau_s >= 0.0 && execution.is_valid();
        let tau_s = execution.loop_dead_time_s(tau_s);
        let list = with_integrators(list, tau_s);
        let finite_times = list.iter().flat_map(|stage| stage.times());
        let lags_s: f64 = finite_times.filter(|time| time.is_finite()).sum();
        let sum_s = tau_s + lags_s;
        let unit_s = if sum_s > 0.0 { sum_s } else { 1.0 };
        let powers: i32 = list.iter().map(|stage| stage.powers_of_time()).sum();
        let mut stages = [Stage::Pole(0.0); 6];
        for (to, from) in stages.iter_mut().zip(&list) {
            *to = from.in_unit(unit_s);
        }
        let built = Self {
            stages,
            count: list.len().min(6),
            tau: tau_s / unit_s,
            sensors: (execution.measurement_filters())
                .map(|filter| filter.map(|filter| filter.in_unit(unit_s))),
            derivative_filter: (execution.derivative_filter).map(|filter| filter.in_unit(unit_s)),
            unit_s,
            gain: gain * unit_s.powi(powers),
        };
        let denominator = built.denominator();
        let in_range = unit_s.is_normal()
            && built.gain.is_normal()
            && is_valid
            && (denominator.coefficients().iter()).all(|c| c.is_finite())
            && denominator.degree() > 0;
        in_range.then_some(built)
    }

    /// The same process in another unit of time.
    pub(crate) fn in_unit(&self, unit_s: f64) -> Self {
        let ratio = unit_s / self.unit_s;
        let powers: i32 = self
            .stages()
            .iter()
            .map(|stage| stage.powers_of_time())
            .sum();
        Self {
            stages: self.stages.map(|stage| stage.in_unit(ratio)),
            tau: self.tau / ratio,
            sensors: (self.sensors).map(|filter| filter.map(|filter| filter.in_unit(ratio))),
            derivative_filter: self.derivative_filter.map(|filter| filter.in_unit(ratio)),
            unit_s,
            gain: self.gain * ratio.powi(powers),
            ..*self
        }
    }

    /// The stages in the order that the input passes them.
    pub(crate) fn stages(&self) -> &[Stage] {
        &self.stages[..self.count]
    }

    /// The rate of the output: the process without its last integrator. `None` if the last stage is no integrator.
    pub(crate) fn rate(&self) -> Option<Self> {
        let (last, rest) = self.stages().split_last()?;
        (*last == Stage::Pole(0.0) && !rest.is_empty()).then(|| Self {
            count: self.count - 1,
            ..*self
        })
    }

    /// Denominator of the process alone.
    pub(crate) fn stage_denominator(&self) -> Polynomial {
        (self.stages().iter()).fold(Polynomial::new(&[1.0]), |product, stage| {
            product.times(&stage.denominator())
        })
    }

    /// Denominator of the process and of the filters of the measurement.
    pub(crate) fn denominator(&self) -> Polynomial {
        (self.sensors.iter().flatten()).fold(self.stage_denominator(), |product, filter| {
            product.times(&Polynomial::new(&filter.denominator()))
        })
    }

    /// Number of integrators.
    pub(crate) fn integrators(&self) -> usize {
        (self.denominator().coefficients().iter())
            .take_while(|c| **c == 0.0)
            .count()
    }

    /// Number of poles right of the imaginary axis.
    pub(crate) fn unstable_poles(&self) -> usize {
        let poles = self.stages().iter().map(|stage| stage.unstable_poles());
        poles.sum()
    }

    /// Whether the process has no pole right of the imaginary axis.
    pub(crate) fn is_stable(&self) -> bool {
        self.unstable_poles() == 0
    }

    /// Time constants of stages and filters, the longest first; infinite for integrators.
    pub(crate) fn times(&self) -> Vec<f64> {
        let filters = self
            .sensors
            .iter()
            .flatten()
            .flat_map(|filter| match filter {
                LowPass::FirstOrder(time) => [*time, 0.0],
                LowPass::SecondOrder(time) => [0.5 * time; 2],
            });
        let stages = self.stages().iter().flat_map(|stage| stage.times());
        let mut times: Vec<f64> = stages.chain(filters).filter(|time| *time > 0.0).collect();
        times.sort_by(|a, b| b.total_cmp(a));
        times
    }

    /// Dead time of a model with `order` time constants by Skogestad's half rule: the dead time, half of the longest
    /// time constant left out, and the others left out.
    pub(crate) fn half_rule_dead_time(&self, order: usize) -> f64 {
        let times = self.times();
        let left_out = times.get(order..).unwrap_or_default();
        let half = left_out.first().map_or(0.0, |first| 0.5 * first);
        self.tau + half + left_out.iter().skip(1).sum::<f64>()
    }

    /// Frequency and damping ratio of a resonance with damping ratio below 1.
    pub(crate) fn resonance(&self) -> Option<(f64, f64)> {
        self.stages().iter().find_map(|stage| match *stage {
            Stage::Pair(c1, c0) if c0 > 0.0 && c1 * c1 < 4.0 * c0 => {
                Some((c0.sqrt(), 0.5 * c1 / c0.sqrt()))
            }
            _ => None,
        })
    }
}
