//! A vehicle that is heard: who it is, and what it said last.

use std::time::Duration;

use mavlink::MessageData;
use mavlink::dialects::common::{
    ATTITUDE_DATA, AUTOPILOT_VERSION_DATA, COMMAND_LONG_DATA, ESTIMATOR_STATUS_DATA,
    EXTENDED_SYS_STATE_DATA, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd,
    MavMessage, MavModeFlag, MavProtocolCapability, MavResult, MavType, SYS_STATUS_DATA,
};
use onecycle_link::FirmwareKind;

use crate::channel::Channel;
use crate::error::LiveError;
use crate::mode::word;
use crate::signing::Key;
use crate::wire::Wire;

/// How often a question is repeated, and how long each answer is awaited.
pub(crate) const TRIES: usize = 5;
pub(crate) const ANSWER: Duration = Duration::from_millis(800);
/// A vehicle that is not heard for this time is lost: three heartbeats.
pub(crate) const LOST: Duration = Duration::from_secs(3);
/// Most texts of the vehicle that are kept.
const TEXTS: usize = 8;

/// How a vehicle puts integers into the 32-bit float of a parameter message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// The bytes of the integer.
    Bytewise,
    /// The value, converted.
    CCast,
}

/// The last messages of each kind.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    pub(crate) heartbeat: Option<HEARTBEAT_DATA>,
    pub(crate) sys_status: Option<SYS_STATUS_DATA>,
    pub(crate) estimator: Option<ESTIMATOR_STATUS_DATA>,
    pub(crate) position: Option<LOCAL_POSITION_NED_DATA>,
    pub(crate) attitude: Option<ATTITUDE_DATA>,
    pub(crate) extended: Option<EXTENDED_SYS_STATE_DATA>,
    /// Messages of text, the newest last.
    pub(crate) texts: Vec<String>,
}

/// A vehicle with an autopilot at the other end of a connection.
pub struct Vehicle {
    pub(crate) channel: Channel,
    system: u8,
    component: u8,
    heard: Duration,
    pub(crate) seen: Seen,
    pub(crate) version: Option<AUTOPILOT_VERSION_DATA>,
}

impl Vehicle {
    /// Waits for the heartbeat of an autopilot, for at most `patience`, and asks for its version. `system`: the number of the
    /// vehicle, if several may be heard. With a key every message must be signed.
    ///
    /// # Errors
    /// No vehicle is heard, its messages have the wrong signatures, or it does not answer.
    pub fn connect(
        wire: Box<dyn Wire>,
        key: Option<&Key>,
        system: Option<u8>,
        patience: Duration,
    ) -> Result<Self, LiveError> {
        let mut channel = Channel::new(wire, key);
        let until = channel.now() + patience;
        let (system, component, heartbeat) = loop {
            match channel.receive(until) {
                Some((header, MavMessage::HEARTBEAT(heartbeat))) => {
                    let number = u8::try_from(header.system_id).ok();
                    let number = number.filter(|number| system.is_none_or(|own| own == *number));
                    if let Some(number) = number.filter(|_| is_autopilot(&heartbeat)) {
                        break (number, header.component_id, heartbeat);
                    }
                }
                Some(_) => {}
                None => return Err(unheard(&channel, patience)),
            }
        };
        let mut vehicle = Self {
            heard: channel.now(),
            channel,
            system,
            component,
            seen: Seen::default(),
            version: None,
        };
        vehicle.seen.heartbeat = Some(heartbeat);
        vehicle.ask_version()?;
        Ok(vehicle)
    }

    fn ask_version(&mut self) -> Result<(), LiveError> {
        let mut is_answered = false;
        for _ in 0..TRIES {
            self.request(AUTOPILOT_VERSION_DATA::ID);
            let until = self.now() + ANSWER;
            while let Some(message) = self.receive(until) {
                match message {
                    MavMessage::AUTOPILOT_VERSION(_) => return Ok(()),
                    MavMessage::COMMAND_ACK(answer) => {
                        is_answered = true;
                        // Firmware that does not know the command.
                        if answer.result != MavResult::MAV_RESULT_ACCEPTED {
                            return Ok(());
                        }
                    }
                    _ => {}
                }
            }
        }
        let is_signed = self.channel.is_signed();
        match is_answered {
            true => Ok(()),
            false if self.is_lost() => Err(LiveError::Lost),
            false => Err(LiveError::Unanswered { is_signed }),
        }
    }

    /// Number of the vehicle.
    pub fn system(&self) -> u8 {
        self.system
    }

    /// Its firmware. `None`: neither PX4 nor ArduPilot.
    pub fn firmware(&self) -> Option<FirmwareKind> {
        match self.seen.heartbeat.as_ref()?.autopilot {
            MavAutopilot::MAV_AUTOPILOT_PX4 => Some(FirmwareKind::Px4),
            MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA => Some(FirmwareKind::ArduPilot),
            _ => None,
        }
    }

