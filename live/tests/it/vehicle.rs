//! A vehicle by script: it answers the messages of a ground station as PX4 or ArduPilot do.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read};
use std::time::Duration;

use mavlink::dialects::common::*;
use mavlink::{
    MAVLinkMessageRaw, MavHeader, MavlinkReader, MavlinkVersion, Message, MessageData,
    SigningConfig, SigningData, write_versioned_msg_signed,
};
use onecycle_live::Key;

use crate::hovering::Hovering;

pub(crate) const SYSTEM: u32 = 7;
/// Modes: Hold and Offboard of PX4, Guided and Loiter of ArduCopter.
pub(crate) const HOLD: u32 = u32::from_le_bytes([0, 0, 4, 3]);
pub(crate) const OFFBOARD: u32 = u32::from_le_bytes([0, 0, 6, 0]);
pub(crate) const GUIDED: u32 = 4;
pub(crate) const LOITER: u32 = 5;
/// Time between two rounds of the vehicle: it sends its streams, and a heartbeat every second.
pub(crate) const ROUND: Duration = Duration::from_millis(20);

/// A parameter with its type.
pub(crate) type Value = (MavParamType, f64);

#[derive(Default)]
struct Bytes(Vec<u8>);

impl Read for Bytes {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.0.len().min(buffer.len());
        if count == 0 {
            return Err(ErrorKind::WouldBlock.into());
        }
        buffer[..count].copy_from_slice(&self.0[..count]);
        self.0.drain(..count);
        Ok(count)
    }
}

pub(crate) struct Scripted {
    pub(crate) autopilot: MavAutopilot,
    pub(crate) parameters: BTreeMap<String, Value>,
    /// Largest values: larger ones are clipped.
    pub(crate) most: BTreeMap<String, f64>,
    /// Whether it sends the first entry of its list of logs again and again, and no other.
    pub(crate) repeats_a_log: bool,
    /// Whether it answers about parameters that it does not have.
    pub(crate) tells_missing: bool,
    pub(crate) is_armed: bool,
    pub(crate) custom_mode: u32,
    /// Whether PX4 changes its mode on command.
    pub(crate) takes_modes: bool,
    /// Whether it is there at all.
    pub(crate) is_on: bool,
    /// Values that a restart brings back.
    pub(crate) stored: BTreeMap<String, Value>,
    /// Its flight; `None`: it stays on the ground.
    pub(crate) hovering: Option<Hovering>,
    /// Flight logs, by number from 1.
    pub(crate) logs: Vec<Vec<u8>>,
    signing: Option<SigningData>,
    /// Messages that it has received.
    pub(crate) received: Vec<MavMessage>,
    reader: MavlinkReader<Bytes>,
    sequence: u8,
    rounds: u64,
}

impl Scripted {
    pub(crate) fn new(autopilot: MavAutopilot, parameters: &[(&str, MavParamType, f64)]) -> Self {
        let owned = |&(name, kind, value): &(&str, _, _)| (name.to_owned(), (kind, value));
        let parameters: BTreeMap<String, Value> = parameters.iter().map(owned).collect();
        Self {
            autopilot,
            stored: parameters.clone(),
            parameters,
            most: BTreeMap::new(),
            repeats_a_log: false,
            tells_missing: false,
            is_armed: false,
            custom_mode: 0,
            takes_modes: true,
            is_on: true,
            hovering: None,
            logs: vec![],
            signing: None,
            received: Vec::new(),
            reader: MavlinkReader::new(Bytes::default()),
            sequence: 0,
            rounds: 0,
        }
    }

    pub(crate) fn px4() -> Self {
        use MavParamType::*;
        Self::new(
            MavAutopilot::MAV_AUTOPILOT_PX4,
            &[
                ("MC_ROLLRATE_P", MAV_PARAM_TYPE_REAL32, 0.15_f32.into()),
                ("MC_ROLLRATE_I", MAV_PARAM_TYPE_REAL32, 0.2_f32.into()),
                ("MC_ROLLRATE_D", MAV_PARAM_TYPE_REAL32, 0.003_f32.into()),
                ("SYS_AUTOSTART", MAV_PARAM_TYPE_INT32, 4001.0),
            ],
        )
    }

