//! State of a vehicle in words and numbers.

use mavlink::MessageData;
use mavlink::dialects::common::{
    AUTOPILOT_VERSION_DATA, ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, EstimatorStatusFlags,
    LOCAL_POSITION_NED_DATA, MavLandedState, MavSysStatusSensor, SYS_STATUS_DATA,
};
use onecycle_link::{ControlLoop, FirmwareKind, gain_names};

use crate::error::LiveError;
use crate::mode;
use crate::vehicle::{ANSWER, TRIES, Vehicle};

/// What a vehicle tells about itself.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct State {
    /// Firmware; `None`: another one than PX4 and ArduPilot.
    pub firmware: Option<FirmwareKind>,
    /// Version with the kind of release; `None`: not told.
    pub version: Option<String>,
    /// Type of the vehicle, such as `quadrotor`.
    pub kind: String,
    /// Number of the vehicle.
    pub system: u8,
    /// Whether its messages are signed, and ours.
    pub is_signed: bool,
    /// Whether the motors are armed.
    pub is_armed: bool,
    /// Whether it is in the air; `None`: not told.
    pub is_in_air: Option<bool>,
    /// Flight mode.
    pub mode: String,
    /// State of the system, such as `standby` or `critical`.
    pub status: String,
    /// Battery; `None`: not told.
    pub battery: Option<Battery>,
    /// Position in metres north, east and up from the origin of the estimator; `None`: not estimated.
    pub position_m: Option<[f64; 3]>,
    /// What the estimator does not estimate, of attitude, velocity, height and position; `None`: not told.
    pub not_estimated: Option<Vec<&'static str>>,
    /// Sensors and functions that are in use and report a fault; `None`: not told.
    pub unhealthy: Option<Vec<&'static str>>,
    /// Gains of the loops: those that the firmware has.
    pub gains: Vec<LoopParameters>,
    /// The last messages of text, the newest last.
    pub texts: Vec<String>,
}

/// Battery of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Battery {
    /// Voltage (V); `None`: not measured.
    pub voltage_v: Option<f64>,
    /// Charge that is left, 0 to 1; `None`: not estimated.
    pub charge: Option<f64>,
}

/// Parameters of the gains of a loop.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LoopParameters {
    /// Which loop.
    pub control_loop: ControlLoop,
    /// Names and values.
    pub parameters: Vec<(String, f64)>,
}

impl Vehicle {
    /// Asks for the state and the gains.
    ///
    /// # Errors
    /// The link is lost.
    pub fn state(&mut self) -> Result<State, LiveError> {
        self.gather();
        let gains = self.gains()?;
        let heartbeat = self.seen.heartbeat.as_ref().ok_or(LiveError::Lost)?;
        let status = self.seen.sys_status.as_ref();
        let landed = self.seen.extended.as_ref().map(|of| of.landed_state);
        Ok(State {
            firmware: self.firmware(),
            version: self.version.as_ref().and_then(version),
            kind: mode::word(&format!("{:?}", heartbeat.mavtype), "MAV_TYPE_"),
            system: self.system(),
            is_signed: self.channel.is_signed(),
            is_armed: self.is_armed(),
            is_in_air: landed.and_then(is_in_air),
            mode: mode::name(heartbeat),
            status: mode::word(&format!("{:?}", heartbeat.system_status), "MAV_STATE_"),
            battery: status.and_then(battery),
            position_m: (self.seen.position.as_ref()).map(|of| [of.x, of.y, -of.z].map(f64::from)),
            not_estimated: self.not_estimated(),
            unhealthy: status.map(unhealthy),
            gains,
            texts: self.seen.texts.clone(),
        })
    }

    /// Asks for the messages of the state, a few times: no firmware sends all of them, and a busy one forgets some.
    fn gather(&mut self) {
        for _ in 0..TRIES {
            let seen = &self.seen;
            let is_px4 = self.firmware() == Some(FirmwareKind::Px4);
            let wanted = [
                (SYS_STATUS_DATA::ID, seen.sys_status.is_some()),
                (
                    ESTIMATOR_STATUS_DATA::ID,
                    seen.estimator.is_some() || !is_px4,
                ),
                (LOCAL_POSITION_NED_DATA::ID, seen.position.is_some()),
                (EXTENDED_SYS_STATE_DATA::ID, seen.extended.is_some()),
            ];
            let missing = wanted.into_iter().filter(|(_, is_there)| !is_there);
            let missing: Vec<u32> = missing.map(|(message, _)| message).collect();
            if missing.is_empty() {
                return;
            }
            for message in missing {
                self.request(message);
            }
            let until = self.now() + ANSWER;
            while self.receive(until).is_some() {}
        }
    }

