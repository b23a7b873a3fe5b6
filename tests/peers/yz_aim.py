"""The simulated YZ-AIM, driven by the package `canopen` with the EDS, as in the examples of the manual.

Its statusword differs from CiA 402 (no mode display, no bit 6), so the helper of the package for that profile cannot be used.
"""

import time

import canopen

import dictionary
import simulated
from difference import Difference, expect, expect_abort, expect_near, wait_until

CONFIG = "configs/gantry-yz-aim.toml"
DATA_SHEET = "configs/eds/yz-aim.eds"
NODES = (1, 2, 3)
MASTER = 127

READ_ONLY = 0x0601_0002
POSITION, VELOCITY, HOMING, INTERPOLATION = 1, 3, 6, 7
ENABLED = 0x0037
TARGET_REACHED, HOMED, HOMING_ERROR = 0x0400, 0x1000, 0x2000
# The drive ignores a controlword for the next state within 20 ms after the previous controlword.
CONTROLWORD_PAUSE_S = 0.03
COMMUNICATION_LOST = 0x20
IN_ALARM = 4
# The default limit of the package is for a machine that is not emulated.
RESPONSE_TIMEOUT_S = 5.0


def run(network, interface, case):
    booted = dict.fromkeys(NODES, False)
    nodes = [canopen.RemoteNode(number, DATA_SHEET) for number in NODES]
    for node in nodes:
        network.add_node(node)
        node.nmt.add_heartbeat_callback(lambda state, number=node.id: booted.update({number: booted[number] or state == 0}))
        node.sdo.RESPONSE_TIMEOUT = RESPONSE_TIMEOUT_S
    first, second, third = nodes
    with simulated.drives(CONFIG, "gantry", interface):
        case("boots", lambda: wait_until("boot-up of every node", lambda: all(booted.values())))
        case("is as its data sheet says, object by object", lambda: data_sheet(first))
        case("refuses to write what is read-only, and does not answer about what it has not", lambda: refusals(first))
        case("sends its heartbeat, and none when stopped", lambda: network_management(first))
        case("has the process data that are read from it", lambda: process_data(nodes))
        case("stores parameters, and has them again after a reset of the node (manual 5.12)", lambda: store(first, booted))
        case("homes on its negative limit switch (17)", lambda: home(first))
        case("moves to a position by SDO (manual 5.06.1)", lambda: absolute_position(first))
        case("moves on by a distance by SDO (5.06.2)", lambda: relative_position(first))
        case("turns at a velocity by SDO, and halts (5.07.1)", lambda: velocity(first))
        case("moves by RPDO1 and answers with TPDO1 (5.10.1)", lambda: position_by_pdo(network, first))
        case("turns by RPDO3 and answers with TPDO3 (5.10.2)", lambda: velocity_by_pdo(first))
        case("interpolates two axes by RPDO4 and SYNC (5.10.3)", lambda: interpolate(network, second, third))
        case("stops with alarm 20h when its master is lost, and goes on when it is back", lambda: master_lost(network, first))


def data_sheet(node):
    constants = {0x1000, 0x1005, 0x1016, 0x1017, 0x1018} | set(range(0x1400, 0x1A04))
    # Object 606C has 16 bits by SDO and 32 in TPDO3. The EDS has 32 (manual, object table and 5.08.3).
    count = dictionary.check_against(node, constants, other_sizes={0x606C})
    expect("number of objects that can be read", count, 109)


def refusals(node):
    expect_abort("writing the statusword", READ_ONLY, lambda: node.sdo.download(0x6041, 0, b"\0\0"))
    node.sdo.RESPONSE_TIMEOUT = 0.5
    for index in (0x6061, 0x6502, 0x6084):
        try:
            node.sdo.upload(index, 0)
        except canopen.SdoAbortedError as abort:
            raise Difference(f"{index:04X} was refused ({abort}), but no reply was expected") from abort
        except canopen.SdoCommunicationError:
            continue
        raise Difference(f"{index:04X} has a value")
    node.sdo.RESPONSE_TIMEOUT = RESPONSE_TIMEOUT_S


def network_management(node):
    states = []
    node.nmt.add_heartbeat_callback(states.append)
    node.sdo["Producer heartbeat time"].raw = 50
    node.nmt.state = "OPERATIONAL"
    wait_until("heartbeat of an operational node", lambda: states and states[-1] == 5)
    node.nmt.state = "STOPPED"
    time.sleep(0.3)
    count = len(states)
    time.sleep(0.5)
    expect("heartbeats of a stopped node", len(states) - count, 0)
    node.nmt.state = "PRE-OPERATIONAL"
    wait_until("heartbeat of a pre-operational node", lambda: states[-1] == 0x7F)
    states.clear()
    node.nmt.state = "RESET COMMUNICATION"
    wait_until("boot-up after a reset of the communication", lambda: 0 in states)
    expect("heartbeat time after a reset of the communication", node.sdo[0x1017].raw, 1000)


