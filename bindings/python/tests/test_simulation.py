"""Virtual time: the same calls, the same motion, as fast as the computer can."""

import threading

import numpy as np
import pytest
import takt
from conftest import ARM6, HOME


def run():
    with takt.simulate(ARM6) as sim, sim.record() as recording:
        sim.move(HOME)
        with sim.follow() as stream:
            for number in range(100):
                stream.push(HOME + 0.001 * number)
                sim.step(20)
        sim.execute([1.0, 2.0], [HOME + 0.2, HOME])
    return recording


def test_the_same_calls_give_the_same_motion_bit_for_bit():
    first, second = run(), run()
    for name, values in first.arrays().items():
        np.testing.assert_array_equal(values, second.arrays()[name], err_msg=name)


def test_time_passes_only_in_calls(sim):
    before = sim.time
    assert sim.time == before
    sim.step(250)
    assert sim.time == pytest.approx(before + 0.25)
    sim.run(0.75)
    assert sim.time == pytest.approx(before + 1.0)


@pytest.mark.parametrize("passes", [lambda sim: None, lambda sim: sim.move(HOME, wait=False)])
def test_a_recording_in_which_no_time_passes_ends_and_is_empty(sim, passes):
    with sim.record() as recording:
        passes(sim)
    assert len(recording.time) == 0


def test_a_simulation_is_an_arm(sim):
    assert isinstance(sim, takt.Arm) and isinstance(sim, takt.Group)


def test_it_ends_with_its_with():
    with takt.simulate(ARM6) as sim:
        pass
    assert sim.has_ended
    with pytest.raises(takt.EndedError):
        sim.step()


def test_threads_share_the_time_of_a_simulation(sim):
    """Whoever waits lets time pass for all, and none of them hangs."""
    motion = sim.move(HOME, wait=False)
    waiting = [threading.Thread(target=motion.wait) for _ in range(4)]
    for thread in waiting:
        thread.start()
    for thread in waiting:
        thread.join()
    np.testing.assert_allclose(sim.state.position, HOME, atol=1e-3)
