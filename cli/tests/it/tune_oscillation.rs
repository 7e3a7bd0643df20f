//! `tune` from one oscillation: ultimate gain and period, a relay test, the gains of a rule.

use onecycle::{Controller, Model, Pid, sensitivity};
use onecycle_design::rules::{Ultimate, ziegler_nichols};
use onecycle_design::{Form, Linear, Structure, load_iae};

use crate::common::{Report, reported, run};

fn tune(arguments: &[&str]) -> Report {
    run(&[&["tune", "--json"], arguments].concat()).report()
}

fn gains(report: &Report) -> [f64; 4] {
    ["kp", "ki", "kd", "filter_s"].map(|name| report.number(&format!("/controller/{name}")))
}

fn controller(report: &Report) -> Controller {
    let [kp, ki, kd, filter_s] = gains(report);
    Pid::new(kp, ki, kd).with_filter_s(filter_s).into()
}

fn same(one: &Report, other: &Report, part: f64) {
    for (a, b) in gains(one).into_iter().zip(gains(other)) {
        assert!((a / b - 1.0).abs() < part, "{a} {b}");
    }
}

/// A process with an infinite or finite first lag, a second one and dead time.
fn process(slope: f64, [first_s, second_s]: [f64; 2], tau_s: f64) -> Model {
    let structure = if second_s > 0.0 {
        Structure::Soptd
    } else {
        Structure::Foptd
    };
    Linear::new(structure)
        .with_gain(slope)
        .with_pole_per_s(1.0 / first_s)
        .with_lags_s([second_s, 1.0])
        .with_tau_s(tau_s)
        .into()
}

// Heaters (tau/T of 0.05 to 1; second lags of half to eight dead times) and integrators by their true KU and TU: each true loop
// keeps Ms 1.6, where Ziegler and Nichols keep it on none. Their load error is smaller; the docs have how much.
#[test]
fn the_true_process_keeps_the_limit() {
    let cases = [
        ([20.0, 0.0], 1.0),
        ([5.0, 0.0], 1.0),
        ([1.0, 0.0], 1.0),
        ([220.0, 8.0], 1.0),
        ([600.0, 20.0], 5.0),
        ([900.0, 40.0], 12.0),
        ([3600.0, 300.0], 120.0),
        ([f64::INFINITY, 0.0], 2.0),
        ([f64::INFINITY, 4.0], 1.0),
    ];
    for (lags_s, tau_s) in cases {
        let truth = process(0.5, lags_s, tau_s);
        let known = Ultimate::of(&truth).unwrap();
        let (gain, period) = (known.gain.to_string(), known.period_s.to_string());
        let found = tune(&["--ultimate-gain", &gain, "--ultimate-period", &period]);
        let ours = controller(&found);
        let peaks = sensitivity(&truth, &ours).unwrap();
        assert!(peaks.ms < 1.61 && peaks.mt < 1.61, "{lags_s:?} {peaks:?}");
        assert!(found.number("/family/margins/ms/high") < 1.61);
        assert!(peaks.ms <= found.number("/family/margins/ms/high") + 0.01);
        let theirs = ziegler_nichols(&known, Form::Pid)
            .unwrap()
            .with_filter_s(period_share(&known));
        let of_rule = sensitivity(&truth, &theirs.into()).map_or(f64::INFINITY, |of| of.ms);
        assert!(of_rule > 1.7, "{lags_s:?} {of_rule}");
        let ratio = load_iae(&truth, &ours).unwrap() / load_iae(&truth, &theirs.into()).unwrap();
        assert!((1.0..15.0).contains(&ratio), "{lags_s:?} {ratio}");
    }
}

/// A filter for a rule that has none.
fn period_share(of: &Ultimate) -> f64 {
    of.period_s / 80.0
}

