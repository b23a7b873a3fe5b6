"""Nodes of ROS 2 over zenoh that behave badly beside a served controller, for the jitter measurements of the laboratory.

One publishes ten trajectories a second, each of the next 1.1 s, and stalls for a third of a second after every 0.7 s. What
comes too late finds the arm at rest, and begins anew from there. One publishes in
bursts, as fast as it can, what must be refused: positions beyond every limit, and bytes that are no message. One takes a twentieth of a second
for each joint state. The bridge is killed (`kill -9`) every two seconds, and started again. Bursts and kills begin when the arm moves.

    python3 unruly_zenoh.py SERVED

TAKT_ZENOH names the bridge. Prints a line when the arm moves, and, ended by SIGTERM, what came to pass; fails if the arm has never moved, or if
a node has failed.
"""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import zenoh

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "extras/zenoh/tests"))
from node import JOINTS, STATES, STORE, TRAJECTORIES, listening, trajectory  # noqa: E402

ENDPOINT = "tcp/127.0.0.1:7447"
LIFE_OF_A_BRIDGE_S = 2.0
# Those that have room on both sides.
LED = JOINTS[:3]
# rad: an arm that is so far from its first place has moved.
MOVED = 0.005
# rad: an arm that has moved by less in a third of a second is at rest.
AT_REST = 0.0005
# s: the points of a trajectory. The first one leaves time for what comes a little late, the last one for coming to rest.
AHEAD_S = (0.3, 0.5, 0.7, 1.1)


def offset(since_s):
    """A gentle motion to and fro: rad."""
    return 0.1 * min(since_s / 2, 1) ** 3 * math.sin(math.pi / 2 * since_s)


class Unruly:
    def __init__(self, session):
        self.publisher = session.declare_publisher(TRAJECTORIES)
        self.newest, self.first, self.last, self.home, self.begun = None, None, None, None, None
        self.is_over, self.has_moved = threading.Event(), threading.Event()
        self.sent, self.unfit, self.killed, self.failures = 0, 0, 0, []
        self.subscribers = [
            session.declare_subscriber(STATES, self.see),
            session.declare_subscriber(STATES, lambda _: time.sleep(0.05)),
        ]

    def see(self, sample):
        self.newest = sample.payload.to_bytes()

    def position(self):
        return list(STORE.deserialize_cdr(self.newest, "sensor_msgs/msg/JointState").position)

    def lead(self):
        if self.newest is None:
            time.sleep(0.1)
            return
        here = self.position()[: len(LED)]
        self.first = self.first or here
        if self.last is None or max(abs(now - before) for now, before in zip(here, self.last)) < AT_REST:
            self.home, self.begun = here, time.monotonic()
        for _ in range(7):
            since = time.monotonic() - self.begun
            points = [(ahead, [home + offset(since + ahead) for home in self.home]) for ahead in AHEAD_S]
            self.publisher.put(trajectory(LED, points))
            self.sent += 1
            time.sleep(0.1)
        self.last = self.position()[: len(LED)]
        if abs(self.last[0] - self.first[0]) > MOVED:
            self.has_moved.set()
        time.sleep(0.333)

    def flood(self):
        self.has_moved.wait()
        far = trajectory(JOINTS, [(0.1, [1e3] * len(JOINTS))])
        end = time.monotonic() + 0.2
        while time.monotonic() < end:
            self.publisher.put(far)
            self.publisher.put(b"no message")
            self.unfit += 2
        time.sleep(0.5)

    def keep_a_bridge(self, served):
        words = [os.environ["TAKT_ZENOH"], served, "--connect", ENDPOINT, "--listen", "tcp/127.0.0.1:0", "--domain", "0", "--command"]
        bridge = subprocess.Popen(words, stderr=subprocess.DEVNULL)
        self.has_moved.wait()
        self.is_over.wait(LIFE_OF_A_BRIDGE_S)
        if bridge.poll() is not None:
            raise RuntimeError(f"the bridge has ended: {bridge.returncode}")
        bridge.kill()
        bridge.wait()
        self.killed += 1

    def repeat(self, node, *arguments):
        while not self.is_over.is_set():
            try:
                node(*arguments)
            except Exception as error:
                self.failures.append(f"{node.__name__}: {error!r}")
                return


def main(served):
    with zenoh.open(listening(ENDPOINT)) as session:
        unruly = Unruly(session)

        def end(*_):
            unruly.is_over.set()
            unruly.has_moved.set()

        signal.signal(signal.SIGTERM, end)
        nodes = [(unruly.lead,), (unruly.flood,), (unruly.keep_a_bridge, served)]
        threads = [threading.Thread(target=unruly.repeat, args=node) for node in nodes]
        for thread in threads:
            thread.start()
        unruly.has_moved.wait()
        has_moved = not unruly.is_over.is_set()
        if has_moved:
            print("the arm moves", flush=True)
        for thread in threads:
            thread.join()
    print(f"{unruly.sent} trajectories, {unruly.unfit} messages that must be refused, {unruly.killed} bridges killed")
    if not has_moved:
        sys.exit("the arm has never moved")
    if unruly.failures:
        sys.exit("\n".join(unruly.failures))


if __name__ == "__main__":
    main(*sys.argv[1:])
