//! Processor time of a thread, which other threads and programs do not change; wall time on systems without it.

/// Seconds since an arbitrary moment, comparable on the same thread.
#[cfg(any(target_os = "linux", target_os = "macos"))]
pub(super) fn thread_seconds() -> f64 {
    let spent = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    spent.tv_sec as f64 + 1e-9 * spent.tv_nsec as f64
}

/// Seconds since an arbitrary moment, comparable on the same thread.
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

    // A sleeping thread uses no processor time; a working one uses at most the wall time.
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
