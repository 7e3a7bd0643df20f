//! Cross-spectra of a record with its set-point, over short overlapping segments.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::Complex64;
use onecycle_design::Linear;

use crate::signals::Signals;

/// Segments that the record is cut into, each overlapping the next by half.
const SEGMENTS: usize = 60;
/// Fewest segments: the deviations come from their scatter.
const FEWEST_SEGMENTS: usize = 24;
/// Fewest points of a segment.
const FEWEST_POINTS: usize = 32;
/// Lines per segment of the lowest frequency, and between neighbours: Blackman's window leaves these nearly independent.
const LINES: f64 = 3.0;
/// Most frequencies.
const MOST_BINS: usize = 160;
/// Highest frequency over the sample rate.
const HIGHEST: f64 = 0.35;
/// The highest frequency used is the last at which the set-point shows in the input: F statistic, mean over
/// [`NEIGHBOURS`], each at most [`LARGEST_F`]. Without set-point it is 1 with a deviation of 0.26.
const LEAST_F: f64 = 2.0;
const LARGEST_F: f64 = 10.0;
const NEIGHBOURS: usize = 15;
/// Least power of the noise of a segment over the mean, so that few segments do not count for all.
const LEAST_POWER: f64 = 0.25;

/// Sums over the segments at one frequency. `U`, `Y`, `R` are the transforms of a segment, of input, output, set-point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bin {
    pub(super) omega_rad_per_s: f64,
    /// Sum of `Y R*`.
    pub(super) output: Complex64,
    /// Sum of `U R*`.
    pub(super) input: Complex64,
    /// Sum of `|Y R|^2`.
    output_square: f64,
    /// Sum of `|U R|^2`.
    input_square: f64,
    /// Sum of `(Y R*)* (U R*)`.
    product: Complex64,
    /// Sums of `|Y|^2`, `|U|^2` and `Y* U`.
    power: (f64, f64, Complex64),
    /// Sums of `|R|^2` and `|R|^4`.
    set_point: (f64, f64),
    /// Number of segments.
    segments: f64,
}

impl Bin {
    fn add(&mut self, [u, y, r]: [Complex64; 3]) {
        self.power.0 += y.norm_sqr();
        self.power.1 += u.norm_sqr();
        self.power.2 += y.conj() * u;
        let power = r.norm_sqr();
        self.set_point.0 += power;
        self.set_point.1 += power * power;
        let (u, y) = (u * r.conj(), y * r.conj());
        self.input += u;
        self.output += y;
        self.input_square += u.norm_sqr();
        self.output_square += y.norm_sqr();
        self.product += y.conj() * u;
        self.segments += 1.0;
    }

    /// Error of `response`, real and imaginary part over their deviation: what the output has beside the response to the
    /// input, correlated with the set-point. Both are standard normal for the true response, however much or little the
    /// set-point moves the input, whatever the noise and the controller are.
    pub(super) fn errors(&self, response: Complex64) -> [f64; 2] {
        let error = self.output - response * self.input;
        let square = self.output_square - 2.0 * (response * self.product).re
            + response.norm_sqr() * self.input_square;
        let scatter = square - error.norm_sqr() / self.segments;
        // Rounding, where the response explains every segment.
        let least = 1e-12 * (self.output_square + response.norm_sqr() * self.input_square);
        let variance = 0.5 * scatter.max(least) * self.segments / (self.segments - 1.0);
        let deviation = variance.sqrt();
        [error.re / deviation, error.im / deviation]
    }

    /// Response at this frequency, and its relative deviation. Infinite where fewer than two segments share the power of the
    /// set-point.
    pub(super) fn response(&self) -> (Complex64, f64) {
        let response = self.output / self.input;
        let square = self.output_square - 2.0 * (response * self.product).re
            + response.norm_sqr() * self.input_square;
        let deviation = square.max(0.0).sqrt() / (self.input * response).norm();
        let freedom = 1.0 - 1.0 / self.shared();
        let least = if freedom > 0.5 { 0.0 } else { f64::INFINITY };
        (response, (deviation / freedom.max(0.0).sqrt()).max(least))
    }

    /// Number of segments among which the power of the set-point is shared: few in a chirp, which has each frequency once.
    fn shared(&self) -> f64 {
        self.set_point.0 * self.set_point.0 / self.set_point.1
    }

    /// F statistic of the set-point in the input.
    fn strength(&self) -> f64 {
        let explained = self.input.norm_sqr();
        explained / (self.input_square - explained / self.segments)
    }
}

