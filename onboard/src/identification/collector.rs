//! From the samples of a relay test to windows of its last cycles.

use super::desk::{Desk, Note, Order};
use super::past::Past;
use super::{MOST_CYCLES, TestSample};
use crate::cycle::{Cycle, CycleDetector, SteadyRun};
use crate::window::Edge;

/// Counters since the windows were opened: rises of the relay, complete cycles; and the switches reversed
/// before.
#[derive(Clone, Copy, Debug, Default)]
struct Collected {
    rises: u8,
    complete: u8,
    undone: u32,
}

/// Collects the last cycles of one axis on a [`Desk`].
pub struct Collector {
    cycles: u8,
    detector: CycleDetector,
    run: SteadyRun,
    past: Past,
    was_high: bool,
    sample_s: f64,
    rate_delay_s: f64,
    collected: Collected,
    is_collecting: bool,
    /// The last cycle of the first order.
    last: Option<Cycle>,
    /// Whether a cycle at another amplitude has to confirm the result.
    is_confirming: bool,
}

impl Collector {
    /// A collector of `cycles` cycles with samples every `sample_s`. The controller is designed for a rate that arrives
    /// `rate_delay_s` after the value.
    #[must_use]
    pub fn new(sample_s: f64, cycles: u8, rate_delay_s: f64) -> Self {
        Self {
            cycles: cycles.clamp(1, MOST_CYCLES),
            detector: CycleDetector::new(),
            run: SteadyRun::default(),
            past: Past::default(),
            was_high: true,
            sample_s,
            rate_delay_s,
            collected: Collected::default(),
            is_collecting: false,
            last: None,
            is_confirming: false,
        }
    }

    /// Resets the collector in place.
    pub fn restart(&mut self) {
        *self = Self::new(self.sample_s, self.cycles, self.rate_delay_s);
    }

    /// After a result: goes on with one cycle at another amplitude of the relay, which changes with the next sample. The next
    /// outcome is the same result if the gain is the same there.
    pub fn confirm(&mut self) {
        self.is_confirming = true;
        self.run = SteadyRun::default();
    }

    /// Number of cycles to collect.
    fn wanted(&self) -> u8 {
        if self.is_confirming { 1 } else { self.cycles }
    }

    /// The latest changes of the input.
    #[must_use]
    pub fn past_edges(&self) -> &[Edge] {
        self.past.edges()
    }

    /// Whether cycles are being collected.
    #[must_use]
    pub fn is_collecting(&self) -> bool {
        self.is_collecting
    }

    /// Takes a sample of the running test. Without the desk, or with an order on it, samples only update the cycle detection.
    /// Complete cycles leave an order.
    pub fn observe(&mut self, desk: Option<&mut Desk>, sample: &TestSample) {
        let cycle = self
            .detector
            .push(sample.time_s, sample.is_high, sample.output);
        if let Some(cycle) = &cycle {
            self.run.push(cycle);
        }
        let rises = sample.is_high && !self.was_high;
        self.was_high = sample.is_high;
        match desk {
            Some(desk) if self.is_collecting => self.collect(desk, sample, rises, cycle),
            Some(desk) if matches!(desk.note, Note::Empty) && rises && self.run.is_steady() => {
                self.open(desk, sample);
            }
            _ => {}
        }
        self.past.push(sample.time_s, sample.input);
    }

    /// Opens new windows at this rise, which is the first of the cycles.
    fn open(&mut self, desk: &mut Desk, sample: &TestSample) {
        desk.coarse.begin(sample.time_s, self.sample_s);
        for edge in self.past.edges() {
            // The window holds more edges than the past.
            let _ = desk.coarse.push_input(edge.time_s, edge.input);
        }
        desk.fine.begin(sample.time_s, self.sample_s);
        self.collected = Collected {
            undone: sample.undone,
            ..Collected::default()
        };
        self.is_collecting = true;
        self.take(desk, sample);
    }

    fn collect(
        &mut self,
        desk: &mut Desk,
        sample: &TestSample,
        rises_now: bool,
        cycle: Option<Cycle>,
    ) {
        let wanted = self.wanted();
        let so_far = &mut self.collected;
        if sample.undone != so_far.undone || !self.run.is_steady() {
            self.is_collecting = false;
            return;
        }
        so_far.rises += u8::from(rises_now);
        // Samples after the last cycle do not belong to it, although its end is not yet certain.
        let is_inside = so_far.rises < wanted;
        if let Some(cycle) = cycle
            && cycle.start_s >= desk.coarse.start_s()
        {
            so_far.complete += 1;
            if so_far.complete == wanted {
                self.order(desk, cycle);
                return;
            }
        }
        if rises_now && is_inside {
            desk.fine.begin(sample.time_s, self.sample_s);
        }
        if is_inside {
            self.take(desk, sample);
        }
    }

    fn order(&mut self, desk: &mut Desk, cycle: Cycle) {
        self.is_collecting = false;
        let of_result = self.last.filter(|_| self.is_confirming);
        self.last = of_result.or(Some(cycle));
        desk.orders = desk.orders.wrapping_add(1);
        desk.note = Note::Order(Order {
            number: desk.orders,
            cycle: of_result.unwrap_or(cycle),
            rate_delay_s: self.rate_delay_s,
            is_confirming: self.is_confirming,
        });
    }

    fn take(&mut self, desk: &mut Desk, sample: &TestSample) {
        if (desk.coarse.push_input(sample.time_s, sample.input)).is_err() {
            self.is_collecting = false;
        }
        desk.coarse.push_output(sample.time_s, sample.output);
        desk.fine.push_output(sample.time_s, sample.output);
    }
}
