//! The identifiers that a drive uses on its bus.

use takt_rt::{Frame, Id};

use super::erob_canopen;
use crate::config::DriveFamily;

/// A protocol of the vendor that a drive may speak instead of CANopen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherProtocol {
    /// Its name.
    pub name: &'static str,
    /// A request that changes nothing in the drive.
    pub request: Frame,
    /// The identifier of the reply.
    pub answer: Id,
}

/// The protocol that a drive of this family may speak instead of CANopen, if it can be probed for under this node ID.
pub fn other_protocol(family: DriveFamily, node: u8) -> Option<OtherProtocol> {
    match family {
        DriveFamily::ErobCanopen => erob_canopen::other_protocol(node),
        DriveFamily::YzAim => None,
    }
}

/// Every identifier between a drive and its master: those that CANopen gives to its node (CiA 301, 7.3.3), and those of
/// the vendor's own protocol.
pub fn identifiers(family: DriveFamily, node: u8) -> Vec<Id> {
    let canopen = (1..=0xE).map(|function| Id::canopen(function << 7, node));
    let other = other_protocol(family, node);
    canopen.chain(other.into_iter().flat_map(|other| [other.request.id(), other.answer])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_erob_uses_the_identifiers_of_its_own_protocol_beside_those_of_canopen() {
        let erob = identifiers(DriveFamily::ErobCanopen, 2);
        for id in [0x082, 0x182, 0x202, 0x582, 0x602, 0x642, 0x5C2, 0x702] {
            assert!(erob.contains(&Id::base(id).unwrap()), "{id:03X}");
        }
        let yz_aim = identifiers(DriveFamily::YzAim, 2);
        assert!(yz_aim.contains(&Id::base(0x582).unwrap()) && !yz_aim.contains(&Id::base(0x642).unwrap()));
        assert_eq!(
            identifiers(DriveFamily::ErobCanopen, 64).len(),
            14,
            "there they are those of other nodes"
        );
    }
}
