//! Tx/rx accounting: the counters of a port and the state of its bus, without any input or output.

use super::super::wire_time::WireTime;
use super::arrival::{Arrival, Sender};
use super::error_frame;
use super::in_flight::InFlight;
use super::wire_format::Message;
use crate::frame::{Frame, FrameKind};
use crate::port::{BusHealth, BusState};

/// Own frames that come back without any error until a controller counts as error-active again, where its driver does not say so. From the
/// highest count that is not bus-off, 128 frames lead back to error-active (ISO 11898-1); the rest is for drivers that report changes of the
/// state and no single errors. At 1 ms, six axes send as many in a second and a half.
const RECOVERED_AFTER: u32 = 10_000;

/// The counters of one port and the state of its bus.
#[derive(Clone, Debug, Default)]
pub(super) struct TxRxAccounting {
    /// All but the time that the wire was occupied.
    health: BusHealth,
    wire_time: WireTime,
    /// Frames that the kernel took and that have not come back from the wire. The kernel does not mark those that another socket of
    /// this process sent as our own when they come back: they are recognised by their content.
    in_flight: InFlight,
    /// True if a frame was still unconfirmed when the socket was last read empty.
    is_behind: bool,
    /// The overflow counter of the socket at its last reading.
    lost: u32,
    /// What has passed the wire since the last error.
    since_error: SinceError,
}

/// What has passed the wire since the last error.
#[derive(Clone, Copy, Debug, Default)]
struct SinceError {
    /// Own frames that came back.
    sent: u32,
    /// True if a frame of another sender was received, which leads a receiver back to error-active (ISO 11898-1).
    has_received: bool,
}

impl TxRxAccounting {
    /// Accounting for a bus with these bit rates (bit/s). Only the time that the wire is occupied depends on them.
    pub(super) fn new(bit_rate: u32, data_bit_rate: Option<u32>) -> Self {
        Self { wire_time: WireTime::new(bit_rate, data_bit_rate), ..Self::default() }
    }

    /// The bus is in this state: a driver reports changes alone.
    pub(super) const fn begin_in(&mut self, state: BusState) {
        self.health.state = state;
    }

    /// The state of the bus and its counters.
    pub(super) fn health(&self) -> BusHealth {
        BusHealth { busy_ns: self.wire_time.busy_ns(), ..self.health }
    }

    /// Returns `true` if the interface does not send.
    pub(super) fn is_down(&self) -> bool {
        self.health.state == BusState::Down
    }

    /// How many own frames have not come back from the wire.
    pub(super) fn unconfirmed(&self) -> usize {
        self.in_flight.count()
    }

    /// Notes that everything that had arrived has been read. A frame that a later one has overtaken was lost: it is an error, and
    /// holds nothing back.
    pub(super) fn read_empty(&mut self) {
        self.health.errors += self.in_flight.end_reading() as u64;
        self.is_behind = self.unconfirmed() > 0;
    }

    /// Returns `true` if own frames still waited for the wire when the socket was last read empty.
    pub(super) const fn is_behind(&self) -> bool {
        self.is_behind
    }

    /// Counts frames that the kernel took.
    ///
    /// Remote frames count as sent at once. The kernel's filters of one identifier each let only data frames pass, so a
    /// remote frame does not come back.
    pub(super) fn taken(&mut self, frames: &[Frame]) {
        self.add(frames, Sender::ThisSocket);
    }

    /// As [`TxRxAccounting::taken`], for frames that another socket of this process sent to this port's interface.
    ///
    /// Such a frame is recognised by its content when it comes back. Another process of this machine can send an equal frame
    /// meanwhile. Then the first of both counts as ours, and the second one as received from another sender.
    pub(super) fn taken_by_another(&mut self, frames: &[Frame]) {
        self.add(frames, Sender::ThisMachine);
    }

    fn add(&mut self, frames: &[Frame], sender: Sender) {
        for frame in frames {
            match frame.kind() {
                FrameKind::Remote => self.health.tx_frames += 1,
                _ => self.in_flight.add(*frame, sender),
            }
        }
        if self.is_down() && !frames.is_empty() {
            self.health.state = BusState::ErrorActive;
        }
    }

