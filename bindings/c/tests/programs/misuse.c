/* What must never crash: handles that are null, closed, made up or of another kind; pointers that are null; counts, sizes, names and
 * numbers that are wrong. Everything is an error, with words, and changes nothing. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <takt.h>

#define CHECK(what) do { if (!(what)) { fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, #what, takt_last_error_text()); exit(1); } } while (0)
#define FAILS(call, code) do { CHECK((call) == (code)); CHECK(takt_last_error_text()[0] != 0); takt_error e_ = {.size = sizeof e_}; \
    CHECK(takt_last_error(&e_) == TAKT_OK && e_.result == (code)); } while (0)

static int32_t returns_seven(void *user, const takt_callback_cycle *cycle, const takt_axis_state *axes, takt_target *targets, size_t count) {
    (void)user; (void)cycle; (void)axes; (void)targets; (void)count;
    return 7;
}

/* Calls what it must not. */
static int32_t waits(void *user, const takt_callback_cycle *cycle, const takt_axis_state *axes, takt_target *targets, size_t count) {
    takt_handle arm = *(takt_handle *)user;
    takt_state state = {.size = sizeof state};
    (void)cycle; (void)axes; (void)targets; (void)count;
    CHECK(takt_wait_cycle(arm, 1.0, &state) == TAKT_ERROR_IN_CALLBACK);
    CHECK(takt_close(arm) == TAKT_ERROR_IN_CALLBACK);
    CHECK(takt_now_ns(arm) > 0);
    return TAKT_FINISHED;
}

