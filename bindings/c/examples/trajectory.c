/* A trajectory in virtual time, without hardware and without waiting: points with times, at half the speed, paused and resumed. And one
 * that is refused, with the point, the axis and the limit.
 *
 *   ./trajectory configs/arm6-erob.toml
 */
#include <stdio.h>
#include <stdlib.h>
#include <takt.h>

static takt_handle arm;

static void check(takt_result result, const char *what) {
    if (result >= TAKT_OK) return;
    fprintf(stderr, "%s: %s\n", what, takt_last_error_text());
    takt_close(arm);
    exit(1);
}

int main(int count, char **arguments) {
    takt_options options = {.size = sizeof options, .drives = TAKT_VIRTUAL};
    takt_state state = {.size = sizeof state};
    takt_progress progress = {.size = sizeof progress};
    takt_error refusal = {.size = sizeof refusal};
    takt_events events;
    takt_event event = {.size = sizeof event};
    takt_motion motion;
    const double times_s[] = {1.0, 2.0, 3.0}, offsets[] = {0.05, 0.0, -0.05}, too_soon_s[] = {0.01};
    double positions[3 * TAKT_MAX_AXES];

    check(takt_open(count > 1 ? arguments[1] : "arm.toml", &options, &arm), "open");
    check(takt_open_events(arm, &events), "events");
    check(takt_read_state(arm, &state), "state");
    const unsigned axes = state.axis_count;
    for (unsigned point = 0; point < 3; point++)
        for (unsigned axis = 0; axis < axes; axis++)
            positions[point * axes + axis] = state.axes[axis].position_set + offsets[point];

    /* What breaks a limit anywhere is refused before anything moves. */
    if (takt_execute(arm, too_soon_s, positions, NULL, NULL, 1, axes, &motion) != TAKT_ERROR_LIMIT) return 1;
    check(takt_last_error(&refusal), "error");
    printf("refused at point %d, axis %d, %.3f beyond %.3f: %s\n", refusal.point, refusal.axis, refusal.value, refusal.limit,
           takt_last_error_text());

    /* A smooth curve through the points, since they come without velocities. */
    check(takt_execute(arm, times_s, positions, NULL, NULL, 3, axes, &motion), "execute");
    check(takt_set_speed(arm, motion, 0.5), "speed");
    check(takt_advance(arm, 500, NULL), "advance");
    check(takt_pause(arm, motion), "pause");
    check(takt_advance(arm, 500, NULL), "advance");
    check(takt_trajectory_progress(arm, motion, &progress), "progress");
    printf("paused at %.2f s of %.2f s\n", progress.path_s, progress.of_s);
    check(takt_resume(arm, motion), "resume");
    check(takt_wait(arm, motion, 60.0), "wait");

    check(takt_read_state(arm, &state), "state");
    printf("the first joint is at %.4f rad after %.2f s of virtual time\n", state.axes[0].position, (double)takt_now_ns(arm) / 1e9);
    while (takt_next_event(events, 0.0, &event) == TAKT_OK)
        if (event.kind == TAKT_EVENT_MOTION_FINISHED) printf("slot %u: %s\n", (unsigned)event.slot, event.words);
    takt_close_events(events);
    check(takt_close(arm), "close");
    return 0;
}
