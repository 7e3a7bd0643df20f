//! `onecycle live relay`: a relay test of the altitude, recorded and identified.

use std::io;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use onecycle::log_gains::{judged_gains, needs_consent, pid, restore_path};
use onecycle::{Controller, Execution, Report};
use onecycle_link::{
    AltitudeCascade, CsvWriter, FirmwareKind, LoopGains, ParameterLine, parameter_text,
};
use onecycle_live::{AltitudeFlight, AltitudeRefusal, AltitudeTest, Vehicle};

use super::{connect, failed, refused};
use crate::args::{LiveRelay, WriteArguments, identify_of};
use crate::commands::identify;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, write_file, write_text};
use crate::reading::Input;
use crate::report::live as report;
use crate::results::live::{AltitudeGains, ProposedChange};
use crate::words::limits::broken;
use crate::words::live as words;
use crate::words::log_gains as gain_words;

pub(crate) fn run(arguments: &LiveRelay) -> Result<ExitCode, Failure> {
    // Everything that can be wrong with the arguments is found before the vehicle moves.
    let further = identify_of(&arguments.out, &arguments.options)?;
    let request = identify::checked(&further)?;
    check_files(arguments)?;
    let mut vehicle = connect(&arguments.connection)?;
    let old = old_gains(&mut vehicle, arguments)?;
    let flight = fly(arguments, &mut vehicle)?;
    print(&report::flight(&flight))?;
    write_file(&arguments.out, |file| record(&flight, file))?;
    if let Some(abort) = &flight.abort {
        return Err(refused(words::aborted(abort, &flight, &arguments.out)));
    }
    let system = vehicle.system();
    drop(vehicle);
    let mut found = identify::found(&request, &Input::new(&further.file)?)?;
    identify::show(&further, &mut found)?;
    let mut code = match found.identification.outcome {
        Ok(_) => exit::DONE,
        Err(_) => exit::NO_PROCESS,
    };
    if let (Some(path), Some(old)) = (&arguments.write.write, old) {
        let proposed = proposed(&found, &flight, old, &arguments.write);
        if let Ok(gains) = &proposed {
            write_gains(path, system, gains)?;
        } else {
            code = exit::NO_PROCESS;
        }
        print(&report::altitude_gains(path, &proposed))?;
    }
    Ok(ExitCode::from(code))
}

/// Refuses files that would be overwritten.
fn check_files(arguments: &LiveRelay) -> Result<(), Failure> {
    let parameters = arguments.write.write.as_deref();
    let all = (parameters.into_iter())
        .flat_map(|path| [path.to_owned(), restore_path(path, "params")])
        .chain([arguments.out.clone()]);
    for path in all {
        if path.exists() && !arguments.write.force {
            return Err(Failure::usage(words::file_exists(&path)));
        }
    }
    Ok(())
}

/// The gains in force, if parameters are to be written.
fn old_gains(vehicle: &mut Vehicle, arguments: &LiveRelay) -> Result<Option<[f64; 4]>, Failure> {
    if arguments.write.write.is_none() {
        return Ok(None);
    }
    if vehicle.firmware() != Some(FirmwareKind::Px4) {
        return Err(Failure::usage(words::ONLY_PX4));
    }
    let mut old = [0.0; 4];
    for (name, value) in AltitudeCascade::NAMES.into_iter().zip(&mut old) {
        let parameter = vehicle.parameter(name);
        *value = parameter
            .map_err(|error| failed(&arguments.connection, &error))?
            .value;
    }
    Ok(Some(old))
}

fn fly(arguments: &LiveRelay, vehicle: &mut Vehicle) -> Result<AltitudeFlight, Failure> {
    let mut test = AltitudeTest::default();
    test.amplitude = arguments.amplitude;
    test.cycles = arguments.cycles;
    test.band_m = arguments.band;
    test.climb_m_per_s = arguments.climb;
    test.drift_m = arguments.drift;
    test.duration_s = arguments.duration;
    let is_over = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&is_over);
    // Fails only if a handler was set before, and this is the only place that sets one.
    ctrlc::set_handler(move || pressed.store(true, Ordering::Relaxed)).map_err(|error| {
        Failure::output(Path::new("a handler for Ctrl-C"), io::Error::other(error))
    })?;
    let _waiting = Waiting::on("testing the altitude; Ctrl-C ends it");
    let flown = vehicle.altitude_test(test, &|| is_over.load(Ordering::Relaxed));
    flown.map_err(|refusal| match refusal {
        AltitudeRefusal::Live(error) => failed(&arguments.connection, &error),
        refusal => refused(words::not_begun(&refusal)),
    })
}

/// The recording as CSV, with what was done in its comments.
fn record(flight: &AltitudeFlight, file: &mut dyn io::Write) -> io::Result<()> {
    let comments = report::comments(flight);
    let comments: Vec<&str> = comments.iter().map(String::as_str).collect();
    let mut writer = CsvWriter::new(file, &comments, &["climb_m_per_s"])?;
    for sample in &flight.samples {
        let more = [sample.climb_m_per_s];
        writer.row(sample.time_s, sample.height_m, sample.thrust, &more)?;
    }
    writer.finish()
}

/// The gains for the asked share of the way to the proposed ones, or the reason why no gains are proposed.
fn proposed(
    found: &Report,
    flight: &AltitudeFlight,
    old: [f64; 4],
    asked: &WriteArguments,
) -> Result<AltitudeGains, String> {
    let identified = found.identification.outcome.as_ref();
    let identified = identified.map_err(|_| gain_words::NOTHING_IDENTIFIED)?;
    let choice = found.choice.as_ref().ok_or(gain_words::NO_DESIGN)?;
    let (design, _) = choice.design().ok_or(gain_words::NO_DESIGN)?;
    let own = design.controller.pid();
    let own = LoopGains::new(own.kp, own.ki, own.kd);
    let hover = flight.hover_thrust;
    let wanted = AltitudeCascade::of_pid(own, hover).ok_or(words::NO_CASCADE)?;
    let gains = AltitudeCascade::new(old).toward(wanted, asked.step);
    // The messages resolve no lag below the time between two of them: the vehicle may have that much more.
    let execution = Execution::sampled(flight.sample_period_s());
    let controller = Controller::from(pid(gains.pid(hover)).with_execution(execution));
    let (figures, least) = judged_gains(&controller, identified, choice)?;
    let way = [AltitudeCascade::new(old), wanted].map(|gains| pid(gains.pid(hover)));
    let broken = broken(&choice.asked, Some(&figures));
    if let Some(broken) = broken.filter(|_| !asked.below_limits)
        && needs_consent(&way, &figures, identified, choice)
    {
        return Err(gain_words::below_limits(&broken));
    }
    let change = |at: usize| ProposedChange {
        name: AltitudeCascade::NAMES[at],
        old: old[at],
        new: gains.values[at],
    };
    Ok(AltitudeGains {
        changes: [0, 1, 2, 3].map(change).into(),
        share: asked.step,
        figures,
        least,
    })
}

/// Writes the file that sets the gains, and the one that sets the old ones again.
fn write_gains(path: &Path, system: u8, gains: &AltitudeGains) -> Result<(), Failure> {
    let text = |value: fn(&ProposedChange) -> f64| {
        let line = |change: &ProposedChange| ParameterLine {
            name: change.name.to_owned(),
            value: value(change),
            is_integer: false,
        };
        let lines: Vec<ParameterLine> = gains.changes.iter().map(line).collect();
        parameter_text(FirmwareKind::Px4, system, &lines)
    };
    write_text(&restore_path(path, "params"), &text(|change| change.old))?;
    write_text(path, &text(|change| change.new))
}
