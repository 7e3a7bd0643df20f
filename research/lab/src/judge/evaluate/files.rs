//! Truth, answers and results as CSV with a header and one row for each experiment.
//!
//! ```text
//! truth     experiment,K,T_prop_s,T_body_s,tau_s,input_bias,noise_sigma,protocol,seed
//! answers   experiment,K,T_prop_s,T_body_s,tau_s   or   experiment,kp,kd      (optional: seconds)
//! results   experiment,method,outcome,deterioration,...   the fields of Record; missing values are empty
//! ```
//!
//! Columns may be in any order, other columns are ignored, and lines that begin with `#` are comments.
//! An experiment without a row has no answer. Every error names its line.

use std::collections::{BTreeMap, BTreeSet};

use csv::{ErrorKind, ReaderBuilder, Trim};
use onecycle_onboard::{Pd, Soiptd, SoiptdError};

use super::{Answer, Record};
use crate::experiments::Truth;

/// Columns of the parameters of a process.
const PROCESS: [&str; 4] = ["K", "T_prop_s", "T_body_s", "tau_s"];
/// Columns of gains.
const GAINS: [&str; 2] = ["kp", "kd"];
/// Values of the column `protocol`: the relay trims the bias away, or it does not.
const PROTOCOLS: [&str; 2] = ["trimmed", "biased"];

/// Why a table cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct TableError {
    /// Line of the file, from one.
    pub line: u64,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a line of a table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The line is not a row of the table: the reason.
    #[error("{0}")]
    Row(String),
    /// The header lacks a column.
    #[error("the header has no column '{0}'")]
    NoColumn(&'static str),
    /// The header of answers names neither processes nor gains, or both.
    #[error("the header must name experiment and either K, T_prop_s, T_body_s, tau_s or kp, kd")]
    NotAnswers,
    /// A cell is not a finite number.
    #[error(
        "{column} is '{text}', which is not a finite number; omit the row of an experiment without an answer"
    )]
    NoNumber {
        /// The column.
        column: &'static str,
        /// Text of the cell.
        text: String,
    },
    /// A cell is not a whole number.
    #[error("{column} is '{text}', which is not a whole number")]
    NotWhole {
        /// The column.
        column: &'static str,
        /// Text of the cell.
        text: String,
    },
    /// An unknown protocol.
    #[error("protocol is '{0}', but must be 'trimmed' or 'biased'")]
    NoProtocol(String),
    /// The benchmark has no such experiment.
    #[error("the benchmark has no experiment {0}")]
    UnknownExperiment(u64),
    /// An experiment has two rows.
    #[error("experiment {experiment} already has a row, line {first}")]
    Twice {
        /// Number of the experiment.
        experiment: u64,
        /// Line of its first row.
        first: u64,
    },
    /// The parameters are out of range.
    #[error("not a process: {0}; omit the row of an experiment without an answer")]
    NoProcess(#[from] SoiptdError),
    /// The table has no row.
    #[error("the table has no rows")]
    Empty,
}

impl Problem {
    fn at(self, line: u64) -> TableError {
        TableError {
            line,
            problem: self,
        }
    }
}

/// A table as text.
struct Table {
    header: Vec<String>,
    /// Line number and cells of each row.
    rows: Vec<(u64, Vec<String>)>,
}

impl Table {
    fn read(text: &str) -> Result<Self, TableError> {
        let mut reader = ReaderBuilder::new()
            .trim(Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let malformed = |error: csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            let problem = match error.kind() {
                ErrorKind::UnequalLengths {
                    expected_len, len, ..
                } => format!("{len} cells, but the header has {expected_len}"),
                _ => error.to_string(),
            };
            Problem::Row(problem).at(line)
        };
        let cells = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect();
        let header = cells(reader.headers().map_err(malformed)?);
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(malformed)?;
            let line = record.position().map_or(1, csv::Position::line);
            rows.push((line, cells(&record)));
        }
        Ok(Self { header, rows })
    }

    fn has(&self, column: &str) -> bool {
        self.header.iter().any(|name| name == column)
    }

    fn column(&self, name: &'static str) -> Result<usize, TableError> {
        let at = self.header.iter().position(|found| found == name);
        at.ok_or(Problem::NoColumn(name).at(1))
    }

    /// The whole numbers of a column.
    fn whole(&self, column: &'static str) -> Result<Vec<u64>, TableError> {
        self.each(column, |text| {
            text.parse().map_err(|_| Problem::NotWhole {
                column,
                text: text.to_owned(),
            })
        })
    }

    /// The finite numbers of a column.
    fn finite(&self, column: &'static str) -> Result<Vec<f64>, TableError> {
        self.each(column, |text| {
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| Problem::NoNumber {
                column,
                text: text.to_owned(),
            })
        })
    }

    fn each<T>(
        &self,
        column: &'static str,
        read: impl Fn(&str) -> Result<T, Problem>,
    ) -> Result<Vec<T>, TableError> {
        let at = self.column(column)?;
        let rows = self.rows.iter();
        rows.map(|(line, cells)| read(&cells[at]).map_err(|problem| problem.at(*line)))
            .collect()
    }

    /// Numbers of the experiments; each may occur once.
    fn experiments(&self) -> Result<Vec<u64>, TableError> {
        let experiments = self.whole("experiment")?;
        let mut lines = BTreeMap::new();
        for (&experiment, &(line, _)) in experiments.iter().zip(&self.rows) {
            if let Some(first) = lines.insert(experiment, line) {
                return Err(Problem::Twice { experiment, first }.at(line));
            }
        }
        Ok(experiments)
    }

    /// The processes of all rows.
    fn processes(&self) -> Result<Vec<Soiptd>, TableError> {
        let [k, t_prop_s, t_body_s, tau_s] = PROCESS;
        let (k, t_prop_s) = (self.finite(k)?, self.finite(t_prop_s)?);
        let (t_body_s, tau_s) = (self.finite(t_body_s)?, self.finite(tau_s)?);
        let process = |row: usize| {
            let process = Soiptd::new(k[row], t_prop_s[row], t_body_s[row], tau_s[row]);
            process.map_err(|error| Problem::from(error).at(self.rows[row].0))
        };
        (0..self.rows.len()).map(process).collect()
    }
}

