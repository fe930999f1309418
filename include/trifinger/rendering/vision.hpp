// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/rendering/camera_renderer.hpp"
#include "trifinger/sim/object_observation.hpp"

namespace trifinger::rendering {

/// Finds objects in images: what a tracker is for a simulation. It remembers nothing of earlier
/// images, so one may serve many simulations in turn.
class ObjectFinder {
 public:
  ObjectFinder() = default;
  ObjectFinder(const ObjectFinder&) = delete;
  ObjectFinder& operator=(const ObjectFinder&) = delete;
  virtual ~ObjectFinder() = default;

  /// Finds the pose of each object of the scene, in their order. Before the call `poses` has those
  /// that the images before have shown; afterwards it has those in these images. A pose that was
  /// not found or may be wrong is empty.
  virtual void find(std::span<const std::span<const std::byte>> images,
                    std::span<std::optional<ObjectPose>> poses) = 0;
};

/// When the cameras of a simulated robot see something.
struct CaptureOptions {
  TimeIndex period{10};  ///< Steps between two captures, at least 1.
  TimeIndex delay{20};   ///< Steps from a capture until its images arrive.
  /// Steps from a capture until the poses of its objects arrive, with an `ObjectFinder`; at least
  /// `delay`. Default: `delay`.
  std::optional<TimeIndex> pose_delay{};

  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;
};

/// Draws what was captured, and finds objects in it. It remembers nothing of earlier images, so one
/// may serve many simulations in turn.
class VisionPipeline {
 public:
  /// Without `finder` nothing is found.
  /// @throws InvalidArgument, Error that says what to install if this machine cannot draw
  VisionPipeline(const SimulationOptions& robot, const std::vector<camera::Camera>& cameras,
                 const RenderingOptions& rendering, std::unique_ptr<ObjectFinder> finder);

  /// Draws the images of a configuration; see `CameraRenderer::render`. Then finds the objects in
  /// them; see `ObjectFinder::find`.
  void look(std::span<const double> configuration, std::uint64_t number,
            std::span<std::optional<ObjectPose>> poses);

  /// The images that were drawn last.
  [[nodiscard]] std::span<const std::span<const std::byte>> images() const noexcept {
    return images_;
  }
  [[nodiscard]] bool can_find() const noexcept { return finder_ != nullptr; }
  [[nodiscard]] CameraRenderer& renderer() noexcept { return renderer_; }

 private:
  CameraRenderer renderer_;
  std::unique_ptr<ObjectFinder> finder_;
  std::vector<std::vector<std::byte>> pixels_;
  std::vector<std::span<std::byte>> places_;  // of these, to be written
  std::vector<std::span<const std::byte>> images_;
};

/// What the cameras of one simulation have captured, and what of it has arrived. Images are drawn
/// when they arrive.
///
/// It is deterministic: what is captured, the random numbers of the session, and the pipeline
/// decide all images and poses, bit for bit, on one machine.
class CaptureQueue {
 public:
  /// Images that have arrived.
  struct Images {
    TimeIndex capture_index{-1};
    TimeIndex arrival_index{-1};
    std::int64_t number{-1};  ///< Counted from 0 in every session.
  };
  /// Poses that were found in images.
  struct Poses {
    TimeIndex capture_index{-1};
    TimeIndex arrival_index{-1};
    std::vector<ObjectPose> objects{};  ///< In the order of the scene.
  };

  /// @throws InvalidArgument
  CaptureQueue(const CaptureOptions& options, std::size_t num_objects);

  /// Begins a session. The noise of its images follows from `random`, and what they look like if
  /// that varies.
  void begin(const Random& random);
  /// Makes each session look different, in the ways of `RenderingVariation` but with one error of
  /// the calibration: that of `nominal`.
  void vary(const RenderingOptions& nominal) { nominal_ = nominal; }
  /// True if the scene is to be captured at this step: once before step 0, then every `period`.
  [[nodiscard]] bool is_due(TimeIndex now) const noexcept;
  /// Captures the scene: MuJoCo's `qpos`, then `qvel`.
  void capture(TimeIndex now, std::vector<double> configuration);
  /// Looks at what has arrived by step `now`. Returns true if there were new images: `pipeline` has
  /// the newest ones until it looks again. Without a finder, older ones are not drawn. If the
  /// pipeline throws, the images at which it looked are still there to be looked at.
  bool look(TimeIndex now, VisionPipeline& pipeline);
  /// The newest images at which somebody has looked.
  [[nodiscard]] const Images& images() const noexcept { return images_; }
  /// Takes the oldest poses that have arrived by step `now` and were not taken yet. Images in which
  /// an object was not found have none.
  [[nodiscard]] std::optional<Poses> take_poses(TimeIndex now);

 private:
  struct Capture {
    Images images;
    std::vector<double> configuration;
  };

  CaptureOptions options_;
  std::optional<RenderingOptions> nominal_;
  RenderingOptions look_;  // of this session, if sessions differ
  std::uint64_t noise_{0};
  std::int64_t num_captures_{0};
  TimeIndex next_{0};
  std::deque<Capture> under_way_;
  Images images_;
  std::vector<std::optional<ObjectPose>> found_;  // poses in the newest images
  std::deque<Poses> poses_;                       // poses that were not taken yet
};

}  // namespace trifinger::rendering
