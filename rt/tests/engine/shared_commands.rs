//! One command frame for two axes: each drive takes its part and passes over that of the other (dummy mapping).

use crate::fixture::{COUNTS_PER_TURN, Rig, axis_in, parameters, pdos};
use arrayvec::ArrayVec;
use takt_rt::{
    AxisProcessData, CommandPdo, ControlLaw, Engine, EngineParameters, Frame, GroupParameters, Id,
    MappedObject, Mapping, Pdo, Phase, RejectReason, Request, SetUpError, TorqueLimits, TransmissionType,
};

const SHARED: Id = Id::canopen(0x200, 1);
const DUMMY: MappedObject = MappedObject::new(0x0006, 0, 16);

fn own() -> [MappedObject; 2] {
    [MappedObject::new(0x6040, 0, 16), MappedObject::new(0x6071, 0, 16)]
}

fn command(objects: &[MappedObject]) -> ArrayVec<CommandPdo, 4> {
    let pdo = Pdo::classic(SHARED, Mapping::commands(objects).unwrap());
    [CommandPdo { axes: 2, ..CommandPdo::every_cycle(pdo) }].into_iter().collect()
}

/// Three axes in CST, of which the first two share their command.
fn two_of_three() -> EngineParameters {
    let law = ControlLaw::Torque {
        stiffness: 400.0,
        damping: 60.0,
        inertia: 1.0,
        viscous_friction: 5.0,
        coulomb_friction: 0.0,
    };
    let mut parameters = parameters(3);
    for (index, axis) in parameters.axes.iter_mut().enumerate() {
        *axis = axis_in(law, 0, index as u8 + 1);
        axis.torque_limits = TorqueLimits::NONE;
    }
    let [controlword, target] = own();
    pdos(&mut parameters.axes[0]).commands = command(&[controlword, target, DUMMY, DUMMY]);
    pdos(&mut parameters.axes[1]).commands = command(&[DUMMY, DUMMY, controlword, target]);
    parameters
}

fn rig() -> Rig {
    let mut rig = Rig::of(two_of_three());
    rig.drive(0).part_of = Some((SHARED, 0, 4));
    rig.drive(1).part_of = Some((SHARED, 4, 4));
    rig
}

fn commands(rig: &Rig) -> Vec<Frame> {
    let is_command = |frame: &&Frame| (0x201..=0x203).contains(&frame.id().value());
    rig.buses[0].sent.iter().map(|(_, frame)| frame).filter(is_command).copied().collect()
}

#[test]
fn two_axes_that_share_a_frame_move_and_one_frame_leaves_for_both_in_a_cycle() {
    let mut rig = rig().enable();
    rig.move_to(0.5);
    rig.buses[0].sent.clear();
    rig.run(100);
    let commands = commands(&rig);
    assert_eq!(commands.len(), 200);
    for pair in commands.chunks(2) {
        assert_eq!((pair[0].id(), pair[0].length()), (SHARED, 8));
        assert_eq!((pair[1].id(), pair[1].length()), (Id::canopen(0x200, 3), 4));
        let [word_0, word_1] =
            [0, 4].map(|at| u16::from_le_bytes([pair[0].payload()[at], pair[0].payload()[at + 1]]));
        assert_eq!([word_0, word_1], [0x0F; 2], "operation enabled for both");
    }
    rig.run_until(Phase::Holding, 3_000);
    rig.run(1_000);
    let at = (0.5 * COUNTS_PER_TURN / std::f64::consts::TAU) as i32;
    for axis in 0..3 {
        assert!((rig.drive(axis).position - at).abs() < 1_000, "{axis}: {}", rig.drive(axis).position);
    }
    assert!(rig.stops().is_empty());
}

#[test]
fn a_shared_frame_does_not_leave_before_the_part_of_each_axis_is_in_it() {
    let mut rig = rig();
    rig.drive(1).is_silent = true;
    rig.host.requests.extend([Request::Sync(true), Request::Activate]);
    rig.run(20);
    let ids = |rig: &Rig| commands(rig).iter().map(|frame| frame.id().value()).collect::<Vec<_>>();
    assert!(ids(&rig).contains(&0x203) && !ids(&rig).contains(&0x201), "{:X?}", ids(&rig));
    rig.drive(1).is_silent = false;
    rig.run(5);
    assert!(ids(&rig).contains(&0x201));
}

#[test]
fn a_stop_of_one_axis_by_its_fault_disables_both_by_the_frame_that_they_share() {
    let mut rig = rig().enable();
    rig.drive(0).state = takt_rt::DriveState::Fault;
    rig.run_until(Phase::Disabled, 3_000);
    assert_eq!(rig.stops().len(), 1);
    for axis in [1, 2] {
        assert!(!rig.drive(axis).state.has_torque(), "{axis}");
    }
}

#[test]
fn a_frame_that_is_not_shared_as_it_says_is_refused() {
    let error_of = |change: fn(&mut EngineParameters)| {
        let mut parameters = two_of_three();
        change(&mut parameters);
        Engine::new(parameters).err()
    };
    assert_eq!(error_of(|_| ()), None);
    let refused = Some(SetUpError::SharedCommand { axis: 0, id: SHARED });
    let group =
        |axes: &[u8]| GroupParameters { axes: axes.iter().copied().collect(), ..GroupParameters::default() };
    let of_two_groups = {
        let mut parameters = two_of_three();
        parameters.groups = [group(&[0, 2]), group(&[1])].into_iter().collect();
        Engine::new(parameters).err()
    };
    assert_eq!(of_two_groups, refused);
    assert_eq!(error_of(|own| pdos(&mut own.axes[1]).commands[0].axes = 1), refused);
    assert_eq!(error_of(|own| pdos(&mut own.axes[0]).commands[0].axes = 3), refused);
    assert_eq!(
        error_of(|own| own.axes[1].exchange = own.axes[0].exchange.clone()),
        refused,
        "one part twice"
    );
    let rare = |own: &mut EngineParameters| {
        pdos(&mut own.axes[0]).commands[0].transmission = TransmissionType::OnControlword;
    };
    assert_eq!(error_of(rare), refused);
}

#[test]
fn the_process_data_of_an_axis_that_shares_its_command_are_not_exchanged() {
    let mut rig = rig();
    let data = AxisProcessData { axis: 0, commands: [None; 4], feedback: [None; 4], unused: [None; 4] };
    rig.request(Request::ProcessData(data));
    let rejection = rig.rejections().pop().unwrap();
    assert!(matches!(rejection.reason, RejectReason::IdTaken { id } if id == SHARED), "{rejection:?}");
}
