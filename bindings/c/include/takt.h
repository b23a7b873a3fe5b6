/* takt: a hard-real-time joint-motion controller for CAN drives. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Made by cbindgen of bindings/c/src. docs/c.md is the guide, with a program of ten lines.
 *
 * takt owns the real-time thread. A program commands and observes it from any of its threads, and may be slow, late, stopped or dead: the
 * axes keep their limits. Every function may be called from any thread at any time, unless it says otherwise; none is called back but the
 * callback of takt_begin_callback(). Handles are numbers that are checked: a wrong, closed or null one is TAKT_ERROR_HANDLE. Positions are
 * rad (m), velocities rad/s (m/s), torques N·m (N); stamps are ns on the clock of takt_now_ns(), other times seconds, as their names say.
 *
 * Structures that begin with `size` may grow: set it to their sizeof. A program that was compiled with an older header works with a newer
 * library of the same TAKT_ABI_VERSION. A name that begins with `reserved` is 0.
 */

#ifndef TAKT_H
#define TAKT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
/* The library is libtakt.so.TAKT_ABI_VERSION. */
#define TAKT_ABI_VERSION 0


// Room for a name, with the zero at its end.
#define TAKT_NAME_LENGTH 64

// Room for the words of an event, with the zero at their end.
#define TAKT_WORDS_LENGTH 512

// The most axes of a controller.
#define TAKT_MAX_AXES 32

// The most groups of a controller.
#define TAKT_MAX_GROUPS 8

// The most buses of a controller.
#define TAKT_MAX_BUSES 16

// Room for a reason, with the zero at its end.
#define TAKT_RULE_LENGTH 32

// In `flags` of a target: `velocity` is that of the position. Without it, it is taken from the points beside.
#define TAKT_HAS_VELOCITY 1

// In `flags` of a target: `acceleration` is that of the position. Without it, it is taken from the points beside.
#define TAKT_HAS_ACCELERATION 2

// What a call has come to. Below 0 is a failure: then takt_last_error() and takt_last_error_text() say more.
enum takt_result
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  TAKT_OK = 0,
  // The motion is still under way. Not a failure.
  TAKT_UNDER_WAY = 1,
  // A pointer is null, a count is wrong, or a value means nothing. Nothing has changed.
  TAKT_ERROR_ARGUMENT = -1,
  // The handle is null, closed, or of another kind.
  TAKT_ERROR_HANDLE = -2,
  // The configuration, or the fault scenario, cannot be read or used.
  TAKT_ERROR_CONFIGURATION = -3,
  // The controller could not be started: a bus, a right or a drive is missing; or none is served by this name. Nothing has moved.
  TAKT_ERROR_START = -4,
  // A limit would be broken. Nothing has changed.
  TAKT_ERROR_LIMIT = -5,
  // The mode of an axis does not take this. Nothing has changed.
  TAKT_ERROR_MODE = -6,
  // The real-time thread has refused it in its present phase. Nothing has changed.
  TAKT_ERROR_REFUSED = -7,
  // Too much is waiting already. Nothing has changed.
  TAKT_ERROR_FULL = -8,
  // A stop has discarded it before it began.
  TAKT_ERROR_OVERTAKEN = -9,
  // A later motion has taken its place.
  TAKT_ERROR_REPLACED = -10,
  // The axes have stopped.
  TAKT_ERROR_STOPPED = -11,
  // Its result is no longer known, because many others have followed it.
  TAKT_ERROR_FORGOTTEN = -12,
  // The motion is not a trajectory under way.
  TAKT_ERROR_NO_TRAJECTORY = -13,
  // It has not happened in time. What was waited for goes on. Of a controller of another process also: that has not answered, and may
  // still carry the command out.
  TAKT_ERROR_TIMEOUT = -14,
  // The controller has ended. In a fork of the process that has opened the handle: it is that process's. Nothing has changed.
  TAKT_ERROR_ENDED = -15,
  // A callback has called a function that may wait or allocate. Nothing has changed. It leaves the last error as it is.
  TAKT_ERROR_IN_CALLBACK = -16,
  // A defect of takt, please report it. The program may go on; the drives are stopped when the controller is closed.
  TAKT_ERROR_DEFECT = -17,
  // Another process commands the controller, or this one may only observe it. Nothing has changed.
  TAKT_ERROR_LEASE = -18,
  // Only the process that has opened the controller can do this. Nothing has changed.
  TAKT_ERROR_NOT_OWN = -19,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_result takt_result;
#else
typedef int32_t takt_result;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Where the drives of a controller are.
enum takt_drives
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // On the interfaces of the configuration; a bus without one is simulated.
  TAKT_CONFIGURED = 0,
  // All simulated, in real time, whatever interfaces the configuration has.
  TAKT_SIMULATED = 1,
  // All simulated, in virtual time: time passes only while the program waits, and in takt_advance(), as fast as this machine can. The
  // same calls give the same run bit for bit.
  TAKT_VIRTUAL = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_drives takt_drives;
#else
typedef int32_t takt_drives;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How a stop is made (IEC 60204-1, 9.2.2). It is not safety-rated: for that the drives have STO, in hardware.
enum takt_stop_category
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Category 0: the power is removed from the drives at once, and the brakes engage.
  TAKT_STOP_POWER_OFF = 0,
  // Category 1: decelerate within the limits, then remove the power.
  TAKT_STOP_THEN_POWER_OFF = 1,
  // Category 2: decelerate within the limits, and hold.
  TAKT_STOP_AND_HOLD = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_stop_category takt_stop_category;
#else
typedef int32_t takt_stop_category;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a group is doing.
enum takt_phase
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The drives are being brought up or shut down.
  TAKT_PHASE_PASSIVE = 0,
  // No torque.
  TAKT_PHASE_DISABLED = 1,
  // The drives are being enabled.
  TAKT_PHASE_ENABLING = 2,
  // Enabled and standing still.
  TAKT_PHASE_HOLDING = 3,
  // Enabled and on a motion of its own.
  TAKT_PHASE_MOVING = 4,
  // Enabled and following a stream or a callback.
  TAKT_PHASE_STREAMING = 5,
  // Decelerating.
  TAKT_PHASE_STOPPING = 6,
  // The drives are being disabled.
  TAKT_PHASE_DISABLING = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_phase takt_phase;
