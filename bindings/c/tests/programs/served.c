/* A controller of another process, commanded by the calls of an own one, until that process is killed: served NAME */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <takt.h>
#include <unistd.h>

#define CHECK(what) do { if (!(what)) { fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, #what, takt_last_error_text()); exit(1); } } while (0)
#define DONE(call) CHECK((call) == TAKT_OK)

enum { AXES = 6 };
static takt_handle arm;
static volatile sig_atomic_t stopped = 1;

static void on_signal(int number) {
    (void)number;
    stopped = takt_stop(arm, TAKT_STOP_AND_HOLD);
}

static takt_state now(void) {
    takt_state state = {.size = sizeof state};
    DONE(takt_read_state(arm, &state));
    return state;
}

static void pose(double *to, double offset) {
    const takt_state state = now();
    for (int axis = 0; axis < AXES; axis++) to[axis] = state.axes[axis].position_set + offset;
}

static void describes(void) {
    takt_axis joint = {.size = sizeof joint};
    takt_handle group;
    CHECK(takt_axis_count(arm) == AXES && takt_period_ns(arm) == 1000000);
    DONE(takt_describe_axis(arm, 1, &joint));
    CHECK(strcmp(joint.name, "joint2") == 0 && joint.node == 2 && joint.is_linear == 0);
    CHECK(joint.position_min < joint.position_max && joint.velocity > 0.0);
    CHECK(takt_open_group(arm, "leg", &group) == TAKT_ERROR_ARGUMENT);
    // In this order: a later state may be of the next cycle.
    const uint64_t seen_at_ns = now().at_ns;
    CHECK(takt_now_ns(arm) >= seen_at_ns);
}

static void moves(void) {
    double to[AXES], path[2 * AXES];
    const double times_s[] = {1.0, 2.0};
    takt_motion motion;
    takt_progress progress = {.size = sizeof progress};
    pose(to, 0.02);
    DONE(takt_move_to(arm, to, AXES, NULL, &motion));
    DONE(takt_wait(arm, motion, 30.0));
    CHECK(takt_motion_result(arm, motion) == TAKT_OK && fabs(now().axes[0].position_set - to[0]) < 1e-9);
    for (int axis = 0; axis < AXES; axis++) to[axis] = -0.02;
    DONE(takt_move_by(arm, to, AXES, NULL, &motion));
    DONE(takt_wait(arm, motion, 30.0));
    pose(path, 0.05);
    pose(path + AXES, 0.0);
    DONE(takt_move_through(arm, path, 2, AXES, &motion));
    DONE(takt_wait(arm, motion, 30.0));
    DONE(takt_execute(arm, times_s, path, NULL, NULL, 2, AXES, &motion));
    DONE(takt_trajectory_progress(arm, motion, &progress));
    CHECK(progress.of_s == 2.0 && progress.rate > 0.0);
    DONE(takt_set_speed(arm, motion, 0.5));
    DONE(takt_pause(arm, motion));
    DONE(takt_resume(arm, motion));
    DONE(takt_wait(arm, motion, 30.0));
    CHECK(takt_trajectory_progress(arm, motion, &progress) == TAKT_ERROR_NO_TRAJECTORY);
}

static void streams(void) {
    double to[AXES], chunk[10 * AXES];
    takt_state state = {.size = sizeof state};
    takt_target targets[AXES];
    pose(to, 0.0);
    CHECK(takt_push_positions(arm, to, AXES) == TAKT_ERROR_REFUSED);
    DONE(takt_begin_stream(arm));
    CHECK(now().groups[0].stream_state != TAKT_STREAM_IDLE);
    for (int point = 1; point <= 50; point++) {
        for (int axis = 0; axis < AXES; axis++) to[axis] += 0.0002;
        DONE(takt_push_positions(arm, to, AXES));
        DONE(takt_advance(arm, 2, &state));
    }
    memset(targets, 0, sizeof targets);
    for (int axis = 0; axis < AXES; axis++) {
        targets[axis].kind = TAKT_POSITION;
        targets[axis].position = to[axis];
    }
    DONE(takt_push_at(arm, takt_now_ns(arm), targets, AXES));
    for (int value = 0; value < 10 * AXES; value++) chunk[value] = to[value % AXES];
    DONE(takt_push_positions_chunk(arm, takt_now_ns(arm), 10000000, chunk, 10, AXES));
    targets[2].kind = TAKT_TORQUE;
    CHECK(takt_push_now(arm, targets, AXES) == TAKT_ERROR_MODE);
    while (fabs(now().axes[0].position_set - to[0]) > 1e-6) DONE(takt_wait_cycle(arm, 5.0, &state));
    DONE(takt_stop(arm, TAKT_STOP_AND_HOLD));
    DONE(takt_wait_phase(arm, TAKT_PHASE_HOLDING, 30.0));
    CHECK(takt_push_positions(arm, to, AXES) == TAKT_ERROR_REFUSED);
    CHECK(takt_push_positions_chunk(arm, takt_now_ns(arm), 10000000, chunk, 10, AXES) == TAKT_ERROR_REFUSED);
}

