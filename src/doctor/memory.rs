//! Memory that moves under a program.

use super::finding::{Check, Finding, Group};
use super::source::Source;

const HUGE_PAGES: Check = Check {
    key: "transparent_hugepage",
    group: Group::Memory,
    title: "huge pages",
    source: "/sys/kernel/mm/transparent_hugepage/enabled",
    why: "khugepaged gathers small pages into large ones behind the program's back, locked ones too; whoever touches one meanwhile waits",
};

pub fn findings(source: &Source) -> Vec<Finding> {
    vec![huge_pages(source.text(HUGE_PAGES.source).as_deref())]
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
    use super::huge_pages;
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
}
