// A stand-in: see ../../README.md.
#pragma once
#include <cstdint>

namespace rclcpp {
class Duration {
public:
    Duration(std::int32_t seconds, std::uint32_t nanoseconds) : nanoseconds_(std::int64_t{seconds} * 1000000000 + nanoseconds) {}
    std::int64_t nanoseconds() const { return nanoseconds_; }
    double seconds() const { return static_cast<double>(nanoseconds_) / 1e9; }

private:
    std::int64_t nanoseconds_;
};
} // namespace rclcpp
