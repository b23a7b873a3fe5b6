//! Finds the nodes on the bus.

use std::collections::BTreeSet;

use serde_json::Value;
use takt_rt::{Frame, Nanoseconds};
use takt_wire::canopen::objects::DEVICE_TYPE;
use takt_wire::canopen::sdo::{SdoError, SdoRequest};

use super::failure::Failure;
use super::report::Report;
use super::sdo_session::SdoSession;

/// Interval between two SDO requests.
const QUESTION_NS: Nanoseconds = 2_000_000;
/// Wait for answers and heartbeats. Most devices send a heartbeat at least once a second.
const ANSWER_NS: Nanoseconds = 1_200_000_000;
/// COB-ID functions that nodes transmit: EMCY, TPDO1 to 4, SDO response, error control.
const FUNCTIONS: [u32; 7] = [0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700];

/// `scan`
pub async fn scan(c: &SdoSession) -> Result<Report, Failure> {
    let mut nodes = others(c).await?;
    c.step("scan");
    match c.upload(DEVICE_TYPE.address).await? {
        Err(SdoError::NoReply { .. }) => {}
        Ok(_) | Err(_) => nodes.push(c.node()),
    }
    nodes.sort_unstable();
    Ok(report(&nodes, |_| "answers".to_owned()))
}

/// The result of a scan: the node IDs, and a text for each.
pub fn report(nodes: &[u8], words: impl Fn(u8) -> String) -> Report {
    let mut report = Report::new();
    for node in nodes {
        report.add("", &format!("node {node}"), Value::Null, words(*node));
    }
    if nodes.is_empty() {
        report.add("", "nodes", Value::Null, "none has answered");
    }
    report.under("nodes", nodes.into())
}

/// The other nodes that answer an SDO upload of object 1000, or that send any frame.
pub async fn others(c: &SdoSession) -> Result<Vec<u8>, Failure> {
    c.step("scan for other nodes");
    let own = c.node();
    c.begin_collecting();
    for node in (1..=127).filter(|node| *node != own) {
        c.send(SdoRequest::Upload { object: DEVICE_TYPE.address }.frame(node));
        c.pause(QUESTION_NS).await?;
    }
    c.pause(ANSWER_NS).await?;
    let nodes: BTreeSet<u8> =
        c.end_collecting().iter().filter_map(sender).filter(|node| *node != own).collect();
    Ok(nodes.into_iter().collect())
}

fn sender(frame: &Frame) -> Option<u8> {
    let id = frame.id().value();
    let node = u8::try_from(id & 0x7F).ok()?;
    (!frame.id().is_extended() && node > 0 && FUNCTIONS.contains(&(id & 0x780))).then_some(node)
}
