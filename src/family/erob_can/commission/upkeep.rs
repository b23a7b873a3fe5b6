//! Saving, the node ID, the brake, faults, and the count of turns.

use takt_wire::erob_can::entries;
use takt_wire::erob_can::frame::NODES;

use super::super::module;
use crate::family::commission::{Failure, Report, TargetDrive};
use crate::family::erob::module::CommandedModule as _;
use crate::family::erob::tasks;
use crate::family::erob_can::session::ErobCanSession;

/// `save`
pub async fn save(c: &ErobCanSession, s: &TargetDrive) -> Result<Report, Failure> {
    c.connect(s).await?;
    module::save(c).await?;
    let mut report = Report::new();
    report.add("saved", "saved", true, "the parameters are kept without power");
    Ok(report)
}

/// `set-id`
pub async fn set_id(c: &ErobCanSession, s: &TargetDrive, node: u8) -> Result<Report, Failure> {
    if !NODES.contains(&node) {
        return Err(Failure::Unsuitable(format!(
            "an eRob with its own protocol has a node ID from 1 to 64, not {node}"
        )));
    }
    c.connect(s).await?;
    tasks::check_standstill(c).await?;
    c.step("set the node ID");
    c.write(&entries::CAN_ADDRESS, node.into()).await?;
    module::save(c).await?;
    c.note("switch the drive off and on: it has the new node ID then");
    let mut report = Report::new();
    report.add("node", "node ID", node, format!("{node}, after the next power-on"));
    Ok(report)
}

/// `release-brake`
pub async fn release_brake(
    c: &ErobCanSession,
    s: &TargetDrive,
    is_confirmed: bool,
) -> Result<Report, Failure> {
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this releases the brake without torque: nothing holds the joint, and a load falls",
            option: "--yes",
        });
    }
    c.connect(s).await?;
    tasks::check_standstill(c).await?;
    module::release_brake(c).await?;
    c.note("the brake is released, and nothing holds the joint; Ctrl-C applies it again");
    c.step("brake released");
    let watched = watch_until_interrupted(c, s).await;
    c.ignore_interruptions();
    c.step("apply the brake");
    c.write(&entries::MOTOR_ENABLE, 0).await?;
    watched?;
    tasks::summary(c, s).await
}

/// Shows readings until the user ends it.
async fn watch_until_interrupted(c: &ErobCanSession, s: &TargetDrive) -> Result<(), Failure> {
    const EVERY_NS: u64 = 100_000_000;
    while !c.is_interrupted() {
        c.show(c.status().await?.reading(c.now_ns(), s));
        c.pause(EVERY_NS).await;
    }
    Ok(())
}

/// `zero`: resets the encoder on the load's side, which wipes the count of turns. The position within one turn remains.
pub async fn clear_turns(c: &ErobCanSession, s: &TargetDrive, is_confirmed: bool) -> Result<Report, Failure> {
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this WIPES THE COUNT OF TURNS (index 0114): the position becomes the one within a turn, and \
                          the joint's zero must be set again; it is meant for multi-turn models after a battery alarm",
            option: "--yes",
        });
    }
    c.connect(s).await?;
    tasks::check_standstill(c).await?;
    let before = c.read(&entries::ACTUAL_POSITION).await?;
    module::reset_encoder(c).await?;
    let after = c.read(&entries::ACTUAL_POSITION).await?;
    let mut report = Report::new();
    report.add("before_counts", "before", before, format!("{before} counts"));
    report.add("after_counts", "after", after, format!("{after} counts"));
    let position = s.position(after.into());
    report.add("position", "position", position, s.position_quantity().show(position));
    c.note(format!(
        "to make this position the joint's zero, set `zero_counts = {after}` in the configuration"
    ));
    Ok(report)
}

/// `clear-fault`: the protocol has no command for it. Disabling ends a fault whose cause is gone.
pub async fn clear_fault(c: &ErobCanSession, s: &TargetDrive) -> Result<Report, Failure> {
    c.connect(s).await?;
    c.step("read the error code");
    let before = c.read(&entries::ERROR_CODE).await?;
    tasks::come_to_rest(c, s).await?;
    c.step("read the error code");
    let after = c.read(&entries::ERROR_CODE).await?;
    if after != 0 {
        return Err(Failure::FaultPersists {
            what: s.error_words(after as u16),
            advice: Some(
                "the protocol has no command that clears it: mend the cause, then switch the power off and on; after a \
                 battery alarm of a multi-turn model use `zero`",
            ),
        });
    }
    let mut report = Report::new();
    let words = if before == 0 { "there was no error".into() } else { s.error_words(before as u16) };
    report.add("cleared", "cleared", before, words);
    Ok(report)
}