/// Cross-spectra of a record.
#[derive(Clone, Debug)]
pub(super) struct Spectra {
    pub(super) bins: Vec<Bin>,
    /// Transforms of input, output and set-point: of each segment, at each frequency.
    transforms: Vec<Vec<[Complex64; 3]>>,
    pub(super) segments: usize,
    /// Time from point to point (s).
    pub(super) sample_s: f64,
    /// Sum of the squares of the windows.
    energy: f64,
}

impl Spectra {
    /// Spectra of the points `range`. `None` if the record is too short, or the set-point does not move the input.
    pub(super) fn new(
        signals: &Signals<'_>,
        set_point: &[f64],
        range: Range<usize>,
    ) -> Option<Self> {
        let sample_s = signals.sample_period_s * f64::from(signals.samples_per_point.max(1));
        let points = 2 * range.len() / (SEGMENTS + 1);
        if points < FEWEST_POINTS {
            return None;
        }
        let mut bins: Vec<Bin> = frequencies(points as f64 * sample_s, HIGHEST / sample_s)
            .map(|omega_rad_per_s| Bin {
                omega_rad_per_s,
                ..Bin::default()
            })
            .collect();
        let (mut all, mut energy) = (Vec::new(), 0.0);
        let window = window(points);
        for run in runs(&range, signals.breaks) {
            // Increments: what is slow would leak into what is fast.
            let even = [signals.input, signals.output, set_point]
                .map(|column| evened(&signals.time_s[run.clone()], &column[run.clone()], sample_s))
                .map(|column| {
                    column
                        .windows(2)
                        .map(|pair| pair[1] - pair[0])
                        .collect::<Vec<f64>>()
                });
            for start in (0..even[0].len()).step_by((points / 2).max(1)) {
                if start + points > even[0].len() {
                    break;
                }
                let columns = [0, 1, 2].map(|k| windowed(&even[k][start..start + points], &window));
                let own: Vec<[Complex64; 3]> = (bins.iter_mut())
                    .map(|bin| {
                        let own = transforms(&columns, bin.omega_rad_per_s * sample_s);
                        bin.add(own);
                        own
                    })
                    .collect();
                all.push(own);
                energy += window.iter().map(|w| w * w).sum::<f64>();
            }
        }
        if all.len() < FEWEST_SEGMENTS {
            return None;
        }
        let top = highest(&bins)?;
        bins.truncate(top + 1);
        for own in &mut all {
            own.truncate(top + 1);
        }
        Some(Self {
            bins,
            segments: all.len(),
            transforms: all,
            sample_s,
            energy,
        })
    }

    /// The spectra with a set-point that counts for less in noisy segments: over the power, near the frequency but not at it,
    /// of what the output has beside the response of `process`. Noise of motors rises with the throttle. The phase of the noise
    /// remains independent of such a set-point, so that the response that leaves nothing correlated is still the process.
    pub(super) fn weighted(&self, process: &Linear, around: &[Complex64]) -> Self {
        let response: Vec<Complex64> = (self.bins.iter().zip(around))
            .map(|(bin, around)| around * process.frequency_response(bin.omega_rad_per_s))
            .collect();
        let mut powers: Vec<Vec<f64>> = (self.transforms.iter())
            .map(|own| {
                let errors = own.iter().zip(&response);
                errors
                    .map(|([u, y, _], g)| (y - g * u).norm_sqr())
                    .collect()
            })
            .collect();
        for at in 0..self.bins.len() {
            let sum: f64 = powers.iter().map(|own| own[at]).sum();
            let mean = (sum / powers.len() as f64).max(f64::MIN_POSITIVE);
            powers.iter_mut().for_each(|own| own[at] /= mean);
        }
        let bins = self.bins.iter().enumerate().map(|(at, bin)| {
            let mut weighted = Bin {
                omega_rad_per_s: bin.omega_rad_per_s,
                ..Bin::default()
            };
            let near = at.saturating_sub(NEIGHBOURS / 2)..(at + NEIGHBOURS / 2 + 1);
            for (own, powers) in self.transforms.iter().zip(&powers) {
                let near = near.start..near.end.min(powers.len());
                let others = (near.len() - 1).max(1) as f64;
                let power = (powers[near].iter().sum::<f64>() - powers[at]) / others;
                let [u, y, r] = own[at];
                weighted.add([u, y, r / power.max(LEAST_POWER)]);
            }
            weighted
        });
        Self {
            bins: bins.collect(),
            ..self.clone()
        }
    }

