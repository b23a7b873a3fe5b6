"""Moves and trajectories."""

import numpy as np
import pytest
import takt
from conftest import HOME, assert_within_limits


def test_a_move_ends_where_it_was_told_to(sim):
    sim.move(HOME)
    np.testing.assert_allclose(sim.state.position, HOME, atol=1e-3)
    assert sim.state.phase == "holding"


@pytest.mark.parametrize("q", [list(HOME), tuple(HOME), HOME.astype(np.float32), HOME[::-1][::-1]])
def test_a_target_is_anything_that_numpy_takes_for_numbers(sim, q):
    sim.move(q)
    np.testing.assert_allclose(sim.state.position_set, HOME, atol=1e-6)


def test_half_the_speed_is_half_the_speed(sim):
    with sim.record() as recording:
        sim.move(HOME + [1, 1, 1, -1, 1, 1], speed=0.5)
    fastest = np.abs(recording.velocity_set).max(axis=0)
    assert np.all(fastest <= [0.5 * axis.velocity * (1 + 1e-6) for axis in sim.axes])


def test_a_move_that_is_not_waited_for_goes_on(sim):
    motion = sim.move(HOME, wait=False)
    assert not motion.is_done
    sim.step(3)
    assert sim.state.phase == "moving"
    motion.wait()
    assert motion.is_done


def test_a_target_beyond_the_limits_is_refused_with_the_limit(sim):
    with pytest.raises(takt.LimitError, match="joint1: 9 is not within its limits") as refused:
        sim.move([9, 0, 0, -0.5, 0, 0.5])
    assert (refused.value.axis, refused.value.value) == ("joint1", 9)
    assert refused.value.highest == sim.axes[0].position_max
    assert isinstance(refused.value, ValueError)
    assert sim.state.phase == "holding"


def test_a_number_that_is_none_is_refused(sim):
    with pytest.raises(takt.LimitError, match="NaN"):
        sim.move([np.nan] * 6)


def test_another_number_of_values_is_refused_in_words(sim):
    with pytest.raises(takt.ArgumentError, match="2 values were given for 6 axes"):
        sim.move([0.0, 0.0])
    with pytest.raises(ValueError, match="one number for each axis"):
        sim.move([[0.0] * 6])


def test_what_is_no_array_of_numbers_is_refused_by_the_name_of_the_argument(sim):
    with sim.follow() as stream:
        for words, call in {
            "q: could not convert string to float": lambda: sim.move(["up"] * 6),
            "q: float.* not 'dict'": lambda: sim.move({}),
            r"q is one number for each axis, and has the shape \(2, 6\)": lambda: sim.move([HOME, HOME]),
            r"times .* has the shape \(1, 2\)": lambda: sim.execute([[1.0, 2.0]], [HOME, HOME]),
            r"q has a row for each point .* the shape \(6,\)": lambda: sim.execute([1.0], HOME),
            "qd: .*inhomogeneous": lambda: sim.execute([1.0, 2.0], [HOME, HOME], [HOME, HOME[:5]]),
            "timeout is a number of seconds from 0 on, and was given as -1": lambda: sim.move(HOME, timeout=-1),
            "dt is a number of seconds from 0 on, and was given as NaN": lambda: stream.push_chunk(None, np.nan, [HOME]),
            "q has 2 values for 6 axes": lambda: stream.push([0.0, 0.0]),
            r"q has the shape \(3, 2\) for 3 points of 6 axes": lambda: stream.push_chunk(None, 0.1, np.zeros((3, 2))),
        }.items():
            with pytest.raises(takt.ArgumentError, match=words):
                call()
        sim.step(2)
        assert stream.state == "awaited", "nothing has changed"


def test_a_motion_that_was_replaced_says_so(sim):
    first = sim.move(HOME, wait=False)
    sim.step(5)
    sim.move(HOME * 0.5)
    with pytest.raises(takt.ReplacedError):
        first.wait()


def test_a_stop_is_what_the_motion_ends_with(sim):
    motion = sim.move(HOME, wait=False)
    sim.step(100)
    sim.stop()
    with pytest.raises(takt.StoppedError, match="a stop was requested") as stopped:
        motion.wait()
    assert (stopped.value.rule, stopped.value.category, stopped.value.axis) == ("requested", 2, None)


