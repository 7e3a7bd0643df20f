//! Optimal PD gains from a table: an interpolation on board instead of a search.
//!
//! At a given phase margin the best controller is one angle, its lead `psi` at the gain crossover. The angle
//! depends on the shape of the process only, and the cost is flat in it at the optimum, so an interpolated lead
//! costs the square of its error. The crossover `w` then follows from the phase and the gains from the
//! magnitude, both exactly, so the margin is exact:
//!
//! ```text
//! arg G(jw) + psi = PM - pi,    Kp = cos(psi) / |G(jw)|,    Kd = sin(psi) / (w |G(jw)|)
//! ```
//!
//! | symbol | name               | unit                     |
//! |--------|--------------------|--------------------------|
//! | PM     | `phase_margin_rad` | rad                      |
//! | psi    | `lead_rad`         | rad                      |
//! | w      | `omega`            | rad/s                    |
//! | Kp, Kd | `Pd`               | see [`Pd`]               |
//!
//! Coordinates of the table, with the two lags ordered by size, `T_1 <= T_2` (`G` does not change when they are
//! exchanged):
//!
//! | coordinate                                | from               | to                     |
//! |-------------------------------------------|--------------------|------------------------|
//! | `x = tau / (T_1 + tau)`                   | 0, no dead time    | 20/21, `tau = 20 T_1`  |
//! | `y = (2 T_1 + tau) / (T_1 + T_2 + tau)`   | 0, no damping      | 1, equal lags          |
//!
//! The nodes are equally spaced in `s`, where `u = c s / (1 - s + c s)` is a coordinate scaled to 0..1 and `c`
//! the stretch of its axis. A stretch below one puts more nodes where `u` is small.
//!
//! A table is a row of f32, or of their little-endian bytes: the [`Nodes`], then [`FIELDS`] angles (rad) per
//! node, with the index of the dead time first: lead of the best PD at the margin of the table; margin of the
//! best PD of all; lead of that PD. The last two are used where a larger margin than the one asked for costs
//! less, which is where the dead time dominates.
//!
//! Reference: equations 11 to 13 of the paper.

mod nodes;

use core::f64::consts::FRAC_PI_2;
use core::fmt;

use libm::{atan, atan2, cos, sin};

pub use self::nodes::{FIELDS, HEADER, LARGEST_DELAY_IN_LAGS, LeadTableError, Nodes};
use self::nodes::{cubic, is_acute};
use crate::control::Pd;
use crate::process::Soiptd;

/// Newton's method takes two to eleven steps, five on average.
const MAX_NEWTON_STEPS: usize = 30;

/// Relative step at which Newton's method ends: its square, the remaining error, is rounding.
const NEWTON_TOLERANCE: f64 = 1e-9;

/// Why a table has no gains for a process.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum GainsError {
    /// The dead time exceeds [`LARGEST_DELAY_IN_LAGS`] shorter lags: its number of shorter lags.
    DeadTime(f64),
    /// Gain or times are so extreme that the gains of the controller overflow.
    Overflow,
}

impl fmt::Display for GainsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DeadTime(lags) => write!(
                f,
                "the dead time is {lags} times the shorter lag, but the lead table ends at \
                 {LARGEST_DELAY_IN_LAGS} times: search for the optimum instead"
            ),
            Self::Overflow => write!(
                f,
                "the gains for this process overflow: its gain or times are too extreme"
            ),
        }
    }
}

impl core::error::Error for GainsError {}

/// Numbers of a table: in memory, or as bytes in flash or a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Numbers<'a> {
    Floats(&'a [f32]),
    LittleEndian(&'a [[u8; 4]]),
}

impl Numbers<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Floats(floats) => floats.len(),
            Self::LittleEndian(bytes) => bytes.len(),
        }
    }

    fn get(&self, index: usize) -> f32 {
        match self {
            Self::Floats(floats) => floats[index],
            Self::LittleEndian(bytes) => f32::from_le_bytes(bytes[index]),
        }
    }
}

