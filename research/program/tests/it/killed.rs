//! Runs that are stopped before their end.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::common::called;

/// Kills a run as soon as `is_time`.
pub(crate) fn killed_when(arguments: &[&str], is_time: impl Fn() -> bool) {
    let mut child = called(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let begin = Instant::now();
    while !is_time() {
        let ended = child.try_wait().expect("its status is known");
        assert!(ended.is_none(), "it was done before it was stopped");
        assert!(begin.elapsed() < Duration::from_secs(600), "it never came");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().expect("it can be stopped");
    child.wait().expect("it ends");
}