    /// Standard deviation of white noise of one point that has the power which a process leaves at the highest frequencies:
    /// the median over their upper half.
    pub(super) fn noise_sigma(&self, process: &Linear, around: &[Complex64]) -> f64 {
        let mut powers: Vec<f64> = (self.bins.iter().zip(around))
            .skip(self.bins.len() / 2)
            .map(|(bin, around)| {
                let response = process.frequency_response(bin.omega_rad_per_s) * around;
                let (output, input, product) = bin.power;
                output - 2.0 * (response * product).re + response.norm_sqr() * input
            })
            .collect();
        powers.sort_by(f64::total_cmp);
        let median = powers.get(powers.len() / 2).copied().unwrap_or(0.0);
        (median.max(0.0) / self.energy).sqrt()
    }

    pub(super) fn band_rad_per_s(&self) -> (f64, f64) {
        let omega = |bin: Option<&Bin>| bin.map_or(0.0, |bin| bin.omega_rad_per_s);
        (omega(self.bins.first()), omega(self.bins.last()))
    }
}

/// Last frequency at which the set-point shows in the input.
fn highest(bins: &[Bin]) -> Option<usize> {
    let strengths: Vec<f64> = (bins.iter())
        .map(|bin| bin.strength().min(LARGEST_F))
        .collect();
    let near = NEIGHBOURS.min(bins.len()).max(1);
    let means = strengths.windows(near);
    let last = means
        .enumerate()
        .rfind(|(_, values)| values.iter().sum::<f64>() > LEAST_F * near as f64)?;
    Some(last.0 + near / 2)
}

/// Frequencies (rad/s) of segments of `length_s` up to `highest_hz`: all lines at first, then in equal ratios.
fn frequencies(length_s: f64, highest_hz: f64) -> impl Iterator<Item = f64> {
    let count = highest_hz * length_s / LINES;
    // The ratio for which lines two apart and the geometric rest make up the most bins.
    let mut ratio = 1.0;
    let size = |ratio: f64| {
        if ratio <= 1.0 {
            return count;
        }
        let even = (1.0 / (ratio - 1.0)).min(count);
        even + (count / even).ln() / ratio.ln()
    };
    while size(ratio) > MOST_BINS as f64 {
        ratio += 1e-3;
    }
    let mut line = LINES;
    std::iter::from_fn(move || {
        let now = line;
        line = (line + LINES).max((line * ratio).round());
        (now / length_s <= highest_hz).then_some(TAU * now / length_s)
    })
}

/// Parts of `range` without gaps.
fn runs(range: &Range<usize>, breaks: &[usize]) -> Vec<Range<usize>> {
    let inside = breaks.iter().copied().filter(|at| range.contains(at));
    let mut start = range.start;
    inside
        .chain([range.end])
        .map(|end| {
            let run = start..end;
            start = end;
            run
        })
        .collect()
}

/// Values every `sample_s` (s) from the first time on, on straight lines between the values given: what stands still in the
/// times of the samples would spread the slow part of a signal over all frequencies.
fn evened(times_s: &[f64], values: &[f64], sample_s: f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else {
        return vec![];
    };
    let count = ((last - first) / sample_s + 1e-6) as usize + 1;
    let mut right = 1;
    (0..count)
        .map(|k| {
            let time_s = first + k as f64 * sample_s;
            while right + 1 < times_s.len() && times_s[right] < time_s {
                right += 1;
            }
            let Some(next) = values.get(right) else {
                return values[0];
            };
            let step_s = times_s[right] - times_s[right - 1];
            let share = ((time_s - times_s[right - 1]) / step_s).clamp(0.0, 1.0);
            values[right - 1] + share * (next - values[right - 1])
        })
        .collect()
}

/// Blackman's window: a loop's signals fall by some 60 dB over the frequencies, and Hann's would leak.
fn window(points: usize) -> Vec<f64> {
    let phase = |k: usize| TAU * k as f64 / points as f64;
    (0..points)
        .map(|k| 0.42 - 0.5 * phase(k).cos() + 0.08 * (2.0 * phase(k)).cos())
        .collect()
}

fn windowed(values: &[f64], window: &[f64]) -> Vec<f64> {
    let sum: f64 = values.iter().zip(window).map(|(v, w)| v * w).sum();
    let mean = sum / window.iter().sum::<f64>();
    let centred = values.iter().zip(window).map(|(v, w)| (v - mean) * w);
    centred.collect()
}

/// Fourier transforms at one frequency, `omega` a sample.
fn transforms(columns: &[Vec<f64>; 3], omega: f64) -> [Complex64; 3] {
    let step = Complex64::cis(-omega);
    let mut turn = Complex64::ONE;
    let mut sums = [Complex64::default(); 3];
    for index in 0..columns[0].len() {
        for (sum, column) in sums.iter_mut().zip(columns) {
            *sum += turn * column[index];
        }
        turn *= step;
    }
    sums
}
