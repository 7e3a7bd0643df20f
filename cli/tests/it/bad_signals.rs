//! Recordings that are not steady relay tests: a verdict with advice, or the true process.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use onecycle_onboard::{Relay, RelaySettings};

use crate::common::{
    HOVER, HOVER_K_OVER_T_BODY, HOVER_TAU_S, Outcome, Sample, Table, UNREADABLE, identify,
    identify_as_text, is_hover, simulate,
};

// ---------------------------------------------------------------- inputs that are no relay

/// Options for the estimator of steady relay oscillations alone.
const RELAY: &[&str] = &["--cycles", "8"];

#[test]
fn a_constant_input() {
    let table = Table::clean().map(|_, sample| sample.input = 0.5);
    let report = identify(table.csv(), &[]).no_process("no_relay");
    assert!(report.advice().contains("--input"));
}

// A sensor that is not connected: nothing is divided by an amplitude of zero.
#[test]
fn a_constant_output() {
    let table = Table::clean().map(|_, sample| sample.output = 0.0);
    let report = identify(table.csv(), &[]).no_process("no_response");
    assert!(report.advice().contains("--output"));
}

#[test]
fn a_continuous_input() {
    let table = Table::clean().map(|_, sample| sample.input = (14.2 * sample.time_s).sin());
    let report = identify(table.csv(), RELAY).no_process("no_relay");
    assert!(report.advice().contains("relay"));
    // The output is not that of this input: what fits it rests on frequencies at which the input has no power.
    identify(table.csv(), &[]).no_process("no_information");
}

#[test]
fn one_switch() {
    let table = Table::clean().map(|index, sample| {
        sample.input = if index < 3000 { 1.0 } else { -1.0 };
    });
    let report = identify(table.csv(), RELAY).no_process("too_short");
    assert!(report.advice().contains("four cycles"));
    // One change of the input tells little of a process that moves by itself.
    identify(table.csv(), &[]).no_process("no_information");
}

// A relay test that failed: the input moves from 1 to 2, then to 0, where it stays for 99.7 % of the recording.
#[test]
fn a_relay_that_gave_up() {
    let table = Table::clean().map(|index, sample| {
        sample.input = match index {
            0..5 => 1.0,
            5..20 => 2.0,
            _ => 0.0,
        };
    });
    let report = identify(table.csv(), RELAY).no_process("no_relay");
    let message = report.0["verdict"]["message"].as_str().unwrap();
    assert!(message.contains("switches 2 times"), "{message}");
    identify(table.csv(), &[]).no_process("no_information");
}

#[test]
fn ten_samples() {
    let table = Table::clean();
    let rise = table.rises()[5];
    let short = Table(table.0[rise - 5..rise + 5].to_vec());
    identify(short.csv(), &[]).no_process("too_short");
    // A relay that switches at every other sample.
    let coarse = Table(table.0[..10].to_vec()).map(|index, sample| {
        sample.input = [1.0, 1.0, -1.0, -1.0][index % 4];
        sample.output = [0.0, 1.0, 0.0, -1.0][index % 4];
    });
    identify(coarse.csv(), &[]).no_process("too_short");
}

#[test]
fn swapped_columns() {
    let swapped = |header: &str| {
        Table::clean()
            .map(|_, sample| std::mem::swap(&mut sample.output, &mut sample.input))
            .csv_of(header, |sample| sample.time_s)
    };
    // With wrong names there is advice, and following it works.
    let report = identify(swapped("time_s,pv,u"), &[]).no_process("no_relay");
    assert!(report.advice().contains("Swap the columns"));
    let fixed = ["--input", "pv", "--output", "u"];
    is_hover(&identify(swapped("time_s,pv,u"), &fixed).identified(), 0.01);
    // With the right names.
    is_hover(&identify(swapped("time_s,u,pv"), &[]).identified(), 0.01);
    // Options that name the same column twice.
    let twice = ["--input", "u", "--output", "u"];
    identify(Table::clean().csv(), &twice).refused(UNREADABLE, &["\"u\"", "both"]);
}