def store(node, booted):
    gain = node.sdo[0x60FB][1]
    before = gain.raw
    gain.raw = before + 100
    node.sdo[0x2614].raw = 1
    wait_until("parameters stored", lambda: node.sdo[0x2614].raw == 2)
    gain.raw = before + 200
    booted[node.id] = False
    node.nmt.state = "RESET"
    wait_until("boot-up after a reset of the node", lambda: booted[node.id])
    expect("gain after a reset of the node", gain.raw, before + 100)


def process_data(nodes):
    wanted_commands = {1: [0x6040, 0x6060, 0x607A], 2: [0x607A, 0x6081], 3: [0x6040, 0x6060, 0x60FF], 4: [0x607A]}
    wanted_feedback = {1: [0x6064, 0x6041], 2: [0x6064, 0x6041], 3: [0x6064, 0x606C], 4: [0x6064, 0x6041]}
    for node in nodes:
        node.rpdo.read()
        node.tpdo.read()
        for maps, first, wanted in ((node.rpdo, 0x200, wanted_commands), (node.tpdo, 0x180, wanted_feedback)):
            for number, objects in wanted.items():
                pdo = maps[number]
                expect(f"objects of {pdo.name}", [variable.index for variable in pdo], objects)
                expect(f"identifier of {pdo.name}", pdo.cob_id, first + 0x100 * (number - 1) + node.id)
        expect("transmission type of RPDO4", node.rpdo[4].trans_type, 1)
        expect("bytes of RPDO1 to 4", [len(node.rpdo[number].data) for number in range(1, 5)], [7, 8, 7, 4])
        expect("bytes of TPDO1 to 4", [len(node.tpdo[number].data) for number in range(1, 5)], [6, 6, 8, 6])


def statusword(node):
    return node.sdo[0x6041].raw


def position(node):
    return node.sdo[0x6064].raw


def wait_for_target(node):
    wait_until("target reached", lambda: statusword(node) & TARGET_REACHED)


def enable(node):
    """After power-up the drive needs 0006h, 0007h and 000Fh with pauses. The manual shows only 000Fh."""
    for word in (0x06, 0x07, 0x0F):
        node.sdo[0x6040].raw = word
        time.sleep(CONTROLWORD_PAUSE_S)
    wait_until("drive enabled", lambda: statusword(node) & ENABLED == ENABLED)


def home(node):
    node.sdo[0x6098].raw = 17
    node.sdo[0x6060].raw = HOMING
    wait_until("homing complete", lambda: statusword(node) & HOMED)
    expect("homing error", statusword(node) & HOMING_ERROR, 0)
    # The zero is the position where the switch opens. The motor stops a little behind it.
    expect_near("position after homing", position(node), 0, 2000)


def absolute_position(node):
    enable(node)
    node.sdo[0x6060].raw = POSITION
    node.sdo[0x6081].raw = 1000
    node.sdo[0x6083].raw = 20_000
    # A stale target must not move the shaft when bit 5 is set, and the drive ignores the first target after enabling.
    node.sdo[0x607A].raw = position(node)
    node.sdo[0x6040].raw = 0x2F
    node.sdo[0x607A].raw = position(node)
    node.sdo[0x607A].raw = 50_000
    wait_until("motor under way", lambda: position(node) > 25_000)
    wait_for_target(node)
    expect_near("position where the target was reached", position(node), 50_000, 50)


def relative_position(node):
    node.sdo[0x6040].raw = 0x0F
    node.sdo[0x607A].raw = 50_000
    expect_near("position before the start", position(node), 50_000, 50)
    node.sdo[0x6040].raw = 0x4F
    node.sdo[0x6040].raw = 0x5F
    expect("controlword, whose bit 4 the drive clears", node.sdo[0x6040].raw, 0x4F)
    wait_until("motor under way", lambda: position(node) > 75_000)
    wait_for_target(node)
    expect_near("position after the first distance", position(node), 100_000, 50)
    node.sdo[0x607A].raw = -100_000
    node.sdo[0x6040].raw = 0x5F
    wait_until("motor under way back", lambda: position(node) < 50_000)
    wait_for_target(node)
    expect_near("position after the second distance", position(node), 0, 50)


def velocity(node):
    node.sdo[0x60FF].raw = 0
    node.sdo[0x6060].raw = VELOCITY
    node.sdo[0x6040].raw = 0x0F
    for speed in (300, -300):
        node.sdo[0x60FF].raw = speed
        wait_until("velocity near the target", lambda: abs(rpm(node) - speed) < 30)
        wait_until("target velocity reached", lambda: statusword(node) & TARGET_REACHED)
    node.sdo[0x6040].raw = 0x010F
    wait_until("standstill after the halt", lambda: abs(rpm(node)) < 1)
    expect("whether the shaft is held after a halt", statusword(node) & ENABLED, ENABLED)
    node.sdo[0x60FF].raw = 0
    node.sdo[0x6040].raw = 0x0F


def rpm(node):
    """By SDO, object 606C has 16 bits with a unit of 0.1 r/min (manual, object table)."""
    return int.from_bytes(node.sdo.upload(0x606C, 0)[:2], "little", signed=True) / 10