/// The truth behind a benchmark, as in `truth.csv`: the shortest numbers that read back to the same
/// bits.
#[must_use]
pub fn truth_csv(truths: &[Truth]) -> String {
    let mut text =
        "experiment,K,T_prop_s,T_body_s,tau_s,input_bias,noise_sigma,protocol,seed\n".to_owned();
    for truth in truths {
        let process = &truth.process;
        text += &format!(
            "{},{:?},{:?},{:?},{:?},{:?},{:?},{},{}\n",
            truth.number,
            process.k().unwrap_or(f64::INFINITY),
            process.t_prop_s(),
            process.t_body_s().unwrap_or(f64::INFINITY),
            process.tau_s(),
            truth.input_bias,
            truth.noise_sigma,
            PROTOCOLS[usize::from(!truth.is_trimmed)],
            truth.seed,
        );
    }
    text
}

/// Reads the truth, in the order of the file.
///
/// # Errors
/// [`TableError`], with the line.
pub fn read_truth(text: &str) -> Result<Vec<Truth>, TableError> {
    let table = Table::read(text)?;
    let numbers = table.experiments()?;
    let processes = table.processes()?;
    let (biases, sigmas) = (table.finite("input_bias")?, table.finite("noise_sigma")?);
    let seeds = table.whole("seed")?;
    let protocols = table.each("protocol", |text| match text {
        text if text == PROTOCOLS[0] => Ok(true),
        text if text == PROTOCOLS[1] => Ok(false),
        text => Err(Problem::NoProtocol(text.to_owned())),
    })?;
    if numbers.is_empty() {
        return Err(Problem::Empty.at(1));
    }
    let truth = |row: usize| Truth {
        number: numbers[row],
        process: processes[row],
        input_bias: biases[row],
        noise_sigma: sigmas[row],
        seed: seeds[row],
        is_trimmed: protocols[row],
    };
    Ok((0..numbers.len()).map(truth).collect())
}

/// An answer of another program.
#[derive(Clone, Debug, PartialEq)]
pub struct Foreign {
    /// The answer, or the reason why its process has no controller.
    pub answer: Result<Answer, String>,
    /// Time that it took (s), as its author states.
    pub seconds: Option<f64>,
}

/// Reads answers to a benchmark with these experiments, by the number of the experiment.
///
/// # Errors
/// [`TableError`], with the line: not a number, parameters out of range, an experiment twice or an
/// unknown one.
pub fn read_answers(
    text: &str,
    experiments: &BTreeSet<u64>,
) -> Result<BTreeMap<u64, Foreign>, TableError> {
    let table = Table::read(text)?;
    let numbers = table.experiments()?;
    for (number, (line, _)) in numbers.iter().zip(&table.rows) {
        if !experiments.contains(number) {
            return Err(Problem::UnknownExperiment(*number).at(*line));
        }
    }
    let (is_process, is_gains) = (
        PROCESS.iter().any(|name| table.has(name)),
        GAINS.iter().any(|name| table.has(name)),
    );
    let answers: Vec<Result<Answer, String>> = match (is_process, is_gains) {
        (true, false) => (table.processes()?.into_iter())
            .map(|process| Answer::of_process(process).map_err(|error| error.to_string()))
            .collect(),
        (false, true) => {
            let (kp, kd) = (table.finite(GAINS[0])?, table.finite(GAINS[1])?);
            let gains = kp.into_iter().zip(kd).map(|(kp, kd)| Pd { kp, kd });
            gains.map(|pd| Ok(Answer::of_gains(pd))).collect()
        }
        _ => return Err(Problem::NotAnswers.at(1)),
    };
    let seconds: Vec<Option<f64>> = if table.has("seconds") {
        table.finite("seconds")?.into_iter().map(Some).collect()
    } else {
        vec![None; numbers.len()]
    };
    let foreign = answers.into_iter().zip(seconds);
    let foreign = foreign.map(|(answer, seconds)| Foreign { answer, seconds });
    Ok(numbers.into_iter().zip(foreign).collect())
}

/// Results in order, as CSV; numbers read back to the same bits.
///
/// # Errors
/// [`csv::Error`]; never, because the text is written to memory.
pub fn results_csv(records: &[Record]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for record in records {
        writer.serialize(record)?;
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}
