//! Logs whose lines name their values, as rows of a table.
//!
//! ```text
//! pwm: 1000.2 1.000                                                  Klipper's relay test           printers.rs
//! Stats 1001.5: ... extruder: target=100 temp=79.9 pwm=0.300         Klipper and Kalico             printers.rs
//! Recv: ok T:148.1 /200.0 @:127                                      Marlin, OctoPrint              printers.rs
//! [08:00:01][D][sensor:094]: 'Boiler': Sending state 79.9 °C with..  ESPHome                        labels.rs
//! Setpoint:100.00,Input:80.10,Output:30.00                           Arduino, sTune, QuickPID       labels.rs
//! boiler,site=a temp=79.9,pwm=0.3 1710230400000000000                InfluxDB                       influx.rs
//! LabVIEW Measurement ...                                            LabVIEW .lvm                   labview.rs
//! (1710230400.000100) can0 101#0A0B                                  candump, with a DBC file       candump.rs, dbc.rs
//! ```
//! Each line of the log becomes one line of the table, empty where it holds no values, so that errors name the lines of the
//! log. The names of the columns are those that occur in the first bytes of the log.

mod candump;
mod dbc;
mod fields;
mod influx;
mod labels;
mod labview;
mod printers;

use std::io::{self, BufRead, BufReader, Read};
use std::rc::Rc;

use self::dbc::Dbc;
use self::fields::Lines;
use super::error::ReadError;
use super::text::{HEAD_BYTES, Text};
use crate::recording::Note;

/// How the lines of a kind of log are read.
struct Form {
    /// What the log is, with an article.
    format: &'static str,
    /// Lines with values in the head from which it is such a log.
    least_lines: usize,
    /// Share of the lines with content that hold values, in percent.
    least_percent: usize,
    /// How the log begins; empty if anything may stand before the first values.
    magic: &'static [u8],
    /// Whether each signal has lines of its own.
    is_sparse: bool,
    /// Whether the words for input and output may be those of a controller.
    is_labelled: bool,
    line: fn(&Rc<Dbc>) -> Box<dyn Lines>,
}

/// Logs of printers whose firmware may leave out the power.
const PRINTER: &str = "a log of a printer's temperatures";
/// Logs of a CAN bus.
const CANDUMP: &str = "a log of candump with its DBC file";

/// All kinds; the first that fits is taken.
const FORMS: [Form; 8] = [
    Form {
        format: CANDUMP,
        magic: b"(",
        least_lines: 1,
        least_percent: 0,
        is_sparse: true,
        is_labelled: false,
        line: |dbc| {
            let dbc = Rc::clone(dbc);
            Box::new(move |line: &str| candump::signals(line, &dbc))
        },
    },
    Form {
        format: "a LabVIEW measurement file",
        magic: labview::MAGIC,
        least_lines: 1,
        least_percent: 0,
        is_sparse: false,
        is_labelled: false,
        line: |_| Box::new(labview::Measurement::default()),
    },
    Form {
        format: "a log of Klipper",
        magic: b"",
        least_lines: 2,
        least_percent: 0,
        is_sparse: false,
        is_labelled: false,
        line: |_| Box::new(printers::stats),
    },
    Form {
        format: "a relay test of Klipper",
        magic: b"pwm:",
        least_lines: 5,
        least_percent: 90,
        is_sparse: true,
        is_labelled: false,
        line: |_| {
            let mut has_power = false;
            Box::new(move |line: &str| printers::relay_test(line, &mut has_power))
        },
    },
    Form {
        format: PRINTER,
        magic: b"",
        least_lines: 3,
        least_percent: 0,
        is_sparse: false,
        is_labelled: false,
        line: |_| Box::new(printers::temperatures),
    },
    Form {
        format: "a log of ESPHome",
        magic: b"",
        least_lines: 3,
        least_percent: 0,
        is_sparse: true,
        is_labelled: false,
        line: |_| Box::new(labels::states),
    },
    Form {
        format: "InfluxDB line protocol",
        magic: b"",
        least_lines: 3,
        least_percent: 90,
        is_sparse: true,
        is_labelled: false,
        line: |_| Box::new(influx::fields),
    },
    Form {
        format: "lines of names and values",
        magic: b"",
        least_lines: 3,
        least_percent: 60,
        is_sparse: false,
        is_labelled: true,
        line: |_| Box::new(labels::labels),
    },
];

/// Most columns of a log.
const MOST_COLUMNS: usize = 512;
/// After this many lines with content, a log is not of a kind if it has less than half of the share of lines with values that the kind
/// asks for.
const FIRST_LINES: usize = 200;
/// Longest line that is looked at, in bytes; longer ones hold no values.
const LONGEST_LINE: usize = 1 << 16;

