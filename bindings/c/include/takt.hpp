/* takt for C++17: a thin wrapper of takt.h. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A controller, a group, an observer of events and a callback close themselves. To open one throws takt::error when it fails; everything
 * after that returns a result, so that nothing is thrown while an arm moves. takt.h says of every call what it does, its units, from which
 * thread it may be called, and whether it blocks: the names are the same.
 */
#ifndef TAKT_HPP
#define TAKT_HPP

#include <takt.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace takt {

inline constexpr double forever = std::numeric_limits<double>::infinity();

/// A view of values that are somebody else's.
template <class T>
class span {
public:
    constexpr span() noexcept = default;
    constexpr span(T *data, std::size_t size) noexcept : data_(data), size_(size) {}
    template <std::size_t N>
    constexpr span(T (&array)[N]) noexcept : data_(array), size_(N) {}
    /// Anything with data() and size(): std::vector, std::array …
    template <class C, class = std::enable_if_t<std::is_convertible_v<decltype(std::declval<C &>().data()), T *>>>
    constexpr span(C &&container) noexcept : data_(container.data()), size_(container.size()) {}
    /// For an argument: move_to({0.1, 0.2}). The values live as long as the call.
    template <class U = T, class = std::enable_if_t<std::is_const_v<U>>>
    constexpr span(std::initializer_list<std::remove_const_t<T>> list) noexcept : size_(list.size()) {
        data_ = list.begin();
    }

