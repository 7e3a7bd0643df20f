//! Defects: what makes a process one that the identifier must not take for an integrator with two lags
//! and a delay.
//!
//! An out-of-family process is a random process of a space with one defect of random strength. Strengths
//! count in the period `T` and the amplitude `a` of the oscillation without the defect, and in the relay's
//! amplitude `h`:
//!
//! | kind             | defect                                                 | strength                       |
//! |------------------|--------------------------------------------------------|--------------------------------|
//! | `resonance`      | a second mass, measured itself or hung on the measured one | at 1.5..10 / T, damping ratio 1..5 % |
//! | `extra_lag`      | a third lag                                            | 1..3 `T_prop`                  |
//! | `second_delay`   | part of the input arrives later                        | 30..70 %, by 0.1..0.5 T        |
//! | `long_delay`     | all of the input arrives later                         | by 0.2..1 T                    |
//! | `clipping`       | the sensor saturates                                   | at 0.4..0.85 a                 |
//! | `rate_limit`     | the input has a limited rate                           | from -h to h in 0.1..0.5 T     |
//! | `dead_zone`      | a small force has no effect                            | up to 0.1..0.4 h               |
//! | `friction`       | Coulomb friction of the body                           | 0.05..0.4 h                    |
//! | `play`           | backlash in front of the sensor                        | 0.1..0.4 a                     |
//! | `rate_sensor`    | the sensor measures the rate, not the position         |                                |
//! | `slow_sensor`    | a lag of the sensor                                    | 0.1..0.5 T                     |
//! | `tone`           | a foreign sinusoid in the measurement                  | 0.1..0.4 a, at 0.2..5 / T      |
//! | `other_cycle`    | a limit cycle that the input does not drive, which the relay only follows | van der Pol's, or that of a loop with three lags |
//! | `asymmetric_lag` | the actuator is slower downwards than upwards          | 1.5..3 `T_prop` downwards      |
//! | `drag`           | damping by the square of the rate                      | 0.1..0.5 h at the oscillation's rate |
//! | `thrust`         | curved characteristic of the actuator, `f + c f^2 / h` | c of 0.1..0.4                  |
//!
//! A dead zone in front of the actuator's lag is left out: under a relay it acts as a smaller relay
//! amplitude, and no experiment with two levels can tell the two apart.

pub mod plant;

use std::f64::consts::TAU;

use num_complex::Complex64;
use onecycle_onboard::Soiptd;
use onecycle_plant::{NoiseSource, Sensor};
use rand::{Rng, RngExt};

use super::oscillation::Oscillation;

/// Kinds of defects. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DefectKind {
    /// No defect: a process of the family.
    InFamily,
    /// A second mass on a spring.
    Resonance,
    /// A third lag.
    ExtraLag,
    /// Part of the input arrives later.
    SecondDelay,
    /// All of the input arrives later.
    LongDelay,
    /// The sensor saturates.
    Clipping,
    /// The input has a limited rate.
    RateLimit,
    /// Small forces have no effect.
    DeadZone,
    /// Coulomb friction.
    Friction,
    /// Backlash in front of the sensor.
    Play,
    /// The sensor measures the rate.
    RateSensor,
    /// The sensor has a lag.
    SlowSensor,
    /// A foreign sinusoid in the measurement.
    Tone,
    /// A limit cycle that the input does not drive.
    OtherCycle,
    /// The actuator is slower downwards than upwards.
    AsymmetricLag,
    /// Damping by the square of the rate.
    Drag,
    /// Curved characteristic of the actuator.
    Thrust,
}

impl DefectKind {
    /// The kinds of [`Measure::Unknown`](super::Measure::Unknown): all that took a process out of the family before the
    /// estimators had forces of their own for drag and thrust.
    pub const OUTSIDE: [Self; 13] = [
        Self::Resonance,
        Self::ExtraLag,
        Self::SecondDelay,
        Self::LongDelay,
        Self::Clipping,
        Self::RateLimit,
        Self::DeadZone,
        Self::Friction,
        Self::Play,
        Self::RateSensor,
        Self::SlowSensor,
        Self::Tone,
        Self::OtherCycle,
    ];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::InFamily => "in_family",
            Self::Resonance => "resonance",
            Self::ExtraLag => "extra_lag",
            Self::SecondDelay => "second_delay",
            Self::LongDelay => "long_delay",
            Self::Clipping => "clipping",
            Self::RateLimit => "rate_limit",
            Self::DeadZone => "dead_zone",
            Self::Friction => "friction",
            Self::Play => "play",
            Self::RateSensor => "rate_sensor",
            Self::SlowSensor => "slow_sensor",
            Self::Tone => "tone",
            Self::OtherCycle => "other_cycle",
            Self::AsymmetricLag => "asymmetric_lag",
            Self::Drag => "drag",
            Self::Thrust => "thrust",
        }
    }
}