    /// Counts `frames` frames that the kernel did not take, by its error number.
    ///
    /// A full socket buffer (`EAGAIN`) and a full queue of the interface (`ENOBUFS`) are one condition: earlier frames still
    /// wait for the bus.
    pub(super) fn refused(&mut self, frames: usize, errno: i32) {
        match errno {
            libc::EAGAIN | libc::ENOBUFS => self.health.tx_overruns += frames as u64,
            libc::ENETDOWN | libc::ENODEV | libc::ENXIO => self.down(),
            _ => self.health.errors += frames as u64,
        }
    }

    /// Counts a receive call that failed with this error number.
    pub(super) fn receive_failed(&mut self, errno: i32) {
        match errno {
            libc::ENETDOWN | libc::ENODEV | libc::ENXIO => self.down(),
            _ => self.health.errors += 1,
        }
    }

    /// Counts a message from the socket. Returns its frame if somebody else sent it.
    pub(super) fn arrived(&mut self, arrival: &Arrival) -> Option<Frame> {
        self.count_losses(arrival.lost);
        if let Message::Frame(frame) = &arrival.message {
            self.wire_time.add(frame);
        }
        match arrival.message {
            Message::Frame(frame) if self.is_own(&frame, arrival.sender) => {
                self.health.tx_frames += u64::from(frame.kind() != FrameKind::Remote);
                self.since_error.sent = self.since_error.sent.saturating_add(1);
                self.recover();
                None
            }
            Message::Frame(frame) => {
                self.health.rx_frames += 1;
                self.since_error.has_received |= arrival.sender == Sender::Wire;
                self.recover();
                Some(frame)
            }
            Message::Error { class, details } => {
                self.reported(error_frame::read(class, details));
                None
            }
            Message::Unknown => {
                self.health.errors += 1;
                None
            }
        }
    }

    fn is_own(&mut self, frame: &Frame, sender: Sender) -> bool {
        match sender {
            // A frame that is waited for no longer is own, too.
            Sender::ThisSocket => {
                self.in_flight.take(frame, sender);
                true
            }
            Sender::ThisMachine => self.in_flight.take(frame, sender),
            Sender::Wire => false,
        }
    }

    /// Ends the error-passive state when enough has passed the wire without an error.
    fn recover(&mut self) {
        let SinceError { sent, has_received } = self.since_error;
        if self.health.state == BusState::ErrorPassive && sent >= RECOVERED_AFTER && has_received {
            self.health.state = BusState::ErrorActive;
        }
    }

    fn reported(&mut self, report: error_frame::Report) {
        if report.is_error {
            self.since_error = SinceError::default();
        }
        if let Some(state) = report.state {
            self.health.state = state;
        }
        if report.has_dropped_transmissions {
            self.forget_transmissions();
        }
        self.health.errors += u64::from(report.is_error);
        self.health.rx_overruns += u64::from(report.has_lost_received);
    }

    /// Counts the messages that the socket lost, by its overflow counter, which wraps around at 2³².
    ///
    /// Any lost message may have been a confirmation, so all of them count as confirmations. A confirmation too many is
    /// ignored. With one too few the set-points would be held back for ever.
    fn count_losses(&mut self, lost: Option<u32>) {
        let Some(lost) = lost else { return };
        let more = lost.wrapping_sub(self.lost);
        self.lost = lost;
        self.health.rx_overruns += u64::from(more);
        self.in_flight.give_up(usize::try_from(more).unwrap_or(usize::MAX));
    }

    /// The interface does not send the frames that it takes. A controller in the bus-off state does not send either, and
    /// keeps that state, which says more.
    pub(super) fn link_lost(&mut self) {
        if self.health.state != BusState::BusOff {
            self.down();
        }
    }

    /// An interface that goes down drops the frames that it still had to send.
    fn down(&mut self) {
        self.health.state = BusState::Down;
        self.forget_transmissions();
    }

