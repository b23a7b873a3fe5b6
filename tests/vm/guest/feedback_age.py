"""Reads a recording of takt and counts, for all axes in operation together, how many cycles old the feedback was that a
cycle worked with: 0 is that of the same slot. Ends with an error when any was older.

    python3 feedback_age.py RECORDING.mcap
"""

import struct
import sys
from collections import Counter

from recording import messages

# In takt_msgs/msg/Axis (src/telemetry/messages/Axis.msg).
AGE, STATE = 66, 68
OPERATION_ENABLED = 4


def main(path):
    ages = Counter()
    for topic, _, axis in messages(path):
        if topic.startswith("/axis/") and axis[STATE] == OPERATION_ENABLED:
            ages[struct.unpack_from("<H", axis, AGE)[0]] += 1
    print(" ".join(f"{age}:{count}" for age, count in sorted(ages.items())))
    if set(ages) != {0}:
        sys.exit("feedback that was older than its slot was worked with, or none at all")


if __name__ == "__main__":
    main(sys.argv[1])
