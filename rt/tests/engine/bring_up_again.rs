//! A group goes back to passive, and is enabled only when the host has confirmed that its drives were brought up again.

use crate::fixture::Rig;
use takt_rt::{MAX_AXES, ModeChange, Phase, RejectReason, Request, StopCategory};

/// A disabled group.
fn disabled() -> Rig {
    let mut rig = Rig::enabled(2);
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabled, 100);
    rig
}

/// Sends a request and returns why it was rejected.
fn rejection(rig: &mut Rig, request: Request) -> Option<RejectReason> {
    let before = rig.rejections().len();
    rig.request(request);
    rig.rejections().get(before).map(|rejected| rejected.reason)
}

#[test]
fn a_group_is_enabled_again_only_after_its_bring_up_is_confirmed() {
    let mut rig = disabled();
    rig.request(Request::BringUp);
    assert_eq!((rig.phase(), rig.host.snapshot.groups[0].needs_bring_up), (Phase::Passive, true));
    assert_eq!(rejection(&mut rig, Request::ConfirmBringUp), Some(RejectReason::Phase), "passive");
    // The bring-up has failed.
    rig.request(Request::Activate);
    rig.run(20);
    assert_eq!((rig.phase(), rig.host.snapshot.groups[0].needs_bring_up), (Phase::Disabled, true));
    assert_eq!(rejection(&mut rig, Request::Enable), Some(RejectReason::NotBroughtUp));
    let modes = ModeChange { modes: [None; MAX_AXES] };
    assert_eq!(rejection(&mut rig, Request::ChangeMode(modes)), Some(RejectReason::NotBroughtUp));
    for request in [Request::Stop(StopCategory::Zero), Request::Disable, Request::ResetFaults] {
        assert_eq!(rejection(&mut rig, request), None, "{request:?}");
    }
    assert_eq!(rejection(&mut rig, Request::Enable), Some(RejectReason::NotBroughtUp), "still");

    // The next one succeeds.
    rig.request(Request::BringUp);
    rig.request(Request::Activate);
    rig.run(20);
    assert_eq!(rejection(&mut rig, Request::ConfirmBringUp), None);
    assert!(!rig.host.snapshot.groups[0].needs_bring_up);
    assert_eq!(rejection(&mut rig, Request::Enable), None);
    rig.run_until(Phase::Holding, 150);
    assert_eq!(rejection(&mut rig, Request::ConfirmBringUp), Some(RejectReason::Phase), "holding");
}