#else
typedef int32_t takt_phase;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a stream is doing.
enum takt_stream_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The group does not stream.
  TAKT_STREAM_IDLE = 0,
  // It does, and no point has come yet: the axes hold.
  TAKT_STREAM_AWAITED = 1,
  // The axes follow the points.
  TAKT_STREAM_FOLLOWING = 2,
  // The points have run out: the axes come to rest, and go on when points come again.
  TAKT_STREAM_DRY = 3,
  // A callback leads the axes.
  TAKT_STREAM_CALLBACK = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_stream_state takt_stream_state;
#else
typedef int32_t takt_stream_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What is wanted of an axis.
enum takt_target_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // To come to rest and hold: for callbacks alone.
  TAKT_HOLD = 0,
  // To be at `position`. `torque` is fed forward.
  TAKT_POSITION = 1,
  // To move at `velocity`.
  TAKT_VELOCITY = 2,
  // To be driven by `torque`: an axis in cyclic synchronous torque.
  TAKT_TORQUE = 3,
  // To be held at `position` by a spring of `stiffness` and a damper of `damping`, with `torque` fed forward: an axis in cyclic
  // synchronous torque.
  TAKT_IMPEDANCE = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_target_kind takt_target_kind;
#else
typedef int32_t takt_target_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// The kinds of events.
enum takt_event_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // A kind that this header does not know yet. The words tell it.
  TAKT_EVENT_OTHER = 0,
  // A group went to another phase: `code` is the takt_phase.
  TAKT_EVENT_PHASE = 1,
  // A stop began: `code` is the takt_stop_category.
  TAKT_EVENT_STOP = 2,
  // A stream has begun, has run dry, or goes on again: `code` is the takt_stream_state.
  TAKT_EVENT_STREAM = 3,
  // A motion has reached its targets.
  TAKT_EVENT_MOTION_FINISHED = 4,
  // The state of a drive has changed: `code` is that of CiA 402, as in takt_axis_state.
  TAKT_EVENT_DRIVE_STATE = 5,
  // A drive shows another mode of operation: `code` is object 6061.
  TAKT_EVENT_MODE = 6,
  // A drive has sent an emergency message: `code` is its error code; 0 when all errors are gone.
  TAKT_EVENT_EMERGENCY = 7,
  // Slots passed unused because the real-time thread was late: `code` is how many.
  TAKT_EVENT_MISSED_SLOTS = 8,
  // Slots are missed more often, or less often, than before: `code` is as `timing` in takt_state.
  TAKT_EVENT_TIMING = 9,
  // A request was rejected, and has changed nothing.
  TAKT_EVENT_REJECTED = 10,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_event_kind takt_event_kind;
#else
typedef int32_t takt_event_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a callback returns.
enum takt_callback_result
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Go on: the targets are for the end of this slot, and it is called again in the next one. Any other number than these two is a stop
  // of the group, by the category that the configuration has for the rule "callback_panicked".
  TAKT_GO_ON = 0,
  // It is over: the axes come to rest and hold, and it is not called again.
  TAKT_FINISHED = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum takt_callback_result takt_callback_result;
#else
typedef int32_t takt_callback_result;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A controller, or one group of its axes: whatever is asked by it concerns its axes alone, in their order. `{0}` is the null handle.
typedef struct {
  // Not for you.
  uint64_t number;
} takt_handle;

// When a callback is called.
typedef struct {
  // The slot.
  uint64_t slot;
  // Its start, on the clock of takt_now_ns().
  uint64_t slot_start_ns;
  // How long this call may take: ns.
  uint64_t time_left_ns;
  // Slots in which it was not called since the last call.
  uint64_t missed_slots;
  // The period of the cycle: s.
  double period_s;
  // The time from the slot of the last call to this one: s.
  double dt_s;
} takt_callback_cycle;

// One axis after a cycle. A value that the drive does not report is NAN.
typedef struct {
  // Actual position: rad (m).
  double position;
  // Actual velocity: rad/s (m/s).
  double velocity;
  // Actual torque: N·m (N); NAN if the drive does not report it.
  double torque;
  // Distance of the actual position from its set-point: rad (m).
  double following_error;
  // Set-point of the position: rad (m).
  double position_set;
  // Set-point of the velocity: rad/s (m/s).
  double velocity_set;
  // Torque that is sent, commanded or fed forward: N·m (N); 0 when none is.
  double torque_set;
  // In thousandths of the rated current; NAN if the drive does not report it.
  double current_per_mille;
  // °C; NAN if the drive does not report it.
  double temperature;
  // The slot of the last feedback: everything that the drive reports is from then. 0 before the first one.
  uint64_t feedback_slot;
  // The time of the last feedback on the clock of takt_now_ns(); 0 before the first one.
  uint64_t feedback_ns;
  // Cycles since the last feedback: 0 when it is from the last cycle.
  uint32_t feedback_age_cycles;
  // Object 6041.
  uint16_t statusword;
  // Object 6040, as commanded.
  uint16_t controlword;
  // Object 603F, or the code of the last emergency message; 0 for none.
  uint16_t error_code;
  // Object 6061, the mode of operation that the drive shows; 0 if it does not report it.
  int8_t mode;
  // Object 6060, the mode of operation that is commanded; 0 before the first cycle.
  int8_t mode_set;
  // The state of CiA 402: 0 not ready to switch on, 1 switch on disabled, 2 ready to switch on, 3 switched on, 4 operation enabled,
  // 5 quick stop active, 6 fault reaction active, 7 fault, 8 undefined.
  uint8_t drive_state;
  // True if the drive has reported since the controller became active. If not, nothing that it reports is known.
  bool is_heard;
  // True if what the drive reports is not from the last cycle: position, velocity, torque and the rest are old.
  bool is_stale;
  // 0; for later.
  uint8_t reserved[17];
} takt_axis_state;