// KU and TU scale gains and time: twice KU doubles all gains, twice TU halves Ki and doubles Kd. The same relay test in other units
// gives the same gains, and only the ratio of its amplitudes counts.
#[test]
fn units_scale_the_gains() {
    let one = gains(&tune(&["--ultimate-gain", "3", "--ultimate-period", "7"]));
    let other = gains(&tune(&["--ultimate-gain", "6", "--ultimate-period", "14"]));
    for ((one, other), factor) in one.into_iter().zip(other).zip([2.0, 1.0, 4.0, 2.0]) {
        assert!((other / one / factor - 1.0).abs() < 0.01, "{one} {other}");
    }
    let relay =
        |h: &str, a: &str| tune(&["--relay", h, "--amplitude", a, "--ultimate-period", "28"]);
    same(&relay("90", "3.28"), &relay("45", "1.64"), 1e-6);
}

// 4 90/(pi 3.28) = 34.936: a relay with its amplitude, with its KU, and Marlin's gains of that KU are one test. Klipper's gains of a
// relay of 255 and an amplitude of 8 degrees have KU = 2 (4 127.5/(pi 8)) = 40.584.
#[test]
fn the_same_test_by_other_options() {
    let period = ["--ultimate-period", "27.75"];
    let of = |options: &[&str]| tune(&[&period[..], options].concat());
    let by_amplitude = of(&["--relay", "90", "--amplitude", "3.28"]);
    same(
        &by_amplitude,
        &of(&["--relay", "90", "--ultimate-gain", "34.936"]),
        0.01,
    );
    let both = [
        "--relay",
        "90",
        "--amplitude",
        "3.28",
        "--ultimate-gain",
        "34.9",
    ];
    same(&by_amplitude, &of(&both), 1e-9);
    let by_gains = tune(&["--rule", "marlin", "--against", "20.9616,1.510746,72.7106"]);
    same(&by_amplitude, &by_gains, 0.01);
    assert!((by_gains.number("/family/known/ultimate_gain") - 34.936).abs() < 1e-3);
    let relay = [
        "--relay",
        "127.5",
        "--amplitude",
        "8",
        "--hysteresis",
        "2.5",
    ];
    let klipper = tune(&["--rule", "klipper", "--against", "24.3507,1.755009,84.467"]);
    same(&of(&relay), &klipper, 0.01);
    assert!((klipper.number("/family/known/relay/amplitude") - 8.0).abs() < 1e-3);
    assert_eq!(klipper.0["family"]["known"]["rule"], "klipper");
}

// Gains that a firmware printed are in its unit, and so are those to type into it.
#[test]
fn gains_of_a_firmware_stay_in_its_unit() {
    for (vendor, before) in [("klipper", "pid_kp: "), ("marlin", "M301 P")] {
        let asked = [
            "--rule",
            vendor,
            "--against",
            "24,1.2,120",
            "--vendor",
            vendor,
        ];
        let kp = tune(&asked).number("/controller/kp");
        let text = run(&[&["tune"], &asked[..]].concat()).stdout;
        let typed = text.split_once(before).unwrap().1.split([',', ' ']).next();
        let typed: f64 = typed.unwrap().parse().unwrap();
        assert!((typed / kp - 1.0).abs() < 1e-4, "{vendor}: {typed} {kp}");
    }
}

// The middle and the ends of each parameter; an integrator has no gain at rest. Text and page say what was assumed.
#[test]
fn the_family_is_reported() {
    let arguments = ["tune", "--ultimate-gain", "35", "--ultimate-period", "28"];
    let (ran, page) = reported(&arguments);
    for words in [
        "taken as    the true ultimate point",
        "19 % below to",
        "middle   all that agree",
        "family      over all of them: phase margin",
        "100 % of the processes that agree",
    ] {
        assert!(ran.stdout.contains(words), "{words}: {}", ran.stdout);
    }
    ran.without_nan();
    assert!(page.contains("all that agree"));
    let report = tune(&arguments[1..]);
    assert_eq!(report.0["schema"], "onecycle.tune/2");
    assert!(report.0["family"]["process"]["k"]["high"].is_null());
    // An integrator has a quarter of the period as dead time, and the longest is that of share 0.7.
    let tau = |end: &str| report.number(&format!("/family/process/tau_s/{end}"));
    assert!(tau("low") < 7.0 && 7.0 < tau("high") && tau("high") < 14.0);
    let ms = report.number("/family/margins/ms/high");
    assert!((ms - 1.6).abs() < 0.005, "{ms}");
    // What is known besides narrows the family, and the gains rise.
    let narrow = tune(&[&arguments[1..], &["--dead-time-share", "0.1..0.4"]].concat());
    assert!(narrow.number("/controller/ki") > 2.0 * report.number("/controller/ki"));
    assert!(narrow.number("/family/process/k/high") > 0.0);
}

