// An exception of a callback, of a type that no handler of takt knows.
#include <cstdio>
#include <cstring>
#include <takt.hpp>

int main(int count, char **arguments) {
    if (count < 2) return 1;
    takt::options simulated;
    simulated.drives = TAKT_SIMULATED;
    auto arm = takt::controller::open(arguments[1], simulated);
    int calls = 0;
    auto throws = [&](const takt_callback_cycle &, takt::span<const takt_axis_state>, takt::span<takt_target>) -> takt_callback_result {
        if (++calls == 100) throw calls;
        return TAKT_GO_ON;
    };
    takt::callback_options patient; // without a real-time kernel
    patient.overruns_allowed = 100;
    auto callback = arm.begin_callback(throws, patient);
    if (callback->wait(10.0).code() != TAKT_ERROR_STOPPED) return 2;
    if (std::strcmp(arm.state().groups()[0].stop_rule, "callback_panicked") != 0) return 3;
    // The run had a stop, and says so.
    if (arm.close().code() != TAKT_OK && arm.raw().number != 0) return 4;
    std::puts("the exception was a stop");
    return 0;
}
