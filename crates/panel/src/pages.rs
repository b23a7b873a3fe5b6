//! The open pages: which of them is there, which one commands, and how often each may ask. Without I/O: the time is given.
//!
//! A page is *present* while it confirms that states reach it. A page that is not present moves nothing.

use std::time::{Duration, Instant};

use takt::words;
use takt::words::Words;

/// How long a page is present after it has last confirmed a state.
pub const PRESENT_FOR: Duration = Duration::from_millis(1500);
/// A page that has confirmed nothing for so long is closed.
pub const CLOSED_AFTER: Duration = Duration::from_secs(15);
/// Pages that may be open at the same time.
pub const PAGES_AT_MOST: usize = 48;

/// The number of an open page; pages are numbered from 1 on.
pub type PageNumber = u64;

/// Why a page may not do what it asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PageRefusal {
    /// Too many pages are open.
    TooManyPages,
    /// The page has been closed, or has never been open.
    NotOpen,
    /// The page has not confirmed a state lately.
    NotPresent,
    /// No page commands, or another one does.
    NotCommander {
        /// The page that commands.
        commander: Option<PageNumber>,
    },
    /// It asks too often.
    TooOften {
        /// What is taken.
        per_second: u32,
    },
    /// A later command of the page has come before it.
    Overtaken,
}

impl PageRefusal {
    /// Its word for programs.
    pub const fn key(&self) -> &'static str {
        match self {
            Self::TooManyPages => "too_many_pages",
            Self::NotOpen => "not_open",
            Self::NotPresent => "not_present",
            Self::NotCommander { .. } => "not_commander",
            Self::TooOften { .. } => "too_often",
            Self::Overtaken => "overtaken",
        }
    }

    /// The sentence.
    pub fn words(&self) -> Words {
        match self {
            Self::TooManyPages => {
                words!("{pages} pages are open already; close one of them", pages = PAGES_AT_MOST)
            }
            Self::NotOpen => "the connection of this page is lost; load it again".into(),
            Self::NotPresent => "states do not reach this page at present, so it moves nothing".into(),
            Self::NotCommander { commander: Some(page) } => {
                words!("this page does not command: page {page} does; take over from it first", page)
            }
            Self::NotCommander { commander: None } => "this page does not command: take command first".into(),
            Self::TooOften { per_second } => {
                words!("too many commands: at most {per_second} a second are taken", per_second)
            }
            Self::Overtaken => "a later command of this page has overtaken this one".into(),
        }
    }
}

/// What a page asks, by what it may ask how often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// A command: 10 a second, 20 at once.
    Command,
    /// A command that goes on with the one before, as a held key does: 30 a second.
    Renewal,
}

/// Allows so many a second, and some at once.
#[derive(Clone, Copy, Debug)]
struct Allowance {
    per_second: u32,
    at_once: f64,
    left: f64,
    at: Instant,
}

impl Allowance {
    const fn new(per_second: u32, at_once: f64, now: Instant) -> Self {
        Self { per_second, at_once, left: at_once, at: now }
    }

    fn take(&mut self, now: Instant) -> Result<(), PageRefusal> {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + passed * f64::from(self.per_second)).min(self.at_once);
        self.at = now;
        if self.left < 1.0 {
            return Err(PageRefusal::TooOften { per_second: self.per_second });
        }
        self.left -= 1.0;
        Ok(())
    }
}

#[derive(Debug)]
struct Page {
    number: PageNumber,
    key: String,
    confirmed: Instant,
    /// The number of its newest command.
    sequence: u64,
    commands: Allowance,
    renewals: Allowance,
    /// 10 a second.
    confirmations: Allowance,
}

impl Page {
    fn is_present(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.confirmed) <= PRESENT_FOR
    }
}

/// The open pages.
#[derive(Debug, Default)]
pub struct Pages {
    open: Vec<Page>,
    commander: Option<PageNumber>,
    opened: u64,
}

impl Pages {
    /// A page is opened. `key` is its secret.
    ///
    /// # Errors
    /// [`PageRefusal::TooManyPages`].
    pub fn open(&mut self, key: String, now: Instant) -> Result<PageNumber, PageRefusal> {
        if self.open.len() >= PAGES_AT_MOST {
            return Err(PageRefusal::TooManyPages);
        }
        self.opened += 1;
        let page = Page {
            number: self.opened,
            key,
            confirmed: now,
            sequence: 0,
            commands: Allowance::new(10, 20.0, now),
            renewals: Allowance::new(30, 30.0, now),
            confirmations: Allowance::new(10, 20.0, now),
        };
        self.open.push(page);
        Ok(self.opened)
    }