/// Lead table: optimal controllers of one phase margin, with borrowed numbers. Every number is checked when the
/// table is made, so using it costs no check. See the [module](self).
///
/// ```
/// use onecycle_onboard::gains::{GainsError, LeadTable, Nodes};
/// use onecycle_onboard::Soiptd;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // The same lead of 65 degrees for every shape.
/// let nodes = Nodes { phase_margin_rad: 0.35, delay_stretch: 1.0, lag_stretch: 1.0, points: 4 };
/// let mut numbers = [1.134_f32; 52];
/// numbers[..4].copy_from_slice(&nodes.header());
/// let table = LeadTable::from_floats(&numbers)?;
///
/// let process = Soiptd::new(1.0, 0.3, 2.0, 0.1)?;
/// let pd = table.pd_at_phase_margin(&process)?;
/// assert!((pd.kp - 8.5).abs() < 0.5 && (pd.kd - 7.0).abs() < 0.5);
///
/// let delayed = Soiptd::new(1.0, 0.001, 2.0, 0.1)?;
/// assert_eq!(table.pd_at_phase_margin(&delayed), Err(GainsError::DeadTime(100.0)));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadTable<'a> {
    nodes: Nodes,
    numbers: Numbers<'a>,
}

impl<'a> LeadTable<'a> {
    /// A table from its numbers.
    ///
    /// # Errors
    /// The first number that is invalid.
    pub fn from_floats(floats: &'a [f32]) -> Result<Self, LeadTableError> {
        Self::new(Numbers::Floats(floats))
    }

    /// A table from its numbers as little-endian bytes, as in a file or in flash.
    ///
    /// # Errors
    /// Those of [`LeadTable::from_floats`], and [`LeadTableError::Bytes`] if the length is not a multiple of
    /// four.
    pub fn from_bytes(bytes: &'a [u8]) -> Result<Self, LeadTableError> {
        match bytes.as_chunks() {
            (numbers, []) => Self::new(Numbers::LittleEndian(numbers)),
            _ => Err(LeadTableError::Bytes(bytes.len())),
        }
    }

    fn new(numbers: Numbers<'a>) -> Result<Self, LeadTableError> {
        let found = numbers.len();
        if found < HEADER {
            let expected = HEADER;
            return Err(LeadTableError::Length { expected, found });
        }
        let nodes = Nodes::from_header(core::array::from_fn(|i| numbers.get(i)))?;
        let expected = nodes.length();
        if found != expected {
            return Err(LeadTableError::Length { expected, found });
        }
        for index in HEADER..found {
            let value = numbers.get(index);
            if !is_acute(value) {
                return Err(LeadTableError::Angle { index, value });
            }
        }
        Ok(Self { nodes, numbers })
    }

    /// Position of the nodes, and phase margin.
    #[must_use]
    pub fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    /// The best PD with at least the margin of the table: the one to use in flight.
    ///
    /// # Errors
    /// [`GainsError::DeadTime`] outside the table; [`GainsError::Overflow`] near the limits of `f64`.
    pub fn pd(&self, process: &Soiptd) -> Result<Pd, GainsError> {
        let [lead_rad, free_margin_rad, free_lead_rad] = self.angles(process)?;
        let floor_rad = self.phase_margin_rad();
        if free_margin_rad > floor_rad {
            gains(process, free_margin_rad, free_lead_rad)
        } else {
            gains(process, floor_rad, lead_rad)
        }
    }

    /// The best PD with exactly the margin of the table, which is the constraint of the paper.
    ///
    /// # Errors
    /// Those of [`LeadTable::pd`].
    pub fn pd_at_phase_margin(&self, process: &Soiptd) -> Result<Pd, GainsError> {
        let [lead_rad, ..] = self.angles(process)?;
        gains(process, self.phase_margin_rad(), lead_rad)
    }

    /// Phase margin that the table is made for (rad), between 0 and `pi/2`.
    #[must_use]
    pub fn phase_margin_rad(&self) -> f64 {
        f64::from(self.nodes.phase_margin_rad)
    }

    /// Angles at a process (rad): cubic interpolation over four nodes along either axis.
    fn angles(&self, process: &Soiptd) -> Result<[f64; FIELDS], GainsError> {
        let [delay, lag] = self.nodes.position(process)?;
        if !(delay.is_finite() && lag.is_finite()) {
            return Err(GainsError::Overflow);
        }
        let points = self.nodes.points;
        let (first_delay, delay_weights) = cubic(delay, points);
        let (first_lag, lag_weights) = cubic(lag, points);
        let mut angles = [0.0; FIELDS];
        for (i, delay_weight) in delay_weights.iter().enumerate() {
            for (j, lag_weight) in lag_weights.iter().enumerate() {
                let node = (first_delay + i) * points + first_lag + j;
                for (field, angle) in angles.iter_mut().enumerate() {
                    let number = self.numbers.get(HEADER + FIELDS * node + field);
                    *angle += delay_weight * lag_weight * f64::from(number);
                }
            }
        }
        Ok(angles)
    }
}

