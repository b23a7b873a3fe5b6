/* Forks, cancelled threads, and a close while another thread lets cycles pass: the controller goes on, or ends, as its owner wants. */
#define _GNU_SOURCE
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <takt.h>

#define CHECK(what) do { if (!(what)) { fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, #what, takt_last_error_text()); _exit(1); } } while (0)

static takt_handle opened(const char *path, int32_t drives) {
    takt_options options = {.size = sizeof options, .drives = drives};
    takt_handle arm;
    CHECK(takt_open(path, &options, &arm) == TAKT_OK);
    return arm;
}

static void is_refused_in_a_fork(takt_handle arm, takt_events events, const char *path) {
    takt_state state = {.size = sizeof state};
    takt_event event = {.size = sizeof event};
    double to[TAKT_MAX_AXES] = {0.1};
    alarm(30);
    CHECK(takt_now_ns(arm) == 0 && takt_axis_count(arm) == 0);
    CHECK(takt_stop(arm, TAKT_STOP_AND_HOLD) == TAKT_ERROR_ENDED);
    CHECK(takt_wait_cycle(arm, 1.0, &state) == TAKT_ERROR_ENDED);
    CHECK(strstr(takt_last_error_text(), "fork") != NULL);
    CHECK(takt_move_to(arm, to, 1, NULL, NULL) == TAKT_ERROR_ENDED);
    CHECK(takt_disable(arm) == TAKT_ERROR_ENDED);
    CHECK(takt_next_event(events, 0.0, &event) == TAKT_ERROR_ENDED);
    CHECK(takt_close_events(events) == TAKT_ERROR_ENDED);
    CHECK(takt_close(arm) == TAKT_ERROR_ENDED);
    /* What it opens itself is its own. After _Fork() a process of several threads may not allocate. */
    if (path) {
        takt_handle own = opened(path, TAKT_VIRTUAL);
        CHECK(takt_advance(own, 10, NULL) == TAKT_OK && takt_close(own) == TAKT_OK);
    }
    _exit(0);
}

static void forks(const char *path, pid_t (*fork_by)(void)) {
    takt_handle arm = opened(path, TAKT_SIMULATED);
    takt_events events;
    takt_motion motion;
    double to[TAKT_MAX_AXES] = {0};
    int status = -1;
    CHECK(takt_open_events(arm, &events) == TAKT_OK);
    CHECK(takt_move_to(arm, to, takt_axis_count(arm), NULL, &motion) == TAKT_OK);
    pid_t child = fork_by();
    if (child == 0) is_refused_in_a_fork(arm, events, fork_by == fork ? path : NULL);
    CHECK(waitpid(child, &status, 0) == child && status == 0);
    CHECK(takt_wait(arm, motion, 60.0) == TAKT_OK);
    CHECK(takt_close_events(events) == TAKT_OK && takt_close(arm) == TAKT_OK);
}

static void *waits(void *of) {
    takt_state state = {.size = sizeof state};
    for (;;) takt_wait_cycle(*(takt_handle *)of, 10.0, &state);
    return NULL;
}

static void cancels(const char *path) {
    takt_handle arm = opened(path, TAKT_SIMULATED);
    for (useconds_t number = 0; number < 50; number++) {
        pthread_t thread;
        void *ended = NULL;
        CHECK(pthread_create(&thread, NULL, waits, &arm) == 0);
        usleep(number * 60);
        CHECK(pthread_cancel(thread) == 0 && pthread_join(thread, &ended) == 0 && ended == PTHREAD_CANCELED);
    }
    CHECK(takt_close(arm) == TAKT_OK);
}

static void *advances(void *of) {
    return (void *)(intptr_t)takt_advance(*(takt_handle *)of, UINT64_MAX, NULL);
}

static void closes_while_time_passes(const char *path) {
    takt_handle arm = opened(path, TAKT_VIRTUAL);
    pthread_t thread;
    void *advanced = NULL;
    CHECK(pthread_create(&thread, NULL, advances, &arm) == 0);
    usleep(100000);
    CHECK(takt_close(arm) == TAKT_OK);
    CHECK(pthread_join(thread, &advanced) == 0 && (intptr_t)advanced == TAKT_ERROR_ENDED);
}

int main(int count, char **arguments) {
    CHECK(count > 1);
    alarm(120);
    forks(arguments[1], fork);
    /* Calls no handler of pthread_atfork(). */
    forks(arguments[1], _Fork);
    cancels(arguments[1]);
    closes_while_time_passes(arguments[1]);
    puts("every process and thread has ended as it should");
    return 0;
}
