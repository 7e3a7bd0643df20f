//! Takes a known low-pass out of the output: that of a gyro, whose cutoff an autopilot's parameters state.
//!
//! The filter is a second-order Butterworth low-pass of cutoff `w` (rad/s), poles `w e^(+-j 3 pi/4)`. Noise that passed it is
//! coloured, and so are disturbances of the process, which makes a fit with white noise wrong. Between three samples
//! `y0, y1, y2` the combination
//!
//! ```text
//! z2 = (y2 - a1 y1 - a2 y0) / (1 - a1 - a2)
//! ```
//!
//! does not depend on the state of the filter if `a1`, `a2` are such that `e^(s t)` gives zero for both poles `s`. It is
//! then a mean of the unfiltered output over the time of the three samples. A ramp comes out of the filter `sqrt(2)/w` late,
//! and out of the combination earlier by [`Unfiltered::late_s`].
//!
//! What takes part in a mean of the output must take part in the same mean of the input ([`alike_smooth`]): a linear process
//! then relates both. Otherwise the fit explains the mean by a lag that the process does not have.

use std::f64::consts::FRAC_1_SQRT_2;

/// Cutoff over the sample rate above which the filter stays in the output: its noise is nearly white from sample to sample.
const FASTEST: f64 = 0.2;
/// Three samples are used if they lie within this many sample periods.
const LONGEST: f64 = 3.5;

/// An output without its filter.
#[derive(Debug, PartialEq)]
pub(super) struct Unfiltered {
    /// The output; meaningless where not `usable`.
    pub(super) output: Vec<f64>,
    /// Whether a sample has its neighbours.
    pub(super) usable: Vec<bool>,
    /// Delay of the output with its filter beyond that of the output without (s).
    pub(super) late_s: f64,
}

/// Takes a filter of cutoff `cutoff_hz` out of samples every `period_s` or so. `None` if it hardly matters.
pub(super) fn unfilter(
    times_s: &[f64],
    output: &[f64],
    cutoff_hz: f64,
    period_s: f64,
) -> Option<Unfiltered> {
    if cutoff_hz.is_nan() || cutoff_hz <= 0.0 || cutoff_hz * period_s > FASTEST {
        return None;
    }
    let pole = std::f64::consts::TAU * cutoff_hz * FRAC_1_SQRT_2;
    let mut unfiltered = Unfiltered {
        output: output.to_vec(),
        usable: vec![false; output.len()],
        late_s: 0.0,
    };
    let mut delays_s = Vec::new();
    for at in 2..output.len() {
        let [first_s, second_s] = [at - 2, at - 1].map(|k| times_s[at] - times_s[k]);
        if first_s > LONGEST * period_s {
            continue;
        }
        let (a1, a2) = annihilator(pole, second_s, first_s);
        let sum = 1.0 - a1 - a2;
        unfiltered.output[at] = (output[at] - a1 * output[at - 1] - a2 * output[at - 2]) / sum;
        unfiltered.usable[at] = true;
        delays_s.push(-(a1 * second_s + a2 * first_s) / sum);
    }
    delays_s.sort_by(f64::total_cmp);
    // The delay of the combination alone, negative: it extrapolates the slow filter.
    unfiltered.late_s = -*delays_s.get(delays_s.len() / 2)?;
    smooth(&mut unfiltered);
    Some(unfiltered)
}

/// Weights of a neighbour and of the sample itself with which the output is smoothed: a tone at half the sample rate, which
/// the combination raises by up to `4/(w dt)^2`, vanishes.
const SMOOTH: [f64; 2] = [0.25, 0.5];

/// Weights with the variance `dt^2/6` of the triangle over three samples, which the combination tends to for slow filters.
const TRIANGLE: [f64; 2] = [1.0 / 12.0, 10.0 / 12.0];

/// The input in the mean that an unfiltered output is, without its delay.
pub(super) fn alike_smooth(input: &[f64]) -> Vec<f64> {
    [SMOOTH, TRIANGLE]
        .iter()
        .fold(input.to_vec(), |from, weights| {
            let mut to = from.clone();
            for (to, near) in to.iter_mut().skip(1).zip(from.windows(3)) {
                *to = weighted(weights, near);
            }
            to
        })
}

/// A sample with its neighbours.
fn weighted([near, own]: &[f64; 2], values: &[f64]) -> f64 {
    match values {
        [before, at, after] => near * (before + after) + own * at,
        _ => f64::NAN,
    }
}

fn smooth(unfiltered: &mut Unfiltered) {
    let values = unfiltered.output.clone();
    let is_usable = std::mem::take(&mut unfiltered.usable);
    let mut usable = vec![false; values.len()];
    for at in 1..values.len().saturating_sub(1) {
        usable[at] = is_usable[at - 1..=at + 1].iter().all(|is| *is);
        unfiltered.output[at] = weighted(&SMOOTH, &values[at - 1..=at + 1]);
    }
    unfiltered.usable = usable;
}

