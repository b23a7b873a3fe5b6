"""Speaks to a simulated hollow-shaft motor over CAN FD by hand, with `cansend` and `candump`, and decodes what it replies as its manual
says (chapter on CAN FD): nothing of takt is between.

    python3 fd_by_hand.py INTERFACE plain|switching

The motor has the ID 1, the master ID 65 (hexadecimal) and 21 pole pairs; `switching` is with bit-rate switching. Prints what was seen; ends
with a sentence at the first difference.
"""

import subprocess
import sys
import time
from collections import namedtuple

COMMAND, REPLY, POLE_PAIRS = "001", "065", 21
COUNTS_PER_TURN, HZ_PER_UNIT, AMPERES_PER_UNIT = 1_048_576, 1000 / 2**23, 100 / 2**15
TORQUE, POSITION = 0, 2
STOP, RUN = 0, 1

Reply = namedtuple("Reply", "at_s flags turns hz amperes mode run temperature motor")


def command(mode, run, turns=0.0, hz=0.0, amperes=0.0, kp=0, kd=0, zero=0):
    fields = round(turns * COUNTS_PER_TURN).to_bytes(5, "big", signed=True)
    fields += round(hz / HZ_PER_UNIT).to_bytes(4, "big", signed=True)
    fields += round(amperes / AMPERES_PER_UNIT).to_bytes(2, "big", signed=True)
    return fields + bytes([mode, run, kp, kd, zero])


class Motor:
    def __init__(self, interface, has_switch):
        self.interface = interface
        self.flags = 1 if has_switch else 0

    def exchange(self, frame):
        """Sends a frame as cansend writes it, and returns the line of the reply, or nothing."""
        listener = subprocess.Popen(
            ["candump", "-L", "-T", "500", "-n", "1", f"{self.interface},{REPLY}:7FF"], stdout=subprocess.PIPE, text=True
        )
        time.sleep(0.05)
        subprocess.run(["cansend", self.interface, frame], check=True)
        return listener.communicate()[0].split()

    def ask(self, data):
        line = self.exchange(f"{COMMAND}##{self.flags}{data.hex()}")
        require(line, "the motor did not reply")
        flags, data = line[2].split("##")[1][0], bytes.fromhex(line[2].split("##")[1][1:])
        require(len(data) == 16, f"the reply has {len(data)} bytes")
        return Reply(
            at_s=float(line[0].strip("()")),
            flags=int(flags, 16) & 1,
            turns=int.from_bytes(data[0:5], "big", signed=True) / COUNTS_PER_TURN,
            hz=int.from_bytes(data[5:9], "big", signed=True) * HZ_PER_UNIT,
            amperes=int.from_bytes(data[9:11], "big", signed=True) * AMPERES_PER_UNIT,
            mode=data[11],
            run=data[12],
            temperature=int.from_bytes(data[14:15], "big", signed=True),
            motor=data[15],
        )


def require(condition, sentence):
    if not condition:
        sys.exit(sentence)


def near(what, found, wanted, tolerance):
    require(abs(found - wanted) <= tolerance, f"{what}: {found}, where {wanted} within {tolerance} was expected")


def comes_to(motor, what, request, is_there):
    """Repeats a request until the reply is as wanted. The limit is for what never happens."""
    for _ in range(60):
        reply = motor.ask(request)
        if is_there(reply):
            return reply
    sys.exit(f"it did not come to {what}, but to {reply}")


def is_at_rest(motor):
    reply = motor.ask(command(POSITION, STOP))
    require(reply.flags == motor.flags, "the reply is of another kind than the request")
    require((reply.run, reply.motor, reply.temperature) == (STOP, 1, 30), f"at rest it replied {reply}")
    near("its velocity at rest", reply.hz, 0, 1e-3)
    require(not motor.exchange(f"{COMMAND}#{bytes(8).hex()}"), "it replied to a classic frame")


def obeys_currents(motor):
    """The velocity in the replies is that of the positions in them."""
    motor.ask(command(TORQUE, RUN, amperes=1.0))
    first = motor.ask(command(TORQUE, RUN, amperes=1.0))
    second = motor.ask(command(TORQUE, RUN, amperes=1.0))
    require((first.mode, first.run) == (TORQUE, RUN), f"by currents it replied {first}")
    near("its current", first.amperes, 1.0, 2 * AMPERES_PER_UNIT)
    require(second.hz > first.hz > 0, f"its velocity went from {first.hz} to {second.hz} Hz")
    hz = (second.turns - first.turns) / (second.at_s - first.at_s) * POLE_PAIRS
    near("the velocity of its positions", hz, (first.hz + second.hz) / 2, 0.05 * second.hz)
    motor.ask(command(TORQUE, STOP))
    return first, second


def obeys_positions(motor):
    before = comes_to(motor, "rest", command(POSITION, STOP), lambda reply: abs(reply.hz) < 1e-3).turns
    target, most = before + 0.05, {"hz": 20.0, "amperes": 10.0, "kp": 200, "kd": 50}
    motor.ask(command(POSITION, RUN, turns=before, **most))
    there = command(POSITION, RUN, turns=target, **most)
    reply = comes_to(motor, "its target", there, lambda reply: abs(reply.turns - target) < 1e-3 and abs(reply.hz) < 0.1)
    require((reply.mode, reply.run) == (POSITION, RUN), f"by positions it replied {reply}")
    comes_to(motor, "rest", command(POSITION, STOP), lambda reply: abs(reply.hz) < 1e-3)
    return reply


def counts_from_zero(motor):
    before = motor.ask(command(POSITION, STOP)).turns
    require(abs(before) > 0.01, f"it is at its zero already: {before}")
    motor.ask(command(POSITION, STOP, zero=1))
    near("its position where it was told zero", motor.ask(command(POSITION, STOP)).turns, 0, 1e-4)
    return before


def main(interface, kind):
    motor = Motor(interface, kind == "switching")
    is_at_rest(motor)
    first, second = obeys_currents(motor)
    reached = obeys_positions(motor)
    before = counts_from_zero(motor)
    print(
        f"1 A led it from {first.hz:.3f} to {second.hz:.3f} Hz in {second.at_s - first.at_s:.3f} s, "
        f"a position to {reached.turns:.5f} turns; {before:.5f} turns became 0"
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