// What is wanted of an axis, in a point of a stream or by a callback. What its kind does not name is ignored.
typedef struct {
  // A takt_target_kind.
  int32_t kind;
  // TAKT_HAS_VELOCITY, TAKT_HAS_ACCELERATION
  uint32_t flags;
  // rad (m)
  double position;
  // rad/s (m/s)
  double velocity;
  // rad/s^2 (m/s^2)
  double acceleration;
  // N·m (N)
  double torque;
  // kp: N·m/rad (N/m), within stiffness_max of the axis.
  double stiffness;
  // kd: N·m·s/rad (N·s/m), within damping_max of the axis.
  double damping;
} takt_target;

// A function that leads the axes of a handle: it is called once in each slot, in the real-time thread, between the feedback and the
// set-points. `axes` has what the drives have just reported, an entry for each axis of the handle, and `targets` as many entries, with
// TAKT_HOLD in each, for what is wanted at the end of the slot. They pass the same limits as every other set-point.
//
// It must not block, lock, allocate, or do input and output, and no C++ exception may leave it. The only functions of this header that it
// may call are takt_stop() and takt_now_ns(). What it reads and writes of `user` beside the program must be atomic.
typedef int32_t (*takt_callback_function)(void *user,
                                          const takt_callback_cycle *cycle,
                                          const takt_axis_state *axes,
                                          takt_target *targets,
                                          size_t axis_count);

// How a callback leads axes. Set `size` to `sizeof(takt_callback_options)` and the rest to 0 for what is usual.
typedef struct {
  // `sizeof(takt_callback_options)`
  uint32_t size;
  // How many calls in a row may take longer than the budget; one more is a stop. Without a real-time kernel the operating system may
  // interrupt a call for milliseconds.
  uint32_t overruns_allowed;
  // How long a call may take: ns. 0 for half of the time in which set-points must be ready, shared by all groups: 125 µs at 1 kHz.
  uint64_t budget_ns;
  // What is done with a target beyond the limits: 0 as the axes are configured, 1 follow as far as they allow, 2 stop.
  int32_t follow;
  // 0; for later.
  int32_t reserved;
} takt_callback_options;

// A callback that leads axes, or has led them. `{0}` is the null handle.
typedef struct {
  // Not for you.
  uint64_t number;
} takt_callback;

// How the calls of a callback have gone. Set `size` to `sizeof(takt_callback_times)`.
typedef struct {
  // `sizeof(takt_callback_times)`
  uint32_t size;
  // 0; for later.
  uint32_t reserved;
  // How often it was called.
  uint64_t calls;
  // Slots between its calls in which it was not called.
  uint64_t missed_slots;
  // Calls that took longer than their budget.
  uint64_t overruns;
  // How long the last call took: ns.
  uint64_t last_ns;
  // How long the longest one took: ns.
  uint64_t longest_ns;
} takt_callback_times;

// Who commands a controller that is served to other processes. Set `size` to `sizeof(takt_lease)`.
typedef struct {
  // `sizeof(takt_lease)`
  uint32_t size;
  // The process that commands; 0 if no other process does.
  uint32_t process;
  // When it may be followed by another one, unless it gives another command: ns from now.
  uint64_t expires_in_ns;
} takt_lease;

// What the configuration says of an axis. Set `size` to `sizeof(takt_axis)`.
typedef struct {
  // `sizeof(takt_axis)`
  uint32_t size;
  // Its number among the axes of the controller, as events and stops count them.
  uint32_t number;
  // 0 if it turns, rad and N·m; 1 if it moves along a line, m and N.
  uint32_t is_linear;
  // The CANopen node ID of its drive.
  uint32_t node;
  // Its group among those of the controller.
  uint32_t group;
  // Its bus among those of the controller, as `buses` of a state has them.
  uint32_t bus;
  // Lowest position: rad (m).
  double position_min;
  // Highest position: rad (m).
  double position_max;
  // Highest speed: rad/s (m/s).
  double velocity;
  // Highest acceleration: rad/s^2 (m/s^2).
  double acceleration;
  // Highest deceleration: rad/s^2 (m/s^2).
  double deceleration;
  // Highest jerk: rad/s^3 (m/s^3); INFINITY where there is no limit.
  double jerk;
  // Highest torque: N·m (N).
  double torque;
  // Highest stiffness of an impedance: N·m/rad (N/m).
  double stiffness_max;
  // Highest damping of an impedance: N·m·s/rad (N·s/m).
  double damping_max;
  // Its name. UTF-8.
  char name[TAKT_NAME_LENGTH];
} takt_axis;

// A group of axes that start, stop and fault together. Set `size` to `sizeof(takt_group)`.
typedef struct {
  // `sizeof(takt_group)`
  uint32_t size;
  // Its number among the groups of the controller, as events count them.
  uint32_t number;
  // How many axes it has.
  uint32_t axis_count;
  // 0; for later.
  uint32_t reserved;
  // Its name, for takt_open_group(). UTF-8. Empty where the configuration names no groups, and all axes are one.
  char name[TAKT_NAME_LENGTH];
} takt_group;

// A place among the events of a controller. `{0}` is the null handle.
typedef struct {
  // Not for you.
  uint64_t number;
} takt_events;

// Something that has happened. Set `size` to `sizeof(takt_event)`.
typedef struct {
  // `sizeof(takt_event)`
  uint32_t size;
  // A takt_event_kind.
  int32_t kind;
  // The slot in which it was seen.
  uint64_t slot;
  // The time at which it was seen, on the clock of takt_now_ns().
  uint64_t at_ns;
  // The group, from 0 on; -1 where it concerns none.
  int32_t group;
  // The axis, from 0 on among those of the controller; -1 where it concerns none.
  int32_t axis;
  // See its kind.
  int64_t code;
  // How many events this handle has missed until now, because it was more than 1024 behind.
  uint64_t missed;
  // It as a sentence, with the names of axes and buses. UTF-8.
  char words[TAKT_WORDS_LENGTH];
} takt_event;

