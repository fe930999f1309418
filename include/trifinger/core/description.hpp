// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace trifinger {

// A *described* struct lists its fields once:
//
//     struct WheelObservation {
//       std::array<double, 2> angle;
//       std::array<float, 2> speed;
//       std::uint64_t steps;
//
//       static constexpr auto fields() {
//         return std::tuple{field("angle", &WheelObservation::angle, "rad"),
//                           field("speed", &WheelObservation::speed, "rad/s"),
//                           field("steps", &WheelObservation::steps)};
//       }
//     };
//
// From this list come the layout of the session, the NumPy dtype, the log schema and the labels of
// plots. Allowed are fixed-width integers, float, double, std::array of these (nested: more
// dimensions) and other described structs (flattened with dots). The compiler checks that the list
// is complete and in order.

/// Type of the numbers in a field.
enum class ScalarType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64
};

/// NumPy's name of the type, such as "float64".
[[nodiscard]] std::string_view name_of(ScalarType type) noexcept;
/// Size of one number [bytes].
[[nodiscard]] std::size_t size_of(ScalarType type) noexcept;

/// One field of an element, known at run time.
struct FieldDescription {
  std::string name;  ///< Nested names are joined with dots: "stamp.capture_time".
  ScalarType type{};
  std::vector<std::size_t> shape;  ///< Empty for a single number.
  std::string unit;                ///< SI, such as "rad/s"; empty without dimension.
  std::size_t offset{0};           ///< Distance from the start of the element [bytes].

  /// Numbers in the field: the product of the shape.
  [[nodiscard]] std::size_t count() const noexcept;

  friend bool operator==(const FieldDescription&, const FieldDescription&) = default;
};

/// The layout of one kind of element.
class ElementDescription {
 public:
  ElementDescription() = default;
  /// @throws InvalidArgument if the fields overlap, leave gaps or share a name.
  explicit ElementDescription(std::vector<FieldDescription> fields);

  /// Inverse of `text()`. @throws InvalidArgument if `text` was not made by it.
  [[nodiscard]] static ElementDescription parse(std::string_view text);

  [[nodiscard]] const std::vector<FieldDescription>& fields() const noexcept { return fields_; }
  /// Size of one element [bytes].
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The field called `name`, or nullptr.
  [[nodiscard]] const FieldDescription* find(std::string_view name) const noexcept;
  /// One line per field, for example "position float64[9] rad".
  [[nodiscard]] std::string text() const;

  friend bool operator==(const ElementDescription&, const ElementDescription&) = default;

 private:
  std::vector<FieldDescription> fields_;
  std::size_t size_{0};
};

namespace detail {

template <class T>
constexpr bool kIsScalarField =
    std::is_same_v<T, std::int8_t> || std::is_same_v<T, std::uint8_t> ||
    std::is_same_v<T, std::int16_t> || std::is_same_v<T, std::uint16_t> ||
    std::is_same_v<T, std::int32_t> || std::is_same_v<T, std::uint32_t> ||
    std::is_same_v<T, std::int64_t> || std::is_same_v<T, std::uint64_t> ||
    std::is_same_v<T, float> || std::is_same_v<T, double>;

template <class T>
constexpr ScalarType scalar_type_of() {
  if constexpr (std::is_floating_point_v<T>) {
    return sizeof(T) == 4 ? ScalarType::kFloat32 : ScalarType::kFloat64;
  } else {
    constexpr int kLog2Size = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
    return static_cast<ScalarType>(2 * kLog2Size + (std::is_unsigned_v<T> ? 1 : 0));
  }
}

template <class T>
struct ArrayTraits {
  using Scalar = T;
  static void append_shape(std::vector<std::size_t>&) {}
};
template <class T, std::size_t N>
struct ArrayTraits<std::array<T, N>> {
  static_assert(N > 0);
  using Scalar = typename ArrayTraits<T>::Scalar;
  static void append_shape(std::vector<std::size_t>& shape) {
    shape.push_back(N);
    ArrayTraits<T>::append_shape(shape);
  }
};

template <class T>
concept HasFields = requires { T::fields(); };

template <class T>
constexpr bool kIsField = HasFields<T> || kIsScalarField<typename ArrayTraits<T>::Scalar>;

}  // namespace detail