fn misused(arguments: &[&str], words: &[&str]) {
    run(&[&["tune"], arguments].concat()).misused(words);
}

const POINT: [&str; 4] = ["--ultimate-gain", "35", "--ultimate-period", "28"];
const RELAY: [&str; 6] = [
    "--ultimate-period",
    "28",
    "--relay",
    "90",
    "--amplitude",
    "3.28",
];

fn point<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&POINT[..], more].concat()
}

fn relay<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&RELAY[..], more].concat()
}

#[test]
fn values_out_of_range_are_refused() {
    for value in ["-1", "0", "nan", "inf", "1e300", "x"] {
        misused(
            &["--ultimate-gain", value],
            &["--ultimate-gain", "positive"],
        );
        misused(
            &["--ultimate-period", value],
            &["--ultimate-period", "positive"],
        );
        misused(&["--relay", value], &["--relay", "positive"]);
        misused(&["--amplitude", value], &["--amplitude", "positive"]);
    }
    misused(&relay(&["--hysteresis", "-1"]), &["zero, or a positive"]);
    misused(
        &relay(&["--hysteresis", "3.28"]),
        &["hysteresis of 3.280", "less than the amplitude"],
    );
    misused(&relay(&["--duty", "0"]), &["between 5 % and 95 %"]);
    for share in ["0.5..0.1", "-1..0.5", "0..1", "0.3", "nan..0.5"] {
        misused(
            &point(&["--dead-time-share", share]),
            &["--dead-time-share", "LOW..HIGH"],
        );
    }
}

#[test]
fn contradictions_are_refused() {
    misused(&POINT[..2], &["needs --ultimate-period"]);
    misused(
        &POINT[2..],
        &["needs --ultimate-gain, or --relay with --amplitude"],
    );
    misused(&RELAY[..4], &["--relay needs --amplitude"]);
    misused(&RELAY[2..], &["--relay needs --ultimate-period"]);
    misused(
        &point(&["--hysteresis", "1"]),
        &["--hysteresis", "add --relay"],
    );
    misused(&["--duty", "30%"], &["--duty", "add --relay"]);
    misused(
        &["--dead-time-share", "0..0.5"],
        &["--dead-time-share needs"],
    );
    misused(
        &relay(&["--ultimate-gain", "50"]),
        &["4H/(pi A) = 34.94", "leave one out"],
    );
    misused(
        &relay(&["--ultimate-gain", "70"]),
        &["twice as large, as in Klipper's log"],
    );
    misused(&point(&["--tau", "1"]), &["--tau", "cannot be used with"]);
    misused(
        &point(&["--process", "foptd"]),
        &["--process", "cannot be used with"],
    );
    misused(
        &point(&["--style", "paper"]),
        &["--style paper", "sharp, balanced or calm"],
    );
    misused(
        &point(&["--controller", "pd"]),
        &["integral", "--controller pi"],
    );
}

#[test]
fn gains_of_no_rule_are_refused() {
    misused(&["--rule", "marlin"], &["--against KP,KI,KD"]);
    misused(
        &["--rule", "bosch", "--against", "1,1,1"],
        &["--rule", "bosch"],
    );
    let of = |rule, gains, words: &[&str]| misused(&["--rule", rule, "--against", gains], words);
    of(
        "marlin",
        "20.95,1.51,92",
        &["Kp and Ki it gives Kd 72.67, but Kd is 92.00"],
    );
    of("marlin", "20.95,0,72", &["positive gains"]);
    of("marlin-bed", "20,1,0", &["no pi"]);
    let hysteresis = [
        "--rule",
        "marlin",
        "--against",
        "20.95,1.51,72.77",
        "--hysteresis",
        "1",
    ];
    misused(&hysteresis, &["has no hysteresis"]);
    // Klipper's thresholds alone swing by 2.5 degrees; a test of it cannot swing by less.
    of(
        "klipper",
        "100,7.2,347",
        &["hysteresis of 2.500", "amplitude of 1.948"],
    );
}
