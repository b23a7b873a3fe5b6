"""A gymnasium environment: an arm is to reach a pose of its joints. The drives, the buses and the real-time engine are those of a real
arm, in virtual time; a policy that has learned here has met their delays, their limits and their following errors.

    env = ReachEnv("configs/arm6-erob.toml")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import takt
from numpy.typing import NDArray

Numbers = NDArray[np.float32]


class ReachEnv(gymnasium.Env[Numbers, Numbers]):
    """An action is a velocity for each joint, as a fraction of its limit. An observation is the positions and velocities of the joints and
    the pose that is to be reached."""

    metadata = {"render_modes": []}

    def __init__(self, config: Any, *, rate_hz: float = 50.0, seconds: float = 4.0, tolerance: float = 0.02):
        self._config = config
        self._dt = 1.0 / rate_hz
        self._steps = round(seconds * rate_hz)
        self._tolerance = tolerance
        self._episode: tuple[takt.Simulation, takt.Stream] | None = None
        with takt.simulate(config) as sim:
            axes = sim.axes
        self._low = np.array([axis.position_min for axis in axes])
        self._high = np.array([axis.position_max for axis in axes])
        self._fastest = np.array([axis.velocity for axis in axes])
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (len(axes),), np.float32)
        # A joint may be a little beyond its limits while it settles.
        lowest = np.concatenate([self._low, -2 * self._fastest, self._low]) - 0.1
        highest = np.concatenate([self._high, 2 * self._fastest, self._high]) + 0.1
        self._box = gymnasium.spaces.Box(lowest.astype(np.float32), highest.astype(np.float32), dtype=np.float32)
        self.observation_space = self._box

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Numbers, dict[str, Any]]:
        super().reset(seed=seed)
        self.close()
        # A new arm: the same seed gives the same episode bit for bit.
        sim = takt.simulate(self._config)
        middle, reach = (self._low + self._high) / 2, (self._high - self._low) / 2
        self._goal = middle + 0.5 * reach * self.np_random.uniform(-1, 1, len(middle))
        self._target = sim.state.position_set
        self._step = 0
        self._episode = sim, sim.follow()
        return self._observation(sim.state), {}

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        sim, stream = self._episode
        speed = np.clip(np.asarray(action, dtype=float), -1, 1) * 0.9 * self._fastest
        self._target = np.clip(self._target + speed * self._dt, self._low, self._high)
        stream.push(self._target)
        sim.run(self._dt)
        self._step += 1
        state = sim.state
        distance = float(np.abs(state.position - self._goal).max())
        reached = distance < self._tolerance
        return self._observation(state), -distance, reached, self._step >= self._steps, {"distance": distance}

    def close(self) -> None:
        if self._episode is not None:
            self._episode[0].close()
            self._episode = None

    def _observation(self, state: takt.State) -> Numbers:
        observation = np.concatenate([state.position, state.velocity, self._goal]).astype(np.float32)
        return np.clip(observation, self._box.low, self._box.high)
