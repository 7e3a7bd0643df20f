//! One file, its recording and its process, as a page uses them.
//!
//! | message | answer |
//! | --- | --- |
//! | `{"do":"open"}` | forgets the file; its bytes follow by [`Session::append`] |
//! | `{"do":"read"}` | `{samples, from_s, to_s, notes, time_s, input, output}`: the columns, thinned to at most 2,000 points |
//! | `{"do":"identify"}`, with `from_s`, `to_s` (s) at will | `{structure, law, parameters, gains, remarks}` or `{verdict, says}` |
//! | `{"do":"judge", "kp", "ki", "kd", "filter_s"}` | margins, peaks, step, load and Nyquist curve of this PID, least margins |
//!
//! An answer with `error` holds one sentence. Infinite numbers are `null`.

use onecycle::{
    Controller, Identified, Identify, Model, Pid, Recording, assess, least_margins, load_response,
    step_response,
};
use onecycle_design::{Sample, loop_response};
use serde_json::{Value, json};

/// Bytes of the largest file that is read: its text and its columns fit in the 4 GiB of a page's memory.
const MOST_BYTES: usize = 512 << 20;
/// Points of a curve in the page, about two for each pixel of a desk.
const POINTS: usize = 2000;
/// Frequencies of the Nyquist curve, over three decades about the gain crossover.
const FREQUENCIES: u32 = 240;
/// Processes of the posterior that judge the gains at each move of a slider.
const DRAWS: usize = 40;

/// What the page works on.
#[derive(Default)]
pub struct Session {
    file: Vec<u8>,
    /// The file is longer than `MOST_BYTES`.
    too_long: bool,
    recording: Option<Recording>,
    identified: Option<Identified>,
    /// Processes of the posterior.
    draws: Vec<Model>,
}

impl Session {
    /// Takes the next bytes of the file.
    pub fn append(&mut self, bytes: &[u8]) {
        self.too_long |= self.file.len() + bytes.len() > MOST_BYTES;
        if !self.too_long {
            self.file.extend_from_slice(bytes);
        }
    }

    /// Answers a message in JSON.
    pub fn ask(&mut self, message: &[u8]) -> Value {
        let answer = match serde_json::from_slice::<Value>(message) {
            Err(error) => Err(format!("the message is not JSON: {error}")),
            Ok(message) => match message["do"].as_str() {
                Some("open") => {
                    *self = Self::default();
                    Ok(json!({}))
                }
                Some("read") => self.read(),
                Some("identify") => self.identify(&message),
                Some("judge") => self.judge(&message),
                _ => Err(format!("unknown message {}", message["do"])),
            },
        };
        answer.unwrap_or_else(|error| json!({ "error": error }))
    }

    fn read(&mut self) -> Result<Value, String> {
        // The text is not needed beside its columns.
        let file = std::mem::take(&mut self.file);
        if self.too_long {
            return Err(format!("The file is longer than {} MB.", MOST_BYTES >> 20));
        }
        let recording = onecycle::read_from(&file[..], &Default::default())
            .map_err(|error| error.to_string())?;
        let every = recording.time_s().len().div_ceil(POINTS).max(1);
        let thin = |column: &[f64]| column.iter().copied().step_by(every).collect::<Vec<f64>>();
        let notes: Vec<String> = recording.notes().iter().map(ToString::to_string).collect();
        let answer = json!({
            "samples": recording.time_s().len(),
            "from_s": recording.time_s().first(),
            "to_s": recording.time_s().last(),
            "notes": notes,
            "time_s": thin(recording.time_s()),
            "input": thin(recording.input()),
            "output": thin(recording.output()),
        });
        self.recording = Some(recording);
        Ok(answer)
    }

    fn identify(&mut self, message: &Value) -> Result<Value, String> {
        let recording = self.recording.as_ref().ok_or("No recording is open.")?;
        let found = Identify::new()
            .span_s(message["from_s"].as_f64(), message["to_s"].as_f64())
            .run(recording);
        let remarks: Vec<&str> = found.remarks.iter().map(|remark| remark.kind()).collect();
        (self.identified, self.draws) = (None, Vec::new());
        let identified = match found.outcome {
            Ok(identified) => identified,
            Err(verdict) => {
                return Ok(json!({ "verdict": verdict.kind(), "says": verdict.to_string() }));
            }
        };
        let parameters: Vec<Value> = (identified.estimate.iter())
            .map(|(parameter, interval)| {
                json!({
                    "name": parameter.key(),
                    "symbol": parameter.symbol(),
                    "estimate": interval.estimate,
                    "low": interval.low,
                    "high": interval.high,
                })
            })
            .collect();
        let structure = identified.model.structure();
        let gains = identified
            .design
            .as_ref()
            .map(|design| gains(&design.controller));
        self.draws = identified.for_design(DRAWS).1;
        self.identified = Some(identified);
        Ok(json!({
            "structure": structure.name(),
            "law": structure.transfer_function(),
            "parameters": parameters,
            "gains": gains,
            "remarks": remarks,
        }))
    }

