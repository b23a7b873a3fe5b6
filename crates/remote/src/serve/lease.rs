//! Who of the clients commands.

use std::time::Duration;

use takt::command::{CommandError, LeaseError};
use takt::trajectory::{PointQuantity, TrajectoryError, TrajectoryPoint};

use crate::commands::bytes_of_point;
use crate::layout::LeaseShown;

/// Points of a trajectory that a client can hand over before it is carried out: 100 s at 1 kHz.
const POINTS_AT_MOST: usize = 100_000;
/// The bytes of them: 100 s of ten axes at 1 kHz with velocities and accelerations.
const BYTES_AT_MOST: usize = 32 << 20;

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

#[derive(Debug)]
struct Holder {
    claimant: Claimant,
    until_ns: u64,
    /// What it has handed over of a trajectory. It goes with the lease.
    points: KeptPoints,
}

/// Points of a trajectory that is to come.
#[derive(Debug, Default)]
struct KeptPoints {
    points: Vec<TrajectoryPoint>,
    bytes: usize,
}

impl KeptPoints {
    /// Keeps points for so many axes, behind those that came before.
    fn extend(&mut self, axes: usize, points: Vec<TrajectoryPoint>) -> Result<(), CommandError> {
        for (point, number) in points.iter().zip(self.points.len()..) {
            check_counts(number, point, axes)?;
        }
        self.bytes += points.iter().map(bytes_of_point).sum::<usize>();
        if self.points.len() + points.len() > POINTS_AT_MOST || self.bytes > BYTES_AT_MOST {
            return Err(CommandError::Full { waiting: self.points.len() });
        }
        self.points.extend(points);
        Ok(())
    }
}