// The last failure of a call in this thread. Set `size` to `sizeof(takt_error)`.
typedef struct {
  // `sizeof(takt_error)`
  uint32_t size;
  // What the call returned.
  takt_result result;
  // The point of a trajectory or of a chunk that it concerns, from 0 on; -1 where it is none.
  int32_t point;
  // The axis that it concerns, from 0 on, as the call counts the axes; -1 where it is none.
  int32_t axis;
  // The value that is beyond a limit: rad, rad/s, rad/s^2, rad/s^3, N·m (m, N); NAN where there is none.
  double value;
  // The limit that it is beyond; NAN where there is none.
  double limit;
} takt_error;

// One group after a cycle.
typedef struct {
  // What it is doing: a takt_phase.
  int32_t phase;
  // Its stream: a takt_stream_state.
  int32_t stream_state;
  // Time left of its present move or stop as it is planned: s.
  double remaining_s;
  // How far the set-points of its stream are behind the stamps: ns.
  uint64_t stream_lag_ns;
  // Points that have come to its stream.
  uint64_t stream_points;
  // Points that have come too late for their time.
  uint64_t stream_late_points;
  // Points that found no room, or could not be used.
  uint64_t stream_lost_points;
  // True if it is stopping or has stopped. It is false again once the group has been enabled again, or has moved on.
  bool is_stopped;
  // True if that stop was for a fault, which takt_clear_faults() must clear.
  bool is_faulted;
  // The category of that stop, 0 to 2: a takt_stop_category.
  uint8_t stop_category;
  // 0; for later.
  uint8_t reserved[1];
  // The axis that the stop was for, among those of the controller; -1 where it is not one axis.
  int32_t stop_axis;
  // The slot in which the reason of the stop was seen.
  uint64_t stop_slot;
  // The rule of that stop as configurations name it: "requested", "following_error", "drive_fault" …; empty without a stop.
  char stop_rule[TAKT_RULE_LENGTH];
  // 0; for later.
  uint64_t reserved_too[2];
} takt_group_state;

// One bus after a cycle.
typedef struct {
  // 0 works normally, 1 error-passive, 2 bus-off, 3 down.
  int32_t state;
  // 0; for later.
  uint32_t reserved;
  // Frames sent.
  uint64_t tx_frames;
  // Frames received.
  uint64_t rx_frames;
  // Frames that the interface had no room for.
  uint64_t tx_overruns;
  // Frames that were lost before they could be read.
  uint64_t rx_overruns;
  // Error frames and bus errors.
  uint64_t errors;
  // How long the wire was occupied: ns.
  uint64_t busy_ns;
  // 0; for later.
  uint64_t reserved_too[2];
} takt_bus_state;

// The state after a cycle. Set `size` to `sizeof(takt_state)` and the rest to 0: `takt_state state = {.size = sizeof state};`.
//
// It may grow at its end. A library that knows less of it than the caller leaves the rest as it is, and sets `size` to what it knows.
typedef struct {
  // `sizeof(takt_state)`
  uint32_t size;
  // How often slots are missed of late: 0 hardly ever, 1 often enough for a warning, 2 no stream may begin, 3 unfit.
  uint32_t timing;
  // The slot that it describes. takt_wait_cycle() waits for a later one.
  uint64_t slot;
  // The time at which it was made, on the clock of takt_now_ns().
  uint64_t at_ns;
  // Slots that passed unused since the start.
  uint64_t missed_slots;
  // Events and records that found no room, since the start.
  uint64_t dropped;
  // Requests that were rejected, since the start.
  uint64_t rejected;
  // How many of `axes` count: those of the handle, in its order.
  uint32_t axis_count;
  // How many of `groups` count: all of the controller, or the one of the handle.
  uint32_t group_count;
  // How many of `buses` count.
  uint32_t bus_count;
  // True if the drive of any of these axes is stale.
  bool is_any_stale;
  // 0; for later.
  uint8_t reserved[3];
  // The groups. Beyond `group_count` they are 0.
  takt_group_state groups[TAKT_MAX_GROUPS];
  // The axes. Beyond `axis_count` they are 0.
  takt_axis_state axes[TAKT_MAX_AXES];
  // The buses. Beyond `bus_count` they are 0.
  takt_bus_state buses[TAKT_MAX_BUSES];
} takt_state;

// How a move is made. Set `size` to `sizeof(takt_move_options)` and the rest to 0 for what is usual.
typedef struct {
  // `sizeof(takt_move_options)`
  uint32_t size;
  // 0; for later.
  uint32_t reserved;
  // Fraction of the velocity limits, up to 1; 0 for 1.
  double velocity_scale;
  // Fraction of the acceleration and jerk limits, up to 1; 0 for 1.
  double acceleration_scale;
  // The shortest duration of the move: s.
  double minimum_duration_s;
} takt_move_options;

// A motion that was begun, for takt_wait(). It needs not be closed. A copy of it is as good.
typedef struct {
  // Not for you.
  uint64_t number;
} takt_motion;

// How a controller is opened. Set `size` to `sizeof(takt_options)` and the rest to 0 for what is usual.
typedef struct {
  // `sizeof(takt_options)`
  uint32_t size;
  // Where the drives are: a takt_drives.
  int32_t drives;
  // 1 if it is a failure that the operating system refuses a right to the real-time thread; 0 if takt goes on without it.
  uint8_t is_realtime_required;
  // 1 to leave the drives disabled: takt_open() returns when each of them reports its position, and takt_enable() enables them. 0 to
  // enable them.
  uint8_t is_left_disabled;
  // 0; for later.
  uint8_t reserved[6];
  // The folder for a recording of the run; NULL for what the configuration says. In virtual time it must be NULL, and nothing is
  // recorded.
  const char *recording;
  // A file of faults to inject, to see what happens then; NULL for none. In virtual time it must be NULL.
  const char *faults;
} takt_options;

