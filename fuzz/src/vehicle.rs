//! A vehicle that says anything over MAVLink.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use mavlink::dialects::common::MavMessage;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message};
use onecycle_live::{Key, LogEntry, Vehicle, Wire};

/// Identities of the messages that the ground station reads: heartbeat, status, version, parameter, logs, attitude, text and others.
const SPOKEN: [u32; 16] = [
    0, 1, 22, 24, 30, 33, 65, 74, 77, 110, 118, 120, 147, 148, 245, 253,
];

/// Datagrams that wait, and the time.
struct Line {
    datagrams: VecDeque<Vec<u8>>,
    now: Duration,
}

struct Scripted(Rc<RefCell<Line>>);

impl Wire for Scripted {
    fn send(&mut self, _: &[u8]) {}

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let mut line = self.0.borrow_mut();
        let Some(bytes) = line.datagrams.pop_front() else {
            line.now += wait;
            return 0;
        };
        line.now += wait.min(Duration::from_millis(20));
        let count = bytes.len().min(buffer.len());
        buffer[..count].copy_from_slice(&bytes[..count]);
        count
    }

    fn now(&self) -> Duration {
        self.0.borrow().now
    }
}

/// Connects, and asks for everything. The first byte chooses what is asked, then follow datagrams: kind, length, bytes.
pub(crate) fn mavlink(bytes: &[u8]) {
    let Some((&asked, mut rest)) = bytes.split_first() else {
        return;
    };
    let heartbeat = [2, 0, 0, 0, 2, 3, 81, 4, 3];
    let mut datagrams = VecDeque::from([framed(0, &heartbeat)]);
    while let [kind, length, tail @ ..] = rest {
        let (payload, tail) = tail.split_at(usize::from(*length).min(tail.len()));
        rest = tail;
        datagrams.push_back(match SPOKEN.get(usize::from(*kind)) {
            Some(&message) => framed(message, payload),
            None => payload.to_vec(),
        });
    }
    let line = Line {
        datagrams,
        now: Duration::ZERO,
    };
    let wire = Box::new(Scripted(Rc::new(RefCell::new(line))));
    let key = (asked & 1 != 0).then(|| Key::of_passphrase("of a test"));
    let patience = Duration::from_secs(5);
    let Ok(mut vehicle) = Vehicle::connect(wire, key.as_ref(), None, patience) else {
        return;
    };
    if asked & 2 != 0 {
        let _ = vehicle.state();
    }
    if asked & 4 != 0 {
        let _ = vehicle.parameter("MC_ROLLRATE_P");
    }
    if asked & 8 != 0 {
        let logs = vehicle.logs().unwrap_or_default();
        let small = logs.into_iter().map(|entry: LogEntry| entry.up_to(4096));
        for entry in small.take(2) {
            let mut count = 0;
            let mut sink = |bytes: &[u8]| {
                count += bytes.len();
                Ok(())
            };
            let _ = vehicle.download(&entry, 0, patience, &mut sink);
            assert!(count <= entry.size as usize);
        }
    }
}

/// A message in a frame with the right check sum; a payload of the wrong length is cut or filled.
fn framed(message: u32, payload: &[u8]) -> Vec<u8> {
    let header = MavHeader {
        system_id: 1,
        component_id: 1,
        sequence: 0,
    };
    let Ok(message) = MavMessage::parse(MavlinkVersion::V2, message, payload) else {
        return payload.to_vec();
    };
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.serialize_message(header, &message);
    raw.raw_bytes().to_vec()
}
