"""Watches the drives of an interface while their master dies: asks each for its position and its statusword (6064, 6041)
about every other millisecond, from when it is started until two seconds after the last SYNC.

    python3 standstill.py INTERFACE=NODE,NODE... [INTERFACE=...]

Prints, in milliseconds after the last SYNC: when the last position had changed by more than the noise of an encoder, and
when the last drive had let go, was in an alarm, or had fallen silent, as one does that is stopped (CiA 301). Ends with an
error when one moved or was enabled to the end, or when there was no SYNC at all.
"""

import select
import socket
import struct
import sys
import time

FRAME = struct.Struct("<IB3x8s")
SYNC, EMERGENCY, REQUEST, ANSWER = 0x080, 0x080, 0x600, 0x580
POSITION, STATUSWORD = (0x6064, 0), (0x6041, 0)
INTERVAL_S, WATCHED_S, PATIENCE_S = 0.002, 2.0, 10.0
NOISE_COUNTS = 8
# Ready to switch on, switched on, operation enabled, and no fault (CiA 402).
ENABLED_MASK, ENABLED = 0x006F, 0x0027


class Drive:
    def __init__(self):
        self.position = None
        self.moved_s = 0.0
        self.enabled_s = 0.0

    def hears(self, index, value, at_s):
        if index == POSITION[0]:
            if self.position is None or abs(value - self.position) > NOISE_COUNTS:
                self.position, self.moved_s = value, at_s
        elif value & ENABLED_MASK == ENABLED:
            self.enabled_s = at_s


def opened(interface):
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    # Nothing but what is looked at: to read every frame would take all of an emulated processor.
    wanted = struct.pack("=IIII", SYNC, 0x7FF, ANSWER, 0x780)
    bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, wanted)
    bus.bind((interface,))
    return bus


def main(*buses):
    drives, interfaces = {}, []
    for bus in buses:
        name, nodes = bus.split("=")
        interfaces.append((opened(name), name, [int(node) for node in nodes.split(",")]))
        drives.update({(name, int(node)): Drive() for node in nodes.split(",")})
    begun_s, last_sync_s, asked_s, wanted = time.time(), 0.0, 0.0, POSITION
    names = {bus: name for bus, name, _ in interfaces}
    while time.time() < (last_sync_s + WATCHED_S if last_sync_s else begun_s + PATIENCE_S):
        if time.time() >= asked_s + INTERVAL_S:
            asked_s, wanted = time.time(), STATUSWORD if wanted is POSITION else POSITION
            for bus, _, nodes in interfaces:
                for node in nodes:
                    bus.send(FRAME.pack(REQUEST + node, 8, struct.pack("<BHBI", 0x40, *wanted, 0)))
        for bus in select.select(list(names), [], [], INTERVAL_S / 2)[0]:
            identifier, _, data = FRAME.unpack(bus.recv(FRAME.size))
            now_s = time.time()
            if identifier == SYNC:
                last_sync_s = now_s
            elif identifier & 0x780 == ANSWER and data[0] in (0x43, 0x4B):
                index = struct.unpack_from("<H", data, 1)[0]
                drives[names[bus], identifier & 0x7F].hears(index, struct.unpack_from("<i", data, 4)[0], now_s)
    if not last_sync_s:
        sys.exit("there was no SYNC")
    end_s = time.time()
    moved_s = max(drive.moved_s for drive in drives.values())
    enabled_s = max(drive.enabled_s for drive in drives.values())
    silent = [key for key, drive in drives.items() if not drive.enabled_s]
    if silent:
        sys.exit(f"never seen under power: {silent}")
    if end_s - max(moved_s, enabled_s) < WATCHED_S / 4:
        sys.exit(f"a drive moved or was enabled until {(max(moved_s, enabled_s) - last_sync_s) * 1e3:.0f} ms after the last SYNC")
    print(f"{(moved_s - last_sync_s) * 1e3:.1f} {(enabled_s - last_sync_s) * 1e3:.1f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
