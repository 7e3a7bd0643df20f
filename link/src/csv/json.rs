//! JSON with recordings: tables as objects or arrays, histories of Home Assistant, the temperature store of Moonraker, tests of SysId,
//! answers of InfluxDB and Prometheus.
//!
//! ```text
//! {"result": {"extruder": {"temperatures": [..], "targets": [..], "powers": [..]}}}     Moonraker, one sample a second
//! [[{"entity_id": "sensor.a", "state": "79.9", "last_changed": ".."}, {"state": ..}]]   Home Assistant, REST
//! {"sensor.a": [{"s": "79.9", "lu": 1710230400.1}]}                                     Home Assistant, WebSocket
//! {"slow-forward": [[t, volts, position, velocity], ..], ..}                            SysId until 2023
//! {"results": [{"series": [{"name": "a", "columns": ["time", "u"], "values": [[..]]}]}]}   InfluxDB 1
//! {"data": {"result": [{"metric": {"__name__": "a"}, "values": [[t, "79.9"]]}]}}        Prometheus
//! [{"t": 0, "u": 1, "y": 2}, ..]   {"t": [..], "u": [..], "y": [..]}   {"t": 0, ..} one a line     any table
//! ```

use serde_json::{Deserializer, Map, Value};

use super::error::ReadError;
use super::sheet::Sheet;

/// Largest file, in bytes; its values take some ten times as much memory.
pub(super) const MOST_BYTES: usize = 1 << 25;

/// Most columns of a table.
const MOST_COLUMNS: usize = 512;

/// The seconds between two samples of the temperature store (Moonraker, `data_store`).
const STORE_PERIOD_S: u32 = 1;

/// The lists of a heater in the temperature store, and their names here.
const STORE: [(&str, &str); 4] = [
    ("temperatures", "temperature"),
    ("targets", "target"),
    ("powers", "power"),
    ("speeds", "speed"),
];

/// Columns of a test of SysId; of a drive with two sides the left one.
const OF_MECHANISM: [&str; 4] = ["time [s]", "voltage [V]", "position", "velocity"];
const OF_DRIVE: [&str; 10] = [
    "time [s]",
    "left voltage [V]",
    "right voltage [V]",
    "left position",
    "right position",
    "left velocity",
    "right velocity",
    "angle",
    "angular rate",
    "",
];

/// Whether a text begins like JSON: `[08:00:01]` does not.
pub(super) fn begins(text: &[u8]) -> bool {
    let text = text.trim_ascii_start();
    let inner = text.get(1..).unwrap_or_default().trim_ascii_start();
    match text.first() {
        Some(b'{') => true,
        Some(b'[') => matches!(inner.first(), Some(b'{' | b'[')),
        _ => false,
    }
}

/// The table of a JSON text, and what it is.
///
/// # Errors
/// The text is cut off or no JSON, or has no table.
pub(super) fn read(text: &[u8]) -> Result<(Sheet, &'static str), ReadError> {
    let mut values = Vec::new();
    let mut stream = Deserializer::from_slice(text).into_iter::<Value>();
    loop {
        match stream.next() {
            Some(Ok(value)) => values.push(value),
            // The last line of a log may be cut off.
            Some(Err(error)) if error.is_eof() && values.len() > 1 => break,
            Some(Err(error)) => {
                return Err(ReadError::BadJson {
                    line: error.line() as u64,
                    is_cut: error.is_eof(),
                });
            }
            None => break,
        }
    }
    let value = match values.len() {
        1 => values.pop().unwrap_or_default(),
        _ => Value::Array(values),
    };
    let known = [
        store,
        sys_id,
        home_assistant,
        compressed,
        influx,
        prometheus,
        rows,
        lists,
    ];
    let found = known.iter().find_map(|read| read(&value));
    found
        .filter(|(sheet, _)| !sheet.is_empty())
        .ok_or(ReadError::JsonNoTable)
}

