//! Every key of a configuration: a row each, from which the reader, `configs/reference.toml` and the JSON Schema for editors come.
//! A range is where a value cannot be, or is a slip of a unit or of a power of ten; the message then says why.

use super::bounds::Bounds;
use super::key::Shown::{Comment, Computed, Default, Example};
use super::key::Values::{Boolean, List, Number, OfAxis, OneOrList, Text, Words};
use super::key::{Key, Literal, Shown, Table, Values};
use super::quantities::Quantities;
use super::quantity::Quantity;

/// A table is `module "HEADER", "SENTENCE" { CONSTANT "key": VALUES, SHOWN, "SENTENCE"; }`; `or "word"` stands behind values in
/// whose place a word may stand.
macro_rules! tables {
    ($($module:ident $header:literal, $says:literal {
        $($id:ident $name:literal: $values:expr $(; or $word:literal)?, $shown:expr, $sentence:literal;)*
    })*) => {
        $(pub mod $module {
            use super::*;
            $(pub const $id: Key = Key {
                name: $name,
                values: $values,
                word: [$(Some($word),)? None][0],
                shown: $shown,
                sentence: $sentence,
            };)*
            pub const TABLE: Table = Table { header: $header, sentence: $says, keys: &[$($id),*] };
        })*
        /// All of them, in the order of the reference.
        pub const TABLES: &[Table] = &[$($module::TABLE),*];
    };
}

