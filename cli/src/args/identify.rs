//! Arguments of `identify`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use onecycle::request::values::{
    HOLDS, METHODS, beta, cutoff_hz, dbc, finite, noise, sample_rate, time_s, time_unit,
};
use onecycle::{ColumnRef, Hold, Method, Request, Structure};
use onecycle_identify::MOST_CYCLES;
use onecycle_link::TimeUnit;

use super::{DesignArguments, LogArguments, WriteArguments, named};
use crate::failure::Failure;
use crate::packs::PackSource;

/// Heading of the options of the estimators.
const ESTIMATION: &str = "Estimation";

/// Identify the process from a recording and design its controller.
///
/// The recording may hold a relay test, a chirp, steps or any other input that excites the process. It is
/// a table with the columns time, input (what acts on the process) and output (the measurement),
/// separated by commas, semicolons, tabs or blanks, with or without a header; or a flight log (PX4 ULog, ArduPilot
/// DataFlash, Betaflight or INAV blackbox, MCAP of ROS 2), of which one control loop is taken.
#[derive(Debug, Args)]
#[command(after_help = concat!(
    "Examples:\n",
    "  onecycle identify examples/simulated_hover.csv\n",
    "  onecycle identify examples/simulated_hover.csv --report report.html\n",
    "  onecycle identify log.csv --time t_ms --input 4 --output roll --cycles 4\n",
    "  onecycle identify log.csv --against 40,5,12 --style calm\n",
    "  onecycle identify examples/logs/px4_chirps.ulg --axis roll --loop rate --from 197 --to 203\n",
    "  onecycle identify examples/logs/px4_chirps.ulg --axis pitch --write pitch.params\n",
    "  onecycle identify chirp.csv --structure soptd --from 12 --to 40\n",
    "  onecycle identify historian.csv --tag LIC101\n",
    "  onecycle identify log.csv --details > report.txt\n",
    "  onecycle identify samples.txt --sample-rate 500 --input 2 --output 1 --json\n\n",
    "Exit codes: 0 identified, 2 bad arguments, 3 unreadable file, 4 no process identified (see the ",
    "verdict), 5 output not written, 6 time stamps that can be read in more than one way (give --time-unit)"
))]
pub(crate) struct Identify {
    /// Recording; - reads the standard input
    pub(crate) file: PathBuf,
    /// Print the report as JSON (schema: docs/identify-json.md)
    #[arg(long)]
    pub(crate) json: bool,
    /// With --json: add the fit of the likelihood row by row (measured, simulated and predicted output,
    /// innovation, disturbance)
    #[arg(long, help_heading = ESTIMATION, requires = "json")]
    pub(crate) rows: bool,
    /// Write a report with figures to this file: one HTML page that works offline
    #[arg(long, value_name = "OUT.html")]
    pub(crate) report: Option<PathBuf>,
    /// Fit the last N steady cycles of a relay test (1 to 50), as the paper and the board do, instead of the whole recording.
    /// More cycles narrow the intervals; fewer follow a process that drifts
    #[arg(long, help_heading = ESTIMATION, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CYCLES as u64))]
    pub(crate) cycles: Option<u64>,
    #[command(flatten)]
    pub(crate) design: DesignArguments,
    /// Maximum noise at the actuator: its standard deviation as a share of the relay's amplitude, or of half the range of
    /// the input, such as 20% or 0.2 [default: that of the style]
    #[arg(long, help_heading = super::design::CONTROLLER, value_name = "SHARE", allow_hyphen_values = true, value_parser = noise)]
    pub(crate) noise: Option<f64>,
    /// Structure of the process [default: the simplest that explains the recording]
    #[arg(long, help_heading = ESTIMATION, value_name = "NAME", value_parser = structure())]
    pub(crate) structure: Option<Structure>,
    /// The process is known to be unstable without its controller, as a magnet that holds a ball or a pendulum on its head: a model
    /// with one unstable pole is fitted
    #[arg(long, help_heading = ESTIMATION)]
    pub(crate) unstable: bool,
    /// Use the recording from this time, in seconds of its time column [default: its start]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = time_s)]
    pub(crate) from: Option<f64>,
    /// Use the recording up to this time, in seconds of its time column [default: its end]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = time_s)]
    pub(crate) to: Option<f64>,
    /// Input between two samples: constant (held), if the recording has every sample of the loop, or a straight line
    /// (interpolated), if it has fewer [default: what explains the recording better]
    #[arg(long, help_heading = ESTIMATION, value_name = "KIND", value_parser = named(&HOLDS))]
    pub(crate) hold: Option<Hold>,
    /// beta of the relay that made the recording: a recording whose switches contradict it is refused [default: from a
    /// comment of the file]
    #[arg(long, help_heading = ESTIMATION, value_name = "BETA", allow_negative_numbers = true, value_parser = beta)]
    pub(crate) beta: Option<f64>,
    /// Time by which the input was logged late, in seconds (negative: early): it is corrected. 0 says that both columns
    /// come from one clock [default: judged by the switches of the relay]
    #[arg(long, help_heading = ESTIMATION, value_name = "S", allow_negative_numbers = true, value_parser = time_s)]
    pub(crate) input_late: Option<f64>,
    /// Input before the first row, in its unit, under which the process was at rest: for a step in the first row [default: the
    /// likelihood decides whether the process was at rest under the first input, or under 0 if the input never changes]
    #[arg(long, help_heading = ESTIMATION, value_name = "VALUE", allow_negative_numbers = true, value_parser = finite)]
    pub(crate) input_before: Option<f64>,
    /// Print below the answer all that is known: recording, process, model, every controller, all remarks
    #[arg(long)]
    pub(crate) details: bool,
    /// Cutoff (Hz) of a second-order low-pass (Butterworth) that the output passed before it was recorded: it is taken out
    /// for the fit, and its delay is part of tau. 0: none [default: of a flight log, the gyro's filter in its parameters]
    #[arg(long, help_heading = ESTIMATION, value_name = "HZ", value_parser = cutoff_hz)]
    pub(crate) output_filter: Option<f64>,
    /// Method for a steady relay oscillation: the network of the pack alone (classify), least squares alone (refine),
    /// or least squares with the network's prior (map)
    #[arg(long, help_heading = ESTIMATION, default_value = "map", value_parser = named(&METHODS))]
    pub(crate) method: Method,
    /// Identifier pack for the fit to cycles (8 if --cycles does not say); "default" is the built-in one
    #[arg(long, help_heading = ESTIMATION, value_name = "FILE", default_value = "default")]
    pub(crate) pack: PackSource,
    #[command(flatten)]
    pub(crate) log: LogArguments,
    #[command(flatten)]
    pub(crate) write: WriteArguments,
    /// Time column, by name or by number from 1
    #[arg(long, help_heading = "Columns of a table", value_name = "COLUMN")]
    pub(crate) time: Option<String>,
    /// Input column, what acts on the process, by name or number
    #[arg(long, help_heading = "Columns of a table", value_name = "COLUMN")]
    pub(crate) input: Option<String>,
    /// Output column, the measurement, by name or number
    #[arg(long, help_heading = "Columns of a table", value_name = "COLUMN")]
    pub(crate) output: Option<String>,
    /// Set-point column, by name or number; it is kept beside the output [default: by name]
    #[arg(long, help_heading = "Columns of a table", value_name = "COLUMN")]
    pub(crate) set_point: Option<String>,
    /// Control loop of a table with several: LIC101 takes the columns, or the tags, LIC101.PV, LIC101.OP and LIC101.SP
    #[arg(long, help_heading = "Columns of a table", value_name = "LOOP")]
    pub(crate) tag: Option<String>,
    /// Sample rate in hertz, for a table without a usable time column
    #[arg(long, help_heading = "Columns of a table", value_name = "HZ", conflicts_with_all = ["time", "time_unit"],
          allow_negative_numbers = true, value_parser = sample_rate)]
    pub(crate) sample_rate: Option<f64>,
    /// Unit of the time column: d, h, min, s, ms, us or ns [default: from its header]
    #[arg(long, help_heading = "Columns of a table", value_name = "UNIT", value_parser = time_unit)]
    pub(crate) time_unit: Option<TimeUnit>,
    /// DBC file with the signals in the frames of a log of candump
    #[arg(long, help_heading = "Columns of a table", value_name = "FILE")]
    pub(crate) dbc: Option<PathBuf>,
}

