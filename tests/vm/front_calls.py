"""Calls of takt in Python, as front_calls.rs has them of a handle: moves, stops and points of a stream, each with CLOCK_REALTIME
before it.

    python3 front_calls.py CONFIG --bus NAME=INTERFACE...
"""

import sys
import time

import numpy as np
import takt

CALLS = 100
STEP, FAR = 0.0005, 0.3


def pause(milliseconds, number=0):
    """So many milliseconds, and a part of one that is another one each time, so that the calls come all over the cycle."""
    time.sleep(milliseconds / 1e3 + number * 37 % 100 / 1e5)


def noted(command, more=""):
    print(f"{command} {time.time():.6f}{more}")


def main(config, *options):
    buses = dict(option.split("=") for option in options if option != "--bus")
    with takt.Arm(config, buses=buses) as arm:
        home, first = arm.state.position_set, np.eye(1, len(arm.state.position_set))[0]
        print("calls begin", file=sys.stderr)
        for number in range(CALLS):
            pause(5, number)
            there = home + first * (STEP if number % 2 == 0 else 0)
            noted("move")
            arm.move(there, wait=False)
        for number in range(CALLS):
            pause(5, number)
            arm.move(home + first * (FAR if number % 2 == 0 else -FAR), wait=False)
            pause(5, number)
            noted("stop")
            arm.stop()
        pause(5)
        arm.move(home)
        with arm.follow() as stream:
            for _ in range(20):
                stream.push(home)
                pause(5)
            for number in range(CALLS):
                here, there = (0, STEP) if number % 2 == 0 else (STEP, 0)
                for _ in range(4):
                    stream.push(home + first * here)
                    pause(5)
                pause(0, number)
                lag_ns, there = round(stream.lag * 1e9), home + first * there
                noted("point", f" {lag_ns}")
                stream.push(there)
                pause(5)
            # The last point comes after the lag of the stream.
            pause(50)


main(*sys.argv[1:])