// How far a trajectory is. Set `size` to `sizeof(takt_progress)`.
typedef struct {
  // `sizeof(takt_progress)`
  uint32_t size;
  // 0; for later.
  uint32_t reserved;
  // The time on the path: s.
  double path_s;
  // The time of its last point: s.
  double of_s;
  // Seconds of the path in a second: 1 as it was written, 0 while it is paused.
  double rate;
} takt_progress;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Lets a function lead the axes of the handle, from the next cycle on. They must hold, or be led by another callback, which it replaces.
// It leads them until it returns TAKT_FINISHED, until a stop, or until a move or another callback takes its place.
//
// `user` is handed to each call. It must stay valid until takt_wait_callback() has returned anything but TAKT_ERROR_TIMEOUT, or until the
// controller is closed. A call that takes longer than its budget is a stop. In virtual time the function is called in the thread that
// waits, or is in takt_advance(). `options` may be NULL.
//
// Any thread, not in a callback; blocks for a cycle or two, until the real-time thread has granted it. takt_close_callback() closes the
// handle.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED in any other motion, TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED,
// TAKT_ERROR_NOT_OWN for a controller of another process, TAKT_ERROR_HANDLE. Nothing has changed then.
//
// Pointers: `function` does what is said of it, and `user` is valid for so long; the others are null, or point to what they should.
takt_result takt_begin_callback(takt_handle handle,
                                takt_callback_function function,
                                void *user,
                                const takt_callback_options *options,
                                takt_callback *callback);

// Waits until a callback is over and the axes have come to rest. It is not called any more then, and its `user` is the program's again,
// unless this returns TAKT_ERROR_TIMEOUT. `timeout_s` is from 0 on, or INFINITY.
//
// Any thread, not in a callback; blocks for up to `timeout_s`.
//
// Errors: TAKT_ERROR_TIMEOUT, TAKT_ERROR_STOPPED after a call that took too long or returned another number and after every other stop,
// TAKT_ERROR_REPLACED, TAKT_ERROR_FORGOTTEN, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
takt_result takt_wait_callback(takt_callback callback,
                               double timeout_s);

// How the calls of a callback have gone until now.
//
// Any thread, not in a callback; does not block.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `times` is null, or points to a structure of the size that it says.
takt_result takt_read_callback_times(takt_callback callback, takt_callback_times *times);

// Closes the handle of a callback. The callback goes on.
//
// Any thread, not in a callback; blocks while another thread waits with it.
//
// Errors: TAKT_ERROR_HANDLE.
takt_result takt_close_callback(takt_callback callback);

// Connects to a controller that another process of this computer serves by a name: `takt run CONFIG --serve NAME`. The handle is taken by
// every call of this header, with the same meaning and the same errors, but for takt_begin_callback(): a callback is a function of the
// process of the controller.
//
// Any number of processes observe; one commands. The first command takes the lease, each command renews it, and it expires 1 s after the
// last one, or when its process ends. Until then the commands of others are TAKT_ERROR_LEASE; takt_take_over() takes it. takt_stop() needs
// none. When the process of the controller ends, every call is TAKT_ERROR_ENDED, and takt_read_state() reads the last state.
//
// Any thread, not in a callback; blocks until the other process answers: up to seconds if that is overloaded. takt_close() ends the
// connection, and not the controller.
//
// Errors: TAKT_ERROR_START (none is served by the name, it is of another version, or its permissions do not let this process observe),
// TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL.
//
// Pointers: The pointers are null, or point to what they should.
takt_result takt_connect(const char *name,
                         takt_handle *handle);

// Takes the lease of a controller of another process from whoever has it. What moves goes on. That process gets TAKT_ERROR_LEASE from
// then on, until it takes it over itself. A controller of this process needs no lease: then it does nothing.
//
// Any thread, not in a callback; blocks until the other process answers.
//
// Errors: TAKT_ERROR_LEASE without write permission, TAKT_ERROR_TIMEOUT, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
takt_result takt_take_over(takt_handle handle);

// Gives the lease of a controller of another process back, so that others need not wait for its end. As takt_take_over().
takt_result takt_release(takt_handle handle);

// Reads who commands.
//
// Any thread, not in a callback; does not block.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `lease` is null, or points to a structure of the size that it says.
takt_result takt_read_lease(takt_handle handle, takt_lease *lease);

// How many axes a handle has; 0 for one that is null, closed or of another kind. Any thread; does not block.
size_t takt_axis_count(takt_handle handle);

// The period of the cycle: ns; 0 for a handle that is null, closed or of another kind. Any thread; does not block.
uint64_t takt_period_ns(takt_handle handle);

// What the configuration says of an axis, counted as in the handle.
//
// Any thread, not in a callback; does not block.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `described` is null, or points to a structure of the size that it says.
takt_result takt_describe_axis(takt_handle handle, uint32_t axis, takt_axis *described);

// How many groups a handle has: those of the controller, or the one of its own; 0 for one that is null, closed or of another kind. Any
// thread; does not block.
size_t takt_group_count(takt_handle handle);

// The name and the size of a group, counted as `groups` of a state has them.
//
// Any thread, not in a callback; does not block.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `described` is null, or points to a structure of the size that it says.
takt_result takt_describe_group(takt_handle handle, uint32_t group, takt_group *described);

// Opens a handle for one group of a controller, by its name in the configuration. Every function takes it as it takes that of the
// controller, and concerns the axes of the group alone, in the order of the group.
//
// Any thread, not in a callback; does not block. takt_close() closes it, and ends nothing.
//
// Errors: TAKT_ERROR_ARGUMENT when there is no such group, TAKT_ERROR_FULL, TAKT_ERROR_HANDLE.
//
// Pointers: The pointers are null, or point to what they should.
takt_result takt_open_group(takt_handle handle,
                            const char *name,
                            takt_handle *group);

