// A stand-in: see ../../README.md.
#pragma once
#include <cstdint>

namespace rclcpp {
class Time {
public:
    explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
    std::int64_t nanoseconds() const { return nanoseconds_; }
    double seconds() const { return static_cast<double>(nanoseconds_) / 1e9; }

private:
    std::int64_t nanoseconds_;
};
} // namespace rclcpp
