// A stand-in: see ../../README.md.
#pragma once
#include <stdexcept>
#include <string>

namespace hardware_interface {

/// A named value of somebody else's.
class ReadOnlyHandle {
public:
    ReadOnlyHandle(const std::string &prefix_name, const std::string &interface_name, double *value_ptr = nullptr)
        : prefix_name_(prefix_name), interface_name_(interface_name), value_ptr_(value_ptr) {}
    explicit ReadOnlyHandle(const std::string &interface_name) : interface_name_(interface_name), value_ptr_(nullptr) {}
    ReadOnlyHandle(const ReadOnlyHandle &) = default;
    ReadOnlyHandle(ReadOnlyHandle &&) = default;
    ReadOnlyHandle &operator=(const ReadOnlyHandle &) = default;
    ReadOnlyHandle &operator=(ReadOnlyHandle &&) = default;
    virtual ~ReadOnlyHandle() = default;

    const std::string get_name() const { return prefix_name_ + "/" + interface_name_; }
    const std::string &get_interface_name() const { return interface_name_; }
    const std::string &get_prefix_name() const { return prefix_name_; }
    double get_value() const {
        if (value_ptr_ == nullptr) throw std::runtime_error(get_name() + " refers to nothing");
        return *value_ptr_;
    }

protected:
    std::string prefix_name_;
    std::string interface_name_;
    double *value_ptr_;
};

class ReadWriteHandle : public ReadOnlyHandle {
public:
    using ReadOnlyHandle::ReadOnlyHandle;
    void set_value(double value) {
        if (value_ptr_ == nullptr) throw std::runtime_error(get_name() + " refers to nothing");
        *value_ptr_ = value;
    }
};

class StateInterface : public ReadOnlyHandle {
public:
    StateInterface(const StateInterface &) = default;
    StateInterface(StateInterface &&) = default;
    using ReadOnlyHandle::ReadOnlyHandle;
};

/// Nobody else may write to what it refers to: it is not copied.
class CommandInterface : public ReadWriteHandle {
public:
    CommandInterface(const CommandInterface &) = delete;
    CommandInterface(CommandInterface &&) = default;
    using ReadWriteHandle::ReadWriteHandle;
};

} // namespace hardware_interface
