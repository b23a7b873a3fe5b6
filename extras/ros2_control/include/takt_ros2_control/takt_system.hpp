// takt's drives as a system of ros2_control. SPDX-License-Identifier: MIT OR Apache-2.0
#ifndef TAKT_ROS2_CONTROL__TAKT_SYSTEM_HPP_
#define TAKT_ROS2_CONTROL__TAKT_SYSTEM_HPP_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <hardware_interface/handle.hpp>
#include <hardware_interface/hardware_info.hpp>
#include <hardware_interface/system_interface.hpp>
#include <hardware_interface/types/hardware_interface_return_values.hpp>
#include <rclcpp/duration.hpp>
#include <rclcpp/time.hpp>
#include <rclcpp_lifecycle/state.hpp>

#include <takt.hpp>

// Jazzy from 4.40 on, Kilted from 5.9 and Rolling from 6.1: the framework makes the handles of the interfaces. Humble, and the first releases of
// Jazzy: the component exports pointers to its values.
#if __has_include(<hardware_interface/types/hardware_component_interface_params.hpp>)
#define TAKT_ROS2_CONTROL_HANDLES 1
#include <hardware_interface/types/hardware_component_interface_params.hpp>
#else
#define TAKT_ROS2_CONTROL_HANDLES 0
#endif

namespace takt_ros2_control {

/// The drives of a takt configuration. takt has a real-time thread of its own, which keeps every limit: the controller manager may be late,
/// and its rate need not be that of the bus. write() stamps its points, read() never waits for a drive.
///
/// Parameters of <hardware>: `configuration`, a file; `drives`, "configured" (the default), "simulated", or "virtual": simulated in virtual
/// time, of which each read() lets its period pass; `realtime`, "wanted" (the default) or "required"; `recording`, a folder; `urdf_limits`,
/// "checked" (the default) or "ignored". The joints are named as the axes of the
/// configuration. An axis that is no joint holds.
class TaktSystem : public hardware_interface::SystemInterface {
public:
    using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

    /// Reads the tag: parameters, joints and their interfaces. Refuses a configuration that allows more than the joints of the URDF.
#if TAKT_ROS2_CONTROL_HANDLES
    CallbackReturn on_init(const hardware_interface::HardwareComponentInterfaceParams &params) override;
#else
    CallbackReturn on_init(const hardware_interface::HardwareInfo &info) override;
#endif
    /// Opens the buses and brings the drives up. They report their positions, and stay disabled.
    CallbackReturn on_configure(const rclcpp_lifecycle::State &previous) override;
    /// Enables the drives. The joints hold until a controller claims them.
    CallbackReturn on_activate(const rclcpp_lifecycle::State &previous) override;
    /// Brings the joints to rest and disables the drives.
    CallbackReturn on_deactivate(const rclcpp_lifecycle::State &previous) override;
    /// Shuts the drives down.
    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_shutdown(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_error(const rclcpp_lifecycle::State &previous) override;

#if !TAKT_ROS2_CONTROL_HANDLES
    std::vector<hardware_interface::StateInterface> export_state_interfaces() override;
    std::vector<hardware_interface::CommandInterface> export_command_interfaces() override;
#endif

    /// Refuses two interfaces of one joint at a time, and efforts of a joint that is not in cyclic synchronous torque.
    hardware_interface::return_type prepare_command_mode_switch(
        const std::vector<std::string> &start, const std::vector<std::string> &stop) override;
    /// Waits for nothing: the next write() is of the new kind.
    hardware_interface::return_type perform_command_mode_switch(
        const std::vector<std::string> &start, const std::vector<std::string> &stop) override;

    hardware_interface::return_type read(const rclcpp::Time &time, const rclcpp::Duration &period) override;
    hardware_interface::return_type write(const rclcpp::Time &time, const rclcpp::Duration &period) override;

private:
    enum class Kind { hold, position, velocity, effort };

    struct Joint {
        std::string name;
        /// The axis in the configuration.
        std::size_t axis = 0;
        Kind kind = Kind::hold;
        double position = 0.0, velocity = 0.0, effort = 0.0;
        double position_command = 0.0, velocity_command = 0.0, effort_command = 0.0;
        /// Where it stays while it is not claimed, or not followed.
        double held = 0.0;
        /// How near to it a command of a controller that stayed active must be: rad (m).
        double start_tolerance = 0.0;
        /// False from an activation on, until the joint is claimed anew or its command is a position near the joint: a controller that stayed
        /// active has the command of before.
        bool is_followed = false;

        /// True if a controller commands a position near the one that is held.
        bool is_commanded_nearby() const;
        /// Whether a key, as in joint1/velocity, is an interface of this joint.
        bool has(const std::string &key, const char *interface) const;
        /// What a state interface or a command interface of this name is about.
        double *state(const std::string &interface);
        double *command(const std::string &interface);
    };

    CallbackReturn read_tag(const hardware_interface::HardwareInfo &info);
    bool find_axes();
    /// Takes the handles that the framework has made.
    bool bind();
    /// Shows what was read, and takes what is commanded; a value that somebody else is at stays as it is until the next cycle.
    void show_state();
    void take_commands();
    /// Shows what a joint begins at, so that no command of an earlier time is followed.
    void show_commands();
    /// The kind of a joint after a switch; none if it is not possible, with the reason in the log. It allocates only for that.
    std::optional<Kind> kind_after(const Joint &joint, const std::vector<std::string> &start, const std::vector<std::string> &stop) const;
    /// Whether a switch claims an interface of a joint.
    static bool is_claimed(const Joint &joint, const std::vector<std::string> &start);
    bool can_switch(const std::vector<std::string> &start, const std::vector<std::string> &stop) const;
    void take_state();
    void hold_all();
    bool come_to_rest_and_disable();
    CallbackReturn close();
    void complain(const std::string &words) const;

    std::string configuration_;
    takt::options options_;
    std::vector<Joint> joints_;
    std::optional<takt::controller> arm_;
    takt::state state_;
    /// One for each axis of the configuration. It is as long as it will be before the drives are enabled.
    std::vector<takt::target> targets_;
    double period_s_ = 0.001;
    bool is_active_ = false;
#if TAKT_ROS2_CONTROL_HANDLES
    /// Each handle, with the value of a joint that it shows or commands.
    std::vector<std::pair<hardware_interface::StateInterface::SharedPtr, const double *>> shown_;
    std::vector<std::pair<hardware_interface::CommandInterface::SharedPtr, double *>> commanded_;
#endif
};

} // namespace takt_ros2_control

#endif
