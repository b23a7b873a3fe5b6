"""Judges how a run of takt ended, by what it printed (`takt run --json`), and what it left, by `takt report --json`.

    python3 run_verdict.py TAKT RUN.json EXIT_CODE FAULT_AT RULE...

The run must have stopped in motion by one of the rules and have left a black box that says the same, or, where `borne` is
among them, have finished. Whatever happened, every cycle must be in the recording, and no set-point may be further from
the one before than a cycle's motion at the limit of the velocity; with `records_lost` among the rules there is no such
recording, and the run must have said so; with `nothing_lost` it must have counted no missed slot, no frame that was not sent,
received or traced, and no error of a bus. Prints how it ended in a few words; ends with an error that says what is wrong.

With FAULT_AT, the time of the fault in seconds of CLOCK_REALTIME (`-` without one), a stop is followed by a second line:
its rule, its category, and after how many milliseconds it was noticed and all axes that are still heard were at rest.
"""

import json
import struct
import subprocess
import sys

from recording import messages

# In takt_msgs/msg/Axis (src/telemetry/messages/Axis.msg).
AGE, STATE = 66, 68
OPERATION_ENABLED = 4
# Half a millimetre of a linear axis; of a rotary one, what it is at a radius of half a metre.
AT_REST = {"rad": 1e-3, "m": 5e-4}


def require(condition, sentence):
    if not condition:
        sys.exit(sentence)


def recorded(takt, path):
    printed = subprocess.run([takt, "report", "--json", path], capture_output=True, text=True)
    require(printed.stdout, f"takt report cannot read {path}: {printed.stderr.strip()}")
    return json.loads(printed.stdout)


def judge_stop(takt, run, code, rules):
    stop, boxes = run["stop"], run["telemetry"]["black_boxes"]
    require(stop["rule"] in rules, f"it stopped by {stop['rule']} ({stop['reason']})")
    require(stop["phase"] == "moving", f"it stopped while {stop['phase']}, not in motion")
    require(code == 1, f"it stopped with exit code {code}")
    require(boxes, "no black box was written")
    cause = recorded(takt, boxes[0])["cause"]
    require(cause and cause["rule"] == stop["rule"], f"the black box tells of {cause}")
    return f"exit code 1, {stop['rule']}, category {stop['category']} in slot {stop['slot']}, black box written"


def judge_records(takt, run, must_be_lost):
    telemetry = run["telemetry"]
    if must_be_lost:
        require(telemetry["not_written"], "nothing is said of what could not be written")
        return f"told: {telemetry['not_written'][0]}"
    require(not telemetry["not_written"], f"not written: {telemetry['not_written']}")
    found = recorded(takt, telemetry["recording"])["cycles"]
    require(
        found == telemetry["records"] == run["cycles"] and telemetry["dropped"] == 0,
        f"of {run['cycles']} cycles {telemetry['dropped']} records were dropped and {found} are in the recording",
    )
    return f"{found} cycles recorded"


def axis_cycles(run):
    """The name of the axis, the time, the slot, the set-point, the position, whether it was just reported, and whether the
    drive was under power, of every axis in every cycle."""
    for topic, at_ns, axis in messages(run["telemetry"]["recording"]):
        if topic.startswith("/axis/"):
            slot, position_set, position = struct.unpack_from("<Qdd", axis)
            is_heard = struct.unpack_from("<H", axis, AGE)[0] == 0
            yield topic[len("/axis/") :], at_ns, slot, position_set, position, is_heard, axis[STATE] == OPERATION_ENABLED


def judge_steps(run):
    """A set-point may be as far from the one before as the axis goes in a period, however many slots were missed between."""
    allowed = {axis["name"]: axis["limits"]["velocity"] * run["cycle_ns"] / 1e9 * 1.00001 for axis in run["axes"]}
    last = {}
    for name, _, slot, position_set, _, _, is_on in axis_cycles(run):
        before, was_on = last.get(name, (position_set, False))
        step = abs(position_set - before)
        require(
            step <= allowed[name] or not (was_on and is_on),
            f"{name}: the set-point jumped by {step} in slot {slot}; a cycle at the limit is {allowed[name]}",
        )
        last[name] = position_set, is_on


def stop_times(run, fault_at_s):
    """When the fault was noticed, and when the last axis came within tolerance of where it came to rest, in ms after it.
    An axis that is silent for a while is known to be at rest when it is heard again; one that never is, is not known."""
    fault_at_ns = int(float(fault_at_s) * 1e9)
    noticed_ns, heard = fault_at_ns, {axis["name"]: [] for axis in run["axes"]}
    for name, at_ns, slot, _, position, is_heard, _ in axis_cycles(run):
        if slot <= run["stop"]["slot"]:
            noticed_ns = at_ns
        elif is_heard:
            heard[name].append((at_ns, position))
    noticed_ms = f"{(noticed_ns - fault_at_ns) / 1e6:.1f}"
    rest_ns = noticed_ns
    for axis in run["axes"]:
        positions = heard[axis["name"]]
        if not positions:
            return noticed_ms, "-"
        moving = [at_ns for at_ns, position in positions if abs(position - positions[-1][1]) > AT_REST[axis["unit"]]]
        rest_ns = max([rest_ns, positions[0][0], *moving[-1:]])
    return noticed_ms, f"{(rest_ns - fault_at_ns) / 1e6:.1f}"


def anomalies(run):
    """What the report counts, where there is any."""
    counted = {"missed slots": run["missed_slots"], "frames not traced": run["telemetry"]["frames_dropped"]}
    for bus in run["buses"]:
        for what in ("tx_overruns", "rx_overruns", "errors"):
            counted[f"{what} on {bus['interface']}"] = bus[what]
    return ", ".join(f"{what} {count}" for what, count in counted.items() if count)


def main(takt, path, code, fault_at_s, *rules):
    with open(path, encoding="utf-8") as file:
        printed = file.read()
    require(printed, f"it ended with exit code {code} and without a report")
    run = json.loads(printed)
    require(run["failure"] is None, f"it failed: {run['failure']}")
    if run["stop"] is None and "borne" in rules:
        # What could not be written is no success, and no stop either.
        expected = "1" if "records_lost" in rules else "0"
        require(code == expected, f"nothing stopped it, and yet the exit code is {code}, not {expected}")
        ended = f"borne, exit code {code}"
    else:
        require(run["stop"] is not None, "nothing stopped it")
        ended = judge_stop(takt, run, int(code), rules)
    counted = anomalies(run)
    require("nothing_lost" not in rules or not counted, f"it has counted {counted}")
    is_lost = "records_lost" in rules
    records = judge_records(takt, run, is_lost)
    if not is_lost:
        judge_steps(run)
    print(f"{ended}, {records}" + (f"; {counted}" if counted else ""))
    if run["stop"] and not is_lost and fault_at_s != "-":
        noticed_ms, rest_ms = stop_times(run, fault_at_s)
        print(f"{run['stop']['rule']} {run['stop']['category']} {noticed_ms} {rest_ms}")


if __name__ == "__main__":
    main(*sys.argv[1:])
