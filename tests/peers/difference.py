"""A difference between expected and received values, described in a sentence."""

import time

from canopen import SdoAbortedError


class Difference(Exception):
    """The difference."""


def expect(what, actual, wanted):
    if actual != wanted:
        raise Difference(f"{what}: {shown(actual)}, where {shown(wanted)} was expected")


def expect_near(what, actual, wanted, tolerance):
    if abs(actual - wanted) > tolerance:
        raise Difference(f"{what}: {actual}, where {wanted} ± {tolerance} was expected")


def wait_until(what, is_reached, within_s=30.0):
    """Waits for an event that must happen. The limit is for an event that never happens."""
    end = time.monotonic() + within_s
    while not is_reached():
        if time.monotonic() > end:
            raise Difference(f"within {within_s} s it did not come to this: {what}")
        time.sleep(0.01)


def expect_abort(what, code, action):
    """The device must refuse with this abort code."""
    try:
        action()
    except SdoAbortedError as abort:
        expect(f"abort code of {what}", abort.code, code)
    else:
        raise Difference(f"{what} was not refused")


def shown(value):
    return f"{value:#x}" if isinstance(value, int) and not isinstance(value, bool) else repr(value)