static void stops_and_powers(void) {
    takt_motion motion;
    double by[AXES] = {-0.5};
    struct sigaction action = {.sa_handler = on_signal};
    DONE(sigaction(SIGUSR1, &action, NULL));
    DONE(takt_move_by(arm, by, AXES, NULL, &motion));
    DONE(takt_wait_phase(arm, TAKT_PHASE_MOVING, 30.0));
    raise(SIGUSR1);
    CHECK(stopped == TAKT_OK && takt_wait(arm, motion, 30.0) == TAKT_ERROR_STOPPED);
    DONE(takt_wait_phase(arm, TAKT_PHASE_HOLDING, 30.0));
    DONE(takt_disable(arm));
    DONE(takt_wait_phase(arm, TAKT_PHASE_DISABLED, 30.0));
    CHECK(takt_clear_faults(arm) == TAKT_OK);
    DONE(takt_enable(arm));
    DONE(takt_wait_phase(arm, TAKT_PHASE_HOLDING, 30.0));
}

static int32_t never(void *user, const takt_callback_cycle *cycle, const takt_axis_state *axes, takt_target *targets, size_t count) {
    (void)user, (void)cycle, (void)axes, (void)targets, (void)count;
    abort();
}

static void refuses(void) {
    double far[AXES] = {99.0};
    takt_callback callback;
    takt_error error = {.size = sizeof error};
    CHECK(takt_begin_callback(arm, never, NULL, NULL, &callback) == TAKT_ERROR_NOT_OWN);
    CHECK(strstr(takt_last_error_text(), "another process") != NULL);
    CHECK(takt_move_to(arm, far, AXES, NULL, NULL) == TAKT_ERROR_LIMIT);
    DONE(takt_last_error(&error));
    CHECK(error.axis == 0 && error.value == 99.0);
    CHECK(takt_move_to(arm, far, 2, NULL, NULL) == TAKT_ERROR_ARGUMENT);
}

static void takes_over(const char *name) {
    double by[AXES] = {0.01};
    takt_handle other;
    takt_lease lease = {.size = sizeof lease};
    takt_motion motion;
    DONE(takt_connect(name, &other));
    DONE(takt_move_by(arm, by, AXES, NULL, &motion));
    CHECK(takt_move_by(other, by, AXES, NULL, NULL) == TAKT_ERROR_LEASE);
    CHECK(strstr(takt_last_error_text(), "take it over") != NULL);
    DONE(takt_read_lease(other, &lease));
    CHECK(lease.process == (uint32_t)getpid() && lease.expires_in_ns > 0);
    DONE(takt_take_over(other));
    CHECK(takt_begin_stream(arm) == TAKT_ERROR_LEASE && takt_push_positions(arm, by, AXES) == TAKT_ERROR_LEASE);
    DONE(takt_wait(arm, motion, 30.0)); /* what moves goes on, and a stop needs no lease */
    DONE(takt_stop(arm, TAKT_STOP_AND_HOLD));
    DONE(takt_wait_phase(arm, TAKT_PHASE_HOLDING, 30.0)); /* what another connection asks may come before it else */
    DONE(takt_move_by(other, by, AXES, NULL, &motion));
    DONE(takt_wait(other, motion, 30.0));
    DONE(takt_release(other));
    DONE(takt_close(other));
    DONE(takt_take_over(arm));
}

int main(int count, char **arguments) {
    takt_events events;
    takt_event event = {.size = sizeof event};
    CHECK(count > 1);
    CHECK(takt_connect("no-such-controller", &arm) == TAKT_ERROR_START);
    CHECK(strstr(takt_last_error_text(), "no-such-controller") != NULL);
    CHECK(takt_connect("a name", &arm) == TAKT_ERROR_ARGUMENT && takt_connect(NULL, &arm) == TAKT_ERROR_ARGUMENT);
    DONE(takt_connect(arguments[1], &arm));
    DONE(takt_open_events(arm, &events));
    describes();
    moves();
    streams();
    stops_and_powers();
    refuses();
    takes_over(arguments[1]);
    int finished = 0, stops = 0;
    while (takt_next_event(events, 0.0, &event) == TAKT_OK) {
        finished += event.kind == TAKT_EVENT_MOTION_FINISHED;
        stops += event.kind == TAKT_EVENT_STOP;
        CHECK(event.words[0] != 0);
    }
    CHECK(finished >= 6 && stops >= 2);

    puts("kill the controller");
    fflush(stdout);
    double here[AXES];
    takt_state state = {.size = sizeof state};
    pose(here, 0.0);
    DONE(takt_begin_stream(arm));
    takt_result pushed;
    while ((pushed = takt_push_positions(arm, here, AXES)) == TAKT_OK || pushed == TAKT_ERROR_FULL) usleep(1000);
    CHECK(pushed == TAKT_ERROR_ENDED);
    while (takt_wait_cycle(arm, 5.0, &state) == TAKT_OK) continue;
    CHECK(takt_wait_cycle(arm, 5.0, &state) == TAKT_ERROR_ENDED && takt_stop(arm, TAKT_STOP_AND_HOLD) == TAKT_ERROR_ENDED);
    CHECK(takt_enable(arm) == TAKT_ERROR_ENDED && strlen(takt_last_error_text()) > 0);
    CHECK(now().slot > 0 && now().axis_count == AXES);
    while (takt_next_event(events, 0.0, &event) == TAKT_OK) continue;
    CHECK(takt_next_event(events, 5.0, &event) == TAKT_ERROR_ENDED);
    CHECK(takt_close_events(events) == TAKT_OK && takt_close(arm) == TAKT_OK && takt_close(arm) == TAKT_ERROR_HANDLE);
    CHECK(takt_connect(arguments[1], &arm) == TAKT_ERROR_START);
    puts("the controller has ended");
    return 0;
}