/// One entry of a struct's list of fields; made by `field()`.
template <class Struct, class Member>
struct Field {
  std::string_view name;
  Member Struct::* member;
  std::string_view unit;
};

template <class Struct, class Member>
[[nodiscard]] constexpr Field<Struct, Member> field(std::string_view name, Member Struct::* member,
                                                    std::string_view unit = "") {
  // The compiler shows the line of the field, where this is instantiated.
  static_assert(detail::kIsField<Member>,
                "the type of this field is no number of fixed size: take std::uint8_t instead of "
                "bool, an integer instead of an enum, an index instead of a pointer, std::array of "
                "numbers instead of a container, or give the inner struct a fields() of its own");
  return {name, member, unit};
}

namespace detail {

/// True if the sizes of the listed fields add up to that of T: nothing left out, no padding.
template <HasFields T>
constexpr bool fields_fill_struct() {
  return std::apply(
      [](const auto&... entry) {
        return (sizeof(std::declval<T&>().*entry.member) + ...) == sizeof(T);
      },
      T::fields());
}

/// True if the fields are listed in the order of their declaration. clang does not compare the
/// addresses of members at compile time; there `describe()` throws at its first call instead.
template <HasFields T>
constexpr bool fields_are_ordered() {
#if defined(__clang__)
  return true;
#else
  return std::apply(
      [](const auto&... entry) {
        constexpr T object{};
        const std::array<const void*, sizeof...(entry)> address{&(object.*entry.member)...};
        for (std::size_t i = 1; i < address.size(); ++i) {
          if (!(address[i - 1] < address[i])) return false;
        }
        return true;
      },
      T::fields());
#endif
}

template <HasFields T>
void append_fields(std::vector<FieldDescription>& fields, const std::string& prefix,
                   std::size_t start) {
  static_assert(fields_fill_struct<T>(),
                "fields() must list every member; no padding between them");
  static_assert(fields_are_ordered<T>(), "fields() must follow the order of declaration");
  static const T object{};
  std::apply(
      [&](const auto&... entry) {
        const auto append = [&]<class Member>(std::string_view name, Member T::* member,
                                              std::string_view unit) {
          std::string full_name = prefix + std::string(name);
          const std::size_t offset =
              start +
              static_cast<std::size_t>(reinterpret_cast<const std::byte*>(&(object.*member)) -
                                       reinterpret_cast<const std::byte*>(&object));
          if constexpr (HasFields<Member>) {
            append_fields<Member>(fields, full_name + ".", offset);
          } else {
            std::vector<std::size_t> shape;
            ArrayTraits<Member>::append_shape(shape);
            fields.push_back({std::move(full_name),
                              scalar_type_of<typename ArrayTraits<Member>::Scalar>(),
                              std::move(shape), std::string(unit), offset});
          }
        };
        (append(entry.name, entry.member, entry.unit), ...);
      },
      T::fields());
}

}  // namespace detail

/// A plain struct with a list of its fields; see the top of this file.
template <class T>
concept Described = detail::HasFields<T> && std::is_trivially_copyable_v<T> &&
                    std::is_standard_layout_v<T> && std::is_default_constructible_v<T>;

/// The description of T, made from its list of fields.
template <Described T>
[[nodiscard]] const ElementDescription& describe() {
  static const ElementDescription description = [] {
    std::vector<FieldDescription> fields;
    detail::append_fields<T>(fields, "", 0);
    return ElementDescription(std::move(fields));
  }();
  return description;
}

}  // namespace trifinger
