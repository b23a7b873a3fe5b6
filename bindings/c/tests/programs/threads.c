/* Many threads with one controller in real time: one moves it, two read, one pushes points, one reads events, one stops it by a signal,
 * and in the end one closes it while the others are in their calls. */
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <takt.h>
#include <unistd.h>

#define CHECK(what) do { if (!(what)) { fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, #what, takt_last_error_text()); exit(1); } } while (0)

static takt_handle arm;
static takt_events events;
static atomic_uint cycles, stops, seen_events, moves;

static void on_signal(int number) {
    (void)number;
    if (takt_stop(arm, TAKT_STOP_AND_HOLD) == TAKT_OK) atomic_fetch_add(&stops, 1);
}

/* Returns when the controller has ended. */
static void *reads(void *unused) {
    takt_state state = {.size = sizeof state};
    takt_result result;
    (void)unused;
    while ((result = takt_wait_cycle(arm, 5.0, &state)) == TAKT_OK) atomic_fetch_add(&cycles, 1);
    CHECK(result == TAKT_ERROR_ENDED || result == TAKT_ERROR_HANDLE);
    return NULL;
}

static void *listens(void *unused) {
    takt_event event = {.size = sizeof event};
    takt_result result;
    (void)unused;
    while ((result = takt_next_event(events, 5.0, &event)) == TAKT_OK) atomic_fetch_add(&seen_events, 1);
    CHECK(result == TAKT_ERROR_ENDED);
    return NULL;
}

static void *moves_about(void *unused) {
    takt_state state = {.size = sizeof state};
    double distances[TAKT_MAX_AXES] = {0.0};
    (void)unused;
    for (int round = 0;; round++) {
        takt_motion motion;
        distances[0] = round % 2 ? 0.02 : -0.02;
        takt_result result = takt_move_by(arm, distances, takt_axis_count(arm), NULL, &motion);
        if (result == TAKT_ERROR_ARGUMENT || result == TAKT_ERROR_HANDLE || result == TAKT_ERROR_ENDED) return NULL;
        if (result != TAKT_OK) continue;
        result = takt_wait(arm, motion, 5.0);
        if (result == TAKT_OK) atomic_fetch_add(&moves, 1);
        if (result == TAKT_ERROR_ENDED || result == TAKT_ERROR_HANDLE) return NULL;
        CHECK(result != TAKT_ERROR_DEFECT && result != TAKT_ERROR_TIMEOUT);
        if (takt_read_state(arm, &state) != TAKT_OK) return NULL;
    }
}

int main(int count, char **arguments) {
    CHECK(count > 1);
    takt_options options = {.size = sizeof options, .drives = TAKT_SIMULATED};
    pthread_t threads[4];
    CHECK(takt_open(arguments[1], &options, &arm) == TAKT_OK);
    CHECK(takt_open_events(arm, &events) == TAKT_OK);
    signal(SIGUSR1, on_signal);
    CHECK(pthread_create(&threads[0], NULL, reads, NULL) == 0);
    CHECK(pthread_create(&threads[1], NULL, reads, NULL) == 0);
    CHECK(pthread_create(&threads[2], NULL, listens, NULL) == 0);
    CHECK(pthread_create(&threads[3], NULL, moves_about, NULL) == 0);
    while (atomic_load(&cycles) < 400 || atomic_load(&moves) < 2) usleep(1000);
    for (int number = 0; number < 20; number++) {
        /* In the middle of whatever these threads do. */
        pthread_kill(threads[number % 4], SIGUSR1);
        usleep(5000);
    }
    /* A signal that comes while another one is on its way is not a second one. */
    while (atomic_load(&stops) < 5) usleep(1000);
    const unsigned moved = atomic_load(&moves);
    while (atomic_load(&moves) <= moved) usleep(1000);
    CHECK(takt_close(arm) == TAKT_OK);
    for (int number = 0; number < 4; number++) pthread_join(threads[number], NULL);
    CHECK(takt_close_events(events) == TAKT_OK);
    CHECK(atomic_load(&seen_events) > 5);
    raise(SIGUSR1);
    puts("all threads have ended");
    return 0;
}
