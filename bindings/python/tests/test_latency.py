"""From a call to the wire, in cycles: counted in virtual time, where nothing else is late. The set-points of a state are those that its cycle
has sent."""

import math

import numpy as np
from conftest import HOME


def cycles_until(sim, is_there):
    for cycle in range(1, 1000):
        sim.step()
        if is_there(sim.state):
            return cycle
    raise AssertionError("nothing has come of it within 1000 cycles")


def is_moving(state):
    return bool(np.any(state.velocity_set != 0.0))


def test_a_move_and_a_stop_are_on_the_wire_in_the_next_cycle(sim):
    sim.move(HOME + 0.3, wait=False)
    assert cycles_until(sim, is_moving) == 1
    sim.step(400)
    sim.stop()
    assert cycles_until(sim, lambda state: state.phase == "stopping") == 1


def test_a_point_is_on_the_wire_in_the_next_cycle_ahead_of_the_lag(sim):
    with sim.follow() as stream:
        for _ in range(500):
            stream.push(HOME)
            sim.step()
        lag = math.ceil(stream.lag * 1000)
        before = sim.state.position_set
        stream.push(HOME + 0.001)
        taken = cycles_until(sim, lambda state: np.abs(state.position_set - before).max() > 1e-9)
        assert taken <= lag + 1
