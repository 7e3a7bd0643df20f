//! Classes: the members of a grid, each with its controller, at a gain that follows from the cycle.
//!
//! A class is a shape; its gain `K` follows from what is measured ([`Measured`]). Costs follow the
//! paper's equation 8: `J_k = (J(C_k, G) - J(C, G)) / J(C, G)` of the class's controller on the true
//! process `G`, whose own controller `C` is the best one at exactly 20 degrees of margin, as the
//! class's is for its own process.
//!
//! At a fixed margin `J` alone can be negative, bought with margin. The minimised cost is
//!
//! ```text
//! cost = max(J, 0) + 0.012 per degree of margin below 20
//! ```

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use onecycle_onboard::{Pd, Soiptd};

use super::ClassifierError;
use super::harmonic::{Harmonics, Response};
use crate::experiments::SampledCycle;
use crate::learn::train::Matrix;
use crate::space::grid::Grid;
use crate::space::limit_cycle::symmetric;
use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::deterioration::{Deterioration, deterioration};
use onecycle_design::soiptd_pd::margins::margins;
use onecycle_design::soiptd_pd::optimum::{Optimum, pd_at_phase_margin};

/// Cost of a degree of lost margin: on (0.3, 2, 0.1) s the best PD at 15 degrees is 6.0 % cheaper than
/// at 20 degrees, a fifth of that for each degree.
const COST_OF_A_DEGREE: f64 = 0.012;

/// Cost above which the margin is not computed: ten times that of neighbouring classes.
const HIGH_COST: f64 = 1.0;

/// How the gain of a class is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gain {
    /// From the harmonics of both signals.
    #[default]
    Harmonics,
    /// From the amplitude, relative to the amplitude of the class's own limit cycle: the paper's way.
    Amplitude,
    /// From the amplitude, by the describing function of the relay at its phase.
    DescribingFunction,
    /// Matched: the class has the magnitude of the true process at the phase of the relay, as nothing measured says. The way
    /// of the authors' published code, whose J has no error of the gain.
    Matched,
}

impl Gain {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Harmonics,
        Self::Amplitude,
        Self::DescribingFunction,
        Self::Matched,
    ];
}

/// Cost of a class that is not the true one, for labels and losses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Price {
    /// `max(J, 0)`, and the lost margin.
    #[default]
    WithMargin,
    /// `J` with its sign, as in the authors' published code: a controller with less margin than asked may be cheaper.
    Ratio,
}

/// What a cycle says about the gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The harmonics of both signals.
    Harmonics(Harmonics),
    /// Half the peak-to-peak output (output unit) for a relay amplitude of one.
    Amplitude(f64),
}

impl Measured {
    /// Half the peak-to-peak output of a cycle.
    #[must_use]
    pub fn amplitude_of(cycle: &SampledCycle) -> Self {
        let (low, high) = (cycle.output.iter())
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &value| {
                (low.min(value), high.max(value))
            });
        Self::Amplitude(0.5 * f64::from(high - low))
    }

    /// What a cycle under a relay with this `beta` says about the gain; `None` if it has no harmonics, and for
    /// [`Gain::Matched`].
    #[must_use]
    pub fn of(gain: Gain, cycle: &SampledCycle, beta: f64) -> Option<Self> {
        match (gain, Self::amplitude_of(cycle)) {
            (Gain::Harmonics, _) => Harmonics::of(cycle, beta).map(Self::Harmonics),
            (Gain::DescribingFunction, Self::Amplitude(amplitude)) => Some(Self::alone(Response {
                omega_rad_per_s: TAU / (cycle.output.len() as f64 * cycle.sample_s),
                magnitude: FRAC_PI_4 * amplitude,
                phase_rad: beta.asin() - PI,
            })),
            (Gain::Amplitude, amplitude) => Some(amplitude),
            _ => None,
        }
    }

    /// What [`Gain::Matched`] takes from the true process under a relay with this `beta`; `None` without that phase.
    #[must_use]
    pub fn matched(truth: &Soiptd, beta: f64) -> Option<Self> {
        let omega_rad_per_s = truth.frequency_at_phase(beta.asin() - PI)?;
        Some(Self::alone(Response::of(truth, omega_rad_per_s)))
    }

    fn alone(first: Response) -> Self {
        Self::Harmonics(Harmonics {
            first,
            second: None,
        })
    }
}

/// A class, with a velocity gain of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Class {
    /// The process.
    pub process: Soiptd,
    /// The best PD at the margin of the space.
    pub pd: Pd,
    /// Amplitude of the limit cycle without bias under a relay of amplitude one (output unit).
    pub amplitude: f64,
    /// Period of the limit cycle (s).
    pub period_s: f64,
}

/// All classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Classes {
    classes: Vec<Class>,
    phase_margin_rad: f64,
    price: Price,
    /// Row `i`, column `k`: cost of the controller of `i` on `k`.
    matrix: Matrix,
}

/// A true process with its optimal controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueProcess {
    /// The process.
    pub process: Soiptd,
    /// The best PD at the margin of the space.
    pub best: Optimum,
}

impl Class {
    /// The class with these times, `T_prop`, `T_body`, `tau` (s).
    ///
    /// # Errors
    /// [`ClassifierError`]: it has no controller or does not oscillate.
    pub fn new(
        times_s: [f64; 3],
        phase_margin_rad: f64,
        beta: f64,
    ) -> Result<Self, ClassifierError> {
        let [t_prop_s, t_body_s, tau_s] = times_s;
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let cycle = symmetric(&process, beta).ok_or(ClassifierError::NoOscillation(times_s))?;
        Ok(Self {
            process,
            pd: pd_at_phase_margin(&process, phase_margin_rad)?.pd,
            amplitude: cycle.amplitude,
            period_s: cycle.period_s(),
        })
    }

