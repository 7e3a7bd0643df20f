//! Thresholds that decide a verdict or a remark, in one table: what each is, with its unit; what follows beyond it; and the campaign or
//! argument that set it. One that neither set says "judgement". How often each fires on right recordings stands in
//! `docs/benchmarks/any-recording.md` (false alarms) and `docs/benchmarks/refusals.md`. Constants of a search or of a method stand
//! where they are used.

use onecycle_design::Parameter;

// What the recording tells.

/// Relative standard deviation of the gain. Above: `no_information`. Judgement: with two deviations
/// the gain is wrong by more than half.
pub(crate) const MOST_DEVIATION: f64 = 0.3;
/// Half width of the 90 % interval over the estimate, of the gain at rest and of the first slope. Both above: `no_information`. Judgement: as
/// [`MOST_DEVIATION`].
pub(crate) const MOST_WIDTH: f64 = 0.5;
/// Share of the input's power in the informative band. Below: `no_information`. Argument: such a fit rests on rounding errors, as
/// that of a sine does which has nothing to do with the output; a relay has 0.1 % beyond its 140th harmonic.
pub(crate) const LEAST_POWER: f64 = 1e-5;
/// Sample period (s). Below: `unusable_units`. Argument: the clocks of a record are compared to the nanosecond.
pub(crate) const LEAST_SAMPLE_S: f64 = 1e-9;

// Whether the model explains it.

/// Largest of twenty autocorrelations of the innovations. Above, and above 3.5 deviations, which white ones exceed once in a hundred
/// records: `coloured`, intervals widened. Campaign: `any_open.toml`, 0.5 % of right recordings.
pub(crate) const COLOURED: f64 = 0.1;
/// The same. Above: an error of the prediction is the model's fault ([`BEYOND_DOUBT`]). Judgement.
pub(crate) const STRONGLY_COLOURED: f64 = 0.3;
/// Share of the innovations that the past input explains, and its F statistic. Above both: `input_left`, and `not_this_process` where the
/// mean predicts better. Campaign: `any_open.toml` and `any_closed.toml`, no right recording of 1,800.
pub(crate) const LEFT: (f64, f64) = (0.02, 3.0);
/// The same. Above both, with a prediction below [`WELL_PREDICTED`]: `not_this_process`. Campaign: as [`LEFT`]. Of later inputs without
/// feedback: `clock_offset`. Argument: noise moves the switching of a relay, in a few rows of a hundred.
pub(crate) const ANOTHER_KIND: (f64, f64) = (0.2, 3.0);
/// Share of the movement of the output to which a sample is believed where no fit to the noise can be believed (`model_error`). Argument:
/// friction, cooling and gears do some per cent beside a linear model. Trial: of 16 laboratory recordings that were refused although
/// a model explains them, two are answered, both rightly.
pub(crate) const BELIEVED_LESS: f64 = 0.03;
/// Share of the distance of the proposed loop from instability that the response to the input takes for certain, beyond the model's,
/// where [`LEFT`] is exceeded and after [`BELIEVED_LESS`]. Above: `not_this_process`. Argument: the peak of the sensitivity is twice the
/// one that is promised.
pub(crate) const MOST_TAKEN: f64 = 0.5;
/// F statistic of twenty past inputs in the innovations of a relay test, of 1,200 rows. Above: refused. Argument: chance exceeds it
/// once in a hundred records.
pub(crate) const MOST_INPUT_F: f64 = 1.88;
/// F statistic of twenty past outputs in the input. Above: the input is fed back. Argument: as [`MOST_INPUT_F`].
pub(crate) const FED_BACK: f64 = 1.88;
/// Share of the variance of the last third that a fit to the first two explains. Below, with an error above
/// [`EXPECTED_ERROR_RATIO`]: `weak_prediction`. Campaign: `any_open.toml`, 3 % of right recordings. Below, it may be that the process
/// grows by itself. Campaign: `any_closed.toml`, no recording of 900.
pub(crate) const WELL_PREDICTED: f64 = 0.9;
/// The same. Below, with an error above [`MOST_ERROR_RATIO`]: `not_this_process`. Campaign: `any_open.toml`, 1 %, all of six seconds.
pub(crate) const LEAST_PREDICTED: f64 = 0.7;
/// The same. From here coloured innovations are no reason to refuse. Argument: where noise is that small they show errors of the
/// model that do not matter. Of a fit without disturbances, which leaves all errors coloured, from [`WELL_PREDICTED`] on.
pub(crate) const BEYOND_DOUBT: f64 = 0.98;
/// Mean square of the prediction's error over what the disturbances explain. Above: see [`WELL_PREDICTED`]. Campaign: as there.
pub(crate) const EXPECTED_ERROR_RATIO: f64 = 2.0;
/// The same: see [`LEAST_PREDICTED`].
pub(crate) const MOST_ERROR_RATIO: f64 = 4.0;
/// Variance of the response to the input in the last third over that in all of the record. Below: the end is calm, and the prediction
/// is measured against the movement of all. Judgement.
pub(crate) const CALM_END: f64 = 0.1;
/// Share of the output's square that a fit without disturbances may leave under feedback. Above: the disturbances stay. Argument: an
/// input that followed all of the disturbance would bias the response by the root, 20 %; it follows a part.
pub(crate) const LEFT_UNDER_FEEDBACK: f64 = 0.04;
/// Distance of a polynomial below zero between one and its root, in standard deviations. Above: the root is above one, and the process
/// `not_this_process`. Argument: chance, once in 30,000.
pub(crate) const SURE: f64 = 4.0;
/// Misfit of the last cycles of a relay test (share of the output). Above: `misfit`. Judgement: the difference can be seen.
pub(crate) const MUCH_MISFIT: f64 = 0.01;
/// Relative error of the frequency response of another stretch after the first was refused (0.34 for that one). Above: refused too.
/// Argument: a gust disturbs some stretches only; a resonance, which the model lacks, disturbs all of them.
pub(crate) const MOST_ERROR_OF_SECOND_CHOICE: f64 = 0.05;
/// Squared distance (deviations of the residual) by which the prior of a pack may move a fit. Above: the prior is dropped. Campaign:
/// of 40 multirotors none exceeded 6.1; of 40 processes with an actuator lag of 3 to 5 ms half exceeded 8.
pub(crate) const MOST_TENSION: f64 = 9.0;
/// Sum of squared errors over its degrees of freedom, of a flight's response to its set-point. Above: no structure explains it.
/// Campaign: of 120 simulated closed loops one exceeded it.
pub(crate) const MOST_COST: f64 = 2.0;
/// Difference of that sum. Above: the fit contradicts the response. Argument: more than six standard deviations.
pub(crate) const CONTRADICTED: f64 = 40.0;

