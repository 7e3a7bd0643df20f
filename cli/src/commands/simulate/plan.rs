//! The experiment that the arguments of `simulate` describe, checked.

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use onecycle_design::Model;
use onecycle_onboard::{Pd, Relay, RelaySettings, Soiptd};
use onecycle_plant::test_signal::prbs_order;
use onecycle_plant::{
    Bandwidths, Controller, Disturbances, Entry, ExcitedLoop, Experiment, FilteredPd, Noise,
    Sensed, Sensor, Stimulus, TestSignal,
};

use crate::args::{BETA, Excitation, Inject, NamedDisturbance, Share, Simulate};
use crate::failure::Failure;

/// Periods of the oscillation in a recording: some to settle, eight or more to fit.
const PERIODS: f64 = 20.0;
/// Largest number of samples of a simulation and of its dead time: half a day at 1 kHz.
const MOST_SAMPLES: f64 = 5e7;
/// Smallest number of samples in a period of the oscillation.
const FEWEST_SAMPLES_A_PERIOD: f64 = 4.0;
/// Samples in a period of the simulation that measures the amplitude, independent of the rate of the recording.
const SAMPLES_A_PERIOD: usize = 1000;
/// Sines of a multisine, unless `--sines` says otherwise.
const SINES: u32 = 12;

/// Largest output of a recording, as the reader of recordings has it.
pub(super) const LARGEST: f64 = 1e300;

/// A simulation that can run.
pub(super) struct Plan {
    pub(super) model: Model,
    pub(super) experiment: Experiment,
}

impl Plan {
    pub(super) fn new(arguments: &Simulate) -> Result<Self, Failure> {
        let model = arguments.process.model()?;
        positive("--sample-rate", arguments.sample_rate)?;
        positive("--amplitude", arguments.amplitude)?;
        if let Some(second) = arguments.second_amplitude {
            positive("--second-amplitude", second)?;
        }
        not_negative("the pre-roll", arguments.preroll)?;
        check_combination(arguments)?;
        if arguments.excitation == Excitation::Relay {
            relay(arguments, arguments.preroll, 0.0)?;
        }
        let mut plan = Self {
            model,
            experiment: Experiment::new(model, 1.0 / arguments.sample_rate, 0.0),
        };
        plan.experiment.duration_s = plan.duration_s(arguments)?;
        check_size(arguments, &plan)?;
        let amplitude = plan.noise_free_amplitude(arguments)?;
        plan.complete(arguments, amplitude)?;
        Ok(plan)
    }

    /// The process of a relay test whose oscillation is known without a simulation.
    fn relay_test(&self, arguments: &Simulate) -> Option<Soiptd> {
        let is_plain = arguments.excitation == Excitation::Relay && arguments.closed.is_none();
        match self.model {
            Model::Soiptd(process) if is_plain => Some(process),
            _ => None,
        }
    }

    fn duration_s(&self, arguments: &Simulate) -> Result<f64, Failure> {
        match (arguments.duration, self.relay_test(arguments)) {
            (Some(duration_s), _) => positive("--duration", duration_s),
            (None, Some(process)) => {
                // The oscillation becomes steady once more at the second amplitude.
                let parts = 1.0 + f64::from(u8::from(arguments.second_amplitude.is_some()));
                Ok(arguments.preroll + parts * PERIODS * period_s(arguments, &process)?)
            }
            (None, None) => Err(Failure::usage(
                "give --duration: only a relay on a soiptd in open loop has a default, 20 periods of its oscillation",
            )),
        }
    }

    /// Adds what disturbs the process and its measurement; `amplitude` is that of the noise-free output.
    fn complete(&mut self, arguments: &Simulate, amplitude: f64) -> Result<(), Failure> {
        let experiment = &mut self.experiment;
        experiment.reference = arguments.reference;
        experiment.input_bias = arguments.bias.of(arguments.amplitude);
        let mut sensor = Sensor::noisy(not_negative("--noise", arguments.noise.of(amplitude))?)
            .with_quantum(not_negative("--quantum", arguments.quantum.of(amplitude))?)
            .with_drop_outs(arguments.drop_outs);
        if let Some(outliers) = arguments.outliers {
            sensor = sensor.with_outliers(outliers.share, outliers.size.of(amplitude));
        }
        experiment.sensor = sensor;
        let jitter_s = arguments.jitter.of(experiment.sample_s);
        experiment.jitter = not_negative("--jitter", jitter_s / experiment.sample_s)?;
        experiment.initial_output = arguments.reference + arguments.offset.of(amplitude);
        self.experiment.disturbances = self.disturbances(arguments, amplitude)?;
        Ok(())
    }