#[test]
fn columns_without_names() {
    let bare = Table::parse(&simulate(&HOVER, &["--no-trim"]));
    let text = bare.csv_of("", |sample| sample.time_s);
    let other = bare
        .map(|_, sample| std::mem::swap(&mut sample.output, &mut sample.input))
        .csv_of("", |sample| sample.time_s);
    for text in [text, other] {
        let report = identify(text.trim_start(), &[]).identified();
        report.noted(&["by how few values the input takes"]);
        is_hover(&report, 0.01);
    }
    // With trim, the input takes more than two values: the columns must be given.
    let trimmed = Table::clean().csv_of("", |sample| sample.time_s);
    identify(trimmed.trim_start(), &[]).refused(UNREADABLE, &["column 2 and column 3", "choose"]);
    let report = identify(trimmed.trim_start(), &["--input", "3", "--output", "2"]).identified();
    is_hover(&report, 0.01);
}

// ---------------------------------------------------------------- recordings of something else

#[test]
fn a_clipped_output() {
    let most = Table::clean()
        .0
        .iter()
        .map(|sample| sample.output)
        .fold(0.0, f64::max);
    for part in [0.9, 0.6] {
        let limit = part * most;
        let both =
            Table::clean().map(|_, sample| sample.output = sample.output.clamp(-limit, limit));
        let report = identify(both.csv(), &[]).no_process("saturated");
        assert!(report.advice().contains("amplitude"));
        let one = Table::clean().map(|_, sample| sample.output = sample.output.min(limit));
        identify(one.csv(), &[]).no_process("saturated");
    }
}

#[test]
fn two_cycles_only() {
    let table = Table::clean();
    let rises = table.rises();
    let cycles = |count: usize| {
        let [from, to] = [rises[8], rises[8 + count] + 80].map(|index| table.0[index].time_s);
        // From the last sample of the low level, so that the first rise is included.
        table.clone().between(from - 0.05, to)
    };
    let report = identify(cycles(2).csv(), RELAY).identified();
    assert_eq!(report.number("/oscillation/cycles_used"), 2.0);
    report.remarked(&["Only 2 steady cycles"]);
    report.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.05);
    let whole = identify(cycles(2).csv(), &[]).identified();
    whole.near("k_over_t_body", HOVER_K_OVER_T_BODY, 0.01);
}

// One complete cycle, from edge to edge, identifies the process, whether it begins with a rise or a fall; the remark says
// that nothing confirms a steady oscillation. Without noise the only error is that the past is assumed to be the cycle's
// own: less than 1 %.
#[test]
fn one_cycle_only() {
    let table = Table::clean();
    let rises = table.rises();
    let falls = Table::clean()
        .map(|_, sample| sample.input = -sample.input)
        .rises();
    for edges in [&rises, &falls] {
        let one = Table(table.0[edges[8] - 1..=edges[9]].to_vec());
        let whole = identify(one.csv(), &[]).identified();
        is_hover(&whole, 0.01);
        let report = identify(one.csv(), RELAY).identified();
        assert_eq!(report.number("/oscillation/cycles_used"), 1.0);
        assert_eq!(report.number("/oscillation/cycles_steady"), 1.0);
        assert_eq!(report.0["last_cycle"]["is_known"], true);
        report.remarked(&[
            "one complete cycle",
            "nothing",
            "steady",
            "a period earlier",
        ]);
        is_hover(&report, 0.01);
        let text = identify_as_text(one.csv(), RELAY);
        assert_eq!(text.code, Some(0), "{text:?}");
        assert!(text.stdout.contains("holds one complete cycle"), "{text:?}");
        // Without a pack the cycle cannot be confirmed.
        let report = identify(one.csv(), &["--method", "refine"]).identified();
        report.remarked(&["one complete cycle", "Record two cycles that are alike"]);
        is_hover(&report, 0.02);
    }
}

