"""Tests simulated SLCAN adapters with the package `python-can` as their host, and the drive behind one with the package `canopen`.

    python tests/peers/slcan_host.py LINE SWITCHING PLAIN

These are the pseudo-terminals of three adapters. Behind LINE is the drive of configs/first.toml, behind SWITCHING and PLAIN are the
motors of configs/hollow-leg-fd.toml, which take frames of CAN FD with and without bit-rate switching. Ends with 1 and a sentence at the
first difference.
"""

import sys

import can
import canopen

from difference import Difference, expect, expect_abort, wait_until

NODE = 1
NO_OBJECT = 0x0602_0000
DEVICE_TYPE = 0x0042_0192


# A hollow-shaft motor and its replies; position mode, without torque (chapter on CAN FD of its manual).
MOTOR, MASTER = 0x001, 0x065
AT_REST = bytes([0] * 11 + [2, 0, 0, 0, 0])


def main(line, switching, plain):
    try:
        is_an_adapter(line)
        is_deaf_at_another_bit_rate(line)
        brings_the_drive(line)
        brings_a_motor_of_can_fd(switching, has_switch=True)
        brings_a_motor_of_can_fd(plain, has_switch=False)
    except Difference as difference:
        sys.exit(str(difference))
    print("slcan: all done")


def opened(line, bit_rate=1_000_000, **options):
    return can.Bus(interface="slcan", channel=line, bitrate=bit_rate, sleep_after_open=0, **options)


def is_an_adapter(line):
    with opened(line) as bus:
        expect("the version of hardware and software", bus.get_version(2.0), (10, 13))
        expect("the serial number", bus.get_serial_number(2.0), "T4KT")


def is_deaf_at_another_bit_rate(line):
    with opened(line, 500_000) as bus:
        bus.send(sdo_read())
        expect("an answer at another bit rate", bus.recv(0.5), None)


def brings_the_drive(line):
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.1
    network.connect(interface="slcan", channel=line, bitrate=1_000_000, sleep_after_open=0)
    try:
        node = network.add_node(NODE, "configs/eds/erob-canopen.eds")
        node.sdo.RESPONSE_TIMEOUT = 5.0
        expect("the device type", node.sdo[0x1000].raw, DEVICE_TYPE)
        expect_abort("an object that is not there", NO_OBJECT, lambda: node.sdo.upload(0x5FFF, 0))
        node.sdo[0x6083].raw = 123_456
        expect("what was written", node.sdo[0x6083].raw, 123_456)
        states = []
        node.nmt.add_heartbeat_callback(states.append)
        node.sdo[0x1017].raw = 50
        node.nmt.state = "OPERATIONAL"
        wait_until("the node is operational", lambda: states[-1:] == [5])
        node.nmt.state = "PRE-OPERATIONAL"
        wait_until("the node is pre-operational", lambda: states[-1:] == [127])
    finally:
        network.disconnect()


def brings_a_motor_of_can_fd(line, has_switch):
    rates = {"nom_bitrate": 1_000_000, "nom_sample_point": 80, "data_bitrate": 5_000_000, "data_sample_point": 75}
    timing = can.BitTimingFd.from_sample_point(f_clock=80_000_000, **rates)
    with can.Bus(interface="slcan", channel=line, timing=timing, sleep_after_open=0) as bus:
        request = {"arbitration_id": MOTOR, "is_extended_id": False, "is_fd": True, "bitrate_switch": has_switch}
        bus.send(can.Message(data=AT_REST, dlc=len(AT_REST), **request))
        reply = bus.recv(5.0)
        if reply is None:
            raise Difference("the motor did not reply")
        seen = reply.arbitration_id, reply.is_fd, reply.bitrate_switch
        expect("the identifier and the kind of the reply", seen, (MASTER, True, has_switch))
        # Position, velocity and current, the mode, no torque, nothing, 30 °C, the motor.
        expect("the reply", bytes(reply.data), bytes([0] * 11 + [2, 0, 0, 30, 1]))


def sdo_read():
    return can.Message(arbitration_id=0x600 + NODE, data=[0x40, 0, 0x10, 0, 0, 0, 0, 0], is_extended_id=False)


if __name__ == "__main__":
    main(*sys.argv[1:])
