"""Streams: any rate, late, uneven, wild, or stopped."""

import numpy as np
import pytest
import takt
from conftest import HOME, assert_within_limits, joint


def circle(time):
    radius = 0.1 * min(time / 1.5, 1.0) ** 3
    return HOME + radius * np.array([np.sin(2 * time), np.cos(2 * time), 0, 0, 0, 0])


@pytest.mark.parametrize("rate", [10, 50, 200, 1000])
def test_a_stream_of_any_rate_is_followed_within_the_limits(sim, rate):
    sim.move(HOME)
    with sim.record() as recording, sim.follow() as stream:
        for number in range(3 * rate):
            stream.push(circle(number / rate))
            sim.step(1000 // rate)
        assert stream.state == "following"
        assert stream.counts[2] == 0
    assert_within_limits(recording, sim.axes)
    assert sim.state.phase == "holding"
    # When the points run out, it comes to rest from the speed of the last one.
    np.testing.assert_allclose(sim.state.position_set, circle(3 - 1 / rate), atol=0.3 / rate + 0.01)


def test_a_client_that_pauses_leaves_the_arm_at_rest_and_goes_on_within_the_limits(sim):
    """As garbage collection, a slow network or a debugger pauses it: the points jump ahead after each pause."""
    sim.move(HOME)
    events = sim.events()
    with sim.record() as recording, sim.follow() as stream:
        time = 0.0
        for pause in [0.4, 0.05, 0.9]:
            for _ in range(100):
                stream.push(circle(time))
                sim.step(10)
                time += 0.01
            sim.run(pause)
            time += pause
            if pause > 0.3:
                assert stream.state == "dry"
                assert np.abs(sim.state.velocity_set).max() < 1e-9
    assert_within_limits(recording, sim.axes)
    assert any("run out" in event.words for event in events.poll() if event.kind == "stream")


def test_wild_points_are_led_to_within_the_limits(sim):
    sim.move(HOME)
    random = np.random.default_rng(7)
    with sim.record() as recording, sim.follow() as stream:
        for _ in range(200):
            stream.push(random.uniform(-30, 30, 6), t=sim.time + random.normal(0, 0.02))
            sim.step(int(random.integers(0, 40)))
    assert_within_limits(recording, sim.axes)


def test_the_chunks_of_a_policy_overlap(sim):
    """As ACT and other policies give them: fifty points at 50 Hz, and new ones every half second."""
    sim.move(HOME)
    dt, begun = 0.02, sim.time
    with sim.record() as recording, sim.follow() as stream:
        for number in range(6):
            start = number * 0.5
            stream.push_chunk(begun + start, dt, [circle(start + k * dt) for k in range(50)])
            sim.run(0.5)
    assert_within_limits(recording, sim.axes)
    np.testing.assert_allclose(sim.state.position_set, circle(2.5 + 49 * dt), atol=0.02)


def test_velocities_alone_turn_the_joints(sim):
    sim.move(HOME)
    with sim.follow() as stream:
        for _ in range(50):
            stream.push(qd=[0.2, 0, 0, 0, 0, 0])
            sim.step(10)
        assert sim.state.velocity_set[0] == pytest.approx(0.2)
    assert sim.state.position_set[0] > 0.05


def test_an_impedance_needs_a_torque_loop_and_says_so(sim):
    with sim.follow() as stream, pytest.raises(takt.StreamError, match='joint1: .*mode "cst"') as refused:
        stream.push(HOME, kp=50.0, kd=3.0)
    assert (refused.value.point, refused.value.axis) == (0, "joint1")


def test_an_impedance_is_followed_where_the_torque_loop_is_here():
    config = joint(mode="cst", joint={"inertia": 1.0, "viscous_friction": 2.0, "coulomb_friction": 1.0})
    with takt.simulate(config) as sim, sim.follow() as stream:
        for number in range(200):
            stream.push([0.1 * min(number / 100, 1)], kp=200.0, kd=20.0, torque=[0.0])
            sim.step(10)
        assert sim.state.position_set[0] == pytest.approx(0.1, abs=1e-3)
        assert sim.state.position[0] == pytest.approx(0.1, abs=0.02)


def test_a_number_that_is_none_is_refused_by_its_point_and_axis(sim):
    with sim.follow() as stream, pytest.raises(takt.StreamError, match="joint2: the position is NaN") as refused:
        stream.push(np.where(np.arange(6) == 1, np.nan, HOME))
    assert (refused.value.point, refused.value.axis) == (0, "joint2")


def test_parts_that_do_not_belong_together_are_refused(sim):
    with sim.follow() as stream:
        for wrong in [{}, {"qd": HOME, "torque": HOME}, {"qdd": HOME}]:
            with pytest.raises(takt.ArgumentError, match="a point has positions"):
                stream.push(**wrong)
        with pytest.raises(ValueError, match="qd has 2 values for 6 axes"):
            stream.push(HOME, [0.0, 0.0])


def test_who_pushes_after_a_stop_is_told(sim):
    with pytest.raises(takt.StreamError, match="no stream is running"), sim.follow() as stream:
        stream.push(HOME * 0)
        sim.step(5)
        sim.stop()
        sim.step(500)
        stream.push(HOME * 0)


def test_a_fault_of_an_exact_stream_is_told_to_who_pushes():
    with takt.simulate(joint(follow="exact")) as sim:
        with pytest.raises(takt.StoppedError, match="joint") as stopped, sim.follow() as stream:
            for number in range(100):
                stream.push([0.0 if number < 50 else 1.0])
                sim.step(10)
        assert stopped.value.axis == "joint" and stopped.value.rule != "requested"
        assert "joint" in sim.state.fault
        with pytest.raises(takt.RefusedError):
            sim.move([0.0])
        sim.clear_fault()
        sim.enable()
        sim.move([0.0])


def test_a_new_stream_carries_out_nothing_that_was_pushed_before_it(sim):
    stream = sim.follow()
    for number in range(60):
        stream.push([0.003 * number, 0, 0, 0, 0, 0])
        sim.run(0.02)
    stream.push([0.18, 0, 0, 0, 0, 0])
    lost = stream.counts[2]
    sim.stop(1, wait=True)
    assert stream.counts[2] == lost + 1
    with pytest.raises(takt.StreamError, match="no stream is running"):
        stream.push([0.18, 0, 0, 0, 0, 0])
    sim.enable()
    sim.move([-0.5, 0, 0, 0, 0, 0])
    sim.run(5)
    home = sim.state.position[0]
    sim.follow()
    sim.run(0.4)
    assert abs(sim.state.position[0] - home) < 1e-6


def test_an_exception_stops_the_arm_at_once(sim):
    with pytest.raises(ZeroDivisionError), sim.follow() as stream:
        stream.push_chunk(None, 0.1, [circle(0.1 * k) for k in range(20)])
        sim.run(0.5)
        time = sim.time
        1 / 0
    assert sim.time - time < 0.5 and sim.state.phase == "holding"


def test_an_arm_in_real_time_follows_a_stream(arm):
    import time

    arm.move(HOME, timeout=60)
    with arm.record() as recording, arm.follow() as stream:
        begun = arm.time
        while arm.time < begun + 1:
            stream.push(circle(arm.time - begun))
            time.sleep(0.01)
    assert_within_limits(recording, arm.axes)
    np.testing.assert_allclose(arm.state.position_set, circle(1.0), atol=0.02)
