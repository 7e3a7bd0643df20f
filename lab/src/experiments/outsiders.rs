//! Relay experiments on processes out of the family, made on purpose: what an identifier must not take
//! for an integrator with two lags and a delay.
//!
//! Each is a random process of a space with one defect of random strength, under the relay of the
//! board, with bias and noise as examples have them ([`dataset`](crate::learn::dataset)). Case `n` of a recipe
//! is the same whatever else is made, and its process the same whatever is wrong with it. Strengths are counted in the period `T` and the amplitude `a` of
//! the oscillation without the defect, and in the relay's amplitude `h`:
//!
//! | kind             | what is wrong                                          | strength                       |
//! |------------------|--------------------------------------------------------|--------------------------------|
//! | `resonance`      | a second mass, measured or hung on the measured one     | at 1.5..10 / T, damped by 1..5 % |
//! | `extra_lag`      | a third lag                                            | 1..3 `T_prop`                  |
//! | `second_delay`   | part of the input comes later                          | 30..70 %, by 0.1..0.5 T        |
//! | `long_delay`     | all of it does                                         | by 0.2..1 T                    |
//! | `clipping`       | the sensor's range ends                                | at 0.4..0.85 a                 |
//! | `rate_limit`     | the input slews                                        | from -h to h in 0.1..0.5 T     |
//! | `dead_zone`      | a small force does nothing                             | up to 0.1..0.4 h               |
//! | `friction`       | Coulomb friction of the body                           | 0.05..0.4 h                    |
//! | `play`           | the measured part has play                             | 0.1..0.4 a                     |
//! | `rate_sensor`    | the rate is measured, not the position                 |                                |
//! | `slow_sensor`    | a lag of the sensor                                    | 0.1..0.5 T                     |
//! | `tone`           | a foreign sinusoid in the measurement                  | 0.1..0.4 a, at 0.2..5 / T      |
//! | `other_cycle`    | a limit cycle of something else, which the relay only follows | van der Pol's, a loop's with three lags |
//!
//! A dead zone in front of the actuator's lag is left out: under a relay it is a smaller relay, and no
//! experiment with two levels tells it from one.

pub mod plant;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Controller, NoiseSource, Sensed, Sensor, Trace};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use self::plant::{Plant, Scale};
use crate::experiments::{DrawnNoise, Recipe};
use crate::learn::dataset::{ExampleError, PREROLL_SAMPLES};
use crate::space::limit_cycle::symmetric;

/// What is wrong with a process, see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Nothing.
    InFamily,
    /// A second mass.
    Resonance,
    /// A third lag.
    ExtraLag,
    /// Part of the input comes later.
    SecondDelay,
    /// All of the input comes later.
    LongDelay,
    /// The range of the sensor ends.
    Clipping,
    /// The input slews.
    RateLimit,
    /// Small forces do nothing.
    DeadZone,
    /// Coulomb friction.
    Friction,
    /// Play in front of the sensor.
    Play,
    /// The rate is measured.
    RateSensor,
    /// The sensor lags.
    SlowSensor,
    /// A foreign sinusoid.
    Tone,
    /// The input drives nothing.
    OtherCycle,
}

impl Kind {
    /// All that is out of the family.
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

    /// Its name in a table.
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
        }
    }
}

