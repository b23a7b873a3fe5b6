"""Reads every object of an EDS from the device that it describes."""

import canopen
from canopen.objectdictionary import ODVariable

from difference import Difference, expect


def entries(dictionary):
    for entry in dictionary.values():
        yield from [entry] if isinstance(entry, ODVariable) else entry.values()


def name(entry):
    return f"{entry.index:04X}:{entry.subindex:02X} {entry.name}"


def check_against(node, constants, other_sizes=(), without_data=()):
    """Reads all readable objects. The size must be that of the type. The value of the `constants` (indices) must be that of the EDS.
    Returns the number of objects."""
    count = 0
    for entry in entries(node.object_dictionary):
        if not entry.readable:
            continue
        count += 1
        try:
            with node.sdo.open(entry.index, entry.subindex, buffering=0) as stream:
                data = stream.read()
        except canopen.SdoAbortedError as abort:
            if entry.index in without_data and abort.code == NO_DATA:
                continue
            raise Difference(f"{name(entry)} cannot be read: {abort}") from abort
        except canopen.SdoCommunicationError as error:
            raise Difference(f"{name(entry)} cannot be read: {error}") from error
        if entry.index not in other_sizes:
            expect(f"bits of {name(entry)}", 8 * len(data), len(entry))
        if entry.index in constants:
            expect(name(entry), entry.decode_raw(data), entry.default)
    return count


NO_DATA = 0x0800_0024
