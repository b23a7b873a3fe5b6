/* A callback: a function in the real-time thread holds every joint by a spring and a damper, and sways the first one. An axis in cyclic
 * synchronous torque takes that.
 *
 *   ./callback configs/arm6-erob-cst.toml
 */
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <takt.h>

struct spring {
    double place[TAKT_MAX_AXES]; /* rad */
    double elapsed_s;            /* only the callback looks at it */
    atomic_uint calls;           /* the program looks at it meanwhile */
};

/* It must not block, allocate or print. */
static int32_t sway(void *user, const takt_callback_cycle *cycle, const takt_axis_state *axes, takt_target *targets, size_t count) {
    struct spring *spring = user;
    unsigned calls = atomic_load(&spring->calls);
    (void)axes;
    spring->elapsed_s += cycle->dt_s;
    for (size_t axis = 0; axis < count; axis++)
        targets[axis] = (takt_target){
            .kind = TAKT_IMPEDANCE, .position = spring->place[axis], .stiffness = axis == 0 ? 200.0 : 40.0, .damping = axis == 0 ? 30.0 : 1.5};
    targets[0].position += 0.02 * sin(3.0 * spring->elapsed_s) * fmin(spring->elapsed_s, 1.0);
    atomic_store(&spring->calls, calls + 1);
    return spring->elapsed_s > 2.0 ? TAKT_FINISHED : TAKT_GO_ON;
}

int main(int count, char **arguments) {
    takt_options options = {.size = sizeof options, .drives = TAKT_SIMULATED};
    takt_state state = {.size = sizeof state};
    takt_callback_times times = {.size = sizeof times};
    /* Without a real-time kernel, a call may be interrupted. */
    takt_callback_options patient = {.size = sizeof patient, .overruns_allowed = 50};
    struct spring spring = {.elapsed_s = 0.0};
    takt_handle arm = {0};
    takt_callback callback = {0};

    if (takt_open(count > 1 ? arguments[1] : "arm.toml", &options, &arm) != TAKT_OK) goto failed;
    if (takt_read_state(arm, &state) != TAKT_OK) goto failed;
    for (unsigned axis = 0; axis < state.axis_count; axis++) spring.place[axis] = state.axes[axis].position_set;
    atomic_store(&spring.calls, 0);
    if (takt_begin_callback(arm, sway, &spring, &patient, &callback) != TAKT_OK) goto failed;
    while (atomic_load(&spring.calls) < 500)
        if (takt_wait_cycle(arm, 1.0, &state) != TAKT_OK) goto failed;
    if (takt_wait_callback(callback, 30.0) != TAKT_OK) goto failed;
    if (takt_read_callback_times(callback, &times) != TAKT_OK) goto failed;
    printf("swayed for 2 s in %u calls, the longest of %u us\n", (unsigned)times.calls, (unsigned)(times.longest_ns / 1000));
    takt_close_callback(callback);
    if (takt_close(arm) != TAKT_OK) goto failed;
    return 0;
failed:
    fprintf(stderr, "%s\n", takt_last_error_text());
    takt_close(arm);
    return 1;
}