    constexpr T *data() const noexcept { return data_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T *begin() const noexcept { return data_; }
    constexpr T *end() const noexcept { return data_ + size_; }
    constexpr T &operator[](std::size_t index) const noexcept { return data_[index]; }

private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

/// Why a call has failed.
struct failure {
    takt_result code = TAKT_OK;
    int point = -1;                                          ///< of a trajectory or a chunk; -1 for none
    int axis = -1;                                           ///< as the call counts them; -1 for none
    double value = std::numeric_limits<double>::quiet_NaN(); ///< beyond `limit`
    double limit = std::numeric_limits<double>::quiet_NaN();
    std::string words;

    /// The last one of this thread.
    static failure last(takt_result code) {
        takt_error error{};
        error.size = sizeof error;
        takt_last_error(&error);
        return {code, error.point, error.axis, error.value, error.limit, takt_last_error_text()};
    }
};

/// Thrown when a controller, a group or an observer cannot be opened, and nowhere else.
class error : public std::runtime_error {
public:
    explicit error(failure why) : std::runtime_error(why.words), why_(std::move(why)) {}
    const failure &why() const noexcept { return why_; }

private:
    failure why_;
};

/// Done, or why not.
class [[nodiscard]] result {
public:
    result() = default;
    explicit result(takt_result code) : code_(code) {
        if (code < TAKT_OK) why_ = std::make_unique<failure>(failure::last(code));
    }
    explicit operator bool() const noexcept { return code_ >= TAKT_OK; }
    takt_result code() const noexcept { return code_; }
    /// Why it has failed; of one that has not, it is empty.
    const failure &why() const {
        static const failure none{};
        return why_ ? *why_ : none;
    }
    const std::string &words() const { return why().words; }
    /// For those who want an exception after all.
    void or_throw() const {
        if (why_) throw error(*why_);
    }

private:
    takt_result code_ = TAKT_OK;
    std::unique_ptr<failure> why_;
};

/// A value, or why there is none.
template <class T>
class [[nodiscard]] result_of : public result {
public:
    result_of(takt_result code, T value) : result(code), value_(std::move(value)) {}
    /// The value; of a call that has failed, an empty one.
    const T &operator*() const noexcept { return value_; }
    const T *operator->() const noexcept { return &value_; }
    /// The value, or takt::error.
    T &&or_throw() && {
        result::or_throw();
        return std::move(value_);
    }

private:
    T value_;
};

/// The state after a cycle.
class state {
public:
    state() { raw.size = sizeof raw; }
    std::uint64_t slot() const noexcept { return raw.slot; }
    std::uint64_t at_ns() const noexcept { return raw.at_ns; }
    span<const takt_axis_state> axes() const noexcept { return {raw.axes, raw.axis_count}; }
    span<const takt_group_state> groups() const noexcept { return {raw.groups, raw.group_count}; }
    span<const takt_bus_state> buses() const noexcept { return {raw.buses, raw.bus_count}; }
    const takt_axis_state &operator[](std::size_t axis) const noexcept { return raw.axes[axis]; }
    /// The set-points of the positions: rad (m).
    std::vector<double> set_points() const {
        std::vector<double> all;
        for (const auto &axis : axes()) all.push_back(axis.position_set);
        return all;
    }

    takt_state raw{};
};

/// What is wanted of an axis.
struct target : takt_target {
    target() : takt_target{} {}
    static target hold() { return {}; }
    static target position(double position) { return of(TAKT_POSITION, position); }
    static target moving(double position, double velocity) {
        target made = of(TAKT_POSITION, position);
        made.takt_target::velocity = velocity;
        made.flags = TAKT_HAS_VELOCITY;
        return made;
    }
    static target velocity(double velocity) {
        target made = of(TAKT_VELOCITY, 0.0);
        made.takt_target::velocity = velocity;
        return made;
    }
    static target torque(double torque) {
        target made = of(TAKT_TORQUE, 0.0);
        made.takt_target::torque = torque;
        return made;
    }
    static target impedance(double position, double stiffness, double damping, double torque = 0.0) {
        target made = of(TAKT_IMPEDANCE, position);
        made.takt_target::stiffness = stiffness;
        made.takt_target::damping = damping;
        made.takt_target::torque = torque;
        return made;
    }

private:
    static target of(std::int32_t kind, double position) {
        target made;
        made.kind = kind;
        made.takt_target::position = position;
        return made;
    }
};
static_assert(sizeof(target) == sizeof(takt_target), "an array of targets is one of takt_target");

using motion = takt_motion;

/// How a controller is opened.
struct options {
    takt_drives drives = TAKT_CONFIGURED;
    bool is_realtime_required = false;
    bool is_left_disabled = false; ///< until enable()
    std::string recording{}; ///< a folder; empty as the configuration says
    std::string faults{};    ///< a file; empty for none

    takt_options raw() const noexcept {
        takt_options raw{};
        raw.size = sizeof raw;
        raw.drives = drives;
        raw.is_realtime_required = is_realtime_required ? 1 : 0;
        raw.is_left_disabled = is_left_disabled ? 1 : 0;
        raw.recording = recording.empty() ? nullptr : recording.c_str();
        raw.faults = faults.empty() ? nullptr : faults.c_str();
        return raw;
    }
};

/// How a move is made.
struct move_options {
    double velocity_scale = 1.0;
    double acceleration_scale = 1.0;
    double minimum_duration_s = 0.0;

    takt_move_options raw() const noexcept {
        takt_move_options raw{};
        raw.size = sizeof raw;
        raw.velocity_scale = velocity_scale;
        raw.acceleration_scale = acceleration_scale;
        raw.minimum_duration_s = minimum_duration_s;
        return raw;
    }
};

/// How a callback leads axes.
struct callback_options {
    std::uint32_t overruns_allowed = 0;
    std::uint64_t budget_ns = 0; ///< 0 for what is usual
    std::int32_t follow = 0;     ///< 0 as configured, 1 smooth, 2 exact
};

/// What happens in a controller.
class events {
public:
    explicit events(takt_handle of) {
        if (takt_result code = takt_open_events(of, &raw_); code != TAKT_OK) throw error(failure::last(code));
    }
    events(events &&other) noexcept : raw_(std::exchange(other.raw_, {})) {}
    events &operator=(events &&other) noexcept {
        std::swap(raw_, other.raw_);
        return *this;
    }
    ~events() {
        if (raw_.number != 0) takt_close_events(raw_);
    }
    /// The next event; TAKT_ERROR_TIMEOUT when none has come.
    result_of<takt_event> next(double timeout_s = 0.0) const {
        takt_event event{};
        event.size = sizeof event;
        takt_result code = takt_next_event(raw_, timeout_s, &event);
        return {code, event};
    }

private:
    takt_events raw_{};
};

/// A callback that leads axes. When it goes out of scope before it is over, the axes are stopped, and it is waited for.
class callback {
public:
    callback(callback &&other) noexcept
        : raw_(std::exchange(other.raw_, {})), axes_(other.axes_), function_(std::move(other.function_)) {}
    callback &operator=(callback &&other) noexcept {
        std::swap(raw_, other.raw_);
        std::swap(axes_, other.axes_);
        std::swap(function_, other.function_);
        return *this;
    }
    ~callback() {
        if (raw_.number == 0) return;
        if (takt_wait_callback(raw_, 0.0) == TAKT_ERROR_TIMEOUT) {
            takt_stop(axes_, TAKT_STOP_AND_HOLD);
            takt_wait_callback(raw_, forever);
        }
        takt_close_callback(raw_);
    }
    /// Waits until it is over and the axes are at rest.
    result wait(double timeout_s) const { return result(takt_wait_callback(raw_, timeout_s)); }
    result_of<takt_callback_times> times() const {
        takt_callback_times times{};
        times.size = sizeof times;
        takt_result code = takt_read_callback_times(raw_, &times);
        return {code, times};
    }

private:
    friend class axes;
    callback() = default;
    takt_callback raw_{};
    takt_handle axes_{};
    std::shared_ptr<void> function_;
};

/// The axes of a controller or of one of its groups: all commands. It is not more than a number, which its owner closes.
class axes {
public:
    takt_handle raw() const noexcept { return raw_; }
    std::size_t size() const noexcept { return takt_axis_count(raw_); }
    std::uint64_t now_ns() const noexcept { return takt_now_ns(raw_); }
    std::uint64_t period_ns() const noexcept { return takt_period_ns(raw_); }
    result_of<takt_axis> describe(std::uint32_t axis) const {
        takt_axis described{};
        described.size = sizeof described;
        takt_result code = takt_describe_axis(raw_, axis, &described);
        return {code, described};
    }

    std::size_t group_count() const noexcept { return takt_group_count(raw_); }
    result_of<takt_group> describe_group(std::uint32_t group) const {
        takt_group described{};
        described.size = sizeof described;
        takt_result code = takt_describe_group(raw_, group, &described);
        return {code, described};
    }

    /// The newest state; of a handle that is closed, an empty one.
    takt::state state() const {
        takt::state state;
        takt_read_state(raw_, &state.raw);
        return state;
    }
    /// The same, into one that is there already.
    result read_state(takt::state &state) const { return result(takt_read_state(raw_, &state.raw)); }
    /// Waits for a cycle that is later than that of `state`, and reads it.
    result wait_cycle(takt::state &state, double timeout_s = forever) const {
        return result(takt_wait_cycle(raw_, timeout_s, &state.raw));
    }
    result wait_phase(takt_phase phase, double timeout_s) const { return result(takt_wait_phase(raw_, phase, timeout_s)); }
    /// Lets so many cycles pass: runs them in virtual time.
    result advance(std::uint64_t cycles) const { return result(takt_advance(raw_, cycles, nullptr)); }
    takt::events events() const { return takt::events(raw_); }

    /// Allocates nothing and takes no lock: for any thread, and for signal handlers. TAKT_OK, or TAKT_ERROR_ENDED.
    takt_result stop(takt_stop_category category = TAKT_STOP_AND_HOLD) const noexcept { return takt_stop(raw_, category); }
    result enable() const { return result(takt_enable(raw_)); }
    result disable() const { return result(takt_disable(raw_)); }
    result clear_faults() const { return result(takt_clear_faults(raw_)); }

    /// Of a controller of another process: who commands it, to command it in place of another process, and to let others.
    result_of<takt_lease> lease() const {
        takt_lease lease{};
        lease.size = sizeof lease;
        takt_result code = takt_read_lease(raw_, &lease);
        return {code, lease};
    }
    result take_over() const { return result(takt_take_over(raw_)); }
    result release() const { return result(takt_release(raw_)); }

    result_of<motion> move_to(span<const double> targets, const move_options &how = {}) const {
        motion begun{};
        takt_move_options raw = how.raw();
        takt_result code = takt_move_to(raw_, targets.data(), targets.size(), &raw, &begun);
        return {code, begun};
    }
    result_of<motion> move_by(span<const double> distances, const move_options &how = {}) const {
        motion begun{};
        takt_move_options raw = how.raw();
        takt_result code = takt_move_by(raw_, distances.data(), distances.size(), &raw, &begun);
        return {code, begun};
    }
    /// Waypoints one after the other, each with a position for each axis.
    result_of<motion> move_through(span<const double> waypoints) const {
        motion begun{};
        const std::size_t each = size();
        takt_result code = takt_move_through(raw_, waypoints.data(), rows(waypoints.size(), each), each, &begun);
        return {code, begun};
    }
    /// Points one after the other, each with a position for each axis; the same of the velocities and the accelerations, or none of them.
    /// What has another number of values is TAKT_ERROR_ARGUMENT.
    result_of<motion> execute(
        span<const double> times_s, span<const double> positions, span<const double> velocities = {},
        span<const double> accelerations = {}) const {
        motion begun{};
        const std::size_t each = size(), values = times_s.size() * each;
        const auto fits = [&](span<const double> of) { return of.empty() || of.size() == values; };
        const bool is_whole = positions.size() == values && fits(velocities) && fits(accelerations);
        takt_result code = takt_execute(
            raw_, times_s.data(), is_whole ? positions.data() : nullptr, velocities.empty() ? nullptr : velocities.data(),
            accelerations.empty() ? nullptr : accelerations.data(), times_s.size(), each, &begun);
        return {code, begun};
    }
    result_of<motion> profile_velocity(std::uint32_t axis, double velocity, double valid_s) const {
        motion begun{};
        takt_result code = takt_profile_velocity(raw_, axis, velocity, valid_s, &begun);
        return {code, begun};
    }
    result_of<motion> profile_torque(std::uint32_t axis, double torque, double valid_s) const {
        motion begun{};
        takt_result code = takt_profile_torque(raw_, axis, torque, valid_s, &begun);
        return {code, begun};
    }
    result_of<motion> change_mode(std::int32_t mode) const {
        motion begun{};
        takt_result code = takt_change_mode(raw_, mode, &begun);
        return {code, begun};
    }
    result_of<motion> change_mode(std::uint32_t axis, std::int32_t mode) const {
        motion begun{};
        takt_result code = takt_change_axis_mode(raw_, axis, mode, &begun);
        return {code, begun};
    }
    result wait(motion of, double timeout_s = forever) const { return result(takt_wait(raw_, of, timeout_s)); }
    /// Its code is TAKT_UNDER_WAY, TAKT_OK, or an error.
    result motion_result(motion of) const { return result(takt_motion_result(raw_, of)); }
    result set_speed(motion of, double rate) const { return result(takt_set_speed(raw_, of, rate)); }
    result pause(motion of) const { return result(takt_pause(raw_, of)); }
    result resume(motion of) const { return result(takt_resume(raw_, of)); }
    result_of<takt_progress> progress(motion of) const {
        takt_progress progress{};
        progress.size = sizeof progress;
        takt_result code = takt_trajectory_progress(raw_, of, &progress);
        return {code, progress};
    }

    result begin_stream() const { return result(takt_begin_stream(raw_)); }
    result push_now(span<const target> targets) const { return result(takt_push_now(raw_, targets.data(), targets.size())); }
    result push_now(span<const double> positions) const {
        return result(takt_push_positions(raw_, positions.data(), positions.size()));
    }
    result push_at(std::uint64_t at_ns, span<const target> targets) const {
        return result(takt_push_at(raw_, at_ns, targets.data(), targets.size()));
    }
    result push_at(std::uint64_t at_ns, span<const double> positions) const {
        return result(takt_push_positions_at(raw_, at_ns, positions.data(), positions.size()));
    }
    /// Points one after the other, each with a target for each axis.
    result push_chunk(std::uint64_t from_ns, std::uint64_t interval_ns, span<const target> targets) const {
        const std::size_t each = size();
        return result(takt_push_chunk(raw_, from_ns, interval_ns, targets.data(), rows(targets.size(), each), each));
    }
    result push_chunk(std::uint64_t from_ns, std::uint64_t interval_ns, span<const double> positions) const {
        const std::size_t each = size();
        return result(takt_push_positions_chunk(raw_, from_ns, interval_ns, positions.data(), rows(positions.size(), each), each));
    }

    /// Lets a function lead the axes, in the real-time thread:
    /// takt_callback_result(const takt_callback_cycle &, takt::span<const takt_axis_state>, takt::span<takt_target>). It must not block,
    /// lock or allocate. What it throws is a stop. The callback owns the function.
    template <class F>
    result_of<callback> begin_callback(F function, const callback_options &how = {}) const {
        callback begun;
        auto owned = std::make_shared<F>(std::move(function));
        takt_callback_options raw{};
        raw.size = sizeof raw;
        raw.overruns_allowed = how.overruns_allowed;
        raw.budget_ns = how.budget_ns;
        raw.follow = how.follow;
        takt_result code = takt_begin_callback(raw_, &call<F>, owned.get(), &raw, &begun.raw_);
        begun.axes_ = raw_;
        begun.function_ = std::move(owned);
        return {code, std::move(begun)};
    }

protected:
    axes() = default;
    ~axes() = default;
    axes(axes &&other) noexcept : raw_(std::exchange(other.raw_, {})) {}
    axes &operator=(axes &&other) noexcept {
        std::swap(raw_, other.raw_);
        return *this;
    }
    takt_handle raw_{};

private:
    /// How many points there are. What is no whole number of points is more than there can be, and is refused.
    static std::size_t rows(std::size_t values, std::size_t each) noexcept {
        return each == 0 || values % each != 0 ? std::numeric_limits<std::size_t>::max() : values / each;
    }
    template <class F>
    static std::int32_t call(
        void *user, const takt_callback_cycle *cycle, const takt_axis_state *shown, takt_target *targets, std::size_t count) {
        try {
            return (*static_cast<F *>(user))(*cycle, span<const takt_axis_state>(shown, count), span<takt_target>(targets, count));
        } catch (...) {
            return -1;
        }
    }
};

/// One group of a controller.
class group : public axes {
public:
    group(takt_handle of, const std::string &name) {
        if (takt_result code = takt_open_group(of, name.c_str(), &raw_); code != TAKT_OK) throw error(failure::last(code));
    }
    group(group &&) noexcept = default;
    group &operator=(group &&) noexcept = default;
    ~group() {
        if (raw_.number != 0) takt_close(raw_);
    }
};

/// Done if no axis of a configuration file may do more than the joint of its name in a robot description; else with each contradiction.
inline result check_urdf(const std::string &path, const std::string &urdf) { return result(takt_check_urdf(path.c_str(), urdf.c_str())); }

/// The owner of a run, or a connection to one. When an owner goes out of scope the axes come to rest, and the drives are disabled and shut down.
class controller : public axes {
public:
    /// By a configuration file. Throws takt::error.
    static controller open(const std::string &path, const options &how = {}) {
        takt_options raw = how.raw();
        controller opened;
        if (takt_result code = takt_open(path.c_str(), &raw, &opened.raw_); code != TAKT_OK) throw error(failure::last(code));
        return opened;
    }
    /// By the text of a configuration. Throws takt::error.
    static controller open_text(const std::string &text, const options &how = {}) {
        takt_options raw = how.raw();
        controller opened;
        if (takt_result code = takt_open_text(text.c_str(), &raw, &opened.raw_); code != TAKT_OK) throw error(failure::last(code));
        return opened;
    }
    /// One of another process, by the name that it is served by (takt run --serve): every call is the same, but for begin_callback(). When
    /// it goes out of scope the connection ends, and not the controller. Throws takt::error.
    static controller connect(const std::string &name) {
        controller connected;
        if (takt_result code = takt_connect(name.c_str(), &connected.raw_); code != TAKT_OK) throw error(failure::last(code));
        return connected;
    }
    controller(controller &&) noexcept = default;
    controller &operator=(controller &&) noexcept = default;
    ~controller() {
        if (raw_.number != 0) takt_close(raw_);
    }
    /// As the destructor, with the result of the run.
    result close() { return result(takt_close(std::exchange(raw_, {}))); }
    /// Throws takt::error when there is no such group.
    takt::group group(const std::string &name) const { return takt::group(raw_, name); }

private:
    controller() = default;
};

} // namespace takt

#endif