/// `a1`, `a2` with `1 = a1 e^(-s near) + a2 e^(-s far)` for the poles `s = pole (-1 +- j)`.
fn annihilator(pole: f64, near_s: f64, far_s: f64) -> (f64, f64) {
    // Real and imaginary part of e^(-s t) = e^(pole t) (cos(pole t) -+ j sin(pole t)).
    let part = |time_s: f64| {
        let phase = pole * time_s;
        (phase.exp() * phase.cos(), phase.exp() * phase.sin())
    };
    let ((near_re, near_im), (far_re, far_im)) = (part(near_s), part(far_s));
    let determinant = near_re * far_im - far_re * near_im;
    (far_im / determinant, -near_im / determinant)
}

#[cfg(test)]
mod tests {
    use onecycle_design::LowPass;

    use super::*;

    // A ramp leaves the filter late by sqrt(2)/w. The combination of the filtered ramp is a mean of the ramp over two sample
    // periods, so its own delay is between 0 and 2 periods, by symmetry close to 1; both add up to what the filter delays.
    #[test]
    fn a_ramp_comes_back_without_its_delay() {
        let (cutoff_hz, dt) = (20.0, 0.0025);
        let filter_s = LowPass::second_order(cutoff_hz).time_s();
        assert!((filter_s - 0.011_254).abs() < 1e-6);
        let times: Vec<f64> = (0..200).map(|k| dt * f64::from(k)).collect();
        // Long after the start of the ramp nothing of the transient is left.
        let ramp: Vec<f64> = times.iter().map(|t| t - filter_s).collect();
        let found = unfilter(&times, &ramp, cutoff_hz, dt).unwrap();
        let own_s = times[100] - found.output[100];
        assert!((own_s - (filter_s - found.late_s)).abs() < 1e-12);
        assert!((own_s / dt - 1.0).abs() < 0.05, "{}", own_s / dt);
        assert_eq!(found.usable.iter().filter(|usable| !**usable).count(), 4);
    }

    // The free response of the filter vanishes, also where samples are absent.
    #[test]
    fn the_state_of_the_filter_vanishes() {
        let (cutoff_hz, dt) = (20.0, 0.0025);
        let pole = std::f64::consts::TAU * cutoff_hz * FRAC_1_SQRT_2;
        let times: Vec<f64> = (0..100)
            .filter(|k| k % 7 != 3)
            .map(|k| dt * f64::from(k))
            .collect();
        let free: Vec<f64> = (times.iter())
            .map(|t| (-pole * t).exp() * (pole * t + 0.3).cos())
            .collect();
        let found = unfilter(&times, &free, cutoff_hz, dt).unwrap();
        for (value, usable) in found.output.iter().zip(&found.usable) {
            assert!(!usable || value.abs() < 1e-11, "{value}");
        }
    }

    // An integrator under a held random input, exact: a ramp `y + u t/dt` gives `f = y + u (t - T)/dt` and a free response. The
    // unfiltered output is the integral of the smoothed input, late by the combination (one sample), within 9 % of the change
    // per sample; of the input itself within 42 % (numpy: 0.064 and 0.416).
    #[test]
    fn the_input_in_the_same_mean_explains_the_output() {
        let (cutoff_hz, dt) = (20.0, 0.0025);
        let time_s = LowPass::second_order(cutoff_hz).time_s();
        let pole = std::f64::consts::TAU * cutoff_hz * FRAC_1_SQRT_2;
        let mut state = 1_u32;
        // At rest at first, so that the smoothed input has the same integral.
        let mut input: Vec<f64> = (0..2000)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 16) / 32768.0 - 1.0
            })
            .collect();
        input[..4].fill(0.0);
        let (mut y, mut f, mut rate) = (0.0, 0.0, 0.0);
        let mut output = Vec::new();
        let (decay, phase) = ((-pole * dt).exp(), pole * dt);
        for u in &input {
            output.push(f);
            let slope = u / dt;
            let a = f - y + slope * time_s;
            let b = (rate - slope) / pole + a;
            f = y + slope * (dt - time_s) + decay * (a * phase.cos() + b * phase.sin());
            rate = slope + pole * decay * ((b - a) * phase.cos() - (a + b) * phase.sin());
            y += u;
        }
        let times: Vec<f64> = (0..output.len()).map(|k| dt * k as f64).collect();
        let found = unfilter(&times, &output, cutoff_hz, dt).unwrap();
        let size = input.iter().map(|u| u * u).sum::<f64>() / 2000.0;
        let error = |input: &[f64]| {
            let mut sum = 0.0;
            let mut squares = 0.0;
            for (at, u) in input.iter().enumerate().take(1990) {
                // `sum` is the integral at sample `at`, which the output shows a sample later.
                if at > 10 {
                    squares += f64::powi(found.output[at + 1] - sum, 2);
                }
                sum += u;
            }
            (squares / 1979.0 / size).sqrt()
        };
        let [smooth, raw] = [error(&alike_smooth(&input)), error(&input)];
        assert!(smooth < 0.09, "{smooth}");
        assert!(raw > 0.35, "{raw}");
    }

    // A filter near the sample rate stays, and so does a cutoff that is none.
    #[test]
    fn fast_filters_stay() {
        let times = [0.0, 0.01, 0.02];
        for cutoff_hz in [30.0, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(unfilter(&times, &[1.0, 2.0, 3.0], cutoff_hz, 0.01), None);
        }
    }
}
