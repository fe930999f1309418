// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/tracking/colour_model.hpp"
#include "trifinger/tracking/tracked_object.hpp"
#include "trifinger/tracking/tracker.hpp"

namespace trifinger::tracking {

// What images of an object say of the cameras that took them.
struct Diagnosis {
  Estimate estimate{};  // from the images as they are; if it is sure, nothing is wrong
  // What is wrong, without a full stop: "camera180 and camera300 are exchanged". Empty if nothing
  // is, or if nothing known explains the images.
  std::string fault{};
  std::string remedy{};
};

// Looks for what is wrong if an estimate is not sure: under which assumption would it be? Cameras
// may be exchanged, images mirrored, upside down, or of another instant, red and blue exchanged,
// and the object may have another size or other colours. Takes some seconds. Throws InvalidArgument
// like Tracker.
[[nodiscard]] Diagnosis diagnose(const std::vector<camera::Camera>& cameras,
                                 const TrackedObject& object, const ColourModel& colours,
                                 std::span<const std::span<const std::byte>> images);

}  // namespace trifinger::tracking
