"""The simulated eRob, driven by the package `canopen` with the EDS."""

import time

from canopen.profiles.p402 import BaseNode402

import dictionary
import simulated
from difference import Difference, expect, expect_abort, expect_near, wait_until

CONFIG = "configs/single-erob.toml"
DATA_SHEET = "configs/eds/erob-canopen.eds"
NODE = 1
MASTER = 127

COMMAND = 0x0504_0001
NO_OBJECT = 0x0602_0000
NO_SUBINDEX = 0x0609_0011
READ_ONLY = 0x0601_0002
LENGTH_TOO_HIGH = 0x0607_0012
INVALID_VALUE = 0x0609_0030

BIT_12 = 0x1000
TARGET_REACHED = 0x0400
COUNTS_PER_TURN = 524_288
CYCLE_S = 0.01


def run(network, interface, case):
    node = BaseNode402(NODE, DATA_SHEET)
    network.add_node(node)
    node.sdo.RESPONSE_TIMEOUT = 5.0
    # The default limits of the helper are for a machine that is not emulated.
    node.TIMEOUT_SWITCH_STATE_SINGLE = node.TIMEOUT_SWITCH_OP_MODE = node.TIMEOUT_CHECK_TPDO = 5.0
    node.TIMEOUT_SWITCH_STATE_FINAL = 30.0
    states = []
    node.nmt.add_heartbeat_callback(states.append)
    with simulated.drives(CONFIG, "can", interface):
        case("boots", lambda: boot_up(node, states))
        case("is as its data sheet says, object by object", lambda: data_sheet(node))
        case("reads, writes and refuses by SDO", lambda: service_data(node))
        case("sends its heartbeat, answers guarding and follows NMT", lambda: network_management(node, states))
        case("has the process data that are read from it", lambda: default_process_data(node))
        case("takes another mapping", lambda: map_process_data(node))
        case("is led by the package's own CiA 402 helper", lambda: state_machine(node))
        case("moves in profile position with the set-point handshake", lambda: profile_position(node))
        case("turns in profile velocity, both ways", lambda: profile_velocity(node))
        case("follows 200 SYNCs in cyclic synchronous position", lambda: cyclic_position(network, node))
        case("fails on a following error, says so, and is reset", lambda: following_error(node))
        case("notices that its master is lost", lambda: master_lost(network, node))


def boot_up(node, states):
    wait_until("boot-up", lambda: 0 in states)
    expect("NMT state after boot-up", node.nmt.state, "PRE-OPERATIONAL")


def data_sheet(node):
    constants = {0x1000, 0x1018, 0x1014, 0x1200, 0x6502}
    count = dictionary.check_against(node, constants, without_data={0x1003})
    expect("number of objects that can be read", count, 216)


def service_data(node):
    sdo = node.sdo
    expect("vendor", sdo["Identity object"]["Vendor ID"].raw, 0x5A65_726F)
    for value in (123_456, 200):
        sdo[0x6083].raw = value
        expect("profile acceleration read back", sdo[0x6083].raw, value)
    sdo[0x607A].raw = -123_456
    expect("negative target read back", sdo[0x607A].raw, -123_456)
    sdo.download(0x6084, 0, (654_321).to_bytes(4, "little"), force_segment=True)
    expect("what was written in segments", sdo[0x6084].raw, 654_321)
    expect_abort("reading a device name, which this drive has not", NO_OBJECT, lambda: sdo.upload(0x1008, 0))
    expect_abort("reading a serial number, which it has not either", NO_SUBINDEX, lambda: sdo.upload(0x1018, 4))
    expect_abort("writing the statusword", READ_ONLY, lambda: sdo.download(0x6041, 0, b"\0\0"))
    expect_abort("eight bytes for four", LENGTH_TOO_HIGH, lambda: sdo.download(0x6083, 0, bytes(8)))
    expect_abort("a block transfer", COMMAND, lambda: sdo.open(0x6083, 0, "wb", size=4, block_transfer=True))
    expect_abort("an error behaviour of 7", INVALID_VALUE, lambda: sdo.download(0x1029, 1, b"\7"))


