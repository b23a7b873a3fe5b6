"""A slave made of the package `canopen` and our data sheet of the eRob, which `takt run` brings up, enables, moves and shuts down.

The package provides NMT, SDO and PDOs. This file provides the states of CiA 402 and a joint that is always at its target.
"""

import json
import os
import subprocess

import canopen
from canopen.objectdictionary import ODVariable
from canopen.objectdictionary.datatypes import VISIBLE_STRING

import dictionary
import simulated
from difference import Difference, expect, expect_near

CONFIG = "tests/peers/slave.toml"
DATA_SHEET = "configs/eds/erob-canopen.eds"
NODE = 1
NAME = "a slave that is written in Python"
COUNTS_PER_TURN = 524_288
COMMUNICATION = range(0x1005, 0x2000)
UPLOAD_SEGMENT = 0x60
# Error code and error register of an emergency message.
BLOCKED_ROTOR, GENERIC_AND_CURRENT = 0x7121, 0x03
RESET_NODE, RESET_COMMUNICATION, START, ENTER_PRE_OPERATIONAL = 129, 130, 1, 128

# Statusword after a controlword (its bits 0 to 3 and 7), from one of the statuswords named.
SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED, FAULT = 0x0240, 0x0231, 0x0233, 0x0237, 0x0208
TRANSITIONS = {
    0x06: {SWITCH_ON_DISABLED: READY, SWITCHED_ON: READY, ENABLED: READY},
    0x07: {READY: SWITCHED_ON, ENABLED: SWITCHED_ON},
    0x0F: {READY: ENABLED, SWITCHED_ON: ENABLED},
}


class Slave:
    def __init__(self, network):
        description = canopen.import_od(DATA_SHEET, NODE)
        name = ODVariable("Device name", 0x1008)
        name.data_type, name.access_type, name.default = VISIBLE_STRING, "const", NAME
        description.add_object(name)
        self.node = network.create_node(NODE, description)
        self.statusword = SWITCH_ON_DISABLED
        self.mode = 0
        self.position = -12_345
        self.writes = []
        self.states = []
        self.segments = 0
        self.breaks_above = None
        self.start_from_defaults(range(0, 0x10000))
        self.node.sdo[0x6076].raw = 31_000
        self.node.sdo[0x6075].raw = 6_300
        self.node.add_read_callback(self.read)
        self.node.add_write_callback(self.written)
        network.subscribe(0x000, self.command)
        network.subscribe(0x080, self.synchronise)
        network.subscribe(0x600 + NODE, self.requested)

    def start_from_defaults(self, indices):
        for entry in dictionary.entries(self.node.object_dictionary):
            if entry.index in indices and entry.data_type != VISIBLE_STRING:
                value = entry.encode_raw(entry.default or 0)
                self.node.data_store.setdefault(entry.index, {})[entry.subindex] = value

    def read(self, index, subindex, od):
        return {0x6041: self.statusword, 0x6061: self.mode, 0x6064: self.position}.get(index)

    def written(self, index, subindex, od, data):
        self.writes.append((index, subindex, od.decode_raw(data)))
        if index == 0x6040:
            self.control(od.decode_raw(data))
        elif index == 0x6060:
            self.mode = od.decode_raw(data)

    def control(self, word):
        if word & 0x02 == 0 and (self.statusword != FAULT or word & 0x80):
            self.statusword = SWITCH_ON_DISABLED
        self.statusword = TRANSITIONS.get(word & 0x8F, {}).get(self.statusword, self.statusword)
        if self.states[-1:] != [self.statusword]:
            self.states.append(self.statusword)

    def command(self, can_id, data, timestamp):
        command, node = data
        if node not in (0, NODE):
            return
        if command in (RESET_NODE, RESET_COMMUNICATION):
            # The package changes the state, but the application must send the boot-up message.
            self.start_from_defaults(COMMUNICATION)
            self.node.nmt.send_command(command)
            self.node.nmt.send_command(ENTER_PRE_OPERATIONAL)
        elif command == START:
            self.node.rpdo.read()
            self.node.tpdo.read()

    def requested(self, can_id, data, timestamp):
        self.segments += data[0] & 0xE0 == UPLOAD_SEGMENT

    def synchronise(self, can_id, data, timestamp):
        """Applies the data of RPDO1 and sends TPDO1, both with the mapping of the master."""
        if self.node.nmt.state != "OPERATIONAL":
            return
        command, feedback = self.node.rpdo[1], self.node.tpdo[1]
        if command.timestamp is not None:
            self.control(command[0x6040].raw)
            if self.statusword == ENABLED:
                self.position = command[0x607A].raw
                self.watch()
        for variable in feedback:
            variable.raw = self.node.sdo[variable.index].raw
        feedback.transmit()

    def watch(self):
        if self.breaks_above is not None and self.position > self.breaks_above:
            self.statusword = FAULT
            self.node.emcy.send(BLOCKED_ROTOR, GENERIC_AND_CURRENT)

    def last_written(self, index, subindex=0):
        values = [value for *place, value in self.writes if place == [index, subindex]]
        if not values:
            raise Difference(f"{index:04X}:{subindex:02X} was never written")
        return values[-1]


