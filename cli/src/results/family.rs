//! The processes that one oscillation leaves possible.

use onecycle_design::oscillation::{Family, MarginRanges, Oscillation};
use onecycle_design::rules::UltimateRule;

/// What is known of a process.
pub(crate) struct Known {
    pub(crate) oscillation: Oscillation,
    /// The rule whose gains told the oscillation.
    pub(crate) rule: Option<Rule>,
    /// Least and largest share of the dead time in the sum of dead time and lags.
    pub(crate) dead_time_share: (f64, f64),
}

/// What is known of a process, the processes that agree with it, and the margins of the chosen controller over them.
pub(crate) struct OfOscillation {
    pub(crate) known: Known,
    pub(crate) family: Family,
    /// `None` if the loop is unstable on one of them.
    pub(crate) margins: Option<MarginRanges>,
}

/// A rule by which firmware or a person computes gains from an oscillation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Ziegler-Nichols behind a relay without hysteresis, by `KU = 4H/(pi A)`.
    Marlin,
    /// The rule without overshoot behind the same relay.
    MarlinBed,
    /// Ziegler-Nichols behind a relay of 0 and full power with thresholds 5 degrees apart, by twice that `KU`.
    Klipper,
    ZieglerNichols,
    TyreusLuyben,
}

impl Rule {
    pub(crate) const ALL: [Self; 5] = [
        Self::Marlin,
        Self::MarlinBed,
        Self::Klipper,
        Self::ZieglerNichols,
        Self::TyreusLuyben,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Marlin => "marlin",
            Self::MarlinBed => "marlin-bed",
            Self::Klipper => "klipper",
            Self::ZieglerNichols => "ziegler-nichols",
            Self::TyreusLuyben => "tyreus-luyben",
        }
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }

    pub(crate) fn formula(self) -> UltimateRule {
        match self {
            Self::Marlin | Self::Klipper | Self::ZieglerNichols => UltimateRule::ZieglerNichols,
            Self::MarlinBed => UltimateRule::NoOvershoot,
            Self::TyreusLuyben => UltimateRule::TyreusLuyben,
        }
    }
}