static void use_every_function(takt_handle arm) {
    takt_motion motion = {1 << 8};
    takt_state state = {.size = sizeof state};
    takt_axis axis = {.size = sizeof axis};
    takt_group shown = {.size = sizeof shown};
    takt_events events;
    takt_handle group;
    takt_callback callback;
    takt_target target = {.kind = TAKT_POSITION};
    double zero = 0.0, one = 1.0;
    CHECK(takt_now_ns(arm) == 0 && takt_axis_count(arm) == 0 && takt_group_count(arm) == 0 && takt_period_ns(arm) == 0);
    CHECK(takt_stop(arm, TAKT_STOP_AND_HOLD) == TAKT_ERROR_HANDLE);
    FAILS(takt_close(arm), TAKT_ERROR_HANDLE);
    FAILS(takt_read_state(arm, &state), TAKT_ERROR_HANDLE);
    FAILS(takt_wait_cycle(arm, 0.0, &state), TAKT_ERROR_HANDLE);
    FAILS(takt_wait_phase(arm, TAKT_PHASE_HOLDING, 0.0), TAKT_ERROR_HANDLE);
    FAILS(takt_advance(arm, 1, &state), TAKT_ERROR_HANDLE);
    FAILS(takt_enable(arm), TAKT_ERROR_HANDLE);
    FAILS(takt_disable(arm), TAKT_ERROR_HANDLE);
    FAILS(takt_clear_faults(arm), TAKT_ERROR_HANDLE);
    FAILS(takt_describe_axis(arm, 0, &axis), TAKT_ERROR_HANDLE);
    FAILS(takt_describe_group(arm, 0, &shown), TAKT_ERROR_HANDLE);
    FAILS(takt_open_group(arm, "arm", &group), TAKT_ERROR_HANDLE);
    FAILS(takt_open_events(arm, &events), TAKT_ERROR_HANDLE);
    FAILS(takt_move_to(arm, &zero, 1, NULL, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_move_by(arm, &zero, 1, NULL, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_move_through(arm, &zero, 1, 1, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_execute(arm, &one, &zero, NULL, NULL, 1, 1, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_profile_velocity(arm, 0, 0.0, 1.0, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_profile_torque(arm, 0, 0.0, 1.0, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_change_mode(arm, 8, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_change_axis_mode(arm, 0, 8, &motion), TAKT_ERROR_HANDLE);
    FAILS(takt_wait(arm, motion, 0.0), TAKT_ERROR_HANDLE);
    FAILS(takt_motion_result(arm, motion), TAKT_ERROR_HANDLE);
    FAILS(takt_set_speed(arm, motion, 1.0), TAKT_ERROR_HANDLE);
    FAILS(takt_pause(arm, motion), TAKT_ERROR_HANDLE);
    FAILS(takt_resume(arm, motion), TAKT_ERROR_HANDLE);
    takt_progress progress = {.size = sizeof progress};
    FAILS(takt_trajectory_progress(arm, motion, &progress), TAKT_ERROR_HANDLE);
    FAILS(takt_begin_stream(arm), TAKT_ERROR_HANDLE);
    FAILS(takt_push_now(arm, &target, 1), TAKT_ERROR_HANDLE);
    FAILS(takt_push_at(arm, 1, &target, 1), TAKT_ERROR_HANDLE);
    FAILS(takt_push_chunk(arm, 1, 1, &target, 1, 1), TAKT_ERROR_HANDLE);
    FAILS(takt_push_positions(arm, &zero, 1), TAKT_ERROR_HANDLE);
    FAILS(takt_push_positions_at(arm, 1, &zero, 1), TAKT_ERROR_HANDLE);
    FAILS(takt_push_positions_chunk(arm, 1, 1, &zero, 1, 1), TAKT_ERROR_HANDLE);
    FAILS(takt_begin_callback(arm, returns_seven, NULL, NULL, &callback), TAKT_ERROR_HANDLE);
}

int main(int count, char **arguments) {
    CHECK(count > 1);
    takt_options options = {.size = sizeof options, .drives = TAKT_VIRTUAL};
    takt_handle arm, null = {0}, made_up = {(uint64_t)77 << 32 | 3};
    takt_motion motion;
    takt_error refusal = {.size = sizeof refusal};
    CHECK(takt_last_error_text()[0] == 0);

    /* To open what cannot be. */
    FAILS(takt_open(NULL, &options, &arm), TAKT_ERROR_ARGUMENT);
    FAILS(takt_open(arguments[1], &options, NULL), TAKT_ERROR_ARGUMENT);
    FAILS(takt_open("no such file", &options, &arm), TAKT_ERROR_CONFIGURATION);
    CHECK(strstr(takt_last_error_text(), "no such file"));
    FAILS(takt_open_text("name = 3", &options, &arm), TAKT_ERROR_CONFIGURATION);
    CHECK(strstr(takt_last_error_text(), "name"));
    FAILS(takt_open("\xff\xfe", &options, &arm), TAKT_ERROR_ARGUMENT);
    takt_options wrong = {.size = 3};
    FAILS(takt_open(arguments[1], &wrong, &arm), TAKT_ERROR_ARGUMENT);
    wrong = (takt_options){.size = sizeof wrong, .drives = 9};
    FAILS(takt_open(arguments[1], &wrong, &arm), TAKT_ERROR_ARGUMENT);
    wrong = (takt_options){.size = sizeof wrong, .drives = TAKT_SIMULATED, .faults = "no such scenario"};
    FAILS(takt_open(arguments[1], &wrong, &arm), TAKT_ERROR_CONFIGURATION);
    wrong = (takt_options){.size = sizeof wrong, .drives = TAKT_VIRTUAL, .recording = "here"};
    FAILS(takt_open(arguments[1], &wrong, &arm), TAKT_ERROR_ARGUMENT);

    CHECK(takt_open(arguments[1], &options, &arm) == TAKT_OK);
    use_every_function(null);
    use_every_function(made_up);
    use_every_function((takt_handle){UINT64_MAX});
    takt_events events;
    CHECK(takt_open_events(arm, &events) == TAKT_OK);
    use_every_function((takt_handle){events.number});
    FAILS(takt_close_events((takt_events){arm.number}), TAKT_ERROR_HANDLE);
    FAILS(takt_close_callback((takt_callback){arm.number}), TAKT_ERROR_HANDLE);
    FAILS(takt_wait_callback((takt_callback){events.number}, 0.0), TAKT_ERROR_HANDLE);
    takt_event event = {.size = sizeof event};
    FAILS(takt_next_event((takt_events){arm.number}, 0.0, &event), TAKT_ERROR_HANDLE);
    FAILS(takt_next_event(events, 0.0, NULL), TAKT_ERROR_ARGUMENT);
    FAILS(takt_next_event(events, NAN, &event), TAKT_ERROR_ARGUMENT);
    CHECK(takt_next_event(events, 0.0, &event) == TAKT_ERROR_TIMEOUT);

    /* Pointers, counts and sizes. */
    takt_state state = {0}, two[2] = {{.size = sizeof state}, {.size = 0}};
    double targets[TAKT_MAX_AXES + 1] = {0};
    const size_t axes = takt_axis_count(arm);
    FAILS(takt_read_state(arm, NULL), TAKT_ERROR_ARGUMENT);
    FAILS(takt_read_state(arm, &state), TAKT_ERROR_ARGUMENT);
    FAILS(takt_wait_cycle(arm, 1.0, &state), TAKT_ERROR_ARGUMENT);
    FAILS(takt_wait_cycle(arm, 1.0, NULL), TAKT_ERROR_ARGUMENT);
    FAILS(takt_wait_cycle(arm, -1.0, two), TAKT_ERROR_ARGUMENT);
    /* A caller that knows more than the library: the rest stays, and the size says so. */
    two[0].size = sizeof two;
    two[1].slot = 99;
    CHECK(takt_read_state(arm, two) == TAKT_OK && two[0].size == sizeof state && two[1].slot == 99);
    CHECK(two[0].axis_count == axes && !two[0].is_any_stale);
    FAILS(takt_move_to(arm, NULL, axes, NULL, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_move_to(arm, targets, axes + 1, NULL, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_move_to(arm, targets, 0, NULL, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_move_by(arm, targets, axes + 1, NULL, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_move_through(arm, targets, SIZE_MAX, axes, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_move_through(arm, targets, SIZE_MAX / 64, axes, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_execute(arm, targets, NULL, NULL, NULL, 1, axes, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_execute(arm, targets, targets, NULL, NULL, 0, axes, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_push_positions(arm, targets, axes + 1), TAKT_ERROR_ARGUMENT);
    FAILS(takt_push_positions(arm, NULL, axes), TAKT_ERROR_ARGUMENT);
    FAILS(takt_push_positions_chunk(arm, 0, 1, targets, SIZE_MAX, axes), TAKT_ERROR_ARGUMENT);
    takt_target none[TAKT_MAX_AXES] = {{0}};
    FAILS(takt_push_now(arm, none, axes), TAKT_ERROR_ARGUMENT);
    none[0].kind = 99;
    FAILS(takt_push_now(arm, none, axes), TAKT_ERROR_ARGUMENT);
    CHECK(takt_last_error(&refusal) == TAKT_OK && refusal.axis == 0 && refusal.point == 0);
    none[0].kind = TAKT_TORQUE;
    for (size_t axis = 1; axis < axes; axis++) none[axis].kind = TAKT_POSITION;
    FAILS(takt_push_now(arm, none, axes), TAKT_ERROR_MODE);
    CHECK(takt_stop(arm, 3) == TAKT_ERROR_ARGUMENT);
    FAILS(takt_wait_phase(arm, 99, 0.0), TAKT_ERROR_ARGUMENT);
    FAILS(takt_change_mode(arm, 300, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_profile_velocity(arm, 99, 0.0, 1.0, &motion), TAKT_ERROR_ARGUMENT);
    FAILS(takt_profile_velocity(arm, 0, 0.0, 1.0, &motion), TAKT_ERROR_MODE);
    FAILS(takt_open_group(arm, "no such group", &null), TAKT_ERROR_ARGUMENT);
    FAILS(takt_open_group(arm, NULL, &null), TAKT_ERROR_ARGUMENT);
    FAILS(takt_wait(arm, (takt_motion){0}, 0.0), TAKT_ERROR_ARGUMENT);
    FAILS(takt_wait(arm, (takt_motion){(uint64_t)1 << 60}, 0.01), TAKT_ERROR_TIMEOUT);
    FAILS(takt_set_speed(arm, (takt_motion){1 << 8}, 1.0), TAKT_ERROR_NO_TRAJECTORY);

    /* Limits, with the axis, the value and the limit. */
    takt_axis described = {.size = sizeof described};
    CHECK(takt_describe_axis(arm, (uint32_t)axes - 1, &described) == TAKT_OK && described.name[0] != 0);
    FAILS(takt_describe_axis(arm, (uint32_t)axes, &described), TAKT_ERROR_ARGUMENT);
    CHECK(strchr(takt_version(), '.') != NULL && takt_check_urdf(arguments[1], "<robot") == TAKT_ERROR_CONFIGURATION);
    takt_group all = {.size = sizeof all};
    CHECK(takt_group_count(arm) == 1 && takt_describe_group(arm, 0, &all) == TAKT_OK);
    CHECK(all.number == 0 && all.axis_count == axes && all.name[0] == 0);
    FAILS(takt_describe_group(arm, 1, &all), TAKT_ERROR_ARGUMENT);
    FAILS(takt_describe_group(arm, 0, NULL), TAKT_ERROR_ARGUMENT);
    targets[axes - 1] = described.position_max + 1.0;
    FAILS(takt_move_to(arm, targets, axes, NULL, &motion), TAKT_ERROR_LIMIT);
    CHECK(takt_last_error(&refusal) == TAKT_OK && refusal.axis == (int32_t)axes - 1);
    CHECK(refusal.value == targets[axes - 1] && refusal.limit == described.position_max);
    targets[axes - 1] = NAN;
    FAILS(takt_move_to(arm, targets, axes, NULL, &motion), TAKT_ERROR_LIMIT);
    double second = 0.01;
    targets[axes - 1] = described.position_max;
    FAILS(takt_execute(arm, &second, targets, NULL, NULL, 1, axes, &motion), TAKT_ERROR_LIMIT);
    CHECK(takt_last_error(&refusal) == TAKT_OK && refusal.point == 0 && refusal.axis >= 0 && fabs(refusal.value) > fabs(refusal.limit));
    takt_move_options fast = {.size = sizeof fast, .velocity_scale = 2.0};
    CHECK(takt_move_to(arm, targets, axes, &fast, &motion) == TAKT_OK);
    FAILS(takt_wait(arm, motion, 1.0), TAKT_ERROR_REFUSED);

    /* Callbacks that do what they must not. */
    takt_callback callback;
    FAILS(takt_begin_callback(arm, NULL, NULL, NULL, &callback), TAKT_ERROR_ARGUMENT);
    FAILS(takt_begin_callback(arm, returns_seven, NULL, NULL, NULL), TAKT_ERROR_ARGUMENT);
    takt_callback_options long_budget = {.size = sizeof long_budget, .budget_ns = 10000000000u};
    FAILS(takt_begin_callback(arm, returns_seven, NULL, &long_budget, &callback), TAKT_ERROR_ARGUMENT);
    CHECK(takt_begin_callback(arm, waits, &arm, NULL, &callback) == TAKT_OK);
    CHECK(takt_wait_callback(callback, 5.0) == TAKT_OK && takt_close_callback(callback) == TAKT_OK);
    FAILS(takt_close_callback(callback), TAKT_ERROR_HANDLE);
    CHECK(takt_begin_callback(arm, returns_seven, NULL, NULL, &callback) == TAKT_OK);
    FAILS(takt_wait_callback(callback, 5.0), TAKT_ERROR_STOPPED);
    CHECK(strstr(takt_last_error_text(), "returned 7"));
    CHECK(takt_close_callback(callback) == TAKT_OK);
    two[0].size = sizeof state;
    CHECK(takt_read_state(arm, two) == TAKT_OK && two[0].groups[0].is_faulted);
    CHECK(strcmp(two[0].groups[0].stop_rule, "callback_panicked") == 0);
    CHECK(takt_clear_faults(arm) == TAKT_OK);

    /* After the end. */
    CHECK(takt_close(arm) == TAKT_OK);
    use_every_function(arm);
    while (takt_next_event(events, 0.0, &event) == TAKT_OK) CHECK(event.words[0] != 0);
    FAILS(takt_next_event(events, 1.0, &event), TAKT_ERROR_ENDED);
    CHECK(takt_close_events(events) == TAKT_OK);

    /* The table is full, and is free again. */
    CHECK(takt_open(arguments[1], &options, &arm) == TAKT_OK);
    takt_events many[256];
    unsigned opened = 0;
    while (opened < 256 && takt_open_events(arm, &many[opened]) == TAKT_OK) opened++;
    CHECK(opened == 255);
    FAILS(takt_open_events(arm, &events), TAKT_ERROR_FULL);
    while (opened > 0) CHECK(takt_close_events(many[--opened]) == TAKT_OK);
    CHECK(takt_close(arm) == TAKT_OK);
    puts("nothing crashed");
    return 0;
}
