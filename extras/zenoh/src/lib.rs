//! A takt controller in the graph of ROS 2, without ROS on the robot: joint states are published and joint trajectories received over zenoh,
//! as `rmw_zenoh` of other computers does it.
//!
//! - `names`: the key expressions of topics and of liveliness tokens, and the identifiers of publishers.
//! - `attachment`: what goes beside each message.
//! - `messages`: `sensor_msgs/JointState` and `trajectory_msgs/JointTrajectory` in CDR.
//! - `motion`: a joint trajectory as points of takt.
//! - `inbox`, `carrier`: the trajectories that wait, and the thread that begins them.
//! - `arrival`: what happens to the controller while a trajectory waits.
//! - `bridge`: the session, and the controller of another process.
//!
//! The format is that of `ros2/rmw_zenoh`, `docs/design.md`, from its version 0.2.4 on, which Jazzy, Kilted and Rolling have.

mod arrival;
mod attachment;
mod bridge;
mod carrier;
mod clock;
mod inbox;
mod messages;
mod motion;
mod names;

pub use bridge::{Bridge, BridgeError, Options};
