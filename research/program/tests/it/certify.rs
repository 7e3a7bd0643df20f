//! `certify`: reports, page, verdicts, refusals.

use crate::common::{NOT_WRITTEN, Scratch, UNREADABLE, figures, reported, run};

/// The exit code of a space that is not certified.
const NOT_CERTIFIED: i32 = 4;

// Fewer shapes and biases than by default, with the same verdicts: stable without bias and with the trim. At a bias of 0.5
// the bare relay has no cycle, but simulations settle.
#[test]
fn multirotors_are_certified() {
    let outcome = run(&["certify", "--shapes", "4", "--bias", "0,0.3,50%", "--json"]);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let found = outcome.report();
    assert_eq!(found.0["schema"], "onecycle.certificate/1");
    assert_eq!(found.0["holds"], true);
    assert!((found.number("/least_stable/spectral_radius") - 0.2119).abs() < 1e-4);
    assert_eq!(found.0["corners"].as_array().map(Vec::len), Some(8));
    assert!((found.number("/corners/7/period_s") - 2.306).abs() < 1e-3);
    assert!((found.number("/corners/7/describing_function/period_s") - 2.2055).abs() < 1e-4);
    for (row, stable, no_cycle) in [(0, 16.0, 0.0), (1, 16.0, 0.0), (2, 0.0, 16.0)] {
        let number = |name: &str| found.number(&format!("/biases/{row}/{name}"));
        assert_eq!(number("certified/bare/stable"), stable);
        assert_eq!(number("certified/bare/no_cycle"), no_cycle);
        assert_eq!(number("certified/trimmed"), 16.0);
        assert_eq!(number("simulated_settled/untrimmed"), 16.0);
        assert_eq!(number("simulated_settled/trimmed"), 16.0);
    }
}

#[test]
fn the_report_for_people_fits_a_terminal() {
    let (outcome, page) = reported(&["certify", "--shapes", "3", "--bias", "0,-0.4"]);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let text = &outcome.without_nan().stdout;
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
    for words in [
        "exactly one stable limit cycle: 9 of 9",
        "21.2 % of a deviation is left",
        "Certified: stable without bias, and with the trim",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // Loci and exact cycles of the eight corners; three curves over two biases and the limit.
    let figures = figures(&page);
    let [loci, stability] = &figures[..] else {
        panic!("{} figures", figures.len());
    };
    let series = loci["data"].as_array().unwrap();
    assert_eq!(series.len(), 8 + 3);
    assert_eq!(series[10]["x"].as_array().map(Vec::len), Some(8));
    assert_eq!(stability["data"].as_array().map(Vec::len), Some(4));
    assert_eq!(page.matches("<tr>").count(), 2 + 8 + 2);
    assert!(page.contains("class=\"verdict good\">Certified: stable without bias"));
}

// A relay that lags by 50 degrees needs damping; these processes have none.
#[test]
fn a_relay_without_oscillation_is_not_certified() {
    let folder = Scratch::new();
    let space = folder.write(
        "space.toml",
        b"t_prop_s = [0.01, 0.1]\nt_body_s = [1e8, 1e9]\ntau_s = [0.01, 0.05]\nbeta = 0.76\n",
    );
    let outcome = run(&["certify", &space, "--shapes", "2", "--bias", "0"]);
    assert_eq!(outcome.code, Some(NOT_CERTIFIED), "{outcome:?}");
    let text = &outcome.without_nan().stdout;
    assert!(text.contains("Not certified"), "{text}");
    assert!(text.contains("no limit cycle"), "{text}");
}

// As in the tests of the library: one exact cycle of 2.306 s, three sampled ones from 2.308 s; a pattern of one cycle at a
// bias of 0.25; no cycle at 0.5, where the relay stops switching.
#[test]
fn single_processes() {
    let arguments = ["certify", "--process", "0.3,2,0.1", "--bias", "0,25%,0.5"];
    let outcome = run(&[&arguments[..], &["--sample-rate", "1000"]].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let text = &outcome.without_nan().stdout;
    for words in [
        "describing function  period 2.206 s, amplitude 0.05873",
        "bare relay           period 2.306 s (high 1.153 s), amplitude 0.06427, 4.2 % left",
        "sampled              period 2.308 s (2308 samples)",
        "sampled              period 2.312 s (2312 samples)",
        "a pattern of 1 cycle(s), mean period 2.216 s",
        "turned back, 1/2     period 3.440 s",
        "bare relay           no limit cycle of two switches",
        "the bare relay stops switching",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn arguments_that_are_none() {
    for (arguments, words) in [
        (
            &["--process", "0.3,2"][..],
            &["--process", "three times"][..],
        ),
        (&["--process", "0.3,two,1"], &["--process", "three times"]),
        (&["--process", "0.3,-2,0.1"], &["--process", "T_body"]),
        (&["--bias", "1"], &["--bias", "between -100 % and 100 %"]),
        (&["--bias", "0,x"], &["--bias", "'x'"]),
        (&["--shapes", "1"], &["--shapes"]),
        (&["--sample-rate", "1000"], &["required arguments"]),
        (&["--process", "0.3,2,0.1", "--json"], &["--json"]),
        (
            &["--process", "0.3,2,0.1", "--sample-rate", "0"],
            &["--sample-rate"],
        ),
    ] {
        run(&[&["certify"], arguments].concat()).misused(words);
    }
    let folder = Scratch::new();
    let missing = folder.name("nosuch.toml");
    run(&["certify", &missing]).refused(UNREADABLE, &["nosuch.toml", "No such file"]);
    let page = folder.name("nosuch/out.html");
    let arguments = ["certify", "--shapes", "2", "--bias", "0", "--report"];
    run(&[&arguments[..], &[&page]].concat()).refused(NOT_WRITTEN, &["out.html"]);
    run(&["certify", "--picture", "out.svg"]).misused(&["--picture"]);
}