    pub(crate) fn ardupilot() -> Self {
        use MavParamType::*;
        Self::new(
            MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            &[
                ("ATC_RAT_RLL_P", MAV_PARAM_TYPE_REAL32, 0.135_f32.into()),
                ("ATC_RAT_RLL_I", MAV_PARAM_TYPE_REAL32, 0.135_f32.into()),
                ("ATC_RAT_RLL_D", MAV_PARAM_TYPE_REAL32, 0.0036_f32.into()),
                ("FRAME_CLASS", MAV_PARAM_TYPE_INT8, 1.0),
            ],
        )
    }

    /// Signs its messages and accepts only signed ones.
    pub(crate) fn with_key(mut self, key: &Key) -> Self {
        let config = SigningConfig::new(key.bytes(), 2, true, false);
        self.signing = Some(SigningData::from_config(config));
        self
    }

    /// Armed and in the air, with the mode of the hover and the parameter that the test needs.
    pub(crate) fn hovering(mut self, mut hovering: Hovering) -> Self {
        hovering.reports_when_set = self.is_px4();
        self.is_armed = true;
        self.hovering = Some(hovering);
        self.custom_mode = match self.is_px4() {
            true => HOLD,
            false => GUIDED,
        };
        let options = (MavParamType::MAV_PARAM_TYPE_INT32, 1.0);
        self.parameters.insert("GUID_OPTIONS".to_owned(), options);
        self
    }

    /// Lets time pass.
    pub(crate) fn advance(&mut self, now: Duration) {
        if let Some(hovering) = &mut self.hovering {
            let is_testing = match self.autopilot {
                MavAutopilot::MAV_AUTOPILOT_PX4 => self.custom_mode == OFFBOARD,
                _ => self.custom_mode == GUIDED && hovering.has_attitude_target,
            };
            hovering.advance(now, is_testing);
        }
    }

    /// Takes bytes in, and returns the frames of its answers.
    pub(crate) fn handle(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.reader.get_mut().0.extend_from_slice(bytes);
        let mut answers = Vec::new();
        while let Ok(raw) = self.reader.read_any_raw_message::<MavMessage>() {
            let is_accepted = match (&self.signing, &raw) {
                (None, _) => true,
                (Some(signing), MAVLinkMessageRaw::V2(raw)) => signing.verify_signature(raw),
                _ => false,
            };
            if !is_accepted || !self.is_on {
                continue;
            }
            let message =
                MavMessage::parse(raw.version(), raw.message_id(), raw.payload()).unwrap();
            for answer in self.answer(&message) {
                answers.push(self.frame(&answer));
            }
            self.received.push(message);
        }
        answers
    }

    /// What it sends by itself in this round.
    pub(crate) fn round(&mut self) -> Vec<Vec<u8>> {
        self.rounds += 1;
        if !self.is_on {
            return vec![];
        }
        let mut messages = Vec::new();
        if self.rounds % 50 == 1 {
            messages.push(self.heartbeat());
        }
        if let Some(hovering) = &self.hovering {
            messages.extend(hovering.streams(self.rounds));
        }
        if self.repeats_a_log {
            messages.extend(self.list_logs().into_iter().take(1));
        }
        messages.iter().map(|message| self.frame(message)).collect()
    }

    /// Restarts: what was not stored is lost.
    pub(crate) fn restart(&mut self) {
        self.parameters.clone_from(&self.stored);
        self.is_armed = false;
    }

    pub(crate) fn value(&self, name: &str) -> f64 {
        self.parameters[name].1
    }

    pub(crate) fn frame(&mut self, message: &MavMessage) -> Vec<u8> {
        self.sequence = self.sequence.wrapping_add(1);
        let header = MavHeader {
            system_id: SYSTEM,
            component_id: 1,
            sequence: self.sequence,
        };
        let mut bytes = Vec::new();
        let signing = self.signing.as_ref();
        write_versioned_msg_signed(&mut bytes, MavlinkVersion::V2, header, message, signing)
            .unwrap();
        bytes
    }

