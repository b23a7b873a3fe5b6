//! Process data that a drive has reported takes the place of what was expected, before anything moves.

use crate::fixture::Rig;
use takt_rt::{
    AxisProcessData, Id, MAX_OBJECTS, MAX_PDOS, MappedObject, MappedPdo, Phase, RejectReason, Request,
    TransmissionType,
};

const CONTROLWORD: MappedObject = MappedObject::new(0x6040, 0, 16);
const TARGET: MappedObject = MappedObject::new(0x607A, 0, 32);
const STATUSWORD: MappedObject = MappedObject::new(0x6041, 0, 16);
const POSITION: MappedObject = MappedObject::new(0x6064, 0, 32);

fn pdo(function: u16, objects: &[MappedObject]) -> MappedPdo {
    let mut mapped = [None; MAX_OBJECTS];
    for (place, object) in mapped.iter_mut().zip(objects) {
        *place = Some(*object);
    }
    MappedPdo { id: Id::canopen(function, 1), transmission: TransmissionType::EveryCycle, objects: mapped }
}

fn data(command: &[MappedObject], feedback: &[MappedObject]) -> AxisProcessData {
    let mut data = AxisProcessData {
        axis: 0,
        commands: [None; MAX_PDOS],
        feedback: [None; MAX_PDOS],
        unused: [None; MAX_PDOS],
    };
    data.commands[0] = Some(pdo(0x300, command));
    data.feedback[0] = Some(pdo(0x180, feedback));
    data
}

#[test]
fn commands_go_out_as_the_drive_maps_them() {
    let mut rig = Rig::new(1);
    let reported = data(&[TARGET, CONTROLWORD], &[STATUSWORD, POSITION]);
    rig.host.requests.extend([Request::ProcessData(reported), Request::Sync(true), Request::Activate]);
    rig.run(20);
    assert_eq!(rig.host.snapshot.rejected, 0);
    let sent = |id: u32| rig.buses[0].sent.iter().filter(move |(_, frame)| frame.id().value() == id);
    assert_eq!(sent(0x201).count(), 0, "nobody listens to RPDO 1 any more");
    let (_, last) = sent(0x301).next_back().unwrap();
    // The target is where the drive is, and follows the joint; behind it the controlword that asks for nothing.
    assert_eq!(last.payload()[..4], 1000_i32.to_le_bytes());
    assert_eq!(last.payload()[4..], [0x06, 0x00]);
}

#[test]
fn a_drive_whose_mapping_is_told_as_it_was_expected_moves_as_ever() {
    let mut rig = Rig::new(1);
    let mut same = data(&[CONTROLWORD, TARGET], &[STATUSWORD, POSITION]);
    same.commands[0] = Some(pdo(0x200, &[CONTROLWORD, TARGET]));
    rig.request(Request::ProcessData(same));
    let mut rig = rig.enable();
    rig.move_to(0.1);
    rig.run_until(Phase::Holding, 5_000);
    assert_eq!((rig.stops(), rig.host.snapshot.rejected), (vec![], 0));
}

#[test]
fn what_cannot_be_exchanged_or_comes_too_late_is_refused_and_changes_nothing() {
    let good = data(&[CONTROLWORD, TARGET], &[STATUSWORD, POSITION]);
    let unknown = MappedObject::new(0x2000, 1, 16);
    // Nobody may give the identifier of its emergency messages up.
    let mut taken = good;
    taken.feedback[0] = Some(pdo(0x280, &[STATUSWORD, POSITION]));
    taken.unused[0] = Some(Id::canopen(0x080, 1));
    let mut rig = Rig::new(1);
    let narrow = MappedObject::new(0x6041, 0, 12);
    for (count, (impossible, reason, axis)) in (1..).zip([
        (AxisProcessData { axis: 7, ..good }, RejectReason::UnknownAxis { axis: 7, axes: 1 }, None),
        (AxisProcessData { feedback: [None; MAX_PDOS], ..good }, RejectReason::NoProcessData, Some(0)),
        (AxisProcessData { commands: [None; MAX_PDOS], ..good }, RejectReason::NoProcessData, Some(0)),
        (
            data(&[CONTROLWORD, unknown], &[STATUSWORD, POSITION]),
            RejectReason::Mapping { object: unknown },
            Some(0),
        ),
        (data(&[CONTROLWORD, TARGET], &[narrow]), RejectReason::Mapping { object: narrow }, Some(0)),
        (taken, RejectReason::IdTaken { id: Id::canopen(0x080, 1) }, Some(0)),
    ]) {
        rig.request(Request::ProcessData(impossible));
        assert_eq!(rig.host.snapshot.rejected, count, "{impossible:?}");
        let rejection = rig.rejections().pop().unwrap();
        assert_eq!((rejection.reason, rejection.axis), (reason, axis));
    }
    let mut rig = rig.enable();
    let refused = rig.host.snapshot.rejected;
    rig.request(Request::ProcessData(good));
    assert_eq!((rig.host.snapshot.rejected, rig.phase()), (refused + 1, Phase::Holding));
    rig.move_to(0.1);
    rig.run_until(Phase::Holding, 5_000);
    assert_eq!(rig.stops(), []);
}

#[test]
fn a_torque_that_the_drive_maps_beside_what_was_expected_is_shown() {
    let torque = MappedObject::new(0x6077, 0, 16);
    let mut rig = Rig::new(1);
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(20);
    assert_eq!(rig.host.snapshot.axes[0].torque, None);
    let mut rig = Rig::new(1);
    let reported = data(&[CONTROLWORD, TARGET], &[STATUSWORD, torque]);
    rig.host.requests.extend([Request::ProcessData(reported), Request::Sync(true), Request::Activate]);
    rig.run(20);
    // The low bytes of the drive's position, 1000 counts, stand where the torque is: its rated one.
    assert_eq!(rig.host.snapshot.axes[0].torque, Some(31.0));
}
