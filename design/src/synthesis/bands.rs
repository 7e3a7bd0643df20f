//! The gains that the limits allow over all frequencies.
//!
//! A *band* is a run of frequencies with forbidden gains, from `low` to `high`. Gains below `low` keep the part of the Nyquist
//! plot in the band inside -1, gains above `high` outside of it. A band turns the plot about -1 if it enters above the
//! negative real axis (`Im l < 0`, phase above -180 deg) and leaves below it (-1), or the other way round (+1).
//!
//! So a gain is allowed if it lies in no band, and if the turns of the bands that it exceeds sum to zero. With two
//! integrators the first band begins at infinite gain: it turns if it leaves below the axis. Three integrators start with
//! a turn of -1, and so does one behind an unstable pole: the plot starts with the same phase, -270 deg, and the large arc that
//! closes it, shorter by one turn, is what the pole asks for. Nothing else needs to be counted.

use num_complex::Complex64;

use crate::analysis::open_loop::{OpenLoop, grid_step};
use crate::analysis::process::{Process, SLOWEST_POLE};
use crate::roots::{minimum, root};

use super::limits::{Interval, Limits, union};

/// Local extrema within this factor of the best one are refined.
const WORTH_REFINING: f64 = 1.1;

/// Tolerance of the logarithm of the frequency of an extremum. The gain is then exact to rounding, as it is flat there.
const TOLERANCE: f64 = 1e-8;

/// The same on a grid with steps above this fraction: the gain is then exact to 1e-6.
const ROUGH_TOLERANCE: f64 = 1e-3;
const ROUGH: f64 = 0.1;

/// Lowest frequency, per unit of time of the process: that of the slowest pole that is no integrator, with room below it.
const FIRST: f64 = 1e-2 * SLOWEST_POLE;

/// A loop whose phase has not fallen below -pi at this frequency, per unit of time and corner, has no limit.
const LAST: f64 = 1e6;

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

/// Why a shape has no largest gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoGain {
    /// Every large gain is allowed.
    Unbounded,
    /// No gain is stable.
    Unstable,
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

    /// Index of the last point at or below a frequency.
    fn first_from(&mut self, omega: f64) -> usize {
        while self.points.last().is_none_or(|point| point.0 <= omega) {
            self.point(self.points.len());
        }
        self.points
            .partition_point(|point| point.0 <= omega)
            .saturating_sub(1)
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

/// Local extremum of an end of the forbidden gains.
#[derive(Clone, Copy, Debug)]
struct Extremum {
    omega: f64,
    gain: f64,
    /// Neighbours on the grid.
    between: [f64; 2],
}

struct Band {
    enters_above: bool,
    from_first: bool,
    /// Local minima of the lower end and local maxima of the upper end.
    lows: Vec<Extremum>,
    highs: Vec<Extremum>,
    low: f64,
    high: f64,
    /// The last two frequencies with their intervals.
    recent: [Option<(f64, Interval)>; 2],
    last_imaginary: f64,
}

impl Band {
    fn new(l: Complex64, from_first: bool) -> Self {
        Self {
            enters_above: l.im < 0.0,
            from_first,
            lows: Vec::new(),
            highs: Vec::new(),
            low: f64::INFINITY,
            high: 0.0,
            recent: [None; 2],
            last_imaginary: l.im,
        }
    }

    fn push(&mut self, omega: f64, interval: Interval) {
        let [before, here] = self.recent;
        if let Some((middle, (low, high))) = here {
            let (start, lows_before, highs_before) = match before {
                Some((start, (low, high))) => (start, low, high),
                None => (0.94 * middle, f64::INFINITY, 0.0),
            };
            let between = [start, omega];
            if low <= lows_before && low <= interval.0 {
                self.lows.push(Extremum {
                    omega: middle,
                    gain: low,
                    between,
                });
            }
            if high >= highs_before && high >= interval.1 {
                self.highs.push(Extremum {
                    omega: middle,
                    gain: high,
                    between,
                });
            }
            self.low = self.low.min(low);
            self.high = self.high.max(high);
        }
        self.recent = [here, Some((omega, interval))];
    }

    /// Ends the band before `omega`.
    fn finish(&mut self, omega: f64) {
        self.push(omega, (f64::INFINITY, 0.0));
        if self.from_first {
            // It extends to frequency zero, where every gain exceeds it.
            self.low = 0.0;
        }
    }

    /// Turns about -1 of a plot that exceeds the band.
    fn turns(&self) -> i32 {
        let leaves_above = self.last_imaginary < 0.0;
        i32::from(leaves_above) - i32::from(self.enters_above || self.from_first)
    }
}

/// Scan of a shape on a grid.
struct Scan<'a> {
    limits: &'a Limits,
    open_loop: &'a OpenLoop,
    tolerance: f64,
    band: Option<Band>,
    bands: Vec<Band>,
    /// Turns of the bands so far.
    turns: i32,
    /// Least gain below the bands that turned downwards since the turns were last zero: no later band can matter at less.
    least: f64,
    /// The last frequency with its loop. `None` at the first one.
    last: Option<(f64, Complex64)>,
}

