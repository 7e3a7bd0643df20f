//! The answer with which every surface begins: what to do, what to type in, how sure it is, what comes next.

use crate::Assessment;

/// What to do about the gains of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
pub enum Advice {
    /// The proposed gains are worth a change.
    Change,
    /// Nobody would feel the difference, or what would be lost is more than what would be gained.
    Keep,
    /// No gains in force are known.
    FirstGains,
    /// There is nothing to type in yet.
    NotYet,
}

/// The answer.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Answer {
    /// What to do.
    pub verdict: Advice,
    /// Why, one clause.
    pub reason: String,
    /// Share of the way to the proposed gains at which the middle column stands. `None`: nothing is proposed.
    pub step: Option<f64>,
    /// Under the names and in the units in which they are typed in. Empty without a proposal.
    pub gains: Vec<Gain>,
    /// Figures of the loop with these gains.
    pub figures: Option<Columns>,
    /// How well the process is known, one sentence.
    pub sure: Option<String>,
    /// The remark that matters most.
    pub watch: Option<String>,
    /// What to do next.
    pub next: String,
}

impl Answer {
    /// Nothing to type in, for this reason.
    #[must_use]
    pub fn not_yet(reason: String) -> Self {
        Self {
            verdict: Advice::NotYet,
            reason,
            step: None,
            gains: vec![],
            figures: None,
            sure: None,
            watch: None,
            next: String::new(),
        }
    }

    /// Whether gains in force are known.
    #[must_use]
    pub fn has_now(&self) -> bool {
        self.gains.iter().any(|gain| gain.now.is_some())
    }
}

/// A gain in force, half of the way to the proposed one, and that one.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Gain {
    /// Name under which it is typed in.
    pub name: String,
    /// Unit of the values; empty if they have none.
    pub unit: String,
    /// In force.
    pub now: Option<f64>,
    /// On the way.
    pub half: Option<f64>,
    /// `None`: outside of the range of the firmware.
    pub full: Option<f64>,
}

/// Figures under the gains in force, half of the way, and under the proposed ones.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Columns {
    /// `None`: no gains are in force, or the loop is unstable under them.
    pub now: Option<Figures>,
    /// On the way to the proposed gains.
    pub half: Option<Figures>,
    /// Under the proposed gains.
    pub full: Figures,
}

impl Columns {
    /// The three columns, where there are some.
    #[must_use]
    pub fn all(&self) -> [Option<&Figures>; 3] {
        [self.now.as_ref(), self.half.as_ref(), Some(&self.full)]
    }
}

/// What is shown of a loop.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Figures {
    /// Phase margin (deg).
    pub phase_margin_deg: f64,
    /// Maximum sensitivity.
    pub ms: f64,
    /// Integrated absolute error after a unit step of the load (output unit s). `None`: a constant load leaves an offset.
    pub load_iae: Option<f64>,
    /// Settling time after a step of the reference (s).
    pub settling_time_s: Option<f64>,
    /// Overshoot, as a share of the step.
    pub overshoot: Option<f64>,
    /// Standard deviation of the noise at the actuator, as a share of the amplitude of the input.
    pub noise_share: Option<f64>,
}

impl From<&Assessment> for Figures {
    fn from(of: &Assessment) -> Self {
        Self {
            phase_margin_deg: of.margins.phase_margin_rad.to_degrees(),
            ms: of.ms,
            load_iae: of.load_iae.filter(|iae| iae.is_finite()),
            settling_time_s: of.step.map(|step| step.settling_time_s),
            overshoot: of.step.map(|step| step.overshoot),
            noise_share: of.noise_share,
        }
    }
}