/// Checks that a point has a value for each axis, of every kind that it has.
fn check_counts(number: usize, point: &TrajectoryPoint, axes: usize) -> Result<(), TrajectoryError> {
    for (quantity, values) in [
        (PointQuantity::Position, &point.positions),
        (PointQuantity::Velocity, &point.velocities),
        (PointQuantity::Acceleration, &point.accelerations),
    ] {
        if !values.is_empty() && values.len() != axes {
            return Err(TrajectoryError::Count { point: number, quantity, given: values.len(), axes });
        }
    }
    Ok(())
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
        if self.holder.as_ref().is_some_and(|holder| holder.claimant == claimant) {
            self.give(claimant, now_ns);
        }
    }

    /// A client takes the lease, whoever has it.
    pub fn take_over(&mut self, claimant: Claimant, now_ns: u64) {
        self.ousted.retain(|(connection, _)| *connection != claimant.connection);
        if let Some(holder) = self.other_holder(claimant, now_ns) {
            let ousted = holder.claimant.connection;
            self.ousted.push((ousted, claimant.process));
        }
        self.give(claimant, now_ns);
    }

    /// A client gives the lease back.
    pub fn release(&mut self, connection: u64) {
        self.holder.take_if(|holder| holder.claimant.connection == connection);
    }

    /// A client has disconnected, or its process has ended.
    pub fn leave(&mut self, connection: u64) {
        self.release(connection);
        self.ousted.retain(|(other, _)| *other != connection);
    }

    /// Keeps points of a trajectory for so many axes, behind those that their client has handed over before, for as long as it has the
    /// lease. After an error none is kept.
    pub fn keep_points(
        &mut self,
        claimant: Claimant,
        axes: usize,
        points: Vec<TrajectoryPoint>,
    ) -> Result<(), CommandError> {
        let kept = self.points_of(claimant)?;
        let extended = kept.extend(axes, points);
        if extended.is_err() {
            *kept = KeptPoints::default();
        }
        extended
    }

    /// The points that a client has handed over, which are so many.
    pub fn take_points(
        &mut self,
        claimant: Claimant,
        count: usize,
    ) -> Result<Vec<TrajectoryPoint>, LeaseError> {
        let KeptPoints { points, .. } = std::mem::take(self.points_of(claimant)?);
        if points.len() == count { Ok(points) } else { Err(LeaseError::Lost) }
    }

    fn points_of(&mut self, claimant: Claimant) -> Result<&mut KeptPoints, LeaseError> {
        let holder = self.holder.as_mut().filter(|holder| holder.claimant == claimant);
        holder.map(|holder| &mut holder.points).ok_or(LeaseError::Lost)
    }

    /// Forgets what belongs to a lease that has expired.
    pub fn forget_expired(&mut self, now_ns: u64) {
        if let Some(holder) = self.holder.as_mut().filter(|holder| now_ns >= holder.until_ns) {
            holder.points = KeptPoints::default();
        }
    }

    /// As observers see it.
    pub fn shown(&self, now_ns: u64) -> LeaseShown {
        let holder = self.holder.as_ref().filter(|holder| now_ns < holder.until_ns);
        let shown = |holder: &Holder| (holder.claimant.process, holder.until_ns);
        let (process, until_ns) = holder.map_or((0, 0), shown);
        LeaseShown { process, until_ns, generation: self.generation }
    }

    fn give(&mut self, claimant: Claimant, now_ns: u64) {
        self.forget_expired(now_ns);
        let until_ns = now_ns.saturating_add(self.length_ns);
        match &mut self.holder {
            Some(holder) if holder.claimant == claimant => holder.until_ns = until_ns,
            _ => {
                self.generation += 1;
                self.holder = Some(Holder { claimant, until_ns, points: KeptPoints::default() });
            }
        }
    }

    fn other_holder(&self, claimant: Claimant, now_ns: u64) -> Option<&Holder> {
        self.holder.as_ref().filter(|holder| holder.claimant != claimant && now_ns < holder.until_ns)
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

    fn point(positions: usize) -> TrajectoryPoint {
        TrajectoryPoint { positions: vec![0.0; positions], ..TrajectoryPoint::default() }
    }

    #[test]
    fn points_are_kept_for_the_axes_of_their_target_alone_and_up_to_a_bound_of_their_bytes() {
        let mut lease = Lease::new(LENGTH);
        assert_eq!(lease.keep_points(FIRST, 6, vec![point(6)]), Err(LeaseError::Lost.into()), "it has none");
        lease.renew(FIRST, 0).unwrap();
        assert_eq!(lease.keep_points(FIRST, 6, vec![point(6); 3]), Ok(()));
        let count =
            TrajectoryError::Count { point: 4, quantity: PointQuantity::Position, given: 8_000, axes: 6 };
        assert_eq!(lease.keep_points(FIRST, 6, vec![point(6), point(8_000)]), Err(count.into()));
        let moving = TrajectoryPoint { accelerations: vec![0.0; 7], ..point(6) };
        let count =
            TrajectoryError::Count { point: 0, quantity: PointQuantity::Acceleration, given: 7, axes: 6 };
        assert_eq!(
            lease.keep_points(FIRST, 6, vec![moving]),
            Err(count.into()),
            "those before are forgotten"
        );
        for (axes, at_most) in [(6, POINTS_AT_MOST), (96, BYTES_AT_MOST / 800)] {
            let each = 100;
            let kept = (0..POINTS_AT_MOST)
                .take_while(|_| lease.keep_points(FIRST, axes, vec![point(axes); each]).is_ok());
            let kept = kept.count() * each;
            assert!((at_most - each..=at_most).contains(&kept), "{kept} points of {axes} axes");
            assert_eq!(lease.take_points(FIRST, 0), Ok(vec![]), "none is kept after an error");
        }
    }

    #[test]
    fn points_go_with_the_lease_and_no_trajectory_begins_with_a_part_of_them() {
        let ends: [fn(&mut Lease); 4] = [
            |lease| lease.release(FIRST.connection),
            |lease| lease.take_over(SECOND, 100 * MS),
            |lease| lease.forget_expired(500 * MS),
            |lease| lease.renew(SECOND, 600 * MS).unwrap(),
        ];
        for end in ends {
            let mut lease = Lease::new(LENGTH);
            lease.renew(FIRST, 0).unwrap();
            lease.keep_points(FIRST, 1, vec![point(1); 2]).unwrap();
            end(&mut lease);
            lease.take_over(FIRST, 700 * MS);
            lease.keep_points(FIRST, 1, vec![point(1)]).unwrap();
            assert_eq!(lease.take_points(FIRST, 3), Err(LeaseError::Lost));
            lease.keep_points(FIRST, 1, vec![point(1); 3]).unwrap();
            assert_eq!(lease.take_points(FIRST, 3).map(|points| points.len()), Ok(3));
        }
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
