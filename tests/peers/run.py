"""Tests takt with the package `canopen` on CAN interfaces, one subject after the other.

    python tests/peers/run.py erob=vcan0 yz_aim=vcan1

TAKT is the path of the program. Ends with 1 and a sentence at the first difference.
"""

import importlib
import logging
import sys
import time
import traceback

import canopen

from difference import Difference


def main(subjects):
    # Every problem is reported as a difference.
    logging.disable(logging.CRITICAL)
    for subject in subjects:
        name, interface = subject.split("=")
        begin = time.monotonic()
        network = canopen.Network()
        # The package polls once a second by default, which would delay every end.
        network.NOTIFIER_CYCLE = 0.1
        network.connect(interface="socketcan", channel=interface)
        try:
            importlib.import_module(name).run(network, interface, lambda *case: tell(name, *case))
        finally:
            network.disconnect()
        print(f"{name}: all done in {time.monotonic() - begin:.1f} s", flush=True)


def tell(subject, sentence, action):
    begin = time.monotonic()
    try:
        action()
    except Exception as error:
        if not isinstance(error, Difference):
            traceback.print_exc()
        sys.exit(f"{subject}: not true that it {sentence}: {error}")
    print(f"{subject}: {sentence} ({time.monotonic() - begin:.1f} s)", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