/// A defect and its strength. The relay's amplitude is one input unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Defect {
    /// No defect.
    None,
    /// A second mass on a spring.
    Resonance {
        /// Frequency of the second mass (rad/s).
        rad_per_s: f64,
        /// Damping ratio.
        damping: f64,
        /// Second mass over the body's mass if the body is measured; zero if the second mass is measured.
        mass_ratio: f64,
    },
    /// A third lag.
    ExtraLag {
        /// Time constant (s).
        lag_s: f64,
    },
    /// Part of the input arrives later.
    SecondPath {
        /// Share of the input, 0 to 1.
        share: f64,
        /// Additional delay (s).
        delay_s: f64,
    },
    /// The sensor saturates.
    Clipping {
        /// Largest reading, either sign (output unit).
        limit: f64,
    },
    /// The input has a limited rate.
    RateLimit {
        /// Largest rate (input unit / s).
        per_s: f64,
    },
    /// Forces inside the dead zone have no effect.
    DeadZone {
        /// Half the width of the zone (input unit).
        half_width: f64,
    },
    /// Coulomb friction.
    Friction {
        /// Friction force (input unit).
        force: f64,
    },
    /// Backlash in front of the sensor.
    Play {
        /// Half the backlash (output unit).
        half_width: f64,
    },
    /// The sensor measures the rate.
    RateSensor,
    /// The sensor has a lag.
    SlowSensor {
        /// Time constant (s).
        lag_s: f64,
    },
    /// A foreign sinusoid in the measurement, from the end of the pre-roll on.
    Tone {
        /// Amplitude (output unit).
        amplitude: f64,
        /// Frequency (rad/s).
        rad_per_s: f64,
        /// Phase at time zero (rad).
        phase_rad: f64,
    },
    /// The oscillator of van der Pol.
    VanDerPol {
        /// Amplitude (output unit).
        amplitude: f64,
        /// Frequency in the limit of no bend (rad/s).
        rad_per_s: f64,
        /// Distance from a harmonic oscillation; the frequency falls with it.
        bend: f64,
    },
    /// A loop of three equal lags and a proportional-integral controller with a limit, unstable.
    OtherLoop {
        /// Limit of the controller (output unit).
        amplitude: f64,
        /// Time constant of each lag (s).
        lag_s: f64,
        /// Proportional gain; the loop is unstable above 8.
        proportional: f64,
        /// Integral gain per lag.
        integral: f64,
    },
    /// The actuator is slower downwards than upwards.
    AsymmetricLag {
        /// Time constant of a falling force (s); a rising one has `T_prop`.
        falling_s: f64,
    },
    /// Damping by the square of the rate.
    Drag {
        /// Force (input unit) at the rate below.
        force: f64,
        /// Rate (output unit / s).
        rate: f64,
    },
    /// Curved characteristic of the actuator: the force `f` acts as `f + curvature f^2`.
    Thrust {
        /// Curvature (1 / input unit).
        curvature: f64,
    },
}

impl Defect {
    /// A random defect of a kind; `process` and `oscillation` are those without the defect.
    pub fn draw(
        kind: DefectKind,
        process: &Soiptd,
        oscillation: Oscillation,
        rng: &mut impl Rng,
    ) -> Self {
        let Oscillation {
            period_s,
            amplitude,
        } = oscillation;
        let mut between = |low: f64, high: f64| rng.random_range(low..=high);
        match kind {
            DefectKind::InFamily => Self::None,
            DefectKind::Resonance => Self::Resonance {
                rad_per_s: TAU / period_s * 1.5 * (10.0_f64 / 1.5).powf(between(0.0, 1.0)),
                damping: between(0.01, 0.05),
                mass_ratio: if between(0.0, 1.0) < 0.5 {
                    0.0
                } else {
                    between(0.1, 1.0)
                },
            },
            DefectKind::ExtraLag => Self::ExtraLag {
                lag_s: process.t_prop_s() * between(1.0, 3.0),
            },
            DefectKind::SecondDelay => Self::SecondPath {
                share: between(0.3, 0.7),
                delay_s: period_s * between(0.1, 0.5),
            },
            DefectKind::LongDelay => Self::SecondPath {
                share: 1.0,
                delay_s: period_s * between(0.2, 1.0),
            },
            DefectKind::Clipping => Self::Clipping {
                limit: amplitude * between(0.4, 0.85),
            },
            DefectKind::RateLimit => Self::RateLimit {
                per_s: 2.0 / (period_s * between(0.1, 0.5)),
            },
            DefectKind::DeadZone => Self::DeadZone {
                half_width: between(0.1, 0.4),
            },
            DefectKind::Friction => Self::Friction {
                force: between(0.05, 0.4),
            },
            DefectKind::Play => Self::Play {
                half_width: amplitude * between(0.05, 0.2),
            },
            DefectKind::RateSensor => Self::RateSensor,
            DefectKind::SlowSensor => Self::SlowSensor {
                lag_s: period_s * between(0.1, 0.5),
            },
            DefectKind::Tone => Self::Tone {
                amplitude: amplitude * between(0.1, 0.4),
                rad_per_s: TAU / period_s * 0.2 * 25.0_f64.powf(between(0.0, 1.0)),
                phase_rad: between(0.0, TAU),
            },
            DefectKind::OtherCycle => Self::draw_other(oscillation, rng),
            DefectKind::AsymmetricLag => Self::AsymmetricLag {
                falling_s: process.t_prop_s() * between(1.5, 3.0),
            },
            DefectKind::Drag => Self::Drag {
                force: between(0.1, 0.5),
                rate: TAU * amplitude / period_s,
            },
            DefectKind::Thrust => Self::Thrust {
                curvature: between(0.1, 0.4),
            },
        }
    }

