//! Worst-case response times of the messages of a CAN bus, after R. Davis, A. Burns, R. Bril and J. Lukkien,
//! "Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised", Real-Time Systems 35
//! (2007): every instance within the busy period is looked at, not the first alone.

/// A message as the analysis sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message {
    /// Shortest time between two of its kind.
    pub period_ns: u64,
    /// How much later than its period it may be queued.
    pub jitter_ns: u64,
    /// Longest time on the wire.
    pub transmission_ns: u64,
}

/// Busy periods longer than this have no use; the bus is then taken to be overloaded.
const LONGEST_BUSY_PERIOD_NS: u64 = 60_000_000_000;

/// The longest time from the event that queues the message at `index` until all of it is received.
///
/// `messages` are in the order of their priority, highest first, and all different in priority. `None` where no bound
/// exists because the messages of this and higher priority overload the bus, or where there is no such message.
pub fn response_time(messages: &[Message], index: usize, bit_ns: u64) -> Option<u64> {
    let (higher, rest) = messages.split_at_checked(index)?;
    let (message, lower) = rest.split_first()?;
    // A lower message that has just won the bus cannot be stopped.
    let blocking_ns = lower.iter().map(|lower| lower.transmission_ns).max().unwrap_or(0);

    // The busy period of this priority and the instances within it.
    let busy_ns = fixed_point(blocking_ns + message.transmission_ns, |busy| {
        blocking_ns + interference(higher, busy) + interference(&[*message], busy)
    })?;
    let instances = (busy_ns + message.jitter_ns).div_ceil(message.period_ns).max(1);

    // The longest wait of each instance and the response that follows from it, the greatest of which counts. The
    // waits only grow from one instance to the next.
    let mut wait_ns = blocking_ns;
    let mut worst_ns = 0;
    for instance in 0..instances {
        let before_ns = blocking_ns + instance * message.transmission_ns;
        wait_ns =
            fixed_point(wait_ns.max(before_ns), |wait| before_ns + interference(higher, wait + bit_ns))?;
        let response_ns = (message.jitter_ns + wait_ns + message.transmission_ns)
            .saturating_sub(instance * message.period_ns);
        worst_ns = worst_ns.max(response_ns);
    }
    Some(worst_ns)
}

/// What these messages can put on the wire within a window.
fn interference(messages: &[Message], window_ns: u64) -> u64 {
    messages
        .iter()
        .map(|message| (window_ns + message.jitter_ns).div_ceil(message.period_ns) * message.transmission_ns)
        .sum()
}

/// The smallest solution of `x = next(x)` from below; `None` when it grows beyond all use.
fn fixed_point(start_ns: u64, next: impl Fn(u64) -> u64) -> Option<u64> {
    let mut value_ns = start_ns;
    loop {
        let next_ns = next(value_ns);
        if next_ns <= value_ns {
            return Some(value_ns);
        }
        if next_ns > LONGEST_BUSY_PERIOD_NS {
            return None;
        }
        value_ns = next_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(period_us: u64, transmission_us: u64) -> Message {
        Message { period_ns: period_us * 1000, jitter_ns: 0, transmission_ns: transmission_us * 1000 }
    }

    const BIT_NS: u64 = 8_000;

    fn response_times(messages: &[Message], bit_ns: u64) -> Vec<Option<u64>> {
        (0..messages.len()).map(|index| response_time(messages, index, bit_ns)).collect()
    }

    /// The example by which the paper refutes its forerunner: the analysis of 1994 finds 3 ms for the last message, whose second instance takes 3.5 ms.
    #[test]
    fn the_second_instance_of_the_published_counterexample_is_the_late_one() {
        let messages = [message(2500, 1000), message(3500, 1000), message(3500, 1000)];
        let expected = [Some(2_000_000), Some(3_000_000), Some(3_500_000)];
        assert_eq!(response_times(&messages, BIT_NS), expected);
    }

    #[test]
    fn a_message_alone_takes_its_own_time() {
        assert_eq!(response_times(&[message(1000, 135)], BIT_NS), [Some(135_000)]);
        assert_eq!(response_time(&[], 0, BIT_NS), None);
    }

    #[test]
    fn the_longest_lower_message_blocks_once() {
        let messages = [message(1000, 55), message(1000, 115), message(1000, 135)];
        assert_eq!(response_times(&messages, 1000), [Some(190_000), Some(305_000), Some(305_000)]);
    }

    #[test]
    fn jitter_of_a_higher_message_lets_two_of_it_come_close_together() {
        let calm = [message(1000, 300), message(5000, 300)];
        let late = [Message { jitter_ns: 900_000, ..calm[0] }, calm[1]];
        assert_eq!(response_times(&calm, 1000)[1], Some(600_000));
        assert_eq!(response_times(&late, 1000)[1], Some(900_000));
    }

    #[test]
    fn the_jitter_of_a_message_is_part_of_its_own_response() {
        let messages = [Message { jitter_ns: 50_000, ..message(1000, 100) }];
        assert_eq!(response_times(&messages, 1000), [Some(150_000)]);
    }

    #[test]
    fn an_overloaded_bus_has_no_bound_from_where_the_overload_begins() {
        let messages = [message(1000, 600), message(1000, 600), message(9000, 100)];
        assert_eq!(response_times(&messages, 1000), [Some(1_200_000), None, None]);
    }
}
