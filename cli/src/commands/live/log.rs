//! `onecycle live log`: the flight logs of a vehicle, and what they tell.

use std::ffi::OsString;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use onecycle_live::{LogEntry, LogError, Vehicle};

use super::{connect, failed, refused, unheard};
use crate::args::{Identify, LiveLog, LogId, identify_of};
use crate::commands::identify;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, with_ending};
use crate::report::live as report;
use crate::words::live as words;

/// Longest time without any block.
const PATIENCE: Duration = Duration::from_secs(30);
/// Bytes at the end of a part that are asked for again, to see that it belongs to the same log.
const COMPARED: u32 = 900;

pub(crate) fn run(arguments: &LiveLog) -> Result<ExitCode, Failure> {
    let further = (arguments.out.as_ref()).and_then(|out| identify_arguments(arguments, out));
    let further = further.transpose()?;
    let connection = &arguments.connection;
    let mut vehicle = connect(connection)?;
    let waiting = Waiting::on("listing the logs");
    let logs = vehicle.logs().map_err(|error| failed(connection, &error))?;
    drop(waiting);
    let Some(out) = &arguments.out else {
        print(&report::logs(&logs))?;
        return Ok(ExitCode::from(exit::DONE));
    };
    let found = match arguments.id {
        LogId::Latest => logs.iter().max_by_key(|log| log.id),
        LogId::Number(id) => logs.iter().find(|log| log.id == id),
    };
    let log = found.ok_or_else(|| refused(words::no_log(arguments.id, &logs)))?;
    download(arguments, &mut vehicle, log, out)?;
    drop(vehicle);
    match further {
        None => {
            print(&format!("onecycle identify {}\n", out.display()))?;
            Ok(ExitCode::from(exit::DONE))
        }
        Some(arguments) => identify::run(&arguments),
    }
}

/// The arguments of `identify`, which are checked before anything is downloaded. `None`: it was not asked for.
fn identify_arguments(arguments: &LiveLog, out: &Path) -> Option<Result<Identify, Failure>> {
    let axis = arguments.identify?;
    let mut options: Vec<OsString> = vec!["--axis".into(), axis.name().into()];
    for (option, path) in [
        ("--report", &arguments.report),
        ("--write", &arguments.write),
    ] {
        if let Some(path) = path {
            options.extend([option.into(), path.into()]);
        }
    }
    options.extend(arguments.options.iter().cloned());
    let parsed = identify_of(out, &options);
    Some(parsed.and_then(|parsed| identify::checked(&parsed).map(|_| parsed)))
}

/// Downloads into `FILE.part`, which becomes FILE at the end.
fn download(
    arguments: &LiveLog,
    vehicle: &mut Vehicle,
    log: &LogEntry,
    out: &Path,
) -> Result<(), Failure> {
    let part = with_ending(out, "part");
    let unwritten = |error| Failure::output(&part, error);
    let mut options = File::options();
    let file = options
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&part);
    let mut file = file.map_err(unwritten)?;
    let waiting = Waiting::on_bytes(format!("downloading log {}", log.id), u64::from(log.size));
    let from = resume(vehicle, log, &mut file).map_err(|error| broken(arguments, &part, error))?;
    waiting.advance(u64::from(from));
    let mut sink = |bytes: &[u8]| {
        waiting.advance(bytes.len() as u64);
        file.write_all(bytes)
    };
    vehicle
        .download(log, from, PATIENCE, &mut sink)
        .map_err(|error| broken(arguments, &part, error))?;
    file.sync_all().map_err(unwritten)?;
    std::fs::rename(&part, out).map_err(|error| Failure::output(out, error))
}

/// Place from which the download goes on: the end of the part, if its last bytes are those of the log.
fn resume(vehicle: &mut Vehicle, log: &LogEntry, file: &mut File) -> Result<u32, LogError> {
    let have = file.metadata()?.len();
    let have = u32::try_from(have)
        .ok()
        .filter(|have| (COMPARED..=log.size).contains(have));
    if let Some(have) = have {
        // Blocks begin at multiples of their size, as those that were compared.
        let end = have - have % COMPARED;
        let from = end - COMPARED;
        let mut own = vec![0; COMPARED as usize];
        file.seek(SeekFrom::Start(u64::from(from)))?;
        file.read_exact(&mut own)?;
        let mut same = Vec::new();
        let mut sink = |bytes: &[u8]| {
            same.extend_from_slice(bytes);
            Ok(())
        };
        vehicle.download(&log.up_to(end), from, PATIENCE, &mut sink)?;
        if same == own {
            file.set_len(u64::from(end))?;
            file.seek(SeekFrom::Start(u64::from(end)))?;
            return Ok(end);
        }
    }
    file.set_len(0)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(0)
}

fn broken(arguments: &LiveLog, part: &Path, error: LogError) -> Failure {
    match error {
        LogError::Write(error) => Failure::output(part, error),
        LogError::Live(error) => unheard(&arguments.connection, &words::interrupted(&error, part)),
        other => refused(words::short_log(&other, part)),
    }
}
