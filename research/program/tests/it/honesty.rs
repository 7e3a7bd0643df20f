//! `campaign` on wrong data: one row for each kind, sums, targets, and the cases that broke a promise.

use crate::common::{Scratch, UNREADABLE, run};

const CAMPAIGN: &str = r#"
measure = "honesty"
cases = 1
seed = 1
noise = 0.005
bias = 0.2
periods = 20
samples_per_period = 100
process = { structure = "soiptd", k_over_t_body = 1, t_prop_s = 0.05, t_body_s = 1, tau_s = 0.03 }

[[kinds]]
name = "right"
control = true

[[kinds]]
name = "swapped"
fault = "swapped_columns"

[[kinds]]
name = "clipped"
defect = "clipping"

[[kinds]]
name = "wrong sign"
fault = "wrong_sign"
named_by = ["negative_gain"]
"#;

// The right case is accepted and right, with or without remarks; swapped columns and a clipped sensor are refused; a wrong
// sign is named, and its controller is unstable on the real plant.
#[test]
fn a_row_for_each_kind() {
    let folder = Scratch::new();
    let path = folder.write("honesty.toml", CAMPAIGN.as_bytes());
    let table = run(&["campaign", &path]);
    assert_eq!(table.code, Some(0), "{table:?}");
    let row = |name: &str| -> Vec<usize> {
        let head = format!("| {name} |");
        let line = (table.stdout.lines()).find_map(|line| line.strip_prefix(&head));
        let words = line.unwrap().split([' ', ',', '|']);
        let numbers = words.filter(|word| !word.is_empty());
        numbers.map(|word| word.parse().unwrap()).collect()
    };
    let right = row("right");
    assert_eq!(right[..3], [1, 0, 0]);
    assert_eq!(right[3] + right[5], 1, "{right:?}");
    assert_eq!(row("swapped"), [1, 1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(row("clipped"), [1, 1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(row("wrong sign"), [1, 0, 1, 0, 0, 0, 0, 1, 0]);
    assert_eq!(row("**wrong data**")[..3], [3, 2, 1]);
    for target in [
        "silent and wrong         0.0 % (target: 1 % at most)",
        "unstable and not named   0 (target: none)",
        "right data refused       0.0 % (target: 3 % at most)",
    ] {
        assert!(table.stdout.contains(target), "{}", table.stdout);
    }
    // Beside it, how often the intervals of right data hold: one case of one kind.
    let right = (table.stdout.lines()).skip_while(|line| !line.contains("90 % intervals hold (%)"));
    let right: Vec<&str> = right.take(4).collect();
    assert!(
        right[2].starts_with("right ") && right[3].is_empty(),
        "{right:?}"
    );
    assert_eq!(run(&["campaign", &path]).stdout, table.stdout);
}

#[test]
fn every_case_stands_in_the_json() {
    let folder = Scratch::new();
    let path = folder.write("honesty.toml", CAMPAIGN.as_bytes());
    let printed = run(&["campaign", &path, "--json"]);
    let json: serde_json::Value = serde_json::from_str(&printed.stdout).unwrap();
    let kinds: Vec<_> = (json["cases"].as_array().unwrap().iter())
        .map(|case| case["kind"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["right", "swapped", "clipped", "wrong sign"]);
    let of = |case: usize| &json["cases"][case];
    assert_eq!(of(1)["outcome"]["refused"], "no_relay");
    assert_eq!(of(3)["is_named"], true);
    let broken = &of(3)["outcome"]["accepted"]["broken"];
    assert!(broken.to_string().contains("unstable"), "{broken}");
    assert_eq!(json["settings"]["file"]["seed"], 1);
}

#[test]
fn wrong_campaigns_are_refused() {
    let folder = Scratch::new();
    for (good, bad, words) in [
        ("bias = 0.2", "bias = -1", &["bias must be 0 to 100"][..]),
        (
            "fault = \"swapped_columns\"",
            "fault = \"input_late\"",
            &["\"swapped\"", "strength must be given"],
        ),
        (
            "fault = \"swapped_columns\"",
            "fault = \"none_such\"",
            &["none_such", "input_late"],
        ),
        (
            "defect = \"clipping\"",
            "defect = \"clipping\"\nwind = { w1_rad_per_s = 1 }",
            &["\"clipped\"", "no wind"],
        ),
        (
            "defect = \"clipping\"",
            "test = { signal = \"chirp\" }",
            &["\"clipped\"", "band_hz must be given"],
        ),
    ] {
        let text = CAMPAIGN.replacen(good, bad, 1);
        assert_ne!(text, CAMPAIGN, "{good}");
        let path = folder.write("honesty.toml", text.as_bytes());
        run(&["campaign", &path]).refused(UNREADABLE, words);
    }
    let path = folder.write("honesty.toml", CAMPAIGN.as_bytes());
    run(&["campaign", &path, "--sigma", "0.1"]).refused(2, &["--sigma has no effect"]);
}