    fn disturbances(&self, arguments: &Simulate, amplitude: f64) -> Result<Disturbances, Failure> {
        let Experiment {
            sensor, sample_s, ..
        } = self.experiment;
        let mut bandwidths = Bandwidths::default();
        let mut named = Disturbances::default();
        for disturbance in &arguments.disturbance {
            let (slot, value) = match *disturbance {
                NamedDisturbance::W1(w) => (&mut bandwidths.w1_rad_per_s, w),
                NamedDisturbance::W0(w) => (&mut bandwidths.w0_rad_per_s, w),
                NamedDisturbance::Wy(w) => (&mut bandwidths.wy_rad_per_s, w),
                NamedDisturbance::Walk(walk) => {
                    (&mut named.input_walk, walk.of(arguments.amplitude))
                }
                NamedDisturbance::White(white) => {
                    (&mut named.input_white, white.of(arguments.amplitude))
                }
                NamedDisturbance::OutputWalk(walk) => (&mut named.output_walk, walk.of(amplitude)),
            };
            *slot = value;
        }
        if bandwidths != Bandwidths::default() && sensor.noise_sigma == 0.0 {
            return Err(Failure::usage(
                "w1, w0 and wy of --disturbance are relative to the measurement noise: give --noise, or use walk, white and output-walk",
            ));
        }
        let process = self.model.linear();
        let relative =
            Disturbances::from_bandwidths(&bandwidths, &process, sensor.noise_sigma, sample_s);
        // Independent noises: their variances add up.
        let mut all = Disturbances::default()
            .with_input_walk(named.input_walk.hypot(relative.input_walk))
            .with_input_white(named.input_white.hypot(relative.input_white))
            .with_output_walk(named.output_walk.hypot(relative.output_walk));
        if let Some(gust) = arguments.gust {
            all = all.with_gusts(gust.sigma.of(arguments.amplitude), gust.correlation_s);
        }
        Ok(all)
    }

    /// What makes the input: the test signal alone, or in the loop.
    pub(super) fn controller(&self, arguments: &Simulate) -> Result<Box<dyn Controller>, Failure> {
        let sensor = &self.experiment.sensor;
        let excitation: Box<dyn Controller> = match self.signal(arguments)? {
            Some(signal) => Box::new(Stimulus::new(signal, arguments.preroll)),
            None => {
                let noise_sigma = sensor.noise_sigma.max(sensor.quantum);
                let relay = relay(arguments, arguments.preroll, noise_sigma)?;
                let at_setpoint = arguments.inject == Some(Inject::Setpoint);
                let is_direct = self.model.linear().gain() > 0.0 || at_setpoint;
                Box::new(TestRelay {
                    relay,
                    sign: if is_direct { 1.0 } else { -1.0 },
                    second: arguments.second_amplitude.map(|amplitude| amplitude as f32),
                    left_s: 0.5 * self.experiment.duration_s,
                })
            }
        };
        let Some(gains) = arguments.closed else {
            return Ok(excitation);
        };
        let (kp, kd) = (gains.kp, gains.kd);
        let controller = FilteredPd::new(Pd { kp, kd }, gains.filter_s);
        let entry = match arguments.inject.unwrap_or(Inject::Input) {
            Inject::Input => Entry::Input,
            Inject::Setpoint => Entry::Setpoint,
        };
        Ok(Box::new(ExcitedLoop::new(excitation, controller, entry)))
    }

    /// The test signal. `None` for a relay.
    fn signal(&self, arguments: &Simulate) -> Result<Option<TestSignal>, Failure> {
        let amplitude = arguments.amplitude;
        let length_s = self.experiment.duration_s - arguments.preroll;
        // Required by `check_combination`.
        let pulse_s = arguments.pulse.unwrap_or(f64::NAN);
        let (low_hz, high_hz) = arguments
            .band
            .map_or((f64::NAN, f64::NAN), |band| (band.low_hz, band.high_hz));
        let signal = match arguments.excitation {
            Excitation::Relay => return Ok(None),
            Excitation::Step => TestSignal::step(amplitude),
            Excitation::Doublet => TestSignal::doublet(amplitude, pulse_s),
            Excitation::ThreeTwoOneOne => TestSignal::three_two_one_one(amplitude, pulse_s),
            Excitation::Prbs => {
                TestSignal::prbs(amplitude, pulse_s, prbs_order(length_s / pulse_s))
            }
            Excitation::Chirp => TestSignal::chirp(amplitude, low_hz, high_hz, length_s),
            Excitation::Multisine => {
                let sines = arguments.sines.unwrap_or(SINES);
                TestSignal::multisine(amplitude, low_hz, high_hz, sines)
            }
        };
        signal.map(Some).map_err(Failure::usage)
    }

