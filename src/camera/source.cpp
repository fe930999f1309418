// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/source.hpp"

namespace trifinger::camera {

std::string_view name_of(Frame::State state) noexcept {
  switch (state) {
    case Frame::State::kNone:
      return "none";
    case Frame::State::kGood:
      return "good";
    case Frame::State::kDamaged:
      return "damaged";
    case Frame::State::kLost:
      return "lost";
  }
  return "unknown";
}

}  // namespace trifinger::camera
