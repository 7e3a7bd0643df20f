//! Time of `onecycle identify` from start to exit, on a recording of 8 s at 1 kHz:
//! `cargo bench -p onecycle-cli --bench identify`. Target: 50 ms.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

const RUNS: usize = 41;

fn main() {
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/simulated_hover.csv");
    let run = || {
        let begin = Instant::now();
        let status = Command::new(env!("CARGO_BIN_EXE_onecycle"))
            .arg("identify")
            .arg(&recording)
            .stdout(Stdio::null())
            .status();
        assert!(
            status.is_ok_and(|status| status.success()),
            "identify failed"
        );
        1e3 * begin.elapsed().as_secs_f64()
    };
    // The first run loads the program from disk.
    run();
    let mut milliseconds: Vec<f64> = (0..RUNS).map(|_| run()).collect();
    milliseconds.sort_unstable_by(f64::total_cmp);
    #[expect(clippy::print_stdout, reason = "a bench reports")]
    {
        println!(
            "identify, whole process, 8,000 rows: median {:.1} ms, least {:.1} ms, most {:.1} ms",
            milliseconds[RUNS / 2],
            milliseconds[0],
            milliseconds[RUNS - 1]
        );
    }
}
