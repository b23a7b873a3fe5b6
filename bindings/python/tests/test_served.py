"""A controller of another process, commanded by the calls of an own one."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
import takt
from conftest import ARM6, HOME, ROOT

SERVER = """
import sys, time, takt
config, name = sys.argv[1:]
arm = takt.Arm(config, simulated=True, record=False)
server = arm.serve(name, lease=60.0)
print("served", flush=True)
time.sleep(3600)
"""


class Served:
    """The process of a controller of simulated drives."""

    def __init__(self, config, folder):
        self.name = str(folder / "arm")
        command = [sys.executable, "-c", SERVER, str(config), self.name]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "served\n"

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


@pytest.fixture
def served(tmp_path):
    served = Served(ARM6, tmp_path)
    yield served
    served.kill()


@pytest.fixture
def arm(served):
    with takt.connect(served.name) as arm:
        yield arm


def test_the_calls_of_an_own_arm_move_that_of_another_process(arm):
    assert isinstance(arm, takt.Arm) and arm.groups == [] and len(arm.axes) == 6
    with takt.simulate(ARM6) as own:
        described = lambda axis: (axis.name, axis.modes, axis.position_min, axis.jerk)
        assert [described(axis) for axis in arm.axes] == [described(axis) for axis in own.axes]
        assert own.name == arm.name
    events = arm.events()
    arm.move(HOME + 0.05)
    assert np.allclose(arm.state.position_set, HOME + 0.05)
    assert arm.state.phase == "holding" and arm.state.age.max() < 60.0
    arm.move_through([HOME + 0.02, HOME])
    motion = arm.execute([1.0, 2.0], [HOME + 0.05, HOME], wait=False)
    assert motion.progress[1] == 2.0 and not motion.is_done
    motion.set_speed(0.5)
    motion.pause()
    motion.resume()
    motion.wait(30)
    assert motion.is_done and motion.progress is None
    kinds = [event.kind for event in events.poll()]
    assert kinds.count("motion_finished") == 3 and "phase" in kinds
    arm.disable()
    arm.enable()
    assert arm.state.phase == "holding" and arm.state.fault is None


def test_a_stream_and_a_recording_are_those_of_an_own_arm(arm):
    last = HOME + 0.0145
    with arm.record() as recording:
        with arm.follow() as stream:
            assert stream.state != "idle"
            begun = arm.time
            for number in range(30):
                stream.push(HOME + 0.0005 * number)
                while arm.time < begun + 0.01 * number:
                    pass
            stream.push_chunk(arm.time, 0.02, np.tile(last, (10, 1)))
            assert stream.counts[0] >= 20
    assert np.allclose(arm.state.position_set, last, atol=1e-6)
    assert len(recording) > 50 and recording.position.shape == (len(recording), 6)
    assert np.all(np.diff(recording.time) > 0)
    assert recording.position_set[-1] == pytest.approx(last, abs=1e-6)
    assert np.isnan(recording.acceleration_set).all(), "a state has none"


def test_a_group_of_another_process_is_commanded_by_itself(tmp_path):
    served = Served(ROOT / "configs" / "arm-and-gripper.toml", tmp_path)
    try:
        with takt.connect(served.name) as both:
            assert both.groups == ["arm", "gripper"]
            arm = both.group("arm")
            arm.move([0.1, -0.1, 0.1])
            assert np.allclose(arm.state.position_set, [0.1, -0.1, 0.1])
            with pytest.raises(takt.ArgumentError):
                both.group("leg")
    finally:
        served.kill()


def test_one_process_commands_and_another_takes_over_only_explicitly(served, arm):
    motion = arm.move(HOME + 0.2, wait=False, speed=0.05)
    with takt.connect(served.name) as second:
        with pytest.raises(takt.LeaseError, match="take it over") as held:
            second.move(HOME)
        assert held.value.process == os.getpid() and second.lease[0] == os.getpid()
        second.take_over()
        with pytest.raises(takt.LeaseError, match="taken over"):
            arm.disable()
        assert not motion.is_done, "what moves goes on"
        arm.stop(wait=True)  # needs no lease
        with pytest.raises(takt.StoppedError):
            motion.wait()
        second.move(HOME)
        second.release()
        assert arm.lease is None
    with takt.connect(served.name, take_over=True) as third:
        third.move(HOME + 0.01)


def test_what_is_refused_says_the_same_as_of_an_own_arm(arm):
    with pytest.raises(takt.LimitError) as error:
        arm.move([9.0, 0, 0, 0, 0, 0])
    assert error.value.axis == "joint1" and error.value.value == 9.0
    with pytest.raises(takt.TrajectoryError) as error:
        arm.execute([0.01], [HOME + 1.0])
    assert (error.value.point, error.value.axis) == (0, "joint1")
    with pytest.raises(takt.OwnerError, match="connected"):
        arm.realtime
    with pytest.raises(takt.OwnerError):
        arm.not_written
    with pytest.raises(takt.OwnerError):
        arm.serve("other")
    assert not hasattr(arm, "step"), "its time is real"


def test_ctrl_c_of_who_watches_does_not_stop_the_arm_of_another_process(served, arm):
    motion = arm.move(HOME + 0.5, speed=0.02, wait=False)
    program = f"""
import os, signal, threading, takt
events = takt.connect({served.name!r}).events()
threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    for event in events:
        pass
except KeyboardInterrupt:
    print("interrupted")
"""
    listening = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, preexec_fn=listening)
    assert done.stdout == "interrupted\n", done.stderr
    assert not motion.is_done and arm.state.phase == "moving"
    arm.stop()


def test_the_death_of_the_process_is_told_by_every_call(served, arm):
    events = arm.events()
    motion = arm.move(HOME + 0.5, speed=0.05, wait=False)
    served.kill()
    with pytest.raises(takt.EndedError):
        motion.wait()
    with pytest.raises(takt.EndedError):
        arm.move(HOME)
    with pytest.raises(takt.EndedError):
        arm.stop()
    assert arm.has_ended and arm.state.slot > 0, "the last state is still there"
    assert all(event.kind != "stop" for event in events), "it has died without a word, and the iteration ends"
    with pytest.raises(takt.StartError, match="served"):
        takt.connect(served.name)


def test_a_closed_connection_leaves_the_controller(served):
    arm = takt.connect(served.name)
    arm.move(HOME + 0.01)
    arm.close()
    arm.close()
    with pytest.raises(takt.EndedError, match="closed"):
        arm.state
    with takt.connect(served.name) as again:
        assert again.lease is None, "it was given back"
        again.move(HOME)


def test_nobody_is_served_by_a_name_that_nobody_has():
    with pytest.raises(takt.StartError, match="nobody-has-it"):
        takt.connect("nobody-has-it")