impl Identify {
    /// What is asked.
    pub(crate) fn request(&self) -> Result<Request, Failure> {
        let column = |name: &Option<String>| name.as_deref().map(ColumnRef::from);
        let mut request = Request::default();
        request.requirements = self.design.requirements();
        request.noise_share = self.noise;
        request.cycles = self.cycles.map(|cycles| cycles as usize);
        request.method = self.method;
        request.structure = self.structure;
        request.is_unstable = self.unstable;
        (request.from_s, request.to_s) = (self.from, self.to);
        request.hold = self.hold;
        request.beta = self.beta;
        request.input_late_s = self.input_late;
        request.input_before = self.input_before;
        request.output_filter_hz = self.output_filter;
        request.pack = self.pack.file()?;
        request.columns.time_column = column(&self.time);
        request.columns.input_column = column(&self.input);
        request.columns.output_column = column(&self.output);
        request.columns.set_point_column = column(&self.set_point);
        request.columns.control_loop.clone_from(&self.tag);
        request.columns.sample_rate_hz = self.sample_rate;
        request.columns.time_unit = self.time_unit;
        let read = |path: &PathBuf| {
            dbc(&path.to_string_lossy()).map_err(|reason| Failure::unreadable(path, reason))
        };
        request.columns.dbc = self.dbc.as_ref().map(read).transpose()?;
        request.axis = self.log.axis;
        request.control_loop = self.log.control_loop;
        request.flight = self.log.flight;
        request.write = self.write.write();
        Ok(request)
    }
}

/// Names of structures.
fn structure() -> impl TypedValueParser<Value = Structure> {
    PossibleValuesParser::new(Structure::ALL.map(Structure::name))
        .try_map(|name| Structure::from_name(&name).ok_or("there is no such structure"))
}