def position_by_pdo(network, node):
    node.nmt.state = "OPERATIONAL"
    answers = answers_of(node.tpdo[1])
    wait_until("TPDO1 every 100 ms", lambda: len(answers) >= 3)
    start = answers[-1][0x6064]
    command = node.rpdo[1]
    command[0x6060].raw = POSITION
    for target in (start + 40_000, start):
        command[0x6040].raw = 0x2F
        command[0x607A].raw = target
        command.transmit()
        wait_until(
            "target reached, by TPDO1",
            lambda: abs(answers[-1][0x6064] - target) <= 50 and answers[-1][0x6041] == ENABLED | TARGET_REACHED,
        )
    # RPDO2 with the current target moves nothing, and TPDO2 replies.
    answers = answers_of(node.tpdo[2])
    node.rpdo[2][0x607A].raw = start
    node.rpdo[2][0x6081].raw = 1000
    node.rpdo[2].transmit()
    wait_until("TPDO2 in answer to RPDO2", lambda: answers)
    network.sync.transmit()
    wait_until("TPDO2 in answer to SYNC", lambda: len(answers) == 2)


def velocity_by_pdo(node):
    answers = answers_of(node.tpdo[3])
    command = node.rpdo[3]
    for speed in (300, -300, 0):
        command[0x6040].raw = 0x0F
        command[0x6060].raw = VELOCITY
        command[0x60FF].raw = speed
        command.transmit()
        wait_until(f"{speed} r/min in TPDO3", lambda: answers and abs(answers[-1][0x606C] - speed) < 5)


def answers_of(pdo):
    """A list that collects the data of a TPDO from now on."""
    answers = []
    pdo.callbacks.clear()
    pdo.add_callback(lambda received: answers.append({variable.index: variable.raw for variable in received}))
    return answers


def interpolate(network, *nodes):
    starts, answers, on_sync = [], [], []
    for node in nodes:
        expect("special function that is stored", node.sdo[0x2619].raw, INTERPOLATION)
        node.sdo[0x6060].raw = INTERPOLATION
        enable(node)
        node.nmt.state = "OPERATIONAL"
        starts.append(position(node))
        answers.append(answers_of(node.tpdo[4]))
        on_sync.append(answers_of(node.tpdo[2]))
    # Two axes move at once in a proportion of 3 to 1, the third axis moves downwards.
    steps = (300, -100)
    cycles = 100

    def send(cycle):
        for node, start, step in zip(nodes, starts, steps):
            node.rpdo[4][0x607A].raw = start + step * cycle
            node.rpdo[4].transmit()

    # The drive ignores the first target after enabling, which is that of cycle 0.
    for cycle in range(cycles + 1):
        send(cycle)
        network.sync.transmit()
        wait_until(f"TPDO4 and TPDO2 of cycle {cycle}", lambda: all(len(each) > cycle for each in answers + on_sync))
    ends = [start + step * cycles for start, step in zip(starts, steps)]
    for node, end in zip(nodes, ends):
        wait_until("end of the line", lambda: abs(position(node) - end) <= 50)
    # Without SYNC a target is stored and moves nothing.
    send(cycles + 50)
    wait_until("answers to the targets that are held", lambda: all(len(each) == cycles + 2 for each in answers))
    time.sleep(0.2)
    for node, end in zip(nodes, ends):
        expect_near("position without SYNC", position(node), end, 50)
    expect("TPDO2 without SYNC", [len(each) for each in on_sync], [cycles + 1] * 2)
    send(cycles)
    network.sync.transmit()
    for node in nodes:
        node.sdo[0x6040].raw = 0


def master_lost(network, node):
    node.sdo[0x6060].raw = POSITION
    node.sdo[0x1016][1].raw = MASTER << 16 | 400
    node.sdo["Producer heartbeat time"].raw = 50
    states = []
    node.nmt.add_heartbeat_callback(states.append)
    heartbeat = network.send_periodic(0x700 + MASTER, [5], 0.05)
    # A move of some seconds, during which the master is lost.
    start = position(node)
    target = start + 600_000
    node.sdo[0x6081].raw = 300
    node.sdo[0x607A].raw = start
    node.sdo[0x6040].raw = 0x2F
    node.sdo[0x607A].raw = target
    wait_until("motor under way", lambda: position(node) > start + 50_000)
    heartbeat.stop()
    wait_until("heartbeat with the alarm code", lambda: states[-1] == IN_ALARM)
    expect("alarm code", node.sdo["Alarm code"].raw, COMMUNICATION_LOST)
    wait_until("standstill", lambda: abs(rpm(node)) < 1)
    expect("whether the drive had arrived before", position(node) < target - 100_000, True)
    heartbeat = network.send_periodic(0x700 + MASTER, [5], 0.05)
    wait_until("heartbeat with the state operational", lambda: states[-1] == 5)
    expect("alarm code", node.sdo["Alarm code"].raw, 0)
    wait_until("the motor resumes by itself", lambda: abs(position(node) - target) <= 50)
    heartbeat.stop()
    node.sdo[0x1016][1].raw = MASTER << 16
