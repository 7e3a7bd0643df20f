//! The answer with which every surface begins: what to do, what to type in, how sure it is, what comes next.

use onecycle::Assessment;
use serde::Serialize;

/// What to do about the gains of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Advice {
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
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Answer {
    pub(crate) verdict: Advice,
    /// Why, one clause.
    pub(crate) reason: String,
    /// Share of the way to the proposed gains at which the middle column stands. `None`: nothing is proposed.
    pub(crate) step: Option<f64>,
    /// Under the names and in the units in which they are typed in. Empty without a proposal.
    pub(crate) gains: Vec<Gain>,
    /// Figures of the loop with these gains.
    pub(crate) figures: Option<Columns>,
    /// How well the process is known, one sentence.
    pub(crate) sure: Option<String>,
    /// The remark that matters most.
    pub(crate) watch: Option<String>,
    /// What to do next.
    pub(crate) next: String,
}

impl Answer {
    /// Nothing to type in, for this reason.
    pub(crate) fn not_yet(reason: String) -> Self {
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
    pub(crate) fn has_now(&self) -> bool {
        self.gains.iter().any(|gain| gain.now.is_some())
    }
}

/// A gain in force, half of the way to the proposed one, and that one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Gain {
    pub(crate) name: String,
    /// Unit of the values; empty if they have none.
    pub(crate) unit: String,
    pub(crate) now: Option<f64>,
    pub(crate) half: Option<f64>,
    /// `None`: outside of the range of the firmware.
    pub(crate) full: Option<f64>,
}

/// Figures under the gains in force, half of the way, and under the proposed ones.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Columns {
    /// `None`: no gains are in force, or the loop is unstable under them.
    pub(crate) now: Option<Figures>,
    pub(crate) half: Option<Figures>,
    pub(crate) full: Figures,
}

impl Columns {
    /// The three columns, where there are some.
    pub(crate) fn all(&self) -> [Option<&Figures>; 3] {
        [self.now.as_ref(), self.half.as_ref(), Some(&self.full)]
    }
}

/// What is shown of a loop.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Figures {
    pub(crate) phase_margin_deg: f64,
    pub(crate) ms: f64,
    /// Integrated absolute error after a unit step of the load (output unit s). `None`: a constant load leaves an offset.
    pub(crate) load_iae: Option<f64>,
    pub(crate) settling_time_s: Option<f64>,
    pub(crate) overshoot: Option<f64>,
    pub(crate) noise_share: Option<f64>,
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
