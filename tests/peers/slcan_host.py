"""Tests a simulated SLCAN adapter with the package `python-can` as its host, and the drive behind it with the package `canopen`.

    python tests/peers/slcan_host.py LINE

LINE is the pseudo-terminal of the adapter; behind it is the drive of configs/first.toml. Ends with 1 and a sentence at the first
difference.
"""

import sys

import can
import canopen

from difference import Difference, expect, expect_abort, wait_until

NODE = 1
NO_OBJECT = 0x0602_0000
DEVICE_TYPE = 0x0042_0192


def main(line):
    try:
        is_an_adapter(line)
        is_deaf_at_another_bit_rate(line)
        brings_the_drive(line)
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


def sdo_read():
    return can.Message(arbitration_id=0x600 + NODE, data=[0x40, 0, 0x10, 0, 0, 0, 0, 0], is_extended_id=False)


if __name__ == "__main__":
    main(sys.argv[1])
