//! Certificates: does the relay make every process of a space oscillate in exactly one stable limit
//! cycle? This is a proof by computation; the paper uses a criterion for the describing function
//! (Ayyad, Chehadeh, Awad, Zweiri 2020, section II; the "Loeb criterion").
//!
//! Time can be scaled, so one process represents its whole ray, and a patch of the surface of shapes
//! ([`Space::shapes`]) represents the space. The limit cycles of each shape and the spectral radius of
//! their Poincare map are exact; the largest radius on a lattice is the start of a climb to the worst
//! process.
//!
//! Under a bias the relay of the board differs from the bare one in two ways, and both are certified:
//! its trim cancels the bias; and without trim the side whose signal turns back before zero switches
//! later from then on, with half the lead each time.

mod summary;

use onecycle_onboard::{RelaySettings, Soiptd, SoiptdError};

use crate::space::Space;
use crate::space::limit_cycle::{LimitCycle, limit_cycles, symmetric, trimmed_spectral_radius};
use crate::space::surface::Direction;

pub use self::summary::{CertificateSummary, RelayCounts};

/// Limit cycles of one process under one bias.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// `T_prop`, `T_body`, `tau` (s).
    pub times_s: [f64; 3],
    /// Constant added to the relay's output, whose amplitude is one.
    pub bias: f64,
    /// Period (s) and amplitude (output unit, velocity gain one) by the describing function, which is
    /// without bias; `None` if it predicts no oscillation.
    pub describing_function: Option<(f64, f64)>,
    /// The exact cycle without bias.
    pub unbiased: Option<LimitCycle>,
    /// All cycles of the bare relay under the bias, the shortest first.
    pub bare: Vec<LimitCycle>,
    /// All cycles in which the side that the bias turns back leads by `2^-n` of `beta`, with `n` from
    /// one.
    pub turned_back: Vec<(u32, LimitCycle)>,
    /// Spectral radius of the cycle with the trim cancelling the bias; `None` beyond the trim's limit.
    pub trimmed: Option<f64>,
}

/// Stability of a list of limit cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CycleStability {
    /// One stable cycle.
    Stable,
    /// Two stable cycles or more: the start decides which one is reached.
    Coexisting,
    /// One cycle or more, none of them stable.
    Unstable,
    /// No cycle of two switches.
    NoCycle,
}

impl CycleStability {
    /// Stability of these cycles.
    #[must_use]
    pub fn of<'a>(cycles: impl IntoIterator<Item = &'a LimitCycle>) -> Self {
        let (mut stable, mut unstable) = (0, 0);
        for cycle in cycles {
            if cycle.is_stable() {
                stable += 1;
            } else {
                unstable += 1;
            }
        }
        match (stable, unstable) {
            (0, 0) => Self::NoCycle,
            (0, _) => Self::Unstable,
            (1, _) => Self::Stable,
            _ => Self::Coexisting,
        }
    }
}

/// Largest number of halvings of the lead; the last leaves 1/64 of it, nearly a plain relay.
const HALVINGS: u32 = 6;

impl Certificate {
    /// Computes the certificate for `T_prop`, `T_body`, `tau` (s), a relay and a bias between -1 and 1.
    ///
    /// # Errors
    /// Names the time that is out of its physical range.
    pub fn new(times_s: [f64; 3], beta: f64, bias: f64) -> Result<Self, SoiptdError> {
        let [t_prop_s, t_body_s, tau_s] = times_s;
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let halved = |n: u32| {
            let less = beta * 0.5_f64.powi(n as i32);
            if bias < 0.0 {
                [less, beta]
            } else {
                [beta, less]
            }
        };
        // Only leading relays turn back.
        let halvings = if beta < 0.0 && bias != 0.0 {
            HALVINGS
        } else {
            0
        };
        let turned_back = (1..=halvings)
            .flat_map(|n| {
                limit_cycles(&process, halved(n), bias)
                    .into_iter()
                    .map(move |cycle| (n, cycle))
            })
            .collect();
        let trim_gain = f64::from(RelaySettings::TRIM_GAIN);
        Ok(Self {
            times_s,
            bias,
            describing_function: process
                .describing_function_oscillation(1.0, beta)
                .map(|(omega, amplitude)| (std::f64::consts::TAU / omega, amplitude)),
            unbiased: symmetric(&process, beta),
            bare: limit_cycles(&process, [beta; 2], bias),
            turned_back,
            trimmed: (bias.abs() as f32 <= RelaySettings::TRIM_LIMIT)
                .then(|| trimmed_spectral_radius(&process, beta, trim_gain))
                .flatten(),
        })
    }

    /// Period and amplitude over those of the describing function, without bias.
    #[must_use]
    pub fn describing_function_ratios(&self) -> Option<(f64, f64)> {
        let (period_s, amplitude) = self.describing_function?;
        let cycle = self.unbiased?;
        Some((cycle.period_s() / period_s, cycle.amplitude / amplitude))
    }
}

/// The process of a space whose cycle without bias is the least stable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastStable {
    /// Shape of the process.
    pub shape: Direction,
    /// `T_prop`, `T_body`, `tau` (s) in the middle of its ray.
    pub times_s: [f64; 3],
    /// Spectral radius of its Poincare map; infinite without a cycle.
    pub spectral_radius: f64,
}

/// First and last step of the climb, in parts of the patch: from that of a lattice to a negligible one.
const CLIMB_STEPS: (f64, f64) = (1.0 / 32.0, 1e-6);

impl Space {
    /// Times (s) of a shape in the middle of its ray; `None` if the ray misses the space.
    #[must_use]
    pub fn middle_of_ray(&self, shape: Direction) -> Option<[f64; 3]> {
        let (low, high) = self.radius_range_s(shape)?;
        Some(shape.at((low * high).sqrt()))
    }

    /// The least stable process without bias, found by a climb from the worst point of a lattice of
    /// `rows` by `columns` shapes with decreasing steps. `None` for an empty lattice.
    #[must_use]
    pub fn least_stable(&self, rows: usize, columns: usize) -> Option<LeastStable> {
        let radius_at = |across: f64, along: f64| {
            let shape = self.shape(across, along)?;
            let times_s = self.middle_of_ray(shape)?;
            let process = Soiptd::new(1.0, times_s[0], times_s[1], times_s[2]).ok()?;
            let spectral_radius =
                symmetric(&process, self.beta).map_or(f64::INFINITY, |cycle| cycle.spectral_radius);
            Some(LeastStable {
                shape,
                times_s,
                spectral_radius,
            })
        };
        let point = |k: usize, count: usize| k as f64 / (count.max(2) - 1) as f64;
        let (mut across, mut along, mut worst) = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (row, column)))
            .filter_map(|(row, column)| {
                let (across, along) = (point(row, rows), point(column, columns));
                Some((across, along, radius_at(across, along)?))
            })
            .max_by(|a, b| a.2.spectral_radius.total_cmp(&b.2.spectral_radius))?;
        let mut step = CLIMB_STEPS.0;
        while step > CLIMB_STEPS.1 {
            let better = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)]
                .map(|(a, b)| ((across + a).clamp(0.0, 1.0), (along + b).clamp(0.0, 1.0)))
                .into_iter()
                .filter_map(|(a, b)| Some((a, b, radius_at(a, b)?)))
                .find(|(.., found)| found.spectral_radius > worst.spectral_radius);
            match better {
                Some(found) => (across, along, worst) = found,
                None => step *= 0.5,
            }
        }
        Some(worst)
    }
}
