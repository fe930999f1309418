// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <cstddef>
#include <optional>
#include <type_traits>

#include "array.hpp"
#include "trifinger/control/motion.hpp"

// Structs of settings: plain data with defaults. In Python each setting is an argument with a name,
// and can be read and changed later.

namespace trifinger::bindings {

/// Up to `kMost` numbers.
template <std::size_t kMost>
using UpTo = Array<Eigen::Matrix<double, Eigen::Dynamic, 1, 0, static_cast<int>(kMost), 1>>;

/// What Python sees of a setting. Times are plain numbers, lists of numbers are arrays.
template <class T>
struct PlainSetting {
  using Type = T;
  static T read(const T& value) { return value; }
  static T write(const T& value) { return value; }
};
template <>
struct PlainSetting<control::Seconds> {
  using Type = double;
  static double read(control::Seconds time) { return time.count(); }
  static control::Seconds write(double time) { return control::Seconds(time); }
};
template <>
struct PlainSetting<std::optional<control::Seconds>> {
  using Type = std::optional<double>;
  static Type read(std::optional<control::Seconds> time) {
    return time ? Type(time->count()) : std::nullopt;
  }
  static std::optional<control::Seconds> write(Type time) {
    return time ? std::optional(control::Seconds(*time)) : std::nullopt;
  }
};
template <std::size_t kCount>
struct PlainSetting<std::array<double, kCount>> {
  using Type = UpTo<kCount>;
  static Type read(const std::array<double, kCount>& numbers) {
    return {Eigen::Vector<double, static_cast<int>(kCount)>::Map(numbers.data())};
  }
  // The rest is zero.
  static std::array<double, kCount> write(const Type& numbers) {
    std::array<double, kCount> all{};
    for (Eigen::Index i = 0; i < numbers.value.size(); ++i)
      all[static_cast<std::size_t>(i)] = numbers.value[i];
    return all;
  }
};

/// One member of a struct of settings.
template <class C, class M>
struct Setting {
  using Plain = PlainSetting<M>;
  using Type = typename Plain::Type;

  const char* name;
  M C::* member;
  const char* doc;

  [[nodiscard]] auto argument() const {
    nanobind::arg argument(name);
    // Otherwise Python would print the address of the default value.
    if constexpr (std::is_class_v<Type>) argument.sig("...");
    return argument = Plain::read(C{}.*member);
  }
  void bind(nanobind::class_<C>& type) const {
    type.def_prop_rw(
        name, [member = member](const C& settings) { return Plain::read(settings.*member); },
        [member = member](C& settings, const Type& value) {
          settings.*member = Plain::write(value);
        },
        doc);
  }
};

template <class C, class M>
Setting(const char*, M C::*, const char*) -> Setting<C, M>;

/// Binds a struct of settings: each can be given by name, and read and changed later.
template <class C, class... M>
void bind_settings(nanobind::class_<C> type, const Setting<C, M>&... settings) {
  type.def(
      "__init__",
      [settings...](C* self, const typename Setting<C, M>::Type&... values) {
        new (self) C{};
        ((self->*settings.member = PlainSetting<M>::write(values)), ...);
      },
      nanobind::kw_only(), settings.argument()...);
  (settings.bind(type), ...);
}

}  // namespace trifinger::bindings
