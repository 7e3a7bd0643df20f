//! The mix of the motors: from their logged outputs back to the torque of an axis.
//!
//! ```text
//! PX4         motor_i = thrust + m_i . torque      m: pseudo-inverse of the geometry CA_ROTORn_*, scaled
//! ArduPilot   motor_i = thrust + m_i . output      m: frame, 0.5 at most; the PWM behind the thrust curve MOT_THST_EXPO
//! sum_i m_ia motor_i / sum_i m_ia^2 = torque of axis a
//! ```
//!
//! This holds for frames whose axes do not act on each other; others are not read back. Reference: PX4 user guide, "Control
//! Allocation"; ArduPilot documentation, "Connect ESCs and Motors", `MOT_THST_EXPO`.

use crate::log::flight::FirmwareKind;
use crate::log::loops::Axis;
use crate::log::plan::{Map, Quantity};
use crate::log::tables::FlightTables;

/// Most motors of a frame.
const MOST: usize = 12;
/// Least share of its range that a motor keeps from both ends: what is at a limit does not follow its torque.
const FREE: f64 = 0.005;
/// Largest cosine between the factors of two axes.
const COUPLED: f64 = 0.05;

/// Motors of a log with their place in the mix.
#[derive(Debug)]
pub(super) struct Motors {
    topic: &'static str,
    fields: Vec<String>,
    curve: Curve,
    /// Per motor: share of roll, pitch and yaw.
    factors: Vec<[f64; 3]>,
}

/// From what is logged of a motor to its thrust.
#[derive(Debug, Clone, Copy)]
enum Curve {
    /// The thrust itself.
    Thrust,
    /// Pulse width (us): ends of the range in which the motors spin, and `e` of `thrust = (1 - e) x + e x^2`.
    Pulse { ends_us: [f64; 2], expo: f64 },
}

impl Curve {
    /// Thrust as a share of the full one. `None`: at a limit.
    fn thrust(self, logged: f64) -> Option<f64> {
        let (share, thrust) = match self {
            Self::Thrust => (logged, logged),
            Self::Pulse { ends_us, expo } => {
                let x = (logged - ends_us[0]) / (ends_us[1] - ends_us[0]);
                (x, (1.0 - expo) * x + expo * x * x)
            }
        };
        (FREE..=1.0 - FREE).contains(&share).then_some(thrust)
    }
}

impl Motors {
    /// The motors of a multirotor. `None`: no such frame, or one whose axes act on each other.
    pub(super) fn of(kind: FirmwareKind, flight: &FlightTables) -> Option<Self> {
        let motors = match kind {
            FirmwareKind::Px4 => Self::px4(flight)?,
            FirmwareKind::ArduPilot => Self::ardupilot(flight)?,
            _ => return None,
        };
        motors.is_decoupled().then_some(motors)
    }

    fn px4(flight: &FlightTables) -> Option<Self> {
        let parameter = |name: &str| flight.parameter(name);
        let count = parameter("CA_ROTOR_COUNT")?;
        if parameter("CA_AIRFRAME")? != 0.0 || !(1.0..=MOST as f64).contains(&count) {
            return None;
        }
        // Torque per thrust: the rotors push up, body axes are forward, right, down.
        let effect = |at: usize| {
            let own = |field: &str| parameter(&format!("CA_ROTOR{at}_{field}"));
            let is_up = own("AX")? == 0.0 && own("AY")? == 0.0 && own("AZ")? < 0.0;
            is_up.then_some([-own("PY")?, own("PX")?, own("KM")?])
        };
        let effects: Option<Vec<[f64; 3]>> = (0..count as usize).map(effect).collect();
        let effects = effects?;
        let squares = |axis: usize| effects.iter().map(|of| of[axis] * of[axis]).sum::<f64>();
        let largest = effects
            .iter()
            .fold(0.0_f64, |most, of| most.max(of[2].abs()));
        // Roll and pitch have one scale: a unit of the torque moves the motors by 0.707 in the mean square, yaw by 1 at most.
        let weaker = squares(0).min(squares(1));
        let level = |axis: usize| {
            let acting = effects.iter().filter(|of| of[axis] != 0.0).count();
            (0.5 * acting as f64 * weaker).sqrt() / squares(axis)
        };
        let scale = [level(0), level(1), 1.0 / largest];
        Some(Self {
            topic: "actuator_motors",
            fields: (0..effects.len())
                .map(|at| format!("control[{at}]"))
                .collect(),
            curve: Curve::Thrust,
            factors: (effects.iter())
                .map(|of| [0, 1, 2].map(|axis| of[axis] * scale[axis]))
                .collect(),
        })
    }

