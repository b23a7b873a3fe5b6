"""Trajectories over zenoh, as a node of ROS 2 sends them, with CLOCK_REALTIME before each: fifty moves, and fifty stops in motion
(a trajectory without points). They are so far apart that each has arrived before the next one, under load as well. `takt-zenoh`
connects to the endpoint where this listens.

    python3 front_calls_zenoh.py ENDPOINT
"""

import queue
import sys
import time
from pathlib import Path

import zenoh

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "extras/zenoh/tests"))
from node import JOINTS, STATES, STORE, TRAJECTORIES, listening, trajectory  # noqa: E402

CALLS = 50
STEP, FAR = 0.0005, 0.3
PATIENCE_S = 60


def pause(milliseconds, number=0):
    """So many milliseconds, and a part of one that is another one each time, so that the calls come all over the cycle."""
    time.sleep(milliseconds / 1e3 + number * 37 % 100 / 1e5)


def noted(command):
    print(f"{command} {time.time():.6f}")


def main(endpoint):
    with zenoh.open(listening(endpoint)) as session:
        states = queue.Queue()
        subscriber = session.declare_subscriber(STATES, states.put)
        state = STORE.deserialize_cdr(states.get(timeout=PATIENCE_S).payload.to_bytes(), "sensor_msgs/msg/JointState")
        subscriber.undeclare()
        publisher = session.declare_publisher(TRAJECTORIES)
        # Until it has seen who subscribes.
        pause(500)
        home = state.position[0]
        print("calls begin", file=sys.stderr)
        for number in range(CALLS):
            message = trajectory(JOINTS[:1], [(0.008, [home + (STEP if number % 2 == 0 else 0)])])
            pause(150, number)
            noted("move")
            publisher.put(message)
        for number in range(CALLS):
            there = trajectory(JOINTS[:1], [(1.5, [home + (FAR if number % 2 == 0 else -FAR)])])
            stop = trajectory([], [])
            pause(150, number)
            publisher.put(there)
            # At first the axis is so slow that its stop would not show.
            pause(300, number)
            noted("stop")
            publisher.put(stop)
        pause(200)


main(*sys.argv[1:])
