//! What the readers do with any bytes: no panic, and sound recordings. `cargo fuzz` calls these functions, and a test of
//! `onecycle-link` with fixed seeds.

#![allow(dead_code, reason = "each fuzz target uses one of them")]

use onecycle_link::{CsvOptions, FlightLog, Recording, read_from};

/// A table, with its default options, with a chosen loop and with a sample rate.
pub(super) fn table(bytes: &[u8]) {
    let short = || CsvOptions::default().max_points(64);
    for options in [
        short(),
        short().control_loop("LIC101"),
        short().sample_rate_hz(10.0),
    ] {
        match read_from(bytes, &options) {
            Ok(recording) => sound(&recording),
            Err(error) => assert!(error.to_string().len() < 2000),
        }
    }
}

/// A MATLAB file behind its head of 128 bytes.
pub(super) fn matlab(bytes: &[u8]) {
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    file.extend(bytes);
    table(&file);
}

/// A PX4 ULog.
pub(super) fn ulog(bytes: &[u8]) {
    log(b"ULog\x01\x12\x35", bytes);
}

/// An ArduPilot DataFlash log.
pub(super) fn dataflash(bytes: &[u8]) {
    log(b"\xa3\x95\x80", bytes);
}

/// An ArduPilot DataFlash log as text.
pub(super) fn dataflash_text(bytes: &[u8]) {
    log(
        b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
        bytes,
    );
}

/// A Betaflight or INAV blackbox log.
pub(super) fn blackbox(bytes: &[u8]) {
    log(
        b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n",
        bytes,
    );
}

/// An MCAP log of ROS 2.
pub(super) fn mcap(bytes: &[u8]) {
    log(b"\x89MCAP0\r\n", bytes);
}

/// A flight log; `head` is put before bytes that do not begin with it.
fn log(head: &[u8], bytes: &[u8]) {
    let begins = bytes.starts_with(&head[..head.len().min(7)]);
    let whole = if begins {
        bytes.to_vec()
    } else {
        [head, bytes].concat()
    };
    let Ok(log) = FlightLog::scan(whole.as_slice()) else {
        return;
    };
    for (index, flight) in log.flights.iter().enumerate().take(3) {
        for logged in flight.loops.iter().take(3) {
            if let Ok(signals) = log.signals(whole.as_slice(), index + 1, logged.control_loop)
                && let Ok(recording) = signals.recording()
            {
                sound(&recording);
            }
        }
    }
}

/// The promises of a recording.
fn sound(recording: &Recording) {
    let (time_s, input, output) = (recording.time_s(), recording.input(), recording.output());
    assert!(time_s.len() >= 2 && input.len() == time_s.len() && output.len() == time_s.len());
    let mut all = time_s.iter().chain(input).chain(output);
    assert!(all.all(|value| value.is_finite()));
    assert!(time_s.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(
        recording
            .notes()
            .iter()
            .all(|note| !note.to_string().contains(['\n', '\r', '\0']))
    );
}