/// A defect and its strength. Forces count in the relay's amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Defect {
    /// None.
    None,
    /// A second mass on a spring.
    Resonance {
        /// Its frequency (rad/s).
        rad_per_s: f64,
        /// Its damping ratio.
        damping: f64,
        /// Its mass over that of the body where that is measured; zero where the second mass is.
        mass_ratio: f64,
    },
    /// A third lag (s).
    ExtraLag {
        /// It (s).
        lag_s: f64,
    },
    /// A share of the input comes later.
    SecondPath {
        /// The share.
        share: f64,
        /// By how much (s).
        delay_s: f64,
    },
    /// The sensor shows nothing beyond.
    Clipping {
        /// The end of its range (output unit).
        limit: f64,
    },
    /// The input slews.
    RateLimit {
        /// By so much at most (input unit / s).
        per_s: f64,
    },
    /// Forces below do nothing.
    DeadZone {
        /// The smallest that does (input unit).
        half_width: f64,
    },
    /// Coulomb friction.
    Friction {
        /// Its force (input unit).
        force: f64,
    },
    /// Play.
    Play {
        /// Half of it (output unit).
        half_width: f64,
    },
    /// The rate is measured.
    RateSensor,
    /// The sensor lags.
    SlowSensor {
        /// By its time constant (s).
        lag_s: f64,
    },
    /// A foreign sinusoid in the measurement, from the end of the pre-roll on.
    Tone {
        /// Its amplitude (output unit).
        amplitude: f64,
        /// Its frequency (rad/s).
        rad_per_s: f64,
        /// Its phase at time zero (rad).
        phase_rad: f64,
    },
    /// The oscillator of van der Pol.
    VanDerPol {
        /// Amplitude (output unit).
        amplitude: f64,
        /// Frequency of a small bend (rad/s).
        rad_per_s: f64,
        /// How far from harmonic it is; the frequency falls with it.
        bend: f64,
    },
    /// A loop of three equal lags and a proportional-integral controller with a limit, unstable.
    OtherLoop {
        /// Limit of the controller (output unit).
        amplitude: f64,
        /// Each lag (s).
        lag_s: f64,
        /// Gain, above 8 unstable.
        proportional: f64,
        /// Gain of the integral over a lag.
        integral: f64,
    },
}

impl Defect {
    fn draw(kind: Kind, process: &Soiptd, scale: Scale, rng: &mut impl Rng) -> Self {
        let Scale {
            period_s,
            amplitude,
        } = scale;
        let mut between = |low: f64, high: f64| rng.random_range(low..=high);
        match kind {
            Kind::InFamily => Self::None,
            Kind::Resonance => Self::Resonance {
                rad_per_s: TAU / period_s * 1.5 * (10.0_f64 / 1.5).powf(between(0.0, 1.0)),
                damping: between(0.01, 0.05),
                mass_ratio: if between(0.0, 1.0) < 0.5 {
                    0.0
                } else {
                    between(0.1, 1.0)
                },
            },
            Kind::ExtraLag => Self::ExtraLag {
                lag_s: process.t_prop_s() * between(1.0, 3.0),
            },
            Kind::SecondDelay => Self::SecondPath {
                share: between(0.3, 0.7),
                delay_s: period_s * between(0.1, 0.5),
            },
            Kind::LongDelay => Self::SecondPath {
                share: 1.0,
                delay_s: period_s * between(0.2, 1.0),
            },
            Kind::Clipping => Self::Clipping {
                limit: amplitude * between(0.4, 0.85),
            },
            Kind::RateLimit => Self::RateLimit {
                per_s: 2.0 / (period_s * between(0.1, 0.5)),
            },
            Kind::DeadZone => Self::DeadZone {
                half_width: between(0.1, 0.4),
            },
            Kind::Friction => Self::Friction {
                force: between(0.05, 0.4),
            },
            Kind::Play => Self::Play {
                half_width: amplitude * between(0.05, 0.2),
            },
            Kind::RateSensor => Self::RateSensor,
            Kind::SlowSensor => Self::SlowSensor {
                lag_s: period_s * between(0.1, 0.5),
            },
            Kind::Tone => Self::Tone {
                amplitude: amplitude * between(0.1, 0.4),
                rad_per_s: TAU / period_s * 0.2 * 25.0_f64.powf(between(0.0, 1.0)),
                phase_rad: between(0.0, TAU),
            },
            Kind::OtherCycle => Self::draw_other(scale, rng),
        }
    }

    /// Periods between half and twice the process's own.
    fn draw_other(scale: Scale, rng: &mut impl Rng) -> Self {
        let rad_per_s = TAU / scale.period_s * 2.0_f64.powf(rng.random_range(-1.0..=1.0));
        let amplitude = scale.amplitude;
        if rng.random_range(0.0..1.0) < 0.5 {
            return Self::VanDerPol {
                amplitude,
                rad_per_s,
                bend: rng.random_range(0.2..=3.0),
            };
        }
        Self::OtherLoop {
            // Three lags pass an eighth of the fundamental of a square wave, 4/pi.
            amplitude: TAU * amplitude,
            // Three equal lags turn the phase by half a turn where each turns it by a sixth.
            lag_s: 3.0_f64.sqrt() / rad_per_s,
            proportional: rng.random_range(10.0..=30.0),
            integral: rng.random_range(0.0..=1.0),
        }
    }