    /// Whether its last heartbeat says that the motors are armed.
    pub fn is_armed(&self) -> bool {
        let flags = self.seen.heartbeat.as_ref().map(|of| of.base_mode);
        flags.is_some_and(|flags| flags.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED))
    }

    /// Whether it is not heard any more.
    pub fn is_lost(&self) -> bool {
        self.now() - self.heard > LOST
    }

    /// Time since the connection was opened.
    pub fn now(&self) -> Duration {
        self.channel.now()
    }

    pub(crate) fn encoding(&self) -> Encoding {
        let capabilities = self.version.as_ref().map(|of| of.capabilities);
        let has = |flag| capabilities.is_some_and(|own| own.contains(flag));
        if has(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE) {
            Encoding::Bytewise
        } else if has(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST) {
            Encoding::CCast
        } else if self.firmware() == Some(FirmwareKind::Px4) {
            Encoding::Bytewise
        } else {
            Encoding::CCast
        }
    }

    pub(crate) fn send(&mut self, message: &MavMessage) {
        self.channel.send(message);
    }

    /// System and component that messages to the autopilot name.
    pub(crate) fn target(&self) -> (u8, u8) {
        (self.system, self.component)
    }

    /// The next message of the autopilot, for which it waits up to a time of [`Self::now`]. `None`: none came.
    pub(crate) fn receive(&mut self, until: Duration) -> Option<MavMessage> {
        loop {
            let (header, message) = self.channel.receive(until)?;
            if header.system_id == u32::from(self.system) && header.component_id == self.component {
                self.heard = self.now();
                self.remember(&message);
                return Some(message);
            }
            if self.now() >= until {
                return None;
            }
        }
    }

    fn remember(&mut self, message: &MavMessage) {
        let seen = &mut self.seen;
        match message {
            MavMessage::HEARTBEAT(of) if is_autopilot(of) => seen.heartbeat = Some(of.clone()),
            MavMessage::SYS_STATUS(of) => seen.sys_status = Some(of.clone()),
            MavMessage::ESTIMATOR_STATUS(of) => seen.estimator = Some(of.clone()),
            MavMessage::LOCAL_POSITION_NED(of) => seen.position = Some(of.clone()),
            MavMessage::ATTITUDE(of) => seen.attitude = Some(of.clone()),
            MavMessage::EXTENDED_SYS_STATE(of) => seen.extended = Some(of.clone()),
            MavMessage::AUTOPILOT_VERSION(of) => self.version = Some(of.clone()),
            MavMessage::STATUSTEXT(of) => {
                // Control characters would command a terminal.
                let text = of.text.to_str().unwrap_or_default();
                seen.texts.push(text.replace(char::is_control, " "));
                let more = seen.texts.len().saturating_sub(TEXTS);
                seen.texts.drain(..more);
            }
            _ => {}
        }
    }

    /// Asks for one message of a kind.
    pub(crate) fn request(&mut self, message: u32) {
        let command = MavCmd::MAV_CMD_REQUEST_MESSAGE;
        self.send_command(command, [message as f32, 0.0, 0.0]);
    }

    fn command_long(&self, command: MavCmd, parameters: [f32; 7]) -> MavMessage {
        let (target_system, target_component) = self.target();
        let [param1, param2, param3, param4, param5, param6, param7] = parameters;
        MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param4,
            param5,
            param6,
            param7,
            command,
            target_system,
            target_component,
            confirmation: 0,
        })
    }

    /// Sends a command once, with its first parameters.
    pub(crate) fn send_command(&mut self, command: MavCmd, [a, b, c]: [f32; 3]) {
        self.send(&self.command_long(command, [a, b, c, 0.0, 0.0, 0.0, 0.0]));
    }

    /// Sends a command until it is answered. `name`: for the error.
    pub(crate) fn command(
        &mut self,
        name: &'static str,
        command: MavCmd,
        first: [f32; 3],
    ) -> Result<(), LiveError> {
        for _ in 0..TRIES {
            self.send_command(command, first);
            let until = self.now() + ANSWER;
            while let Some(message) = self.receive(until) {
                let MavMessage::COMMAND_ACK(answer) = message else {
                    continue;
                };
                if answer.command != command {
                    continue;
                }
                if answer.result == MavResult::MAV_RESULT_ACCEPTED {
                    return Ok(());
                }
                let said = self.seen.texts.last().cloned();
                let said = said.map_or(String::new(), |text| format!(" ({text})"));
                let result = word(&format!("{:?}", answer.result), "MAV_RESULT_") + &said;
                return Err(LiveError::Refused {
                    command: name,
                    result,
                });
            }
        }
        match self.is_lost() {
            true => Err(LiveError::Lost),
            false => Err(LiveError::Unanswered {
                is_signed: self.channel.is_signed(),
            }),
        }
    }
}

fn is_autopilot(heartbeat: &HEARTBEAT_DATA) -> bool {
    heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
        && heartbeat.mavtype != MavType::MAV_TYPE_GCS
}

fn unheard(channel: &Channel, patience: Duration) -> LiveError {
    let waited_s = patience.as_secs_f64();
    match channel.refused {
        refused if refused.wrong > 0 => LiveError::WrongKey,
        refused if refused.unsigned > 0 => LiveError::Unsigned,
        _ if channel.is_heard => LiveError::NoAutopilot(waited_s),
        _ => LiveError::Silent(waited_s),
    }
}
