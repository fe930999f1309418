// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/draw/drawing.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <system_error>

#include "base/text_of.hpp"
#include "manipulation/parts/decimal.hpp"
#include "manipulation/skills/draw/letters.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Vector2d;

constexpr double kSpace = 0.28;     // Between letters, as a share of their height.
constexpr int kChords = 24;         // Straight pieces of one curve.
constexpr double kApart = 1e-4;     // Distance of drawn points [m].
constexpr double kSample = 2.5e-4;  // Distance of points of the wanted line [m].
constexpr double kNear = 1.5e-3;    // What is drawn so near counts as drawn [m].

std::string millimetres(double length) { return decimal(1e3 * length, 0); }

// Reads the path of a letter.
class PathReader {
 public:
  explicit PathReader(std::string_view path) : at_(path.data()), end_(path.data() + path.size()) {}

  [[nodiscard]] Drawing read() {
    Drawing drawing;
    for (skip(); at_ < end_; skip()) {
      const char command = *at_++;
      const Vector2d point = next();
      if (command == 'M') {
        drawing.push_back({point});
      } else if (command == 'L') {
        drawing.back().push_back(point);
      } else {
        const Vector2d second = next();
        curve(drawing.back(), point, second, next());
      }
    }
    return drawing;
  }

 private:
  void skip() {
    while (at_ < end_ && *at_ == ' ') ++at_;
  }
  double number() {
    skip();
    double value = 0.0;
    at_ = std::from_chars(at_, end_, value).ptr;
    return value;
  }
  Vector2d next() {
    const double x = number();
    return {x, number()};
  }
  static void curve(PenStroke& stroke, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
    const Vector2d a = stroke.back();
    for (int i = 1; i <= kChords; ++i) {
      const double s = static_cast<double>(i) / kChords;
      const double r = 1.0 - s;
      stroke.emplace_back(r * r * r * a + 3 * r * r * s * b + 3 * r * s * s * c + s * s * s * d);
    }
  }

  const char* at_;
  const char* end_;
};

const Letter& letter_of(char sign) {
  const auto found = std::ranges::find(all_letters(), sign, &Letter::sign);
  if (found != all_letters().end()) return *found;
  std::string known;
  for (const Letter& letter : all_letters())
    if (letter.sign != ' ') known += letter.sign;
  throw InvalidArgument(std::string("there is no letter '") + sign +
                        "' to draw, only the space and " + known +
                        ": others need a file of strokes");
}

Vector2d nearest_on(const Vector2d& from, const Vector2d& to, const Vector2d& point) {
  const Vector2d displacement = to - from;
  const double length = displacement.squaredNorm();
  const double share =
      length > 0 ? std::clamp((point - from).dot(displacement) / length, 0.0, 1.0) : 0.0;
  return from + share * displacement;
}

double distance_to(const Drawing& drawing, const Vector2d& point) {
  double least = std::numeric_limits<double>::infinity();
  for (const PenStroke& stroke : drawing) {
    if (stroke.size() == 1) least = std::min(least, (stroke.front() - point).squaredNorm());
    for (std::size_t i = 1; i < stroke.size(); ++i) {
      const Vector2d nearest = nearest_on(stroke[i - 1], stroke[i], point);
      least = std::min(least, (nearest - point).squaredNorm());
    }
  }
  return std::sqrt(least);
}

// Points that are evenly spread along the drawing.
PenStroke samples_of(const Drawing& drawing) {
  PenStroke samples;
  for (const PenStroke& stroke : drawing) {
    for (std::size_t i = 1; i < stroke.size(); ++i) {
      const Vector2d displacement = stroke[i] - stroke[i - 1];
      const int count = std::max(1, static_cast<int>(std::lround(displacement.norm() / kSample)));
      for (int k = 0; k < count; ++k)
        samples.emplace_back(stroke[i - 1] + (k + 0.5) / count * displacement);
    }
  }
  return samples;
}

std::vector<double> row_of(const std::string& line, const std::string& where) {
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  for (;;) {
    double number = 0.0;
    const auto [next, error] = std::from_chars(at, end, number);
    if (error != std::errc() || !std::isfinite(number))
      throw InvalidArgument(where + " has something that is not a number");
    numbers.push_back(number);
    if (next == end) return numbers;
    if (*next != ',') throw InvalidArgument(where + " has something other than a comma");
    at = next + 1;
  }
}

std::string path_of(const Drawing& drawing, const Paper& paper) {
  // Pictures count y downwards.
  const Eigen::Rotation2Dd back(-paper.turn);
  std::string text;
  for (const PenStroke& stroke : drawing) {
    char command = 'M';
    for (const Vector2d& point : stroke) {
      const Vector2d at = 1e3 * (back * (point - paper.centre));
      text += command + decimal(at.x(), 2) + " " + decimal(-at.y(), 2);
      command = 'L';
    }
  }
  return text;
}

}  // namespace

bool Paper::contains(const Vector2d& point) const noexcept {
  const Vector2d at = Eigen::Rotation2Dd(-turn) * (point - centre);
  return (at.cwiseAbs() - size / 2).maxCoeff() <= 0.0;
}

Drawing written(std::string_view word, double height) {
  Drawing drawing;
  double begin = 0.0;
  for (const char sign : word) {
    const Letter& letter = letter_of(sign);
    for (PenStroke& stroke : PathReader(letter.path).read()) {
      for (Vector2d& point : stroke) point = height * (point + Vector2d(begin, 0.0));
      drawing.push_back(std::move(stroke));
    }
    begin += letter.width + kSpace;
  }
  if (drawing.empty()) throw InvalidArgument("there is nothing to draw: the word is empty");
  return drawing;
}

