//! The gains that the limits allow over all frequencies.
//!
//! A *band* is a run of frequencies with forbidden gains. How the Nyquist plot enters and leaves it says on which side of
//! the forbidden gains the loop is stable:
//!
//! | band | allowed |
//! |------|---------|
//! | left downwards (`Im l > 0`) | gains below |
//! | contains the first frequency, while `|L|` grows without limit there (two integrators) | gains above |
//! | left upwards, entered from below | gains above |
//! | left upwards, entered from above: a dip | gains below, or above |
//!
//! Small gains are stable for a stable process and one integrator, and no allowed gain meets -1. So no count of
//! encirclements is needed.

use num_complex::Complex64;

use crate::analysis::open_loop::{OpenLoop, grid_step};
use crate::analysis::process::Process;
use crate::roots::{minimum, root};

use super::limits::{Interval, Limits, union};

/// Local extrema within this factor of the best one are refined.
const WORTH_REFINING: f64 = 1.5;

/// Tolerance of the logarithm of the frequency of an extremum. The gain is then exact to rounding.
const TOLERANCE: f64 = 1e-8;

/// Lowest frequency, per unit of time of the process.
const FIRST: f64 = 1e-5;

/// Most frequencies of a grid. A loop that needs more has a dead time of thousands of its other times.
const MOST_FREQUENCIES: usize = 100_000;

/// Gains of a shape that the limits allow.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Allowed {
    /// Largest allowed gain.
    pub high: f64,
    /// Frequency that limits it.
    pub omega: f64,
    /// Least gain. Above `high` if no gain is allowed.
    pub low: f64,
    /// Local extrema: frequency and gain of the upper limits, in order of frequency.
    pub upper: Vec<(f64, f64)>,
    /// The same of the lower limits.
    pub lower: Vec<(f64, f64)>,
}

/// Frequencies of a process, and the process at each. Grows as needed.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    points: Vec<(f64, Complex64)>,
    process: Process,
    /// Step as a fraction of the frequency.
    fraction: f64,
    resonance: Option<(f64, f64)>,
    plant: OpenLoop,
}

impl Grid {
    /// `plant` is the process under a gain of 1.
    pub(crate) fn new(process: &Process, plant: OpenLoop, fraction: f64) -> Self {
        Self {
            points: Vec::with_capacity(1024),
            process: *process,
            fraction,
            resonance: process.resonance(),
            plant,
        }
    }

    #[inline]
    fn point(&mut self, i: usize) -> (f64, Complex64) {
        while self.points.len() <= i {
            let omega = self.points.last().map_or(FIRST, |(omega, _)| {
                omega + grid_step(*omega, self.process.tau, self.resonance, self.fraction)
            });
            self.points.push((omega, self.plant.at(omega)));
        }
        self.points[i]
    }
}

/// A band in progress.
#[derive(Default)]
struct Band {
    from_first: bool,
    from_above: bool,
    /// Local minima of the lower end of the forbidden gains, and local maxima of the upper end: frequency, gain, and
    /// distance to the neighbours.
    lows: Vec<Extremum>,
    highs: Vec<Extremum>,
    /// The last two intervals.
    recent: [Option<(f64, Interval)>; 2],
    last_imaginary: f64,
}

#[derive(Clone, Copy, Debug)]
struct Extremum {
    omega: f64,
    gain: f64,
    /// Neighbours on the grid.
    between: [f64; 2],
}

impl Band {
    fn push(&mut self, omega: f64, interval: Interval) {
        let [before, here] = self.recent;
        if let Some((middle, (low, high))) = here {
            let (start, lows_before, highs_before) = match before {
                Some((start, (low, high))) => (start, low, high),
                None => (0.94 * middle, f64::INFINITY, 0.0),
            };
            let between = [start, omega];
            if low <= lows_before && low <= interval.0 {
                self.lows.push(Extremum { omega: middle, gain: low, between });
            }
            if high >= highs_before && high >= interval.1 {
                self.highs.push(Extremum { omega: middle, gain: high, between });
            }
        }
        self.recent = [here, Some((omega, interval))];
    }

    /// Ends the band before `omega`.
    fn finish(&mut self, omega: f64) {
        self.push(omega, (f64::INFINITY, 0.0));
    }
}

/// Scan of a shape on a grid.
struct Scan<'a> {
    limits: &'a Limits,
    open_loop: &'a OpenLoop,
    band: Option<Band>,
    upper: Vec<Extremum>,
    lower: Vec<Extremum>,
    dips: Vec<[Extremum; 2]>,
    least: f64,
    is_first: bool,
}

