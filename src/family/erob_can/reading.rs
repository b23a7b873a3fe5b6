//! Readings of the joint.

use crate::erob_can::client::RequestError;
use crate::erob_can::entries;
use crate::family::commission::TargetDrive;
use crate::family::erob_can::session::ErobCanSession;
use crate::procedure::AxisReading;

/// A joint slower than this stands: counts/s. The readings of a joint at rest are not quite 0.
pub const STANDING: i32 = 300;

/// Reads position, velocity and current of the joint of a drive in this state.
pub async fn read(
    session: &ErobCanSession,
    target: &TargetDrive,
    state: &'static str,
) -> Result<AxisReading, RequestError> {
    let position_counts = session.read(&entries::ACTUAL_POSITION).await?.into();
    let velocity = session.read(&entries::ACTUAL_VELOCITY).await?;
    let current_ma = session.read(&entries::MOTOR_CURRENT).await?;
    Ok(AxisReading {
        at_ns: session.now_ns(),
        position: target.position(position_counts),
        position_counts,
        velocity: target.velocity(velocity.into()),
        torque: None,
        current_a: Some(f64::from(current_ma) / 1000.0),
        temperature_c: None,
        statusword: None,
        state,
    })
}

/// As [`read`], with the state and the temperature that the drive tells.
pub async fn read_with_state(
    session: &ErobCanSession,
    target: &TargetDrive,
) -> Result<AxisReading, RequestError> {
    let state = session.read(&entries::TARGET_REACHED_STATE).await?;
    let temperature = session.read(&entries::TEMPERATURE).await?;
    let state = entries::TARGET_REACHED_STATE.meaning(state).unwrap_or("unknown");
    let reading = read(session, target, state).await?;
    Ok(AxisReading { temperature_c: Some(temperature.into()), ..reading })
}
