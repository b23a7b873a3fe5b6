/* A program in C with a controller of its own, and threads that behave badly beside it, for the jitter measurements of the laboratory.
 *
 * First a callback sways the joints in the real-time thread, then points lead the same motion: one thread pushes them at 100 Hz and stalls for a third of a
 * second after every 0.7 s, one hands over chunks as fast as it can, one gives commands as fast as it can, all of which must be refused,
 * and one observes without a pause. All have ordinary priority. It ends with an error if the axes have stopped.
 *
 *   unruly_program CONFIG --duration SECONDS --record FILE.mcap
 *
 * The interfaces are those of the configuration: other arguments of `takt run` are read over.
 */
#include <glob.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <takt.h>
#include <time.h>

#define INTERVAL_NS 10000000u
#define POINTS 20

static takt_handle arm;
static takt_state home = {.size = sizeof home};
static uint64_t begun_ns;
static atomic_bool is_over, may_return, was_taken;

static void pause_ns(long ns) {
    nanosleep(&(struct timespec){.tv_nsec = ns}, NULL);
}

/* A gentle motion of every joint, to and fro. */
static double offset(double since_s) {
    double grown = fmin(since_s / 2.0, 1.0);
    return 0.1 * grown * grown * grown * sin(1.5707963 * since_s);
}

static void positions_at(uint64_t at_ns, double *positions) {
    double moved = offset((double)(at_ns - begun_ns) / 1e9);
    for (unsigned axis = 0; axis < home.axis_count; axis++)
        positions[axis] = home.axes[axis].position_set + moved;
}

/* Streams, and stalls. */
static void *lead(void *unused) {
    double positions[TAKT_MAX_AXES];
    (void)unused;
    while (!atomic_load(&is_over)) {
        for (int point = 0; point < 70 && !atomic_load(&is_over); point++) {
            positions_at(takt_now_ns(arm), positions);
            /* Where the flood has filled the look-ahead there is no room, and beside a callback there is no stream. */
            takt_push_positions(arm, positions, home.axis_count);
            pause_ns(INTERVAL_NS);
        }
        pause_ns(333000000);
    }
    return unused;
}

/* Hands over the next fifth of a second, again and again. */
static void *flood(void *unused) {
    double chunk[POINTS * TAKT_MAX_AXES];
    while (!atomic_load(&is_over)) {
        uint64_t now_ns = takt_now_ns(arm);
        for (unsigned point = 0; point < POINTS; point++)
            positions_at(now_ns + (uint64_t)point * INTERVAL_NS, chunk + point * home.axis_count);
        takt_push_positions_chunk(arm, now_ns, INTERVAL_NS, chunk, POINTS, home.axis_count);
    }
    return unused;
}

/* Commands that must be refused: by the limits, because nothing holds, by the mode, and without a motion. */
static void *command(void *unused) {
    double far[TAKT_MAX_AXES], none[TAKT_MAX_AXES];
    takt_motion motion = {0};
    for (unsigned axis = 0; axis < TAKT_MAX_AXES; axis++) {
        far[axis] = 1e3;
        none[axis] = NAN;
    }
    while (!atomic_load(&is_over)) {
        if (takt_move_to(arm, far, home.axis_count, NULL, &motion) == TAKT_OK
            || takt_move_to(arm, none, home.axis_count, NULL, &motion) == TAKT_OK
            || takt_push_positions(arm, none, home.axis_count) == TAKT_OK
            || takt_profile_velocity(arm, 0, 1.0, 1.0, &motion) == TAKT_OK
            || takt_pause(arm, (takt_motion){0}) == TAKT_OK)
            atomic_store(&was_taken, true);
    }
    return unused;
}

static void *observe(void *unused) {
    takt_state state = {.size = sizeof state};
    while (!atomic_load(&is_over)) takt_read_state(arm, &state);
    return unused;
}