/// The text of a log as a table, with a note about it; any other text as it is. `dbc` describes the frames of a log of candump.
pub(super) fn table<'a>(
    text: Text<'a>,
    dbc: Option<&str>,
) -> Result<(Text<'a>, Option<Note>), ReadError> {
    let is_given = dbc.is_some();
    let dbc = Rc::new(dbc.map_or_else(|| Ok(Dbc::default()), Dbc::parse)?);
    let is_candump = candump::begins(&text.head)?;
    // Most tables have none of these marks.
    let has_marks = text
        .head
        .iter()
        .any(|&byte| matches!(byte, b':' | b'=' | b'>'));
    let of_table = |form: &&Form| match is_candump {
        true => form.format == CANDUMP,
        false => form.format != CANDUMP && (has_marks || !form.magic.is_empty()),
    };
    let Some((form, columns)) = FORMS.iter().filter(of_table).find_map(|form| {
        let columns = form.columns(&text.head, &dbc)?;
        Some((form, columns))
    }) else {
        if is_candump {
            return Err(ReadError::NoDbc { is_given });
        }
        let lines = text.head.split(|&byte| byte == b'\n').count() as u64;
        return match text.head.starts_with(labview::MAGIC) {
            true => Err(ReadError::NoData { lines }),
            false => Ok((text, None)),
        };
    };
    if form.format == PRINTER && !columns.iter().any(|name| name.ends_with(".power")) {
        return Err(ReadError::NoPower);
    }
    let note = Note::Format {
        format: form.format.into(),
        columns: columns.len(),
    };
    let rows = Rows {
        log: BufReader::new(Box::new(io::Cursor::new(text.head).chain(text.rest))),
        columns: columns.clone(),
        line: (form.line)(&dbc),
        row: Vec::new(),
        sent: 0,
    };
    let mut rest: Box<dyn Read> = Box::new(rows);
    let mut head = Vec::new();
    (rest.by_ref().take(HEAD_BYTES as u64))
        .read_to_end(&mut head)
        .map_err(|reason| ReadError::Interrupted { line: 0, reason })?;
    let text = Text {
        whole: head.len() < HEAD_BYTES,
        head,
        rest,
        utf16: text.utf16,
        names: Some(columns),
        is_long: false,
        is_sparse: form.is_sparse,
        is_labelled: form.is_labelled,
    };
    Ok((text, Some(note)))
}

impl Form {
    /// The names of the columns, if the head of a text is that of such a log.
    fn columns(&self, head: &[u8], dbc: &Rc<Dbc>) -> Option<Vec<String>> {
        if !head.trim_ascii_start().starts_with(self.magic) {
            return None;
        }
        let mut columns: Vec<String> = Vec::new();
        let mut line = (self.line)(dbc);
        let (mut found, mut filled) = (0, 0);
        let lines = head.split(|&byte| byte == b'\n');
        for text in lines.filter(|text| text.len() <= LONGEST_LINE) {
            filled += usize::from(!text.trim_ascii().is_empty());
            if filled > FIRST_LINES && 200 * found < self.least_percent * filled {
                return None;
            }
            // A row of numbers names none of them.
            if self.magic.is_empty() && !text.iter().any(|byte| b":=>".contains(byte)) {
                continue;
            }
            let fields = line.fields(String::from_utf8_lossy(text).trim());
            found += usize::from(!fields.is_empty());
            for (name, _) in fields {
                if columns.len() < MOST_COLUMNS && !columns.contains(&name) {
                    columns.push(name);
                }
            }
        }
        // The time comes first.
        columns.sort_by_key(|name| name != "time");
        let is_such = found >= self.least_lines && 100 * found >= self.least_percent * filled;
        (is_such && columns.len() > 1).then_some(columns)
    }
}

/// The rows of a log.
struct Rows<'a> {
    log: BufReader<Box<dyn Read + 'a>>,
    columns: Vec<String>,
    line: Box<dyn Lines>,
    row: Vec<u8>,
    sent: usize,
}

impl Rows<'_> {
    /// Makes the row of the next line; false at the end.
    fn advance(&mut self) -> io::Result<bool> {
        self.row.clear();
        self.sent = 0;
        let mut bytes = Vec::new();
        let limit = LONGEST_LINE as u64;
        let count = self
            .log
            .by_ref()
            .take(limit)
            .read_until(b'\n', &mut bytes)?;
        if count == 0 {
            return Ok(false);
        }
        let mut ends = bytes.ends_with(b"\n");
        let is_whole = ends || count < LONGEST_LINE;
        let mut fields = Vec::new();
        if is_whole {
            fields = self.line.fields(String::from_utf8_lossy(&bytes).trim());
        }
        while !ends && !is_whole {
            bytes.clear();
            let count = self
                .log
                .by_ref()
                .take(limit)
                .read_until(b'\n', &mut bytes)?;
            ends = bytes.ends_with(b"\n") || count == 0;
        }
        if !fields.is_empty() {
            for (at, column) in self.columns.iter().enumerate() {
                if at > 0 {
                    self.row.push(b'\t');
                }
                if let Some((_, value)) = fields.iter().find(|(name, _)| name == column) {
                    self.row.extend_from_slice(value.as_bytes());
                }
            }
        }
        self.row.push(b'\n');
        Ok(true)
    }
}

impl Read for Rows<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.sent == self.row.len() && !self.advance()? {
            return Ok(0);
        }
        let piece = &self.row[self.sent..];
        let count = piece.len().min(out.len());
        out[..count].copy_from_slice(&piece[..count]);
        self.sent += count;
        Ok(count)
    }
}
