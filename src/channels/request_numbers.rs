//! The ids of requests. All clients take them from one counter, so that no two requests have the same id.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use takt_rt::RequestId;

/// Gives the ids of requests. Clone it for every thread that sends requests.
#[derive(Clone, Debug, Default)]
pub struct RequestNumbers {
    given: Arc<AtomicU64>,
}

impl RequestNumbers {
    /// The next id. The first one is 1.
    pub fn next(&self) -> RequestId {
        // Relaxed is enough: no other data depends on the counter.
        RequestId(self.given.fetch_add(1, Ordering::Relaxed) + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::thread;

    #[test]
    fn no_two_threads_get_the_same_id() {
        let numbers = RequestNumbers::default();
        let taking = |_| {
            let numbers = numbers.clone();
            thread::spawn(move || (0..1000).map(|_| numbers.next()).collect::<Vec<_>>())
        };
        let threads: Vec<_> = (0..4).map(taking).collect();
        let given: BTreeSet<RequestId> = threads.into_iter().flat_map(|each| each.join().unwrap()).collect();
        assert_eq!((given.len(), given.last()), (4000, Some(&RequestId(4000))));
    }
}
