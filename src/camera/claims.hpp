// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mutex>
#include <set>
#include <string>
#include <utility>

namespace trifinger::camera {

// Which devices belong to some camera already, for cameras that take any that is left. Threads
// share it.
class Claims {
 public:
  explicit Claims(std::set<std::string> taken = {}) : taken_(std::move(taken)) {}

  // Takes the device with this serial number and this name, one of which may be empty. False if it
  // is somebody else's.
  [[nodiscard]] bool take(const std::string& serial, const std::string& name) {
    const std::lock_guard lock(mutex_);
    if (taken_.contains(serial) || taken_.contains(name)) return false;
    if (!serial.empty()) taken_.insert(serial);
    if (!name.empty()) taken_.insert(name);
    return true;
  }
  void give_back(const std::string& serial, const std::string& name) {
    const std::lock_guard lock(mutex_);
    taken_.erase(serial);
    taken_.erase(name);
  }

 private:
  std::mutex mutex_;
  std::set<std::string> taken_;
};

}  // namespace trifinger::camera
