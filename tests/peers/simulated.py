"""`takt sim` as the other side of a bus."""

import contextlib
import os
import subprocess

TAKT = os.environ["TAKT"]


@contextlib.contextmanager
def drives(config, bus, interface):
    """The drives of a configuration, for as long as the context lasts."""
    process = subprocess.Popen([TAKT, "sim", config, "--bus", f"{bus}={interface}"], stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait(timeout=10)
