// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "xml.hpp"

namespace trifinger::detail {

// Largest models. MuJoCo needs some seconds for each of them, and the robots of
// tools/fetch_robots.py stay below a tenth.
inline constexpr std::size_t kMostElements = 50'000;  // as text
inline constexpr double kMostCopies = 10'000;         // by <replicate>, <attach> and <flexcomp>
inline constexpr double kMostFreedoms = 4'000;        // of all joints
inline constexpr double kMostBytes = 2.0 * (1U << 30U);
inline constexpr std::size_t kMostText = std::size_t{1} << 27U;  // of all XML files [bytes]

// What MuJoCo makes of an element and all that is in it.
struct Amount {
  double elements{0};
  double copies{0};
  double freedoms{0};
  double bytes{0};   // pictures, heights, files, buffers
  double keys{0};    // key frames
  double user{0};    // most numbers of a user at one element
  double rays{0};    // sensors with a ray for each pixel of a camera
  double pixels{0};  // of the largest camera
  double depth{0};   // levels

  Amount& operator+=(const Amount& other);
};

// Counts what a model asks for.
class Counter {
 public:
  // `source` is named in errors. `models` are those that can be attached, by name.
  Counter(const XmlElement& root, std::string source, const std::map<std::string, Amount>& models);

  // Throws InvalidArgument if a number is too large.
  [[nodiscard]] Amount count();

 private:
  Amount count(const XmlElement& element);
  Amount count_attached(const XmlElement& element);
  void require_bounds(const XmlElement& element) const;

  const XmlElement& root_;
  std::string source_;
  const std::map<std::string, Amount>& models_;
  std::map<std::string, const XmlElement*> named_;  // bodies and frames
  std::map<const XmlElement*, Amount> counted_;     // null amounts while they are counted
};

// Throws InvalidArgument if a model is too large.
void require_size(const Amount& amount, const std::string& source);

}  // namespace trifinger::detail
