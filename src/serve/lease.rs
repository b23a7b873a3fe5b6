//! Who of the clients commands.

use std::time::Duration;

use crate::command::LeaseError;
use crate::remote::LeaseShown;

/// A client, by the number of its connection and by its process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claimant {
    /// The connection. No other one has had the number before.
    pub connection: u64,
    /// Its process, for people.
    pub process: u32,
}

/// The lease. Only the process of the controller has it: a client cannot take it but by a packet.
#[derive(Debug)]
pub struct Lease {
    /// From a command to the end.
    length_ns: u64,
    holder: Option<Holder>,
    /// The connections whose lease another one has taken over, with the process that has.
    ousted: Vec<(u64, u32)>,
    generation: u64,
}

#[derive(Clone, Copy, Debug)]
struct Holder {
    claimant: Claimant,
    until_ns: u64,
}

impl Lease {
    /// A lease that nobody has, and that expires so long after a command.
    pub fn new(length: Duration) -> Self {
        let length_ns = u64::try_from(length.as_nanos()).unwrap_or(u64::MAX);
        Self { length_ns, holder: None, ousted: vec![], generation: 0 }
    }

    /// A client commands: it renews its lease, or takes it if nobody has it.
    pub fn renew(&mut self, claimant: Claimant, now_ns: u64) -> Result<(), LeaseError> {
        if let Some(holder) = self.other_holder(claimant, now_ns) {
            return Err(match self.ousted_by(claimant) {
                Some(process) => LeaseError::TakenOver { process },
                None => LeaseError::Held {
                    process: holder.claimant.process,
                    expires_in: Duration::from_nanos(holder.until_ns - now_ns),
                },
            });
        }
        if let Some(process) = self.ousted_by(claimant) {
            return Err(LeaseError::TakenOver { process });
        }
        self.give(claimant, now_ns);
        Ok(())
    }

    /// A command has been carried out: if its client still has the lease, it has it for the whole length from now on.
    pub fn prolong(&mut self, claimant: Claimant, now_ns: u64) {
        if self.holder.is_some_and(|holder| holder.claimant == claimant) {
            self.give(claimant, now_ns);
        }
    }

    /// A client takes the lease, whoever has it.
    pub fn take_over(&mut self, claimant: Claimant, now_ns: u64) {
        self.ousted.retain(|(connection, _)| *connection != claimant.connection);
        if let Some(holder) = self.other_holder(claimant, now_ns) {
            self.ousted.push((holder.claimant.connection, claimant.process));
        }
        self.give(claimant, now_ns);
    }

    /// A client gives the lease back.
    pub fn release(&mut self, connection: u64) {
        self.holder = self.holder.filter(|holder| holder.claimant.connection != connection);
    }

    /// A client has disconnected, or its process has ended.
    pub fn leave(&mut self, connection: u64) {
        self.release(connection);
        self.ousted.retain(|(other, _)| *other != connection);
    }

    /// As observers see it.
    pub fn shown(&self, now_ns: u64) -> LeaseShown {
        let holder = self.holder.filter(|holder| now_ns < holder.until_ns);
        let shown = |holder: Holder| (holder.claimant.process, holder.until_ns);
        let (process, until_ns) = holder.map_or((0, 0), shown);
        LeaseShown { process, until_ns, generation: self.generation }
    }

    fn give(&mut self, claimant: Claimant, now_ns: u64) {
        if self.holder.is_none_or(|holder| holder.claimant != claimant) {
            self.generation += 1;
        }
        self.holder = Some(Holder { claimant, until_ns: now_ns.saturating_add(self.length_ns) });
    }

    fn other_holder(&self, claimant: Claimant, now_ns: u64) -> Option<Holder> {
        self.holder.filter(|holder| holder.claimant != claimant && now_ns < holder.until_ns)
    }

    fn ousted_by(&self, claimant: Claimant) -> Option<u32> {
        let entry = self.ousted.iter().find(|(connection, _)| *connection == claimant.connection);
        entry.map(|(_, process)| *process)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH: Duration = Duration::from_millis(500);
    const MS: u64 = 1_000_000;
    #[test]
    fn a_command_that_took_its_time_prolongs_the_lease_of_its_client_and_of_no_other() {
        let mut lease = Lease::new(LENGTH);
        assert_eq!(lease.renew(FIRST, 0), Ok(()));
        lease.prolong(FIRST, 400 * MS);
        assert_eq!(lease.shown(800 * MS).process, FIRST.process);
        lease.release(FIRST.connection);
        lease.prolong(FIRST, 800 * MS);
        assert_eq!(lease.shown(800 * MS).process, 0, "it has been given back");
    }

    const FIRST: Claimant = Claimant { connection: 1, process: 101 };
    const SECOND: Claimant = Claimant { connection: 2, process: 102 };

    #[test]
    fn one_client_commands_until_its_lease_expires_and_each_command_renews_it() {
        let mut lease = Lease::new(LENGTH);
        assert_eq!(lease.renew(FIRST, 0), Ok(()));
        assert_eq!(lease.renew(FIRST, 400 * MS), Ok(()));
        let held =
            |left_ms| Err(LeaseError::Held { process: 101, expires_in: Duration::from_millis(left_ms) });
        assert_eq!(lease.renew(SECOND, 500 * MS), held(400));
        assert_eq!(lease.renew(SECOND, 899 * MS), held(1));
        assert_eq!(lease.shown(899 * MS).process, 101);
        assert_eq!(lease.shown(900 * MS), LeaseShown { process: 0, until_ns: 0, generation: 1 });
        assert_eq!(lease.renew(SECOND, 900 * MS), Ok(()));
        assert_eq!(lease.shown(900 * MS), LeaseShown { process: 102, until_ns: 1_400 * MS, generation: 2 });
        assert!(lease.renew(FIRST, 901 * MS).is_err(), "it has expired");
        assert_eq!(lease.renew(FIRST, 1_400 * MS), Ok(()), "and may be had again when nobody has it");
    }

    #[test]
    fn a_client_whose_lease_was_taken_over_commands_again_only_when_it_says_so() {
        let mut lease = Lease::new(LENGTH);
        assert_eq!(lease.renew(FIRST, 0), Ok(()));
        lease.take_over(SECOND, 1);
        let taken_over = Err(LeaseError::TakenOver { process: 102 });
        assert_eq!(lease.renew(FIRST, 2), taken_over);
        assert_eq!(lease.renew(SECOND, 3), Ok(()));
        assert_eq!(lease.renew(FIRST, 900 * MS), taken_over, "even when the other one has it no longer");
        lease.leave(SECOND.connection);
        assert_eq!(lease.renew(FIRST, 901 * MS), taken_over);
        lease.take_over(FIRST, 902 * MS);
        assert_eq!(lease.renew(FIRST, 903 * MS), Ok(()));
    }

    #[test]
    fn a_lease_is_free_as_soon_as_its_holder_gives_it_back_or_ends() {
        let mut lease = Lease::new(LENGTH);
        for end in [Lease::release, Lease::leave] {
            assert_eq!(lease.renew(FIRST, 0), Ok(()));
            end(&mut lease, SECOND.connection);
            assert!(lease.renew(SECOND, 1).is_err(), "only its holder can");
            end(&mut lease, FIRST.connection);
            assert_eq!(lease.renew(SECOND, 1), Ok(()));
            lease.leave(SECOND.connection);
        }
    }
}
