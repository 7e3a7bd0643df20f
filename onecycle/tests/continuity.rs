//! What does not change a process does not change the answer. No truth is needed.

use onecycle::{CsvOptions, Identification, Identify, Parameter, Recording, Structure};

const FILES: [&str; 6] = [
    "simulated_hover.csv",
    "jsbsim_f450_alt_noise1.csv",
    "rotorpy_sih_roll_noise1.csv",
    "ardupilot_altitude.csv",
    "plant/tec_relay_run2.csv",
    "plant/tic205_values.csv",
];

/// Powers of two: the changed recording has the same digits.
const OUTPUT_UNITS: f64 = 1024.0;
const INPUT_UNITS: f64 = 8.0;
const SLOWER: f64 = 64.0;

struct Columns {
    time_s: Vec<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
}

impl Columns {
    fn read(name: &str) -> Self {
        let path = format!("{}/../examples/{name}", env!("CARGO_MANIFEST_DIR"));
        let recording = onecycle::read(path, &CsvOptions::default()).expect("an example");
        Self {
            time_s: recording.time_s().to_vec(),
            input: recording.input().to_vec(),
            output: recording.output().to_vec(),
        }
    }

    /// With each column times its factor.
    fn scaled(&self, [time, input, output]: [f64; 3]) -> Self {
        let times = |column: &[f64], factor: f64| column.iter().map(|v| v * factor).collect();
        Self {
            time_s: times(&self.time_s, time),
            input: times(&self.input, input),
            output: times(&self.output, output),
        }
    }

    fn part(&self, rows: std::ops::Range<usize>) -> Self {
        Self {
            time_s: self.time_s[rows.clone()].to_vec(),
            input: self.input[rows.clone()].to_vec(),
            output: self.output[rows].to_vec(),
        }
    }
}

fn identified(columns: &Columns) -> Identification {
    let recording = Recording::from_samples(&columns.time_s, &columns.input, &columns.output)
        .expect("rows in order");
    Identify::new().run(&recording)
}

type Process = (Structure, Vec<(Parameter, f64)>);

/// Structure and parameters, or the kind of the verdict.
fn answer(found: &Identification) -> Result<Process, &'static str> {
    match &found.outcome {
        Ok(found) => {
            let parameters = found.estimate.iter();
            let values =
                parameters.map(|(parameter, of)| (parameter, of.estimate.unwrap_or(f64::INFINITY)));
            Ok((found.model.structure(), values.collect()))
        }
        Err(verdict) => Err(verdict.kind()),
    }
}

/// Factor of a parameter if time, input and output are multiplied by these.
fn factor(parameter: Parameter, structure: Structure, [time, input, output]: [f64; 3]) -> f64 {
    let integrators = structure.stages().integrators as i32;
    let per_integration = |more: i32| time.powi(-(integrators + more));
    match parameter {
        Parameter::K => output / input * per_integration(0),
        // Without a slow lag there is one integrator more in its place.
        Parameter::KOverTBody => {
            let has_body = structure.parameters().contains(&Parameter::TBody);
            output / input * per_integration(i32::from(has_body))
        }
        Parameter::InverseTBody | Parameter::NaturalFrequency => 1.0 / time,
        Parameter::Zeta => 1.0,
        Parameter::InputBias => input,
        _ => time,
    }
}

// A structure once depended on the unit of the output: the evidence of structures with different numbers of unknown states had
// a prior in that unit, worth 14 in BIC between volts and millivolts.
#[test]
fn units_and_speed_do_not_matter() {
    for name in FILES {
        let columns = Columns::read(name);
        let before = answer(&identified(&columns));
        let changes = [
            [1.0, INPUT_UNITS, OUTPUT_UNITS],
            [1.0, 1.0 / INPUT_UNITS, 1.0 / OUTPUT_UNITS],
            [SLOWER, 1.0, 1.0],
        ];
        for factors in changes {
            let after = answer(&identified(&columns.scaled(factors)));
            match (&before, &after) {
                (Ok((structure, before)), Ok((other, after))) => {
                    assert_eq!(structure, other, "{name} {factors:?}");
                    for ((parameter, before), (_, after)) in before.iter().zip(after) {
                        let expected = before * factor(*parameter, *structure, factors);
                        let is_alike = (after - expected).abs() <= 1e-3 * expected.abs();
                        assert!(
                            is_alike || after == &expected,
                            "{name} {factors:?} {parameter:?}: {after} for {expected}"
                        );
                    }
                }
                _ => assert_eq!(before.is_err(), after.is_err(), "{name} {factors:?}"),
            }
        }
    }
}

#[test]
fn a_few_rows_less_and_turned_signs_leave_the_answer() {
    for name in FILES {
        let columns = Columns::read(name);
        let count = columns.time_s.len();
        let before = identified(&columns);
        let cut = (count / 100).max(3);
        let changed = [cut..count, 0..count - cut, 7..count].map(|rows| columns.part(rows));
        let turned = columns.scaled([1.0, -1.0, -1.0]);
        let changed = changed.iter().chain([&turned]);
        for (change, columns) in ["start", "end", "seven rows", "signs"].iter().zip(changed) {
            let after = identified(columns);
            assert_eq!(
                before.outcome.is_ok(),
                after.outcome.is_ok(),
                "{name} {change}"
            );
            let (Ok(before), Ok(after)) = (&before.outcome, &after.outcome) else {
                continue;
            };
            for parameter in [Parameter::KOverTBody, Parameter::K] {
                let pair = before
                    .estimate
                    .get(parameter)
                    .zip(after.estimate.get(parameter));
                let Some((one, other)) = pair else { continue };
                let ends = |of: onecycle::Interval| {
                    (
                        of.low.unwrap_or(f64::NEG_INFINITY),
                        of.high.unwrap_or(f64::INFINITY),
                    )
                };
                let ((low, high), (from, to)) = (ends(one), ends(other));
                assert!(low <= to && from <= high, "{name} {change} {parameter:?}");
            }
        }
    }
}
