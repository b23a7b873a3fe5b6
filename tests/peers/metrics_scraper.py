"""Scrapes a run as Prometheus does, and reads the text with the parser of the package `prometheus_client`.

    python tests/peers/metrics_scraper.py TAKT

Ends with 1 and a sentence at the first difference.
"""

import math
import re
import subprocess
import sys
import tempfile
import time
import urllib.request

from prometheus_client.parser import text_string_to_metric_families

from difference import Difference, expect

HISTOGRAMS = ("takt_wake_seconds", "takt_sync_release_seconds", "takt_compute_seconds")
AXES = {f"joint{number}" for number in range(1, 7)}


def main(takt):
    with tempfile.TemporaryDirectory() as folder:
        command = [takt, "run", "configs/arm6-erob.toml", "--serve", f"{folder}/arm", "--metrics", "0", "--record", f"{folder}/run.mcap"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as run:
            try:
                address = address_of(run)
                first = first_with_positions(address)
                is_complete(first)
                time.sleep(1)
                counters_go_up(first, scrape(address))
            except Difference as difference:
                sys.exit(str(difference))
            finally:
                run.terminate()
    print("metrics: all done")


def address_of(run):
    address = None
    for line in run.stderr:
        found = re.search(r"metrics at (http://\S+)", line)
        address = found[1] if found else address
        if "served by the name" in line:
            return address
    raise Difference("the run has ended before it was served")


def first_with_positions(address):
    """What is scraped once the drives have reported, which is some cycles after the address is known."""
    until = time.monotonic() + 20
    while time.monotonic() < until:
        families = scrape(address)
        if families["takt_axis_position"].samples:
            return families
        time.sleep(0.1)
    raise Difference("no axis has shown a position for 20 s")


def scrape(address):
    with urllib.request.urlopen(address, timeout=10) as reply:
        expect("the content type", reply.headers["Content-Type"], "text/plain; version=0.0.4; charset=utf-8")
        text = reply.read().decode()
    families = list(text_string_to_metric_families(text))
    names = [family.name for family in families]
    expect("families that stand twice", [name for name in set(names) if names.count(name) > 1], [])
    for family in families:
        if not family.documentation:
            raise Difference(f"{family.name} has no help")
        if family.type == "unknown":
            raise Difference(f"{family.name} has no type")
    return {family.name: family for family in families}


def is_complete(families):
    for name in HISTOGRAMS:
        expect(f"the type of {name}", families[name].type, "histogram")
        samples = families[name].samples
        buckets = [(float(sample.labels["le"]), sample.value) for sample in samples if sample.name.endswith("_bucket")]
        expect(f"the bounds of {name} in their order", buckets, sorted(buckets))
        expect(f"the counts of {name} going up", [count for _, count in buckets], sorted(count for _, count in buckets))
        count = next(sample.value for sample in samples if sample.name.endswith("_count"))
        expect(f"the last bucket of {name}", buckets[-1], (math.inf, count))
    for name in ("takt_axis_position", "takt_axis_following_error", "takt_axis_feedback_age_seconds"):
        expect(f"the axes of {name}", {sample.labels["axis"] for sample in families[name].samples}, AXES)
    for name, label in (("takt_group_state", "group"), ("takt_drive_state", "axis"), ("takt_bus_state", "bus")):
        present = {}
        for sample in families[name].samples:
            present.setdefault(sample.labels[label], []).append(sample.value)
        for subject, values in present.items():
            expect(f"the states of {subject} in {name} that it is in", sum(values), 1)
    expect("the type of takt_stops", families["takt_stops"].type, "counter")


def counters_go_up(before, after):
    for name in ("takt_cycles", "takt_bus_frames", "takt_bus_busy_seconds"):
        for old, new in zip(before[name].samples, after[name].samples):
            if not new.value > old.value:
                raise Difference(f"{new.name} {new.labels} has not gone up: {old.value}, then {new.value}")


if __name__ == "__main__":
    main(sys.argv[1])