impl Scan<'_> {
    #[inline]
    fn add(&mut self, omega: f64, l: Complex64) {
        let interval = self.limits.forbidden(omega, l);
        if let Some((before, last)) = self.last {
            let is_crossing = (last.im < 0.0) != (l.im < 0.0) && last.re.min(l.re) < 0.0;
            // The phase passes -pi, where gains are always forbidden. A grid that is coarse for the limits may step over them.
            let is_seen = self.band.is_some() && interval.is_some();
            if is_crossing && (self.limits.gain_margin > 1.0 || !is_seen) {
                self.cross([before, omega], [last, l]);
            }
            self.margin([before, omega], [last, l]);
        }
        match (interval, &mut self.band) {
            (None, None) => {}
            (Some(interval), band) => {
                let from_first = self.last.is_none();
                let band = band.get_or_insert_with(|| Band::new(l, from_first));
                band.push(omega, interval);
                band.last_imaginary = l.im;
            }
            (None, Some(_)) => self.finish(omega),
        }
        self.last = Some((omega, l));
    }

    /// Adds the phase crossing between two frequencies with their loops.
    fn cross(&mut self, [before, after]: [f64; 2], ends: [Complex64; 2]) {
        let crossing = root(|omega| self.open_loop.at(omega).im, before, after, 0.0);
        let l = self.open_loop.at(crossing);
        if let Some(interval) = self.limits.forbidden(crossing, l) {
            let margin = self.limits.at_phase_crossing(l);
            let band = self.band.get_or_insert_with(|| Band::new(ends[0], false));
            band.push(crossing, union(Some(interval), margin).unwrap_or(margin));
            band.last_imaginary = ends[1].im;
        }
    }

    /// Adds the frequency between two others, with their loops, at which a margin of phase or delay begins or ends to be kept: the
    /// gain there is an end of the forbidden ones, but no extremum.
    fn margin(&mut self, [before, after]: [f64; 2], ends: [Complex64; 2]) {
        let excess = |omega: f64, l: Complex64| self.limits.phase_excess(omega, l);
        let (Some(first), Some(last)) = (excess(before, ends[0]), excess(after, ends[1])) else {
            return;
        };
        if (first < 0.0) == (last < 0.0) {
            return;
        }
        let at = |omega: f64| excess(omega, self.open_loop.at(omega)).unwrap_or(0.0);
        let edge = root(at, before, after, 0.0);
        let l = self.open_loop.at(edge);
        let one = 1.0 / l.norm();
        let interval = union(self.limits.forbidden(edge, l), (one, one));
        if let Some(interval) = interval {
            let band = self.band.get_or_insert_with(|| Band::new(l, false));
            band.push(edge, interval);
            band.last_imaginary = l.im;
        }
    }

    /// Ends the band before `omega`.
    fn finish(&mut self, omega: f64) {
        if let Some(mut band) = self.band.take() {
            band.finish(omega);
            self.turns += band.turns();
            if self.turns >= 0 {
                // Higher gains are stable again.
                self.least = f64::INFINITY;
            } else if band.turns() < 0 && !band.from_first {
                self.least = self.least.min(band.low);
            }
            self.bands.push(band);
        }
    }

    /// Turns at frequency zero, by the integrators and the unstable pole of the loop.
    fn first_turns(&self) -> i32 {
        let zeros = |c: &[f64]| c.iter().take_while(|c| **c == 0.0).count();
        let integrators = zeros(self.open_loop.denominator.coefficients());
        let turning = integrators + 2 * self.open_loop.unstable_poles;
        -i32::from(turning > 2 + zeros(self.open_loop.numerator.coefficients()))
    }

    /// Whether a gain just below the band `at` is allowed.
    fn is_allowed(&self, at: &Band) -> bool {
        let mut turns = self.first_turns();
        for band in &self.bands {
            if at.low > band.low && at.low < band.high {
                return false;
            }
            if at.low >= band.high {
                turns += band.turns();
            }
        }
        turns == 0
    }

    /// The ends of the allowed gains on the grid: the highest stable ones, or by how much they miss each other.
    fn ends(&self) -> Result<[f64; 2], NoGain> {
        let tops = self.bands.iter().filter(|band| band.low > 0.0);
        let high = (tops.clone().filter(|band| self.is_allowed(band)))
            .map(|band| band.low)
            .fold(0.0, f64::max);
        if high > 0.0 {
            return Ok([self.highest_below(high), high]);
        }
        // The bands that turn upwards ask for more gain than those that turn downwards allow.
        let high = (tops.clone().filter(|band| band.turns() < 0))
            .map(|band| band.low)
            .fold(f64::INFINITY, f64::min);
        let is_lower = |band: &&Band| band.turns() > 0 || band.from_first;
        let low = (self.bands.iter().filter(is_lower))
            .map(|band| band.high)
            .fold(0.0, f64::max);
        if low > high {
            Ok([low, high])
        } else {
            Err(NoGain::Unstable)
        }
    }

    /// Highest end of the bands below a gain.
    fn highest_below(&self, gain: f64) -> f64 {
        let ends = self.bands.iter().map(|band| band.high);
        ends.filter(|high| *high <= gain).fold(0.0, f64::max)
    }

    /// Refines an extremum of the lower (`true`) or upper end of the forbidden gains.
    fn refine(&self, extremum: &Extremum, is_low: bool) -> (f64, f64) {
        let (omega, gain) = between(
            self.open_loop,
            self.limits,
            (extremum.between, self.tolerance),
            is_low,
        );
        let is_better = if is_low {
            gain < extremum.gain
        } else {
            gain > extremum.gain
        };
        if is_better {
            (omega, gain)
        } else {
            (extremum.omega, extremum.gain)
        }
    }

    fn allowed(&self) -> Result<Allowed, NoGain> {
        let [low, high] = self.ends()?;
        let rounding = 1e-12;
        let upper: Vec<(f64, f64)> = (self.bands.iter())
            .flat_map(|band| &band.lows)
            .filter(|e| e.gain >= high * (1.0 - rounding) && e.gain <= WORTH_REFINING * high)
            .map(|extremum| self.refine(extremum, true))
            .collect();
        let lower: Vec<(f64, f64)> = (self.bands.iter())
            .flat_map(|band| &band.highs)
            .filter(|e| e.gain <= low * (1.0 + rounding) && e.gain * WORTH_REFINING >= low)
            .map(|extremum| self.refine(extremum, false))
            .collect();
        let least = upper.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let (omega, high) = *least.ok_or(NoGain::Unstable)?;
        Ok(Allowed {
            high,
            omega,
            low: lower.iter().map(|(_, gain)| *gain).fold(low, f64::max),
            upper,
            lower,
        })
    }
}

