//! The processes that one oscillation leaves possible.

use onecycle_design::oscillation::{Family, MarginRanges, Oscillation};
use onecycle_design::rules::UltimateRule;

/// What is known of a process.
pub struct Known {
    /// An ultimate point, or a relay test.
    pub oscillation: Oscillation,
    /// The rule whose gains told the oscillation.
    pub rule: Option<Rule>,
    /// Least and largest share of the dead time in the sum of dead time and lags.
    pub dead_time_share: (f64, f64),
}

/// What is known of a process, the processes that agree with it, and the margins of the chosen controller over them.
pub struct OfOscillation {
    /// What is known.
    pub known: Known,
    /// The processes that agree with it.
    pub family: Family,
    /// `None` if the loop is unstable on one of them.
    pub margins: Option<MarginRanges>,
}

/// A rule by which firmware or a person computes gains from an oscillation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Ziegler-Nichols behind a relay without hysteresis, by `KU = 4H/(pi A)`.
    Marlin,
    /// The rule without overshoot behind the same relay.
    MarlinBed,
    /// Ziegler-Nichols behind a relay of 0 and full power with thresholds 5 degrees apart, by twice that `KU`.
    Klipper,
    /// That of Ziegler and Nichols.
    ZieglerNichols,
    /// That of Tyreus and Luyben.
    TyreusLuyben,
}

impl Rule {
    /// Every rule.
    pub const ALL: [Self; 5] = [
        Self::Marlin,
        Self::MarlinBed,
        Self::Klipper,
        Self::ZieglerNichols,
        Self::TyreusLuyben,
    ];

    /// Name of the rule.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Marlin => "marlin",
            Self::MarlinBed => "marlin-bed",
            Self::Klipper => "klipper",
            Self::ZieglerNichols => "ziegler-nichols",
            Self::TyreusLuyben => "tyreus-luyben",
        }
    }

    /// Rule of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }

    /// Full output in the unit of the gains that this rule of a firmware prints; `None` of a rule of books.
    #[must_use]
    pub fn full_output(self) -> Option<f64> {
        matches!(self, Self::Marlin | Self::MarlinBed | Self::Klipper).then_some(255.0)
    }

    /// Its formula.
    #[must_use]
    pub fn formula(self) -> UltimateRule {
        match self {
            Self::Marlin | Self::Klipper | Self::ZieglerNichols => UltimateRule::ZieglerNichols,
            Self::MarlinBed => UltimateRule::NoOvershoot,
            Self::TyreusLuyben => UltimateRule::TyreusLuyben,
        }
    }
}
