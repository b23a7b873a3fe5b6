"""`takt sim` as the devices of a bus."""

import contextlib
import os
import subprocess
import sys

TAKT = os.environ["TAKT"]


def drives(config, bus, interface):
    """The drives of a configuration, while the context lasts."""
    return hosted(interface, [config, "--bus", f"{bus}={interface}"])


def drive_of(data_sheet, node, interface):
    """A drive made from its data sheet, while the context lasts."""
    return hosted(interface, ["--eds", data_sheet, "--node", str(node), "--interface", interface])


@contextlib.contextmanager
def hosted(interface, arguments):
    messages = os.path.join(os.environ["OUT"], f"sim-{interface}.txt")
    with open(messages, "wb") as stderr:
        process = subprocess.Popen([TAKT, "sim", *arguments], stderr=stderr)
    try:
        yield
    finally:
        process.terminate()
        if process.wait(timeout=30) != 0:
            with open(messages, encoding="utf-8") as said:
                print(f"`takt sim` ended with {process.returncode}: {said.read()}", file=sys.stderr)
