//! Whether a driver waits for more frames before it reports any.

use crate::doctor::finding::{Check, Finding, Group};
use crate::doctor::source::CommandFailure;

const COALESCING: Check = Check {
    key: "can_rx_coalescing",
    group: Group::Can,
    title: "coalescing",
    source: "ethtool -c",
    why: "a driver that gathers received frames to save interrupts lets feedback miss its command phase",
};

pub fn finding(name: &str, answer: Result<String, CommandFailure>) -> Finding {
    match answer {
        Err(CommandFailure::Missing) => {
            COALESCING.not_known("ethtool is not installed").mend("sudo apt-get install ethtool")
        }
        Err(CommandFailure::Failed(_)) => COALESCING.good("the driver has none"),
        Ok(text) => of_settings(name, &text),
    }
}

/// Lines such as `rx-usecs-irq: 1000` and `rx-usecs: n/a`.
fn of_settings(name: &str, text: &str) -> Finding {
    let waits = ["rx-usecs", "rx-usecs-irq"].into_iter().filter_map(|key| {
        let line = text.lines().find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(':'))?;
        let us: u64 = line.trim().parse().ok()?;
        (us > 0).then_some((key, us))
    });
    let waits: Vec<_> = waits.collect();
    if waits.is_empty() {
        return COALESCING.good("off").applied(false);
    }
    let words: Vec<_> = waits.iter().map(|(key, us)| format!("{key} {us} µs")).collect();
    let off: Vec<_> = waits.iter().map(|(key, _)| format!("{key} 0")).collect();
    COALESCING
        .could_be_better(words.join(", "))
        .applied(true)
        .mend(format!("sudo ethtool -C {name} {}", off.join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn a_driver_that_waits_is_told_with_the_command_that_stops_it() {
        let text = "Coalesce parameters for can0:\nAdaptive RX: n/a  TX: n/a\nstats-block-usecs:\tn/a\n\nrx-usecs:\tn/a\nrx-frames:\tn/a\nrx-usecs-irq:\t1000\nrx-frames-irq:\t13\n";
        let finding = of_settings("can0", text);
        assert_eq!(
            (finding.verdict, finding.read.as_str()),
            (Verdict::CouldBeBetter, "rx-usecs-irq 1000 µs")
        );
        assert_eq!(finding.mend, ["sudo ethtool -C can0 rx-usecs-irq 0"]);
        assert_eq!(of_settings("can0", "rx-usecs: 0\nrx-usecs-irq: 0\n").verdict, Verdict::Good);
    }

    #[test]
    fn a_driver_without_it_is_good_and_a_machine_without_ethtool_is_told_so() {
        let failed = CommandFailure::Failed("netlink error: Operation not supported".to_owned());
        assert_eq!(finding("can0", Err(failed)).verdict, Verdict::Good);
        assert_eq!(finding("can0", Err(CommandFailure::Missing)).verdict, Verdict::NotKnown);
    }
}
