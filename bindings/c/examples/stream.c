/* A stream: a slow circle of the first two joints, a point every 10 ms from an ordinary program; then a chunk of points for later, as a
 * policy gives it; and Ctrl-C stops the arm at any time.
 *
 *   ./stream configs/arm6-erob.toml
 */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <takt.h>

#define INTERVAL_NS 10000000u

static takt_handle arm;

/* A stop may be called in a signal handler. */
static void on_interrupt(int signal_number) {
    (void)signal_number;
    takt_stop(arm, TAKT_STOP_AND_HOLD);
}

static int failed(const char *what) {
    fprintf(stderr, "%s: %s\n", what, takt_last_error_text());
    takt_close(arm);
    return 1;
}

/* The joints at a time: on a circle that begins at rest, at its centre. */
static void circle(const takt_state *centre, double time_s, double *positions) {
    double grown = time_s < 1.5 ? time_s / 1.5 : 1.0, radius = 0.1 * grown * grown * grown;
    for (unsigned axis = 0; axis < centre->axis_count; axis++)
        positions[axis] = centre->axes[axis].position_set;
    positions[0] += radius * sin(1.57 * time_s);
    positions[1] += radius * cos(1.57 * time_s);
}

int main(int count, char **arguments) {
    takt_options options = {.size = sizeof options, .drives = TAKT_SIMULATED};
    takt_state centre = {.size = sizeof centre}, state = {.size = sizeof state};
    double positions[TAKT_MAX_AXES], chunk[25 * TAKT_MAX_AXES];

    if (takt_open(count > 1 ? arguments[1] : "arm.toml", &options, &arm) != TAKT_OK) return failed("open");
    signal(SIGINT, on_interrupt);
    if (takt_read_state(arm, &centre) != TAKT_OK || takt_begin_stream(arm) != TAKT_OK) return failed("begin");

    const unsigned axes = centre.axis_count;
    const uint64_t begun_ns = takt_now_ns(arm);
    uint64_t at_ns = begun_ns;
    state.slot = centre.slot;
    /* Whatever the rate of this loop, the arm follows what it was given, a little behind, within its limits. */
    while (at_ns < begun_ns + 2000000000u) {
        circle(&centre, (double)(at_ns - begun_ns) / 1e9, positions);
        if (takt_push_positions_at(arm, at_ns, positions, axes) != TAKT_OK) return failed("push");
        at_ns += INTERVAL_NS;
        while (takt_now_ns(arm) < at_ns)
            if (takt_wait_cycle(arm, 1.0, &state) != TAKT_OK) return failed("wait");
    }
    printf("followed %.1f ms behind\n", (double)state.groups[0].stream_lag_ns / 1e6);

    /* The next half second at once. A later chunk would take the place of what is left of this one. */
    for (unsigned point = 0; point < 25; point++)
        circle(&centre, (double)(at_ns - begun_ns) / 1e9 + 0.02 * point, chunk + point * axes);
    if (takt_push_positions_chunk(arm, at_ns, 20000000u, chunk, 25, axes) != TAKT_OK) return failed("push");
    /* The points run out, and the arm comes to rest. It would go on with the next ones. */
    do {
        if (takt_wait_cycle(arm, 1.0, &state) != TAKT_OK) return failed("wait");
    } while (state.groups[0].stream_state != TAKT_STREAM_DRY);
    printf("at rest after %u points, %u of them late\n", (unsigned)state.groups[0].stream_points,
           (unsigned)state.groups[0].stream_late_points);

    takt_stop(arm, TAKT_STOP_AND_HOLD);
    if (takt_wait_phase(arm, TAKT_PHASE_HOLDING, 5.0) != TAKT_OK) return failed("hold");
    if (takt_close(arm) != TAKT_OK) return failed("close");
    return 0;
}
