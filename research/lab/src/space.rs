//! A space of processes with the requirements on their controllers; phase, grid and certificate are
//! computed for a space (the paper's equations 3 and 11; Ayyad, Chehadeh, Awad, Zweiri 2020).
//!
//! ```toml
//! t_prop_s = [0.015, 0.3]
//! t_body_s = [0.2, 2.0]
//! tau_s = [0.0005, 0.1]
//! phase_margin_deg = 20.0   # least phase margin; default 20
//! beta = -0.73              # parameter of the relay; default -0.73
//! ```

pub mod candidate;
pub mod certificate;
pub mod grid;
pub mod limit_cycle;
pub mod phase;
pub mod surface;

use rand::{Rng, RngExt};

/// Lowest and highest value.
pub type Range = (f64, f64);

/// A box of processes, a phase margin and a relay. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Space {
    /// Lag of the actuator (s).
    #[serde(deserialize_with = "two_times")]
    pub t_prop_s: Range,
    /// Lag of the body (s).
    #[serde(deserialize_with = "two_times")]
    pub t_body_s: Range,
    /// Dead time (s).
    #[serde(deserialize_with = "two_times")]
    pub tau_s: Range,
    /// Least phase margin of a controller (degrees).
    #[serde(default = "paper_margin")]
    pub phase_margin_deg: f64,
    /// Parameter of the relay: the sine of the phase of its oscillation.
    #[serde(default = "paper_beta")]
    pub beta: f64,
}

/// Exactly two values; a tuple would accept a third.
pub(crate) fn two_times<'de, D: serde::Deserializer<'de>>(file: D) -> Result<Range, D::Error> {
    let values: Vec<f64> = serde::Deserialize::deserialize(file)?;
    match values[..] {
        [low, high] => Ok((low, high)),
        _ => Err(serde::de::Error::invalid_length(
            values.len(),
            &"two numbers, the lowest and the highest",
        )),
    }
}

fn paper_margin() -> f64 {
    Space::MULTIROTOR.phase_margin_deg
}

fn paper_beta() -> f64 {
    Space::MULTIROTOR.beta
}

/// A field of a file that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{field} must be {range}, but is {value:?}")]
pub struct FieldError {
    /// Name of the field in the file.
    pub field: &'static str,
    /// Allowed values.
    pub range: &'static str,
    /// Value of the field.
    pub value: f64,
}

/// Returns the first check that fails: a field, its allowed values, its value, and whether it is right.
pub(crate) fn first_out_of_range(
    checks: impl IntoIterator<Item = (&'static str, &'static str, f64, bool)>,
) -> Result<(), FieldError> {
    for (field, range, value, is_right) in checks {
        if !is_right {
            return Err(FieldError {
                field,
                range,
                value,
            });
        }
    }
    Ok(())
}

/// Shortest and longest time of a process (s): from electronics to the climate, and far from the limits
/// of `f64` for any power in a formula.
const TIMES_S: Range = (1e-9, 1e9);

impl Space {
    /// The paper's multirotors: its equation 3, its margin, its relay.
    pub const MULTIROTOR: Self = Self {
        t_prop_s: (0.015, 0.3),
        t_body_s: (0.2, 2.0),
        tau_s: (0.0005, 0.1),
        phase_margin_deg: 20.0,
        beta: -0.73,
    };

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        for (field, (low, high)) in [
            ("t_prop_s", self.t_prop_s),
            ("t_body_s", self.t_body_s),
            ("tau_s", self.tau_s),
        ] {
            let may_vanish = field == "tau_s";
            for value in [low, high] {
                if !((TIMES_S.0..=TIMES_S.1).contains(&value) || may_vanish && value == 0.0) {
                    return Err(FieldError {
                        field,
                        range: if may_vanish {
                            "two times, zero or 1e-9 to 1e9 s"
                        } else {
                            "two times, 1e-9 to 1e9 s"
                        },
                        value,
                    });
                }
            }
            if high < low {
                return Err(FieldError {
                    field,
                    range: "the lower time first",
                    value: low,
                });
            }
        }
        first_out_of_range([
            (
                "phase_margin_deg",
                "1 to 80",
                self.phase_margin_deg,
                (1.0..=80.0).contains(&self.phase_margin_deg),
            ),
            (
                "beta",
                "-0.95 to 0.95",
                self.beta,
                (-0.95..=0.95).contains(&self.beta),
            ),
        ])
    }

    /// Least phase margin of a controller (rad).
    #[must_use]
    pub fn phase_margin_rad(&self) -> f64 {
        self.phase_margin_deg.to_radians()
    }

    /// The ranges of `T_prop`, `T_body` and `tau` (s).
    #[must_use]
    pub fn ranges_s(&self) -> [Range; 3] {
        [self.t_prop_s, self.t_body_s, self.tau_s]
    }

    /// Random `T_prop`, `T_body` and `tau` (s), uniform in the box.
    pub fn random(&self, rng: &mut impl Rng) -> [f64; 3] {
        self.ranges_s()
            .map(|(low, high)| rng.random_range(low..=high))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn errors_name_the_field() {
        assert_eq!(Space::MULTIROTOR.validate(), Ok(()));
        type Spoil = fn(&mut Space);
        let spoilt: [(Spoil, &str); 7] = [
            (|s| s.t_prop_s.0 = 0.0, "t_prop_s"),
            (|s| s.t_body_s.1 = f64::INFINITY, "t_body_s"),
            (|s| s.tau_s.0 = -1.0, "tau_s"),
            (|s| s.tau_s = (0.1, 0.05), "tau_s"),
            (|s| s.t_prop_s.1 = f64::NAN, "t_prop_s"),
            (|s| s.phase_margin_deg = 90.0, "phase_margin_deg"),
            (|s| s.beta = -1.0, "beta"),
        ];
        for (spoil, field) in spoilt {
            let mut space = Space::MULTIROTOR;
            spoil(&mut space);
            let error = space.validate().unwrap_err();
            assert_eq!(error.field, field);
            assert!(error.to_string().starts_with(field), "{error}");
        }
    }

    // A box may have no extent in one direction; its random processes lie in it.
    #[test]
    fn random_processes_lie_in_the_box() {
        let space = Space {
            tau_s: (0.02, 0.02),
            ..Space::MULTIROTOR
        };
        assert_eq!(space.validate(), Ok(()));
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        for _ in 0..100 {
            for (time_s, (low, high)) in space.random(&mut rng).into_iter().zip(space.ranges_s()) {
                assert!((low..=high).contains(&time_s));
            }
        }
    }
}
