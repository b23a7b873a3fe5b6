"""The compiled part of the package: import its names from `takt`.

Angles are in rad, lengths in m, times in seconds, torques in N·m (forces in N). "For each axis" means one number for each, in the order
of `axes`.
"""

from os import PathLike
from typing import Any, Literal, TypeAlias, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self, disjoint_base

__all__ = [
    "Arm",
    "Event",
    "Events",
    "Axis",
    "Group",
    "Motion",
    "__version__",
    "_after_fork",
    "_close_all",
    "Recording",
    "Server",
    "Simulation",
    "connect",
    "simulate",
    "State",
    "Stream",
]

__version__: str

_Floats: TypeAlias = NDArray[np.float64]
_Config: TypeAlias = str | PathLike[str] | dict[str, Any]
_Mode: TypeAlias = Literal["csp", "csv", "cst", "ip", "pp", "pv", "pt"]
_Phase: TypeAlias = Literal[
    "passive", "disabled", "enabling", "holding", "moving", "streaming", "stopping", "disabling"
]

class _Realtime(TypedDict):
    policy: str
    priority: int | None
    cpu: int | None
    memory_locked: bool
    preempt_rt: bool
    refused: list[str]
    grant_with: list[str]

@final
class Axis:
    """An axis, as the configuration has it. rad, rad/s, rad/s², rad/s³ and N·m; m and N of a linear axis."""

    @property
    def name(self) -> str: ...
    @property
    def position_min(self) -> float: ...
    @property
    def position_max(self) -> float: ...
    @property
    def velocity(self) -> float:
        """The highest speed."""
    @property
    def acceleration(self) -> float: ...
    @property
    def deceleration(self) -> float: ...
    @property
    def jerk(self) -> float: ...
    @property
    def torque(self) -> float: ...
    @property
    def modes(self) -> list[str]:
        """The modes of operation that the configuration allows; the first is the one that it starts in."""

@disjoint_base
class Group:
    """Axes that move together: all of an arm, or one group of them.

    Calls release the interpreter's lock while they wait. Ctrl-C in one that waits stops the axes in control (category 2) and raises
    KeyboardInterrupt. A call that raises a `CommandError` has changed nothing.
    """

    @property
    def name(self) -> str: ...
    @property
    def axes(self) -> list[Axis]:
        """The axes, in the order in which values are given and returned."""
    @property
    def state(self) -> State:
        """The state after the newest complete cycle. Some microseconds; it disturbs nothing."""

    def move(
        self,
        q: ArrayLike,
        *,
        speed: float = 1.0,
        acceleration: float = 1.0,
        duration: float = 0.0,
        wait: bool = True,
        timeout: float | None = None,
    ) -> Motion:
        """Moves every axis to its target `q`, where all come to rest at the same time.

        `speed` and `acceleration` are fractions of the limits, above 0 up to 1; `duration` is the least time of the move. A move replaces
        the one that is under way. With `wait=False` it returns at once.

        Raises `LimitError` for a target beyond the limits, and what `Motion.wait` raises.
        """

    def move_through(self, waypoints: ArrayLike, *, wait: bool = True, timeout: float | None = None) -> Motion:
        """Moves through waypoints (a row each) without stopping, to rest at the last one, nearly as fast as the limits allow."""

    def execute(
        self,
        times: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        *,
        wait: bool = True,
        timeout: float | None = None,
    ) -> Motion:
        """Carries out points with times (seconds from now), as a JointTrajectory of ROS has them: a row of `q` for each.

        Without `qd` a smooth curve leads through the points and ends at rest; nowhere is it beyond the points on both sides of it. All of
        it is checked before anything moves: `TrajectoryError` has the first point, axis and limit. A first point at 0 must be where the
        axes are; with a later one they go there first, unless a way from rest would swing far back for the velocity of that point. While
        another trajectory is under way, this one takes its place without a step.
        """

    def follow(self) -> Stream:
        """Begins to follow a stream of points of any rate. Use it as a context manager."""

    def wait(self, motion: Motion, timeout: float | None = None) -> None:
        """The same as `motion.wait(timeout)`."""

    def stop(self, category: Literal[0, 1, 2] = 2, *, wait: bool = False, timeout: float | None = 30.0) -> None:
        """Asks for a stop (IEC 60204-1), and returns at once, or when the axes are at rest if it is to `wait`. 2 decelerates and holds, 1 decelerates and disables, 0 removes power at once.

        It is never refused, and may be called from any thread. It discards what has been asked for and not begun.
        """

    def enable(self, timeout: float | None = 30.0) -> None:
        """Enables the axes again unless they hold, and waits until they do. After a fault, `clear_fault` first."""

    def disable(self, timeout: float | None = 30.0) -> None:
        """Brings the axes to rest and disables them, and waits for that."""

    def clear_fault(self) -> None:
        """Clears the fault that has stopped the axes. They stay disabled."""

    def change_mode(self, mode: _Mode, axis: int | str | None = None, *, timeout: float | None = 5.0) -> None:
        """Changes the mode of operation of every axis, or of one, as far as the configuration allows it."""

    def drive_velocity(self, axis: int | str, velocity: float, *, valid_for: float = 0.1) -> Motion:
        """Gives an axis in profile velocity ("pv") a velocity. Unless it comes again within `valid_for`, the group stops."""

    def drive_torque(self, axis: int | str, torque: float, *, valid_for: float = 0.1) -> Motion:
        """Gives an axis in profile torque ("pt") a torque. Unless it comes again within `valid_for`, the group stops."""