/// The bit rates of CiA 301, 5.3, which every adapter and every drive here divides its clock to.
pub const BIT_RATES: [u32; 8] = [10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
/// The highest bit rate of the data phase.
pub const DATA_BIT_RATE_AT_MOST: f64 = 8e6;
/// The longest period of a bus, in seconds.
pub const BUS_PERIOD_AT_MOST_S: f64 = 0.1;
/// The largest part of the period that a thread may spin: a loop that spins for most of it leaves no time to other threads of its CPU.
pub const SPIN_GUARD_AT_MOST: f64 = 0.5;
/// The command phase as a fraction of the period: the cycle must leave room on both sides of it.
pub const COMMAND_PHASE: Bounds = Bounds::Between(0.05, 0.95);
/// The addresses of slaves on a serial line (Modbus over Serial Line 1.02, 2.2).
pub const LINE_ADDRESSES: std::ops::Range<i64> = 1..248;
/// The longest time (s) that a stop from the highest speed may take.
pub const STOP_AT_MOST_S: f64 = 10.0;
/// The longest gap of a simulation, at most, in seconds.
pub const LONGEST_GAP_AT_MOST_S: f64 = 60.0;

const COUNTS: Bounds = Bounds::Plausible {
    low: 16.0,
    high: 4_294_967_296.0,
    reason: "coarser encoders cannot position a joint, and drives count in 32 bits",
};
const RATIO: Bounds =
    Bounds::Plausible { low: 1e-3, high: 1e5, reason: "no gear of a joint has another ratio" };
const LEAD: Bounds = Bounds::Plausible {
    low: 1e-5,
    high: 10.0,
    reason: "no screw or belt moves a joint by less or more in a turn",
};
const POSITION_GAIN: Bounds = Bounds::Plausible {
    low: 0.01,
    high: 1000.0,
    reason: "a lower gain takes minutes to correct an error, and no drive follows a higher one",
};
const BANDWIDTH: Bounds = Bounds::Plausible {
    low: 0.1,
    high: 1000.0,
    reason: "a slower loop takes minutes to correct an error, and no loop over a bus is faster",
};
const SHARE: Bounds = Bounds::Plausible {
    low: 0.001,
    high: 1.0,
    reason: "the limits are the most, and a smaller part of them would take hours",
};
/// Object 1018 and 1000 have 32 bits.
const NUMBER_32: Values = Values::Integer(0, 0xFFFF_FFFF);

const fn time(low_s: f64, high_s: f64) -> Values {
    Values::Quantity(Quantity::DURATION, Bounds::Between(low_s, high_s))
}

const fn integer(low: i64, high: i64) -> Values {
    Values::Integer(low, high)
}

const fn usually(number: f64) -> Shown {
    Default(Literal::Number(number))
}

const fn count(number: i64) -> Shown {
    Default(Literal::Integer(number))
}

const fn is(value: bool) -> Shown {
    Default(Literal::Boolean(value))
}

const fn word(word: &'static str) -> Shown {
    Default(Literal::Word(word))
}

const POSITION: Values = OfAxis(|q: Quantities| (q.position, Bounds::Finite));
const SPEED: Values = OfAxis(|q| (q.velocity, q.ranges.velocity));
const ACCELERATION: Values = OfAxis(|q| (q.acceleration, q.ranges.acceleration));
const EFFORT: Values = OfAxis(|q| (q.effort, q.ranges.effort));
const DEVIATION: Values = OfAxis(|q| (q.position, q.ranges.deviation));
const FRICTION: Values = OfAxis(|q| (q.effort, q.ranges.friction));
const VISCOUS: Values = OfAxis(|q| (q.damping, q.ranges.viscous_friction));
const STIFFNESS: Values = OfAxis(|q| (q.stiffness, q.ranges.stiffness));
const DAMPING: Values = OfAxis(|q| (q.damping, q.ranges.damping));

tables! {
    root "", "" {
        NAME "name": Text, Example("\"reference\""), "of the machine, for people and file names";
        URDF "urdf": Text, Comment("\"arm.urdf\""), "a robot description, from this file's folder: limits of positions, velocities and torques come from it";
    }

    cycle "[cycle]", "" {
        PERIOD "period": time(250e-6, 0.1), usually(1e-3), "of SYNC and set-points";
        COMMAND_PHASE "command_phase": Values::Quantity(Quantity::FRACTION, super::COMMAND_PHASE); or "auto", Computed("0.55"), "when set-points are made from feedback: a fraction of the period, a time, or \"auto\"\n\"auto\" finds it from the worst case of every bus: after the last feedback, with as much reserve for a late wake-up\nbefore it as after it; a file for which there is none is refused with the sums. `takt check` shows what \"auto\" is,\nand in which range the command phase may lie.";
    }

    missed_slots "[cycle.missed_slots]", "a bucket that each missed slot fills by one, and that leak_slots used slots empty by one" {
        WARNING "warning": integer(1, 1_000_000), count(10), "missed slots in the bucket at which takt warns";
        DEGRADED "degraded": integer(1, 1_000_000), count(50), "missed slots at which no stream is begun any more";
        STOP "stop": integer(1, 1_000_000), count(250), "missed slots at which the group stops; not with simulated buses alone, see [simulation]";
        LEAK_SLOTS "leak_slots": integer(1, 1_000_000), count(10), "used slots after which the bucket loses one";
    }

    stream "[stream]", "" {
        DELAY "delay": time(0.0, 1.0); or "auto", word("auto"), "how far set-points run behind the stamps of their points: learnt from them, or a time";
    }

    realtime "[realtime]", "" {
        PRIORITY "priority": integer(1, 99); or "off", count(80), "of SCHED_FIFO, or \"off\"";
        CPU "cpu": integer(0, 1023); or "last", word("last"), "the last CPU that takt may use, or the number of one";
        LOCK_MEMORY "lock_memory": Boolean, is(true), "keeps all memory out of the swap";
        HOLD_DMA_LATENCY "hold_dma_latency": Boolean, is(true), "keeps the CPU out of deep idle states";
        SPIN_GUARD "spin_guard": Values::Quantity(Quantity::DURATION, Bounds::Finite); or "measure", word("measure"), "how long before a deadline to spin instead of sleep: a time, or measured; on PREEMPT_RT, a tenth of the period";
    }

    master "[master]", "the controller as a CANopen node" {
        NODE "node": integer(1, 127), count(127), "its node ID (CiA 301, 7.4.1)";
        HEARTBEAT "heartbeat": time(10e-3, 65.535); or "off", Computed("\"100 ms\""), "or \"off\": drives then do not notice when the controller dies\nWith an axis in mode \"csv\", \"cst\", \"pp\", \"pv\" or \"pt\" the default is 20 ms, or the period of the cycle where that is longer: such a drive\ngoes on moving until it notices that the controller is gone. `takt check` shows for how long, and how far.";
        HEARTBEAT_TIMEOUT "heartbeat_timeout": time(1e-3, 65.535), Computed("\"500 ms\""), "five heartbeats; a drive stops by itself after this time without one";
        TIME "time": time(10e-3, 3600.0); or "off", word("off"), "or the period of TIME, by which drives know the time of day: \"10 s\"";
    }

    bus "[[bus]]", "" {
        NAME "name": Text, Example("\"left\""), "by which axes and reports call it";
        INTERFACE "interface": Text, word("sim"), "simulated drives, a SocketCAN interface: \"can0\", \"vcan0\", or an adapter on USB: \"slcan:/dev/ttyACM0\"\nA serial line with drives of the family erob-modbus, and no CAN bus: \"serial:/dev/ttyUSB0\", or \"sim\" with such drives on it. It has\nname, interface, bit_rate (115200 bit/s unless given; also \"serial:/dev/ttyUSB0@19200\") and period (10 ms unless given) alone.";
        BIT_RATE "bit_rate": Values::Quantity(Quantity::BIT_RATE, Bounds::Between(1.0, 1e8)), usually(1e6), "those of CiA 301";
        DATA_BIT_RATE "data_bit_rate": Values::Quantity(Quantity::BIT_RATE, Bounds::Between(1.0, DATA_BIT_RATE_AT_MOST)), Comment("\"5 Mbit/s\""), "of the data phase of CAN FD frames; without it the bus is classic";
        PERIOD "period": time(250e-6, BUS_PERIOD_AT_MOST_S), Computed("\"1 ms\""), "of its cycle: that of the controller or a multiple, 32 times at most; a YZ-AIM interpolates at 2 ms";
        RESTART_MS "restart_ms": integer(0, 60_000), count(100), "how long after bus-off the kernel restarts the controller, 0 never; holds where takt brings the interface up";
        SERVICE_FRAMES "service_frames_per_cycle": integer(1, 32), count(1), "NMT and SDO frames sent in one cycle at most, while enabled, apart from the heartbeat";
        SDO_WHILE_ENABLED "sdo_while_enabled": Boolean, is(false), "true needs room for a request and its answer in every cycle";
        COMMAND_FRAMES "command_frames": Words(&["auto", "one-per-axis", "shared"]), word("auto"), "\"one-per-axis\", \"shared\" (axes of a group share RPDOs by dummy mapping, where their \"cia402\" data\nsheets allow it and it shortens the frames of a cycle), or \"auto\": shared only if the bus does not carry its traffic otherwise";
    }

    family "[defaults.axis]", "holds for every axis that does not say otherwise; not for name and node" {
        DRIVE "drive": Text, Example("\"erob-canopen\""), "or \"yz-aim\"; or \"cia402\": any other CiA 402 drive, by its data sheet";
        EDS "eds": Text, Comment("\"my-drive.eds\""), "only with \"cia402\", and required: an EDS or DCF, from this file's folder";
        NODE_AXIS "node_axis": integer(1, 8), Comment("2"), "only with \"cia402\"; default 1: which axis of a drive with several (CiA 402-2); they have one bus, node and eds";
        COMMUNICATION_TIMEOUT "communication_timeout": Values::Quantity(Quantity::DURATION, Bounds::Between(0.0, 4.0)), Comment("\"500 ms\""), "only with \"erob-modbus\"; default 500 ms; time-out of the drive for requests of its master; \"0 ms\": none";
        DESCRIPTION "description": Text, Comment("\"damiao-dm-mit\""), "only with \"bit-fields\", and required: a description that comes with takt, or the path of one";
        EXTENDED "extended": Boolean, Comment("true"), "only with \"hollow-can\"; default: false; whether the motor is in extended mode";
        MASTER_ID "master_id": integer(0, 0x7FF), Comment("0x65"), "only with \"bit-fields\": the identifier by which the motor replies";
        BIT_RATE_SWITCH "bit_rate_switch": Boolean, Comment("true"), "only with \"bit-fields\" on CAN FD; default: false; whether frames switch to data_bit_rate";
        OLD_FIRMWARE "old_firmware": Boolean, Comment("true"), "only with \"bit-fields\"; default: false; whether the motor takes enable, disable and zero by the identifier of its mode";
        QUIRKS "quirks": Text, Comment("\"my-drive.toml\""), "only with \"cia402\": in what the drive deviates from its data sheet (see drives/)";
    }

    axis "[[axis]]", "" {
        NAME "name": Text, Example("\"shoulder\""), "by which groups, programs and reports call it";
        BUS "bus": Text, Example("\"left\""), "the name of its bus";
        NODE "node": integer(1, 247), Example("1"), "of its drive; to 127 on a CAN bus";
        URDF_JOINT "urdf_joint": Text, Comment("\"shoulder_pan\""), "only with `urdf`; default: the name of the axis; its joint there, or \"off\": the limits are all here";
        MODE "mode": Words(&["csp", "csv", "cst", "ip", "pp", "pv", "pt"]), Computed("\"csp\""), "cyclic: \"csp\", \"csv\", \"cst\", \"ip\"; the drive's own profile: \"pp\", \"pv\", \"pt\"";
        MODES "modes": List(&Words(&["csp", "csv", "cst"])), Comment("[\"csp\", \"csv\", \"cst\"]"), "the modes that the axis may be changed to while it runs; without it, it stays in `mode`\nEach of them has its loop below, and is mapped: objects 6060, 6061 and every target, which is one more PDO. An eRob takes another mode\nonly while it is disabled; a YZ-AIM cannot be changed.";
        TRAVEL "travel": Words(&["rotary", "linear"]), word("rotary"), "or \"linear\", which needs lead, what it moves in one turn";
        LEAD "lead": Values::Quantity(Quantity::LENGTH, super::LEAD), Comment("\"5 mm\""), "of a linear axis";
        COUNTS_PER_TURN "counts_per_turn": Number(COUNTS), Computed("524288"), "of the position that the drive reports (eRob: 19 bits at the output)";
        GEAR_RATIO "gear_ratio": Number(RATIO), usually(1.0), "turns of the reported position for one of the joint";
        REVERSED "reversed": Boolean, is(false), "whether positive counts are negative travel";
        ZERO_COUNTS "zero_counts": integer(i32::MIN as i64, i32::MAX as i64), count(0), "the count at which the joint is at 0";
        POSITION_AT_ZERO_COUNTS "position_at_zero_counts": POSITION, Comment("\"30 deg\""), "the same in another way: where the joint is when the drive counts 0";
        MAPPING "mapping": Words(&["written", "as-stored"]), Computed("\"written\""), "or \"as-stored\": the drive keeps its own, of which a YZ-AIM knows no other\nA stored mapping is read back and followed, and counted with as many full PDOs as would be written.";
        FEEDBACK "feedback": List(&Words(&["operation_mode", "velocity", "torque", "current", "error_code"])), Computed("[\"operation_mode\"]"), "in addition to statusword and position: also \"velocity\", \"torque\", \"current\", \"error_code\"\nWith \"operation_mode\", a mode that another master changes is noticed at once; it costs 10 us of a bus of 1 Mbit/s for each drive. Without it,\nonly the motion of the drive shows the change (following_error). The PDOs of a YZ-AIM carry none.";
        ANSWERS_SYNC "answers_sync": Boolean, is(true), "of a YZ-AIM: false spares the bus a frame, and feedback is a cycle older";
        TRANSMISSION_TYPE "transmission_type": integer(1, 255), count(1), "of the PDOs: 1 = every SYNC, 2 = every second one, up to 240; 254, 255 = on events\nMore than 1 lessens the load but not the worst case: without a counter in SYNC all drives may answer the same one.";
        FEEDBACK_DELAY "feedback_delay": time(0.0, 0.01), usually(20e-6), "the longest time from SYNC until feedback is ready to be sent, for `takt check`";
        START_TOLERANCE "start_tolerance": DEVIATION, Computed("\"0.02 rad\""), "0.002 m for a linear axis; no stream with follow = \"exact\" may begin farther from the joint";
        TARGET_TOLERANCE "target_tolerance": DEVIATION, Computed("\"0.01 rad\""), "1 mm for a linear axis; a program that leaves the joint farther off its target has not finished\nIn mode \"cst\" the default is 1.5 * coulomb_friction / stiffness where that is more: static friction holds a joint off its target there.";
        FOLLOW "follow": Words(&["smooth", "exact"]), word("smooth"), "a stream is followed as closely as the limits allow; \"exact\": what breaks a limit is a stop";
        FEED_FORWARD "feed_forward": Words(&["none", "velocity", "torque", "velocity-and-torque"]), word("none"), "\"velocity\": 60B1 in csp and ip, \"torque\": 60B2 in csp, csv and ip, or \"velocity-and-torque\"\nThe torque is what a stream feeds forward, and fits into the PDO of the target. The velocity is that of the set-point, and takes another frame.";
        MISSED_FEEDBACK_CYCLES "missed_feedback_cycles": integer(1, 1000), count(5), "cycles without feedback after which the group stops";
        MISSED_FEEDBACK_TIME "missed_feedback_time": Values::Quantity(Quantity::DURATION, Bounds::Finite), Comment("\"50 ms\""), "in its place: a time of 1 to 1000 cycles, rounded down to whole ones";
        HEARTBEAT "heartbeat": time(10e-3, 65.535); or "off", word("off"), "the drive's own; feedback in every cycle proves the drive alive as well\nA drive that has no heartbeat (1017), but 100C and 100D, is asked for its state instead: node guarding, at this period, or else at that of\n[master] heartbeat; the drive stops by itself after [master] heartbeat_timeout without a request. `takt check` says which of both is in force.";
        POWER_UP "power_up": time(0.0, 60.0), usually(0.2), "until the drive answers: `takt drive` waits for it, a simulated drive takes it; a real eRob takes 8 s";
        DCF "dcf": Text, Comment("\"shoulder.dcf\""), "a DCF or concise DCF, from this file's folder: written at bring-up and read back;\n`takt check` refuses values that contradict the limits of the axis, as a 60C6 below the deceleration";
    }

    limits "[axis.limits]", "with `urdf`, a position, velocity or torque given here may be narrower than that of the joint, not wider" {
        POSITION "position": List(&super::POSITION), Example("[\"-170 deg\", \"170 deg\"]"), "lowest and highest";
        VELOCITY "velocity": SPEED, Example("\"137 deg/s\""), "highest";
        ACCELERATION "acceleration": super::ACCELERATION, Example("\"8 rad/s^2\""), "highest";
        DECELERATION "deceleration": super::ACCELERATION, Computed("\"8 rad/s^2\""), "the acceleration";
        JERK "jerk": OfAxis(|q| (q.jerk, q.ranges.jerk)), Computed("inf"), "no limit: trapezoids";
        TORQUE "torque": EFFORT, Example("\"87 Nm\""), "highest; the force of a linear axis";
    }

    following_error "[axis.following_error]", "" {
        LIMIT "limit": DEVIATION, Computed("\"0.1 rad\""), "0.01 m for a linear axis";
        TIME "time": time(0.0, 10.0), usually(0.05), "further than limit for longer than this stops the group";
    }

    velocity_loop "[axis.velocity_loop]", "used in mode \"csv\"" {
        POSITION_GAIN "position_gain": Values::Quantity(Quantity::GAIN, super::POSITION_GAIN), Computed("\"20 1/s\""), "at periods above 12.5 ms it is 0.25 / period";
    }

    torque_loop "[axis.torque_loop]", "used in mode \"cst\"" {
        BANDWIDTH "bandwidth": Values::Quantity(Quantity::GAIN, super::BANDWIDTH), Computed("\"40 1/s\""), "at periods above 3.75 ms it is 0.15 / period";
        STIFFNESS "stiffness": super::STIFFNESS, Computed("\"1600 Nm/rad\""), "inertia * bandwidth^2";
        DAMPING "damping": super::DAMPING, Computed("\"80 Nm s/rad\""), "2 * inertia * bandwidth: critical";
        INERTIA "inertia": OfAxis(|q| (q.inertia, q.ranges.fed_forward_inertia)), Computed("\"1 kg m^2\""), "fed forward with the acceleration; that of the joint";
        VISCOUS_FRICTION "viscous_friction": VISCOUS, Computed("\"1 Nm s/rad\""), "fed forward with the velocity; that of the joint";
        COULOMB_FRICTION "coulomb_friction": FRICTION, Computed("\"0.5 Nm\""), "fed forward with the direction; that of the joint";
        STIFFNESS_MAX "stiffness_max": super::STIFFNESS, Example("\"1600 Nm/rad\""), "a stream of impedances may ask for no more; stiffness in mode \"cst\" where it is not given";
        DAMPING_MAX "damping_max": super::DAMPING, Example("\"80 Nm s/rad\""), "a stream of impedances may ask for no more; damping in mode \"cst\" where it is not given";
        TORQUE_RISE "torque_rise": time(0.001, 10.0), usually(0.1), "of a torque that a stream asks for, from zero to its limit; of a change of gains, too";
    }

    identity "[axis.identity]", "compared at bring-up; \"any\" is not compared" {
        DEVICE_TYPE "device_type": NUMBER_32; or "any", Computed("0x00420192"), "object 1000, of the drive's family";
        VENDOR "vendor": NUMBER_32; or "any", Computed("0x5A65726F"), "object 1018:1, of the drive's family";
        PRODUCT "product": NUMBER_32; or "any", Computed("0x26483052"), "object 1018:2, of the drive's family";
        REVISION "revision": NUMBER_32; or "any", Computed("\"any\""), "object 1018:3";
    }

    joint "[axis.joint]", "its mechanics; mode \"cst\" feeds them forward, and the simulated joint obeys them" {
        INERTIA "inertia": OfAxis(|q| (q.inertia, q.ranges.inertia)), Example("\"1 kg m^2\""), "rotor and load at the joint; 1 kg m^2 unless given; mode \"cst\" on a real bus requires it";
        VISCOUS_FRICTION "viscous_friction": VISCOUS, Example("\"1 Nm s/rad\""), "1 Nm s/rad unless given; mode \"cst\" on a real bus requires it";
        COULOMB_FRICTION "coulomb_friction": FRICTION, Example("\"0.5 Nm\""), "0.5 Nm unless given; mode \"cst\" on a real bus requires it";
        RATED_TORQUE "rated_torque": EFFORT, Example("\"87 Nm\""), "of the drive at the joint, unless the drive reports it (object 6076); the torque limit unless given";
    }

    simulated "[axis.simulated]", "the simulated drive, in addition to [axis.joint]" {
        GRAVITY "gravity": FRICTION, usually(0.0), "a quarter turn from 0, where the joint hangs; the weight of a linear axis";
        FRICTION_SHAPE "friction": Words(&["constant", "harmonic-drive"]), word("constant"), "Coulomb friction; \"harmonic-drive\": little at rest, all of it from 0.8 rad/s on";
        PEAK_TORQUE "peak_torque": EFFORT, Computed("\"261 Nm\""), "three times the rated torque";
        INITIAL_POSITION "initial_position": POSITION, Computed("\"0 deg\""), "at power-up; or the limit nearest to 0";
        TAKES_VELOCITY_LIMIT "takes_velocity_limit_while_enabled": Boolean, Comment("true"), "only with \"erob-can\": it accepts index 0204 while it is enabled, against its manual; default: it refuses";
        POWER_UP "power_up": Words(&["pre-operational", "operational"]), word("pre-operational"), "the NMT state after power-up; a YZ-AIM may also be \"operational\"";
    }

    group "[[group]]", "axes that start, move, stop and fault together; none: all axes are one group" {
        NAME "name": Text, Example("\"arm\""), "by which programs and reports call it";
        AXES "axes": List(&Text), Example("[\"shoulder\"]"), "every axis is in one group; a program has their targets in this order";
        STOPS_WITH "stops_with": List(&Text), Computed("[]"), "the groups that stop this one, too, when they stop";
    }

    program "[program]", "what `takt run` does, one move after the other" {
        REPEAT "repeat": integer(1, 1_000_000), count(1), "how often";
    }

    program_move "[[program.move]]", "a coordinated move of every axis of a group to rest" {
        GROUP "group": Text, Example("\"arm\""), "which group moves, where there are several; different groups move at the same time";
        TO "to": OneOrList(&POSITION), Example("[\"30 deg\"]"), "a target for every axis of the group in its order, or one for all: \"30 deg\"";
        VELOCITY "velocity": Values::Quantity(Quantity::FRACTION, SHARE), usually(1.0), "of the velocity limits";
        ACCELERATION "acceleration": Values::Quantity(Quantity::FRACTION, SHARE), usually(1.0), "of the acceleration and jerk limits";
        MINIMUM_DURATION "minimum_duration": time(0.0, 3600.0), usually(0.0), "the move takes at least this long";
        DWELL "dwell": time(0.0, 3600.0), usually(0.0), "standstill after the move";
        SPEED "speed": OneOrList(&super::SPEED), Comment("[\"45 deg/s\"]"), "in place of `to`, for axes in mode \"pv\": go at this speed …";
        TORQUE "torque": OneOrList(&EFFORT), Comment("[\"2 Nm\"]"), "… or in mode \"pt\" push with this torque …";
        FOR "for": time(0.0, 3600.0), Comment("\"2 s\""), "… for this time, and stop";
    }

    telemetry "[telemetry]", "" {
        DIRECTORY "directory": Text, word("runs"), "of recordings";
        RECORD "record": Boolean, is(true), "an MCAP file a run";
        CANDUMP "candump": Boolean, is(false), "a log of the frames of every bus, as candump writes it";
        BLACK_BOX "black_box": time(0.1, 60.0); or "off", usually(5.0), "of cycles, events, frames and what a replay needs, written at every fault; or \"off\"";
        RING_RECORDS "ring_records": integer(16, 1_048_576), count(4096), "cycles that the ring holds while the logger is busy";
    }

    simulation "[simulation]", "" {
        SEED "seed": integer(0, i64::MAX - 1), count(1), "of everything random";
        LONGEST_GAP "longest_gap": Values::Quantity(Quantity::DURATION, Bounds::Finite), Computed("\"2 ms\""), "or two periods of the cycle where that is more; a pause of the process that is longer stops the simulated world too";
        STOPS_FOR_MISSED_SLOTS "stops_for_missed_slots": Boolean, is(false), "true: as on real buses, the group stops from `cycle.missed_slots.stop` on";
    }
}
