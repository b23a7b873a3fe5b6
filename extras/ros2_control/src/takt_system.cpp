// takt's drives as a system of ros2_control. SPDX-License-Identifier: MIT OR Apache-2.0
#include <takt_ros2_control/takt_system.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include <hardware_interface/types/hardware_interface_type_values.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <rclcpp/logger.hpp>
#include <rclcpp/logging.hpp>

namespace takt_ros2_control {

using hardware_interface::HW_IF_EFFORT;
using hardware_interface::HW_IF_POSITION;
using hardware_interface::HW_IF_VELOCITY;
using hardware_interface::return_type;

namespace {

/// The drives are enabled or disabled within this time.
constexpr double patience_s = 30.0;
/// After an activation a position that is no farther from the joint is followed: the defaults of start_tolerance.
constexpr double start_tolerance_rad = 0.02, start_tolerance_m = 0.002;
/// Object 6060 in cyclic synchronous torque (CiA 402).
constexpr int cyclic_synchronous_torque = 10;

bool is_known(const std::string &interface) {
    return interface == HW_IF_POSITION || interface == HW_IF_VELOCITY || interface == HW_IF_EFFORT;
}

} // namespace

void TaktSystem::complain(const std::string &words) const {
    RCLCPP_ERROR(rclcpp::get_logger("takt"), "%s", words.c_str());
}

#if TAKT_ROS2_CONTROL_HANDLES
TaktSystem::CallbackReturn TaktSystem::on_init(const hardware_interface::HardwareComponentInterfaceParams &params) {
    if (SystemInterface::on_init(params) != CallbackReturn::SUCCESS) return CallbackReturn::ERROR;
    return read_tag(info_);
}
#else
TaktSystem::CallbackReturn TaktSystem::on_init(const hardware_interface::HardwareInfo &info) {
    if (SystemInterface::on_init(info) != CallbackReturn::SUCCESS) return CallbackReturn::ERROR;
    return read_tag(info_);
}
#endif

TaktSystem::CallbackReturn TaktSystem::read_tag(const hardware_interface::HardwareInfo &info) {
    const auto parameter = [&](const char *name, const char *otherwise) {
        const auto found = info.hardware_parameters.find(name);
        return found == info.hardware_parameters.end() ? std::string(otherwise) : found->second;
    };
    configuration_ = parameter("configuration", "");
    if (configuration_.empty()) {
        complain("<hardware> needs <param name=\"configuration\">, a file");
        return CallbackReturn::ERROR;
    }
    // Whole, so that a message shows where it was looked for.
    configuration_ = std::filesystem::absolute(configuration_).string();
    const std::string drives = parameter("drives", "configured");
    if (drives == "configured") {
        options_.drives = TAKT_CONFIGURED;
    } else if (drives == "simulated") {
        options_.drives = TAKT_SIMULATED;
    } else if (drives == "virtual") {
        options_.drives = TAKT_VIRTUAL;
    } else {
        complain("<param name=\"drives\"> is \"" + drives + "\"; it is configured, simulated or virtual");
        return CallbackReturn::ERROR;
    }
    const std::string realtime = parameter("realtime", "wanted");
    if (realtime != "wanted" && realtime != "required") {
        complain("<param name=\"realtime\"> is \"" + realtime + "\"; it is wanted or required");
        return CallbackReturn::ERROR;
    }
    options_.is_realtime_required = realtime == "required";
    options_.recording = parameter("recording", "");
    joints_.clear();
    for (const auto &component : info.joints) {
        for (const auto *interfaces : {&component.command_interfaces, &component.state_interfaces}) {
            for (const auto &interface : *interfaces) {
                if (is_known(interface.name)) continue;
                complain(component.name + ": there is no interface \"" + interface.name + "\"; they are position, velocity and effort");
                return CallbackReturn::ERROR;
            }
        }
        Joint joint;
        joint.name = component.name;
        joints_.push_back(joint);
    }
    const std::string limits = parameter("urdf_limits", "checked");
    if (limits != "checked" && limits != "ignored") {
        complain("<param name=\"urdf_limits\"> is \"" + limits + "\"; it is checked or ignored");
        return CallbackReturn::ERROR;
    }
    if (limits == "ignored") return CallbackReturn::SUCCESS;
    const auto fits = takt::check_urdf(configuration_, info.original_xml);
    if (fits) return CallbackReturn::SUCCESS;
    complain(fits.words());
    return CallbackReturn::ERROR;
}

TaktSystem::CallbackReturn TaktSystem::on_configure(const rclcpp_lifecycle::State &) {
    try {
        options_.is_left_disabled = true;
        arm_.emplace(takt::controller::open(configuration_, options_));
    } catch (const takt::error &why) {
        complain(why.what());
        return CallbackReturn::FAILURE;
    }
    if (!find_axes() || !bind()) {
        close();
        return CallbackReturn::FAILURE;
    }
    period_s_ = static_cast<double>(arm_->period_ns()) / 1e9;
    targets_.assign(arm_->size(), takt::target());
    state_ = arm_->state();
    take_state();
    hold_all();
    return CallbackReturn::SUCCESS;
}

bool TaktSystem::find_axes() {
    for (auto &joint : joints_) {
        bool is_found = false;
        for (std::uint32_t axis = 0; axis < arm_->size() && !is_found; axis++) {
            const auto described = arm_->describe(axis);
            is_found = described && joint.name == described->name;
            if (!is_found) continue;
            joint.axis = axis;
            joint.start_tolerance = described->is_linear ? start_tolerance_m : start_tolerance_rad;
        }
        if (is_found) continue;
        std::string known;
        for (std::uint32_t axis = 0; axis < arm_->size(); axis++) known += std::string(axis ? ", " : "") + arm_->describe(axis)->name;
        complain(joint.name + " is no axis of " + configuration_ + "; the axes are: " + known);
        return false;
    }
    return true;
}

TaktSystem::CallbackReturn TaktSystem::on_activate(const rclcpp_lifecycle::State &) {
    if (!arm_) return CallbackReturn::ERROR;
    for (const auto &step : {arm_->enable(), arm_->wait_phase(TAKT_PHASE_HOLDING, patience_s)}) {
        if (step) continue;
        complain(step.words());
        // None of them keeps its power while the system is inactive.
        come_to_rest_and_disable();
        return CallbackReturn::FAILURE;
    }
    state_ = arm_->state();
    take_state();
    hold_all();
    // The first point comes with the next write(). From now on no call of the controller manager waits.
    if (const auto begun = arm_->begin_stream(); !begun) {
        complain(begun.words());
        come_to_rest_and_disable();
        return CallbackReturn::FAILURE;
    }
    is_active_ = true;
    return CallbackReturn::SUCCESS;
}

TaktSystem::CallbackReturn TaktSystem::on_deactivate(const rclcpp_lifecycle::State &) {
    is_active_ = false;
    return come_to_rest_and_disable() ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
}

TaktSystem::CallbackReturn TaktSystem::on_cleanup(const rclcpp_lifecycle::State &) { return close(); }

TaktSystem::CallbackReturn TaktSystem::on_shutdown(const rclcpp_lifecycle::State &) { return close(); }

TaktSystem::CallbackReturn TaktSystem::on_error(const rclcpp_lifecycle::State &) {
    // It can be configured anew, whatever the end of the run has to say.
    close();
    return CallbackReturn::SUCCESS;
}

TaktSystem::CallbackReturn TaktSystem::close() {
    is_active_ = false;
    if (!arm_) return CallbackReturn::SUCCESS;
    const auto closed = arm_->close();
    arm_.reset();
    for (auto &joint : joints_) joint.kind = Kind::hold;
    if (closed) return CallbackReturn::SUCCESS;
    complain(closed.words());
    return CallbackReturn::FAILURE;
}

bool TaktSystem::come_to_rest_and_disable() {
    if (!arm_) return false;
    // It comes to rest first.
    for (const auto &step : {arm_->disable(), arm_->wait_phase(TAKT_PHASE_DISABLED, patience_s)}) {
        if (step) continue;
        complain(step.words());
        return false;
    }
    return true;
}

#if TAKT_ROS2_CONTROL_HANDLES
bool TaktSystem::bind() {
    shown_.clear();
    commanded_.clear();
    try {
        for (std::size_t number = 0; number < joints_.size(); number++) {
            Joint &joint = joints_[number];
            for (const auto &interface : info_.joints[number].state_interfaces)
                shown_.emplace_back(get_state_interface_handle(joint.name + "/" + interface.name), joint.state(interface.name));
            for (const auto &interface : info_.joints[number].command_interfaces)
                commanded_.emplace_back(get_command_interface_handle(joint.name + "/" + interface.name), joint.command(interface.name));
        }
    } catch (const std::exception &why) {
        complain(why.what());
        return false;
    }
    return true;
}

void TaktSystem::show_state() {
    for (const auto &[handle, value] : shown_) static_cast<void>(set_state(handle, *value, false));
}

void TaktSystem::take_commands() {
    for (const auto &[handle, value] : commanded_) static_cast<void>(get_command(handle, *value, false));
}

void TaktSystem::show_commands() {
    for (const auto &[handle, value] : commanded_) static_cast<void>(set_command(handle, *value, true));
}
#else
bool TaktSystem::bind() { return true; }
void TaktSystem::show_state() {}
void TaktSystem::take_commands() {}
void TaktSystem::show_commands() {}

std::vector<hardware_interface::StateInterface> TaktSystem::export_state_interfaces() {
    std::vector<hardware_interface::StateInterface> exported;
    for (std::size_t number = 0; number < joints_.size(); number++) {
        Joint &joint = joints_[number];
        for (const auto &interface : info_.joints[number].state_interfaces) {
            exported.emplace_back(joint.name, interface.name, joint.state(interface.name));
        }
    }
    return exported;
}

std::vector<hardware_interface::CommandInterface> TaktSystem::export_command_interfaces() {
    std::vector<hardware_interface::CommandInterface> exported;
    for (std::size_t number = 0; number < joints_.size(); number++) {
        Joint &joint = joints_[number];
        for (const auto &interface : info_.joints[number].command_interfaces) {
            exported.emplace_back(joint.name, interface.name, joint.command(interface.name));
        }
    }
    return exported;
}
#endif

double *TaktSystem::Joint::state(const std::string &interface) {
    return interface == HW_IF_POSITION ? &position : interface == HW_IF_VELOCITY ? &velocity : &effort;
}

double *TaktSystem::Joint::command(const std::string &interface) {
    return interface == HW_IF_POSITION ? &position_command : interface == HW_IF_VELOCITY ? &velocity_command : &effort_command;
}

bool TaktSystem::Joint::is_commanded_nearby() const {
    // Where it is held exactly, the command may be the one that hold_all() has shown.
    return kind == Kind::position && position_command != held && std::abs(position_command - held) <= start_tolerance;
}

bool TaktSystem::Joint::has(const std::string &key, const char *interface) const {
    return key.size() > name.size() && key[name.size()] == '/' && key.compare(0, name.size(), name) == 0 &&
           key.compare(name.size() + 1, std::string::npos, interface) == 0;
}

std::optional<TaktSystem::Kind> TaktSystem::kind_after(
    const Joint &joint, const std::vector<std::string> &start, const std::vector<std::string> &stop) const {
    const std::pair<const char *, Kind> known[] = {
        {HW_IF_POSITION, Kind::position}, {HW_IF_VELOCITY, Kind::velocity}, {HW_IF_EFFORT, Kind::effort}};
    Kind kind = joint.kind;
    for (const auto &key : stop)
        for (const auto &[interface, of] : known)
            if (joint.has(key, interface) && kind == of) kind = Kind::hold;
    for (const auto &key : start) {
        for (const auto &[interface, of] : known) {
            if (!joint.has(key, interface)) continue;
            if (kind != Kind::hold && kind != of) {
                complain(joint.name + ": two command interfaces are claimed at once");
                return std::nullopt;
            }
            kind = of;
        }
    }
    if (kind == Kind::effort && state_[joint.axis].mode_set != cyclic_synchronous_torque) {
        complain(joint.name + ": an effort needs mode = \"cst\" in the configuration");
        return std::nullopt;
    }
    return kind;
}

bool TaktSystem::is_claimed(const Joint &joint, const std::vector<std::string> &start) {
    return std::any_of(start.begin(), start.end(), [&](const std::string &key) {
        return joint.has(key, HW_IF_POSITION) || joint.has(key, HW_IF_VELOCITY) || joint.has(key, HW_IF_EFFORT);
    });
}

bool TaktSystem::can_switch(const std::vector<std::string> &start, const std::vector<std::string> &stop) const {
    return std::all_of(joints_.begin(), joints_.end(), [&](const Joint &joint) { return kind_after(joint, start, stop).has_value(); });
}

return_type TaktSystem::prepare_command_mode_switch(const std::vector<std::string> &start, const std::vector<std::string> &stop) {
    return !arm_ || can_switch(start, stop) ? return_type::OK : return_type::ERROR;
}

return_type TaktSystem::perform_command_mode_switch(const std::vector<std::string> &start, const std::vector<std::string> &stop) {
    if (!arm_) return return_type::OK;
    take_commands();
    if (!can_switch(start, stop)) return return_type::ERROR;
    for (Joint &joint : joints_) {
        const Kind kind = kind_after(joint, start, stop).value_or(joint.kind);
        if (joint.kind == kind && (joint.is_followed || !is_claimed(joint, start))) continue;
        joint.kind = kind;
        joint.is_followed = true;
        // It goes on from where it is, whatever the interface was last used for.
        const auto &axis = state_[joint.axis];
        joint.held = joint.position_command = axis.position_set;
        joint.velocity_command = 0.0;
        joint.effort_command = axis.torque_set;
    }
    show_commands();
    return return_type::OK;
}

return_type TaktSystem::read(const rclcpp::Time &, const rclcpp::Duration &period) {
    if (!arm_) return return_type::ERROR;
    if (options_.drives == TAKT_VIRTUAL) {
        const auto cycles = static_cast<std::uint64_t>(std::max(std::llround(period.seconds() / period_s_), 0LL));
        if (const auto passed = cycles == 0 ? takt::result() : arm_->advance(cycles); !passed) {
            complain(passed.words());
            return return_type::ERROR;
        }
    }
    if (const auto seen = arm_->read_state(state_); !seen) {
        complain(seen.words());
        return return_type::ERROR;
    }
    take_state();
    for (const auto &group : state_.groups()) {
        if (is_active_ && group.is_faulted) {
            complain(std::string("takt has stopped the arm: ") + group.stop_rule);
            return return_type::ERROR;
        }
    }
    return return_type::OK;
}

return_type TaktSystem::write(const rclcpp::Time &, const rclcpp::Duration &) {
    if (!is_active_) return return_type::OK;
    take_commands();
    for (auto &joint : joints_) {
        takt::target &target = targets_[joint.axis];
        joint.is_followed = joint.is_followed || joint.is_commanded_nearby();
        switch (joint.is_followed ? joint.kind : Kind::hold) {
        case Kind::hold: target = takt::target::position(joint.held); break;
        case Kind::position: target = takt::target::position(joint.position_command); break;
        case Kind::velocity: target = takt::target::velocity(joint.velocity_command); break;
        case Kind::effort: target = takt::target::torque(joint.effort_command); break;
        }
    }
    const auto pushed = arm_->push_now(targets_);
    // A point that finds no room is lost, and counted: the next one comes soon.
    if (pushed || pushed.code() == TAKT_ERROR_FULL) return return_type::OK;
    complain(pushed.words());
    return return_type::ERROR;
}

void TaktSystem::take_state() {
    for (auto &joint : joints_) {
        const auto &axis = state_[joint.axis];
        joint.position = axis.position;
        joint.velocity = axis.velocity;
        joint.effort = axis.torque;
    }
    show_state();
}

void TaktSystem::hold_all() {
    for (std::size_t axis = 0; axis < targets_.size(); axis++) targets_[axis] = takt::target::position(state_[axis].position_set);
    for (auto &joint : joints_) {
        joint.held = joint.position_command = state_[joint.axis].position_set;
        joint.velocity_command = 0.0;
        joint.effort_command = 0.0;
        joint.is_followed = false;
    }
    show_commands();
}

} // namespace takt_ros2_control

PLUGINLIB_EXPORT_CLASS(takt_ros2_control::TaktSystem, hardware_interface::SystemInterface)
