//! The classes: members of a grid, each with its controller, at a gain that the cycle tells.
//!
//! A class knows its shape; its gain `K` follows from what is measured ([`Measured`]). Costs are those of the
//! paper's equation 8: `J_k = (J(C_k, G) - J(C, G)) / J(C, G)` of the class's controller on the true process
//! `G`, whose own `C` is best at exactly 20 degrees of margin, as the class's own was on its process.
//!
//! At a margin `J` alone can be negative, bought with margin. What is minimised is
//!
//! ```text
//! cost = max(J, 0) + 0.012 per degree of margin below 20
//! ```

use onecycle_onboard::{Pd, Soiptd};

use super::ClassifierError;
use super::harmonic::{Harmonics, Response};
use crate::learn::train::Matrix;
use crate::space::grid::Grid;
use crate::space::limit_cycle::symmetric;
use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::deterioration::{Deterioration, deterioration};
use onecycle_design::soiptd_pd::margins::margins;
use onecycle_design::soiptd_pd::optimum::{Optimum, pd_at_phase_margin};

/// What a degree of lost margin costs: on (0.3, 2, 0.1) s the best PD at 15 degrees is cheaper than
/// that at 20 by 6.0 %, five times this.
const COST_OF_A_DEGREE: f64 = 0.012;

/// Costs from which margins play no part any more: ten times those of neighbours.
const HIGH_COST: f64 = 1.0;

/// How a class comes to its gain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gain {
    /// From the harmonics of both signals.
    #[default]
    Harmonics,
    /// From the amplitude, against that of the class's own limit cycle: the paper's.
    Amplitude,
}

/// What a cycle tells of the gain, whatever the class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The harmonics of both signals.
    Harmonics(Harmonics),
    /// Half the difference of highest and lowest output (output unit), the relay's amplitude one.
    Amplitude(f64),
}

/// A class, its velocity gain one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Class {
    /// The process.
    pub process: Soiptd,
    /// The best PD at the margin of the space.
    pub pd: Pd,
    /// Amplitude of its limit cycle without bias under a relay of amplitude one (output unit).
    pub amplitude: f64,
    /// Period of that cycle (s).
    pub period_s: f64,
}

/// All classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Classes {
    classes: Vec<Class>,
    phase_margin_rad: f64,
    /// Row `i`, column `k`: what the controller of `i` costs on `k`.
    matrix: Matrix,
}

/// A process with the controller that others are compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueProcess {
    /// The process.
    pub process: Soiptd,
    /// Its best PD at the margin of the space.
    pub best: Optimum,
}

impl Class {
    fn new(times_s: [f64; 3], phase_margin_rad: f64, beta: f64) -> Result<Self, ClassifierError> {
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

    /// Its velocity gain.
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

    /// Its controller at that gain.
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
    /// Of a process at a margin.
    ///
    /// # Errors
    /// Where it has no such controller.
    pub fn new(process: Soiptd, phase_margin_rad: f64) -> Result<Self, ClassifierError> {
        Ok(Self {
            best: pd_at_phase_margin(&process, phase_margin_rad)?,
            process,
        })
    }

    /// What a controller costs here.
    #[must_use]
    pub fn judge(&self, controller: Pd) -> Deterioration {
        deterioration(controller, &self.process, &self.best)
    }

    /// What is minimised, infinite where unstable.
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
}

impl Classes {
    /// The members of a grid.
    ///
    /// # Errors
    /// Where one has no controller or does not oscillate.
    pub fn of(grid: &Grid) -> Result<Self, ClassifierError> {
        let space = &grid.settings.space;
        let phase_margin_rad = space.phase_margin_rad();
        let classes = (grid.members.iter())
            .map(|member| Class::new(member.candidate.times_s(), phase_margin_rad, space.beta))
            .collect::<Result<Vec<_>, _>>()?;
        let mut this = Self {
            matrix: Matrix::zeros(classes.len(), classes.len()),
            phase_margin_rad,
            classes,
        };
        for k in 0..this.len() {
            let on = this.classes[k];
            let truth = this.truth(on.process)?;
            // Without noise and bias the class's own cycle says this, exactly.
            let omega_rad_per_s = std::f64::consts::TAU / on.period_s;
            let measured = Measured::Harmonics(Harmonics {
                first: Response::of(&on.process, omega_rad_per_s),
                second: None,
            });
            for (i, cost) in this.costs(&truth, &measured).into_iter().enumerate() {
                this.matrix.row_mut(i)[k] = cost;
            }
        }
        Ok(this)
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.classes.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.classes.is_empty()
    }

    /// Class `k` of those there are.
    #[must_use]
    pub fn class(&self, k: usize) -> &Class {
        &self.classes[k]
    }

    /// Row `i`, column `k`: what the controller of class `i` costs on class `k`, infinite where it
    /// is unstable.
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

    /// A process beside its best controller at the margin of the classes.
    ///
    /// # Errors
    /// Where it has none.
    pub fn truth(&self, process: Soiptd) -> Result<TrueProcess, ClassifierError> {
        TrueProcess::new(process, self.phase_margin_rad)
    }

    /// What the controller of every class costs on a process, at the gains that a cycle tells.
    #[must_use]
    pub fn costs(&self, truth: &TrueProcess, measured: &Measured) -> Vec<f32> {
        let costs = (self.classes.iter()).map(|class| truth.cost(class.controller(measured)));
        costs.map(|cost| cost as f32).collect()
    }
}

/// The class of least cost, the first where several cost as little.
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