/// Frequency and value of the least lower (`true`) or largest upper end of the forbidden gains between two frequencies.
fn between(
    open_loop: &OpenLoop,
    limits: &Limits,
    (ends, tolerance): ([f64; 2], f64),
    is_low: bool,
) -> (f64, f64) {
    let end = |ln: f64| {
        let omega = ln.exp();
        match limits.forbidden(omega, open_loop.at(omega)) {
            Some((low, _)) if is_low => low,
            Some((_, high)) => -high,
            None if is_low => f64::INFINITY,
            None => 0.0,
        }
    };
    let [low, high] = ends.map(f64::ln);
    let (ln, value) = minimum(end, low, high, tolerance);
    (ln.exp(), value.abs())
}

/// Value of the extremum of the forbidden gains near a frequency: of the lower end (`true`) or of the upper one.
pub(crate) fn extremum(open_loop: &OpenLoop, limits: &Limits, omega: f64, is_low: bool) -> f64 {
    let ends = [omega * 0.94, omega * 1.06];
    between(open_loop, limits, (ends, TOLERANCE), is_low).1
}

/// Gains of the shape in `open_loop` (its gain is 1) that `limits` allow. `path` is the feedback path of the shape, `grid`
/// the process. The scan starts at the first of `ends`; neither `|L|` nor the phase rises above the second.
pub(crate) fn allowed(
    grid: &mut Grid,
    open_loop: &OpenLoop,
    path: impl Fn(f64) -> Complex64,
    limits: &Limits,
    [first, corner]: [f64; 2],
) -> Result<Allowed, NoGain> {
    let mut scan = Scan {
        limits,
        open_loop,
        tolerance: if grid.fraction > ROUGH {
            ROUGH_TOLERANCE
        } else {
            TOLERANCE
        },
        band: None,
        bands: Vec::new(),
        turns: 0,
        least: f64::INFINITY,
        last: None,
    };
    scan.turns = scan.first_turns();
    let share = (1.0 - 1.0 / limits.ms.min(limits.mt)).min(1.0 / limits.gain_margin);
    let start = grid.first_from(first);
    for i in start..start + MOST_FREQUENCIES {
        let (omega, process) = grid.point(i);
        let l = process * path(omega);
        scan.add(omega, l);
        // With falling |L| no later frequency forbids gains below share/|l|.
        if omega > corner && share * share > 4.0 * scan.least * scan.least * l.norm_sqr() {
            return scan.allowed();
        }
        if omega > corner && l.norm_sqr() == 0.0 {
            break;
        }
        // A loop whose phase stays above -pi has no limit.
        if scan.least == f64::INFINITY && omega > LAST * (1.0 + corner) && scan.band.is_none() {
            break;
        }
    }
    Err(NoGain::Unbounded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::Law;
    use crate::analysis::process::Stage;
    use crate::controller::Execution;

    /// Gains `k` that the limits allow the loop `k e^(-s)/s`, on a grid of this fraction.
    fn of_integrator(limits: &Limits, fraction: f64) -> Allowed {
        let process =
            Process::of_stages(1.0, &[Stage::Pole(0.0)], 1.0, &Execution::default()).unwrap();
        let law = Law::pid(&process, [1.0, 0.0, 0.0], 0.0);
        let plant = OpenLoop::new(&process, &law);
        let mut grid = Grid::new(&process, plant, fraction);
        let path = |_: f64| Complex64::ONE;
        allowed(&mut grid, &plant, path, limits, [0.01, 0.0]).unwrap()
    }

    // k e^(-s)/s turns about -1 at k = pi/2. Ms = Mt = m allows a gain below that: the closer, the larger m. The forbidden
    // phases are 2 asin(1/m) wide, 0.2 rad for m = 10, but a step of the coarse grid turns the plot by 0.6 rad.
    #[test]
    fn a_coarse_grid_sees_narrow_bands() {
        for m in [1.6, 3.0, 10.0] {
            let found = [0.04, 0.15].map(|fraction| of_integrator(&Limits::of(m), fraction));
            assert!((found[1].high / found[0].high - 1.0).abs() < 1e-6, "{m}");
            let ultimate = std::f64::consts::FRAC_PI_2;
            let share = found[0].high / ultimate;
            assert!(share < 1.0 && share > 1.0 - 2.0 / m, "{m} {share}");
        }
    }

    // k e^(-s)/s has the phase margin pi/2 - k: a margin of 60 deg allows k = pi/6, and a delay margin d the k with
    // pi/2 - k = k d. On a coarse grid too, whose frequencies miss both.
    #[test]
    fn margins_of_phase_and_delay_are_exact() {
        let of_phase = Limits {
            phase_margin_rad: std::f64::consts::FRAC_PI_3,
            ..Limits::of(1e3)
        };
        let of_delay = Limits {
            delay_margin: 2.0,
            ..Limits::of(1e3)
        };
        let most = std::f64::consts::FRAC_PI_6;
        for limits in [of_phase, of_delay] {
            for fraction in [0.04, 0.15] {
                let high = of_integrator(&limits, fraction).high;
                assert!((high / most - 1.0).abs() < 1e-9, "{fraction} {high}");
            }
        }
    }
}
