"""Reads a recording of takt, and says whether every set-point kept the limits of its axis, whether the axes were at rest when their power
was removed, and whether anything but a request of the program has stopped them. Ends with an error where not. The limits are plain
numbers in the configuration, or begin with one.

    python3 limits_kept.py CONFIG RECORDING.mcap
"""

import struct
import sys
import tomllib

from recording import messages

# In takt_msgs/msg/Axis (src/telemetry/messages/Axis.msg).
POSITION_SET, VELOCITY_SET, STATE = 8, 24, 68
OPERATION_ENABLED = 4
# In takt_msgs/msg/Event.
KIND, TEXT = 16, 20
STOP = 1
# What a single-precision number of the recording may be off.
ROUNDING = 1e-6
# rad: set-points leave in whole counts of the encoders (19 bits), so that one at its limit is rounded.
COUNT = 1.2e-5
# rad/s (m/s): a joint that moves less is at rest.
AT_REST = 1e-3


def number(value):
    return float(value) if isinstance(value, (int, float)) else float(value.split()[0])


def main(config, path):
    with open(config, "rb") as file:
        limits = {f"/axis/{axis['name']}": axis["limits"] for axis in tomllib.load(file)["axis"]}
    broken, stops, fastest, last = [], [], 0.0, {}
    for topic, _, fields in messages(path):
        if topic in limits:
            if fields[STATE] != OPERATION_ENABLED:
                continue
            lowest, highest = map(number, limits[topic]["position"])
            velocity_limit = number(limits[topic]["velocity"])
            (position,) = struct.unpack_from("<d", fields, POSITION_SET)
            acceleration_limit = number(limits[topic]["acceleration"])
            velocity, acceleration = struct.unpack_from("<2f", fields, VELOCITY_SET)
            fastest = max(fastest, abs(velocity))
            last[topic] = velocity
            is_kept = (
                lowest - COUNT <= position <= highest + COUNT
                and abs(velocity) <= velocity_limit * (1 + ROUNDING)
                and abs(acceleration) <= acceleration_limit * (1 + ROUNDING)
            )
            if not is_kept:
                broken.append(f"{topic}: {position} rad, {velocity} rad/s, {acceleration} rad/s^2")
        elif topic == "/events" and fields[KIND] == STOP:
            (length,) = struct.unpack_from("<I", fields, TEXT)
            stops.append(bytes(fields[TEXT + 4 : TEXT + 3 + length]).decode())
    faults = [text for text in stops if "a stop was requested" not in text]
    moving = [topic for topic, velocity in last.items() if abs(velocity) > AT_REST]
    kept = f"{len(broken)} set-points beyond their limits" if broken else "limits kept"
    print(f"  {kept}, at up to {fastest:.3f} rad/s; {len(stops)} stops, {len(faults)} of them not asked for", end="; ")
    print("at rest in the end" if not moving else f"in motion in the end: {moving}")
    if broken or faults or moving or set(last) != set(limits):
        sys.exit("\n".join([*broken[:3], *faults, *moving]) or "an axis was never enabled")


if __name__ == "__main__":
    main(*sys.argv[1:])
