// A stand-in: see ../README.md.
#pragma once
#include <stdexcept>
#include <string>
#include <utility>

namespace hardware_interface {

/// A named value of somebody else's.
class Handle {
public:
    Handle(const std::string &prefix_name, const std::string &interface_name, double *value = nullptr)
        : prefix_name_(prefix_name), interface_name_(interface_name), name_(prefix_name + "/" + interface_name), value_(value) {}
    Handle(const Handle &) = default;
    Handle(Handle &&) = default;
    Handle &operator=(const Handle &) = default;
    Handle &operator=(Handle &&) = default;
    virtual ~Handle() = default;

    const std::string &get_name() const { return name_; }
    const std::string &get_interface_name() const { return interface_name_; }
    const std::string &get_prefix_name() const { return prefix_name_; }
    double get_value() const {
        if (value_ == nullptr) throw std::runtime_error(name_ + " refers to nothing");
        return *value_;
    }
    void set_value(double value) {
        if (value_ == nullptr) throw std::runtime_error(name_ + " refers to nothing");
        *value_ = value;
    }

protected:
    std::string prefix_name_, interface_name_, name_;
    double *value_;
};

class StateInterface : public Handle {
public:
    using Handle::Handle;
};

/// Nobody else may write to what it refers to: it is not copied.
class CommandInterface : public Handle {
public:
    using Handle::Handle;
    CommandInterface(const CommandInterface &) = delete;
    CommandInterface(CommandInterface &&) = default;
};

} // namespace hardware_interface
