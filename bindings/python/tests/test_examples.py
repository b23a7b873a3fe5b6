"""The examples, and every program of docs/python.md."""

import re
import sys
import textwrap

import numpy as np
import pytest
import takt
from conftest import ARM6, ROOT, assert_within_limits, joint

sys.path.insert(0, str(ROOT / "bindings" / "python" / "examples"))


def test_a_robot_of_lerobot_observes_and_acts():
    from lerobot_robot import TaktRobot, TaktRobotConfig

    sim = takt.simulate(ARM6)
    robot = TaktRobot(TaktRobotConfig(config=ARM6), arm=sim)
    assert not robot.is_connected
    with pytest.raises(ConnectionError, match="connect"):
        robot.get_observation()
    robot.connect()
    assert robot.is_connected and robot.is_calibrated
    assert set(robot.observation_features) == {f"joint{n}.pos" for n in range(1, 7)} == set(robot.action_features)
    with sim.record() as recording:
        for number in range(90):
            observation = robot.get_observation()
            assert set(observation) == set(robot.observation_features)
            action = {f"joint{n}.pos": 0.3 * np.sin(number / 30) if n != 4 else -0.5 for n in range(1, 7)}
            assert robot.send_action(action) == pytest.approx(action)
            sim.run(1 / 30)
        wild = robot.send_action(dict.fromkeys(robot.action_features, 99.0))
        assert wild["joint1.pos"] == sim.axes[0].position_max
        sim.run(0.1)
        robot.send_chunk(np.tile(sim.state.position_set, (50, 1)), fps=50)
        sim.run(1.0)
    assert_within_limits(recording, sim.axes)
    robot.disconnect()
    assert sim.has_ended and not robot.is_connected
    with pytest.raises(ConnectionError, match="connect"):
        robot.send_action(wild)


def test_a_robot_of_lerobot_starts_its_own_arm():
    from lerobot_robot import TaktRobot, TaktRobotConfig

    robot = TaktRobot(TaktRobotConfig(config=joint() | {"telemetry": {"record": False}}, simulated=True))
    robot.connect()
    robot.send_action({"joint.pos": 0.1})
    robot.disconnect()


def test_the_environment_is_one_of_gymnasium():
    from gymnasium.utils.env_checker import check_env
    from gymnasium_reach import ReachEnv

    check_env(ReachEnv(ARM6), skip_render_check=True)


def test_a_simple_policy_reaches_the_goal_and_the_same_seed_gives_the_same_episode():
    from gymnasium_reach import ReachEnv

    def episode():
        env = ReachEnv(ARM6)
        observation, _ = env.reset(seed=3)
        observations, terminated, truncated = [observation], False, False
        while not (terminated or truncated):
            position, goal = observation[:6], observation[12:]
            observation, _, terminated, truncated, _ = env.step(np.clip(2.0 * (goal - position), -1, 1))
            observations.append(observation)
        env.close()
        return terminated, np.array(observations)

    (reached, first), (_, second) = episode(), episode()
    assert reached
    np.testing.assert_array_equal(first, second)


PAGE = (ROOT / "docs" / "python.md").read_text()
PROGRAMS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("number", range(len(PROGRAMS)))
def test_every_program_of_the_page_runs(number):
    exec(compile(textwrap.dedent(PROGRAMS[number]), f"docs/python.md, program {number + 1}", "exec"), {})
