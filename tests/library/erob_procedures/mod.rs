//! eRobs that commands move: the motions of the manuals on the simulated modules, by the vendor's own CAN protocol and by Modbus-RTU, in
//! virtual time.

mod bench;
mod both;
mod modbus;
mod own;
