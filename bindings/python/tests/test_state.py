"""State, events, recordings, axes, groups, modes."""

import threading

import numpy as np
import pytest
import takt
from conftest import HOME, ROOT, joint


def test_the_state_has_an_array_of_its_own_for_everything(sim):
    sim.move(HOME)
    state = sim.state
    for of in [state.position, state.velocity, state.torque, state.position_set, state.velocity_set, state.age]:
        assert of.dtype == np.float64 and of.shape == (6,)
    mine = state.position
    mine[:] = 7
    np.testing.assert_allclose(state.position, HOME, atol=1e-3)
    assert state.is_stale.dtype == bool and not state.is_stale.any()
    assert np.all(state.age < 0.002)
    assert state.drive_state == ["operation enabled"] * 6 and state.mode == ["csp"] * 6
    assert state.fault is None and state.error_code == [0] * 6


def test_what_no_drive_reports_is_nan(sim):
    assert np.isnan(sim.state.temperature).all()


def test_the_age_of_what_is_no_longer_reported_grows(sim):
    """After the end nothing is reported any more, and the last values must not look new."""
    sim.move(HOME)
    last = sim.state
    sim.close()
    state = sim.state
    assert state.is_stale.all() and np.all(state.age > 0)
    assert "ms old" in repr(state)
    assert not last.is_stale.any()


def test_axes_have_their_limits(sim):
    first = sim.axes[0]
    assert (first.name, first.position_max, first.velocity) == ("joint1", 2.9671, 2.3925)
    assert first.modes == ["csp"]
    assert len(sim.axes) == 6


def test_events_say_what_happens(sim):
    events = sim.events()
    sim.move(HOME)
    seen = events.poll()
    assert [event.words for event in seen if event.kind == "phase"] == ["holding → moving", "moving → holding"]
    assert all(event.slot > 0 and event.time > 0 for event in seen)
    assert events.poll() == []
    with pytest.raises(takt.TimeoutError):
        events.wait(timeout=0.1)
    sim.disable()
    assert any(event.axis == "joint3" for event in events.poll() if event.kind == "drive_state")


def test_to_iterate_over_events_ends_with_the_arm(sim):
    events = sim.events()
    sim.close()
    assert any("disabled" in event.words for event in events)


def test_a_recording_has_every_cycle(sim):
    with sim.record() as recording:
        sim.step(250)
    assert len(recording) == 250
    np.testing.assert_allclose(np.diff(recording.time), 1e-3, atol=1e-9)
    arrays = recording.arrays()
    assert {"time", "position", "position_set", "torque", "age"} <= set(arrays)
    assert arrays["position"].shape == (250, 6)
    sim.step(10)
    assert len(recording) == 250


def test_a_recording_does_not_grow_beyond_its_time(sim):
    with sim.record(at_most=0.1) as recording:
        sim.step(500)
    assert len(recording) == 100 and recording.is_full


def test_two_recordings_at_once_have_their_own_times(sim):
    with sim.record() as whole:
        sim.step(50)
        with sim.record() as part:
            sim.step(50)
        sim.step(50)
    assert (len(whole), len(part)) == (150, 50)


def test_a_recording_in_real_time_lacks_no_cycle_that_was_run(arm):
    with arm.record() as recording:
        arm.move(HOME, timeout=60)
    period = np.diff(recording.time)
    assert len(recording) > 100 and np.all(period > 0.0009)
    np.testing.assert_allclose(recording.position_set[-1], HOME, atol=1e-9)


def test_groups_move_by_themselves():
    with takt.simulate(ROOT / "configs" / "arm-and-gripper.toml") as sim:
        assert sim.groups == ["arm", "gripper"]
        arm, gripper = (sim.group(name) for name in sim.groups)
        motion = arm.move([0.2, 0.1, 0.3], wait=False)
        sim.step(5)
        assert (arm.state.phase, gripper.state.phase) == ("moving", "holding")
        assert sim.state.phases == {"arm": "moving", "gripper": "holding"}
        motion.wait()
        np.testing.assert_allclose(arm.state.position_set, [0.2, 0.1, 0.3], atol=1e-9)
        with arm.follow() as stream:
            # It takes a torque while the arm follows a stream.
            gripper.drive_torque("finger", 0.2, valid_for=0.5)
            for _ in range(10):
                stream.push([0.2, 0.1, 0.3])
                sim.step(10)
            assert gripper.state.phase == "moving" and arm.state.phase == "streaming"
            gripper.stop(wait=True)
        assert len(gripper.state.position) == 1
        with pytest.raises(takt.ArgumentError, match="must name it"):
            sim.execute([1.0], [[0.0] * len(sim.axes)])
        with pytest.raises(takt.ArgumentError, match="no group"):
            sim.group("leg")


def test_an_axis_that_may_changes_its_mode():
    config = joint(
        modes=["csp", "csv"],
        velocity_loop={"position_gain": 20.0},
    )
    with takt.simulate(config) as sim:
        assert sim.axes[0].modes == ["csp", "csv"]
        with pytest.raises(takt.RefusedError, match="must be disabled"):
            sim.change_mode("csv")
        sim.disable()
        sim.change_mode("csv")
        sim.enable()
        assert sim.state.mode == ["csv"]
        sim.move([0.3])
        sim.disable()
        sim.change_mode("csp", axis="joint")
        assert sim.state.mode == ["csp"]
        with pytest.raises(takt.ArgumentError, match="the modes are: csp"):
            sim.change_mode("fast")
        with pytest.raises(takt.ArgumentError, match="the axes are: joint"):
            sim.change_mode("csv", axis="elbow")


def test_who_waits_lets_the_other_threads_of_the_program_go_on(arm):
    events = arm.events()
    seen = []
    waiting = threading.Thread(target=lambda: seen.append(events.wait()))
    waiting.start()
    # If the waiting thread held the interpreter's lock, this line would never be reached.
    arm.stop()
    waiting.join()
    assert seen[0].kind == "stop"


def test_every_object_shows_itself_as_a_notebook_does(tmp_path):
    sim = takt.simulate(ROOT / "configs" / "first.toml")
    (axis,), group = sim.axes, sim.name
    assert repr(sim) == f'<arm "{group}", holding: {axis.name}>'
    assert repr(axis).startswith(f'Axis("{axis.name}", position ')
    events, motion = sim.events(), sim.move([0.1], wait=False)
    assert repr(motion) == "<motion under way>"
    assert "poll()" in repr(events)
    motion.wait()
    assert repr(motion) == "<motion at its target>"
    assert repr(sim.state).startswith("<state of slot ") and f"{axis.name} +0.1000" in repr(sim.state)
    assert repr(events.poll()[0]).endswith(" s: holding → moving>")
    with sim.record() as recording, sim.follow() as stream:
        sim.step(3)
        assert repr(stream).startswith("<stream awaited, ")
    assert repr(recording) == f"<recording of {len(recording)} cycles>"
    with sim.serve(str(tmp_path / "arm")) as server:
        assert repr(server).startswith("<controller served as ")
        with takt.connect(str(tmp_path / "arm")) as client:
            of_client = client.events()
        assert repr(client) == f"<closed arm of {axis.name}>" and "events" in repr(of_client)
    assert repr(server).startswith("<controller closed as ")
    sim.close()
    assert repr(sim) == f'<arm "{group}", ended: {axis.name}>'
    assert "ms old" in repr(sim.state)


def test_the_package_says_its_version():
    from importlib.metadata import version

    assert takt.__version__ == version("takt")
