/* Shared by the programs in C++ of the laboratory that call takt and note when (front_calls.cpp, front_calls_ros2.cpp). */
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

constexpr int calls = 100;
constexpr double step = 0.0005, far = 0.3; // rad

/// So many milliseconds, and a part of one that is another one each time, so that the calls come all over the cycle.
inline void pause(int milliseconds, int number) {
    std::this_thread::sleep_for(std::chrono::microseconds(milliseconds * 1000 + number * 37 % 100 * 10));
}

inline void calls_begin() {
    std::fputs("calls begin\n", stderr);
}

/// A command, and CLOCK_REALTIME.
inline void noted(const char *command, const std::string &more = {}) {
    const auto at = std::chrono::system_clock::now().time_since_epoch();
    const auto microseconds = std::chrono::duration_cast<std::chrono::microseconds>(at).count();
    std::printf("%s %lld.%06lld%s\n", command, static_cast<long long>(microseconds / 1000000), static_cast<long long>(microseconds % 1000000), more.c_str());
}
