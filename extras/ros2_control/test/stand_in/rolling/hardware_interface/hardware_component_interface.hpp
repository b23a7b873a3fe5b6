// A stand-in: see ../../README.md. The handles are made of the tag, as the framework does it when a component exports none itself.
#pragma once
#include <memory>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include <hardware_interface/handle.hpp>
#include <hardware_interface/hardware_info.hpp>
#include <hardware_interface/types/hardware_component_interface_params.hpp>
#include <hardware_interface/types/hardware_interface_return_values.hpp>
#include <rclcpp/duration.hpp>
#include <rclcpp/logger.hpp>
#include <rclcpp/time.hpp>
#include <rclcpp_lifecycle/node_interfaces/lifecycle_node_interface.hpp>

namespace hardware_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

class HardwareComponentInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
public:
    HardwareComponentInterface() = default;
    HardwareComponentInterface(const HardwareComponentInterface &) = delete;
    HardwareComponentInterface(HardwareComponentInterface &&) = delete;

    virtual CallbackReturn on_init(const HardwareComponentInterfaceParams &params) {
        info_ = params.hardware_info;
        return CallbackReturn::SUCCESS;
    }
    virtual std::vector<StateInterface::ConstSharedPtr> on_export_state_interfaces() {
        std::vector<StateInterface::ConstSharedPtr> exported;
        for (const auto &joint : info_.joints)
            for (const auto &info : joint.state_interfaces) {
                auto made = std::make_shared<StateInterface>(InterfaceDescription(joint.name, info));
                states_[made->get_name()] = made;
                exported.push_back(made);
            }
        return exported;
    }
    virtual std::vector<CommandInterface::SharedPtr> on_export_command_interfaces() {
        std::vector<CommandInterface::SharedPtr> exported;
        for (const auto &joint : info_.joints)
            for (const auto &info : joint.command_interfaces) {
                auto made = std::make_shared<CommandInterface>(InterfaceDescription(joint.name, info));
                commands_[made->get_name()] = made;
                exported.push_back(made);
            }
        return exported;
    }
    virtual return_type prepare_command_mode_switch(const std::vector<std::string> &, const std::vector<std::string> &) {
        return return_type::OK;
    }
    virtual return_type perform_command_mode_switch(const std::vector<std::string> &, const std::vector<std::string> &) {
        return return_type::OK;
    }
    virtual return_type read(const rclcpp::Time &time, const rclcpp::Duration &period) = 0;
    virtual return_type write(const rclcpp::Time &time, const rclcpp::Duration &period) = 0;

    virtual const StateInterface::SharedPtr &get_state_interface_handle(const std::string &interface_name) const {
        const auto found = states_.find(interface_name);
        if (found == states_.end()) throw std::runtime_error("no state interface " + interface_name);
        return found->second;
    }
    virtual const CommandInterface::SharedPtr &get_command_interface_handle(const std::string &interface_name) const {
        const auto found = commands_.find(interface_name);
        if (found == commands_.end()) throw std::runtime_error("no command interface " + interface_name);
        return found->second;
    }
    template <typename T>
    bool set_state(const StateInterface::SharedPtr &handle, const T &value, bool wait_until_set) {
        return handle->set_value(value, wait_until_set);
    }
    template <typename T>
    bool set_command(const CommandInterface::SharedPtr &handle, const T &value, bool wait_until_set) {
        return handle->set_value(value, wait_until_set);
    }
    template <typename T>
    bool get_command(const CommandInterface::SharedPtr &handle, T &command, bool wait_until_get) const {
        return handle->get_value(command, wait_until_get);
    }
    virtual rclcpp::Logger get_logger() const { return rclcpp::get_logger("resource_manager.hardware_component"); }

protected:
    HardwareInfo info_;

private:
    std::unordered_map<std::string, StateInterface::SharedPtr> states_;
    std::unordered_map<std::string, CommandInterface::SharedPtr> commands_;
};

} // namespace hardware_interface