// How well parameters are known.

/// Relative half widths of 90 % intervals. Above: `weak_parameter`. Judgement.
pub(crate) const WIDE: [(Parameter, f64); 3] = [
    (Parameter::KOverTBody, 0.1),
    (Parameter::TProp, 0.3),
    (Parameter::TBody, 0.5),
];
/// Width of the interval of the dead time over the period. Above: `weak_delay`. Argument: 0.03 periods are 11 degrees of phase.
pub(crate) const WIDE_DELAY: f64 = 0.03;
/// Lower end of the phase margin over that specified. Below: `margin_may_be_less`. Judgement.
pub(crate) const LITTLE_MARGIN: f64 = 0.75;

// The test.

/// Noise over amplitude. Above: `noisy`. Judgement: the relay then needs its protection against switching
/// on noise.
pub(crate) const MUCH_NOISE: f64 = 0.05;
/// Samples a period. Below: `coarse`. Argument: one sample is 10 degrees, half of a phase margin of 20.
pub(crate) const FEW_SAMPLES: f64 = 360.0 / 10.0;
/// Input bias over the relay's amplitude. Above: `biased`. Argument: a relay that is asymmetric on purpose shows 0.2.
pub(crate) const MUCH_BIAS: f64 = 0.25;
/// Distance of the share of time high from one half. Above: a relay may have halved its ratio on one side. Campaign: of the relays of
/// `bench` that did, none lay below 0.056.
pub(crate) const LEAST_ASYMMETRY: f64 = 0.04;
/// Ratio of the relay's switching point. Below: it leads, and oscillates near the crossover of any controller. Campaign: of 630 loops
/// on processes with a flexible mode 9 were unstable, all with a crossover below 1.2 times the frequency of the oscillation.
pub(crate) const LEADING: f64 = -0.05;
/// Latest input (s) that a clock explains. Above: hysteresis. Argument: columns of one log lie milliseconds apart, at worst a period of
/// its slowest message.
pub(crate) const MOST_LATE_S: f64 = 1.0;
/// Phase margin (rad) that a sample period costs. Above: it matters when between two samples the relay switches. Argument: the 3 degrees
/// by which `honesty.toml` lets a margin miss its interval.
pub(crate) const MUCH_BETWEEN_RAD: f64 = 0.05;

// The controller.

/// Crossover over the highest excited frequency. Above: `extrapolated`. Judgement.
pub(crate) const EXTRAPOLATED: f64 = 1.5;
/// Gain margin. Below: `little_gain_margin`. Argument: the 6 dB that textbooks ask for.
pub(crate) const LEAST_GAIN_MARGIN: f64 = 2.0;
/// Noise at the actuator over the amplitude of the input. Above: `noise_at_actuator`. Judgement.
pub(crate) const MOST_NOISE: f64 = 0.1;
