//! Function codes of the pre-defined connection set (CiA 301, 7.3.3), for [`Id::canopen`](crate::Id::canopen).

/// Network management, without a node ID.
pub const NMT: u16 = 0x000;
/// SYNC, without a node ID.
pub const SYNC: u16 = 0x080;
/// TIME, without a node ID.
pub const TIME: u16 = 0x100;
/// EMCY of a device.
pub const EMERGENCY: u16 = 0x080;
/// TPDO 1 to 4.
pub const TPDO: [u16; 4] = [0x180, 0x280, 0x380, 0x480];
/// RPDO 1 to 4.
pub const RPDO: [u16; 4] = [0x200, 0x300, 0x400, 0x500];
/// SDO server to client.
pub const SDO_RESPONSE: u16 = 0x580;
/// SDO client to server.
pub const SDO_REQUEST: u16 = 0x600;
/// Boot-up and heartbeat.
pub const ERROR_CONTROL: u16 = 0x700;
