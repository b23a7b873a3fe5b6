"""Simulated drives made from their data sheets, driven by the package `canopen` with the same files."""

from canopen.profiles.p402 import BaseNode402

import simulated
from difference import expect, expect_abort, expect_near, wait_until

FOLDER = "tests/eds/vendors"
NODE = 4
NO_OBJECT = 0x0602_0000
TARGET_REACHED = 0x0400
COUNTS = 2000

# Each with its velocities and accelerations for a short move.
DRIVES = (
    ("eyou-euservo", 50_000, 500_000),
    ("faulhaber-mcbl300x", 3_000, 30_000),
    # Its velocities are in r/min.
    ("maxon-epos4", 60, 600),
    ("schunk-lwa4p", 50_000, 500_000),
)


def run(network, interface, case):
    network.sync.start(0.01)
    for name, velocity, acceleration in DRIVES:
        data_sheet = f"{FOLDER}/{name}.eds"
        node = BaseNode402(NODE, data_sheet)
        node.sdo.RESPONSE_TIMEOUT = 5.0
        node.TIMEOUT_SWITCH_STATE_SINGLE = node.TIMEOUT_SWITCH_OP_MODE = node.TIMEOUT_CHECK_TPDO = 5.0
        node.TIMEOUT_SWITCH_STATE_FINAL = 30.0
        states = []
        network.add_node(node)
        node.nmt.add_heartbeat_callback(states.append)
        with simulated.drive_of(data_sheet, NODE, interface):
            case(f"boots as {name}", lambda: wait_until("boot-up", lambda: 0 in states))
            case(f"has the objects of {name} and no others", lambda: objects(node))
            case(f"is led as {name} by the package's CiA 402 helper", lambda: state_machine(node))
            case(f"moves as {name} in profile position", lambda: move(node, velocity, acceleration))
            case(f"faults as {name} on the loss of its master, and is reset", lambda: master_lost(network, node))
        del network[NODE]
    network.sync.stop()


def objects(node):
    for index in range(0x6000, 0x6100):
        if index not in node.object_dictionary:
            expect_abort(f"reading {index:04X}", NO_OBJECT, lambda: node.sdo.upload(index, 0))
    expect("vendor", node.sdo[0x1018][1].raw, node.object_dictionary[0x1018][1].default or 0)


def state_machine(node):
    for pdo in (node.rpdo[1], node.tpdo[1]):
        pdo.read()
    # The controlword acts at once; the statusword comes with every SYNC.
    for pdo, index, transmission_type in ((node.rpdo[1], 0x6040, 255), (node.tpdo[1], 0x6041, 1)):
        pdo.clear()
        pdo.add_variable(index)
        pdo.trans_type = transmission_type
        pdo.enabled = True
        pdo.save()
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    wait_until("state after power-up", lambda: node.state == "SWITCH ON DISABLED")
    node.op_mode = "PROFILED POSITION"
    expect("mode", node.op_mode, "PROFILED POSITION")
    node.sdo[0x607A].raw = node.sdo[0x6064].raw
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED", "SWITCH ON DISABLED"):
        node.state = state
        expect("state", node.state, state)


def move(node, velocity, acceleration):
    node.sdo[0x6081].raw = velocity
    node.sdo[0x6083].raw = acceleration
    node.state = "OPERATION ENABLED"
    start = node.sdo[0x6064].raw
    # Within the window the target counts as reached, while the position still settles.
    window = node.sdo[0x6067].raw if 0x6067 in node.object_dictionary else 0
    for target in (start + COUNTS, start):
        node.sdo[0x607A].raw = target
        node.controlword = 0x1F
        wait_until("target reached", lambda: abs(node.sdo[0x6064].raw - target) <= 10)
        node.controlword = 0x0F
        wait_until("target reached in the statusword", lambda: node.sdo[0x6041].raw & TARGET_REACHED)
        expect_near("position where the target was reached", node.sdo[0x6064].raw, target, max(window, 10))


def master_lost(network, node):
    # Object 6007 says what the drive does then; 1 is a fault, as in a drive without that object.
    if 0x6007 in node.object_dictionary:
        node.sdo[0x6007].raw = 1
    node.sdo[0x1016][1].raw = 127 << 16 | 300
    network.send_message(0x77F, [5])
    wait_until("fault", lambda: node.sdo[0x6041].raw & 0x08)
    node.sdo[0x1016][1].raw = 0
    # Without object 1029 the loss makes the node pre-operational, where it sends no feedback.
    node.nmt.state = "OPERATIONAL"
    node.reset_from_fault()
    expect("state after the reset", node.state, "OPERATION ENABLED")
    node.state = "SWITCH ON DISABLED"
