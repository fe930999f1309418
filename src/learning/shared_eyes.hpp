// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <mutex>
#include <utility>
#include <vector>

#include "trifinger/rendering/simulation_that_sees.hpp"

namespace trifinger::learning {

// Eyes for the threads of a batch: a pair for each that can be at work at one time.
class SharedEyes {
 public:
  void add(rendering::Eyes eyes) {
    all_.push_back(std::move(eyes));
    free_.push_back(&all_.back());
  }

  // A pair that nobody else uses.
  class Use {
   public:
    explicit Use(SharedEyes& shared) : shared_(shared), eyes_(shared.take()) {}
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    ~Use() {
      const std::lock_guard lock(shared_.mutex_);
      shared_.free_.push_back(eyes_);
    }

    [[nodiscard]] rendering::Eyes& operator*() const noexcept { return *eyes_; }

   private:
    SharedEyes& shared_;
    rendering::Eyes* eyes_;
  };

 private:
  rendering::Eyes* take() {
    const std::lock_guard lock(mutex_);
    rendering::Eyes* const eyes = free_.back();
    free_.pop_back();
    return eyes;
  }

  std::mutex mutex_;
  std::deque<rendering::Eyes> all_;
  std::vector<rendering::Eyes*> free_;
};

}  // namespace trifinger::learning