type Found = Option<(Sheet, &'static str)>;

/// Moonraker's temperature store.
fn store(value: &Value) -> Found {
    let heaters = value.get("result").unwrap_or(value).as_object()?;
    let mut names = vec!["time [s]".to_owned()];
    let mut lists: Vec<&[Value]> = Vec::new();
    for (heater, of) in heaters {
        // `heater_generic dryer`, `temperature_sensor mcu`.
        let heater = heater.rsplit(' ').next().unwrap_or(heater);
        of.get("temperatures")?;
        for (key, name) in STORE {
            if let Some(list) = of.get(key).and_then(Value::as_array) {
                names.push(format!("{heater}.{name}"));
                lists.push(list);
            }
        }
    }
    // The newest sample is the last of each.
    let rows = lists.iter().map(|list| list.len()).max()?;
    let mut sheet = Sheet::wide(names);
    for row in 0..rows {
        let cell = |list: &&[Value]| {
            let at = (row + list.len()).checked_sub(rows);
            at.and_then(|at| list.get(at))
                .map(plain)
                .unwrap_or_default()
        };
        let time = (row * STORE_PERIOD_S as usize).to_string();
        sheet.row(std::iter::once(time).chain(lists.iter().map(cell)));
    }
    Some((
        sheet,
        "a temperature store of Moonraker with one sample a second",
    ))
}

/// Tests of SysId, in order of time.
fn sys_id(value: &Value) -> Found {
    let tests = value.as_object()?;
    let mut rows: Vec<&Vec<Value>> = Vec::new();
    for (name, test) in tests {
        if name.ends_with("forward") || name.ends_with("backward") {
            rows.extend(test.as_array()?.iter().filter_map(Value::as_array));
        }
    }
    let names = match rows.first()?.len() {
        4 => &OF_MECHANISM[..],
        width @ 9..=10 => &OF_DRIVE[..width],
        _ => return None,
    };
    let time = |row: &Vec<Value>| row.first().and_then(Value::as_f64).unwrap_or(f64::NAN);
    rows.sort_by(|a, b| time(a).total_cmp(&time(b)));
    let mut sheet = Sheet::wide(names.iter().map(|&name| name.to_owned()).collect());
    for row in rows.iter().filter(|row| row.len() == names.len()) {
        sheet.row(row.iter().map(plain));
    }
    Some((sheet, "a recording of SysId"))
}

/// A history of Home Assistant from its REST interface.
fn home_assistant(value: &Value) -> Found {
    let entities = value.as_array()?;
    let mut sheet = Sheet::long();
    for entity in entities {
        // The first state of each entity names it.
        let states = entity.as_array()?;
        let name = states.first()?.get("entity_id")?.as_str()?;
        for state in states {
            let stamp = ["last_changed", "last_updated"]
                .into_iter()
                .find_map(|key| state.get(key));
            add_state(
                &mut sheet,
                &plain(stamp?),
                name,
                (state.get("state")?, state.get("attributes")),
            );
        }
    }
    Some((sheet, "a history of Home Assistant"))
}

/// A history of Home Assistant from its WebSocket.
fn compressed(value: &Value) -> Found {
    let entities = value.get("result").unwrap_or(value).as_object()?;
    let mut sheet = Sheet::long();
    for (name, states) in entities {
        for state in states.as_array()? {
            let stamp = ["lc", "lu"].into_iter().find_map(|key| state.get(key));
            add_state(
                &mut sheet,
                &plain(stamp?),
                name,
                (state.get("s")?, state.get("a")),
            );
        }
    }
    Some((sheet, "a history of Home Assistant"))
}

/// A state, and the temperatures of a thermostat.
fn add_state(
    sheet: &mut Sheet,
    time: &str,
    name: &str,
    (state, attributes): (&Value, Option<&Value>),
) {
    sheet.row([time, name, &plain(state)]);
    if name.starts_with("climate.") {
        for (key, of) in [
            ("current_temperature", "temperature"),
            ("temperature", "target"),
        ] {
            if let Some(value) = attributes.and_then(|all| all.get(key)) {
                sheet.row([time, &format!("{name}.{of}"), &plain(value)]);
            }
        }
    }
}

/// Series of InfluxDB 1.
fn influx(value: &Value) -> Found {
    let results = value.get("results")?.as_array()?;
    let mut sheet = Sheet::long();
    for series in results
        .iter()
        .filter_map(|result| result.get("series")?.as_array())
        .flatten()
    {
        let measurement = plain(series.get("name")?);
        let columns: Vec<String> = series
            .get("columns")?
            .as_array()?
            .iter()
            .map(plain)
            .collect();
        let time = columns.iter().position(|name| name == "time")?;
        for row in series
            .get("values")?
            .as_array()?
            .iter()
            .filter_map(Value::as_array)
        {
            for (name, value) in columns.iter().zip(row).filter(|(name, _)| *name != "time") {
                if value.is_number() || value.is_boolean() {
                    sheet.row([
                        &plain(row.get(time)?),
                        &format!("{measurement}.{name}"),
                        &plain(value),
                    ]);
                }
            }
        }
    }
    Some((sheet, "an answer of InfluxDB"))
}

/// A range of Prometheus.
fn prometheus(value: &Value) -> Found {
    let mut sheet = Sheet::long();
    for series in value.get("data")?.get("result")?.as_array()? {
        let labels = series.get("metric")?.as_object()?;
        let mut name = labels.get("__name__").map(plain).unwrap_or_default();
        for (_, value) in labels.iter().filter(|(key, _)| *key != "__name__") {
            name = format!("{name}.{}", plain(value));
        }
        for pair in series
            .get("values")?
            .as_array()?
            .iter()
            .filter_map(Value::as_array)
        {
            sheet.row([&plain(pair.first()?), name.as_str(), &plain(pair.get(1)?)]);
        }
    }
    Some((sheet, "an answer of Prometheus"))
}

/// Rows as objects, one level of objects within.
fn rows(value: &Value) -> Found {
    let rows = match value {
        Value::Array(rows) => rows,
        // The only array of objects of an object.
        Value::Object(of) => {
            let mut arrays = of.values().filter_map(Value::as_array);
            arrays.find(|rows| rows.first().is_some_and(Value::is_object))?
        }
        _ => return None,
    };
    let mut names: Vec<String> = Vec::new();
    for row in rows.iter().take(1000) {
        for (name, _) in flat(row.as_object()?) {
            if !names.contains(&name) && names.len() < MOST_COLUMNS {
                names.push(name);
            }
        }
    }
    let mut sheet = Sheet::wide(names.clone());
    for row in rows {
        let cells = flat(row.as_object()?);
        let cell = |name: &String| cells.iter().find(|(key, _)| key == name);
        sheet.row(
            names
                .iter()
                .map(|name| cell(name).map_or_else(String::new, |(_, value)| plain(value))),
        );
    }
    (names.len() > 1).then_some((sheet, "JSON with a row in each object"))
}

fn flat(of: &Map<String, Value>) -> Vec<(String, &Value)> {
    let mut all = Vec::new();
    for (name, value) in of {
        match value {
            Value::Object(inner) => {
                all.extend(
                    inner
                        .iter()
                        .map(|(key, value)| (format!("{name}.{key}"), value)),
                );
            }
            Value::Array(_) => {}
            _ => all.push((name.clone(), value)),
        }
    }
    all
}

/// Columns as lists of one length; in one level of objects too.
fn lists(value: &Value) -> Found {
    let mut columns: Vec<(String, &Vec<Value>)> = Vec::new();
    for (name, value) in value.as_object()? {
        match value {
            Value::Array(list) => columns.push((name.clone(), list)),
            Value::Object(inner) => columns.extend(
                (inner.iter())
                    .filter_map(|(key, value)| Some((format!("{name}.{key}"), value.as_array()?))),
            ),
            _ => {}
        }
    }
    columns.truncate(MOST_COLUMNS);
    let rows = columns.iter().map(|(_, list)| list.len()).max()?;
    columns.retain(|(_, list)| {
        list.len() == rows
            && list
                .iter()
                .all(|value| !value.is_array() && !value.is_object())
    });
    let mut sheet = Sheet::wide(columns.iter().map(|(name, _)| name.clone()).collect());
    for row in 0..rows {
        sheet.row(
            columns
                .iter()
                .map(|(_, list)| list.get(row).map(plain).unwrap_or_default()),
        );
    }
    (columns.len() > 1).then_some((sheet, "JSON with a list for each column"))
}

/// The text of a value; empty for null, arrays and objects.
fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        Value::Bool(value) => value.to_string(),
        _ => String::new(),
    }
}
