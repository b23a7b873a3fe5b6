// A group of a controller of another process in C++: served NAME
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <takt.hpp>
#include <utility>

static void check(bool is_so, const char *what) {
    if (!is_so) throw std::runtime_error(what);
}

int main(int count, char **arguments) try {
    check(count > 1, "a name");
    try {
        auto none = takt::controller::connect("no-such-controller");
        check(false, "there is none");
    } catch (const takt::error &error) {
        check(error.why().code == TAKT_ERROR_START, "why");
    }
    auto all = takt::controller::connect(arguments[1]);
    auto arm = all.group("arm");
    check(all.size() == 4 && arm.size() == 3, "axes");
    check(all.group_count() == 2 && arm.group_count() == 1, "groups");
    const auto second = all.describe_group(1), last = all.describe_group(all.describe(3)->group);
    check(std::string_view(second->name) == "gripper" && second->axis_count == 1 && last->number == 1, "the second group");
    check(std::string_view(arm.describe_group(0)->name) == "arm" && arm.describe_group(0)->axis_count == 3, "the first group");
    check(all.describe_group(2).code() == TAKT_ERROR_ARGUMENT, "there are two");
    check(all.describe(3)->bus < all.state().buses().size(), "its bus");
    check(!all.execute({1.0}, {0.0, 0.0, 0.0, 0.0}), "a trajectory is for one group");
    arm.wait(arm.move_to({0.1, -0.1, 0.1}).or_throw(), 30.0).or_throw();
    check(arm.state().axes().size() == 3 && all.state().groups().size() == 2, "states");
    auto motion = arm.execute({1.0}, {0.0, 0.0, 0.0}).or_throw();
    check(arm.progress(motion)->of_s == 1.0, "progress");
    arm.wait(motion, 30.0).or_throw();

    auto other = takt::controller::connect(arguments[1]);
    check(other.disable().code() == TAKT_ERROR_LEASE, "the lease is the first one's");
    other.take_over().or_throw();
    check(other.lease()->process != 0, "a lease");
    check(arm.disable().code() == TAKT_ERROR_LEASE, "taken over");
    other.release().or_throw();
    check(other.lease()->process == 0, "given back");
    check(arm.stop() == TAKT_OK, "a stop needs no lease");
    auto refused = arm.begin_callback(
        [](const takt_callback_cycle &, takt::span<const takt_axis_state>, takt::span<takt_target>) { return TAKT_FINISHED; });
    check(refused.code() == TAKT_ERROR_NOT_OWN, "a callback is the owner's");
    std::puts("all that another process can do");
} catch (const std::exception &problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
}
