// The first program: moves the simulated joint to a quarter turn.
//
//   c++ -std=c++17 first.cpp $(pkg-config --cflags --libs takt) -o first && ./first configs/first.toml
#include <cstdio>
#include <exception>
#include <takt.hpp>

int main(int count, char **arguments) try {
    auto arm = takt::controller::open(count > 1 ? arguments[1] : "arm.toml");
    auto motion = arm.move_to({1.5708}).or_throw();
    arm.wait(motion, 10.0).or_throw();
    std::puts("the joint is there");
} catch (const std::exception &problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
}