    fn gains(&mut self) -> Result<Vec<LoopParameters>, LiveError> {
        let Some(firmware) = self.firmware() else {
            return Ok(Vec::new());
        };
        let names_of = |of| gain_names(firmware, of).into_iter().map(|(_, name)| name);
        let names: Vec<String> = ControlLoop::ALL.into_iter().flat_map(names_of).collect();
        let values = self.parameters(&names)?;
        let loop_of = |control_loop| {
            let value = |name: String| {
                let parameter = values.get(&name).copied().flatten()?;
                Some((name, parameter.value))
            };
            LoopParameters {
                control_loop,
                parameters: names_of(control_loop).filter_map(value).collect(),
            }
        };
        let loops = ControlLoop::ALL.into_iter().map(loop_of);
        Ok(loops.filter(|of| !of.parameters.is_empty()).collect())
    }

    fn not_estimated(&self) -> Option<Vec<&'static str>> {
        use EstimatorStatusFlags as Flag;
        if let Some(estimator) = &self.seen.estimator {
            let horizontal = Flag::ESTIMATOR_POS_HORIZ_REL | Flag::ESTIMATOR_POS_HORIZ_ABS;
            let vertical = Flag::ESTIMATOR_POS_VERT_ABS | Flag::ESTIMATOR_POS_VERT_AGL;
            let parts = [
                ("attitude", Flag::ESTIMATOR_ATTITUDE),
                ("velocity", Flag::ESTIMATOR_VELOCITY_VERT),
                ("height", vertical),
                ("position", horizontal),
            ];
            let is_missing = |flags| !estimator.flags.intersects(flags);
            let missing = parts.into_iter().filter(|(_, flags)| is_missing(*flags));
            return Some(missing.map(|(name, _)| name).collect());
        }
        let health = self
            .seen
            .sys_status
            .as_ref()?
            .onboard_control_sensors_health;
        let is_healthy = health.contains(MavSysStatusSensor::MAV_SYS_STATUS_AHRS);
        let mut missing = if is_healthy { vec![] } else { vec!["attitude"] };
        if self.seen.position.is_none() {
            missing.push("position");
        }
        Some(missing)
    }
}

/// One byte each of major, minor and patch version, and of the kind of release.
fn version(message: &AUTOPILOT_VERSION_DATA) -> Option<String> {
    let [major, minor, patch, release] = message.flight_sw_version.to_be_bytes();
    if [major, minor, patch] == [0; 3] {
        return None;
    }
    let release = match release {
        0..64 => " dev",
        64..128 => " alpha",
        128..192 => " beta",
        192..255 => " rc",
        255 => "",
    };
    Some(format!("{major}.{minor}.{patch}{release}"))
}

fn is_in_air(state: MavLandedState) -> Option<bool> {
    match state {
        MavLandedState::MAV_LANDED_STATE_UNDEFINED => None,
        state => Some(state != MavLandedState::MAV_LANDED_STATE_ON_GROUND),
    }
}

/// The message has mV and per cent; 65535 mV and -1 % stand for an unknown value.
fn battery(status: &SYS_STATUS_DATA) -> Option<Battery> {
    let voltage_v = (status.voltage_battery != u16::MAX && status.voltage_battery > 0)
        .then(|| 1e-3 * f64::from(status.voltage_battery));
    let charge =
        (status.battery_remaining >= 0).then(|| 0.01 * f64::from(status.battery_remaining));
    let battery = Battery { voltage_v, charge };
    (voltage_v.is_some() || charge.is_some()).then_some(battery)
}

fn unhealthy(status: &SYS_STATUS_DATA) -> Vec<&'static str> {
    use MavSysStatusSensor as Sensor;
    let faulty = status.onboard_control_sensors_enabled - status.onboard_control_sensors_health;
    [
        ("gyro", Sensor::MAV_SYS_STATUS_SENSOR_3D_GYRO),
        ("accelerometer", Sensor::MAV_SYS_STATUS_SENSOR_3D_ACCEL),
        ("compass", Sensor::MAV_SYS_STATUS_SENSOR_3D_MAG),
        ("barometer", Sensor::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE),
        ("GPS", Sensor::MAV_SYS_STATUS_SENSOR_GPS),
        ("radio control", Sensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER),
        ("estimator", Sensor::MAV_SYS_STATUS_AHRS),
        ("battery", Sensor::MAV_SYS_STATUS_SENSOR_BATTERY),
        ("log", Sensor::MAV_SYS_STATUS_LOGGING),
        ("pre-arm checks", Sensor::MAV_SYS_STATUS_PREARM_CHECK),
    ]
    .into_iter()
    .filter(|(_, sensor)| faulty.contains(*sensor))
    .map(|(name, _)| name)
    .collect()
}