def run(network, interface, case):
    slave = Slave(network)
    report = {}
    case("is brought up, moved and left by `takt run`", lambda: report.update(takt_run(interface, 0)))
    case("has got its communication parameters", lambda: communication(slave))
    case("has got its process data, mapped as the standard wants it", lambda: mapping(slave))
    case("has got its mode, target and limits", lambda: drive(slave))
    case("was led through the states, and is where the report says", lambda: motion(slave, report))
    case("stops `takt run` by an emergency message", lambda: emergency(slave, interface))


def takt_run(interface, exit_code):
    command = [simulated.TAKT, "run", os.path.abspath(CONFIG), "--bus", f"can={interface}", "--json"]
    # There it writes its own log of the bus.
    result = subprocess.run(command, cwd=os.environ["OUT"], capture_output=True, text=True, timeout=120)
    if result.returncode != exit_code:
        raise Difference(f"`takt run` ended with {result.returncode}: {result.stderr.strip()} {result.stdout.strip()}")
    return json.loads(result.stdout)


def communication(slave):
    expect("segments of the device name that were fetched", slave.segments, -(-len(NAME) // 7))
    expect("SYNC identifier", slave.last_written(0x1005), 0x80)
    period = [value for index, _, value in slave.writes if index == 0x1006]
    expect("cycle period in µs, and its end", period, [50_000, 0])
    expect("error behaviour", slave.last_written(0x1029, 1), 2)
    consumer = [value for index, _, value in slave.writes if index == 0x1016]
    expect("heartbeat consumer of the drive, and its end", consumer, [127 << 16 | 20_000, 0])
    producer = [value for index, _, value in slave.writes if index == 0x1017]
    expect("heartbeat producer of the drive, and its end", producer, [200, 0])


def mapping(slave):
    for communication_index, mapping_index, wanted in ((0x1400, 0x1600, [0x6040, 0x607A]), (0x1800, 0x1A00, [0x6041, 0x6061, 0x6064])):
        count = slave.last_written(mapping_index, 0)
        mapped = [slave.last_written(mapping_index, number) >> 16 for number in range(1, count + 1)]
        expect(f"objects mapped by {mapping_index:04X}", sorted(mapped), sorted(wanted))
        expect(f"transmission type in {communication_index:04X}", slave.last_written(communication_index, 2), 1)
        # CiA 301: invalid, count 0, the objects, the count, valid.
        order = [(index, subindex) for index, subindex, _ in slave.writes if index in (communication_index, mapping_index)]
        expect("first and last write", [order[0], order[-1]], [(communication_index, 1)] * 2)
        identifiers = [value for index, subindex, value in slave.writes if (index, subindex) == (communication_index, 1)]
        expect("whether the PDO is invalid while it is changed", [value >> 31 for value in identifiers], [1, 0])
        counts = [value for index, subindex, value in slave.writes if (index, subindex) == (mapping_index, 0)]
        expect("counts of objects", counts, [0, count])


def drive(slave):
    expect("mode", slave.last_written(0x6060), 8)
    expect("target before enabling", slave.last_written(0x607A), -12_345)
    expect("profile velocity in counts/s", slave.last_written(0x6081), COUNTS_PER_TURN * 45 // 360)
    expect("interpolation time", (slave.last_written(0x60C2, 1), slave.last_written(0x60C2, 2)), (50, -3))


def motion(slave, report):
    joint = report["axes"][0]
    expect("states", slave.states[:4], [SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED])
    expect("state in the end", slave.statusword, SWITCH_ON_DISABLED)
    expect_near("position of the slave in counts", slave.position, COUNTS_PER_TURN * 30 / 360, 1)
    counts_per_rad = COUNTS_PER_TURN / 6.283185307179586
    expect_near("final position in the report", joint["final_position"] * counts_per_rad, slave.position, 1)
    expect("reason of a stop", report["stop"], None)


def emergency(slave, interface):
    slave.position = 0
    slave.breaks_above = COUNTS_PER_TURN * 5 // 360
    stop = takt_run(interface, 1)["stop"]
    # Object 603F stays 0, so only the emergency message shows the error.
    expect("why the run stopped", (stop["rule"], stop["axis"], stop["value"]), ("drive_fault", "joint", BLOCKED_ROTOR))
