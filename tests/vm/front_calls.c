/* Calls of takt.h, as front_calls.rs has them of a handle: moves, stops and points of a stream, each with CLOCK_REALTIME before it.
 *
 *     front_calls_c CONFIG        whose interfaces are those of the laboratory
 */
#include <stdio.h>
#include <stdlib.h>
#include <takt.h>
#include <time.h>

#define CALLS 100
/* rad */
#define STEP 0.0005
#define FAR 0.3

static takt_handle arm;
static takt_state state = {.size = sizeof state};
static double home[TAKT_MAX_AXES];

/* So many milliseconds, and a part of one that is another one each time, so that the calls come all over the cycle. */
static void pause_ms(long milliseconds, int number) {
    nanosleep(&(struct timespec){.tv_nsec = milliseconds * 1000000 + number * 37 % 100 * 10000}, NULL);
}

static void noted(const char *command) {
    struct timespec at;
    clock_gettime(CLOCK_REALTIME, &at);
    printf("%s %lld.%06ld", command, (long long)at.tv_sec, at.tv_nsec / 1000);
}

static void done(takt_result result) {
    if (result == TAKT_OK) return;
    fprintf(stderr, "%s\n", takt_last_error_text());
    exit(1);
}

/* Home, but for the first axis. */
static const double *away(double by) {
    static double there[TAKT_MAX_AXES];
    for (unsigned axis = 0; axis < state.axis_count; axis++) there[axis] = home[axis];
    there[0] += by;
    return there;
}

static void move_to(const double *there, takt_motion *motion) {
    done(takt_move_to(arm, there, state.axis_count, NULL, motion));
}

static void push(double by) {
    done(takt_push_positions(arm, away(by), state.axis_count));
}

int main(int count, char **arguments) {
    takt_motion motion = {0};
    done(takt_open(count > 1 ? arguments[1] : "arm.toml", NULL, &arm));
    done(takt_read_state(arm, &state));
    for (unsigned axis = 0; axis < state.axis_count; axis++) home[axis] = state.axes[axis].position_set;
    fputs("calls begin\n", stderr);
    for (int number = 0; number < CALLS; number++) {
        pause_ms(5, number);
        noted("move");
        move_to(away(number % 2 == 0 ? STEP : 0.0), &motion);
        puts("");
    }
    for (int number = 0; number < CALLS; number++) {
        pause_ms(5, number);
        move_to(away(number % 2 == 0 ? FAR : -FAR), &motion);
        pause_ms(5, number);
        noted("stop");
        done(takt_stop(arm, TAKT_STOP_AND_HOLD));
        puts("");
    }
    pause_ms(5, 0);
    move_to(home, &motion);
    done(takt_wait(arm, motion, 10.0));
    done(takt_begin_stream(arm));
    for (int point = 0; point < 20; point++) {
        push(0.0);
        pause_ms(5, 0);
    }
    for (int number = 0; number < CALLS; number++) {
        for (int point = 0; point < 4; point++) {
            push(number % 2 == 0 ? 0.0 : STEP);
            pause_ms(5, 0);
        }
        pause_ms(0, number);
        done(takt_read_state(arm, &state));
        noted("point");
        push(number % 2 == 0 ? STEP : 0.0);
        printf(" %llu\n", (unsigned long long)state.groups[0].stream_lag_ns);
        pause_ms(5, 0);
    }
    /* The last point comes after the lag of the stream. */
    pause_ms(50, 0);
    done(takt_close(arm));
    return 0;
}
