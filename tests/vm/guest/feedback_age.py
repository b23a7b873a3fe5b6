"""Reads a recording of takt and counts, for all axes in operation together, how many cycles old the feedback was that a
cycle worked with: 0 is that of the same slot. Ends with an error when any was older.

    python3 feedback_age.py RECORDING.mcap

The format is read here as far as takt writes it (https://mcap.dev/spec, chunks without compression), so that nothing need
be installed; tests/read_recording.py reads it with the format's own reader.
"""

import struct
import sys
from collections import Counter

CHANNEL, MESSAGE, CHUNK = 4, 5, 6
# takt_msgs/msg/Axis as CDR (src/telemetry/messages/Axis.msg), after the encapsulation of four bytes.
ENCAPSULATION, AGE, STATE = 4, 66, 68
OPERATION_ENABLED = 4


def records(data):
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        yield code, data[at + 9 : at + 9 + length]
        at += 9 + length


def chunk_records(body):
    name_length = struct.unpack_from("<I", body, 28)[0]
    assert name_length == 0, "the chunk is compressed"
    return records(body[32 + 8 :])


def main(path):
    with open(path, "rb") as file:
        data = memoryview(file.read())[8:]
    axes, ages = set(), Counter()
    for code, body in records(data):
        for inner, record in chunk_records(body) if code == CHUNK else []:
            if inner == CHANNEL:
                channel, _, length = struct.unpack_from("<HHI", record)
                if bytes(record[8 : 8 + length]).startswith(b"/axis/"):
                    axes.add(channel)
            elif inner == MESSAGE and struct.unpack_from("<H", record)[0] in axes:
                axis = record[22 + ENCAPSULATION :]
                if axis[STATE] == OPERATION_ENABLED:
                    ages[struct.unpack_from("<H", axis, AGE)[0]] += 1
    print(" ".join(f"{age}:{count}" for age, count in sorted(ages.items())))
    if set(ages) != {0}:
        sys.exit("feedback that was older than its slot was worked with, or none at all")


if __name__ == "__main__":
    main(sys.argv[1])
