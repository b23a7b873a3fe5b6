"""takt: a hard-real-time joint-motion controller for CAN drives.

    import takt

    with takt.Arm("configs/arm6-erob.toml", simulated=True) as arm:
        arm.move([0.3, -0.2, 0.4, -0.9, 0.2, 0.5], speed=0.5)
        print(arm.state.position)

Angles are in rad, lengths in m, times in seconds, torques in N·m (forces in N).
"""

import atexit as _atexit
import os as _os

from . import _takt
from ._takt import __version__, Arm, Axis, Event, Events, Group, Motion, Recording, Server, Simulation, State, Stream, connect, simulate
from .errors import (
    ArgumentError,
    CommandError,
    ConfigError,
    ConfigWarning,
    EndedError,
    Error,
    LeaseError,
    LimitError,
    MotionError,
    OwnerError,
    RefusedError,
    ReplacedError,
    ShutdownError,
    StartError,
    StoppedError,
    StreamError,
    TimeoutError,
    TrajectoryError,
)

__all__ = [
    "ArgumentError",
    "Arm",
    "Axis",
    "CommandError",
    "ConfigError",
    "ConfigWarning",
    "EndedError",
    "Error",
    "Event",
    "Events",
    "Group",
    "LeaseError",
    "LimitError",
    "Motion",
    "MotionError",
    "OwnerError",
    "Recording",
    "Server",
    "RefusedError",
    "ReplacedError",
    "ShutdownError",
    "Simulation",
    "StartError",
    "State",
    "StoppedError",
    "Stream",
    "StreamError",
    "TimeoutError",
    "TrajectoryError",
    "__version__",
    "connect",
    "simulate",
]

# A program that ends without closing its arms leaves them at rest, too.
_atexit.register(_takt._close_all)
# A fork has none of the threads of a controller, and must leave it alone.
_os.register_at_fork(after_in_child=_takt._after_fork)