// Opens a place among the events of a controller, from now on. Each has its own. Of a group, they are those of its controller.
//
// Any thread, not in a callback; does not block. takt_close_events() closes it.
//
// Errors: TAKT_ERROR_FULL, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `events` is null, or may be written to.
takt_result takt_open_events(takt_handle handle,
                             takt_events *events);

// Takes the next event; with `timeout_s` 0 it does not wait. In virtual time the wait runs cycles.
//
// Any thread, not in a callback; blocks for up to `timeout_s`, and while another thread waits with the same handle.
//
// Errors: TAKT_ERROR_TIMEOUT when none has come, TAKT_ERROR_ENDED when the controller has ended and no event is left,
// TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `event` is null, or points to a structure of the size that it says.
takt_result takt_next_event(takt_events events,
                            double timeout_s,
                            takt_event *event);

// Closes a place among the events.
//
// Any thread, not in a callback; blocks while another thread waits with it.
//
// Errors: TAKT_ERROR_HANDLE.
takt_result takt_close_events(takt_events events);

// The last failure of a call in this thread, as a sentence that names what and where, and the cure where one is known; empty before the
// first failure. UTF-8. It stays valid until the next failure of a call in this thread. Any thread; does not block.
const char *takt_last_error_text(void);

// The last failure of a call in this thread, as numbers: which point, axis and limit. Any thread; does not block.
//
// Errors: TAKT_ERROR_ARGUMENT.
//
// Pointers: `error` is null, or points to a structure of the size that it says.
takt_result takt_last_error(takt_error *error);

// The version of the library: "0.1.0". Any thread; does not block.
const char *takt_version(void);

// Closes a handle. That of takt_open() ends the run with it: the axes come to rest, the drives are disabled and shut down. That of
// takt_connect() ends nothing: the controller goes on in its process, and what moves goes on. Calls that
// other threads are in return TAKT_ERROR_ENDED. Handles of its groups, events and callbacks stay open, to be closed as well.
//
// Any thread, not in a callback; blocks until the drives are shut down and the calls of other threads with this handle have returned.
//
// Errors: TAKT_ERROR_HANDLE; TAKT_ERROR_STOPPED when the run has not ended as it should, with the reason in the text. The handle is
// closed then, too.
takt_result takt_close(takt_handle handle);

// The present time of the controller in ns: CLOCK_MONOTONIC, or virtual time. The stamps of points are on this clock. 0 for a handle
// that is null, closed or of another kind. Any thread, also in a callback and in a signal handler; does not block.
uint64_t takt_now_ns(takt_handle handle);

// Stops the axes of the handle: `category` is a takt_stop_category. It is taken in the next cycle, and is never refused. What waits to
// be carried out is discarded, so that nothing begins after the stop. takt_wait_phase() waits until the axes are at rest.
//
// Any thread, also in a callback and in a signal handler: it is a few atomic operations, allocates nothing, takes no lock and does not
// block. It leaves the last error as it is. Of a controller of another process it is two or three system calls that do not wait, and
// needs no lease.
//
// Errors: TAKT_ERROR_HANDLE, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT for another category; of another process TAKT_ERROR_LEASE without write
// permission, and TAKT_ERROR_TIMEOUT if it has taken none of many stops.
takt_result takt_stop(takt_handle handle,
                      int32_t category);

// Begins to bring the axes to rest and to disable their drives. takt_wait_phase() with TAKT_PHASE_DISABLED waits until they are. The
// brakes engage.
//
// Any thread; blocks for a cycle or two, until the real-time thread has granted it.
//
// Errors: TAKT_ERROR_REFUSED, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
takt_result takt_disable(takt_handle handle);

// Begins to enable the drives again: after takt_disable(), or after a fault and takt_clear_faults(). takt_wait_phase() with
// TAKT_PHASE_HOLDING waits until they are.
//
// Any thread; blocks for a cycle or two, until the real-time thread has granted it.
//
// Errors: TAKT_ERROR_REFUSED unless the axes are disabled and no fault is left, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
takt_result takt_enable(takt_handle handle);

// Clears the faults that have stopped the axes. Look at the machine first: takt does not know whether the cause is gone.
//
// Any thread; blocks for a cycle or two, until the real-time thread has granted it.
//
// Errors: TAKT_ERROR_REFUSED in motion, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
takt_result takt_clear_faults(takt_handle handle);

// Waits for a cycle that is later than `state->slot`, and reads the state after it. If there is one already, it does not wait. So a loop
// of it sees every cycle as long as it is fast enough; one that was late sees the newest, and goes on. `timeout_s` is from 0 on, or
// INFINITY. In virtual time it runs the cycle.
//
// Any thread, not in a callback; blocks for up to `timeout_s`. It wakes some 20 µs after the set-points of the cycle have been sent, plus
// what the operating system takes to wake a thread.
//
// Errors: TAKT_ERROR_TIMEOUT, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `state` is null, or points to a structure of the size that it says.
takt_result takt_wait_cycle(takt_handle handle,
                            double timeout_s,
                            takt_state *state);

// Waits until every group of the handle is in a phase: a takt_phase. `timeout_s` is from 0 on, or INFINITY.
//
// Any thread, not in a callback; blocks for up to `timeout_s`.
//
// Errors: TAKT_ERROR_TIMEOUT, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
takt_result takt_wait_phase(takt_handle handle, int32_t phase, double timeout_s);

// Lets so many cycles pass, and reads the state after them; `state` may be NULL. In virtual time it runs them, as fast as this machine
// can; in real time it waits for them.
//
// Any thread, not in a callback; blocks until they have passed.
//
// Errors: TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `state` is null, or points to a structure of the size that it says.
takt_result takt_advance(takt_handle handle,
                         uint64_t cycles,
                         takt_state *state);

