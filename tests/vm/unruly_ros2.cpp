// A controller manager that behaves badly with a TaktSystem (and so with takt.hpp), for the jitter measurements of the laboratory: it leads two
// joints to and fro at 250 Hz, then calls write() as fast as it can, changes a joint to velocity and back in motion, and stalls
// for a third of a second, again and again. A thread beside it takes memory and gives it back without a pause. It ends with an error if the
// axes have stopped, or if they did not come to rest.
//
//     unruly_ros2 CONFIG --duration SECONDS --record FILE.mcap        the interfaces are those of the configuration
#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "../../extras/ros2_control/test/manager.hpp"

namespace {

using clock_type = std::chrono::steady_clock;
using seconds = std::chrono::duration<double>;

constexpr const char *joints[] = {"joint1", "joint2"};
const rclcpp::Duration period(0, 4000000);

/// A gentle motion to and fro: rad.
double offset(double since_s) {
    const double grown = std::min(since_s / 2.0, 1.0);
    return 0.1 * grown * grown * grown * std::sin(1.5707963 * since_s);
}

void litter(const std::atomic<bool> &is_over) {
    while (!is_over) {
        std::vector<std::string> made;
        for (std::size_t number = 0; number < 2000; number++) made.emplace_back(64 + number, 'x');
    }
}

/// A manager, and where the joints were when it began.
struct Unruly {
    Manager &manager;
    clock_type::time_point begun = clock_type::now();
    double home[2] = {manager.state("joint1/position"), manager.state("joint2/position")};
    unsigned long written = 0;

    void cycle(bool is_second_a_velocity = false) {
        const rclcpp::Time now(0);
        const double moved = offset(seconds(clock_type::now() - begun).count());
        CHECK(manager.system->read(now, period) == return_type::OK);
        manager.command("joint1/position", home[0] + moved);
        if (is_second_a_velocity) {
            manager.command("joint2/velocity", 0.0);
        } else {
            manager.command("joint2/position", home[1] + moved);
        }
        CHECK(manager.system->write(now, period) == return_type::OK);
        written++;
    }

    void at_250_hz(int cycles, bool is_second_a_velocity = false) {
        for (int cycle_number = 0; cycle_number < cycles; cycle_number++) {
            cycle(is_second_a_velocity);
            std::this_thread::sleep_for(std::chrono::milliseconds(4));
        }
    }

    void as_fast_as_it_can(seconds lasting) {
        for (const auto end = clock_type::now() + lasting; clock_type::now() < end;) cycle();
    }

    void behave_badly() {
        at_250_hz(75);
        as_fast_as_it_can(seconds(0.3));
        CHECK(manager.switch_to({"joint2/velocity"}, {"joint2/position"}) == return_type::OK);
        at_250_hz(10, true);
        CHECK(manager.switch_to({"joint2/position"}, {"joint2/velocity"}) == return_type::OK);
        at_250_hz(10);
        std::this_thread::sleep_for(std::chrono::milliseconds(333));
    }
};

} // namespace

int main(int count, char **arguments) {
    CHECK(count > 1);
    double lasting_s = 2.0;
    std::string recording = "unruly_ros2.mcap";
    for (int at = 2; at + 1 < count; at++) {
        if (std::strcmp(arguments[at], "--duration") == 0) lasting_s = std::atof(arguments[at + 1]);
        if (std::strcmp(arguments[at], "--record") == 0) recording = arguments[at + 1];
    }
    const std::string folder = recording + ".folder";
    std::filesystem::create_directory(folder);

    auto tag = parsed("extras/ros2_control/urdf/arm.ros2_control.urdf");
    tag = with(with(with(tag, "configuration", arguments[1]), "realtime", "required"), "recording", folder);
    Manager manager;
    auto &system = *manager.system;
    CHECK(manager.init(tag) == CallbackReturn::SUCCESS);
    manager.take_interfaces();
    CHECK(system.on_configure(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.switch_to({"joint1/position", "joint2/position"}, {}) == return_type::OK);

    std::atomic<bool> is_over{false};
    std::thread littering([&] { litter(is_over); });
    Unruly unruly{manager};
    while (clock_type::now() < unruly.begun + seconds(lasting_s)) unruly.behave_badly();
    is_over = true;
    littering.join();

    CHECK(system.on_deactivate(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_cleanup(any_state) == CallbackReturn::SUCCESS);
    std::printf("%lu calls of write()\n", unruly.written);
    std::filesystem::path left;
    for (const auto &entry : std::filesystem::directory_iterator(folder))
        if (entry.path().extension() == ".mcap") left = entry.path();
    CHECK(!left.empty());
    std::filesystem::rename(left, recording);
}
