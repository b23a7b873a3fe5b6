//! The numbers of requests: whoever asks takes them from the same place, so that no two have the same.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use takt_rt::RequestId;

/// Gives out numbers of requests. Clone it for every thread that asks.
#[derive(Clone, Debug, Default)]
pub struct RequestNumbers {
    given: Arc<AtomicU64>,
}

impl RequestNumbers {
    /// The next number, from 1 on.
    pub fn next(&self) -> RequestId {
        // Nothing but the number itself is handed from one thread to the other.
        RequestId(self.given.fetch_add(1, Ordering::Relaxed) + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::thread;

    #[test]
    fn no_two_of_many_threads_get_the_same_number() {
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
