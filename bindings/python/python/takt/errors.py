"""The exceptions of takt. Their texts are the library's: what is wrong, where, and what to do about it."""

import builtins


class Error(Exception):
    """Any error of takt."""


class ConfigError(Error, ValueError):
    """A configuration that cannot be used; the text shows each problem at its line."""


class StartError(Error, RuntimeError):
    """The drives could not be brought up or enabled. Nothing has moved."""


class ShutdownError(Error, RuntimeError):
    """The run has not ended as it should: a fault on the way, or drives that did not answer."""


class EndedError(Error, RuntimeError):
    """The controller has ended, or is in another process."""


class TimeoutError(Error, builtins.TimeoutError):
    """A wait has taken too long. What was waited for goes on."""


class CommandError(Error):
    """A command was not carried out; nothing has changed."""


class ArgumentError(CommandError, ValueError):
    """A command does not fit: another number of axes, a name that is not there, a wrong number."""


class LimitError(ArgumentError):
    """A value is beyond a limit of its axis."""

    axis: str
    value: float
    lowest: float
    highest: float


class TrajectoryError(ArgumentError):
    """A trajectory was refused before anything moved: the first point, axis and limit that it breaks."""

    point: "int | None"
    axis: "str | None"
    #: The limit that is broken: position, velocity, acceleration, deceleration, jerk; None where it is not a limit.
    quantity: "str | None" = None
    #: When, in seconds after the beginning of the trajectory.
    time: "float | None" = None
    value: "float | None" = None
    limit: "float | None" = None


class LeaseError(CommandError):
    """Another process commands the controller, or this one may only observe it."""

    #: The process that commands, or that has taken over; None where it is the permissions.
    process: "int | None"


class OwnerError(CommandError):
    """Only the program that runs the controller can say or do this."""


class RefusedError(CommandError):
    """The real-time thread has refused a request: in this phase, or while a fault is latched."""


class StreamError(CommandError):
    """Points of a stream were not taken."""

    point: "int | None" = None
    axis: "str | None" = None


class MotionError(Error):
    """A motion has not reached its targets."""


class StoppedError(MotionError):
    """The axes have stopped: a fault, or a stop that was asked for."""

    #: The rule, as configurations call it: "following_error", "requested".
    rule: str
    #: The category of the stop (IEC 60204-1): 0, 1, 2; None where it came before the motion had begun.
    category: "int | None"
    axis: "str | None"


class ReplacedError(MotionError):
    """A later motion has taken the place of this one."""


class ConfigWarning(UserWarning):
    """What a configuration says is possible, and implausible."""
