//! One CAN bus: arbitration, occupation of the wire, and arrival of frames.
//!
//! Whenever the wire is free, every station with a waiting frame takes part in the arbitration. The frame with the
//! highest priority wins; the others wait until it has been sent. There are no bit errors, and every frame is
//! acknowledged. Two stations that send the same identifier at once would destroy each other's frames on a real bus;
//! here the station with the lower number goes first.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::wire_length::{INTERMISSION_BITS, WireLength, bits_ns};

use super::mailbox::{Mailbox, QueueOrder, priority};

/// The bit rates of a bus in bit/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireBitRates {
    /// Bit rate of classic frames and of the arbitration phase.
    pub nominal: u32,
    /// Bit rate of the data phase of CAN FD frames with bit-rate switching.
    pub data: Option<u32>,
}

impl WireBitRates {
    /// How long a frame occupies the wire, including the intermission.
    pub fn duration_ns(self, frame: &Frame) -> Nanoseconds {
        WireLength::of(frame).duration_ns(self.nominal, self.data)
    }
}

/// A frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameOnWire {
    /// The frame.
    pub frame: Frame,
    /// The index of its sender's mailbox.
    pub sender: usize,
    /// When it arrives: the end of its last bit before the intermission.
    pub arrives_ns: Nanoseconds,
    /// When the wire is free again.
    pub free_ns: Nanoseconds,
}

/// The wire and the mailboxes of its stations.
#[derive(Debug)]
pub struct Medium {
    rates: WireBitRates,
    mailboxes: Vec<Mailbox>,
    is_connected: Vec<bool>,
    on_wire: Option<FrameOnWire>,
    free_ns: Nanoseconds,
    busy_ns: Nanoseconds,
}

impl Medium {
    /// A free bus with one station for each mailbox.
    pub fn new(rates: WireBitRates, mailboxes: Vec<Mailbox>) -> Self {
        let is_connected = vec![true; mailboxes.len()];
        let mailboxes = match rates.data {
            Some(_) => mailboxes,
            None => mailboxes.into_iter().map(Mailbox::classic).collect(),
        };
        Self { rates, mailboxes, is_connected, on_wire: None, free_ns: 0, busy_ns: 0 }
    }

    /// The usual bus: station 0 is the master with a FIFO queue, followed by this number of drives with priority
    /// queues.
    pub fn with_master(
        rates: WireBitRates,
        master_frames: usize,
        drives: usize,
        drive_frames: usize,
    ) -> Self {
        let master = Mailbox::new(QueueOrder::FirstInFirstOut, master_frames);
        let drives = (0..drives).map(|_| Mailbox::new(QueueOrder::Priority, drive_frames));
        Self::new(rates, std::iter::once(master).chain(drives).collect())
    }

    /// The mailbox of an existing station.
    pub fn mailbox(&self, station: usize) -> &Mailbox {
        &self.mailboxes[station]
    }

    /// The mailbox of an existing station.
    pub fn mailbox_mut(&mut self, station: usize) -> &mut Mailbox {
        &mut self.mailboxes[station]
    }

    /// Disconnects a station or connects it again. A frame that it has begun to send still arrives.
    pub fn disconnect(&mut self, station: usize, is_cut_off: bool) {
        self.is_connected[station] = !is_cut_off;
    }

    /// Returns `true` if a station is connected.
    pub fn is_connected(&self, station: usize) -> bool {
        self.is_connected[station]
    }

    /// The frame on the wire.
    pub fn on_wire(&self) -> Option<&FrameOnWire> {
        self.on_wire.as_ref()
    }

    /// How long the wire has been occupied in total.
    pub fn busy_ns(&self) -> Nanoseconds {
        self.busy_ns
    }

    /// The time of the next event: the frame on the wire arrives, or a waiting one can start. `None` when no frame
    /// waits.
    pub fn next_ns(&self, now_ns: Nanoseconds) -> Option<Nanoseconds> {
        match &self.on_wire {
            Some(transmission) => Some(transmission.arrives_ns),
            None => self.offers().next().map(|_| self.free_ns.max(now_ns)),
        }
    }

    /// Does what is due at `now_ns`: returns the frame that has just arrived, or starts the next frame on a free wire.
    pub fn step(&mut self, now_ns: Nanoseconds) -> Option<FrameOnWire> {
        if self.on_wire.is_some() {
            return self.on_wire.take_if(|transmission| transmission.arrives_ns <= now_ns);
        }
        if self.free_ns <= now_ns {
            self.arbitrate(now_ns);
        }
        None
    }

