// SPDX-License-Identifier: BSD-3-Clause
#include "robot/wear_recorder.hpp"

#include <chrono>
#include <filesystem>
#include <utility>

#include "core/log_folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::apps {
namespace {

constexpr Nanoseconds kInterval = std::chrono::minutes(1);

}  // namespace

WearRecorder::WearRecorder(const std::string& robot, boards::BoardRobot& driver,
                           const SessionHost& host)
    : driver_(driver), host_(host), written_(std::chrono::steady_clock::now()) {
  try {
    open(robot);
  } catch (const Error& error) {
    file_.reset();
    message_ = std::string("running hours are not kept: ") + error.what();
  }
}

WearRecorder::~WearRecorder() {
  try {
    static_cast<void>(write());
  } catch (...) {
    // There is no memory for it. The newest record stays.
    return;
  }
}

void WearRecorder::open(const std::string& robot) {
  const std::filesystem::path path = log_folder() / (robot + ".wear");
  const CompanionDescription& wear = driver_.wear_description();
  file_.emplace(path, boards::WearFile::Owner{.robot = robot, .type = wear.type}, wear.element);
  message_ = file_->damage();
  driver_.continue_wear(file_->newest());
  // Counts the start.
  take();
}

void WearRecorder::take() {
  std::vector<std::byte> bytes = driver_.wear_bytes();
  const std::lock_guard lock(mutex_);
  taken_ = std::move(bytes);
}

bool WearRecorder::is_due() const {
  return std::chrono::steady_clock::now() - written_ >= kInterval;
}

std::string WearRecorder::look() {
  // A disk that refuses is not asked all the time.
  return is_failing_ && !is_due() ? std::exchange(message_, {}) : write();
}

std::string WearRecorder::write() {
  std::optional<std::vector<std::byte>> element;
  if (file_) element = newest();
  if (!element) return std::exchange(message_, {});
  written_ = std::chrono::steady_clock::now();
  try {
    file_->append(*element);
    if (std::exchange(is_failing_, false)) message_ = "running hours are written again";
  } catch (const Error& error) {
    if (!std::exchange(is_failing_, true)) {
      message_ =
          std::string("running hours cannot be written, they wait in memory: ") + error.what();
    }
    const std::lock_guard lock(mutex_);
    if (!taken_) taken_ = std::move(element);
  }
  return std::exchange(message_, {});
}

// Returns what to write now.
std::optional<std::vector<std::byte>> WearRecorder::newest() {
  {
    const std::lock_guard lock(mutex_);
    if (taken_) return std::exchange(taken_, std::nullopt);
  }
  if (!is_due()) return std::nullopt;
  written_ = std::chrono::steady_clock::now();
  const CompanionDescription& wear = driver_.wear_description();
  try {
    // The driver belongs to the loop; what it has shown does not.
    const UntypedFrontend shown(host_.open(wear.name));
    // What has ended has been taken, and that is newer.
    if (shown.session().info().phase == SessionInfo::Phase::kEnded) return std::nullopt;
    const TimeIndex end = shown.range(Series::kObservation).second;
    std::vector<std::byte> element(wear.element.size());
    if (end > 0 && shown.try_get(Series::kObservation, end - 1, element.data())) return element;
  } catch (const Error&) {
    // There is no session now, or another one has just begun.
  }
  return std::nullopt;
}

}  // namespace trifinger::apps
