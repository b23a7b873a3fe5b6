//! The objects of CiA 402 that PDOs carry, with their lengths in bits.

use takt_rt::MappedObject;

pub const CONTROLWORD: MappedObject = MappedObject::new(0x6040, 0, 16);
pub const TARGET_POSITION: MappedObject = MappedObject::new(0x607A, 0, 32);
pub const TARGET_VELOCITY: MappedObject = MappedObject::new(0x60FF, 0, 32);
pub const TARGET_TORQUE: MappedObject = MappedObject::new(0x6071, 0, 16);
pub const VELOCITY_OFFSET: MappedObject = MappedObject::new(0x60B1, 0, 32);
pub const TORQUE_OFFSET: MappedObject = MappedObject::new(0x60B2, 0, 16);
pub const OPERATION_MODE: MappedObject = MappedObject::new(0x6060, 0, 8);
pub const STATUSWORD: MappedObject = MappedObject::new(0x6041, 0, 16);
pub const POSITION: MappedObject = MappedObject::new(0x6064, 0, 32);
pub const OPERATION_MODE_DISPLAY: MappedObject = MappedObject::new(0x6061, 0, 8);
pub const VELOCITY: MappedObject = MappedObject::new(0x606C, 0, 32);
pub const TORQUE: MappedObject = MappedObject::new(0x6077, 0, 16);
pub const CURRENT: MappedObject = MappedObject::new(0x6078, 0, 16);
pub const ERROR_CODE: MappedObject = MappedObject::new(0x603F, 0, 16);
