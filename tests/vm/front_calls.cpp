// Calls of takt.hpp, as front_calls.rs has them of a handle: moves, stops and points of a stream, each with CLOCK_REALTIME before it.
//
//     front_calls_cpp CONFIG        whose interfaces are those of the laboratory
#include "front_calls.hpp"

#include <exception>
#include <takt.hpp>

int main(int count, char **arguments) try {
    auto arm = takt::controller::open(count > 1 ? arguments[1] : "arm.toml");
    const auto home = arm.state().set_points();
    const auto away = [&](double by) {
        auto there = home;
        there[0] += by;
        return there;
    };
    calls_begin();
    for (int number = 0; number < calls; number++) {
        pause(5, number);
        const auto there = away(number % 2 == 0 ? step : 0.0);
        noted("move");
        arm.move_to(there).or_throw();
    }
    for (int number = 0; number < calls; number++) {
        pause(5, number);
        arm.move_to(away(number % 2 == 0 ? far : -far)).or_throw();
        pause(5, number);
        noted("stop");
        if (arm.stop() != TAKT_OK) throw std::runtime_error("stop");
    }
    pause(5, 0);
    arm.wait(arm.move_to(home).or_throw(), 10.0).or_throw();
    arm.begin_stream().or_throw();
    for (int point = 0; point < 20; point++) {
        arm.push_now(home).or_throw();
        pause(5, 0);
    }
    for (int number = 0; number < calls; number++) {
        for (int point = 0; point < 4; point++) {
            arm.push_now(away(number % 2 == 0 ? 0.0 : step)).or_throw();
            pause(5, 0);
        }
        pause(0, number);
        const auto lag_ns = arm.state().groups()[0].stream_lag_ns;
        const auto there = away(number % 2 == 0 ? step : 0.0);
        noted("point", " " + std::to_string(lag_ns));
        arm.push_now(there).or_throw();
        pause(5, 0);
    }
    // The last point comes after the lag of the stream.
    pause(50, 0);
    arm.close().or_throw();
} catch (const std::exception &problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
}
