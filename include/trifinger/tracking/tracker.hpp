// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/tracking/colour_model.hpp"
#include "trifinger/tracking/tracked_object.hpp"

namespace trifinger::tracking {

struct TrackerOptions {
  /// How far the calibration of a camera may shift its image: standard deviation [pixel].
  double calibration_error{0.5};
  /// Where the object's centre is searched: this far from the world's z axis [m]...
  double search_radius{0.22};
  double search_bottom{0.0};  ///< ...and between these heights [m]. The lower one is the table's.
  double search_top{0.22};
};

/// Where an object is, as images show it.
struct Estimate {
  enum class State {
    kNotFound,  ///< Nothing in the images looks like the object. The pose means nothing.
    kUnsure,    ///< The pose is the best guess, but it may be wrong.
    kSure,      ///< The pose is good to about its standard deviations.
  };

  State state{State::kNotFound};
  Eigen::Isometry3d pose{Eigen::Isometry3d::Identity()};  ///< Pose of the object in the world.
  Eigen::Vector3d position_deviation{Eigen::Vector3d::Zero()};  ///< Standard deviations [m].
  /// Standard deviations of a rotation about the world's axes [rad].
  Eigen::Vector3d rotation_deviation{Eigen::Vector3d::Zero()};
  double confidence{0};  ///< Confidence from 0 to 1, at least 0.5 if the state is `kSure`.
  int cameras{0};        ///< Cameras that show the object.
  int faces{0};          ///< Faces that at least one camera shows.
  double residual{0};    ///< Root mean square distance of measured from expected edges [pixel].

  [[nodiscard]] bool is_sure() const noexcept { return state == State::kSure; }
};

/// Finds an object with coloured faces in the images of calibrated cameras, taken at one time.
///
/// Knows nothing of earlier images: the same images give the same estimate. Not thread-safe.
class Tracker {
 public:
  /// @throws InvalidArgument if there is no camera or more than 8, if a camera has no colours or
  /// its size is odd, or if the object has a colour that the model does not know
  Tracker(std::vector<camera::Camera> cameras, TrackedObject object,
          const ColourModel& colours = ColourModel::standard(), const TrackerOptions& options = {});
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;
  ~Tracker();

  /// Where the object is in these images, one of each camera. An empty image stands for one that is
  /// missing or damaged. `guess` is where the object may be, such as its last pose. It saves time
  /// if it is near, and it is forgotten if the images do not confirm it or if a number in it is not
  /// finite. Does not allocate.
  /// @throws InvalidArgument if the number of images or the size of one is wrong
  [[nodiscard]] Estimate track(std::span<const std::span<const std::byte>> images,
                               const Eigen::Isometry3d* guess = nullptr);

  [[nodiscard]] const std::vector<camera::Camera>& cameras() const noexcept;
  [[nodiscard]] const TrackedObject& object() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace trifinger::tracking
