"""The other end of an SLCAN adapter's line, which hears and says nothing: writes when each SYNC frame of the host was read, as candump -L
does.

    python3 slcan_reader.py LINK FILE

LINK becomes a second name of its pseudo-terminal. It begins anew each time the host opens the channel, and writes FILE when it is told to
end (SIGTERM). Nothing marks a byte with the time at which it was sent: the times are those of reading.
"""

import os
import signal
import sys
import time
import tty

OPEN, SYNC = b"O", b"t0800"


def main(link, path):
    host_side, adapter_side = os.openpty()
    tty.setraw(adapter_side)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    os.symlink(os.ttyname(adapter_side), link)
    times, rest = [], b""
    try:
        while True:
            *lines, rest = (rest + os.read(host_side, 4096)).split(b"\r")
            now_us = time.time_ns() // 1000
            for line in lines:
                if line == OPEN:
                    times = []
                elif line == SYNC:
                    times.append(now_us)
    finally:
        os.unlink(link)
        with open(path, "w", encoding="ascii") as file:
            file.writelines(f"({at // 1_000_000}.{at % 1_000_000:06}) pty 080#\n" for at in times)


if __name__ == "__main__":
    main(*sys.argv[1:])