@disjoint_base
class Arm(Group):
    """A controller in real time, with its own real-time thread. The arm is enabled, and holds its position.

    `config` is the path of a TOML file, the text of one (of several lines), or a dictionary with its keys. `buses` connects buses to
    other interfaces: `{"base": "can0"}`; with `simulated`, all others are simulated in this process. `record` is a file for the recording
    (MCAP), or False for none; None is as the configuration says. `require_realtime` raises if the system refuses a step of the real-time
    set-up; `take_over` has another process that commands one of the buses stop in control first.

    Close it, or use it as a context manager: then the axes come to rest, and the drives are disabled and shut down.
    """

    def __new__(
        cls,
        config: _Config,
        *,
        buses: dict[str, str] | None = None,
        simulated: bool = False,
        record: bool | str | PathLike[str] | None = None,
        require_realtime: bool = False,
        take_over: bool = False,
    ) -> Self: ...
    def close(self) -> None:
        """Brings the axes to rest, disables and shuts down the drives. Raises `ShutdownError` if that went wrong."""
    @property
    def time(self) -> float:
        """The present time on the clock of the arm: that of `time.monotonic()`, or virtual time. Stamps and events are on it."""
    @property
    def groups(self) -> list[str]:
        """The names of the groups; none where all axes are one group."""
    def group(self, name: str) -> Group:
        """One group of several, which is commanded by itself."""
    def events(self) -> Events:
        """What happens from now on."""
    def record(self, at_most: float = 600.0) -> Recording:
        """Records every cycle from now on, for no more than `at_most` seconds. Use it as a context manager."""
    @property
    def realtime(self) -> _Realtime:
        """What the system has granted to the real-time thread, what it has refused, and the commands that grant it."""
    @property
    def not_written(self) -> list[str]:
        """The recordings that could not be written. The motion goes on after them."""
    @property
    def has_ended(self) -> bool:
        """Whether the run has ended, or the process of the controller."""
    @property
    def lease(self) -> tuple[int, float] | None:
        """Of a controller that is served: the process that commands, and the seconds until another one may follow it; None if nobody does."""
    def serve(self, name: str, *, mode: int = 0o600, lease: float = 1.0) -> Server:
        """Lets other processes observe and command the controller by this name, as `takt run --serve` does: see `connect`.

        `mode` is read as file permissions: who may read observes, who may write commands. `lease` is how long after its last command a
        client keeps the lease, in seconds. The program itself needs none.
        """
    def take_over(self) -> None:
        """Commands a controller of another process in place of whoever commands it; that one gets a `LeaseError` from then on."""
    def release(self) -> None:
        """Lets another process command. One's own controller needs neither."""
    def __enter__(self) -> Self: ...
    def __exit__(self, *exception: object) -> None: ...