    /// A page is closed. It commands no longer.
    pub fn close(&mut self, number: PageNumber) {
        self.open.retain(|page| page.number != number);
        self.commander = self.commander.filter(|commander| *commander != number);
    }

    /// How many are open.
    pub fn count(&self) -> usize {
        self.open.len()
    }

    /// The page that commands.
    pub const fn commander(&self) -> Option<PageNumber> {
        self.commander
    }

    /// The page with this key.
    ///
    /// # Errors
    /// [`PageRefusal::NotOpen`].
    pub fn number(&self, key: &str) -> Result<PageNumber, PageRefusal> {
        self.open.iter().find(|page| page.key == key).map(|page| page.number).ok_or(PageRefusal::NotOpen)
    }

    fn page(&mut self, key: &str) -> Result<&mut Page, PageRefusal> {
        self.open.iter_mut().find(|page| page.key == key).ok_or(PageRefusal::NotOpen)
    }

    /// A page confirms that a state has reached it.
    ///
    /// # Errors
    /// [`PageRefusal::NotOpen`], [`PageRefusal::TooOften`].
    pub fn confirm(&mut self, key: &str, now: Instant) -> Result<PageNumber, PageRefusal> {
        let page = self.page(key)?;
        page.confirmations.take(now)?;
        page.confirmed = now;
        Ok(page.number)
    }

    /// A page begins to command: `is_taken_over` from another one that does. Returns that one.
    ///
    /// # Errors
    /// [`PageRefusal::NotCommander`] if another one commands and is not to be taken over from, and as [`Pages::may_command`].
    pub fn take(
        &mut self,
        key: &str,
        is_taken_over: bool,
        now: Instant,
    ) -> Result<Option<PageNumber>, PageRefusal> {
        let page = self.page(key)?;
        page.commands.take(now)?;
        let (number, is_present) = (page.number, page.is_present(now));
        let other = self.commander.filter(|commander| *commander != number);
        match other {
            _ if !is_present => Err(PageRefusal::NotPresent),
            Some(_) if !is_taken_over => Err(PageRefusal::NotCommander { commander: other }),
            _ => {
                self.commander = Some(number);
                Ok(other)
            }
        }
    }

    /// A page commands no longer.
    ///
    /// # Errors
    /// [`PageRefusal::NotOpen`].
    pub fn release(&mut self, key: &str) -> Result<PageNumber, PageRefusal> {
        let number = self.page(key)?.number;
        self.commander = self.commander.filter(|commander| *commander != number);
        Ok(number)
    }

    /// Returns `true` if a page may give its command with this number now. Its numbers rise.
    ///
    /// # Errors
    /// See [`PageRefusal`].
    pub fn may_command(
        &mut self,
        key: &str,
        sequence: u64,
        asked: Asked,
        now: Instant,
    ) -> Result<PageNumber, PageRefusal> {
        let commander = self.commander;
        let page = self.page(key)?;
        match asked {
            Asked::Command => page.commands.take(now)?,
            Asked::Renewal => page.renewals.take(now)?,
        }
        if commander != Some(page.number) {
            return Err(PageRefusal::NotCommander { commander });
        }
        if !page.is_present(now) {
            return Err(PageRefusal::NotPresent);
        }
        if sequence <= page.sequence {
            return Err(PageRefusal::Overtaken);
        }
        page.sequence = sequence;
        Ok(page.number)
    }

    /// A page has sent a stop with this number: what it sent before does not begin any more.
    pub fn stopped(&mut self, key: &str, sequence: u64) {
        if let Ok(page) = self.page(key) {
            page.sequence = page.sequence.max(sequence);
        }
    }

    /// Returns `true` if a page is present and commands, and has said nothing after its command with this number.
    pub fn may_begin(&self, number: PageNumber, sequence: u64, now: Instant) -> bool {
        let is_newest = |page: &Page| page.number == number && page.sequence == sequence;
        self.may_move(number, now) && self.open.iter().any(is_newest)
    }

    /// Returns `true` if a page is present and commands.
    pub fn may_move(&self, number: PageNumber, now: Instant) -> bool {
        let is_present = |page: &Page| page.number == number && page.is_present(now);
        self.commander == Some(number) && self.open.iter().any(is_present)
    }

