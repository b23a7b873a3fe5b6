// Calls of takt.hpp and of the system of ros2_control, for `benches/instructions`, which compiles it: how many instructions each takes.
//
//   cpp_instructions WORK REPETITIONS
//
// The handles of ros2_control are those of the stand-in, which lock and look as those of Rolling do.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <hardware_interface/types/hardware_component_interface_params.hpp>
#include <takt.hpp>
#include <takt_ros2_control/takt_system.hpp>

namespace {

constexpr std::size_t axes = 6;
const char *const configuration = "configs/arm6-erob.toml";

void check(bool is_so, const char *what) {
    if (is_so) return;
    std::fprintf(stderr, "cpp_instructions: %s: %s\n", what, takt_last_error_text());
    std::exit(1);
}

bool in_cpp(const std::string &work, std::uint64_t repetitions) {
    takt::options options;
    options.drives = TAKT_VIRTUAL;
    const auto arm = takt::controller::open(configuration, options);
    const std::vector<double> positions(axes, 0.1);
    const std::vector<takt::target> targets(axes, takt::target::position(0.1));
    takt::state state;
    const auto repeat = [&](auto call) {
        for (std::uint64_t stamp_ns = 0; stamp_ns < repetitions; stamp_ns++) check(call(stamp_ns), work.c_str());
    };
    if (work == "cpp-state-6") repeat([&](std::uint64_t) { return arm.state().slot() > 0; });
    else if (work == "cpp-read-state-6") repeat([&](std::uint64_t) { return bool(arm.read_state(state)); });
    // No cycle takes them: there is room for 256.
    else if (work == "cpp-push-positions-6") repeat([&](std::uint64_t stamp_ns) { return bool(arm.push_at(stamp_ns, positions)); });
    else if (work == "cpp-push-targets-6") repeat([&](std::uint64_t stamp_ns) { return bool(arm.push_at(stamp_ns, targets)); });
    else if (work == "cpp-stop") repeat([&](std::uint64_t) { return arm.stop() == TAKT_OK; });
    else return false;
    // Without an end: the process is measured, and ends here.
    std::_Exit(0);
}

hardware_interface::HardwareComponentInterfaceParams tag() {
    hardware_interface::HardwareComponentInterfaceParams params;
    auto &info = params.hardware_info;
    info.hardware_parameters = {{"configuration", configuration}, {"drives", "virtual"}, {"urdf_limits", "ignored"}};
    for (std::size_t axis = 1; axis <= axes; axis++) {
        hardware_interface::ComponentInfo joint{};
        joint.name = "joint" + std::to_string(axis);
        for (const char *name : {"position", "velocity", "effort"}) {
            hardware_interface::InterfaceInfo shown{};
            shown.name = name;
            joint.state_interfaces.push_back(shown);
        }
        joint.command_interfaces = {joint.state_interfaces.front()};
        info.joints.push_back(joint);
    }
    return params;
}

bool in_ros2_control(const std::string &work, std::uint64_t repetitions) {
    using hardware_interface::CallbackReturn;
    using hardware_interface::return_type;
    const rclcpp_lifecycle::State any(1, "unconfigured");
    takt_ros2_control::TaktSystem system;
    check(system.on_init(tag()) == CallbackReturn::SUCCESS, "on_init");
    const auto shown = system.on_export_state_interfaces();
    const auto commanded = system.on_export_command_interfaces();
    check(system.on_configure(any) == CallbackReturn::SUCCESS, "on_configure");
    check(system.on_activate(any) == CallbackReturn::SUCCESS, "on_activate");
    std::vector<std::string> claimed;
    for (const auto &interface : commanded) claimed.push_back(interface->get_name());
    check(system.perform_command_mode_switch(claimed, {}) == return_type::OK, "perform_command_mode_switch");
    // No time passes, so that no cycle is counted.
    const rclcpp::Duration none(0, 0);
    const auto repeat = [&](auto call) {
        for (std::uint64_t repetition = 0; repetition < repetitions; repetition++) check(call() == return_type::OK, work.c_str());
    };
    if (work == "ros2-read-6") repeat([&] { return system.read(rclcpp::Time(0), none); });
    else if (work == "ros2-write-6") repeat([&] { return system.write(rclcpp::Time(0), none); });
    else return false;
    std::_Exit(0);
}

} // namespace

int main(int count, char **arguments) {
    const std::string work = count > 1 ? arguments[1] : "";
    const std::uint64_t repetitions = count > 2 ? std::strtoull(arguments[2], nullptr, 10) : 1;
    (void)(work.rfind("ros2-", 0) == 0 ? in_ros2_control(work, repetitions) : in_cpp(work, repetitions));
    std::fprintf(stderr, "cpp_instructions: there is no work \"%s\"\n", work.c_str());
    return 2;
}
