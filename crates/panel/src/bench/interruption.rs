//! What interrupts an errand: whatever a person or a lost page does counts once, and a stop that is repeated later takes the torque at once.

use std::time::{Duration, Instant};

use super::super::pages::PageNumber;
use super::Bench;
use takt::link::ownership::Ownership;

/// How often it is looked whether the page is there. A poll of a bus is much shorter.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// A stop that comes so long after the first one cuts the stop in control short.
const AGAIN_AFTER: Duration = Duration::from_millis(500);

/// Interrupts an errand.
pub struct Interruption<'a> {
    bench: &'a Bench,
    /// The page it is for; `None` where it is carried out for nobody, as the last disabling is.
    page: Option<PageNumber>,
    /// True if another errand replaces it.
    gives_way: bool,
    stops: u64,
    interrupted: Option<Instant>,
    looked: Option<Instant>,
}

impl<'a> Interruption<'a> {
    /// Of what is carried out for a page, since so many stops.
    pub const fn of(bench: &'a Bench, page: PageNumber, gives_way: bool, stops: u64) -> Self {
        Self { bench, page: Some(page), gives_way, stops, interrupted: None, looked: None }
    }

    /// Of what is carried out whoever is there: it is interrupted by nobody.
    pub const fn never(bench: &'a Bench) -> Self {
        Self { bench, page: None, gives_way: false, stops: 0, interrupted: None, looked: None }
    }

    /// Returns `true` if the errand is to be interrupted now: each `true` is an interruption of its own.
    pub fn poll(&mut self, ownership: &mut Ownership) -> bool {
        let now = Instant::now();
        if self.looked.is_some_and(|looked| now.duration_since(looked) < LOOK_EVERY) {
            return false;
        }
        self.looked = Some(now);
        if ownership.poll_release_request().is_some() {
            self.bench.is_taken_over.store(true, std::sync::atomic::Ordering::Release);
        }
        let Some(page) = self.page else { return false };
        let stops = self.bench.stops();
        let is_stopped = stops != self.stops;
        match self.interrupted {
            None => {
                let is_due =
                    is_stopped || self.bench.is_taken_over() || self.ends(now) || !self.bench.may_move(page);
                if is_due {
                    (self.interrupted, self.stops) = (Some(now), stops);
                }
                is_due
            }
            Some(first) if is_stopped && now.duration_since(first) >= AGAIN_AFTER => {
                self.stops = stops;
                true
            }
            Some(_) => false,
        }
    }

    fn ends(&self, now: Instant) -> bool {
        let next = self.bench.next();
        next.ends
            || (self.gives_way && next.errand.is_some())
            || next.held_until.is_some_and(|until| now >= until)
    }
}
