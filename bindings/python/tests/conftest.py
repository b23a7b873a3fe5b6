"""What the tests share: where the configurations are, and arms."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import takt

ROOT = Path(__file__).resolve().parents[3]
ARM6 = ROOT / "configs" / "arm6-erob.toml"
HOME = np.array([0.0, 0.0, 0.0, -0.5, 0.0, 0.5])


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, monkeypatch):
    """What a run writes goes there. The configurations are beside it, as in the repository."""
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def sim():
    """Six axes in virtual time."""
    with takt.simulate(ARM6) as sim:
        yield sim


@pytest.fixture
def arm():
    """Six simulated axes in real time."""
    with takt.Arm(ARM6, simulated=True, record=False) as arm:
        yield arm


def joint(**more):
    """A configuration of one joint, as a dictionary."""
    limits = {
        "position": [-2.0, 2.0],
        "velocity": 1.5,
        "acceleration": 6.0,
        "jerk": 100.0,
        "torque": 31.0,
    }
    return {
        "name": "one",
        "bus": [{"name": "can"}],
        "axis": [{"name": "joint", "bus": "can", "node": 1, "drive": "erob-canopen", "limits": limits, **more}],
    }


def assert_within_limits(recording, axes):
    """Every set-point of a recording is within the limits of its axis, and the numbers go on from one cycle to the next."""
    tolerance = 1 + 1e-6
    velocity, acceleration = recording.velocity_set, recording.acceleration_set
    position = recording.position_set
    for index, axis in enumerate(axes):
        assert position[:, index].min() >= axis.position_min - 1e-9
        assert position[:, index].max() <= axis.position_max + 1e-9
        assert np.abs(velocity[:, index]).max() <= axis.velocity * tolerance
        hardest = max(axis.acceleration, axis.deceleration)
        assert np.abs(acceleration[:, index]).max() <= hardest * tolerance
        steps = np.abs(np.diff(position[:, index]))
        assert steps.max() <= axis.velocity * 1e-3 * tolerance + 1e-12
