"""An arm of takt as a robot of LeRobot (https://github.com/huggingface/lerobot).

takt owns the real-time thread: `send_action` hands a point to its stream and returns, so a policy at 30 Hz, a pause for a new chunk, or a
crash of the policy leave the arm within its limits. Without lerobot installed the class works by itself, with the same methods.

    robot = TaktRobot(TaktRobotConfig(config="configs/arm6-erob.toml", simulated=True))
    robot.connect()
    robot.send_action({"joint1.pos": 0.1, ...})
    robot.disconnect()
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import takt

try:
    from lerobot.robots import Robot, RobotConfig

    _register = RobotConfig.register_subclass("takt")
except ImportError:  # It is an example, and needs nothing but takt.
    Robot = object
    RobotConfig = object

    def _register(config_class: type) -> type:
        return config_class


@_register
@dataclass(kw_only=True)
class TaktRobotConfig(RobotConfig):
    """`config` is what `takt.Arm` takes; `cameras` are objects with `connect`, `async_read` and `disconnect`, by their names."""

    config: Any
    simulated: bool = False
    buses: dict[str, str] | None = None
    cameras: dict[str, Any] = field(default_factory=dict)


class TaktRobot(Robot):
    """The joints of an arm, as `<axis>.pos` in rad (m)."""

    config_class = TaktRobotConfig
    name = "takt"

    def __init__(self, config: TaktRobotConfig, arm: takt.Arm | None = None):
        if Robot is not object:
            super().__init__(config)
        self.config = config
        self.cameras = config.cameras
        self.arm = arm
        self._stream: takt.Stream | None = None
        # The names are needed before the arm is connected.
        with nullcontext(arm) if arm else takt.simulate(config.config) as described:
            self._names = [axis.name for axis in described.axes]

    @property
    def observation_features(self) -> dict[str, Any]:
        cameras = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return {f"{name}.pos": float for name in self._names} | cameras

    @property
    def action_features(self) -> dict[str, Any]:
        return {f"{name}.pos": float for name in self._names}

    @property
    def is_connected(self) -> bool:
        return self._stream is not None

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
        if self.arm is None:
            self.arm = takt.Arm(self.config.config, simulated=self.config.simulated, buses=self.config.buses)
        for camera in self.cameras.values():
            camera.connect()
        self._stream = self.arm.follow()

    def get_observation(self) -> dict[str, Any]:
        self._check_connected()
        state = self.arm.state
        if state.fault:
            raise takt.StoppedError(state.fault)
        positions = {f"{name}.pos": float(q) for name, q in zip(self._names, state.position)}
        return positions | {name: camera.async_read() for name, camera in self.cameras.items()}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Returns what is sent: the action within the limits of the positions."""
        self._check_connected()
        wanted = np.array([action[f"{name}.pos"] for name in self._names], dtype=float)
        limits = [(axis.position_min, axis.position_max) for axis in self.arm.axes]
        sent = np.clip(wanted, *np.transpose(limits))
        self._stream.push(sent)
        return {f"{name}.pos": float(q) for name, q in zip(self._names, sent)}

    def send_chunk(self, actions: np.ndarray, fps: float) -> None:
        """A whole chunk of a policy (ACT, diffusion): a row for each action, from now on. The next chunk may overlap it."""
        self._check_connected()
        self._stream.push_chunk(None, 1.0 / fps, actions)

    def _check_connected(self) -> None:
        if not self.is_connected:
            raise ConnectionError("the robot is not connected: call connect() first")

    def disconnect(self) -> None:
        stream, arm = self._stream, self.arm
        self._stream = self.arm = None
        try:
            if stream is not None:
                stream.finish()
        finally:
            # After a fault, too.
            for camera in self.cameras.values():
                camera.disconnect()
            if arm is not None:
                arm.close()