    /// Half the peak-to-peak output without bias, disturbances, noise and jitter: of the last two periods of a relay test,
    /// of the whole test otherwise. Zero if no option is a percentage of it.
    fn noise_free_amplitude(&self, arguments: &Simulate) -> Result<f64, Failure> {
        let calm = Simulate {
            preroll: 0.0,
            ..arguments.clone()
        };
        if let Some(process) = self.relay_test(arguments) {
            let period_s = period_s(arguments, &process)?;
            let sample_s = period_s / SAMPLES_A_PERIOD as f64;
            let plan = Self {
                model: self.model,
                experiment: Experiment::new(self.model, sample_s, PERIODS * period_s),
            };
            let mut controller = plan.controller(&calm)?;
            let trace = (plan.experiment).run(&mut controller, &mut Noise::from_seed(0));
            return Ok(trace.amplitude_of_last(2 * SAMPLES_A_PERIOD));
        }
        if !has_percentage(arguments) {
            return Ok(0.0);
        }
        let (mut low, mut high, mut end_s) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        let mut controller = self.controller(arguments)?;
        self.experiment
            .observe(&mut controller, &mut Noise::from_seed(0), |row| {
                (low, high) = (low.min(row.true_output), high.max(row.true_output));
                end_s = row.time_s;
                if high - low <= LARGEST {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            });
        if high - low <= LARGEST {
            Ok(0.5 * (high - low))
        } else {
            Err(diverged(arguments, end_s))
        }
    }
}

/// The relay of a test.
struct TestRelay {
    relay: Relay,
    /// -1 for a process with negative gain.
    sign: f64,
    /// Amplitude of the second half of the test.
    second: Option<f32>,
    /// Time until then (s).
    left_s: f64,
}

impl Controller for TestRelay {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        self.left_s -= dt_s;
        if self.left_s <= 0.0
            && let Some(amplitude) = self.second.take()
        {
            // Its range is checked with the arguments.
            let _ = self.relay.set_amplitude(amplitude);
        }
        self.sign * Controller::step(&mut self.relay, dt_s, reference, sensed)
    }
}

fn relay(arguments: &Simulate, preroll_s: f64, noise_sigma: f64) -> Result<Relay, Failure> {
    let (amplitude, beta) = (arguments.amplitude as f32, arguments.beta as f32);
    let settings = RelaySettings {
        preroll_s: preroll_s as f32,
        noise_sigma: noise_sigma as f32,
        asymmetry: arguments.asymmetry as f32,
        trim_gain: if arguments.no_trim {
            0.0
        } else {
            RelaySettings::TRIM_GAIN
        },
        ..if arguments.bare {
            RelaySettings::bare(amplitude, beta)
        } else {
            RelaySettings::new(amplitude, beta)
        }
    };
    Relay::new(settings).map_err(Failure::usage)
}

/// The sentence for a simulation whose output grows without limit.
pub(super) fn diverged(arguments: &Simulate, time_s: f64) -> Failure {
    Failure::usage(match arguments.closed {
        Some(_) => format!(
            "the output exceeds {LARGEST:e} at {time_s:.3} s: the loop is unstable; lower the gains of --loop or change \
             their sign"
        ),
        None => format!(
            "the output exceeds {LARGEST:e} at {time_s:.3} s: lower --amplitude, --bias or --duration"
        ),
    })
}

/// Whether an option is a percentage of the noise-free amplitude.
fn has_percentage(arguments: &Simulate) -> bool {
    let mut shares = vec![arguments.noise, arguments.quantum, arguments.offset];
    shares.extend(arguments.outliers.map(|outliers| outliers.size));
    for disturbance in &arguments.disturbance {
        if let NamedDisturbance::OutputWalk(walk) = disturbance {
            shares.push(*walk);
        }
    }
    shares
        .iter()
        .any(|share| matches!(share, Share::Percent(_)))
}

