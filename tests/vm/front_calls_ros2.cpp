// Calls of write() of TaktSystem, with CLOCK_REALTIME before it: a controller manager of 200 Hz, whose controller has a position elsewhere a hundred times.
//
//     front_calls_ros2 CONFIG        whose interfaces are those of the laboratory
#include "../../extras/ros2_control/test/manager.hpp"
#include "front_calls.hpp"

int main(int count, char **arguments) {
    CHECK(count == 2);
    const auto tag = parsed("extras/ros2_control/urdf/arm.ros2_control.urdf");
    Manager manager;
    auto &system = *manager.system;
    CHECK(manager.init(with(tag, "configuration", arguments[1])) == CallbackReturn::SUCCESS);
    manager.take_interfaces();
    CHECK(system.on_configure(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.switch_to({"joint1/position"}, {}) == return_type::OK);
    const rclcpp::Duration period(0, 5000000);
    const rclcpp::Time now(0);
    double position = manager.state("joint1/position");
    manager.command("joint1/position", position);
    calls_begin();
    for (int number = 0; number < calls; number++) {
        for (int cycle = 0; cycle < (number == 0 ? 20 : 4); cycle++) {
            CHECK(system.read(now, period) == return_type::OK && system.write(now, period) == return_type::OK);
            pause(5, 0);
        }
        pause(0, number);
        position += number % 2 == 0 ? step : -step;
        CHECK(system.read(now, period) == return_type::OK);
        manager.command("joint1/position", position);
        noted("write");
        CHECK(system.write(now, period) == return_type::OK);
        pause(5, 0);
    }
    // The last point comes after the lag of the stream.
    pause(50, 0);
    CHECK(system.on_deactivate(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_cleanup(any_state) == CallbackReturn::SUCCESS);
}