impl Scan<'_> {
    #[inline]
    fn add(&mut self, before: f64, omega: f64, l: Complex64) {
        let interval = self.limits.forbidden(omega, l);
        match (interval, &mut self.band) {
            (None, None) => {}
            (Some(interval), band) => {
                let from_first = self.is_first;
                let band = band.get_or_insert_with(|| Band {
                    from_first,
                    from_above: l.im < 0.0 && !from_first,
                    last_imaginary: l.im,
                    ..Band::default()
                });
                if self.limits.gain_margin > 1.0 && (band.last_imaginary < 0.0) != (l.im < 0.0) {
                    let crossing = root(|omega| self.open_loop.at(omega).im, before, omega, 0.0);
                    let margin = self.limits.at_phase_crossing(self.open_loop.at(crossing));
                    band.push(crossing, union(Some(interval), margin).unwrap_or(margin));
                }
                band.push(omega, interval);
                band.last_imaginary = l.im;
            }
            (None, Some(_)) => self.leave(omega),
        }
        self.is_first = false;
    }

    fn leave(&mut self, omega: f64) {
        let Some(mut band) = self.band.take() else {
            return;
        };
        band.finish(omega);
        if band.from_first {
            self.lower.append(&mut band.highs);
        } else if band.last_imaginary > 0.0 {
            for extremum in band.lows {
                self.least = self.least.min(extremum.gain);
                self.upper.push(extremum);
            }
        } else if band.from_above {
            let low = band.lows.iter().copied().min_by(|a, b| a.gain.total_cmp(&b.gain));
            let high = band.highs.iter().copied().max_by(|a, b| a.gain.total_cmp(&b.gain));
            self.dips.extend(low.zip(high).map(|(low, high)| [low, high]));
        } else {
            self.lower.append(&mut band.highs);
        }
    }

    /// Refines an extremum of the lower (`true`) or upper end of the forbidden gains.
    fn refine(&self, extremum: &Extremum, is_low: bool) -> (f64, f64) {
        let end = |ln: f64| {
            let omega = ln.exp();
            match self.limits.forbidden(omega, self.open_loop.at(omega)) {
                Some((low, high)) => if is_low { low } else { -high },
                None => if is_low { f64::INFINITY } else { 0.0 },
            }
        };
        let [low, high] = extremum.between.map(f64::ln);
        let (ln, value) = minimum(end, low, high, TOLERANCE);
        let gain = value.abs();
        let is_better = if is_low { gain < extremum.gain } else { gain > extremum.gain };
        if is_better { (ln.exp(), gain) } else { (extremum.omega, extremum.gain) }
    }

    fn refined(&self, extrema: &[Extremum], is_low: bool) -> Vec<(f64, f64)> {
        let gains = extrema.iter().map(|extremum| extremum.gain);
        let best = if is_low {
            gains.fold(f64::INFINITY, f64::min)
        } else {
            gains.fold(0.0, f64::max)
        };
        let is_near = |extremum: &&Extremum| {
            if is_low {
                extremum.gain <= WORTH_REFINING * best
            } else {
                extremum.gain * WORTH_REFINING >= best
            }
        };
        (extrema.iter().filter(is_near)).map(|extremum| self.refine(extremum, is_low)).collect()
    }

    /// `None` if no frequency limits the gain from above.
    fn allowed(&self) -> Option<Allowed> {
        let mut upper = self.refined(&self.upper, true);
        let mut lower = self.refined(&self.lower, false);
        let (mut omega, mut high) = *upper.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        // From the highest dip down: a gain inside a dip goes below it, a gain above a dip stays above it.
        let mut dips = self.dips.clone();
        dips.sort_by(|a, b| b[1].gain.total_cmp(&a[1].gain));
        for [low_end, high_end] in &dips {
            let below = self.refine(low_end, true);
            let above = self.refine(high_end, false);
            if above.1 <= high {
                lower.push(above);
            } else if below.1 < high {
                (omega, high) = below;
                upper = vec![below];
            }
        }
        let low = lower.iter().map(|(_, gain)| *gain).fold(0.0, f64::max);
        Some(Allowed {
            high,
            omega,
            low,
            upper,
            lower,
        })
    }
}

/// Gains of the shape in `open_loop` (its gain is 1) that `limits` allow. `path` is the feedback path of the shape, `grid`
/// the process. `None` if the gain has no upper limit, or the grid none.
pub(crate) fn allowed(
    grid: &mut Grid,
    open_loop: &OpenLoop,
    path: impl Fn(f64) -> Complex64,
    limits: &Limits,
    corner: f64,
) -> Option<Allowed> {
    let mut scan = Scan {
        limits,
        open_loop,
        band: None,
        upper: Vec::new(),
        lower: Vec::new(),
        dips: Vec::new(),
        least: f64::INFINITY,
        is_first: true,
    };
    let share = (1.0 - 1.0 / limits.ms.min(limits.mt)).min(1.0 / limits.gain_margin);
    let mut before = FIRST;
    for i in 0..MOST_FREQUENCIES {
        let (omega, process) = grid.point(i);
        let l = process * path(omega);
        scan.add(before, omega, l);
        before = omega;
        // With falling |L| no later frequency forbids gains below share/|l|.
        if omega > corner && share * share > 4.0 * scan.least * scan.least * l.norm_sqr() {
            return scan.allowed();
        }
        if omega > corner && l.norm_sqr() == 0.0 {
            break;
        }
        // A loop whose phase stays above -pi has no limit.
        if scan.least == f64::INFINITY && omega > 1e4 * corner && scan.band.is_none() {
            break;
        }
    }
    None
}
