// A controller manager in small, for programs that lead a TaktSystem: it reads the tag of a URDF, and has the order of calls of ros2_control:
// read, update, write; switches between the cycles.
#pragma once
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <hardware_interface/system_interface.hpp>
#include <pluginlib/class_list_macros.hpp>
#if __has_include(<hardware_interface/types/hardware_component_interface_params.hpp>)
#define HANDLES 1
#include <hardware_interface/types/hardware_component_interface_params.hpp>
#else
#define HANDLES 0
#endif

namespace pluginlib_stand_in {
template <>
std::unique_ptr<hardware_interface::SystemInterface> make<hardware_interface::SystemInterface>();
}

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

#define CHECK(what)                                                                  \
    do {                                                                             \
        if (!(what)) {                                                               \
            std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #what);          \
            std::exit(1);                                                            \
        }                                                                            \
    } while (0)

namespace {

const rclcpp_lifecycle::State any_state(1, "unconfigured");

/// What component_parser makes of the tag, as far as this tag goes.
hardware_interface::HardwareInfo parsed(const std::string &path) {
    std::ifstream file(path);
    CHECK(file.good());
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    hardware_interface::HardwareInfo info{};
    info.type = "system";
    info.original_xml = text;
    bool is_in_tag = false;
    for (std::size_t begin = text.find('<'); begin != std::string::npos; begin = text.find('<', begin + 1)) {
        const std::size_t end = text.find('>', begin), next = text.find('<', begin + 1);
        const std::string element = text.substr(begin + 1, end - begin - 1);
        const std::string tag = element.substr(0, element.find_first_of(" /"));
        const std::size_t named = element.find("name=\"");
        const std::string name = named == std::string::npos ? "" : element.substr(named + 6, element.find('"', named + 6) - named - 6);
        const std::string content = next == std::string::npos ? "" : text.substr(end + 1, next - end - 1);
        if (tag == "ros2_control" || tag == "/ros2_control") is_in_tag = tag == "ros2_control";
        if (!is_in_tag) continue;
        if (tag == "plugin") CHECK(content == "takt_ros2_control/TaktSystem");
        if (tag == "param") info.hardware_parameters[name] = content;
        if (tag == "joint") {
            info.joints.emplace_back();
            info.joints.back().name = name;
            info.joints.back().type = "joint";
        }
        hardware_interface::InterfaceInfo interface{};
        interface.name = name;
        if (tag == "command_interface") info.joints.back().command_interfaces.push_back(interface);
        if (tag == "state_interface") info.joints.back().state_interfaces.push_back(interface);
    }
    return info;
}

struct Manager {
    std::unique_ptr<hardware_interface::SystemInterface> system = pluginlib_stand_in::make<hardware_interface::SystemInterface>();
#if HANDLES
    std::vector<hardware_interface::StateInterface::ConstSharedPtr> states{};
    std::vector<hardware_interface::CommandInterface::SharedPtr> commands{};
    static const hardware_interface::StateInterface &of(const hardware_interface::StateInterface::ConstSharedPtr &it) { return *it; }
    static hardware_interface::CommandInterface &of(const hardware_interface::CommandInterface::SharedPtr &it) { return *it; }
    static double value(const hardware_interface::StateInterface &interface) { return interface.get_optional().value(); }
    static void set(hardware_interface::CommandInterface &interface, double value) { CHECK(interface.set_value(value, true)); }
    void take_interfaces() {
        states = system->on_export_state_interfaces();
        commands = system->on_export_command_interfaces();
    }
    CallbackReturn init(const hardware_interface::HardwareInfo &info) const {
        hardware_interface::HardwareComponentInterfaceParams params;
        params.hardware_info = info;
        return system->on_init(params);
    }
#else
    std::vector<hardware_interface::StateInterface> states{};
    std::vector<hardware_interface::CommandInterface> commands{};
    template <class T>
    static T &of(T &it) { return it; }
    static double value(const hardware_interface::StateInterface &interface) { return interface.get_value(); }
    static void set(hardware_interface::CommandInterface &interface, double value) { interface.set_value(value); }
    void take_interfaces() {
        states = system->export_state_interfaces();
        commands = system->export_command_interfaces();
    }
    CallbackReturn init(const hardware_interface::HardwareInfo &info) const { return system->on_init(info); }
#endif
    std::int64_t now_ns = 0;

    double state(const std::string &name) const {
        for (const auto &interface : states)
            if (of(interface).get_name() == name) return value(of(interface));
        std::fprintf(stderr, "there is no state %s\n", name.c_str());
        std::exit(1);
    }
    void command(const std::string &name, double value) {
        for (auto &interface : commands)
            if (of(interface).get_name() == name) return set(of(interface), value);
        std::fprintf(stderr, "there is no command %s\n", name.c_str());
        std::exit(1);
    }
    /// Cycles of 4 ms: the controller manager is four times slower than the bus.
    template <class F>
    return_type run(int cycles, F update) {
        const rclcpp::Duration period(0, 4000000);
        for (int cycle = 0; cycle < cycles; cycle++) {
            now_ns += period.nanoseconds();
            const rclcpp::Time now(now_ns);
            if (return_type read = system->read(now, period); read != return_type::OK) return read;
            update(cycle * period.seconds());
            if (return_type written = system->write(now, period); written != return_type::OK) return written;
        }
        return return_type::OK;
    }
    return_type run(int cycles) {
        return run(cycles, [](double) {});
    }
    return_type switch_to(const std::vector<std::string> &start, const std::vector<std::string> &stop) {
        if (system->prepare_command_mode_switch(start, stop) != return_type::OK) return return_type::ERROR;
        return system->perform_command_mode_switch(start, stop);
    }
};

hardware_interface::HardwareInfo with(hardware_interface::HardwareInfo info, const char *name, const std::string &value) {
    info.hardware_parameters[name] = value;
    return info;
}

} // namespace
