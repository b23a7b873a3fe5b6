// Every way to move, in virtual time, without hardware and without waiting: to, by, through, a trajectory, a stream, a callback.
//
//   ./every_way configs/arm6-erob.toml
#include <cmath>
#include <cstdio>
#include <exception>
#include <takt.hpp>
#include <vector>

int main(int count, char **arguments) try {
    takt::options options;
    options.drives = TAKT_VIRTUAL;
    auto arm = takt::controller::open(count > 1 ? arguments[1] : "arm.toml", options);
    const std::vector<double> home = arm.state().set_points();
    const auto from_home = [&](double offset) {
        std::vector<double> pose = home;
        for (double &position : pose) position += offset;
        return pose;
    };

    takt::move_options gently;
    gently.velocity_scale = 0.5;
    arm.wait(arm.move_to(from_home(0.05), gently).or_throw()).or_throw();
    arm.wait(arm.move_by(std::vector<double>(arm.size(), -0.05)).or_throw()).or_throw();

    std::vector<double> path;
    for (double offset : {0.02, 0.05, 0.0})
        for (double position : from_home(offset)) path.push_back(position);
    arm.wait(arm.move_through(path).or_throw()).or_throw();
    arm.wait(arm.execute({1.0, 2.0, 3.0}, path).or_throw()).or_throw();

    // After it is open, nothing throws: a result says what was wrong, and where.
    if (auto refused = arm.execute({0.001}, takt::span<const double>(path.data(), arm.size())); !refused)
        std::printf("refused at point %d, axis %d: %s\n", refused.why().point, refused.why().axis, refused.words().c_str());

    arm.begin_stream().or_throw();
    takt::state state;
    for (int point = 0; point < 100; point++) {
        arm.push_now(from_home(0.02 * std::sin(0.03 * point))).or_throw();
        arm.advance(10).or_throw();
    }
    arm.stop();
    arm.wait_phase(TAKT_PHASE_HOLDING, 5.0).or_throw();

    auto swaying = arm.begin_callback(
        [elapsed_s = 0.0, &home](const takt_callback_cycle &cycle, takt::span<const takt_axis_state>, takt::span<takt_target> targets) mutable {
            elapsed_s += cycle.dt_s;
            for (std::size_t axis = 0; axis < targets.size(); axis++)
                targets[axis] = takt::target::position(home[axis] + 0.02 * std::sin(elapsed_s) * std::sin(elapsed_s));
            return elapsed_s < 2.0 ? TAKT_GO_ON : TAKT_FINISHED;
        });
    swaying->wait(10.0).or_throw();
    std::printf("%llu calls\n", static_cast<unsigned long long>(swaying->times()->calls));

    arm.wait_cycle(state).or_throw();
    std::printf("at %.3f rad after %.2f s of virtual time\n", state[0].position, static_cast<double>(arm.now_ns()) / 1e9);
    arm.close().or_throw();
} catch (const std::exception &problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
}
