//! The scripted vehicle at the end of a wire with faults, in simulated time.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

use onecycle_live::{Key, LiveError, Vehicle, Wire};

use crate::vehicle::{ROUND, Scripted};

/// Time of a message from one end to the other.
const LATENCY: Duration = Duration::from_millis(10);

/// Where a message goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Way {
    ToVehicle,
    ToUs,
}

/// How often a message arrives: 0 it is lost, 1, 2 it is doubled. Told the way and the number of the message on it, from 0.
pub(crate) type Fate = Box<dyn FnMut(Way, usize) -> usize>;

/// What happens when this many messages were sent to the vehicle.
pub(crate) type Event = Box<dyn FnMut(&mut Scripted, usize)>;

pub(crate) struct World {
    pub(crate) vehicle: Scripted,
    pub(crate) now: Duration,
    /// Messages under way, by time of arrival and number.
    under_way: BTreeMap<(Duration, usize), (Way, Vec<u8>)>,
    next_round: Duration,
    pub(crate) counts: [usize; 2],
    total: usize,
    pub(crate) fate: Fate,
    /// Largest delay of a message beside the latency (ms): messages overtake each other.
    pub(crate) jitter_ms: u32,
    pub(crate) event: Event,
    /// The link is down from this number of messages to the vehicle on, for this long.
    pub(crate) cut: Option<(usize, Duration)>,
    down_until: Option<Duration>,
}

pub(crate) type Shared = Rc<RefCell<World>>;

impl World {
    pub(crate) fn of(vehicle: Scripted) -> Shared {
        Rc::new(RefCell::new(Self {
            vehicle,
            now: Duration::ZERO,
            under_way: BTreeMap::new(),
            next_round: Duration::ZERO,
            counts: [0; 2],
            total: 0,
            fate: Box::new(|_, _| 1),
            jitter_ms: 0,
            event: Box::new(|_, _| {}),
            cut: None,
            down_until: None,
        }))
    }

    fn post(&mut self, way: Way, bytes: &[u8]) {
        let number = self.counts[way as usize];
        self.counts[way as usize] += 1;
        if way == Way::ToVehicle {
            (self.event)(&mut self.vehicle, number);
            if let Some((_, length)) = self.cut.filter(|(from, _)| *from == number) {
                self.down_until = Some(self.now.saturating_add(length));
                // A message counts once, a reconnected link does not fail again.
                self.cut = None;
            }
        }
        let copies = (self.fate)(way, number);
        if self.down_until.is_some_and(|until| self.now < until) {
            return;
        }
        for copy in 0..copies {
            self.total += 1;
            let late_ms = (self.total as u32).wrapping_mul(7919) % (self.jitter_ms + 1);
            let late = Duration::from_millis(late_ms.into());
            let arrival = self.now + LATENCY * (1 + 3 * copy as u32) + late;
            self.under_way
                .insert((arrival, self.total), (way, bytes.to_vec()));
        }
    }

    /// Lets time pass up to the next message to us, or until `until`.
    fn advance(&mut self, until: Duration) -> Option<Vec<u8>> {
        loop {
            let arrival = self.under_way.keys().next().map(|(time, _)| *time);
            let next = arrival.map_or(self.next_round, |time| time.min(self.next_round));
            if next > until {
                self.now = until;
                return None;
            }
            self.now = self.now.max(next);
            if arrival == Some(next) {
                let (_, (way, bytes)) = self.under_way.pop_first().unwrap();
                match way {
                    Way::ToUs => return Some(bytes),
                    Way::ToVehicle => {
                        self.vehicle.advance(self.now);
                        for answer in self.vehicle.handle(&bytes) {
                            self.post(Way::ToUs, &answer);
                        }
                    }
                }
            } else {
                self.next_round += ROUND;
                self.vehicle.advance(self.now);
                for message in self.vehicle.round() {
                    self.post(Way::ToUs, &message);
                }
            }
        }
    }
}

struct Simulated(Shared);

impl Wire for Simulated {
    fn send(&mut self, bytes: &[u8]) {
        self.0.borrow_mut().post(Way::ToVehicle, bytes);
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let mut world = self.0.borrow_mut();
        let until = world.now + wait;
        match world.advance(until) {
            Some(bytes) => {
                buffer[..bytes.len()].copy_from_slice(&bytes);
                bytes.len()
            }
            None => 0,
        }
    }

    fn now(&self) -> Duration {
        self.0.borrow().now
    }
}

pub(crate) const PATIENCE: Duration = Duration::from_secs(10);

pub(crate) fn connect(world: &Shared, key: Option<&Key>) -> Result<Vehicle, LiveError> {
    Vehicle::connect(Box::new(Simulated(Rc::clone(world))), key, None, PATIENCE)
}