    fn judge(&self, message: &Value) -> Result<Value, String> {
        let identified = self
            .identified
            .as_ref()
            .ok_or("No process is identified.")?;
        let number = |name: &str| {
            let value = message[name].as_f64();
            value.ok_or_else(|| format!("{name} must be a number."))
        };
        // The proposal's filters and sampling stay.
        let proposed = identified.design.as_ref().map(|of| of.controller.pid());
        let mut pid = proposed.unwrap_or(Pid::new(0.0, 0.0, 0.0));
        (pid.kp, pid.ki, pid.kd) = (number("kp")?, number("ki")?, number("kd")?);
        let controller = Controller::from(pid.with_filter_s(number("filter_s")?));
        let model = &identified.model;
        let noise = identified.specification.noise;
        let Some(figures) = assess(model, &controller, noise.as_ref()) else {
            return Ok(json!({ "stable": false }));
        };
        let crossover = figures.margins.gain_crossover_rad_per_s;
        let nyquist: Vec<[f64; 2]> = (0..FREQUENCIES)
            .filter_map(|index| {
                let decades = 3.0 * f64::from(index) / f64::from(FREQUENCIES - 1) - 1.2;
                let at = loop_response(model, &controller, crossover * 10_f64.powf(decades))?;
                let (sin, cos) = at.phase_rad.sin_cos();
                Some([at.magnitude * cos, at.magnitude * sin])
            })
            .collect();
        let step = step_response(model, &controller).map(|of| curve(&of.samples));
        let load = load_response(model, &controller).map(|of| curve(&of.samples));
        let least = least_margins(&self.draws, &controller);
        Ok(json!({
            "stable": true,
            "phase_margin_deg": figures.margins.phase_margin_rad.to_degrees(),
            "gain_margin": figures.margins.gain_margin,
            "delay_margin_s": figures.margins.delay_margin_s,
            "ms": figures.ms,
            "mt": figures.mt,
            "noise_share": figures.noise_share,
            "overshoot": figures.step.map(|of| of.overshoot),
            "settling_time_s": figures.step.map(|of| of.settling_time_s),
            "nyquist": nyquist,
            "step": step.ok(),
            "load": load.ok(),
            "least": least.map(|of| json!({
                "stable": of.stable,
                "phase_margin_deg": of.phase_margin_rad.to_degrees(),
                "ms": of.ms,
            })),
        }))
    }
}

fn gains(controller: &Controller) -> Value {
    let filter_s = controller.pid().filter_s;
    json!({
        "kp": controller.kp(), "ki": controller.ki(), "kd": controller.kd(), "filter_s": filter_s,
    })
}

/// Time (s) and output of at most 400 of the samples.
fn curve(samples: &[Sample]) -> Vec<[f64; 2]> {
    let every = samples.len().div_ceil(400).max(1);
    let points = samples.iter().step_by(every);
    points.map(|sample| [sample.t_s, sample.y]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOVER: &[u8] = include_bytes!("../../examples/simulated_hover.csv");

    fn ask(session: &mut Session, message: Value) -> Value {
        session.ask(message.to_string().as_bytes())
    }

    // The numbers of the messages are those of the library to the bit: f64 to JSON and back is exact.
    #[test]
    fn a_file_in_chunks_gives_the_numbers_of_the_library() {
        let mut session = Session::default();
        HOVER.chunks(1000).for_each(|chunk| session.append(chunk));
        let read = ask(&mut session, json!({ "do": "read" }));
        assert_eq!(read["error"], Value::Null);
        let answer = ask(&mut session, json!({ "do": "identify" }));
        let recording = onecycle::read_from(HOVER, &Default::default()).unwrap();
        let identified = Identify::new().run(&recording).outcome.unwrap();
        for (place, (_, interval)) in identified.estimate.iter().enumerate() {
            let of = &answer["parameters"][place];
            assert_eq!(of["estimate"].as_f64(), interval.estimate);
            assert_eq!(of["low"].as_f64(), interval.low);
        }
        let design = identified.design.unwrap();
        assert_eq!(answer["gains"]["kp"].as_f64(), Some(design.controller.kp()));
        let mut message = answer["gains"].clone();
        message["do"] = json!("judge");
        let judged = ask(&mut session, message.clone());
        let margin_deg = design.margins.phase_margin_rad.to_degrees();
        assert!((judged["phase_margin_deg"].as_f64().unwrap() - margin_deg).abs() < 1e-6);
        // A hundred times the gain is past the gain margin.
        message["kp"] = json!(100.0 * design.controller.kp());
        assert_eq!(ask(&mut session, message)["stable"], json!(false));
    }

    #[test]
    fn bad_messages_and_files_have_an_error() {
        let mut session = Session::default();
        assert!(session.ask(b"{")["error"].is_string());
        assert!(ask(&mut session, json!({ "do": "fly" }))["error"].is_string());
        assert!(ask(&mut session, json!({ "do": "identify" }))["error"].is_string());
        session.append(b"t,u,y\n0,1,x\n");
        let error = ask(&mut session, json!({ "do": "read" }));
        assert!(
            error["error"].as_str().unwrap().contains("line 2"),
            "{error}"
        );
    }
}
