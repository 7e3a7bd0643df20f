//! A value that two threads use by turns: the one that has it gives it to the other. Nobody waits, and nothing is locked.
//!
//! The tuner's desk goes this way between the control loop and the analysis. The test runs every interleaving of two threads
//! that the memory model allows (`RUSTFLAGS="--cfg loom" cargo test --manifest-path onboard/handover/Cargo.toml`).
#![no_std]

#[cfg(not(loom))]
use core::{
    cell::UnsafeCell,
    sync::atomic::{AtomicBool, Ordering},
};

#[cfg(loom)]
use loom::{
    cell::UnsafeCell,
    sync::atomic::{AtomicBool, Ordering},
};

/// One of the two threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The thread that has the value first.
    First,
    /// The other one.
    Second,
}

/// A value that two threads use by turns.
#[derive(Debug)]
pub struct Handover<T> {
    is_second: AtomicBool,
    value: UnsafeCell<T>,
}

// SAFETY: the value is only touched in `turn`, by the side whose turn it is; the flag passes it on with release and acquire.
unsafe impl<T: Send> Sync for Handover<T> {}

impl<T> Handover<T> {
    /// A value that the first side has.
    pub fn new(value: T) -> Self {
        Self {
            is_second: AtomicBool::new(false),
            value: UnsafeCell::new(value),
        }
    }

    /// Works on the value if it is this side's turn; `work` returns its result and whether the value goes to the other side.
    /// `None` if it is the other side's turn.
    ///
    /// # Safety
    /// Each side is used by one thread at a time, and not again within `work`.
    pub unsafe fn turn<R>(&self, side: Side, work: impl FnOnce(&mut T) -> (R, bool)) -> Option<R> {
        let is_second = side == Side::Second;
        if self.is_second.load(Ordering::Acquire) != is_second {
            return None;
        }
        // SAFETY: it is this side's turn, this side is one thread by the caller's promise, and only this side can end its turn.
        let (result, goes) = unsafe { with(&self.value, work) };
        if goes {
            self.is_second.store(!is_second, Ordering::Release);
        }
        Some(result)
    }
}

/// # Safety
/// Nobody else uses the value.
#[cfg(not(loom))]
unsafe fn with<T, R>(value: &UnsafeCell<T>, work: impl FnOnce(&mut T) -> R) -> R {
    // SAFETY: the caller's promise.
    work(unsafe { &mut *value.get() })
}

/// # Safety
/// Nobody else uses the value.
#[cfg(loom)]
unsafe fn with<T, R>(value: &UnsafeCell<T>, work: impl FnOnce(&mut T) -> R) -> R {
    // SAFETY: the caller's promise, which loom checks.
    value.with_mut(|value| work(unsafe { &mut *value }))
}

#[cfg(all(test, loom))]
mod tests {
    extern crate std;

    use loom::sync::Arc;
    use loom::thread;
    use std::vec::Vec;

    use super::{Handover, Side};

    /// Numbers that one side adds while it has the list, `most` in all; it gives the list away after each.
    fn adds(list: &Handover<Vec<u32>>, side: Side, most: u32) {
        let mut added = 0;
        while added < most {
            // SAFETY: each side is one thread.
            let turn = unsafe {
                list.turn(side, |list| {
                    list.push(list.len() as u32);
                    (list.len(), true)
                })
            };
            match turn {
                Some(length) => {
                    // The other side has added one in between.
                    assert_eq!(length % 2, usize::from(side == Side::First));
                    added += 1;
                }
                None => thread::yield_now(),
            }
        }
    }

    // Loom fails the test if any interleaving lets both sides touch the list, or lets one see an old list.
    #[test]
    fn every_interleaving_takes_turns() {
        loom::model(|| {
            let list = Arc::new(Handover::new(Vec::new()));
            let of_second = Arc::clone(&list);
            let second = thread::spawn(move || adds(&of_second, Side::Second, 2));
            adds(&list, Side::First, 2);
            second.join().unwrap();
            // SAFETY: the other thread has ended.
            let all = unsafe { list.turn(Side::First, |list| (list.clone(), false)) };
            assert_eq!(all.unwrap(), [0, 1, 2, 3]);
        });
    }

    // A side that keeps the value has it again next time; the other one does not get in.
    #[test]
    fn a_turn_lasts_until_it_is_given_away() {
        loom::model(|| {
            let value = Arc::new(Handover::new(0));
            let of_second = Arc::clone(&value);
            let second = thread::spawn(move || {
                // SAFETY: each side is one thread.
                unsafe { of_second.turn(Side::Second, |value| (*value, false)) }
            });
            for _ in 0..2 {
                // SAFETY: each side is one thread.
                let _ = unsafe { value.turn(Side::First, |value| (*value += 1, *value == 2)) };
            }
            assert!(matches!(second.join().unwrap(), None | Some(2)));
        });
    }
}
