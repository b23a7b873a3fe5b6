// A stand-in: see ../../README.md. The class is made by its base, as pluginlib does.
#pragma once
#include <memory>
#include <type_traits>

namespace pluginlib_stand_in {
template <class Base>
std::unique_ptr<Base> make();
}

#define PLUGINLIB_EXPORT_CLASS(class_type, base_type)                                             \
    static_assert(std::is_base_of_v<base_type, class_type>, "the class is not one of its base"); \
    template <>                                                                                   \
    std::unique_ptr<base_type> pluginlib_stand_in::make<base_type>() {                            \
        return std::make_unique<class_type>();                                                    \
    }
