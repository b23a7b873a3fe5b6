"""Reads a recording of takt as far as takt writes the format (https://mcap.dev/spec, chunks without compression), so that
nothing need be installed; tests/read_recording.py reads it with the format's own reader.
"""

import mmap
import struct

CHANNEL, MESSAGE, CHUNK = 4, 5, 6


def records(data):
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        yield code, data[at + 9 : at + 9 + length]
        at += 9 + length


def unpacked(data):
    for code, body in records(data):
        if code == CHUNK:
            name_length = struct.unpack_from("<I", body, 28)[0]
            assert name_length == 0, "the chunk is compressed"
            yield from records(body[32 + 8 :])
        else:
            yield code, body


def messages(path):
    """The topic, the time in nanoseconds of CLOCK_REALTIME and the fields of every message, in their order. The fields
    are CDR (src/telemetry/messages/*.msg), without the encapsulation of four bytes."""
    with open(path, "rb") as file:
        # Ten minutes of six axes are half a gigabyte.
        data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))[8:]
    topics = {}
    for code, body in unpacked(data):
        if code == CHANNEL:
            channel, _, length = struct.unpack_from("<HHI", body)
            topics[channel] = bytes(body[8 : 8 + length]).decode()
        elif code == MESSAGE:
            channel, _, log_time_ns = struct.unpack_from("<HIQ", body)
            yield topics[channel], log_time_ns, body[22 + 4 :]