def network_management(node, states):
    node.sdo["Producer heartbeat time"].raw = 50
    node.nmt.wait_for_heartbeat(5)
    for state, code in (("OPERATIONAL", 5), ("STOPPED", 4), ("PRE-OPERATIONAL", 0x7F)):
        node.nmt.state = state
        wait_until(f"heartbeat of a node that is {state}", lambda: states[-1] == code)
    node.sdo["Producer heartbeat time"].raw = 0
    states.clear()
    node.nmt.start_node_guarding(0.05)
    wait_until("answers to the guarding of a pre-operational node", lambda: len(states) >= 3)
    expect("states by node guarding", set(states), {0x7F})
    node.nmt.stop_node_guarding()
    node.sdo["Producer heartbeat time"].raw = 50
    for command in ("RESET COMMUNICATION", "RESET"):
        states.clear()
        node.nmt.state = command
        wait_until(f"boot-up after {command}", lambda: 0 in states)
        expect(f"heartbeat time after {command}", node.sdo[0x1017].raw, 0)


def default_process_data(node):
    node.tpdo.read()
    node.rpdo.read()
    for maps, first, wanted in (
        (node.rpdo, 0x200, [[0x6040], [0x6040, 0x607A], [0x6040, 0x60FF], []]),
        (node.tpdo, 0x180, [[0x6041], [0x6041, 0x6064], [0x6041, 0x606C], []]),
    ):
        for number, objects in enumerate(wanted, 1):
            pdo = maps[number]
            expect(f"objects of {pdo.name}", [variable.index for variable in pdo], objects)
            expect(f"identifier of {pdo.name}", pdo.cob_id, first + 0x100 * (number - 1) + NODE)
            expect(f"whether {pdo.name} is enabled", pdo.enabled, number == 1)
            expect(f"transmission type of {pdo.name}", pdo.trans_type, 255)


def map_process_data(node):
    """Feedback every 20 ms for the profile modes. For the cyclic modes, a target and feedback at SYNC."""
    set_up(node.rpdo[1], [0x6040, 0x6060, 0x607A], 255)
    set_up(node.tpdo[1], [0x6041, 0x6061, 0x6064], 255, event_timer=20)
    set_up(node.rpdo[2], [0x6040, 0x607A], 1)
    set_up(node.tpdo[2], [0x6064, 0x6041], 1)
    for pdo in (node.rpdo[1], node.tpdo[1]):
        objects = [variable.index for variable in pdo]
        pdo.read()
        expect(f"objects of {pdo.name} read back", [variable.index for variable in pdo], objects)
    expect("bytes of the feedback", len(node.tpdo[1].data), 7)


def set_up(pdo, objects, transmission_type, event_timer=0):
    pdo.clear()
    for index in objects:
        pdo.add_variable(index)
    pdo.trans_type = transmission_type
    pdo.event_timer = event_timer
    pdo.enabled = True
    pdo.save()


def state_machine(node):
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    wait_until("feedback of an operational node", lambda: node.tpdo_values[0x6041] != 0)
    expect("state after power-up", node.state, "SWITCH ON DISABLED")
    expect("whether homing is supported", node.is_op_mode_supported("HOMING"), False)
    node.op_mode = "PROFILED POSITION"
    expect("mode", node.op_mode, "PROFILED POSITION")
    node.rpdo_pointers[0x607A].raw = node.sdo[0x6064].raw
    for state in (
        "READY TO SWITCH ON",
        "SWITCHED ON",
        "OPERATION ENABLED",
        "SWITCHED ON",
        "READY TO SWITCH ON",
        "SWITCH ON DISABLED",
        "OPERATION ENABLED",
        "SWITCH ON DISABLED",
    ):
        node.state = state
        expect("state", node.state, state)