@final
class Simulation(Arm):
    """An arm of simulated drives in virtual time. See `simulate`."""

    def __new__(cls, config: _Config) -> Self: ...
    def step(self, cycles: int = 1) -> None:
        """Lets this many cycles pass, as fast as the computer can."""
    def run(self, seconds: float) -> None:
        """Lets a time pass, rounded up to whole cycles."""

def simulate(config: _Config) -> Simulation:
    """An arm of simulated drives in virtual time, whatever interfaces the configuration has.

    Its time passes only in `step`, `run`, and each call that waits, by as many cycles as the wait takes. The same calls give the same
    motion bit for bit.
    """

@final
class Server:
    """Lets other processes observe and command a controller, until it is closed. Use it as a context manager."""

    def close(self) -> None:
        """The clients' calls raise `EndedError` from then on. The controller goes on."""
    def __enter__(self) -> Self: ...
    def __exit__(self, *_exception: object) -> None: ...

def connect(name: str, *, take_over: bool = False) -> Arm:
    """Connects to a controller that another process of this computer serves: `takt run CONFIG --serve NAME`.

    The arm has the same calls. Any number of processes observe, and one commands: the first command takes the lease, each command renews it,
    and it ends 1 s after the last one; others get a `LeaseError` until then, or `take_over`. `stop` needs no lease. `close` ends the
    connection, and not the controller: what moves goes on. `record` has the cycles that this process sees, without accelerations. `realtime` and
    `not_written` raise `OwnerError`. When the process of the controller ends, calls raise `EndedError`.

    Raises `StartError` if no controller is served by the name, or its permissions do not let this process observe it.
    """

@final
class Motion:
    """A motion that has begun."""

    def wait(self, timeout: float | None = None) -> None:
        """Waits until the axes are at rest at their targets.

        Raises `StoppedError` after a stop, `ReplacedError` when another motion has taken its place, `RefusedError`, `TimeoutError`.
        """
    @property
    def is_done(self) -> bool:
        """Whether it has ended, however it has."""
    @property
    def progress(self) -> tuple[float, float, float] | None:
        """Of a trajectory under way: its time on the path, the time of its last point, and the rate at which it passes."""
    def set_speed(self, rate: float) -> None:
        """Changes the speed along the path of a trajectory: 1 as it was written. The path stays the same."""
    def pause(self) -> None:
        """Brings the axes to rest on the path of a trajectory."""
    def resume(self) -> None:
        """Goes on with a trajectory that was paused."""

@final
class Stream:
    """Points of any rate, each stamped with the time that it is meant for.

    The real-time thread interpolates, runs behind the stamps by `lag`, and keeps every limit, however late, early, uneven or wild the
    points are. When they run out, the axes come to rest; when they come again, the axes go on.

    At the end of its `with` the last point is waited for; after an exception the axes stop at once.
    """

    def push(
        self,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        t: float | None = None,
        *,
        qdd: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
    ) -> None:
        """Hands over a point that is meant for the time `t` of the arm; for now without it.

        It has positions `q`, with or without velocities `qd`, accelerations `qdd`, torques that are fed forward, and an impedance (`kp` in
        N·m/rad, `kd` in N·m·s/rad, for each axis or one number for all); or velocities alone; or torques alone. A torque loop needs an axis
        in mode "cst".
        """
    def push_chunk(
        self,
        t0: float | None,
        dt: float,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        *,
        qdd: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
    ) -> None:
        """Hands over points at equal intervals `dt` (a row each), the first of which is meant for `t0`; for now if that is None.

        They take the place of every earlier point from there on, as overlapping chunks of a policy are to. Up to 256 points may wait, of which
        the loop takes eight in a cycle.
        """
    @property
    def state(self) -> Literal["idle", "awaited", "following", "dry", "callback"]:
        """It is "awaited" before the first point, "following", "dry" when the points have run out, "idle" when the axes follow no longer."""
    @property
    def lag(self) -> float:
        """How far the set-points are behind the stamps now."""
    @property
    def counts(self) -> tuple[int, int, int]:
        """The points that have come, that came too late for their time, and that were lost."""
    def finish(self, timeout: float | None = None) -> None:
        """Waits for the last point, and ends the stream: the axes hold."""
    def __enter__(self) -> Self: ...
    def __exit__(self, *exception: object) -> None: ...