static int32_t sway(void *user, const takt_callback_cycle *cycle, const takt_axis_state *axes, takt_target *targets, size_t count) {
    (void)user;
    (void)axes;
    double moved = offset((double)(cycle->slot_start_ns - begun_ns) / 1e9);
    for (size_t axis = 0; axis < count; axis++)
        targets[axis] = (takt_target){.kind = TAKT_POSITION, .position = home.axes[axis].position_set + moved};
    return atomic_load(&may_return) ? TAKT_FINISHED : TAKT_GO_ON;
}

static int failed(const char *what) {
    fprintf(stderr, "%s: %s\n", what, takt_last_error_text());
    return 1;
}

/* Gives the one recording in a folder its name. */
static int named(const char *folder, const char *name) {
    char pattern[4096];
    glob_t found;
    snprintf(pattern, sizeof pattern, "%s/*.mcap", folder);
    if (glob(pattern, 0, NULL, &found) != 0 || rename(found.gl_pathv[0], name) != 0) return failed("recording");
    globfree(&found);
    return 0;
}

static void pause_s(double seconds) {
    while ((seconds -= 0.01) > 0.0) pause_ns(INTERVAL_NS);
}

int main(int count, char **arguments) {
    const char *config = count > 1 ? arguments[1] : "arm.toml", *recording = "unruly_program.mcap";
    double half_s = 1.0;
    for (int at = 2; at + 1 < count; at++) {
        if (strcmp(arguments[at], "--duration") == 0) half_s = atof(arguments[at + 1]) / 2.0;
        if (strcmp(arguments[at], "--record") == 0) recording = arguments[at + 1];
    }
    char folder[4000];
    snprintf(folder, sizeof folder, "%s.folder", recording);
    mkdir(folder, 0700);

    takt_options options = {.size = sizeof options, .is_realtime_required = 1, .recording = folder};
    takt_callback_times times = {.size = sizeof times};
    takt_callback callback = {0};
    takt_state state = {.size = sizeof state};
    if (takt_open(config, &options, &arm) != TAKT_OK || takt_read_state(arm, &home) != TAKT_OK) return failed("open");

    void *(*const clients[])(void *) = {lead, flood, command, observe};
    enum { CLIENTS = sizeof clients / sizeof *clients };
    pthread_t threads[CLIENTS];
    begun_ns = takt_now_ns(arm);
    if (takt_begin_callback(arm, sway, NULL, NULL, &callback) != TAKT_OK) return failed("callback");
    for (int client = 0; client < CLIENTS; client++)
        if (pthread_create(&threads[client], NULL, clients[client], NULL) != 0) return failed("thread");

    pause_s(half_s);
    atomic_store(&may_return, true);
    if (takt_wait_callback(callback, 5.0) != TAKT_OK || takt_read_callback_times(callback, &times) != TAKT_OK) return failed("wait");
    if (takt_begin_stream(arm) != TAKT_OK) return failed("stream");
    pause_s(half_s);
    atomic_store(&is_over, true);
    for (int client = 0; client < CLIENTS; client++) pthread_join(threads[client], NULL);
    do {
        if (takt_wait_cycle(arm, 5.0, &state) != TAKT_OK) return failed("rest");
    } while (state.groups[0].stream_state != TAKT_STREAM_DRY);

    printf("%u calls of the callback, the longest of %u us; %u points, %u late\n", (unsigned)times.calls,
           (unsigned)(times.longest_ns / 1000), (unsigned)state.groups[0].stream_points, (unsigned)state.groups[0].stream_late_points);
    bool has_stopped = state.groups[0].phase != TAKT_PHASE_STREAMING;
    if (takt_close(arm) != TAKT_OK) return failed("close");
    if (has_stopped || atomic_load(&was_taken)) {
        fputs(has_stopped ? "the axes have stopped\n" : "a command was taken that must be refused\n", stderr);
        return 1;
    }
    return named(folder, recording);
}
