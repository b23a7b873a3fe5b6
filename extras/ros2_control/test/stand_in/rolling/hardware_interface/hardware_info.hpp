// A stand-in: see ../../README.md.
#pragma once
#include <string>
#include <unordered_map>
#include <vector>

namespace hardware_interface {

struct InterfaceInfo {
    std::string name;
    std::string min = "";
    std::string max = "";
    std::string initial_value = "";
    std::string data_type = "double";
    int size;
    std::unordered_map<std::string, std::string> parameters;
    bool enable_limits;
};

struct ComponentInfo {
    std::string name;
    std::string type;
    bool enable_limits = true;
    std::vector<InterfaceInfo> command_interfaces;
    std::vector<InterfaceInfo> state_interfaces;
    std::unordered_map<std::string, std::string> parameters;
};

struct InterfaceDescription {
    InterfaceDescription(const std::string &prefix_name_in, const InterfaceInfo &interface_info_in)
        : prefix_name(prefix_name_in), interface_info(interface_info_in), interface_name(prefix_name + "/" + interface_info.name) {}
    std::string prefix_name;
    InterfaceInfo interface_info;
    std::string interface_name;
    const std::string &get_name() const { return interface_name; }
};

struct HardwareInfo {
    std::string name;
    std::string type;
    std::string group;
    unsigned int rw_rate;
    bool is_async;
    std::string hardware_plugin_name;
    std::unordered_map<std::string, std::string> hardware_parameters;
    std::vector<ComponentInfo> joints;
    std::vector<ComponentInfo> sensors;
    std::vector<ComponentInfo> gpios;
    std::string original_xml;
};

} // namespace hardware_interface
