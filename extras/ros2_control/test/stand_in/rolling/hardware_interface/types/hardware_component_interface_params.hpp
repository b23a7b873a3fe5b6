// A stand-in: see ../../../README.md.
#pragma once
#include <hardware_interface/hardware_info.hpp>

namespace hardware_interface {
struct HardwareComponentInterfaceParams {
    HardwareComponentInterfaceParams() = default;
    hardware_interface::HardwareInfo hardware_info;
};
} // namespace hardware_interface
