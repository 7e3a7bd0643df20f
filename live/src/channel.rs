//! MAVLink messages over a wire: framing, heartbeat, signatures.

use std::io::{self, ErrorKind, Read};
use std::time::Duration;

use mavlink::dialects::common::{
    HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavType,
};
use mavlink::{
    MAVLinkMessageRaw, MavHeader, MavlinkReader, MavlinkVersion, Message, SigningData,
    write_versioned_msg_signed,
};

use crate::signing::Key;
use crate::wire::Wire;

/// System number of ground stations, and the component of a ground station program (`MAV_COMP_ID_MISSIONPLANNER`).
const OWN_SYSTEM: u32 = 255;
const OWN_COMPONENT: u8 = 190;

/// A ground station tells every second that it is there.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// `RADIO_STATUS` comes from the modem, which has no key.
const RADIO_STATUS: u32 = 109;

/// Messages that were not accepted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Refused {
    /// Without a signature, while a key is in use.
    pub(crate) unsigned: u64,
    /// With a signature of another key, or an old one.
    pub(crate) wrong: u64,
}

/// Bytes that have come and are not read yet.
#[derive(Default)]
struct Inbox {
    bytes: Vec<u8>,
    read: usize,
}

impl Read for Inbox {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = &self.bytes[self.read..];
        if left.is_empty() {
            return Err(ErrorKind::WouldBlock.into());
        }
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.read += count;
        Ok(count)
    }
}

/// A wire that carries messages.
pub(crate) struct Channel {
    wire: Box<dyn Wire>,
    reader: MavlinkReader<Inbox>,
    buffer: Vec<u8>,
    signing: Option<SigningData>,
    sequence: u8,
    heartbeat_due: Duration,
    pub(crate) refused: Refused,
    /// Whether any message has come, accepted or not.
    pub(crate) is_heard: bool,
}

impl Channel {
    pub(crate) fn new(wire: Box<dyn Wire>, key: Option<&Key>) -> Self {
        Self {
            heartbeat_due: wire.now(),
            wire,
            reader: MavlinkReader::new(Inbox::default()),
            buffer: vec![0; 2048],
            signing: key.map(Key::signing),
            sequence: 0,
            refused: Refused::default(),
            is_heard: false,
        }
    }

    pub(crate) fn is_signed(&self) -> bool {
        self.signing.is_some()
    }

    pub(crate) fn now(&self) -> Duration {
        self.wire.now()
    }

    pub(crate) fn send(&mut self, message: &MavMessage) {
        let header = MavHeader {
            system_id: OWN_SYSTEM,
            component_id: OWN_COMPONENT,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut bytes = Vec::new();
        let signing = self.signing.as_ref();
        let version = MavlinkVersion::V2;
        // Memory takes every message.
        if write_versioned_msg_signed(&mut bytes, version, header, message, signing).is_ok() {
            self.wire.send(&bytes);
        }
    }

    /// The next message, for which it waits up to a time of [`Self::now`]. `None`: none came.
    pub(crate) fn receive(&mut self, until: Duration) -> Option<(MavHeader, MavMessage)> {
        loop {
            while let Ok(raw) = self.reader.read_any_raw_message::<MavMessage>() {
                if let Some(message) = self.accepted(&raw) {
                    return Some(message);
                }
            }
            let now = self.now();
            if now >= self.heartbeat_due {
                self.heartbeat_due = now + HEARTBEAT;
                self.send(&heartbeat());
            }
            if now >= until {
                return None;
            }
            let wait = until.min(self.heartbeat_due) - now;
            let count = self.wire.receive(&mut self.buffer, wait);
            let inbox = self.reader.get_mut();
            // The reader has taken every byte before.
            inbox.bytes.clear();
            inbox.bytes.extend_from_slice(&self.buffer[..count]);
            inbox.read = 0;
        }
    }

    /// The message, if its signature is what it must be and the dialect knows its contents.
    fn accepted(&mut self, raw: &MAVLinkMessageRaw) -> Option<(MavHeader, MavMessage)> {
        self.is_heard = true;
        if let Some(signing) = &self.signing {
            let is_signed = match raw {
                MAVLinkMessageRaw::V2(raw) => raw.incompatibility_flags() & 1 != 0,
                MAVLinkMessageRaw::V1(_) => false,
            };
            let is_valid = match raw {
                MAVLinkMessageRaw::V2(raw) => signing.verify_signature(raw),
                MAVLinkMessageRaw::V1(_) => false,
            };
            if !is_valid {
                match is_signed {
                    true => self.refused.wrong += 1,
                    false if raw.message_id() != RADIO_STATUS => self.refused.unsigned += 1,
                    false => {}
                }
                return None;
            }
        }
        let header = MavHeader {
            system_id: raw.system_id(),
            component_id: raw.component_id(),
            sequence: raw.sequence(),
        };
        // Newer firmware has values that the dialect does not know; their messages tell nothing here.
        let message = MavMessage::parse(raw.version(), raw.message_id(), raw.payload()).ok()?;
        Some((header, message))
    }
}

fn heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    })
}
