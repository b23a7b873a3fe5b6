//! The simulated bus and the simulated drives from the point of view of a master.

mod bench;
mod canopen_pdo_reader;
mod cia402;
mod data_sheet;
mod device;
mod lengths;
mod motion;
mod network;
mod passing_frames;
mod port;
mod process_data;
mod profiles;
#[path = "../../../../tests/vectors/rows.rs"]
mod rows;
mod sdo;
mod vectors;
mod yz_aim;
mod yz_aim_vectors;
