"""Tests a simulated eRob with Modbus-RTU, with the package `pymodbus` as its master.

    python tests/peers/modbus_master.py LINE

LINE is the pseudo-terminal of a line with the slaves 2 and 3. Ends with 1 and a sentence at the first difference.
"""

import sys
import time

from pymodbus import ModbusException
from pymodbus.client import ModbusSerialClient

from difference import Difference, expect, expect_near, wait_until

SLAVE = 2
POSITION = 3


def main(line):
    client = ModbusSerialClient(line, baudrate=115200, timeout=0.5, retries=0)
    if not client.connect():
        sys.exit(f"{line} cannot be opened")
    try:
        reads_registers(client)
        refuses_what_it_does_not_have(client)
        moves(client)
        is_silent_for_others(client)
    except Difference as difference:
        sys.exit(str(difference))
    finally:
        client.close()


def reads_registers(client):
    expect("the addresses", [read(client, 0, 3, slave) for slave in (2, 3)], [[2, 4, 0], [3, 4, 0]])
    write(client, 0x004D, [0, 20000])
    expect("what was written", read(client, 0x004D, 2), [0, 20000])
    expect("a block of 13 registers", len(read(client, 0x006C, 13)), 13)


def refuses_what_it_does_not_have(client):
    for address, count in ((0x0062, 1), (0x00F0, 1), (0x0061, 2)):
        answer = client.read_holding_registers(address, count=count, device_id=SLAVE)
        expect(f"the exception of {address:04X}", answer.exception_code, 2)
    answer = client.write_register(0x0040, 9, device_id=SLAVE)
    expect("the exception of a wrong value", answer.exception_code, 3)
    answer = client.read_coils(0, count=1, device_id=SLAVE)
    expect("the exception of a function that it does not have", answer.exception_code, 1)


def moves(client):
    """The absolute move of the manual, 5.1, by a hundredth of a turn."""
    for register, value in ((0x0040, POSITION), (0x0042, 0), (0x0041, 1)):
        write_one(client, register, value)
    for register, value in ((0x0049, 1_000_000), (0x004B, 1_000_000), (0x0047, 50_000), (0x0045, 0)):
        write_double(client, register, value)
    write_one(client, 0x00F0, 1)
    time.sleep(0.55)
    expect("the status of an enabled motor", read(client, 0x0063, 1), [1])
    write_double(client, 0x0043, -5243)
    write_one(client, 0x00F1, 1)
    wait_until("the joint has arrived", lambda: read(client, 0x0063, 1) == [4])
    high, low = read(client, 0x0066, 2)
    position = int.from_bytes(((high << 16) | low).to_bytes(4), signed=True)
    expect_near("the position", position, -5243, 60)
    expect("motion and fault", read(client, 0x0060, 2), [0, 0])
    write_one(client, 0x00F0, 0)
    expect("the status of a disabled motor", read(client, 0x0063, 1), [0])


def is_silent_for_others(client):
    try:
        answer = client.read_holding_registers(0, count=1, device_id=9)
    except ModbusException:
        return
    raise Difference(f"slave 9 is not there and answers {answer}")


def read(client, address, count, slave=SLAVE):
    return sound(client.read_holding_registers(address, count=count, device_id=slave)).registers


def write_one(client, address, value):
    sound(client.write_register(address, value, device_id=SLAVE))


def write_double(client, address, value):
    bits = value & 0xFFFF_FFFF
    write(client, address, [bits >> 16, bits & 0xFFFF])


def write(client, address, values):
    sound(client.write_registers(address, values, device_id=SLAVE))


def sound(answer):
    if answer.isError():
        raise Difference(f"the slave refuses: {answer}")
    return answer


if __name__ == "__main__":
    main(sys.argv[1])
