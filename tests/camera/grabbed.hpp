// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "trifinger/camera/source.hpp"

namespace trifinger::test {

/// Memory for what a source delivers.
class Grabbed {
 public:
  explicit Grabbed(camera::Source& source) {
    const std::size_t count = source.names().size();
    for (const camera::ImageFormat& format : source.formats()) {
      buffers_.emplace_back(format.size());
      images.emplace_back(buffers_.back());
    }
    frames.resize(count);
  }

  std::vector<std::span<std::byte>> images;
  std::vector<camera::Frame> frames;

 private:
  std::vector<std::vector<std::byte>> buffers_;
};

}  // namespace trifinger::test
