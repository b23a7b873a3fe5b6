// A stand-in: see ../../README.md.
#pragma once
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <string>

#include <hardware_interface/hardware_info.hpp>

namespace hardware_interface {

/// A named value that others may read and write at any time. Those who do not wait get or set it unless somebody else is at it.
class Handle {
public:
    explicit Handle(const InterfaceDescription &description) : handle_name_(description.get_name()) {}
    Handle(const Handle &) = delete;
    virtual ~Handle() = default;

    const std::string &get_name() const { return handle_name_; }
    template <typename T = double>
    [[nodiscard]] std::optional<T> get_optional() const {
        T value;
        return get_value(value, false) ? std::optional<T>(value) : std::nullopt;
    }
    template <typename T>
    [[nodiscard]] bool get_value(T &value, bool wait_for_lock) const {
        std::shared_lock<std::shared_mutex> lock(handle_mutex_, std::defer_lock);
        if (wait_for_lock) lock.lock();
        else if (!lock.try_lock()) return false;
        value = value_;
        return true;
    }
    template <typename T>
    [[nodiscard]] bool set_value(const T &value, bool wait_for_lock) {
        std::unique_lock<std::shared_mutex> lock(handle_mutex_, std::defer_lock);
        if (wait_for_lock) lock.lock();
        else if (!lock.try_lock()) return false;
        value_ = value;
        return true;
    }
    /// Of the stand-in alone: somebody else is at it.
    std::unique_lock<std::shared_mutex> held() const { return std::unique_lock<std::shared_mutex>(handle_mutex_); }

protected:
    std::string handle_name_;
    double value_ = std::numeric_limits<double>::quiet_NaN();
    mutable std::shared_mutex handle_mutex_;
};

class StateInterface : public Handle {
public:
    using Handle::Handle;
    using SharedPtr = std::shared_ptr<StateInterface>;
    using ConstSharedPtr = std::shared_ptr<const StateInterface>;
};

class CommandInterface : public Handle {
public:
    using Handle::Handle;
    using SharedPtr = std::shared_ptr<CommandInterface>;
};

} // namespace hardware_interface