    /// What the class's own cycle without noise and bias says about its gain; exact.
    fn quiet(&self) -> Measured {
        let omega_rad_per_s = TAU / self.period_s;
        Measured::alone(Response::of(&self.process, omega_rad_per_s))
    }

    /// Velocity gain of the class for a measured cycle.
    #[must_use]
    pub fn gain(&self, measured: &Measured) -> f64 {
        match measured {
            Measured::Harmonics(harmonics) => {
                let first = &harmonics.first;
                harmonics.gain(&self.process, first.omega_rad_per_s)
            }
            Measured::Amplitude(amplitude) => amplitude / self.amplitude,
        }
    }

    /// Controller of the class at that gain.
    #[must_use]
    pub fn controller(&self, measured: &Measured) -> Pd {
        let gain = self.gain(measured);
        Pd {
            kp: self.pd.kp / gain,
            kd: self.pd.kd / gain,
        }
    }
}

impl TrueProcess {
    /// A true process and its best PD at a margin.
    ///
    /// # Errors
    /// [`ClassifierError`]: the process has no such controller.
    pub fn new(process: Soiptd, phase_margin_rad: f64) -> Result<Self, ClassifierError> {
        Ok(Self {
            best: pd_at_phase_margin(&process, phase_margin_rad)?,
            process,
        })
    }

    /// Cost of a controller on this process.
    #[must_use]
    pub fn judge(&self, controller: Pd) -> Deterioration {
        deterioration(controller, &self.process, &self.best)
    }

    /// The cost that the choice of a class minimises; infinite if unstable.
    #[must_use]
    pub fn cost(&self, controller: Pd) -> f64 {
        let Some(cost) = ise(&self.process, controller) else {
            return f64::INFINITY;
        };
        let relative = (cost - self.best.ise) / self.best.ise;
        if relative > HIGH_COST {
            return relative;
        }
        let asked_rad = self.best.margins.phase_margin_rad;
        let lost_deg = margins(&self.process, controller).map_or(f64::INFINITY, |left| {
            (asked_rad - left.phase_margin_rad).to_degrees().max(0.0)
        });
        relative.max(0.0) + COST_OF_A_DEGREE * lost_deg
    }

    /// `J` with its sign; infinite if unstable.
    #[must_use]
    pub fn ratio(&self, controller: Pd) -> f64 {
        ise(&self.process, controller).map_or(f64::INFINITY, |cost| cost / self.best.ise - 1.0)
    }
}

impl Classes {
    /// The classes of a grid, with costs [`Price::WithMargin`].
    ///
    /// # Errors
    /// As [`Self::priced`].
    pub fn of(grid: &Grid) -> Result<Self, ClassifierError> {
        Self::priced(grid, Price::default())
    }

    /// The classes of a grid.
    ///
    /// # Errors
    /// [`ClassifierError`]: a member has no controller or does not oscillate.
    pub fn priced(grid: &Grid, price: Price) -> Result<Self, ClassifierError> {
        let space = &grid.settings.space;
        let phase_margin_rad = space.phase_margin_rad();
        let classes = (grid.members.iter())
            .map(|member| Class::new(member.candidate.times_s(), phase_margin_rad, space.beta))
            .collect::<Result<Vec<_>, _>>()?;
        let mut this = Self {
            matrix: Matrix::zeros(classes.len(), classes.len()),
            phase_margin_rad,
            price,
            classes,
        };
        for k in 0..this.len() {
            let on = this.classes[k];
            let truth = this.truth(on.process)?;
            for (i, cost) in this.costs(&truth, &on.quiet()).into_iter().enumerate() {
                this.matrix.row_mut(i)[k] = cost;
            }
        }
        Ok(this)
    }

    /// Number of classes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.classes.len()
    }

    /// Whether there are no classes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.classes.is_empty()
    }

    /// Class `k`; panics if there is none.
    #[must_use]
    pub fn class(&self, k: usize) -> &Class {
        &self.classes[k]
    }

    /// Row `i`, column `k`: cost of the controller of class `i` on class `k`; infinite if unstable.
    #[must_use]
    pub fn matrix(&self) -> &Matrix {
        &self.matrix
    }

    /// `T_prop`, `T_body`, `tau` of class `k` (s).
    #[must_use]
    pub fn times_s(&self, k: usize) -> [f64; 3] {
        let process = &self.classes[k].process;
        [
            process.t_prop_s(),
            process.inv_t_body_per_s().recip(),
            process.tau_s(),
        ]
    }

    /// A true process with its best controller at the margin of the classes.
    ///
    /// # Errors
    /// [`ClassifierError`]: the process has no controller.
    pub fn truth(&self, process: Soiptd) -> Result<TrueProcess, ClassifierError> {
        TrueProcess::new(process, self.phase_margin_rad)
    }

    /// Cost of the controller of every class on a process, at the gains that follow from a cycle.
    #[must_use]
    pub fn costs(&self, truth: &TrueProcess, measured: &Measured) -> Vec<f32> {
        let cost = |class: &Class| {
            let controller = class.controller(measured);
            match self.price {
                Price::WithMargin => truth.cost(controller),
                Price::Ratio => truth.ratio(controller),
            }
        };
        self.classes
            .iter()
            .map(|class| cost(class) as f32)
            .collect()
    }
}

/// The class of least cost, the first of equals.
#[must_use]
pub fn label(costs: &[f32]) -> usize {
    let mut least = 0;
    for (k, cost) in costs.iter().enumerate() {
        if *cost < costs[least] {
            least = k;
        }
    }
    least
}
