"""Judges from outside after how many cycles a command is on the wire: by the times of the calls, and what a listener has seen.

    python3 front_latency.py CALLS WIRE

CALLS has a line for each call: the command and CLOCK_REALTIME before it, and of a point the lag of the stream in ns. WIRE is a log of candump with the
kernel's times: SYNC (080), which begins a cycle, and the set-points of the axis (201). A move shows in the first set-point that is another
one than before, a stop in the first whose step is another one than at the speed before. Prints how many of the calls were on the
wire by the next cycle, of points by the next one after the lag, the median and the worst. Fails when a call was not to be judged.
"""

import math
import statistics
import sys
from bisect import bisect_right

# Set-points leave in whole counts, so that equal steps differ by one, and those of a trajectory by two.
ROUNDING = 1


def wire(path):
    """The times of SYNC in µs, and the set-points of the axis as (cycle, counts)."""
    cycles, set_points = [], []
    with open(path, encoding="ascii") as log:
        for line in log:
            time, _, frame = line.split()[:3]
            identifier, data = frame.split("#")
            seconds, fraction = time[1:-1].split(".")
            if identifier == "080":
                cycles.append(int(seconds) * 1_000_000 + int(fraction))
            elif cycles:
                counts = int.from_bytes(bytes.fromhex(data)[POSITION : POSITION + 4], "little", signed=True)
                set_points.append((len(cycles) - 1, counts))
    return cycles, set_points


# In the set-point of eRob: the control word comes first.
POSITION = 2


def calls(path):
    with open(path, encoding="ascii") as file:
        for line in file:
            command, at, *lag_ns = line.split()
            seconds, fraction = at.split(".")
            yield command, int(seconds) * 1_000_000 + int(fraction), int(lag_ns[0]) if lag_ns else 0


def cycles_until(set_points, first, cycle):
    """Cycles from that of the call to the first set-point whose step is not what it was before the call."""
    before = set_points[first - 1][1] - set_points[first - 2][1]
    # A set-point at rest is exactly the one before.
    bearing = 0 if before == 0 else 2 * ROUNDING
    for (at, counts), (_, last) in zip(set_points[first:], set_points[first - 1 :]):
        if abs(counts - last - before) > bearing:
            return at - cycle
    return None


def main(calls_path, wire_path):
    cycles, set_points = wire(wire_path)
    numbers = [cycle for cycle, _ in set_points]
    found, lost = {}, []
    for command, at, lag_ns in calls(calls_path):
        cycle = bisect_right(cycles, at) - 1
        # Set-points of the cycle of the call may have left already.
        first = bisect_right(numbers, cycle - 1)
        # A stream that follows smoothly creeps to its last point, a count now and then.
        is_at_rest = abs(set_points[first - 1][1] - set_points[first - 2][1]) <= ROUNDING
        taken = cycles_until(set_points, first, cycle)
        if taken is None or is_at_rest == (command == "stop"):
            around = [counts for _, counts in set_points[max(first - 4, 0) : first + 20]]
            lost.append(f"{command} at {at} µs, set-points {around}")
            continue
        found.setdefault(command, []).append((taken, math.ceil(lag_ns / 1e6)))
    for command, counted in found.items():
        taken, lags = zip(*counted)
        in_time = sum(cycles_taken <= lag + 1 for cycles_taken, lag in counted)
        by = f"a cycle after the lag (of {min(lags)} to {max(lags)})" if any(lags) else "the next cycle"
        print(f"  {command:6} {in_time:3} of {len(taken)} by {by}; median {statistics.median(taken):g}, at most {max(taken)} cycles")
    if lost or not found:
        lines = "\n".join(lost)
        sys.exit(f"{len(lost)} calls cannot be judged, the axis was not as it should be before them, or never changed:\n{lines}")


main(*sys.argv[1:])
