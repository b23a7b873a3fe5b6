"""Judges how a run of takt ended, by what it printed (`takt run --json`), and what it left, by `takt report --json`.

    python3 run_verdict.py TAKT RUN.json EXIT_CODE RULE...

The run must have stopped in motion by one of the rules and have left a black box that says the same, or, where `borne` is
among them, have finished. Whatever happened, every cycle must be in the recording. Prints how it ended in a few words;
ends with an error that says what is wrong.
"""

import json
import subprocess
import sys


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


def judge_records(takt, run):
    telemetry = run["telemetry"]
    require(not telemetry["not_written"], f"not written: {telemetry['not_written']}")
    found = recorded(takt, telemetry["recording"])["cycles"]
    require(
        found == telemetry["records"] == run["cycles"] and telemetry["dropped"] == 0,
        f"of {run['cycles']} cycles {telemetry['dropped']} records were dropped and {found} are in the recording",
    )


def anomalies(run):
    """What the report counts, where there is any."""
    counted = {"missed slots": run["missed_slots"], "frames not traced": run["telemetry"]["frames_dropped"]}
    for bus in run["buses"]:
        for what in ("tx_overruns", "rx_overruns", "errors"):
            counted[f"{what} on {bus['interface']}"] = bus[what]
    return ", ".join(f"{what} {count}" for what, count in counted.items() if count)


def main(takt, path, code, *rules):
    with open(path, encoding="utf-8") as file:
        printed = file.read()
    require(printed, f"it ended with exit code {code} and without a report")
    run = json.loads(printed)
    require(run["failure"] is None, f"it failed: {run['failure']}")
    if run["stop"] is None and "borne" in rules:
        require(code == "0", f"nothing stopped it, and yet the exit code is {code}")
        ended = "borne, exit code 0"
    else:
        require(run["stop"] is not None, "nothing stopped it")
        ended = judge_stop(takt, run, int(code), rules)
    judge_records(takt, run)
    counted = anomalies(run)
    print(f"{ended}, {run['cycles']} cycles recorded" + (f"; {counted}" if counted else ""))


if __name__ == "__main__":
    main(*sys.argv[1:])