def test_a_motion_that_a_stop_has_overtaken_says_so(sim):
    motion = sim.move(HOME, wait=False)
    sim.stop()
    with pytest.raises(takt.StoppedError, match="before it began") as stopped:
        motion.wait()
    assert (stopped.value.rule, stopped.value.category) == ("requested", None)


def test_a_stop_may_be_waited_for(sim):
    sim.move(HOME, wait=False)
    sim.step(100)
    sim.stop(wait=True)
    assert sim.state.phase == "holding"
    sim.move(HOME)
    sim.move(HOME + 0.3, wait=False)
    sim.step(100)
    sim.stop(1, wait=True)
    assert sim.state.phase == "disabled"
    sim.enable()
    with pytest.raises(takt.ArgumentError, match="no stop of category 3"):
        sim.stop(3)


def test_a_wait_ends_in_time_and_the_motion_goes_on(sim):
    motion = sim.move(HOME, speed=0.1, wait=False)
    with pytest.raises(takt.TimeoutError, match="goes on") as late:
        motion.wait(timeout=0.1)
    assert isinstance(late.value, TimeoutError)
    motion.wait()


def test_a_trajectory_is_carried_out_exactly(sim):
    sim.move(HOME)
    times = np.linspace(0.0, 2.0, 41)
    # The polynomial of least jerk over 0.2 rad.
    way = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])(np.polynomial.Polynomial([0, 0.5])) * 0.2
    q, qd, qdd = (part(times)[:, None] * np.ones(6) for part in [way, way.deriv(), way.deriv(2)])
    qdd[-1] = 0.0
    with sim.record() as recording:
        sim.execute(times, HOME + q, qd, qdd)
    assert_within_limits(recording, sim.axes)
    np.testing.assert_allclose(sim.state.position_set, HOME + 0.2, atol=1e-9)
    begun = np.abs(recording.velocity_set[:, 0]).nonzero()[0][0]
    passed = recording.time - recording.time[begun] + 1e-3
    moving = (passed > 0) & (passed < 2)
    np.testing.assert_allclose(recording.position_set[moving, 0] - HOME[0], way(passed[moving]), atol=1e-5)


def test_a_trajectory_that_breaks_a_limit_names_point_axis_and_limit_and_nothing_moves(sim):
    sim.move(HOME)
    q = np.array([HOME, HOME, HOME])
    q[2, 3] += 0.5
    with pytest.raises(takt.TrajectoryError, match="point 2, joint4: .* is beyond the limit of") as refused:
        sim.execute([0.0, 1.0, 1.05], q)
    error = refused.value
    assert (error.point, error.axis) == (2, "joint4")
    assert error.quantity in ("velocity", "acceleration", "jerk") and abs(error.value) > abs(error.limit)
    assert sim.state.phase == "holding"
    np.testing.assert_array_equal(sim.state.position_set, HOME)


def test_points_and_times_must_be_equally_many(sim):
    with pytest.raises(takt.ArgumentError, match="q has 1 points for 2 times"):
        sim.execute([0.0, 1.0], [HOME])


def test_a_trajectory_is_slowed_paused_and_resumed_on_its_path(sim):
    sim.move(HOME)
    motion = sim.execute([1.0, 2.0], [HOME + 0.1, HOME], wait=False)
    motion.set_speed(0.5)
    sim.run(0.5)
    motion.pause()
    sim.run(1.0)
    path, of, rate = motion.progress
    assert 0 < path < of == 2.0 and rate == 0.0
    motion.resume()
    motion.wait()
    np.testing.assert_allclose(sim.state.position_set, HOME, atol=1e-9)


def test_waypoints_are_passed_without_stopping(sim):
    sim.move(HOME)
    with sim.record() as recording:
        sim.move_through([HOME + 0.2, HOME + 0.35, HOME + 0.5])
    assert_within_limits(recording, sim.axes)
    middle = np.abs(recording.position_set[:, 0] - 0.35).argmin()
    assert recording.velocity_set[middle, 0] > 0.1
    np.testing.assert_allclose(sim.state.position_set, HOME + 0.5, atol=1e-9)


def test_an_arm_in_real_time_moves(arm):
    arm.move(HOME, timeout=60)
    np.testing.assert_allclose(arm.state.position, HOME, atol=1e-2)
