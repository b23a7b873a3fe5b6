"""Pages of a panel as browsers keep them open: each reads its states and confirms them. The first one moves an axis to and fro.

    python3 open_pages.py PORT PAGES

Prints a line when every page is open and the axes move. Ended by SIGTERM, it prints how many states the pages have had, and fails
if one has had none, or if a page was lost before.
"""

import http.client
import json
import signal
import sys
import threading
import time

CONFIRM_EVERY_S = 0.3
# A panel beside a busy machine answers when it has its turn.
PATIENCE_S = 120

is_over = threading.Event()


class Page:
    """A page: its stream of states on one connection, its questions on others."""

    def __init__(self, port):
        self.port, self.key, self.states, self.loss = port, None, 0, None
        self.newest = {}
        self.is_open = threading.Event()
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()

    def ask(self, method, path, body=None):
        headers = {"X-Takt-Panel": "1"}
        if self.key:
            headers["X-Takt-Page"] = self.key
        if body is not None:
            headers["Content-Type"] = "application/json"
            body = json.dumps(body)
        connection = self.connection()
        connection.request(method, path, body, headers)
        return connection.getresponse()

    def connection(self):
        """One to the panel, which may not be up yet."""
        end = time.monotonic() + PATIENCE_S
        while True:
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
            try:
                connection.connect()
                return connection
            except ConnectionRefusedError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.2)

    def command(self, path, body=None):
        answer = self.ask("POST", path, body)
        words = answer.read().decode()
        if answer.status != 200:
            raise RuntimeError(f"{path} {body}: {answer.status} {words}")

    def read(self):
        try:
            stream = self.ask("GET", "/api/states")
            event, confirmed = None, 0.0
            while line := stream.readline().decode():
                if line.startswith("event: "):
                    event = line.removeprefix("event: ").strip()
                elif line.startswith("data: "):
                    value = json.loads(line.removeprefix("data: "))
                    if event == "page":
                        self.key = value["key"]
                    elif event == "state":
                        self.newest, self.states = value, self.states + 1
                        self.is_open.set()
                        if time.monotonic() - confirmed > CONFIRM_EVERY_S:
                            confirmed = time.monotonic()
                            self.ask("POST", "/api/confirm").read()
            self.loss = "its stream has ended"
        except (OSError, ValueError, http.client.HTTPException) as error:
            self.loss = repr(error)
        finally:
            self.is_open.set()

    def until(self, is_so):
        end = time.monotonic() + PATIENCE_S
        while not is_so(self.newest):
            if self.loss or time.monotonic() > end:
                raise RuntimeError(f"the axes are not where they should be: {self.loss or self.newest}")
            time.sleep(0.05)


def main():
    port, count = int(sys.argv[1]), int(sys.argv[2])
    signal.signal(signal.SIGTERM, lambda *_: is_over.set())
    pages = [Page(port) for _ in range(count)]
    for page in pages:
        page.is_open.wait(PATIENCE_S)
    first = pages[0]
    # `takt run --panel` has enabled the arm.
    first.until(lambda state: all(group["phase"] == "holding" for group in state["groups"]))
    first.command("/api/control", {"do": "take"})
    here = first.newest["axes"][0]["position_set"]
    motion = {"do": "reciprocate", "axis": 0, "between": [here, here + 0.3], "velocity": 0.5, "acceleration": 0.5}
    first.command("/api/command", {"number": 1, "command": motion})
    print(f"{count} pages are open, and an axis moves", flush=True)
    is_over.wait()
    losses = [page.loss for page in pages if page.loss]
    states = sorted(page.states for page in pages)
    print(f"{count} pages: {states[0]} to {states[-1]} states each; lost: {len(losses)} {losses[:1]}", flush=True)
    sys.exit(1 if losses or states[0] == 0 else 0)


main()
