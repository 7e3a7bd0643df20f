//! The time that a method takes: the processor's, for its own thread, so that neither other threads nor other
//! programs count. Where the system does not tell it, that of the wall.

/// Seconds from some moment on, to be compared on one thread.
#[cfg(any(target_os = "linux", target_os = "macos"))]
pub(super) fn thread_seconds() -> f64 {
    let spent = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    spent.tv_sec as f64 + 1e-9 * spent.tv_nsec as f64
}

/// Seconds from some moment on, to be compared on one thread.
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
pub(super) fn thread_seconds() -> f64 {
    use std::sync::LazyLock;
    use std::time::Instant;

    static BEGIN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGIN.elapsed().as_secs_f64()
}

#[cfg(all(test, any(target_os = "linux", target_os = "macos")))]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    // A thread that sleeps spends nothing, one that works spends no more than has gone by.
    #[test]
    fn sleep_is_free_and_work_is_not() {
        let (wall, begin_s) = (Instant::now(), thread_seconds());
        std::thread::sleep(Duration::from_millis(50));
        let slept_s = thread_seconds() - begin_s;
        assert!(slept_s < 0.025, "{slept_s}");
        let mut sum = 0.0;
        while thread_seconds() - begin_s < slept_s + 0.01 {
            sum += std::hint::black_box(1.0);
        }
        assert!(sum > 0.0 && wall.elapsed().as_secs_f64() >= 0.06);
    }
}