    /// A limit cycle with a period between half and twice that of the process.
    fn draw_other(oscillation: Oscillation, rng: &mut impl Rng) -> Self {
        let rad_per_s = TAU / oscillation.period_s * 2.0_f64.powf(rng.random_range(-1.0..=1.0));
        let amplitude = oscillation.amplitude;
        if rng.random_range(0.0..1.0) < 0.5 {
            return Self::VanDerPol {
                amplitude,
                rad_per_s,
                bend: rng.random_range(0.2..=3.0),
            };
        }
        Self::OtherLoop {
            // Three lags pass an eighth of the fundamental of a square wave, which is 4/pi.
            amplitude: TAU * amplitude,
            // At the oscillation each of the three equal lags contributes 60 degrees of phase.
            lag_s: 3.0_f64.sqrt() / rad_per_s,
            proportional: rng.random_range(10.0..=30.0),
            integral: rng.random_range(0.0..=1.0),
        }
    }

    /// State at the start: zero, except for processes that oscillate by themselves.
    fn start(&self) -> [f64; 5] {
        let y = match *self {
            Self::VanDerPol { amplitude, .. } => amplitude,
            Self::OtherLoop { amplitude, .. } => 0.05 * amplitude,
            _ => 0.0,
        };
        [y, 0.0, 0.0, 0.0, 0.0]
    }

    /// Whether the measured output does not depend on the input.
    #[must_use]
    pub fn is_undriven(&self) -> bool {
        matches!(self, Self::VanDerPol { .. } | Self::OtherLoop { .. })
    }

    /// What the defect multiplies the frequency response of the process by, at a frequency (rad/s). One for a defect
    /// that a small signal does not see; `None` if there is no such factor.
    #[must_use]
    pub fn response(&self, rad_per_s: f64) -> Option<Complex64> {
        let s = Complex64::new(0.0, rad_per_s);
        match *self {
            Self::Resonance {
                rad_per_s: own,
                damping,
                mass_ratio,
            } => {
                let second = own * own / (s * s + 2.0 * damping * own * s + own * own);
                Some(if mass_ratio > 0.0 {
                    1.0 + mass_ratio * (1.0 - second)
                } else {
                    second
                })
            }
            Self::ExtraLag { lag_s } | Self::SlowSensor { lag_s } => Some(1.0 / (lag_s * s + 1.0)),
            Self::SecondPath { share, delay_s } => {
                Some((1.0 - share) + share * (-s * delay_s).exp())
            }
            Self::RateSensor => Some(s),
            Self::VanDerPol { .. } | Self::OtherLoop { .. } => None,
            _ => Some(Complex64::ONE),
        }
    }

    /// Reading of a sensor at this time (s after the pre-roll) and this output (output unit).
    pub fn sense(
        &self,
        output: f64,
        time_s: f64,
        sensor: &Sensor,
        noise: &mut impl NoiseSource,
    ) -> f64 {
        match *self {
            Self::Tone {
                amplitude,
                rad_per_s,
                phase_rad,
            } if time_s >= 0.0 => {
                let tone = amplitude * (rad_per_s * time_s + phase_rad).sin();
                sensor.read(output + tone, noise)
            }
            Self::Clipping { limit } => sensor.read(output, noise).clamp(-limit, limit),
            _ => sensor.read(output, noise),
        }
    }
}