// Moves the axes to targets, where they come to rest: rad (m), one for each axis of the handle. All of them arrive at the same time, as
// soon as the limits and `options` allow; `options` may be NULL. A move under way is planned anew from where it is. A drive in profile
// position plans by itself.
//
// Any thread, not in a callback; does not wait for the motion. takt_wait() does, and tells of a refusal.
//
// Errors: TAKT_ERROR_LIMIT for a target beyond the limits of its axis, TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL, TAKT_ERROR_ENDED,
// TAKT_ERROR_HANDLE. Nothing has changed then.
//
// Pointers: `targets` points to `axes` numbers; the others are null, or point to what they should.
takt_result takt_move_to(takt_handle handle,
                         const double *targets,
                         size_t axes,
                         const takt_move_options *options,
                         takt_motion *motion);

// As takt_move_to(), by distances from the present set-points: of an axis in motion, from where it is to be at this moment.
//
// Pointers: As takt_move_to().
takt_result takt_move_by(takt_handle handle,
                         const double *distances,
                         size_t axes,
                         const takt_move_options *options,
                         takt_motion *motion);

// Gives a drive in profile velocity a velocity: rad/s (m/s). `axis` is counted as in the handle. Unless it is given again within
// `valid_s`, the group stops: nothing moves on behind a program that hangs.
//
// Any thread, not in a callback; does not wait for the velocity. takt_wait() does.
//
// Errors: TAKT_ERROR_MODE, TAKT_ERROR_LIMIT, TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
//
// Pointers: `motion` is null, or may be written to.
takt_result takt_profile_velocity(takt_handle handle,
                                  uint32_t axis,
                                  double velocity,
                                  double valid_s,
                                  takt_motion *motion);

// Gives a drive in profile torque a torque: N·m (N). As takt_profile_velocity().
//
// Pointers: `motion` is null, or may be written to.
takt_result takt_profile_torque(takt_handle handle,
                                uint32_t axis,
                                double torque,
                                double valid_s,
                                takt_motion *motion);

// Changes the mode of operation of every axis of the handle: object 6060, 1 profile position, 3 profile velocity, 4 profile torque,
// 8, 9 and 10 cyclic synchronous position, velocity and torque, as far as `modes` of the configuration allow. Many drives must be
// disabled before. takt_wait() returns when the drives show the mode.
//
// Any thread, not in a callback; does not wait for the change. takt_wait() does, and tells of a refusal.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
//
// Pointers: `motion` is null, or may be written to.
takt_result takt_change_mode(takt_handle handle,
                             int32_t mode,
                             takt_motion *motion);

// As takt_change_mode(), of one axis, counted as in the handle. The others of its group hold, or stay disabled.
//
// Pointers: `motion` is null, or may be written to.
takt_result takt_change_axis_mode(takt_handle handle,
                                  uint32_t axis,
                                  int32_t mode,
                                  takt_motion *motion);

// Waits until a motion has reached its targets and the axes are at rest there, or until a velocity, a torque or a mode is reached. The
// result is that of this motion, whatever came after it. `timeout_s` is from 0 on, or INFINITY.
//
// Any thread, not in a callback; blocks for up to `timeout_s`.
//
// Errors: TAKT_ERROR_TIMEOUT (the motion goes on), TAKT_ERROR_STOPPED, TAKT_ERROR_REFUSED, TAKT_ERROR_LIMIT, TAKT_ERROR_MODE,
// TAKT_ERROR_REPLACED, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_FORGOTTEN, TAKT_ERROR_ENDED, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
takt_result takt_wait(takt_handle handle,
                      takt_motion motion,
                      double timeout_s);

// How a motion has ended, without waiting: TAKT_UNDER_WAY, TAKT_OK, or an error of takt_wait(). Any thread, not in a callback; does not
// block.
takt_result takt_motion_result(takt_handle handle,
                               takt_motion motion);

// Opens a controller by a configuration file: brings its drives up and enables them, and returns when the axes hold their position. With
// `options->is_left_disabled` it leaves them disabled.
//
// takt owns the real-time thread from then on. The program may be slow, late or stopped: the axes keep their limits, and a stream that
// runs dry comes to rest. `options` may be NULL.
//
// Any thread; blocks until the drives are enabled: up to seconds, as they need. takt_close() ends the run.
//
// Errors: TAKT_ERROR_CONFIGURATION (the text shows each problem at its line), TAKT_ERROR_START, TAKT_ERROR_ARGUMENT, TAKT_ERROR_FULL
// (256 handles are open). Nothing has moved then.
//
// Pointers: The pointers are null, or point to what they should.
takt_result takt_open(const char *path,
                      const takt_options *options,
                      takt_handle *handle);

// As takt_open(), by the text of a configuration. Files that it names are looked for in the working directory.
//
// Pointers: As takt_open().
takt_result takt_open_text(const char *configuration,
                           const takt_options *options,
                           takt_handle *handle);

// Compares a configuration with the text of a robot description (URDF): an axis that has the name of a joint may do no more than it. The
// limits of positions, velocities and torques are compared; narrower ones are no contradiction. Nothing is opened.
//
// Any thread; blocks while it reads the file.
//
// Errors: TAKT_ERROR_CONFIGURATION, with each contradiction in the text; TAKT_ERROR_ARGUMENT for a NULL.
//
// Pointers: The pointers are null, or point to texts.
takt_result takt_check_urdf(const char *path,
                            const char *urdf);

// Reads the state after the newest complete cycle. Before the first one, no drive is heard. After the end, it is the last one.
//
// Any thread; does not block.
//
// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `state` is null, or points to a structure of the size that it says.
takt_result takt_read_state(takt_handle handle,
                            takt_state *state);

// The groups of the handle begin to follow the points that are pushed. The first one must come within the enable time-out of the
// configuration. The axes are led to it within their limits. A stream begins empty: points are taken from now on, until a stop or a fault
// ends it. Those that still wait then are discarded, and counted as lost.
//
// Any thread, not in a callback; blocks for a cycle or two, until the real-time thread has granted it. takt_stop() ends it.
//
// Errors: TAKT_ERROR_REFUSED unless the axes hold, TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE.
takt_result takt_begin_stream(takt_handle handle);