/// Options that the test signal needs, and those that it does not have.
fn check_combination(arguments: &Simulate) -> Result<(), Failure> {
    use Excitation::{Chirp, Doublet, Multisine, Prbs, Relay, ThreeTwoOneOne};
    let excitation = arguments.excitation;
    let name = excitation.name();
    let has_pulses = matches!(excitation, Doublet | ThreeTwoOneOne | Prbs);
    let has_band = matches!(excitation, Chirp | Multisine);
    let needed = [
        (has_pulses, arguments.pulse.is_some(), "--pulse", "0.5"),
        (has_band, arguments.band.is_some(), "--band", "1,20"),
    ];
    for (needs, given, option, example) in needed {
        if needs && !given {
            return Err(Failure::usage(format!(
                "the test signal {name} needs {option}, such as {option} {example}"
            )));
        }
    }
    let is_relay = excitation == Relay;
    let defaults = (BETA, 0.0);
    let unused = [
        (has_pulses, arguments.pulse.is_some(), "--pulse"),
        (has_band, arguments.band.is_some(), "--band"),
        (
            excitation == Multisine,
            arguments.sines.is_some(),
            "--sines",
        ),
        (is_relay, arguments.no_trim, "--no-trim"),
        (is_relay, arguments.bare, "--bare"),
        (
            is_relay,
            arguments.second_amplitude.is_some(),
            "--second-amplitude",
        ),
        (
            is_relay,
            (arguments.beta, arguments.asymmetry) != defaults,
            "--beta or --asymmetry",
        ),
    ];
    for (has, given, option) in unused {
        if given && !has {
            return Err(Failure::usage(format!(
                "{option} has no effect on the test signal {name}: leave it out or choose another --excitation"
            )));
        }
    }
    if !is_relay && arguments.closed.is_none() && arguments.reference != 0.0 {
        return Err(Failure::usage(
            "--reference has no effect in open loop: add --loop, or use --offset for the initial output",
        ));
    }
    if !arguments.reference.is_finite() {
        return Err(Failure::usage(format!(
            "--reference must be a number, but is {}",
            arguments.reference
        )));
    }
    if arguments.inject == Some(Inject::Setpoint) && has_input_percentage(arguments) {
        return Err(Failure::usage(
            "with --inject setpoint --amplitude is in output units: give --bias, --gust, walk and white as values \
             and not as percentages of it",
        ));
    }
    Ok(())
}

/// Whether a disturbance at the input is a percentage of the amplitude of the test signal.
fn has_input_percentage(arguments: &Simulate) -> bool {
    let mut shares = vec![arguments.bias];
    shares.extend(arguments.gust.map(|gust| gust.sigma));
    for disturbance in &arguments.disturbance {
        if let NamedDisturbance::Walk(share) | NamedDisturbance::White(share) = disturbance {
            shares.push(*share);
        }
    }
    shares
        .iter()
        .any(|share| matches!(share, Share::Percent(_)))
}

fn check_size(arguments: &Simulate, plan: &Plan) -> Result<(), Failure> {
    let Experiment {
        duration_s,
        sample_s,
        ..
    } = plan.experiment;
    let samples = duration_s / sample_s;
    if !(2.0..=MOST_SAMPLES).contains(&samples) {
        return Err(Failure::usage(format!(
            "the simulation has {samples:.0} samples, but 2 to {MOST_SAMPLES:.0} are possible: change --duration or \
             --sample-rate"
        )));
    }
    if plan.model.linear().tau_s() / sample_s > MOST_SAMPLES {
        return Err(Failure::usage(format!(
            "--tau is longer than {MOST_SAMPLES:.0} samples: lower --sample-rate"
        )));
    }
    if arguments.excitation != Excitation::Relay && duration_s <= arguments.preroll {
        return Err(Failure::usage(format!(
            "--duration must be longer than --preroll, but is {duration_s} s: the test signal starts at {} s",
            arguments.preroll
        )));
    }
    let highest_hz = arguments.band.map_or(0.0, |band| band.high_hz);
    if highest_hz > 0.5 * arguments.sample_rate {
        return Err(Failure::usage(format!(
            "--band ends at {highest_hz} Hz, above half the sample rate of {} Hz: raise --sample-rate",
            arguments.sample_rate
        )));
    }
    if arguments.pulse.is_some_and(|pulse_s| pulse_s < sample_s) {
        return Err(Failure::usage(
            "--pulse is shorter than a sample: raise --sample-rate",
        ));
    }
    Ok(())
}

fn period_s(arguments: &Simulate, process: &Soiptd) -> Result<f64, Failure> {
    let oscillation = process.describing_function_oscillation(arguments.amplitude, arguments.beta);
    let (omega, _) = oscillation.ok_or_else(|| {
        Failure::usage("the process does not oscillate at this phase: choose a smaller --beta")
    })?;
    let period_s = TAU / omega;
    if period_s * arguments.sample_rate < FEWEST_SAMPLES_A_PERIOD {
        return Err(Failure::usage(format!(
            "the oscillation has a period of {period_s:.3e} s, less than {FEWEST_SAMPLES_A_PERIOD} \
             samples: raise --sample-rate"
        )));
    }
    Ok(period_s)
}

fn positive(name: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Failure::usage(format!(
        "{name} must be positive, but is {value}"
    )))
}

fn not_negative(name: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(Failure::usage(format!(
        "{name} must be zero or positive, but is {value}"
    )))
}
