// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <mutex>
#include <utility>
#include <vector>

#include "trifinger/rendering/simulation_with_cameras.hpp"

namespace trifinger::learning {

// A vision pipeline for each thread of a batch that can be at work at one time.
class SharedPipelines {
 public:
  void add(rendering::VisionPipeline pipeline) {
    all_.push_back(std::move(pipeline));
    free_.push_back(&all_.back());
  }

  // A pipeline that nobody else uses.
  class Use {
   public:
    explicit Use(SharedPipelines& shared) : shared_(shared), pipeline_(shared.take()) {}
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    ~Use() {
      const std::lock_guard lock(shared_.mutex_);
      shared_.free_.push_back(pipeline_);
    }

    [[nodiscard]] rendering::VisionPipeline& operator*() const noexcept { return *pipeline_; }

   private:
    SharedPipelines& shared_;
    rendering::VisionPipeline* pipeline_;
  };

 private:
  rendering::VisionPipeline* take() {
    const std::lock_guard lock(mutex_);
    rendering::VisionPipeline* const pipeline = free_.back();
    free_.pop_back();
    return pipeline;
  }

  std::mutex mutex_;
  std::deque<rendering::VisionPipeline> all_;
  std::vector<rendering::VisionPipeline*> free_;
};

}  // namespace trifinger::learning
