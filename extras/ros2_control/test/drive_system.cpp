// Leads a TaktSystem through its life, in virtual time, as a controller manager does.
#include "manager.hpp"

#include <cstdlib>
#include <new>

namespace {
std::size_t allocations = 0;
}

// Not inlined: the compiler warns of a `free` that it sees behind a `new`.
__attribute__((noinline)) void *operator new(std::size_t size) {
    allocations++;
    if (void *memory = std::malloc(size)) return memory;
    throw std::bad_alloc();
}
__attribute__((noinline)) void operator delete(void *memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void *memory, std::size_t) noexcept { std::free(memory); }

int main(int count, char **arguments) {
    CHECK(count == 3);
    const std::string configuration = arguments[1];
    const auto tag = parsed(arguments[2]);
    CHECK(tag.joints.size() == 2);
    const auto info = with(with(tag, "configuration", configuration), "drives", "virtual");

    // What is wrong with a tag is said before anything is opened.
    {
        Manager manager;
        CHECK(manager.init(with(info, "configuration", "")) == CallbackReturn::ERROR);
        CHECK(manager.init(with(info, "drives", "imaginary")) == CallbackReturn::ERROR);
        CHECK(manager.init(with(info, "realtime", "perhaps")) == CallbackReturn::ERROR);
        CHECK(manager.init(with(info, "urdf_limits", "perhaps")) == CallbackReturn::ERROR);
        auto strange = info;
        strange.joints[0].command_interfaces[0].name = "temper";
        CHECK(manager.init(strange) == CallbackReturn::ERROR);
        CHECK(manager.init(with(info, "configuration", "no such file")) == CallbackReturn::ERROR);
        strange = info;
        strange.joints[0].name = "no_such_joint";
        CHECK(manager.init(strange) == CallbackReturn::SUCCESS);
        manager.take_interfaces();
        CHECK(manager.system->on_configure(any_state) == CallbackReturn::FAILURE);
    }

    // A configuration that allows more than the joints of the URDF is refused, unless that is wanted.
    {
        Manager manager;
        auto narrow = info;
        const std::string wide = "velocity=\"2.5\"";
        const std::size_t at = narrow.original_xml.find(wide);
        CHECK(at != std::string::npos);
        narrow.original_xml.replace(at, wide.size(), "velocity=\"0.1\"");
        CHECK(manager.init(narrow) == CallbackReturn::ERROR);
        CHECK(manager.init(with(narrow, "urdf_limits", "ignored")) == CallbackReturn::SUCCESS);
        narrow.original_xml = "<robot";
        CHECK(manager.init(narrow) == CallbackReturn::ERROR);
    }

    Manager manager;
    auto &system = *manager.system;
    CHECK(manager.init(info) == CallbackReturn::SUCCESS);
    manager.take_interfaces();
    CHECK(manager.states.size() == 5 && manager.commands.size() == 5);

    // Inactive: states can be read, and nothing is sent.
    CHECK(system.on_configure(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.run(50) == return_type::OK);
    const double home = manager.state("joint1/position"), home2 = manager.state("joint2/position");
    CHECK(std::isfinite(home));

#if HANDLES
    // Whoever is at a value makes nobody wait: the value stays as it was.
    {
        const auto held = manager.states[0]->held();
        CHECK(manager.run(2) == return_type::OK);
    }
#endif

    // Active: it holds until somebody claims it.
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.run(250) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - home) < 0.01);

    // Neither a switch nor a cycle takes memory: the thread of the controller manager may be real-time.
    const std::vector<std::string> claimed = {"joint1/position", "joint2/position"}, released;
    CHECK(system.prepare_command_mode_switch(claimed, released) == return_type::OK);
    const std::size_t allocated = allocations;
    CHECK(system.perform_command_mode_switch(claimed, released) == return_type::OK);
    CHECK(manager.run(3) == return_type::OK);
    CHECK(allocations == allocated);

    // Positions.
    CHECK(manager.run(500, [&](double time_s) {
        manager.command("joint1/position", home + 0.1 * (1.0 - std::cos(1.5 * time_s)));
        manager.command("joint2/position", home2);
    }) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - (home + 0.1 * (1.0 - std::cos(3.0)))) < 0.02);

    // Two interfaces of a joint at once are refused, and nothing has changed.
    CHECK(system.prepare_command_mode_switch({"joint1/velocity"}, {}) == return_type::ERROR);
    CHECK(manager.run(10) == return_type::OK);

    // A velocity, while joint 2 goes on by positions.
    CHECK(manager.switch_to({"joint1/velocity"}, {"joint1/position"}) == return_type::OK);
    CHECK(manager.run(250, [&](double) { manager.command("joint1/velocity", -0.2); }) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/velocity") + 0.2) < 0.03);

    // What is beyond the limits is led to within them: no fault.
    CHECK(manager.run(25, [&](double) { manager.command("joint1/velocity", -100.0); }) == return_type::OK);
    CHECK(manager.run(100, [&](double) { manager.command("joint1/velocity", 0.0); }) == return_type::OK);

    // An effort: the joint is in cyclic synchronous torque. It floats, and is held again.
    CHECK(manager.switch_to({"joint1/effort"}, {"joint1/velocity"}) == return_type::OK);
    CHECK(manager.run(50, [&](double) { manager.command("joint1/effort", 1.0); }) == return_type::OK);
    CHECK(manager.switch_to({}, {"joint1/effort", "joint2/position"}) == return_type::OK);
    CHECK(manager.run(250) == return_type::OK);
    const double held = manager.state("joint1/position");
    CHECK(manager.run(250) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - held) < 0.005 && std::abs(manager.state("joint1/velocity")) < 0.01);

    // A controller manager that stalls for half a second of the bus: the joints come to rest, and go on.
    CHECK(manager.switch_to({"joint1/velocity"}, {}) == return_type::OK);
    CHECK(manager.run(100, [&](double) { manager.command("joint1/velocity", 0.2); }) == return_type::OK);
    CHECK(system.read(rclcpp::Time(manager.now_ns), rclcpp::Duration(0, 500000000)) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/velocity")) < 0.02);
    CHECK(manager.run(100) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/velocity") - 0.2) < 0.05);

    // There and back. A controller that stayed active is not followed until its command asks for no motion, or it claims the joint anew.
    CHECK(manager.switch_to({"joint1/position"}, {"joint1/velocity"}) == return_type::OK);
    CHECK(manager.run(50) == return_type::OK);
    CHECK(system.on_deactivate(any_state) == CallbackReturn::SUCCESS);
    const double off = manager.state("joint1/position");
    const auto far_away = [&](double) { manager.command("joint1/position", off + 0.5); };
    CHECK(manager.run(50, far_away) == return_type::OK);
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.run(250, far_away) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - off) < 0.01);
    CHECK(manager.run(250, [&](double time_s) { manager.command("joint1/position", off + 0.1 * std::min(time_s, 1.0)); }) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - off - 0.1) < 0.02);
    CHECK(system.on_deactivate(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.run(100, far_away) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - off - 0.1) < 0.02);
    CHECK(manager.switch_to({"joint1/position"}, {"joint1/position"}) == return_type::OK);
    CHECK(manager.run(500, far_away) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/position") - off - 0.5) < 0.02);
    CHECK(manager.switch_to({"joint1/velocity"}, {"joint1/position"}) == return_type::OK);
    CHECK(system.on_deactivate(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.run(100, [&](double) { manager.command("joint1/velocity", 0.5); }) == return_type::OK);
    CHECK(std::abs(manager.state("joint1/velocity")) < 0.01);
    CHECK(manager.switch_to({"joint1/velocity"}, {"joint1/velocity"}) == return_type::OK);

    // What is no number is a fault of the command, not of the machine: the write fails, and the manager makes an end of it.
    CHECK(manager.run(5, [&](double) { manager.command("joint1/velocity", std::nan("")); }) == return_type::ERROR);
    CHECK(system.on_error(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.read(rclcpp::Time(0), rclcpp::Duration(0, 1000000)) == return_type::ERROR);

    // It can be configured anew.
    CHECK(system.on_configure(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_activate(any_state) == CallbackReturn::SUCCESS);
    CHECK(manager.run(50) == return_type::OK);
    CHECK(system.on_deactivate(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_cleanup(any_state) == CallbackReturn::SUCCESS);
    CHECK(system.on_shutdown(any_state) == CallbackReturn::SUCCESS);
    std::puts("the system has lived its life");
    return 0;
}
