// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>

#include "trifinger/base/time.hpp"

namespace trifinger::camera {

// The calls of the system that a Video4Linux camera needs. Tests replace them, because containers
// have no cameras. Failing calls return -1 and set errno, as those of the system do.
class VideoSystem {
 public:
  VideoSystem() = default;
  VideoSystem(const VideoSystem&) = delete;
  VideoSystem& operator=(const VideoSystem&) = delete;
  virtual ~VideoSystem() = default;

  [[nodiscard]] virtual int open(const std::string& path) = 0;
  virtual void close(int file) = 0;
  // The serial number of the device behind this path; empty if it has none.
  [[nodiscard]] virtual std::string serial_of(const std::string& path) = 0;
  [[nodiscard]] virtual int ioctl(int file, unsigned long request, void* argument) = 0;
  // nullptr if it fails.
  [[nodiscard]] virtual std::byte* map(int file, std::size_t size, std::size_t offset) = 0;
  virtual void unmap(std::byte* memory, std::size_t size) = 0;
  // Waits until a buffer can be taken or the device has an error. False if neither has happened.
  [[nodiscard]] virtual bool wait(int file, Timeout timeout) = 0;

  // That of the machine.
  [[nodiscard]] static VideoSystem& machine();
};

}  // namespace trifinger::camera