// Two edges, or three quarters of a period with the same level at both ends: no complete cycle, and the message says so.
#[test]
fn half_a_cycle() {
    let table = Table::clean();
    let rises = table.rises();
    let (from, to) = (rises[8], rises[9]);
    let quarter = (to - from) / 4;
    for rows in [
        from - 1..to,
        from + 1..to + quarter,
        from - 1..from + 3 * quarter,
    ] {
        let table = Table(table.0[rows].to_vec());
        let report = identify(table.csv(), RELAY).no_process("too_short");
        let message = report.0["verdict"]["message"].as_str().unwrap();
        assert!(message.contains("no complete cycle"), "{message}");
        assert!(report.advice().contains("four cycles"));
    }
}

/// Deterministic numbers between -1 and 1.
fn chance() -> impl FnMut() -> f64 {
    let mut seed = 12345_u64;
    move || {
        seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[test]
fn an_unsteady_oscillation() {
    let mut chance = chance();
    let mut samples = Vec::new();
    let (mut period_s, mut amplitude, mut time_s) = (0.4, 1.0, 0.0);
    for _ in 0..25 {
        let start_s: f64 = time_s;
        while time_s < start_s + period_s {
            let phase = TAU * (time_s - start_s) / period_s;
            samples.push(Sample {
                time_s,
                output: -amplitude * (phase - 0.8).sin(),
                input: if phase < 0.5 * TAU { 1.0 } else { -1.0 },
            });
            time_s = samples.len() as f64 * 1e-3;
        }
        period_s = (period_s * (1.0 + 0.5 * chance())).clamp(0.1, 2.0);
        amplitude = (amplitude * (1.0 + 0.5 * chance())).clamp(0.1, 10.0);
    }
    let table = Table(samples);
    let report = identify(table.csv(), RELAY).no_process("not_steady");
    assert!(report.advice().contains("settle"));
    // No process made these samples.
    identify(table.csv(), &[]).no_process("not_steady");
}

/// A relay test on any plant. The plant returns the controlled state and the recorded output.
fn relay_test(
    mut plant: impl FnMut(f64) -> (f64, f64),
    controlled: fn((f64, f64)) -> f64,
) -> Table {
    let settings = RelaySettings {
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
    };
    let mut relay = Relay::new(settings).expect("the settings are usual");
    let mut state = (0.0, 0.0);
    let sample = |index: i32| {
        let input = f64::from(relay.step(-controlled(state) as f32, 1e-3));
        let output = state.1;
        state = plant(input);
        Sample {
            time_s: f64::from(index) * 1e-3,
            output,
            input,
        }
    };
    Table((0..12_000).map(sample).collect())
}

/// Two masses on a spring, driven through an actuator and a dead time. Returns the positions of the driven mass and of the
/// other one, for [`relay_test`].
struct TwoMasses {
    /// Force of the actuator, then position and velocity of each mass.
    state: [f64; 5],
    masses: [f64; 2],
    stiffness: f64,
    damping: f64,
    delay: VecDeque<f64>,
}

impl TwoMasses {
    const T_PROP_S: f64 = 0.032;
    const TAU_S: f64 = 0.024;
    const DRAG_PER_S: f64 = 0.6;
    const STEPS: usize = 10;

    fn new(ratio: f64, resonance_hz: f64, damping: f64) -> Self {
        let masses = [1.0 / (1.0 + ratio), ratio / (1.0 + ratio)];
        let omega = TAU * resonance_hz;
        let reduced = masses[0] * masses[1];
        Self {
            state: [0.0; 5],
            masses,
            stiffness: omega * omega * reduced,
            damping: 2.0 * damping * omega * reduced,
            delay: vec![0.0; (Self::TAU_S * 1e3) as usize * Self::STEPS].into(),
        }
    }

    fn rate(&self, state: &[f64; 5], input: f64) -> [f64; 5] {
        let [force, x1, v1, x2, v2] = *state;
        let [m1, m2] = self.masses;
        let spring = self.stiffness * (x1 - x2) + self.damping * (v1 - v2);
        [
            (input - force) / Self::T_PROP_S,
            v1,
            (force - spring) / m1 - Self::DRAG_PER_S * v1,
            v2,
            spring / m2 - Self::DRAG_PER_S * v2,
        ]
    }

    /// Integrates one sample of 1 ms by Runge-Kutta; returns the positions of the two masses.
    fn step(&mut self, input: f64) -> (f64, f64) {
        let h = 1e-3 / Self::STEPS as f64;
        let along = |s: &[f64; 5], k: &[f64; 5], h: f64| std::array::from_fn(|i| s[i] + h * k[i]);
        for _ in 0..Self::STEPS {
            self.delay.push_back(input);
            let arrived = self.delay.pop_front().unwrap_or(0.0);
            let s = self.state;
            let k1 = self.rate(&s, arrived);
            let k2 = self.rate(&along(&s, &k1, 0.5 * h), arrived);
            let k3 = self.rate(&along(&s, &k2, 0.5 * h), arrived);
            let k4 = self.rate(&along(&s, &k3, h), arrived);
            let mean: [f64; 5] =
                std::array::from_fn(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0);
            self.state = along(&s, &mean, h);
        }
        (self.state[1], self.state[3])
    }
}

fn driven_mass(mut plant: TwoMasses) -> Table {
    relay_test(
        move |input| {
            let (x1, _) = plant.step(input);
            (x1, x1)
        },
        |state| state.0,
    )
}

fn far_mass(mut plant: TwoMasses) -> Table {
    relay_test(move |input| plant.step(input), |state| state.1)
}

// A very stiff spring acts like a single mass: a test of the integration itself.
#[test]
fn a_stiff_spring_is_a_single_mass() {
    let report = identify(driven_mass(TwoMasses::new(0.1, 200.0, 0.1)).csv(), &[]).identified();
    report
        .near("k_over_t_body", 1.0, 0.02)
        .near("t_prop_s", TwoMasses::T_PROP_S, 0.05)
        .near("tau_s", TwoMasses::TAU_S, 0.05);
}

/// Asserts that no structure explains the recording, or only one at a bound of its parameters or without information.
fn refused(outcome: &Outcome) {
    let kind = outcome.report().kind().to_owned();
    assert!(
        matches!(
            &kind[..],
            "not_this_process" | "edge_of_domain" | "no_information"
        ),
        "{kind}"
    );
}

#[test]
fn a_resonance_near_the_oscillation() {
    for plant in [
        TwoMasses::new(1.0, 2.5, 0.02),
        TwoMasses::new(1.0, 2.5, 0.1),
        TwoMasses::new(0.3, 7.0, 0.02),
    ] {
        let csv = driven_mass(plant).csv();
        refused(&identify(csv.clone(), &[]));
        let report = identify(csv, RELAY).no_process("not_this_process");
        assert!(report.advice().contains("resonance"));
    }
    refused(&identify(
        far_mass(TwoMasses::new(0.3, 1.0, 0.02)).csv(),
        &[],
    ));
}

/// Asserts that the recording is refused, or the gain is that of both masses.
fn is_not_fooled(outcome: &Outcome) {
    let report = outcome.report();
    if report.kind() == "identified" {
        report.near("k_over_t_body", 1.0, 0.25);
    }
}

#[test]
fn a_resonance_of_the_driven_mass_does_not_fool() {
    is_not_fooled(&identify(
        driven_mass(TwoMasses::new(1.0, 10.0, 0.02)).csv(),
        &[],
    ));
}

#[test]
fn a_resonance_of_the_far_mass_does_not_fool() {
    is_not_fooled(&identify(
        far_mass(TwoMasses::new(0.3, 5.0, 0.02)).csv(),
        &[],
    ));
}

/// A recording of the velocity of a simulated process, by central differences.
fn velocity(table: &Table) -> Table {
    let samples = table.0.windows(3).map(|of| Sample {
        output: (of[2].output - of[0].output) / (of[2].time_s - of[0].time_s),
        ..of[1]
    });
    Table(samples.collect())
}

#[test]
fn a_velocity_instead_of_a_position() {
    let csv = velocity(&Table::clean()).csv();
    identify(csv.clone(), RELAY).no_process("not_this_process");
    // From the whole recording it is the rate loop: the same lags without the integrator. A difference of two samples is a rate half
    // a sample ago, averaged, which is believed to be dead time.
    let report = identify(csv, &[]).identified();
    assert_eq!(report.0["structure"], "soptd");
    let of = |key: &str| report.number(&format!("/process/{key}/estimate"));
    let delay_s = of("tau_s");
    for (found, truth) in [
        (of("t_body_s"), 1.6886),
        (of("t_prop_s"), 0.0321),
        (delay_s, 0.0237),
    ] {
        assert!((found / truth - 1.0).abs() < 0.01, "{found} {truth}");
    }
}

// The interval of the phase margin has reasonable bounds, however wide it is.
#[test]
fn a_phase_margin_is_an_angle() {
    let table = driven_mass(TwoMasses::new(1.0, 10.0, 0.02));
    let report = identify(table.csv(), &[]).report();
    let low = report.0.pointer("/margins/phase_margin_deg_interval/low");
    assert!(
        low.and_then(serde_json::Value::as_f64)
            .is_none_or(|low| low > -720.0),
        "{low:?}"
    );
    let text = identify_as_text(table.csv(), &[]).stdout;
    assert!(
        text.lines().all(|line| line.chars().count() < 130),
        "{text}"
    );
}

// ---------------------------------------------------------------- numbers of any size

/// The clean recording in other units.
fn scaled(time: f64, output: f64, input: f64) -> Outcome {
    let table = Table::clean().map(|_, sample| {
        sample.time_s *= time;
        sample.output *= output;
        sample.input *= input;
    });
    identify(table.csv(), &[])
}

#[test]
fn units_of_any_size() {
    for factor in [1e-6, 1e6] {
        scaled(1.0, factor, 1.0).identified().near(
            "k_over_t_body",
            HOVER_K_OVER_T_BODY * factor,
            0.01,
        );
        scaled(1.0, 1.0, factor).identified().near(
            "k_over_t_body",
            HOVER_K_OVER_T_BODY / factor,
            0.01,
        );
        let slow = scaled(factor, 1.0, 1.0).identified();
        slow.near("k_over_t_body", HOVER_K_OVER_T_BODY / factor / factor, 0.01);
        slow.near("tau_s", HOVER_TAU_S * factor, 0.02);
    }
}

// Squares of these factors overflow. The result is a number, null for an unbounded value, or a refusal.
#[test]
fn units_beyond_reason() {
    for factor in [1e-300, 1e-150, 1e30, 1e299] {
        for (output, input) in [(factor, 1.0), (1.0, factor), (factor, factor)] {
            ends_well(&scaled(1.0, output, input));
        }
    }
}

/// Asserts that the outcome is a process, a verdict or a refusal.
fn ends_well(outcome: &Outcome) {
    match outcome.code {
        Some(0) => drop(outcome.identified()),
        Some(4) => drop(outcome.report()),
        _ => outcome.refused(UNREADABLE, &[]),
    }
}

#[test]
fn damaged_bytes_never_crash() {
    let table = Table::clean().between(1.0, 5.0);
    let text = table.csv().into_bytes();
    let mut chance = chance();
    for _ in 0..60 {
        let mut bytes = text.clone();
        for _ in 0..3 {
            let place = ((chance() + 1.0) / 2.0 * (bytes.len() - 1) as f64) as usize;
            let letters = b"0123456789.,;-+eE\n\r\t \"#naif\xff";
            let letter = ((chance() + 1.0) / 2.0 * (letters.len() - 1) as f64) as usize;
            bytes[place] = letters[letter];
        }
        ends_well(&identify(&bytes, &[]));
    }
}