Drawing load_strokes(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw InvalidArgument("cannot read the strokes '" + path.string() + "'");
  Drawing drawing;
  double number = 0.0;
  std::string line;
  std::getline(file, line);  // The names.
  for (std::size_t row = 2; std::getline(file, line); ++row) {
    const std::string where = path.string() + ":" + std::to_string(row);
    const std::vector<double> numbers = row_of(line, where);
    if (numbers.size() != 3)
      throw InvalidArgument(detail::text_of(where, " has ", numbers.size(),
                                            " numbers, must have 3: the stroke, x and y"));
    if (drawing.empty() || numbers[0] != number) drawing.emplace_back();
    number = numbers[0];
    const Vector2d point(numbers[1], numbers[2]);
    if (drawing.back().empty() || drawing.back().back() != point) drawing.back().push_back(point);
  }
  for (const PenStroke& stroke : drawing)
    if (stroke.size() < 2)
      throw InvalidArgument(path.string() + " has a stroke with a single point");
  if (drawing.empty()) throw InvalidArgument(path.string() + " has no strokes");
  return drawing;
}

Drawing placed(const Drawing& drawing, const Paper& paper) {
  Eigen::AlignedBox2d box;
  for (const PenStroke& stroke : drawing)
    for (const Vector2d& point : stroke) box.extend(point);
  if ((box.sizes() - paper.size).maxCoeff() > 0.0) {
    throw InvalidArgument(
        "the drawing is " + millimetres(box.sizes().x()) + " x " + millimetres(box.sizes().y()) +
        " mm large, which does not fit on the paper of " + millimetres(paper.size.x()) + " x " +
        millimetres(paper.size.y()) + " mm");
  }
  const Eigen::Rotation2Dd turn(paper.turn);
  Drawing there = drawing;
  for (PenStroke& stroke : there)
    for (Vector2d& point : stroke) point = paper.centre + turn * (point - box.center());
  return there;
}

Drawing drawn_by(const ObjectDescription& pen, std::span<const SeenPose> poses, const Paper& paper,
                 double touch) {
  const double radius = pen.size[1] / 2;
  const double reach = pen.size[0] / 2 - radius;
  Drawing drawn;
  bool is_drawing = false;
  for (const SeenPose& seen : poses) {
    const Eigen::Vector3d nib =
        seen.pose.position + reach * (seen.pose.orientation * Eigen::Vector3d::UnitX());
    const Vector2d point = nib.head<2>();
    if (nib.z() - radius > touch || !paper.contains(point)) {
      is_drawing = false;
      continue;
    }
    if (!is_drawing) drawn.emplace_back();
    is_drawing = true;
    if (drawn.back().empty() || (drawn.back().back() - point).norm() >= kApart)
      drawn.back().push_back(point);
  }
  return drawn;
}

DrawingError compare(const Drawing& wanted, const Drawing& drawn) {
  DrawingError error;
  double squares = 0.0;
  std::size_t count = 0;
  for (const PenStroke& stroke : drawn) {
    for (const Vector2d& point : stroke) {
      const double distance = distance_to(wanted, point);
      squares += distance * distance;
      error.largest = std::max(error.largest, distance);
      ++count;
    }
  }
  if (count == 0) return error;
  error.rms = std::sqrt(squares / static_cast<double>(count));
  const PenStroke samples = samples_of(wanted);
  const auto near = std::ranges::count_if(
      samples, [&](const Vector2d& point) { return distance_to(drawn, point) <= kNear; });
  error.share = static_cast<double>(near) / static_cast<double>(samples.size());
  return error;
}

std::string csv_of(const Drawing& wanted, const Drawing& drawn) {
  std::string text = "kind,stroke,x,y\n";
  const auto add = [&text](std::string_view kind, const Drawing& drawing) {
    for (std::size_t i = 0; i < drawing.size(); ++i)
      for (const Vector2d& point : drawing[i])
        text += detail::text_of(kind, ',', i, ',') + decimal(point.x(), 6) + "," +
                decimal(point.y(), 6) + "\n";
  };
  add("wanted", wanted);
  add("drawn", drawn);
  return text;
}

std::string svg_of(const Drawing& wanted, const Drawing& drawn, const Paper& paper) {
  const Vector2d size = 1e3 * paper.size;
  const std::string width = decimal(size.x(), 1);
  const std::string height = decimal(size.y(), 1);
  const std::string left = decimal(-size.x() / 2, 2);
  const std::string top = decimal(-size.y() / 2, 2);
  std::string text = R"(<svg xmlns="http://www.w3.org/2000/svg" width=")" + width +
                     R"(mm" height=")" + height + R"(mm" viewBox=")" + left + " " + top + " " +
                     width + " " + height +
                     R"(" fill="none" stroke-linecap="round" stroke-linejoin="round">)"
                     "\n";
  text += R"(<rect x=")" + left + R"(" y=")" + top + R"(" width=")" + width + R"(" height=")" +
          height +
          R"(" fill="#FDFCF8" stroke="#C8C4B8" stroke-width="0.3"/>)"
          "\n";
  text += R"(<path stroke="#9CC3E6" stroke-width="2" d=")" + path_of(wanted, paper) + "\"/>\n";
  text += R"(<path stroke="#1A1A1A" stroke-width="0.5" d=")" + path_of(drawn, paper) + "\"/>\n";
  return text + "</svg>\n";
}

}  // namespace trifinger::manipulation
