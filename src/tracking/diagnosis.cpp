// SPDX-License-Identifier: BSD-3-Clause
#include "diagnosis.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "base/text_of.hpp"

namespace trifinger::tracking {
namespace {

using trifinger::detail::text_of;
using Images = std::vector<std::span<const std::byte>>;

// How pixels may be stored otherwise than they are said to be.
struct Storage {
  bool is_mirrored{false};
  bool is_upside_down{false};
  bool is_blue_first{false};
};

// The image as it is if it was stored like that.
std::vector<std::byte> read_as(const Storage& storage, const camera::ImageFormat& format,
                               std::span<const std::byte> pixels) {
  if (pixels.empty()) return {};
  const auto width = static_cast<std::size_t>(format.width);
  const auto height = static_cast<std::size_t>(format.height);
  const std::size_t channels = camera::channels(format.pixels);
  const bool is_mosaic = format.pixels == camera::PixelFormat::kBayerRg8;
  // A mosaic keeps its pattern if it is moved by one pixel after it was mirrored, and red and blue
  // change places if it is moved by one pixel in both directions.
  const std::size_t last = is_mosaic ? 0 : 1;
  const std::size_t shift = is_mosaic && storage.is_blue_first ? 1 : 0;
  std::vector<std::byte> image(pixels.size());
  for (std::size_t row = 0; row < height; ++row) {
    const std::size_t from_row =
        (storage.is_upside_down ? 2 * height - last - row : row + shift) % height;
    for (std::size_t column = 0; column < width; ++column) {
      const std::size_t from_column =
          (storage.is_mirrored ? 2 * width - last - column : column + shift) % width;
      for (std::size_t k = 0; k < channels; ++k) {
        const std::size_t from = channels == 3 && storage.is_blue_first ? 2 - k : k;
        image[(row * width + column) * channels + k] =
            pixels[(from_row * width + from_column) * channels + from];
      }
    }
  }
  return image;
}

// Tries assumptions, and keeps the one under which the images fit together best.
class Assumptions {
 public:
  Assumptions(const std::vector<camera::Camera>& cameras, const TrackedObject& object,
              const ColourModel& colours, std::span<const std::span<const std::byte>> images)
      : cameras_(cameras),
        object_(object),
        colours_(colours),
        images_(images.begin(), images.end()),
        tracker_(cameras, object, colours) {
    diagnosis_.estimate = tracker_.track(images_);
  }

  Diagnosis diagnosis() {
    if (diagnosis_.estimate.is_sure()) return diagnosis_;
    try_orders();
    try_storage({.is_mirrored = true}, "mirrored", "let the camera not mirror it");
    try_storage({.is_mirrored = true, .is_upside_down = true}, "upside down",
                "turn it, or let the camera not turn it");
    try_storage({.is_blue_first = true}, "with red and blue exchanged",
                "give the camera the pixel format that its configuration has");
    try_sizes();
    try_colours();
    // Two images say less than three: they explain what nothing else does.
    if (best_ <= 0) try_without_one();
    return diagnosis_;
  }

 private:
  // Nothing explains the images better.
  [[nodiscard]] bool is_clear() const { return best_ > 0.95; }

  void consider(const Estimate& estimate, const std::string& fault, const std::string& remedy) {
    if (!estimate.is_sure() || estimate.confidence <= best_) return;
    best_ = estimate.confidence;
    diagnosis_.fault = fault;
    diagnosis_.remedy = remedy;
  }

  void try_orders() {
    constexpr std::size_t kMost = 4;  // 23 orders
    std::vector<std::size_t> order(images_.size());
    std::iota(order.begin(), order.end(), 0);
    if (order.size() > kMost) {
      for (std::size_t i = 0; i < order.size(); ++i) {
        for (std::size_t k = i + 1; k < order.size(); ++k) {
          std::swap(order[i], order[k]);
          try_order(order);
          std::swap(order[i], order[k]);
        }
      }
      return;
    }
    while (std::ranges::next_permutation(order).found) try_order(order);
  }

  void try_order(const std::vector<std::size_t>& order) {
    if (is_clear()) return;
    Images images;
    std::string moves;
    std::vector<std::string> moved;
    for (std::size_t i = 0; i < order.size(); ++i) {
      images.push_back(images_[order[i]]);
      if (order[i] == i) continue;
      const std::string& name = cameras_[order[i]].name;
      if (cameras_[order[i]].format != cameras_[i].format) return;
      moved.push_back(name);
      moves += text_of(moves.empty() ? "" : ", ", name, " is ", cameras_[i].name);
    }
    std::ranges::sort(moved);
    consider(tracker_.track(images),
             moved.size() == 2 ? text_of(moved[0], " and ", moved[1], " are exchanged")
                               : "the cameras are in another order: " + moves,
             "give them in the right order in 'cameras.devices'");
  }

  void try_storage(const Storage& storage, const std::string& how, const std::string& remedy) {
    if (is_clear()) return;
    std::vector<std::vector<std::byte>> read;
    read.reserve(images_.size());
    for (std::size_t i = 0; i < images_.size(); ++i) {
      read.push_back(read_as(storage, cameras_[i].format, images_[i]));
    }
    consider(tracker_.track(Images(read.begin(), read.end())), "all images are " + how, remedy);
    for (std::size_t i = 0; i < images_.size(); ++i) {
      Images images = images_;
      images[i] = read[i];
      consider(tracker_.track(images), text_of("the image of ", cameras_[i].name, " is ", how),
               remedy);
    }
  }

  void try_sizes() {
    constexpr int kMost = 18;
    for (int i = -kMost; i <= kMost && !is_clear(); ++i) {
      const double factor = std::pow(1.03, i);  // a sure estimate stands some 2 %
      TrackedObject object = object_;
      object.rim *= factor;
      for (ColouredFace& face : object.faces) {
        for (Eigen::Vector3d& corner : face.corners) corner *= factor;
      }
      consider(Tracker(cameras_, object, colours_).track(images_),
               text_of(object_.name, " is about ", std::lround(100 * factor),
                       " % as large as it is said to be"),
               "give its size in 'objects'");
    }
  }

  void try_colours() {
    for (std::size_t i = 0; i < object_.faces.size(); ++i) {
      for (std::size_t k = i + 1; k < object_.faces.size() && !is_clear(); ++k) {
        TrackedObject object = object_;
        std::swap(object.faces[i].colour, object.faces[k].colour);
        consider(Tracker(cameras_, object, colours_).track(images_),
                 text_of("the ", object_.faces[i].colour, " and ", object_.faces[k].colour,
                         " faces of ", object_.name, " are exchanged"),
                 "give its colours in 'objects[i].colours'");
      }
    }
  }

  void try_without_one() {
    for (std::size_t i = 0; i < images_.size(); ++i) {
      if (images_[i].empty()) continue;
      Images images = images_;
      images[i] = {};
      consider(
          tracker_.track(images),
          text_of("the image of ", cameras_[i].name, " does not fit to the others"),
          "see whether it shows what is there now; if it does, the camera was moved: calibrate");
    }
  }

  const std::vector<camera::Camera>& cameras_;
  const TrackedObject& object_;
  const ColourModel& colours_;
  Images images_;
  Tracker tracker_;
  Diagnosis diagnosis_;
  double best_{0};
};

}  // namespace

Diagnosis diagnose(const std::vector<camera::Camera>& cameras, const TrackedObject& object,
                   const ColourModel& colours, std::span<const std::span<const std::byte>> images) {
  return Assumptions(cameras, object, colours, images).diagnosis();
}

}  // namespace trifinger::tracking
