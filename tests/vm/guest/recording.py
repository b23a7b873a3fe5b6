"""Reads a recording of takt as far as takt writes the format (https://mcap.dev/spec, chunks that are compressed by zstd or not), so
that nothing need be installed but the library that Debian's package manager itself uses; tests/read_recording.py reads it with the format's own reader.
"""

import ctypes
import mmap
import struct

CHANNEL, MESSAGE, CHUNK = 4, 5, 6


def records(data):
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        yield code, data[at + 9 : at + 9 + length]
        at += 9 + length


def decompressed(compression, packed, length):
    assert compression == b"zstd", f"the chunk is compressed by {compression}"
    zstd = ctypes.CDLL("libzstd.so.1")
    zstd.ZSTD_decompress.restype = ctypes.c_size_t
    zstd.ZSTD_decompress.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t]
    records = ctypes.create_string_buffer(length)
    taken = zstd.ZSTD_decompress(records, length, bytes(packed), len(packed))
    assert taken == length, f"the chunk has {taken} bytes in place of {length}"
    return memoryview(records.raw)


def unpacked(data):
    for code, body in records(data):
        if code == CHUNK:
            length = struct.unpack_from("<Q", body, 16)[0]
            name_length = struct.unpack_from("<I", body, 28)[0]
            compression, packed = bytes(body[32 : 32 + name_length]), body[32 + name_length + 8 :]
            yield from records(packed if compression == b"" else decompressed(compression, packed, length))
        else:
            yield code, body


def messages(path):
    """The topic, the time in nanoseconds of CLOCK_REALTIME and the fields of every message, in their order. The fields
    are CDR (src/telemetry/messages/*.msg), without the encapsulation of four bytes."""
    with open(path, "rb") as file:
        # Ten minutes of six axes are half a gigabyte.
        data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))[8:]
    topics = {}
    for code, body in unpacked(data):
        if code == CHANNEL:
            channel, _, length = struct.unpack_from("<HHI", body)
            topics[channel] = bytes(body[8 : 8 + length]).decode()
        elif code == MESSAGE:
            channel, _, log_time_ns = struct.unpack_from("<HIQ", body)
            yield topics[channel], log_time_ns, body[22 + 4 :]
