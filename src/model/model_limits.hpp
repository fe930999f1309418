// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "xml.hpp"

namespace trifinger::detail {

// Largest models. MuJoCo needs some seconds for each of them, and the robots of
// tools/fetch_robots.py stay below a tenth.
inline constexpr std::size_t kMaxElements = 50'000;  // as text
inline constexpr double kMaxCopies = 10'000;         // by <replicate>, <attach> and <flexcomp>
inline constexpr double kMaxFreedoms = 4'000;        // of all joints
inline constexpr double kMaxBytes = 2.0 * (1U << 30U);
inline constexpr std::size_t kMaxText = std::size_t{1} << 27U;  // of all XML files [bytes]

// The first numbers of a text, up to the first thing that is none; at most 8.
[[nodiscard]] std::vector<double> numbers_of(std::string_view text);

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

// What a text names and others have, as far as it could be read.
struct Outside {
  std::map<std::string, Amount> models;  // by the names for which <attach> asks
  std::map<std::string, double> points;  // at most, by the file of a <flexcomp>
};

// Counts what a model asks for.
class Counter {
 public:
  // `source` is named in errors.
  Counter(const XmlElement& root, std::string source, const Outside& outside);

  // Throws InvalidArgument if a number is too large.
  [[nodiscard]] Amount count();

 private:
  Amount count(const XmlElement& element);
  Amount count_attached(const XmlElement& element);
  void add_default(const XmlElement& element);
  void add_name(const XmlElement& element);
  // Product of the numbers of an attribute that a default may have.
  [[nodiscard]] double size_of(const XmlElement& element, std::string_view attribute,
                               double missing) const;
  [[nodiscard]] double bytes_of(const XmlElement& element) const;
  void require_bounds(const XmlElement& element) const;

  const XmlElement& root_;
  std::string source_;
  const Outside& outside_;
  // Bodies and frames above, by the names of their elements and their own.
  std::map<std::pair<std::string, std::string>, const XmlElement*> named_;
  std::map<const XmlElement*, Amount> counted_;  // null amounts while they are counted
  // The largest values in any <default>, whichever class an element may have.
  std::map<std::string_view, double> defaults_;
  double default_freedoms_{1};
  int levels_{0};      // that are being counted
  int replicates_{0};  // among them
};

// Throws InvalidArgument if a model is too large.
void require_size(const Amount& amount, const std::string& source);

}  // namespace trifinger::detail