    /// The frames that the connected stations offer.
    fn offers(&self) -> impl Iterator<Item = (usize, &Frame)> {
        let stations = self.mailboxes.iter().zip(&self.is_connected).enumerate();
        stations
            .filter(|(_, (_, is_connected))| **is_connected)
            .filter_map(|(station, (mailbox, _))| mailbox.head().map(|frame| (station, frame)))
    }

    fn arbitrate(&mut self, now_ns: Nanoseconds) {
        let Some((_, sender)) = self.offers().map(|(station, frame)| (priority(frame), station)).min() else {
            return;
        };
        let Some(frame) = self.mailboxes[sender].pop() else { return };
        let duration_ns = self.rates.duration_ns(&frame);
        self.busy_ns += duration_ns;
        self.free_ns = now_ns + duration_ns;
        let arrives_ns = self.free_ns - bits_ns(INTERMISSION_BITS, self.rates.nominal).min(duration_ns);
        self.on_wire = Some(FrameOnWire { frame, sender, arrives_ns, free_ns: self.free_ns });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::Id;

    const RATES: WireBitRates = WireBitRates { nominal: 1_000_000, data: None };

    fn frame(id: u32) -> Frame {
        Frame::of(Id::base(id).unwrap(), [0x55; 8])
    }

    /// Runs the bus until no frame waits; returns arrival time, station and identifier of each frame.
    fn run(medium: &mut Medium) -> Vec<(Nanoseconds, usize, u32)> {
        let mut arrived = vec![];
        let mut now_ns = 0;
        while let Some(next_ns) = medium.next_ns(now_ns) {
            now_ns = next_ns;
            if let Some(transmission) = medium.step(now_ns) {
                arrived.push((now_ns, transmission.sender, transmission.frame.id().value()));
            }
        }
        arrived
    }

    #[test]
    fn the_highest_priority_identifier_of_all_stations_goes_first() {
        let mut medium = Medium::with_master(RATES, 8, 2, 8);
        for (station, id) in [(1, 0x581), (1, 0x181), (2, 0x182), (0, 0x201), (0, 0x080)] {
            assert!(medium.mailbox_mut(station).push(frame(id)));
        }
        let order: Vec<_> = run(&mut medium).into_iter().map(|(_, station, id)| (station, id)).collect();
        // The master's FIFO offers 0x201 first, although 0x080 behind it has a higher priority.
        assert_eq!(order, [(1, 0x181), (2, 0x182), (0, 0x201), (0, 0x080), (1, 0x581)]);
    }

    #[test]
    fn frames_follow_each_other_without_a_gap_and_arrive_before_the_intermission() {
        let mut medium = Medium::with_master(RATES, 8, 0, 8);
        for id in [0x201, 0x202, 0x203] {
            medium.mailbox_mut(0).push(frame(id));
        }
        let mut start_ns = 0;
        for (arrived_ns, _, id) in run(&mut medium) {
            let duration_ns = RATES.duration_ns(&frame(id));
            assert_eq!(arrived_ns, start_ns + duration_ns - 3_000);
            start_ns += duration_ns;
        }
        assert_eq!(medium.busy_ns(), start_ns);
    }

    #[test]
    fn a_station_takes_can_fd_frames_only_on_a_bus_that_is_set_up_for_them() {
        let long = Frame::fd(Id::base(0x201).unwrap(), &[7; 16], true).unwrap();
        let mut classic = Medium::with_master(RATES, 8, 1, 8);
        for station in [0, 1] {
            assert!(!classic.mailbox_mut(station).push(long) && !classic.mailbox_mut(station).put(long));
        }
        assert!(classic.mailbox_mut(0).push(frame(0x201)));
        let mut flexible = Medium::with_master(WireBitRates { data: Some(5_000_000), ..RATES }, 8, 1, 8);
        assert!(flexible.mailbox_mut(0).push(long) && flexible.mailbox_mut(1).put(long));
    }

    #[test]
    fn a_later_frame_does_not_interrupt_the_frame_on_the_wire() {
        let mut medium = Medium::with_master(RATES, 8, 1, 8);
        medium.mailbox_mut(1).push(frame(0x701));
        medium.step(0);
        medium.mailbox_mut(0).push(frame(0x080));
        let order: Vec<_> = run(&mut medium).into_iter().map(|(_, _, id)| id).collect();
        assert_eq!(order, [0x701, 0x080]);
    }
}
