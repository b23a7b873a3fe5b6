//! Memory management that can delay a program.

use super::finding::{Check, Finding, Group};
use super::source::Source;

const HUGE_PAGES: Check = Check {
    key: "transparent_hugepage",
    group: Group::Memory,
    title: "huge pages",
    source: "/sys/kernel/mm/transparent_hugepage/enabled",
    why: "khugepaged merges small pages into large ones, also locked ones; a program that touches such a page meanwhile has to wait",
};

const PAGE_LISTS: Check = Check {
    key: "page_lists",
    group: Group::Memory,
    title: "free pages of a CPU",
    source: "/proc/zoneinfo",
    why: "a process that ends gives the free pages that its CPU keeps back all at once, under a lock; a thousand of them take a quarter of a millisecond, and a thread that sends a frame may have to wait for it",
};

/// The kernel's own lower limit is four of the batches in which a CPU takes pages (`zone_highsize`, mm/page_alloc.c); a
/// kernel that chooses by the size of the memory keeps many more.
const SHORT_LIST_BATCHES: u64 = 4;

pub fn findings(source: &Source) -> Vec<Finding> {
    vec![
        huge_pages(source.text(HUGE_PAGES.source).as_deref()),
        page_lists(source.text(PAGE_LISTS.source).as_deref()),
    ]
}

/// Every zone of the memory has a list for each CPU.
fn page_lists(zones: Option<&str>) -> Finding {
    let (mut longest, mut is_short) = (0, true);
    for list in zones.unwrap_or_default().split("cpu:").skip(1) {
        let pages =
            |name| list.lines().find_map(|line| line.trim().strip_prefix(name)?.trim().parse::<u64>().ok());
        // Since Linux 6.7 the length moves by itself, up to `high_max`.
        let high = pages("high_max:").or_else(|| pages("high:")).unwrap_or(0);
        longest = longest.max(high);
        is_short &= high <= SHORT_LIST_BATCHES * pages("batch:").unwrap_or(0);
    }
    match longest {
        0 => PAGE_LISTS.not_known("the kernel does not show its lists"),
        _ if is_short => PAGE_LISTS.good(format!("at most {longest}, as few as this kernel can")),
        _ => PAGE_LISTS
            .could_be_better(format!("up to {longest}"))
            .mend("sudo sysctl -w vm.percpu_pagelist_high_fraction=1000000"),
    }
}

/// The choice in force stands in square brackets: `always [madvise] never`.
fn huge_pages(choices: Option<&str>) -> Finding {
    let Some(choices) = choices else { return HUGE_PAGES.good("this kernel has none that are transparent") };
    let chosen = choices.split_once('[').and_then(|(_, rest)| rest.split_once(']'));
    match chosen {
        Some(("always", _)) => HUGE_PAGES
            .could_be_better("transparent, for every program")
            .mend(format!("echo madvise | sudo tee {}", HUGE_PAGES.source)),
        Some(("madvise", _)) => {
            HUGE_PAGES.good("transparent for programs that ask for it; this one does not")
        }
        Some(("never", _)) => HUGE_PAGES.good("never transparent"),
        _ => HUGE_PAGES.not_known(format!("transparent: {choices:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::{huge_pages, page_lists};
    use crate::doctor::Verdict;

    #[test]
    fn the_choice_in_brackets_counts() {
        for (text, verdict) in [
            (Some("[always] madvise never"), Verdict::CouldBeBetter),
            (Some("always [madvise] never"), Verdict::Good),
            (Some("always madvise [never]"), Verdict::Good),
            (Some("always madvise"), Verdict::NotKnown),
            (Some("[inherit]"), Verdict::NotKnown),
            (None, Verdict::Good),
        ] {
            assert_eq!(huge_pages(text).verdict, verdict, "{text:?}");
        }
    }

    /// Lists of a zone as `/proc/zoneinfo` shows them.
    fn zones(lists: &[&str]) -> String {
        let list =
            |text: &&str| format!("    cpu: 0\n              count:    7\n{text}\n  vm stats threshold: 4\n");
        format!(
            "Node 0, zone      DMA\n  pages free     3840\n        high     9999\n  pagesets\n{}",
            lists.iter().map(list).collect::<String>()
        )
    }

    #[test]
    fn lists_of_free_pages_are_short_when_each_is_as_short_as_the_kernel_makes_them() {
        // As shown by Linux 6.1 with one CPU and 1 GiB: as it comes, and mended.
        let (as_it_comes, mended) = ("high:  1211\n batch: 63", "high:  252\n batch: 63");
        let (small, small_mended) = ("high:  18\n batch: 1", "high:  4\n batch: 1");
        // As shown by Linux 6.18.
        let (new, new_mended) = (
            "high:     252\n batch:    63\n high_min: 1708\n high_max: 48300",
            "high:     252\n batch:    63\n high_min: 252\n high_max: 252",
        );
        for (lists, verdict, read) in [
            (vec![small, as_it_comes], Verdict::CouldBeBetter, "up to 1211"),
            (vec![small, mended], Verdict::CouldBeBetter, "up to 252"),
            (vec![small_mended, mended], Verdict::Good, "at most 252, as few as this kernel can"),
            (vec![mended, new], Verdict::CouldBeBetter, "up to 48300"),
            (vec!["high: 0\n batch: 1", new_mended], Verdict::Good, "at most 252, as few as this kernel can"),
        ] {
            let finding = page_lists(Some(&zones(&lists)));
            assert_eq!((finding.verdict, finding.read.as_str()), (verdict, read), "{lists:?}");
            assert_eq!(finding.mend.is_empty(), verdict == Verdict::Good);
        }
    }

    #[test]
    fn without_lists_of_free_pages_there_is_nothing_to_judge() {
        for text in [None, Some(""), Some("Node 0, zone DMA\n        high     9999\n")] {
            assert_eq!(page_lists(text).verdict, Verdict::NotKnown, "{text:?}");
        }
    }
}
