//! `onecycle fly`: fly missions, evaluate them, write page and CSV files.

use std::fs;
use std::io::{self, Write};
use std::process::ExitCode;

use onecycle_identify::Signals;
use onecycle_identify::cycles::{Cycles, CyclesError};
use onecycle_onboard::tuner::TunerPhase;
use onecycle_plant::multirotor::pilot::TICK_S;
use onecycle_plant::multirotor::{Axis, FlightRecord, Flown, Mission, fly, judged, trace};

use crate::args::Fly;
use crate::failure::{Failure, exit};
use crate::output::{print, write_file, write_text};
use crate::report::fly as report;
use crate::results::fly::{Flight, MissionFlights};
use crate::workers::Workers;

/// Number of cycles identified one by one: that of the paper's Table VII.
const CYCLES: usize = 5;

pub(crate) fn run(arguments: &Fly) -> Result<ExitCode, Failure> {
    let is_wanted = |mission: &Mission| {
        let mut names = arguments.missions.iter();
        arguments.missions.is_empty() || names.any(|named| named.0 == *mission)
    };
    let missions: Vec<Mission> = Mission::ALL.into_iter().filter(is_wanted).collect();
    if let Some(out) = &arguments.out {
        fs::create_dir_all(out).map_err(|error| Failure::output(out, error))?;
    }
    let workers = Workers::new(arguments.threads)?;
    let seeds = arguments.seeds as usize;
    let flights = workers.map(missions.len() * seeds, |piece| {
        let (mission, number) = (missions[piece / seeds], piece % seeds);
        one(
            mission,
            arguments.seed.wrapping_add(number as u64),
            number == 0,
        )
    });
    workers.finish();
    let mut flights = flights.into_iter();
    let mut flown = Vec::with_capacity(missions.len());
    for mission in missions {
        let flights: Result<Vec<Flight>, Failure> = flights.by_ref().take(seeds).collect();
        flown.push(MissionFlights {
            mission,
            flights: flights?,
        });
    }
    print(&report::text(&flown))?;
    if let Some(out) = &arguments.out {
        for one in &flown {
            let path = out.join(format!("{}.csv", one.mission.name()));
            if let Some(first) = one.flights.first() {
                write_file(&path, |file| csv(file, &first.flown.records))?;
            }
        }
        let path = out.join("flights.html");
        let page = report::html(&flown);
        write_text(&path, &page)?;
        print(&format!("{}\n", path.display()))?;
    }
    let all_flown =
        (flown.iter().flat_map(|one| &one.flights)).all(|flight| flight.flown.failure.is_none());
    Ok(ExitCode::from(if all_flown {
        exit::DONE
    } else {
        exit::NO_PROCESS
    }))
}

fn one(mission: Mission, seed: u64, is_kept: bool) -> Result<Flight, Failure> {
    let mut flown = fly(mission, seed).map_err(Failure::usage)?;
    let judged = (flown.tuned.iter())
        .map(|tuned| judged(tuned).map(|cost| (*tuned, cost)))
        .collect::<Result<_, _>>()
        .map_err(Failure::usage)?;
    let cycles = match mission {
        Mission::Cycles if flown.failure.is_none() => cycles(&flown).ok(),
        _ => None,
    };
    if !is_kept {
        flown.records = vec![];
    }
    Ok(Flight {
        flown,
        judged,
        cycles,
    })
}

/// The last cycles of the relay, each identified alone.
fn cycles(flown: &Flown) -> Result<Cycles, CyclesError> {
    let index = Axis::Altitude.index();
    let oscillates = |record: &&FlightRecord| {
        matches!(
            record.phases[index],
            TunerPhase::Relay | TunerPhase::Identify
        )
    };
    let records: Vec<FlightRecord> = flown.records.iter().filter(oscillates).copied().collect();
    let trace = trace(&records, Axis::Altitude);
    let signals = Signals::even(&trace.time_s, &trace.input, &trace.output, TICK_S);
    Cycles::of(&signals, CYCLES)
}

/// One row for each tick: true state, measurements, commands and the phase of each tuner.
fn csv(file: &mut dyn Write, records: &[FlightRecord]) -> io::Result<()> {
    let mut out = io::BufWriter::new(file);
    write!(
        out,
        "time_s,x_m,y_m,altitude_m,climb_m_per_s,roll_rad,pitch_rad,yaw_rad"
    )?;
    for axis in Axis::ALL {
        let name = axis.name();
        write!(out, ",{name}_measured,{name}_command,{name}_phase")?;
    }
    writeln!(out)?;
    for record in records {
        let (at, angles) = (record.reading.position_m, record.reading.angles_rad);
        let climb = record.reading.velocity_m_per_s.z;
        write!(
            out,
            "{:.3},{},{},{},{climb}",
            record.time_s, at.x, at.y, at.z
        )?;
        write!(out, ",{},{},{}", angles.x, angles.y, angles.z)?;
        for axis in Axis::ALL {
            let k = axis.index();
            let phase = record.phases[k].name();
            write!(
                out,
                ",{},{},{phase}",
                record.measured[k], record.commands[k]
            )?;
        }
        writeln!(out)?;
    }
    out.flush()
}
