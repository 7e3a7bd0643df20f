//! `onecycle live` without a vehicle: arguments, files and a connection on which nobody is. The tests of the crate
//! `onecycle-live` have a scripted vehicle.

use std::net::UdpSocket;

use crate::common::{Scratch, UNREADABLE, run};

/// A port of the loopback on which nothing sends.
fn quiet_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.local_addr().unwrap().port()
}

fn connection() -> String {
    format!("udp:127.0.0.1:{}", quiet_port())
}

#[test]
fn no_connection() {
    for text in [
        "tcp:127.0.0.1:5760",
        "udp",
        "udp:0",
        "serial:/dev/ttyACM0",
        "14550",
    ] {
        run(&["live", "state", text]).misused(&["udp:PORT (listen)", "serial:DEVICE:BAUD"]);
    }
    run(&["live", "state", &connection(), "--wait", "-1"]).misused(&["between 0.1 and 3600 s"]);
}

#[test]
fn nobody_is_heard() {
    let at = connection();
    let wanted = [&at, "no vehicle was heard within 0.2 s", "--wait"];
    run(&["live", "state", &at, "--wait", "0.2"]).refused(UNREADABLE, &wanted);
    run(&["live", "log", &at, "--wait", "0.2"]).refused(UNREADABLE, &wanted);
}

#[test]
fn a_port_in_use() {
    let socket = UdpSocket::bind("0.0.0.0:0").unwrap();
    let at = format!("udp:{}", socket.local_addr().unwrap().port());
    run(&["live", "state", &at]).refused(UNREADABLE, &[&at, "another program listens there"]);
}

#[test]
fn a_device_that_is_not_there() {
    let at = "serial:/dev/nosuch:57600";
    run(&["live", "state", at]).refused(UNREADABLE, &[at, "check the name of the device"]);
}

#[test]
fn an_empty_passphrase() {
    let folder = Scratch::new();
    let key = folder.write("key.txt", b"\n");
    let arguments = ["live", "state", &connection(), "--key", &key];
    run(&arguments).refused(UNREADABLE, &["key.txt", "no passphrase"]);
}

// The file is read before the vehicle is looked for.
#[test]
fn parameter_files() {
    let folder = Scratch::new();
    let at = connection();
    for (name, text, words) in [
        ("empty.params", "# nothing\n", vec!["sets no parameter"]),
        (
            "cli.txt",
            "set p_roll = 40\nsave\n",
            vec!["line 1", "Betaflight", "CLI"],
        ),
        ("twice.param", "A,1\nA,2\n", vec!["line 2", "a second time"]),
        ("nan.param", "A,nan\n", vec!["line 1", "finite number"]),
    ] {
        let path = folder.write(name, text.as_bytes());
        run(&["live", "write", &at, &path]).refused(UNREADABLE, &words);
    }
    let path = folder.write("roll.param", b"ATC_RAT_RLL_P,0.1\n");
    let outcome = run(&["live", "write", &at, &path, "--old", &path, "--wait", "0.2"]);
    outcome.misused(&["old-file", "--old"]);
    run(&["live", "write", &at, &path, "--wait", "0.2"]).refused(UNREADABLE, &["no vehicle"]);
    let mut files = folder.files();
    files.sort();
    let own = [
        "cli.txt",
        "empty.params",
        "nan.param",
        "roll.param",
        "twice.param",
    ];
    assert_eq!(files, own);
}

// What identify would refuse is refused before anything is downloaded or flown.
#[test]
fn options_of_identify() {
    let folder = Scratch::new();
    let (at, out) = (connection(), folder.name("flight.ulg"));
    let log = ["live", "log", &at, "-o", &out, "--wait", "0.2"];
    run(&[&log[..], &["--identify", "altitude"]].concat()).misused(&["altitude", "--identify"]);
    run(&[&log[..], &["--report", "a.html"]].concat()).misused(&["required arguments"]);
    let bad = ["--identify", "roll", "--", "--cycles", "many"];
    run(&[&log[..], &bad].concat()).misused(&["options of identify", "many"]);
    let relay = [
        "live", "relay", &at, "--axis", "altitude", "-o", &out, "--wait", "0.2",
    ];
    for (option, value, words) in [
        ("--amplitude", "50%", "between 1 and 30 %"),
        ("--band", "0", "positive"),
        ("--duration", "nan", "positive"),
        ("--cycles", "1", "2..=100"),
    ] {
        run(&[&relay[..], &[option, value]].concat()).misused(&[words]);
    }
    run(&[&relay[..], &["--", "--style", "wild"]].concat()).misused(&["options of identify"]);
    run(&relay).refused(UNREADABLE, &["no vehicle"]);
    assert!(folder.files().is_empty());
}

#[test]
fn recordings_are_not_overwritten() {
    let folder = Scratch::new();
    let out = folder.write("altitude.csv", b"mine");
    let at = connection();
    let arguments = [
        "live", "relay", &at, "--axis", "altitude", "-o", &out, "--wait", "0.2",
    ];
    run(&arguments).misused(&["altitude.csv", "exists"]);
    assert_eq!(std::fs::read(&out).unwrap(), b"mine");
}
