// A stand-in: see ../../README.md.
#pragma once
#include <cstdio>
#include <rclcpp/logger.hpp>

#define RCLCPP_ERROR(logger, ...)                              \
    do {                                                       \
        std::fprintf(stderr, "[%s] ", (logger).get_name());    \
        std::fprintf(stderr, __VA_ARGS__);                     \
        std::fputc('\n', stderr);                              \
    } while (0)