    fn forget_transmissions(&mut self) {
        self.in_flight.clear();
        self.is_behind = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Id;

    fn frame(node: u8) -> Frame {
        Frame::of(Id::canopen(0x200, node), [1, 2, 3])
    }

    fn arrival(message: Message, sender: Sender) -> Arrival {
        Arrival { message, sender, real_time_ns: None, lost: None }
    }

    fn error(class: u32) -> Arrival {
        arrival(Message::Error { class, details: [0; 8] }, Sender::Wire)
    }

    #[test]
    fn a_frame_counts_as_sent_when_it_has_come_back() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1), frame(2)]);
        assert_eq!((accounting.unconfirmed(), accounting.health().tx_frames), (2, 0));
        assert_eq!(accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::ThisSocket)), None);
        assert_eq!((accounting.unconfirmed(), accounting.health().tx_frames), (1, 1));
        assert_eq!(accounting.arrived(&arrival(Message::Frame(frame(7)), Sender::Wire)), Some(frame(7)));
        assert_eq!((accounting.unconfirmed(), accounting.health().rx_frames), (1, 1));
    }

    #[test]
    fn a_bus_is_behind_from_a_reading_without_the_confirmation_to_the_next_one() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1)]);
        assert!(!accounting.is_behind());
        accounting.read_empty();
        assert!(accounting.is_behind());
        accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::ThisSocket));
        assert!(accounting.is_behind());
        accounting.read_empty();
        accounting.taken(&[frame(2)]);
        assert!(!accounting.is_behind());
        accounting.read_empty();
        accounting.receive_failed(libc::ENETDOWN);
        assert!(!accounting.is_behind());
    }

    #[test]
    fn a_frame_that_another_socket_sent_for_this_port_is_known_again_as_often_as_it_was_sent() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken_by_another(&[frame(1), frame(2)]);
        assert_eq!(accounting.unconfirmed(), 2);
        // The wire decides about the order.
        assert_eq!(accounting.arrived(&arrival(Message::Frame(frame(2)), Sender::ThisMachine)), None);
        assert_eq!(accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::ThisMachine)), None);
        assert_eq!(
            (accounting.unconfirmed(), accounting.health().tx_frames, accounting.health().rx_frames),
            (0, 2, 0)
        );
        let too_many = accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::ThisMachine));
        assert_eq!((too_many, accounting.health().rx_frames), (Some(frame(1)), 1));
    }

    #[test]
    fn nobody_elses_frame_is_a_confirmation_however_like_it_is() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken_by_another(&[frame(1)]);
        assert_eq!(accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::Wire)), Some(frame(1)));
        assert_eq!(
            accounting.arrived(&arrival(Message::Frame(frame(2)), Sender::ThisMachine)),
            Some(frame(2))
        );
        assert_eq!(accounting.unconfirmed(), 1);
    }

    #[test]
    fn confirmations_that_are_lost_leave_room_for_those_to_come() {
        let mut accounting = TxRxAccounting::default();
        for node in (1..=100).cycle().take(1_000) {
            accounting.taken_by_another(&[frame(node)]);
        }
        // The last 128 of them are remembered.
        let mut arrives =
            |node| accounting.arrived(&arrival(Message::Frame(frame(node)), Sender::ThisMachine));
        assert_eq!([arrives(100), arrives(100)], [None, None]);
        assert_eq!([arrives(1), arrives(1)], [None, Some(frame(1))]);
        accounting.receive_failed(libc::ENETDOWN);
        assert_eq!(
            accounting.arrived(&arrival(Message::Frame(frame(99)), Sender::ThisMachine)),
            Some(frame(99))
        );
    }

    #[test]
    fn a_lost_confirmation_is_an_error_and_holds_nothing_back_when_a_later_frame_has_come_back() {
        for by_another in [false, true] {
            let mut accounting = TxRxAccounting::default();
            let sender = if by_another { Sender::ThisMachine } else { Sender::ThisSocket };
            let send = |accounting: &mut TxRxAccounting, node| match by_another {
                true => accounting.taken_by_another(&[frame(node)]),
                false => accounting.taken(&[frame(node)]),
            };
            send(&mut accounting, 1);
            (0..1_000).for_each(|_| accounting.read_empty());
            assert_eq!((accounting.unconfirmed(), accounting.is_behind()), (1, true), "it may still wait");
            send(&mut accounting, 2);
            accounting.arrived(&arrival(Message::Frame(frame(2)), sender));
            accounting.read_empty();
            assert_eq!((accounting.unconfirmed(), accounting.is_behind()), (0, false));
            assert_eq!((accounting.health().tx_frames, accounting.health().errors), (1, 1));
            // It comes after all, and is nobody else's frame.
            assert_eq!(accounting.arrived(&arrival(Message::Frame(frame(1)), sender)), None);
            assert_eq!((accounting.health().tx_frames, accounting.health().rx_frames), (2, 0));
        }
    }

    #[test]
    fn remote_frames_are_not_waited_for_whether_they_come_back_or_not() {
        let mut accounting = TxRxAccounting::default();
        let remote = Frame::remote(Id::canopen(0x700, 1), 1).unwrap();
        accounting.taken(&[remote, frame(1)]);
        assert_eq!(accounting.unconfirmed(), 1);
        accounting.arrived(&arrival(Message::Frame(remote), Sender::ThisSocket));
        assert_eq!((accounting.unconfirmed(), accounting.health().tx_frames), (1, 1));
    }

    #[test]
    fn a_full_socket_and_a_full_interface_are_one_condition() {
        let mut accounting = TxRxAccounting::default();
        accounting.refused(2, libc::EAGAIN);
        accounting.refused(3, libc::ENOBUFS);
        assert_eq!(accounting.health(), BusHealth { tx_overruns: 5, ..BusHealth::default() });
    }

    #[test]
    fn an_interface_that_goes_down_forgets_what_was_queued_and_is_up_when_it_takes_frames_again() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1)]);
        accounting.receive_failed(libc::ENETDOWN);
        assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::Down, 0));
        accounting.refused(1, libc::ENETDOWN);
        assert_eq!(accounting.health().state, BusState::Down);
        assert_eq!(accounting.health().tx_overruns, 0);
        accounting.taken(&[]);
        assert_eq!(accounting.health().state, BusState::Down);
        accounting.taken(&[frame(1)]);
        assert_eq!(accounting.health().state, BusState::ErrorActive);
    }

    #[test]
    fn whatever_says_that_there_is_no_interface_is_one_condition_at_once() {
        for errno in [libc::ENETDOWN, libc::ENODEV, libc::ENXIO] {
            let (mut sending, mut receiving) = (TxRxAccounting::default(), TxRxAccounting::default());
            sending.taken(&[frame(1)]);
            sending.refused(1, errno);
            receiving.taken(&[frame(1)]);
            receiving.receive_failed(errno);
            for accounting in [sending, receiving] {
                assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::Down, 0));
                assert_eq!((accounting.health().tx_overruns, accounting.health().errors), (0, 0));
            }
        }
    }

    #[test]
    fn an_interface_that_drops_what_it_takes_is_down_unless_its_controller_has_left_the_bus() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1), frame(2)]);
        accounting.link_lost();
        assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::Down, 0));
        // It takes frames for as long as it goes down.
        accounting.taken(&[frame(1)]);
        accounting.link_lost();
        assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::Down, 0));

        let mut accounting = TxRxAccounting::default();
        accounting.arrived(&error(libc::CAN_ERR_BUSOFF));
        accounting.taken(&[frame(1)]);
        accounting.link_lost();
        assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::BusOff, 1));
    }

    #[test]
    fn bus_off_drops_what_was_queued_and_lasts_until_the_restart() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1), frame(2)]);
        accounting.arrived(&error(libc::CAN_ERR_BUSOFF));
        assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::BusOff, 0));
        accounting.taken(&[frame(1)]);
        assert_eq!(accounting.health().state, BusState::BusOff);
        accounting.arrived(&error(libc::CAN_ERR_RESTARTED));
        assert_eq!((accounting.health().state, accounting.unconfirmed()), (BusState::ErrorActive, 0));
        assert_eq!(accounting.health().errors, 1);
    }

    #[test]
    fn an_error_passive_controller_is_active_again_when_enough_has_passed_without_an_error() {
        let passive = || {
            let details = [0, libc::CAN_ERR_CRTL_TX_PASSIVE as u8, 0, 0, 0, 0, 0, 0];
            arrival(Message::Error { class: libc::CAN_ERR_CRTL, details }, Sender::Wire)
        };
        let own = arrival(Message::Frame(frame(1)), Sender::ThisSocket);
        let foreign = arrival(Message::Frame(frame(9)), Sender::Wire);
        let mut reported = TxRxAccounting::default();
        reported.arrived(&passive());
        let mut begun = TxRxAccounting::default();
        begun.begin_in(BusState::ErrorPassive);
        for mut accounting in [reported, begun] {
            (0..2 * RECOVERED_AFTER).for_each(|_| assert_eq!(accounting.arrived(&own), None));
            assert_eq!(accounting.health().state, BusState::ErrorPassive, "it may be passive as a receiver");
            accounting.arrived(&foreign);
            assert_eq!(accounting.health().state, BusState::ErrorActive);

            accounting.arrived(&passive());
            accounting.arrived(&foreign);
            (1..RECOVERED_AFTER).for_each(|_| assert_eq!(accounting.arrived(&own), None));
            accounting.arrived(&error(libc::CAN_ERR_PROT));
            accounting.arrived(&foreign);
            (1..RECOVERED_AFTER).for_each(|_| assert_eq!(accounting.arrived(&own), None));
            assert_eq!(accounting.health().state, BusState::ErrorPassive);
            accounting.arrived(&own);
            assert_eq!(accounting.health().state, BusState::ErrorActive);
        }
    }

    #[test]
    fn a_controller_that_has_left_the_bus_comes_back_by_its_restart_alone() {
        let mut accounting = TxRxAccounting::default();
        accounting.begin_in(BusState::BusOff);
        accounting.arrived(&arrival(Message::Frame(frame(9)), Sender::Wire));
        for _ in 0..2 * RECOVERED_AFTER {
            accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::ThisSocket));
        }
        assert_eq!(accounting.health().state, BusState::BusOff);
    }

    #[test]
    fn lost_messages_are_counted_once_and_hold_nothing_back() {
        let mut accounting = TxRxAccounting::default();
        accounting.taken(&[frame(1), frame(2), frame(3)]);
        let mut with_losses = arrival(Message::Frame(frame(9)), Sender::Wire);
        with_losses.lost = Some(2);
        accounting.arrived(&with_losses);
        accounting.arrived(&with_losses);
        assert_eq!((accounting.health().rx_overruns, accounting.unconfirmed()), (2, 1));
        with_losses.lost = Some(u32::MAX);
        accounting.arrived(&with_losses);
        with_losses.lost = Some(1);
        accounting.arrived(&with_losses);
        assert_eq!((accounting.health().rx_overruns, accounting.unconfirmed()), (u64::from(u32::MAX) + 2, 0));
    }

    #[test]
    fn the_wire_is_occupied_by_frames_of_either_side_for_as_long_as_they_are() {
        let mut accounting = TxRxAccounting::new(500_000, None);
        accounting.taken(&[frame(1)]);
        assert_eq!(accounting.health().busy_ns, 0);
        accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::ThisSocket));
        accounting.arrived(&arrival(Message::Frame(frame(1)), Sender::Wire));
        accounting.arrived(&error(libc::CAN_ERR_ACK));
        // Two frames of 47 bits and three bytes, at 2 µs a bit.
        assert_eq!(accounting.health().busy_ns, 2 * (47 + 24) * 2_000);
    }

    #[test]
    fn the_data_phase_of_a_frame_occupies_the_wire_at_its_own_bit_rate() {
        let long = Frame::fd(Id::canopen(0x200, 1), &[7; 64], true).unwrap();
        let mut accounting = TxRxAccounting::new(1_000_000, Some(5_000_000));
        accounting.arrived(&arrival(Message::Frame(long), Sender::Wire));
        assert_eq!(accounting.health().busy_ns, 30 * 1_000 + (5 + 512 + 25 + 7) * 200);
    }

    #[test]
    fn what_is_no_frame_is_an_error() {
        let mut accounting = TxRxAccounting::default();
        assert_eq!(accounting.arrived(&arrival(Message::Unknown, Sender::Wire)), None);
        accounting.refused(2, libc::EINVAL);
        accounting.receive_failed(libc::EIO);
        assert_eq!(accounting.health().errors, 4);
    }
}