    fn heartbeat(&self) -> MavMessage {
        let armed = match self.is_armed {
            true => MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
            false => MavModeFlag::empty(),
        };
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: self.custom_mode,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: self.autopilot,
            base_mode: armed | MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            system_status: MavState::MAV_STATE_STANDBY,
            mavlink_version: 3,
        })
    }

    fn is_px4(&self) -> bool {
        self.autopilot == MavAutopilot::MAV_AUTOPILOT_PX4
    }

    fn answer(&mut self, message: &MavMessage) -> Vec<MavMessage> {
        match message {
            MavMessage::PARAM_REQUEST_READ(of) if of.param_index >= 0 => {
                let name = self.parameters.keys().next().cloned();
                name.map(|name| self.param_value(&name))
                    .into_iter()
                    .collect()
            }
            MavMessage::PARAM_REQUEST_READ(of) => self.about(of.param_id.to_str().unwrap()),
            MavMessage::PARAM_SET(of) => {
                let name = of.param_id.to_str().unwrap();
                if let Some(&(kind, _)) = self.parameters.get(name) {
                    assert_eq!(
                        of.param_type, kind,
                        "the type of a parameter is that of the vehicle"
                    );
                    let value = match kind {
                        MavParamType::MAV_PARAM_TYPE_REAL32 => f64::from(of.param_value),
                        _ if self.is_px4() => f64::from(of.param_value.to_bits() as i32),
                        _ => f64::from(of.param_value),
                    };
                    let most = self.most.get(name).copied().unwrap_or(f64::INFINITY);
                    self.parameters
                        .insert(name.to_owned(), (kind, value.min(most)));
                }
                self.about(name)
            }
            MavMessage::COMMAND_LONG(of) => self.obey(of),
            MavMessage::SET_ATTITUDE_TARGET(of) => {
                let is_thrust = self.is_px4() || self.value("GUID_OPTIONS") as u32 & 8 != 0;
                if let Some(hovering) = self.hovering.as_mut().filter(|_| is_thrust) {
                    hovering.set_thrust(of.thrust.into());
                }
                vec![]
            }
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(of) => {
                if let Some(hovering) = self.hovering.as_mut() {
                    hovering.set_place((-of.z).into());
                }
                vec![]
            }
            MavMessage::LOG_REQUEST_LIST(_) => self.list_logs(),
            MavMessage::LOG_REQUEST_DATA(of) => self.log_data(of),
            _ => vec![],
        }
    }

    fn list_logs(&self) -> Vec<MavMessage> {
        let number = self.logs.len() as u16;
        let entry = |(at, log): (usize, &Vec<u8>)| LOG_ENTRY_DATA {
            time_utc: 1_700_000_000 + at as u32,
            size: log.len() as u32,
            id: at as u16 + 1,
            num_logs: number,
            last_log_num: number,
        };
        let entries = self
            .logs
            .iter()
            .enumerate()
            .map(entry)
            .map(MavMessage::LOG_ENTRY);
        match number {
            _ if self.repeats_a_log => entries.take(1).collect(),
            // An empty list is sent as one entry with the number 0.
            0 => vec![MavMessage::LOG_ENTRY(LOG_ENTRY_DATA::DEFAULT)],
            _ => entries.collect(),
        }
    }

    fn log_data(&self, request: &LOG_REQUEST_DATA_DATA) -> Vec<MavMessage> {
        let log = &self.logs[usize::from(request.id) - 1];
        let end = log.len().min((request.ofs + request.count) as usize);
        let block = |ofs: usize| {
            let bytes = &log[ofs..end.min(ofs + 90)];
            let mut data = [0; 90];
            data[..bytes.len()].copy_from_slice(bytes);
            MavMessage::LOG_DATA(LOG_DATA_DATA {
                ofs: ofs as u32,
                id: request.id,
                count: bytes.len() as u8,
                data,
            })
        };
        match self.repeats_a_log {
            true => vec![block(0)],
            false => (request.ofs as usize..end).step_by(90).map(block).collect(),
        }
    }

    fn about(&self, name: &str) -> Vec<MavMessage> {
        if self.parameters.contains_key(name) {
            return vec![self.param_value(name)];
        }
        match self.tells_missing {
            true => vec![MavMessage::PARAM_ERROR(PARAM_ERROR_DATA {
                param_index: -1,
                target_system: 255,
                target_component: 190,
                param_id: name.into(),
                error: MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
            })],
            false => vec![],
        }
    }

    fn param_value(&self, name: &str) -> MavMessage {
        let (kind, value) = self.parameters[name];
        let param_value = match kind {
            MavParamType::MAV_PARAM_TYPE_REAL32 => value as f32,
            _ if self.is_px4() => f32::from_bits(value as i32 as u32),
            _ => value as f32,
        };
        MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value,
            param_count: self.parameters.len() as u16,
            param_index: 0,
            param_id: name.into(),
            param_type: kind,
        })
    }

    fn obey(&mut self, command: &COMMAND_LONG_DATA) -> Vec<MavMessage> {
        let ack = |result| {
            MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
                command: command.command,
                result,
            })
        };
        match command.command {
            MavCmd::MAV_CMD_REQUEST_MESSAGE => {
                let message = match command.param1 as u32 {
                    AUTOPILOT_VERSION_DATA::ID => MavMessage::AUTOPILOT_VERSION(self.version()),
                    SYS_STATUS_DATA::ID => self.sys_status(),
                    LOCAL_POSITION_NED_DATA::ID => self.position(),
                    EXTENDED_SYS_STATE_DATA::ID if self.hovering.is_some() => {
                        MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
                            vtol_state: MavVtolState::MAV_VTOL_STATE_UNDEFINED,
                            landed_state: MavLandedState::MAV_LANDED_STATE_IN_AIR,
                        })
                    }
                    _ => return vec![ack(MavResult::MAV_RESULT_DENIED)],
                };
                vec![ack(MavResult::MAV_RESULT_ACCEPTED), message]
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => vec![ack(MavResult::MAV_RESULT_ACCEPTED)],
            MavCmd::MAV_CMD_DO_SET_MODE if self.is_px4() && self.takes_modes => {
                let [main, sub] = [command.param2 as u8, command.param3 as u8];
                self.custom_mode = u32::from_le_bytes([0, 0, main, sub]);
                vec![ack(MavResult::MAV_RESULT_ACCEPTED), self.heartbeat()]
            }
            _ => vec![ack(MavResult::MAV_RESULT_UNSUPPORTED)],
        }
    }

    fn sys_status(&self) -> MavMessage {
        use MavSysStatusSensor as Sensor;
        let all = Sensor::MAV_SYS_STATUS_SENSOR_GPS | Sensor::MAV_SYS_STATUS_AHRS;
        MavMessage::SYS_STATUS(SYS_STATUS_DATA {
            onboard_control_sensors_present: all,
            onboard_control_sensors_enabled: all,
            onboard_control_sensors_health: Sensor::MAV_SYS_STATUS_AHRS,
            voltage_battery: 15_600,
            battery_remaining: 87,
            ..SYS_STATUS_DATA::DEFAULT
        })
    }

    fn position(&self) -> MavMessage {
        match &self.hovering {
            Some(hovering) => hovering.position(),
            None => MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA {
                z: -10.0,
                ..LOCAL_POSITION_NED_DATA::DEFAULT
            }),
        }
    }

    fn version(&self) -> AUTOPILOT_VERSION_DATA {
        let encoding = match self.is_px4() {
            true => MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
            false => MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
        };
        AUTOPILOT_VERSION_DATA {
            capabilities: encoding,
            flight_sw_version: u32::from_be_bytes([1, 15, 4, 255]),
            ..AUTOPILOT_VERSION_DATA::DEFAULT
        }
    }
}
