//! Actuators that do not do what they are told: nonlinearities between the command and the process, exact for a command
//! that is held from sample to sample.
//!
//! | actuator | position `v` for the command `u` |
//! |----------|----------------------------------|
//! | [`Actuator::DeadZone`] | `u` less the part of it inside the zone |
//! | [`Actuator::Saturation`] | `u` within the limits |
//! | [`Actuator::Backlash`] | follows `u` at the distance of half the gap |
//! | [`Actuator::Sticking`] | stays until `u` is further away than the band, then jumps to `u` |
//! | [`Actuator::StickSlip`] | the same, but stops half a band short of `u` |
//!
//! Reference: M. A. A. S. Choudhury, N. F. Thornhill, S. L. Shah, "Modelling valve stiction", Control Eng. Practice 13
//! (2005), for the band and the jump.

/// An actuator and its strength, in input units. See the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Actuator {
    /// Does what it is told.
    #[default]
    Ideal,
    /// Small commands have no effect.
    DeadZone {
        /// Half the width of the zone.
        half_width: f64,
    },
    /// The position is limited.
    Saturation {
        /// Lowest position.
        low: f64,
        /// Highest position.
        high: f64,
    },
    /// Gap between drive and load.
    Backlash {
        /// Half the gap.
        half_width: f64,
    },
    /// A valve that sticks, then jumps to the command.
    Sticking {
        /// Largest distance to the command at which it stays.
        band: f64,
    },
    /// A valve that sticks, then moves and stops before it reaches the command.
    StickSlip {
        /// Largest distance to the command at which it stays.
        band: f64,
    },
}

impl Actuator {
    /// Position under a held command, from the position before.
    #[must_use]
    pub fn position(&self, before: f64, command: f64) -> f64 {
        match *self {
            Self::Ideal => command,
            Self::DeadZone { half_width } => command - command.clamp(-half_width, half_width),
            Self::Saturation { low, high } => command.max(low).min(high),
            Self::Backlash { half_width } => {
                before.max(command - half_width).min(command + half_width)
            }
            Self::Sticking { band } | Self::StickSlip { band }
                if (command - before).abs() <= band =>
            {
                before
            }
            Self::Sticking { .. } => command,
            Self::StickSlip { band } => command - 0.5 * band.copysign(command - before),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positions(actuator: Actuator, commands: [f64; 5]) -> [f64; 5] {
        let mut at = 0.0;
        commands.map(|command| {
            at = actuator.position(at, command);
            at
        })
    }

    #[test]
    fn positions_by_hand() {
        let commands = [0.25, 1.0, 0.75, -0.5, -1.0];
        let of = |actuator| positions(actuator, commands);
        assert_eq!(of(Actuator::Ideal), commands);
        let zone = Actuator::DeadZone { half_width: 0.5 };
        assert_eq!(of(zone), [0.0, 0.5, 0.25, 0.0, -0.5]);
        let limits = Actuator::Saturation {
            low: -0.75,
            high: f64::INFINITY,
        };
        assert_eq!(of(limits), [0.25, 1.0, 0.75, -0.5, -0.75]);
        let gap = Actuator::Backlash { half_width: 0.5 };
        assert_eq!(of(gap), [0.0, 0.5, 0.5, 0.0, -0.5]);
        let sticking = Actuator::Sticking { band: 0.5 };
        assert_eq!(of(sticking), [0.0, 1.0, 1.0, -0.5, -0.5]);
        let slip = Actuator::StickSlip { band: 0.5 };
        assert_eq!(of(slip), [0.0, 0.75, 0.75, -0.25, -0.75]);
    }
}
