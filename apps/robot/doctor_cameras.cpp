// SPDX-License-Identifier: BSD-3-Clause
#include "robot/doctor_cameras.hpp"

#include <fmt/core.h>

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include "tracking/diagnosis.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/sim/object_observation.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

// The good images, of each camera one or none.
std::vector<std::vector<std::byte>> copied(const camera::Images& images) {
  std::vector<std::vector<std::byte>> copies(images.infos().size());
  for (std::size_t i = 0; i < copies.size(); ++i) {
    if (images.infos()[i].frame().state != camera::Frame::State::kGood) continue;
    const std::span<const std::byte> pixels = images.pixels(i);
    copies[i].assign(pixels.begin(), pixels.end());
  }
  images.require_valid();
  return copies;
}

Finding judged(const ObjectDescription& object, const std::vector<camera::Camera>& cameras,
               camera::LiveCameras& live) {
  constexpr int kLooks = 3;  // fingers may hide much at one instant
  constexpr auto kWait = std::chrono::seconds(5);
  tracking::Diagnosis found;
  for (int look = 0; look < kLooks; ++look) {
    const std::optional<camera::Images> images = live.next(kWait);
    if (!images) {
      return {"cameras", Verdict::kFails, "deliver no images", "see what 'trifinger cameras' says"};
    }
    const std::vector<std::vector<std::byte>> copies = copied(*images);
    tracking::Diagnosis diagnosis = tracking::diagnose(
        cameras, tracking::tracked_object(object), tracking::ColourModel::standard(),
        std::vector<std::span<const std::byte>>(copies.begin(), copies.end()));
    if (diagnosis.estimate.is_sure()) {
      return {object.name, Verdict::kGood,
              fmt::format("the images of {} cameras fit together", diagnosis.estimate.cameras), ""};
    }
    if (!diagnosis.fault.empty()) found = std::move(diagnosis);
  }
  if (!found.fault.empty()) {
    return {object.name, Verdict::kFails, found.fault, found.remedy};
  }
  return {object.name, Verdict::kNote, "is not seen well enough to judge the cameras by it",
          "lay it where all cameras see it, away from the fingers, and look with 'trifinger look'"};
}

}  // namespace

std::vector<Finding> examine_cameras(const std::string& robot) {
  const Session session = Session::open(robot);
  const RobotConfig config = read_robot_config(config_file_of(session));
  const std::vector<ObjectDescription>& objects = objects_of(config.simulation);
  if (objects.empty()) {
    throw InvalidArgument("robot '" + robot +
                          "' has no objects to judge its cameras by; 'objects' in its "
                          "configuration names them");
  }
  const std::vector<camera::Camera> cameras = camera::calibration_of(session).cameras;
  camera::LiveCameras live(robot, cameras);
  std::vector<Finding> findings;
  findings.reserve(objects.size());
  for (const ObjectDescription& object : objects) {
    findings.push_back(judged(object, cameras, live));
  }
  return findings;
}

}  // namespace trifinger::apps
