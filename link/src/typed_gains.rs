//! Gains in force, as configurations and logs of heaters have them.
//!
//! ```text
//! [extruder]                            Klipper and Kalico: printer.cfg, klippy.log, also behind `#*#`
//! pid_kp = 22.2
//! echo:  M301 P22.20 I1.08 D114.00      Marlin: M503, its log
//! control_parameters:                   ESPHome: YAML
//!   kp: 0.4
//! double Kp=2, Ki=5, Kd=1;              Arduino: sketch
//! ```

/// Gains of one loop as they stand in a file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TypedGains {
    /// The controller that takes them: `klipper`, `marlin`, `marlin-bed`, `esphome` or `arduino`.
    pub controller: &'static str,
    /// The loop, as a recording of the same device names it; empty if the file does not name it.
    pub control_loop: String,
    /// Proportional, integral and derivative gain, as typed.
    pub values: [f64; 3],
}

const NAMES: [&str; 3] = ["kp", "ki", "kd"];

/// All gains in a text, in its order; of a loop that stands there twice, the last.
pub fn typed_gains(text: &str) -> Vec<TypedGains> {
    let mut found: Vec<TypedGains> = Vec::new();
    let mut section = String::new();
    let mut of_section = [None; 3];
    let mut of_yaml = [None; 3];
    let mut of_sketch = [None; 3];
    let mut is_yaml = false;
    for line in text.lines() {
        let line = line.trim_start_matches("#*#").trim();
        if let Some(name) = line
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'))
        {
            add(&mut found, ("klipper", &section), of_section);
            section = name
                .split_whitespace()
                .last()
                .unwrap_or_default()
                .to_owned();
            of_section = [None; 3];
        }
        for (command, controller, control_loop) in
            [("M301 ", "marlin", "T"), ("M304 ", "marlin-bed", "B")]
        {
            if let Some((_, words)) = line.split_once(command) {
                let of = |letter: char| {
                    let word = words
                        .split_whitespace()
                        .find_map(|word| word.strip_prefix(letter));
                    word.and_then(number)
                };
                add(
                    &mut found,
                    (controller, control_loop),
                    ['P', 'I', 'D'].map(of),
                );
            }
        }
        if line.contains("control_parameters:") {
            (is_yaml, of_yaml) = (true, [None; 3]);
        }
        for (at, name) in NAMES.iter().enumerate() {
            let key = |prefix: &str| value_of(line, &format!("{prefix}{name}"));
            if let Some(value) = key("pid_") {
                of_section[at] = Some(value);
            } else if let Some(value) = key("") {
                let of = if is_yaml {
                    &mut of_yaml
                } else {
                    &mut of_sketch
                };
                of[at] = Some(value);
            }
        }
    }
    add(&mut found, ("klipper", &section), of_section);
    add(&mut found, ("esphome", ""), of_yaml);
    if found.is_empty() {
        add(&mut found, ("arduino", ""), of_sketch);
    }
    found
}

/// Adds the gains of a loop, in place of those before. Without a proportional gain nothing is added.
fn add(
    found: &mut Vec<TypedGains>,
    (controller, control_loop): (&'static str, &str),
    values: [Option<f64>; 3],
) {
    let [Some(kp), ki, kd] = values else { return };
    found.retain(|of| (of.controller, of.control_loop.as_str()) != (controller, control_loop));
    found.push(TypedGains {
        controller,
        control_loop: control_loop.to_owned(),
        values: [kp, ki.unwrap_or(0.0), kd.unwrap_or(0.0)],
    });
}

/// The number behind a name and `:` or `=`, in any case; not behind a longer name.
fn value_of(line: &str, name: &str) -> Option<f64> {
    let lower = line.to_ascii_lowercase();
    let found = lower.match_indices(name).find_map(|(at, _)| {
        let before = lower[..at].chars().next_back();
        let rest = lower[at + name.len()..].trim_start();
        let is_name = before.is_none_or(|c| !c.is_alphanumeric() && c != '_');
        rest.strip_prefix([':', '=']).filter(|_| is_name)
    });
    number(found?.trim_start().split([',', ';', ' ', '#']).next()?)
}

fn number(text: &str) -> Option<f64> {
    text.trim()
        .trim_end_matches('f')
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<(&'static str, String, [f64; 3])> {
        let all = typed_gains(text).into_iter();
        all.map(|of| (of.controller, of.control_loop, of.values))
            .collect()
    }

    #[test]
    fn gains_where_they_stand() {
        let klipper = "[extruder]\ncontrol = pid\npid_Kp: 20.5\npid_ki = 1.5\npid_kd=70\n[fan]\npin: PA1\n[heater_bed]\npid_kp: 60\npid_ki: 2\n\
                       pid_kd: 500\n#*# [extruder]\n#*# pid_kp = 22.2\n#*# pid_ki = 1.25\n#*# pid_kd = 80.5\n";
        let bed = ("klipper", "heater_bed".to_owned(), [60.0, 2.0, 500.0]);
        let extruder = ("klipper", "extruder".to_owned(), [22.2, 1.25, 80.5]);
        assert_eq!(found(klipper), [bed, extruder]);
        let marlin =
            "Recv: echo:  M301 P22.20 I1.08 D114.00\nRecv: echo:  M304 P97.1 I1.41 D800 ; bed\n";
        let hot = ("marlin", "T".to_owned(), [22.2, 1.08, 114.0]);
        let bed = ("marlin-bed", "B".to_owned(), [97.1, 1.41, 800.0]);
        assert_eq!(found(marlin), [hot, bed]);
        let yaml = "climate:\n  - platform: pid\n    control_parameters:\n      kp: 0.49460\n      ki: 0.00487\n      kd: 12.56301\n";
        assert_eq!(
            found(yaml),
            [("esphome", String::new(), [0.4946, 0.00487, 12.56301])]
        );
        let sketch = "double Kp=2, Ki=5.5, Kd=1;\nPID myPID(&Input, &Output, &Setpoint, Kp, Ki, Kd, DIRECT);\n";
        assert_eq!(found(sketch), [("arduino", String::new(), [2.0, 5.5, 1.0])]);
        for text in ["", "M301", "pid_ki = 2", "kp =", "[a]\npid_kp: x"] {
            assert_eq!(found(text), [], "{text}");
        }
    }
}
