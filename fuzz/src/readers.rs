//! What the readers do with any bytes: no panic, sound recordings, and files of parameters that set what they show.

use onecycle_link::{
    CsvOptions, FlightLog, Recording, parameter_text, read_from, read_parameters, typed_gains,
};

/// A table, with its default options, with a chosen loop and with a sample rate.
pub(crate) fn table(bytes: &[u8]) {
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
pub(crate) fn matlab(bytes: &[u8]) {
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    file.extend(bytes);
    table(&file);
}

/// A log of WPILib.
pub(crate) fn wpilog(bytes: &[u8]) {
    table(&behind(b"WPILOG\x00\x01\x00\x00\x00\x00", bytes));
}

/// A TDMS file of LabVIEW.
pub(crate) fn tdms(bytes: &[u8]) {
    table(&behind(b"TDSm", bytes));
}

/// A file with parameters of PX4 or ArduPilot; written again, it sets the same ones.
pub(crate) fn parameters(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let Ok(read) = read_parameters(&text) else {
        return;
    };
    assert!(!read.lines.is_empty());
    for line in &read.lines {
        assert!(line.value.is_finite() && line.name.len() <= 16);
    }
    let written = parameter_text(read.firmware, 1, &read.lines);
    let again = read_parameters(&written).map(|file| file.lines);
    let names = |lines: &[onecycle_link::ParameterLine]| {
        let of = lines.iter().map(|line| line.name.clone());
        of.collect::<Vec<_>>()
    };
    assert_eq!(names(&again.unwrap_or_default()), names(&read.lines));
}

/// A configuration or a log of a heater with its gains.
pub(crate) fn gains(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    for found in typed_gains(&text) {
        assert!(found.values.iter().all(|value| value.is_finite()));
    }
}

/// A PX4 ULog.
pub(crate) fn ulog(bytes: &[u8]) {
    log(b"ULog\x01\x12\x35", bytes);
}

/// An ArduPilot DataFlash log.
pub(crate) fn dataflash(bytes: &[u8]) {
    log(b"\xa3\x95\x80", bytes);
}

/// An ArduPilot DataFlash log as text.
pub(crate) fn dataflash_text(bytes: &[u8]) {
    log(
        b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
        bytes,
    );
}

/// A Betaflight or INAV blackbox log.
pub(crate) fn blackbox(bytes: &[u8]) {
    log(
        b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n",
        bytes,
    );
}

/// An MCAP log of ROS 2.
pub(crate) fn mcap(bytes: &[u8]) {
    log(b"\x89MCAP0\r\n", bytes);
}

/// `head` is put before bytes that do not begin with it.
fn behind(head: &[u8], bytes: &[u8]) -> Vec<u8> {
    match bytes.starts_with(&head[..head.len().min(7)]) {
        true => bytes.to_vec(),
        false => [head, bytes].concat(),
    }
}

/// A flight log.
fn log(head: &[u8], bytes: &[u8]) {
    let whole = behind(head, bytes);
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