    fn ardupilot(flight: &FlightTables) -> Option<Self> {
        /// Function of a servo output that is motor 1.
        const FIRST: f64 = 33.0;
        let parameter = |name: &str| flight.parameter(name);
        // Quadcopters plus and X: angle from the nose to the right (deg), and direction of the torque.
        let frame = match (parameter("FRAME_CLASS")?, parameter("FRAME_TYPE")?) {
            (1.0, 0.0) => [(90.0, 1.0), (-90.0, 1.0), (0.0, -1.0), (180.0, -1.0)],
            (1.0, 1.0) => [(45.0, 1.0), (-135.0, 1.0), (-45.0, -1.0), (135.0, -1.0)],
            _ => return None,
        };
        let output = |motor: usize| {
            let is_it = |output: &usize| {
                let function = parameter(&format!("SERVO{output}_FUNCTION"));
                function == Some(FIRST + motor as f64)
            };
            Some(format!("C{}", (1..=14).find(is_it)?))
        };
        let fields: Option<Vec<String>> = (0..frame.len()).map(output).collect();
        let of = |(angle_deg, turn): (f64, f64)| {
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            // Half of the full output at most, also in X.
            let share = 0.5 / sin.abs().max(cos.abs());
            [-share * sin, share * cos, 0.5 * turn]
        };
        let [low, high] = ["MOT_PWM_MIN", "MOT_PWM_MAX"].map(parameter);
        let [spin_low, spin_high] = ["MOT_SPIN_MIN", "MOT_SPIN_MAX"].map(parameter);
        let (low, range) = (low?, high? - low?);
        let ends_us = [low + spin_low? * range, low + spin_high? * range];
        (ends_us[1] > ends_us[0]).then_some(Self {
            topic: "RCOU",
            fields: fields?,
            curve: Curve::Pulse {
                ends_us,
                expo: parameter("MOT_THST_EXPO")?,
            },
            factors: frame.map(of).to_vec(),
        })
    }

    /// Whether thrust and the axes are orthogonal in the motors, and every axis has motors.
    fn is_decoupled(&self) -> bool {
        let column = |at: usize| -> Vec<f64> {
            let of = |factors: &[f64; 3]| factors.get(at).copied().unwrap_or(1.0);
            self.factors.iter().map(of).collect()
        };
        let dot = |a: usize, b: usize| -> f64 {
            column(a).iter().zip(column(b)).map(|(a, b)| a * b).sum()
        };
        let pairs = (0..4).flat_map(|a| (0..a).map(move |b| (a, b)));
        let cosine = |(a, b): (usize, usize)| dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
        // Not a number, of an axis without motors, is not below the limit.
        pairs.map(cosine).all(|cosine| cosine.abs() < COUPLED)
    }

    /// The columns to read.
    pub(super) fn quantity(&self) -> Quantity {
        Quantity {
            topic: self.topic,
            fields: self.fields.clone(),
            map: Map::Linear(vec![0.0; self.fields.len()], 0.0),
            stamp: None,
        }
    }

    /// Times (s) of the rows of the motors, and the torque of an axis that they put out. `None` where a motor is at a limit.
    pub(super) fn torque(
        &self,
        flight: &FlightTables,
        axis: Axis,
    ) -> Option<(Vec<f64>, Vec<Option<f64>>)> {
        let topic = flight.topic(self.topic)?;
        let columns: Option<Vec<&[f64]>> = (self.fields.iter())
            .map(|field| topic.column(field))
            .collect();
        let columns = columns?;
        let shares = || self.factors.iter().map(|factors| factors[axis.index()]);
        let size: f64 = shares().map(|share| share * share).sum();
        let mixed = |row: usize| {
            let thrusts: Option<Vec<f64>> = (columns.iter())
                .map(|column| self.curve.thrust(column[row]))
                .collect();
            let sum: f64 = thrusts?
                .iter()
                .zip(shares())
                .map(|(t, share)| t * share)
                .sum();
            Some(sum / size)
        };
        let torque = (0..topic.time_s.len()).map(mixed).collect();
        Some((topic.time_s.clone(), torque))
    }
}