    /// The pages that have been silent for too long.
    pub fn silent(&self, now: Instant) -> Vec<PageNumber> {
        let is_silent = |page: &&Page| now.saturating_duration_since(page.confirmed) > CLOSED_AFTER;
        self.open.iter().filter(is_silent).map(|page| page.number).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two(now: Instant) -> Pages {
        let mut pages = Pages::default();
        assert_eq!(pages.open("a".to_owned(), now), Ok(1));
        assert_eq!(pages.open("b".to_owned(), now), Ok(2));
        pages
    }

    #[test]
    fn one_page_commands_and_another_takes_over_only_when_it_says_so() {
        let now = Instant::now();
        let mut pages = two(now);
        let command =
            |pages: &mut Pages, key, sequence| pages.may_command(key, sequence, Asked::Command, now);
        assert_eq!(command(&mut pages, "a", 1), Err(PageRefusal::NotCommander { commander: None }));
        assert_eq!(pages.take("a", false, now), Ok(None));
        assert_eq!(command(&mut pages, "a", 1), Ok(1));
        let held = Err(PageRefusal::NotCommander { commander: Some(1) });
        assert_eq!(pages.take("b", false, now), held);
        assert_eq!(pages.take("b", true, now), Ok(Some(1)));
        assert_eq!(command(&mut pages, "a", 2), Err(PageRefusal::NotCommander { commander: Some(2) }));
        assert!(pages.may_move(2, now) && !pages.may_move(1, now));
        pages.close(2);
        assert_eq!(pages.commander(), None);
        assert_eq!(command(&mut pages, "b", 1), Err(PageRefusal::NotOpen));
        assert_eq!(pages.take("unknown", true, now), Err(PageRefusal::NotOpen));
    }

    #[test]
    fn a_page_that_no_state_reaches_moves_nothing_and_is_closed_in_the_end() {
        let now = Instant::now();
        let mut pages = two(now);
        pages.take("a", false, now).unwrap();
        let late = now + PRESENT_FOR + Duration::from_millis(1);
        assert!(pages.may_move(1, now + PRESENT_FOR) && !pages.may_move(1, late));
        assert_eq!(pages.may_command("a", 1, Asked::Command, late), Err(PageRefusal::NotPresent));
        assert_eq!(pages.take("b", true, late), Err(PageRefusal::NotPresent));
        assert_eq!(pages.confirm("a", late), Ok(1));
        assert_eq!(pages.may_command("a", 1, Asked::Command, late), Ok(1));
        assert_eq!(pages.silent(now + CLOSED_AFTER + Duration::from_millis(1)), [2]);
    }

    #[test]
    fn a_command_that_comes_after_a_later_one_or_a_stop_is_not_taken() {
        let now = Instant::now();
        let mut pages = two(now);
        pages.take("a", false, now).unwrap();
        assert_eq!(pages.may_command("a", 7, Asked::Renewal, now), Ok(1));
        assert_eq!(pages.may_command("a", 7, Asked::Renewal, now), Err(PageRefusal::Overtaken));
        pages.stopped("a", 9);
        assert_eq!(pages.may_command("a", 8, Asked::Command, now), Err(PageRefusal::Overtaken));
        assert_eq!(pages.may_command("a", 10, Asked::Command, now), Ok(1));
        assert!(pages.may_begin(1, 10, now) && !pages.may_begin(1, 9, now) && !pages.may_begin(2, 0, now));
        pages.stopped("a", 11);
        assert!(!pages.may_begin(1, 10, now));
    }

    #[test]
    fn a_page_is_told_when_it_asks_too_often_and_may_ask_again_later() {
        let now = Instant::now();
        let mut pages = two(now);
        pages.take("a", false, now).unwrap();
        let taken = (1..100).filter(|n| pages.may_command("a", *n, Asked::Command, now).is_ok()).count();
        assert_eq!(taken, 19, "20 at once, and the take-over was one of them");
        let refused = pages.may_command("a", 200, Asked::Command, now);
        assert_eq!(refused, Err(PageRefusal::TooOften { per_second: 10 }));
        let later = now + Duration::from_millis(100);
        assert_eq!(pages.may_command("a", 200, Asked::Command, later), Ok(1));
        assert_eq!(pages.may_command("a", 201, Asked::Renewal, now), Ok(1), "renewals are counted apart");
    }

    #[test]
    fn there_is_room_for_so_many_pages() {
        let now = Instant::now();
        let mut pages = Pages::default();
        for number in 0..PAGES_AT_MOST {
            pages.open(number.to_string(), now).unwrap();
        }
        assert_eq!(pages.open("more".to_owned(), now), Err(PageRefusal::TooManyPages));
        pages.close(3);
        assert_eq!(pages.open("more".to_owned(), now), Ok(PAGES_AT_MOST as u64 + 1));
    }
}
