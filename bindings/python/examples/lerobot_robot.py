"""An arm of takt as a robot of LeRobot (https://github.com/huggingface/lerobot).

takt owns the real-time thread: `send_action` hands a point to its stream and returns, so a policy at 30 Hz, a pause for a new chunk, or a
crash of the policy leave the arm within its limits. Without lerobot installed the class works by itself, with the same methods and
without cameras.

    robot = TaktRobot(TaktRobotConfig(config="configs/arm6-erob.toml", simulated=True))
    robot.connect()
    robot.send_action({"joint1.pos": 0.1, ...})
    robot.disconnect()

Tried with lerobot 0.6.1. For its programs (`lerobot-record --robot.type=takt --robot.config=arm.toml`) put this file into a package whose
name begins with `lerobot_robot_`, which they import by themselves.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import takt
from numpy.typing import ArrayLike

try:
    from lerobot.cameras import CameraConfig, make_cameras_from_configs
    from lerobot.robots import Robot, RobotConfig

    _register = RobotConfig.register_subclass("takt")
except ImportError:  # It is an example, and needs nothing but takt.
    Robot = object
    RobotConfig = object
    CameraConfig = Any

    def _register(config_class: type) -> type:
        return config_class

    def make_cameras_from_configs(_configs: dict[str, Any]) -> dict[str, Any]:
        return {}


@_register
@dataclass(kw_only=True)
class TaktRobotConfig(RobotConfig):
    """`config` is the path of a configuration, or another one that `takt.Arm` takes."""

    config: str
    simulated: bool = False
    buses: dict[str, str] | None = None
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


class TaktRobot(Robot):
    """The joints of an arm, as `<axis>.pos` in rad (m)."""

    config_class = TaktRobotConfig
    name = "takt"

    def __init__(self, config: TaktRobotConfig, arm: takt.Arm | None = None):
        # An example alone has no base class that takes it.
        if Robot is not object:
            super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)
        self._given = arm
        self._connected: tuple[takt.Arm, takt.Stream] | None = None
        # The names and limits are needed before the arm is connected.
        with nullcontext(arm) if arm else takt.simulate(config.config) as described:
            self._names = [axis.name for axis in described.axes]
            self._lowest = np.array([axis.position_min for axis in described.axes])
            self._highest = np.array([axis.position_max for axis in described.axes])

    @property
    def observation_features(self) -> dict[str, Any]:
        cameras = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return self.action_features | cameras

    @property
    def action_features(self) -> dict[str, Any]:
        return {f"{name}.pos": float for name in self._names}

    @property
    def is_connected(self) -> bool:
        return self._connected is not None

    @property
    def is_calibrated(self) -> bool:
        # The drives have absolute encoders, and the configuration has their zero points.
        return True

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def connect(self, calibrate: bool = True) -> None:
        if self.is_connected:
            raise ConnectionError("the robot is connected already")
        config = self.config
        arm, self._given = self._given or takt.Arm(config.config, simulated=config.simulated, buses=config.buses), None
        try:
            for camera in self.cameras.values():
                camera.connect()
            self._connected = arm, arm.follow()
        except BaseException:
            arm.close()
            raise

    def get_observation(self) -> dict[str, Any]:
        arm, _ = self._check_connected()
        state = arm.state
        if state.fault:
            raise takt.StoppedError(state.fault)
        positions = self._named(state.position)
        return positions | {name: camera.async_read() for name, camera in self.cameras.items()}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Returns what is sent: the action within the limits of the positions."""
        _, stream = self._check_connected()
        wanted = np.array([action[f"{name}.pos"] for name in self._names], dtype=float)
        sent = np.clip(wanted, self._lowest, self._highest)
        stream.push(sent)
        return self._named(sent)

    def send_chunk(self, actions: ArrayLike, fps: float) -> None:
        """A whole chunk of a policy (ACT, diffusion): a row for each action, from now on. The next chunk may overlap it."""
        _, stream = self._check_connected()
        stream.push_chunk(None, 1.0 / fps, actions)

    def disconnect(self) -> None:
        connected, self._connected = self._connected, None
        if connected is None:
            return
        arm, stream = connected
        try:
            stream.finish()
        finally:
            # After a fault, too.
            for camera in self.cameras.values():
                camera.disconnect()
            arm.close()

    def _check_connected(self) -> tuple[takt.Arm, takt.Stream]:
        if self._connected is None:
            raise ConnectionError("the robot is not connected: call connect() first")
        return self._connected

    def _named(self, positions: np.ndarray[Any, np.dtype[np.float64]]) -> dict[str, Any]:
        return {f"{name}.pos": float(q) for name, q in zip(self._names, positions)}