@final
class State:
    """The state after a cycle. Each array has a value for each axis, nan where a drive has not reported it, and is the caller's own."""

    @property
    def slot(self) -> int:
        """The number of the cycle."""
    @property
    def time(self) -> float:
        """When the cycle was, on the clock of the arm."""
    @property
    def missed_slots(self) -> int:
        """Slots that passed unused since the start, because the real-time thread was late."""
    @property
    def position(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def torque(self) -> _Floats: ...
    @property
    def position_set(self) -> _Floats:
        """The set-points of the positions."""
    @property
    def velocity_set(self) -> _Floats: ...
    @property
    def torque_set(self) -> _Floats: ...
    @property
    def following_error(self) -> _Floats: ...
    @property
    def current(self) -> _Floats:
        """As fractions of the rated currents."""
    @property
    def temperature(self) -> _Floats:
        """Of the drives, in °C."""
    @property
    def age(self) -> _Floats:
        """How old what each drive reports is, in seconds; infinite before its first report."""
    @property
    def is_stale(self) -> NDArray[np.bool_]:
        """Whether what a drive reports is not from its last cycle."""
    @property
    def phase(self) -> _Phase:
        """What the axes are doing; where groups do different things, what the first does."""
    @property
    def phases(self) -> dict[str, _Phase]:
        """What each group is doing."""
    @property
    def fault(self) -> str | None:
        """The fault that has stopped the axes, in words."""
    @property
    def mode(self) -> list[str]:
        """The mode of operation of each axis."""
    @property
    def drive_state(self) -> list[str]:
        """The state of each drive (CiA 402)."""
    @property
    def error_code(self) -> list[int]:
        """The error code of each drive; 0 for none."""

@final
class Event:
    """Something that happened. `str(event)` is its sentence."""

    @property
    def slot(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def kind(
        self,
    ) -> Literal[
        "phase",
        "stop",
        "stream",
        "motion_finished",
        "drive_state",
        "mode",
        "emergency",
        "missed_slots",
        "timing",
        "rejected",
    ]: ...
    @property
    def axis(self) -> str | None: ...
    @property
    def group(self) -> str | None: ...
    @property
    def words(self) -> str: ...

@final
class Events:
    """The events since a beginning. To iterate waits for each, until the arm is closed; `poll` does not wait."""

    def poll(self) -> list[Event]:
        """The events that have come."""
    def wait(self, timeout: float | None = None) -> Event:
        """Waits for the next event."""
    @property
    def missed(self) -> int:
        """Events that this observer has missed because it was more than 1024 behind."""
    def __iter__(self) -> Self: ...
    def __next__(self) -> Event: ...

@final
class Recording:
    """Every cycle of a time. Each array has a row for each cycle and a column for each axis; `time` has one number for each cycle."""

    def stop(self) -> None:
        """Ends it, when everything up to now has been written down."""
    @property
    def time(self) -> _Floats: ...
    @property
    def position(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def torque(self) -> _Floats: ...
    @property
    def position_set(self) -> _Floats: ...
    @property
    def velocity_set(self) -> _Floats: ...
    @property
    def acceleration_set(self) -> _Floats: ...
    @property
    def torque_set(self) -> _Floats: ...
    @property
    def following_error(self) -> _Floats: ...
    @property
    def age(self) -> _Floats:
        """Cycles since the feedback of each axis; 0 for feedback of the same cycle."""
    def arrays(self) -> dict[str, _Floats]:
        """All arrays by their names, as `numpy.savez` takes them."""
    @property
    def is_full(self) -> bool:
        """Whether it has as many cycles as it may have."""
    def __len__(self) -> int: ...
    def __enter__(self) -> Self: ...
    def __exit__(self, *exception: object) -> None: ...

def _after_fork() -> None: ...
def _close_all() -> None: ...