// Pushes a point that is meant for now: a target for each axis of the handle. It is stamped with takt_now_ns(). Points may come at any
// rate, evenly or not: takt follows them within all limits, a little behind (`stream_lag_ns`), and comes to rest when they run out.
//
// Any thread, not in a callback; allocates nothing, and waits for no more than another thread that pushes points to the same group. To a
// controller of another process it sends a packet, and waits for the answer.
//
// Errors: TAKT_ERROR_LIMIT (a torque or a gain beyond that of its axis; positions and velocities are led to within the limits),
// TAKT_ERROR_MODE, TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED before takt_begin_stream() and after a stop, TAKT_ERROR_FULL, TAKT_ERROR_ENDED,
// TAKT_ERROR_HANDLE. The point is not taken then.
//
// Pointers: `targets` is null, or points to `axes` targets.
takt_result takt_push_now(takt_handle handle,
                          const takt_target *targets,
                          size_t axes);

// Pushes a point that is meant for `at_ns` on the clock of takt_now_ns(): sooner or later than now, and in any order. One with the stamp
// of another one takes its place. As takt_push_now().
//
// Pointers: `targets` is null, or points to `axes` targets.
takt_result takt_push_at(takt_handle handle,
                         uint64_t at_ns,
                         const takt_target *targets,
                         size_t axes);

// Pushes a chunk, as a policy gives it: `points` points at equal intervals, the first of which is meant for `from_ns`. `targets` has
// `axes` targets for the first point, then as many for the second, and so on. It takes the place of every earlier point from there on.
// All of it is taken, or nothing. As takt_push_now().
//
// Pointers: `targets` is null, or points to `points` times `axes` targets.
takt_result takt_push_chunk(takt_handle handle,
                            uint64_t from_ns,
                            uint64_t interval_ns,
                            const takt_target *targets,
                            size_t points,
                            size_t axes);

// As takt_push_now(), of positions alone: rad (m).
//
// Pointers: `positions` is null, or points to `axes` numbers.
takt_result takt_push_positions(takt_handle handle, const double *positions, size_t axes);

// As takt_push_at(), of positions alone: rad (m).
//
// Pointers: `positions` is null, or points to `axes` numbers.
takt_result takt_push_positions_at(takt_handle handle, uint64_t at_ns, const double *positions, size_t axes);

// As takt_push_chunk(), of positions alone: rad (m).
//
// Pointers: `positions` is null, or points to `points` times `axes` numbers.
takt_result takt_push_positions_chunk(takt_handle handle,
                                      uint64_t from_ns,
                                      uint64_t interval_ns,
                                      const double *positions,
                                      size_t points,
                                      size_t axes);

// Carries out a trajectory through points with times, as ROS' JointTrajectory has them.
//
// `times_s` has a time for each of `points` points: seconds after the beginning, each later than the one before. `positions` (rad, m)
// has `axes` numbers for the first point, then as many for the second, and so on; so have `velocities` (rad/s, m/s) and `accelerations`
// (rad/s^2, m/s^2), which may be NULL. Without velocities a smooth curve leads through the points and ends at rest; nowhere is it beyond the
// points on both sides of it. A first point at the time 0 must be where the axes are; otherwise the trajectory goes there first: a way
// from rest that would swing far back, for the velocity of that point, is TAKT_ERROR_ARGUMENT. All of it is checked before anything moves.
// While another trajectory is under way, this one takes its place without a step.
//
// Any thread, not in a callback; blocks until it is computed and granted: some cycles, more for thousands of points. takt_wait() waits
// for its end.
//
// Errors: TAKT_ERROR_LIMIT, with the first point, axis and limit in takt_last_error(); TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED in any
// other motion, TAKT_ERROR_MODE, TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE. Nothing has changed then.
//
// Pointers: The arrays are null, or have as many numbers as is said above; `motion` is null, or may be written to.
takt_result takt_execute(takt_handle handle,
                         const double *times_s,
                         const double *positions,
                         const double *velocities,
                         const double *accelerations,
                         size_t points,
                         size_t axes,
                         takt_motion *motion);

// Moves the axes through waypoints without stopping, to rest at the last one, in nearly the shortest time that the limits allow.
// `waypoints` has `axes` positions (rad, m) for the first one, then as many for the second, and so on. The speed along it can be
// changed as of takt_execute().
//
// Any thread, not in a callback; blocks until it is computed and granted.
//
// Errors: as takt_execute().
//
// Pointers: `waypoints` is null, or has `points` times `axes` numbers; `motion` is null, or may be written to.
takt_result takt_move_through(takt_handle handle,
                              const double *waypoints,
                              size_t points,
                              size_t axes,
                              takt_motion *motion);

// Changes the speed along the path of a trajectory: 1 as it was written, 0.5 half as fast. The path stays the same, and all limits are
// kept. Of a trajectory that is paused, it is the speed after takt_resume().
//
// Any thread, not in a callback; blocks until the change begins: some 20 ms.
//
// Errors: TAKT_ERROR_LIMIT for what the limits do not allow, TAKT_ERROR_NO_TRAJECTORY, TAKT_ERROR_ARGUMENT, TAKT_ERROR_REFUSED,
// TAKT_ERROR_FULL, TAKT_ERROR_OVERTAKEN, TAKT_ERROR_ENDED, TAKT_ERROR_HANDLE. The trajectory goes on as before then.
takt_result takt_set_speed(takt_handle handle,
                           takt_motion motion,
                           double rate);

// Brings the axes to rest on the path of a trajectory. As takt_set_speed().
takt_result takt_pause(takt_handle handle, takt_motion motion);

// Goes on with a trajectory that was paused. As takt_set_speed().
takt_result takt_resume(takt_handle handle, takt_motion motion);

// How far a trajectory under way is.
//
// Any thread, not in a callback; waits for no more than another command of a trajectory of the same group.
//
// Errors: TAKT_ERROR_NO_TRAJECTORY, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
//
// Pointers: `progress` is null, or points to a structure of the size that it says.
takt_result takt_trajectory_progress(takt_handle handle, takt_motion motion, takt_progress *progress);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TAKT_H */
