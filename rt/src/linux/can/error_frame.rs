//! The meaning of error frames, in which a driver reports errors and states (`linux/can/error.h`).

use crate::port::BusState;

/// The meaning of one error frame for the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Report {
    /// The state that the controller has entered; `None` if the frame does not say.
    pub(super) state: Option<BusState>,
    /// True if the driver has dropped the frames that it still had to send. It does so at bus-off and at the restart.
    pub(super) has_dropped_transmissions: bool,
    /// True if this is an error. A controller that recovers sends a report too, which is not an error.
    pub(super) is_error: bool,
    /// True if the controller has lost a received frame.
    pub(super) has_lost_received: bool,
}

/// The index of the data byte with the details of `CAN_ERR_CRTL`.
const CONTROLLER_DETAIL: usize = 1;

/// Reads an error frame: the error classes in its identifier and the details in its data.
pub(super) fn read(class: u32, details: [u8; 8]) -> Report {
    let controller = if class & libc::CAN_ERR_CRTL != 0 {
        i32::from(details.get(CONTROLLER_DETAIL).copied().unwrap_or(0))
    } else {
        0
    };
    let is_off = class & libc::CAN_ERR_BUSOFF != 0;
    let is_restarted = class & libc::CAN_ERR_RESTARTED != 0;
    let is_recovery = is_restarted || controller == libc::CAN_ERR_CRTL_ACTIVE;
    Report {
        state: match () {
            () if is_off => Some(BusState::BusOff),
            () if is_restarted => Some(BusState::ErrorActive),
            () => controller_state(controller),
        },
        has_dropped_transmissions: is_off || is_restarted,
        // A lost arbitration is normal on a bus. A driver reports it only on request.
        is_error: !is_recovery && class & !(libc::CAN_ERR_LOSTARB | libc::CAN_ERR_CNT) != 0,
        has_lost_received: controller & libc::CAN_ERR_CRTL_RX_OVERFLOW != 0,
    }
}

/// The worse of the transmitter's and the receiver's state. The warning level (96) is still error-active.
fn controller_state(controller: i32) -> Option<BusState> {
    let passive = libc::CAN_ERR_CRTL_RX_PASSIVE | libc::CAN_ERR_CRTL_TX_PASSIVE;
    let active = libc::CAN_ERR_CRTL_ACTIVE | libc::CAN_ERR_CRTL_RX_WARNING | libc::CAN_ERR_CRTL_TX_WARNING;
    if controller & passive != 0 {
        Some(BusState::ErrorPassive)
    } else if controller & active != 0 {
        Some(BusState::ErrorActive)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controller(detail: i32) -> Report {
        read(libc::CAN_ERR_CRTL, [0, detail as u8, 0, 0, 0, 0, 0, 0])
    }

    #[test]
    fn fault_confinement_states_are_read() {
        assert_eq!(controller(libc::CAN_ERR_CRTL_TX_PASSIVE).state, Some(BusState::ErrorPassive));
        assert_eq!(controller(libc::CAN_ERR_CRTL_RX_PASSIVE).state, Some(BusState::ErrorPassive));
        assert_eq!(controller(libc::CAN_ERR_CRTL_TX_WARNING).state, Some(BusState::ErrorActive));
        assert_eq!(controller(libc::CAN_ERR_CRTL_ACTIVE).state, Some(BusState::ErrorActive));
        assert_eq!(read(libc::CAN_ERR_BUSOFF, [0; 8]).state, Some(BusState::BusOff));
        assert_eq!(read(libc::CAN_ERR_RESTARTED, [0; 8]).state, Some(BusState::ErrorActive));
        assert_eq!(read(libc::CAN_ERR_ACK | libc::CAN_ERR_BUSERROR, [0; 8]).state, None);
    }

    #[test]
    fn the_details_count_only_when_their_class_is_named() {
        let passive = [0, libc::CAN_ERR_CRTL_TX_PASSIVE as u8, 0, 0, 0, 0, 0, 0];
        assert_eq!(read(libc::CAN_ERR_PROT, passive).state, None);
    }

    #[test]
    fn leaving_the_bus_and_coming_back_lose_what_was_queued() {
        assert!(read(libc::CAN_ERR_BUSOFF, [0; 8]).has_dropped_transmissions);
        assert!(read(libc::CAN_ERR_RESTARTED, [0; 8]).has_dropped_transmissions);
        assert!(!controller(libc::CAN_ERR_CRTL_TX_PASSIVE).has_dropped_transmissions);
    }

    #[test]
    fn recoveries_and_lost_arbitration_are_not_errors() {
        assert!(!read(libc::CAN_ERR_RESTARTED, [0; 8]).is_error);
        assert!(!controller(libc::CAN_ERR_CRTL_ACTIVE).is_error);
        assert!(!read(libc::CAN_ERR_LOSTARB, [0; 8]).is_error);
        assert!(read(libc::CAN_ERR_ACK, [0; 8]).is_error);
        assert!(controller(libc::CAN_ERR_CRTL_TX_PASSIVE).is_error);
    }

    #[test]
    fn a_receive_overflow_of_the_controller_is_a_loss() {
        assert!(controller(libc::CAN_ERR_CRTL_RX_OVERFLOW).has_lost_received);
        assert!(!controller(libc::CAN_ERR_CRTL_TX_OVERFLOW).has_lost_received);
    }
}
