//! The heartbeats between drive and master (objects 1016 and 1017). Without them a drive does not react when the master
//! fails.

use takt_wire::canopen::objects::{CONSUMER_HEARTBEAT_TIME, PRODUCER_HEARTBEAT_TIME};

use super::axis_session::{AxisSession, StepResult};
use super::axis_units::rounded_up;

/// Sets the period of the drive's own heartbeat; 0 if none is configured.
pub async fn produce(c: &AxisSession<'_>) -> StepResult {
    c.step("heartbeat", "choose heartbeat times that this drive accepts");
    let period_ms = c.axis.heartbeat_ns.map_or(0, |period_ns| rounded_up(period_ns, 1_000_000));
    c.write_and_read_back(PRODUCER_HEARTBEAT_TIME, period_ms).await
}

/// Lets the drive watch the master's heartbeat, if it has one: 1016:1 has the master's node ID and the timeout.
pub async fn watch_master(c: &AxisSession<'_>) -> StepResult {
    let master = &c.config.master;
    let watched = master.heartbeat_ns.map_or(0, |_| {
        let timeout_ms = rounded_up(master.heartbeat_timeout_ns, 1_000_000).min(u16::MAX.into());
        i64::from(master.node) << 16 | timeout_ms
    });
    c.write_and_read_back(CONSUMER_HEARTBEAT_TIME, watched).await
}

/// Lets the drive watch the master no longer.
///
/// A drive whose shut-down has failed may still have torque, and obeys nothing: its watchdog alone may still stop it. So it keeps it.
pub async fn end_watch(c: &AxisSession<'_>, advice: &'static str) -> StepResult {
    if c.has_failed() {
        return Ok(());
    }
    c.step("end of heartbeats", advice);
    c.write_and_read_back(CONSUMER_HEARTBEAT_TIME, 0).await
}
