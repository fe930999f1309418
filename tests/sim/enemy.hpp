// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>

#include "trifinger/joint/counted.hpp"

namespace trifinger::test {

/// Acts like a user who wants to break a robot from a file: with numbers that make no sense, with
/// as much torque as he gets, to and fro, or always outwards, and with targets far away.
class Enemy {
 public:
  Enemy(std::uint32_t seed, std::size_t joints) : random_(seed), joints_(joints) {}

  [[nodiscard]] CountedAction next() {
    if (random_() % 50 == 0) way_ = static_cast<int>(random_() % 4);
    CountedAction action(joints_);
    for (std::size_t i = 0; i < joints_; ++i) {
      switch (way_) {
        case 0:
          action.torque[i] = any();
          action.position[i] = any();
          action.position_kp[i] = any();
          action.position_kd[i] = any();
          break;
        case 1:
          action.torque[i] = random_() % 2 == 0 ? 1e9 : -1e9;
          break;
        case 2:
          action.torque[i] = i % 2 == 0 ? 1e9 : -1e9;
          break;
        default:
          action.position[i] = std::uniform_real_distribution(-4.0, 4.0)(random_);
      }
    }
    return action;
  }

 private:
  double any() {
    constexpr std::array kNasty{std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::infinity(), -1e300, 1e300, 0.0};
    if (random_() % 4 == 0) return kNasty[random_() % kNasty.size()];
    return std::uniform_real_distribution(-20.0, 20.0)(random_);
  }

  std::mt19937 random_;
  std::size_t joints_;
  int way_{0};
};

}  // namespace trifinger::test