def profile_position(node):
    for index, value in ((0x6081, 400_000), (0x6083, 2_000_000), (0x6084, 2_000_000)):
        node.sdo[index].raw = value
    node.op_mode = "PROFILED POSITION"
    node.state = "OPERATION ENABLED"
    start = node.sdo[0x6064].raw
    for target in (start + COUNTS_PER_TURN // 4, start):
        set_point(node, target)
        wait_until("target reached", lambda: node.statusword & TARGET_REACHED)
        expect_near("position where the target was reached", node.sdo[0x6064].raw, target, 100)


def set_point(node, target):
    node.rpdo_pointers[0x607A].raw = target
    node.controlword = 0x1F
    wait_until("set-point acknowledged", lambda: node.statusword & BIT_12)
    node.controlword = 0x0F
    wait_until("acknowledgement withdrawn", lambda: not node.statusword & BIT_12)


def profile_velocity(node):
    node.state = "SWITCH ON DISABLED"
    node.op_mode = "PROFILED VELOCITY"
    node.sdo[0x60FF].raw = 0
    node.state = "OPERATION ENABLED"
    for velocity in (50_000, -50_000, 0):
        node.sdo[0x60FF].raw = velocity
        wait_until("target velocity reached", lambda: abs(node.sdo[0x606C].raw - velocity) <= 1000)
        wait_until("statusword that says so", lambda: node.statusword & TARGET_REACHED)


def cyclic_position(network, node):
    node.state = "SWITCH ON DISABLED"
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    node.sdo[0x60C2][1].raw = round(CYCLE_S * 1000)
    command, feedback = node.rpdo[2], node.tpdo[2]
    start = node.sdo[0x6064].raw
    # Both RPDOs contain the target, so both must have the same value.
    node.rpdo_pointers[0x607A].raw = start
    node.state = "OPERATION ENABLED"
    positions = []
    feedback.add_callback(lambda pdo: positions.append(pdo[0x6064].raw))
    cycles, step = 200, 300
    end = start + step * cycles
    for cycle in range(1, cycles + 1):
        command[0x6040].raw = 0x0F
        command[0x607A].raw = start + step * cycle
        command.transmit()
        network.sync.transmit()
        wait_until(f"answer to SYNC {cycle}", lambda: len(positions) >= cycle)
        # Sent after the feedback, so that the drive always has its interpolation time.
        time.sleep(CYCLE_S)
    wait_until("target reached", lambda: abs(node.sdo[0x6064].raw - end) <= 100)
    expect("answers to SYNC", len(positions), cycles)
    # At a SYNC, the target of the previous SYNC has been reached.
    for before, position in enumerate(positions):
        expect_near(f"position at SYNC {before + 1}", position, start + step * before, 2 * step)
    node.state = "SWITCH ON DISABLED"


def following_error(node):
    node.op_mode = "PROFILED POSITION"
    node.rpdo_pointers[0x607A].raw = node.sdo[0x6064].raw
    node.state = "OPERATION ENABLED"
    node.sdo[0x6065].raw = 0
    node.rpdo_pointers[0x607A].raw = node.sdo[0x6064].raw + COUNTS_PER_TURN // 8
    node.controlword = 0x1F
    emergency = node.emcy.wait(0x8611, timeout=30)
    if emergency is None:
        raise Difference("no emergency message came of a following error")
    wait_until("fault", lambda: node.state == "FAULT")
    expect("error code", node.sdo[0x603F].raw, 0x8611)
    expect("latest error in the history", node.sdo[0x1003][1].raw & 0xFFFF, 0x8611)
    node.sdo[0x6065].raw = -1
    node.rpdo_pointers[0x607A].raw = node.sdo[0x6064].raw
    node.reset_from_fault()
    expect("state after the reset", node.state, "OPERATION ENABLED")
    wait_until("end of the emergency", lambda: node.emcy.log[-1].code == 0)
    expect("error register", node.sdo[0x1001].raw, 0)
    node.state = "SWITCH ON DISABLED"


def master_lost(network, node):
    node.sdo[0x1016][1].raw = MASTER << 16 | 500
    heartbeat = network.send_periodic(0x700 + MASTER, [5], 0.1)
    time.sleep(1)
    expect("emergencies while the master is there", node.emcy.active, [])
    heartbeat.stop()
    if node.emcy.wait(0x8130, timeout=30) is None:
        raise Difference("no emergency message was sent after the loss of the heartbeat")
    node.sdo[0x1016][1].raw = 0
