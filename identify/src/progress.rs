//! How much of the work of an identification is done.
//!
//! Work is divided into parts, and a part into smaller ones; who listens is told the share of the whole when a part ends. The
//! number of candidates is not known before they are tried, so a part has a fixed share of what surrounds it. Nothing is told by
//! other threads.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

thread_local! {
    static HEARD: RefCell<Option<Heard>> = const { RefCell::new(None) };
}

/// Who listens, and the part of the whole that is in progress.
struct Heard {
    told: Rc<dyn Fn(f64)>,
    part: Range<f64>,
    last: f64,
}

/// Does `work`; `told` hears the share of it that is done, from 0 to 1, never less than before, on this thread only.
pub fn with_progress<T>(told: Rc<dyn Fn(f64)>, work: impl FnOnce() -> T) -> T {
    let heard = Heard {
        told,
        part: 0.0..1.0,
        last: 0.0,
    };
    let before = HEARD.replace(Some(heard));
    let done = work();
    tell(1.0);
    HEARD.set(before);
    done
}

/// Does `work`, which is this part of what surrounds it, where 1 is all of that.
pub fn part<T>(of: Range<f64>, work: impl FnOnce() -> T) -> T {
    let surrounding = HEARD.with_borrow_mut(|heard| {
        let heard = heard.as_mut()?;
        let (start, length) = (heard.part.start, heard.part.end - heard.part.start);
        let inner = start + of.start * length..start + of.end * length;
        Some(std::mem::replace(&mut heard.part, inner))
    });
    let done = work();
    if let Some(surrounding) = surrounding {
        let end = HEARD.with_borrow_mut(|heard| {
            let heard = heard.as_mut()?;
            Some(std::mem::replace(&mut heard.part, surrounding).end)
        });
        if let Some(end) = end {
            tell(end);
        }
    }
    done
}

/// Does `work`, which is one of `count` equal parts.
pub fn one_of<T>(index: usize, count: usize, work: impl FnOnce() -> T) -> T {
    let share = |index: usize| index as f64 / count.max(1) as f64;
    part(share(index)..share(index + 1), work)
}

/// The listener is called while nothing is borrowed: it may work with progress of its own.
fn tell(share: f64) {
    let told = HEARD.with_borrow_mut(|heard| {
        let heard = heard.as_mut().filter(|heard| share > heard.last)?;
        heard.last = share;
        Some(Rc::clone(&heard.told))
    });
    if let Some(told) = told {
        told(share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(work: impl FnOnce()) -> Vec<f64> {
        let all = Rc::new(RefCell::new(vec![]));
        let into = Rc::clone(&all);
        with_progress(Rc::new(move |share| into.borrow_mut().push(share)), work);
        all.take()
    }

    // Half, then two quarters of which the second has halves; the end is told once.
    #[test]
    fn parts_of_parts_are_shares_of_the_whole() {
        let shares = heard(|| {
            part(0.0..0.5, || ());
            part(0.5..1.0, || {
                one_of(0, 2, || ());
                one_of(1, 2, || {
                    part(0.0..0.5, || ());
                    // Told already.
                    part(0.0..0.25, || ());
                });
            });
        });
        assert_eq!(shares, [0.5, 0.75, 0.875, 1.0]);
    }

    #[test]
    fn work_that_nobody_follows_is_done() {
        assert_eq!(part(0.0..0.5, || 3), 3);
        assert_eq!(heard(|| ()), [1.0]);
    }
}
