"""A program in Python with a controller of its own that behaves badly, for the jitter measurements of the laboratory.

One thread pushes points at 100 Hz and sleeps for a third of a second after every 0.7 s, one hands over chunks as fast as it can, one
gives commands that must be refused, one observes without a pause, one makes garbage in cycles and has it collected, and one
keeps the interpreter's lock for a tenth of a second at a time. It ends with an error if the axes have stopped.

    python3 unruly_program.py CONFIG --bus NAME=INTERFACE... --duration SECONDS --record FILE.mcap
"""

import argparse
import gc
import sys
import threading
import time

import numpy as np
import takt

INTERVAL = 0.01


def offset(since):
    """A gentle motion to and fro: rad."""
    since = np.asarray(since)
    return 0.1 * np.minimum(since / 2, 1) ** 3 * np.sin(np.pi / 2 * since)


class Unruly:
    def __init__(self, arm, stream):
        self.arm, self.stream = arm, stream
        self.home, self.begun = arm.state.position_set, arm.time
        self.is_over = threading.Event()
        self.failures, self.longest_pause = [], 0.0

    def lead(self):
        for _ in range(70):
            self.stream.push(self.home + offset(self.arm.time - self.begun))
            time.sleep(INTERVAL)
        time.sleep(0.333)

    def flood(self):
        now = self.arm.time
        since = now - self.begun + INTERVAL * np.arange(20)
        self.stream.push_chunk(now, INTERVAL, self.home + offset(since)[:, None])

    def command(self):
        for wrong in (np.full(6, 1e3), np.full(6, np.nan)):
            try:
                self.arm.move(wrong, wait=False)
            except takt.Error:
                continue
            raise AssertionError(f"a move to {wrong} was taken")

    def observe(self):
        self.arm.state.position.sum()

    def litter(self):
        for _ in range(20_000):
            cycle = []
            cycle.append(cycle)
        begun = time.monotonic()
        gc.collect()
        self.longest_pause = max(self.longest_pause, time.monotonic() - begun)

    def keep_the_lock(self):
        # One instruction of the interpreter, which gives the lock to nobody meanwhile.
        begun = time.monotonic()
        while time.monotonic() < begun + 0.1:
            pow(3, 20_011, 1 << 20_000)
        time.sleep(0.05)

    def repeat(self, client):
        while not self.is_over.is_set():
            try:
                client()
            except takt.StreamError:
                # Where the flood has filled the look-ahead there is no room.
                pass
            except Exception as error:
                self.failures.append(f"{client.__name__}: {error!r}")
                return


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("config")
    parser.add_argument("--bus", action="append", default=[])
    parser.add_argument("--duration", type=float)
    parser.add_argument("--record")
    parser.add_argument("--require-realtime", action="store_true")
    given = parser.parse_args()
    # Whoever has the interpreter's lock keeps it for long.
    sys.setswitchinterval(0.05)
    buses = dict(bus.split("=") for bus in given.bus)
    with takt.Arm(given.config, buses=buses, record=given.record, require_realtime=given.require_realtime) as arm:
        with arm.follow() as stream:
            unruly = Unruly(arm, stream)
            clients = [unruly.lead, unruly.flood, unruly.command, unruly.observe, unruly.litter, unruly.keep_the_lock]
            threads = [threading.Thread(target=unruly.repeat, args=[client]) for client in clients]
            for thread in threads:
                thread.start()
            time.sleep(given.duration)
            unruly.is_over.set()
            for thread in threads:
                thread.join()
            counts, phase = stream.counts, arm.state.phase
        print(f"{counts}, collected for up to {1e3 * unruly.longest_pause:.0f} ms")
    if phase != "streaming":
        sys.exit(f"the axes are {phase}")
    if unruly.failures:
        sys.exit("\n".join(unruly.failures))


if __name__ == "__main__":
    main()