    /// State at the start: zero, but for what oscillates on its own.
    fn start(&self) -> [f64; 5] {
        let y = match *self {
            Self::VanDerPol { amplitude, .. } => amplitude,
            Self::OtherLoop { amplitude, .. } => 0.05 * amplitude,
            _ => 0.0,
        };
        [y, 0.0, 0.0, 0.0, 0.0]
    }

    /// Whether the input drives nothing that is measured.
    #[must_use]
    pub fn is_undriven(&self) -> bool {
        matches!(self, Self::VanDerPol { .. } | Self::OtherLoop { .. })
    }

    /// What the sensor makes of the output at this time.
    fn sense(
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

/// One experiment, before it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The process without its defect, of velocity gain one.
    pub process: Soiptd,
    /// What is wrong with it.
    pub defect: Defect,
    /// Oscillation without the defect.
    pub scale: Scale,
    /// Constant added to the input.
    pub bias: f64,
    /// Noise of a sample (output unit).
    pub sigma: f64,
    /// Sample period (s).
    pub sample_s: f64,
    trim: bool,
    beta: f64,
    rng: Pcg64Mcg,
}

/// Periods of an experiment: until it is steady, and the eight cycles that an identification takes.
const PERIODS: f64 = 26.0;

/// Case number `n` of a recipe; `None` where the relay does not make the process oscillate.
///
/// # Errors
/// See [`ExampleError`].
pub fn case(recipe: &Recipe, kind: Kind, n: u64) -> Result<Option<Case>, ExampleError> {
    recipe.validate()?;
    let mut rng = Pcg64Mcg::seed_from_u64(recipe.seed.wrapping_add(n));
    let family = recipe.families[recipe.family(&mut rng)];
    let process = family.process(&mut rng)?;
    let bias = recipe.bias * rng.random_range(-1.0..=1.0);
    let sigma = recipe.sigma * rng.random_range(0.0..=1.0);
    let samples = family.samples(&mut rng);
    let beta = family.space.beta;
    let Some(quiet) = symmetric(&process, beta) else {
        return Ok(None);
    };
    let mut scale = Scale {
        period_s: quiet.period_s(),
        amplitude: quiet.amplitude,
    };
    if kind == Kind::RateSensor {
        let Some(omega) = process.frequency_at_phase(beta.asin() - PI - FRAC_PI_2) else {
            return Ok(None);
        };
        scale = Scale {
            period_s: TAU / omega,
            amplitude: 4.0 / PI * omega * process.magnitude(omega),
        };
    }
    let defect = Defect::draw(kind, &process, scale, &mut rng);
    Ok(Some(Case {
        process,
        defect,
        scale,
        bias,
        sigma: sigma * scale.amplitude,
        sample_s: scale.period_s / samples,
        trim: recipe.trim,
        beta,
        rng,
    }))
}

impl Case {
    /// Runs the relay of the board on it.
    ///
    /// # Errors
    /// Where the relay's settings are out of range.
    pub fn run(&self) -> Result<Trace, ExampleError> {
        let mut rng = self.rng.clone();
        let mut noise = DrawnNoise(&mut rng);
        let sample_s = self.sample_s;
        let mut settings = RelaySettings::new(1.0, self.beta as f32);
        let mut preroll_s = PREROLL_SAMPLES * sample_s;
        if self.defect.is_undriven() {
            // What moves already has no quiet to measure the noise in.
            preroll_s = 0.0;
            settings.noise_sigma = self.sigma as f32;
        }
        settings.preroll_s = preroll_s as f32;
        if self.trim {
            settings.trim_gain = RelaySettings::TRIM_GAIN;
        }
        let mut relay = Relay::new(settings)?;
        let sensor = Sensor::noisy(self.sigma);
        let mut plant = Plant::new(&self.process, &self.defect, self.scale, sample_s);
        let samples = ((preroll_s + PERIODS * self.scale.period_s) / sample_s).round() as usize;
        let mut trace = Trace::with_capacity(samples);
        for sample in 0..samples {
            let time_s = sample as f64 * sample_s;
            let output = plant.output();
            let since_s = time_s - preroll_s;
            let seen = self.defect.sense(output, since_s, &sensor, &mut noise);
            let sensed = Sensed {
                output: seen,
                rate: plant.rate(),
            };
            let input = Controller::step(&mut relay, sample_s, 0.0, sensed);
            trace.push(time_s, input, seen, output);
            plant.step(input + self.bias);
        }
        Ok(trace)
    }
}
