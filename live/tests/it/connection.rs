//! Connecting: who is there, signatures, and UDP on the loopback.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use onecycle_link::FirmwareKind;
use onecycle_live::{Address, Assignment, Key, LiveError, Outcome, Plan, Udp, Vehicle};

use crate::vehicle::Scripted;
use crate::world::{PATIENCE, World, connect};

#[test]
fn firmware_and_encoding() {
    for (vehicle, kind, name, value) in [
        (Scripted::px4(), FirmwareKind::Px4, "SYS_AUTOSTART", 4001.0),
        (
            Scripted::ardupilot(),
            FirmwareKind::ArduPilot,
            "FRAME_CLASS",
            1.0,
        ),
    ] {
        let mut vehicle = connect(&World::of(vehicle), None).unwrap();
        assert_eq!(vehicle.firmware(), Some(kind));
        assert_eq!(vehicle.system(), 7);
        assert_eq!(vehicle.parameter(name).unwrap().value, value);
    }
}

#[test]
fn nobody_is_there() {
    let world = World::of(Scripted::px4());
    world.borrow_mut().vehicle.is_on = false;
    assert!(matches!(connect(&world, None), Err(LiveError::Silent(_))));
    assert_eq!(world.borrow().now, PATIENCE);
}

// The vehicle's heartbeat is heard, its ears are closed.
#[test]
fn heard_and_not_answering() {
    let world = World::of(Scripted::px4());
    world.borrow_mut().fate = Box::new(|way, _| usize::from(way == crate::world::Way::ToUs));
    let error = connect(&world, None).err();
    assert!(
        matches!(error, Some(LiveError::Unanswered { is_signed: false })),
        "{error:?}"
    );
}

#[test]
fn signatures() {
    let [own, other] = ["hangar", "Hangar"].map(Key::of_passphrase);
    // Both have the key.
    let world = World::of(Scripted::px4().with_key(&own));
    let mut vehicle = connect(&world, Some(&own)).unwrap();
    assert_eq!(vehicle.parameter("SYS_AUTOSTART").unwrap().value, 4001.0);
    // The vehicle has another one.
    let world = World::of(Scripted::px4().with_key(&other));
    assert!(matches!(
        connect(&world, Some(&own)),
        Err(LiveError::WrongKey)
    ));
    // The vehicle has none.
    let world = World::of(Scripted::px4());
    assert!(matches!(
        connect(&world, Some(&own)),
        Err(LiveError::Unsigned)
    ));
    // We have none: the vehicle does not take our questions.
    let world = World::of(Scripted::px4().with_key(&own));
    let error = connect(&world, None).err();
    assert!(
        matches!(error, Some(LiveError::Unanswered { is_signed: false })),
        "{error:?}"
    );
    assert_eq!(world.borrow().vehicle.received.len(), 0);
}

/// The scripted vehicle in a thread, which sends to a port of the loopback. Ends when it is dropped.
struct Loopback {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Loopback {
    fn new(socket: UdpSocket, to: Option<u16>, make: fn() -> Scripted) -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let over = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let mut vehicle = make();
            let mut peer = to.map(|port| ([127, 0, 0, 1], port).into());
            socket
                .set_read_timeout(Some(Duration::from_millis(5)))
                .unwrap();
            let mut buffer = [0; 2048];
            while !over.load(Ordering::Relaxed) {
                let mut frames = vehicle.round();
                if let Ok((count, from)) = socket.recv_from(&mut buffer) {
                    peer = Some(from);
                    frames.extend(vehicle.handle(&buffer[..count]));
                }
                for frame in frames {
                    if let Some(peer) = peer {
                        let _ = socket.send_to(&frame, peer);
                    }
                }
            }
        });
        Self {
            is_over,
            thread: Some(thread),
        }
    }
}

impl Drop for Loopback {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn write_one(vehicle: &mut Vehicle) {
    let wanted = [Assignment {
        name: "MC_ROLLRATE_P".to_owned(),
        value: 0.12,
    }];
    let plan = Plan::new(vehicle, &wanted, false).unwrap();
    assert!(matches!(
        plan.run(vehicle, PATIENCE, |_| {}),
        Outcome::Written
    ));
    assert_eq!(
        vehicle.parameter("MC_ROLLRATE_P").unwrap().value as f32,
        0.12
    );
}

// Real sockets: we listen, and the vehicle sends to us.
#[test]
fn listening_on_the_loopback() {
    let wire = Udp::listen("127.0.0.1", 0).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let _vehicle = Loopback::new(socket, Some(wire.port().unwrap()), Scripted::px4);
    let mut vehicle = Vehicle::connect(Box::new(wire), None, None, PATIENCE).unwrap();
    write_one(&mut vehicle);
}

// Real sockets: we send to the vehicle, which hears of us by our heartbeat. Both sign.
#[test]
fn sending_on_the_loopback() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udp:127.0.0.1:{}", socket.local_addr().unwrap().port());
    let signed = || Scripted::px4().with_key(&Key::of_passphrase("hangar"));
    let _vehicle = Loopback::new(socket, None, signed);
    let wire = address.parse::<Address>().unwrap().open().unwrap();
    let key = Key::of_passphrase("hangar");
    let mut vehicle = Vehicle::connect(wire, Some(&key), None, PATIENCE).unwrap();
    write_one(&mut vehicle);
}