/// The PD with this margin and this lead at its crossover.
fn gains(process: &Soiptd, phase_margin_rad: f64, lead_rad: f64) -> Result<Pd, GainsError> {
    let omega = crossover(process, lead_rad - phase_margin_rad).ok_or(GainsError::Overflow)?;
    let over_magnitude = 1.0 / process.magnitude(omega);
    let proportional = cos(lead_rad) * over_magnitude;
    let derivative = sin(lead_rad) * over_magnitude / omega;
    let is_right = |gain: f64| gain > 0.0 && gain.is_finite();
    if !(is_right(proportional) && is_right(derivative)) {
        return Err(GainsError::Overflow);
    }
    let sign = process.k_over_t_body().signum();
    Ok(Pd {
        kp: sign * proportional,
        kd: sign * derivative,
    })
}

/// Frequency (rad/s) at which the process lags by `lag_rad` beyond `-pi`:
///
/// `f(w) = atan(w T_prop) + w tau - atan(1/(w T_body)) = lag_rad`.
///
/// `f` rises and is concave, so Newton's method climbs to the root from any point below it. Tangents of `f` lie
/// above it and give such points: the tangent at zero and the one without damping.
fn crossover(process: &Soiptd, lag_rad: f64) -> Option<f64> {
    let (lag_s, tau_s) = (process.t_prop_s(), process.tau_s());
    let damping = process.inv_t_body_per_s();
    let reach_s = lag_s + tau_s;
    let undamped_s = reach_s + process.t_body_s().unwrap_or(f64::MAX);
    let mut omega = (lag_rad / reach_s).max((lag_rad + FRAC_PI_2) / undamped_s);
    for _ in 0..MAX_NEWTON_STEPS {
        let phase = omega * lag_s;
        let value = atan(phase) + omega * tau_s - atan2(damping, omega) - lag_rad;
        let slope =
            lag_s / (1.0 + phase * phase) + tau_s + damping / (damping * damping + omega * omega);
        let step = value / slope;
        omega -= step;
        if step.abs() <= NEWTON_TOLERANCE * omega {
            break;
        }
    }
    (omega > 0.0 && omega.is_finite()).then_some(omega)
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use libm::{fabs, sqrt, tan};

    use super::*;

    const NODES: Nodes = Nodes {
        phase_margin_rad: 0.25,
        delay_stretch: 0.5,
        lag_stretch: 2.0,
        points: 5,
    };

    const LENGTH: usize = 79;

    fn table_of(angles_rad: [f32; FIELDS]) -> [f32; LENGTH] {
        let mut numbers = [0.0; LENGTH];
        let (header, nodes) = numbers.split_at_mut(HEADER);
        header.copy_from_slice(&NODES.header());
        nodes.as_chunks_mut().0.fill(angles_rad);
        numbers
    }

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        fabs(a - b) <= tolerance * fabs(b)
    }

    // In these cases f is one arc tangent: w T = tan(lag) without damping and dead time; 2 atan(w T) - pi/2 =
    // lag with equal lags; w tau - pi/2 + atan(w T_body) = lag with negligible T_prop, here with w T_body = 1.
    // Newton's method stops at 1e-9, with an error of the square of that.
    #[test]
    fn crossovers_by_hand() {
        for lag_rad in [0.01, 0.3, 1.0, 1.5] {
            let process = Soiptd::from_acceleration_gain(1.0, 0.2, 0.0, 0.0).unwrap();
            let omega = crossover(&process, lag_rad).unwrap();
            assert!(close(omega, tan(lag_rad) / 0.2, 1e-12), "{lag_rad} {omega}");

            let process = Soiptd::from_acceleration_gain(1.0, 0.2, 5.0, 0.0).unwrap();
            for lag_rad in [lag_rad, -lag_rad] {
                let omega = crossover(&process, lag_rad).unwrap();
                let expected = tan(0.5 * (lag_rad + FRAC_PI_2)) / 0.2;
                assert!(close(omega, expected, 1e-12), "{lag_rad} {omega}");
            }
        }
        let process = Soiptd::from_acceleration_gain(1.0, 1e-15, 2.0, 0.5).unwrap();
        let omega = crossover(&process, 1.0 - 0.25 * PI).unwrap();
        assert!(close(omega, 2.0, 1e-12), "{omega}");
        // A double integrator always lags by pi or more.
        let process = Soiptd::from_acceleration_gain(1.0, 0.2, 0.0, 0.1).unwrap();
        assert_eq!(crossover(&process, -0.1), None);
    }

    // Double integrator with A = -3, T = 0.2 s and a lead of pi/4 above the margin: w T = 1, so w = 5 and 1/|G|
    // = 25 sqrt(2) / 3. Binary fractions are exact in f32, so the lead is rounded only once.
    #[test]
    fn gains_by_hand() {
        let lead_rad = 0.25 + 0.25 * PI;
        let numbers = table_of([lead_rad as f32, 0.125, 1.25]);
        let table = LeadTable::from_floats(&numbers).unwrap();
        let process = Soiptd::from_acceleration_gain(-3.0, 0.2, 0.0, 0.0).unwrap();
        let pd = table.pd_at_phase_margin(&process).unwrap();
        let over_magnitude = -25.0 * sqrt(2.0) / 3.0;
        assert!(close(pd.kp, over_magnitude * cos(lead_rad), 1e-6));
        assert!(close(pd.kd, over_magnitude * sin(lead_rad) / 5.0, 1e-6));
        // The free margin is below that of the table, so the table's margin applies.
        assert_eq!(table.pd(&process), Ok(pd));

        // A free margin above that of the table is used, with its own lead: w T = tan(1.25 - 0.5).
        let numbers = table_of([1.0, 0.5, 1.25]);
        let table = LeadTable::from_floats(&numbers).unwrap();
        let pd = table.pd(&process).unwrap();
        let omega = tan(0.75) / 0.2;
        let over_magnitude = -omega * omega / cos(0.75) / 3.0;
        assert!(close(pd.kp, over_magnitude * cos(1.25), 1e-12));
        assert!(close(pd.kd, over_magnitude * sin(1.25) / omega, 1e-12));
    }

    #[test]
    fn bytes_are_the_numbers() {
        let numbers = table_of([1.0, 0.5, 1.25]);
        let mut bytes = [[0; 4]; LENGTH];
        for (bytes, number) in bytes.iter_mut().zip(numbers) {
            *bytes = number.to_le_bytes();
        }
        let bytes = bytes.as_flattened();
        let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
        let gains = |table: LeadTable| (table.pd(&process), table.pd_at_phase_margin(&process));
        assert_eq!(
            gains(LeadTable::from_bytes(bytes).unwrap()),
            gains(LeadTable::from_floats(&numbers).unwrap())
        );
        assert_eq!(
            LeadTable::from_bytes(&bytes[..9]).err(),
            Some(LeadTableError::Bytes(9))
        );
    }

    #[test]
    fn errors_name_the_number() {
        let right = table_of([1.0, 0.5, 1.25]);
        let error = |numbers: &[f32]| LeadTable::from_floats(numbers).err();
        assert_eq!(error(&right), None);
        for (index, value) in [
            (0, 0.0),
            (0, 1.6),
            (0, f32::NAN),
            (1, 0.0),
            (2, f32::INFINITY),
            (3, 4.5),
            (3, 3.0),
            (3, 1001.0),
        ] {
            let mut numbers = right;
            numbers[index] = value;
            match error(&numbers) {
                Some(LeadTableError::Header { index: found, .. }) => assert_eq!(found, index),
                other => panic!("{index} {value}: {other:?}"),
            }
        }
        for value in [0.0, -1.0, 1.6, f32::NAN] {
            let mut numbers = right;
            numbers[LENGTH - 1] = value;
            match error(&numbers) {
                Some(LeadTableError::Angle { index, .. }) => assert_eq!(index, LENGTH - 1),
                other => panic!("{value}: {other:?}"),
            }
        }
        let length = |expected, found| Some(LeadTableError::Length { expected, found });
        assert_eq!(error(&right[..LENGTH - 1]), length(LENGTH, LENGTH - 1));
        assert_eq!(error(&right[..3]), length(HEADER, 3));
    }

    // 20 shorter lags are the end of the table, whichever lag is the shorter; 21 are outside.
    #[test]
    fn processes_outside_are_errors() {
        let numbers = table_of([1.0, 0.5, 1.25]);
        let table = LeadTable::from_floats(&numbers).unwrap();
        let gains = |gain, t_prop_s, t_body_s, tau_s| {
            table.pd(&Soiptd::new(gain, t_prop_s, t_body_s, tau_s).unwrap())
        };
        assert!(gains(1.0, 0.1, 1.0, 2.0).is_ok());
        assert!(gains(1.0, 1.0, 0.1, 2.0).is_ok());
        for (t_prop_s, t_body_s) in [(0.125, 1.0), (1.0, 0.125)] {
            let error = gains(1.0, t_prop_s, t_body_s, 2.625);
            assert_eq!(error, Err(GainsError::DeadTime(21.0)));
        }
        assert_eq!(gains(1e-300, 1e-9, 1e-9, 0.0), Err(GainsError::Overflow));
    }
}
