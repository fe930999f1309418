// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/camera_renderer.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "base/moved.hpp"
#include "base/text_of.hpp"
#include "rendering/context.hpp"
#include "scene.hpp"
#include "sensor.hpp"
#include "trifinger/base/error.hpp"
#include "view.hpp"

namespace trifinger::rendering {
namespace {

using trifinger::detail::require;
using trifinger::detail::text_of;

constexpr int kRgba = 0x1908;           // OpenGL's name of a format
constexpr int kLargestPicture = 16384;  // of Mesa and of all drivers since 2010 [pixel]
constexpr double kMinBlur = 0.3;  // Less displacement during the exposure shows no blur [pixel].

// The wall of the open hardware is made of clear polycarbonate.
bool has_clear_wall(const SimulationOptions& robot) {
  return robot.file == nullptr && robot.description.variant == Variant::kEdu &&
         robot.description.arrangement == Arrangement::kTriFinger;
}

double seconds(Nanoseconds time) { return std::chrono::duration<double>(time).count(); }

}  // namespace

class CameraRenderer::Implementation {
 public:
  Implementation(const SimulationOptions& robot, std::vector<camera::Camera> cameras,
                 const RenderingOptions& options)
      : model_(make_model(robot, Detail::kPictures)),
        drawn_(model_->copy()),
        data_(model_->make_data()),
        later_(model_->make_data()),
        scene_(*drawn_, initial_data(), has_clear_wall(robot)),
        cameras_(std::move(cameras)) {
    require(!cameras_.empty(), "a renderer needs a camera");
    for (const camera::Camera& camera : cameras_) {
      require(camera.format.width >= 2 && camera.format.height >= 2,
              text_of("images of ", camera.name, " have ", camera.format.width, " x ",
                      camera.format.height, " pixels, must have at least 2 x 2"));
    }
    set_options(options);
  }
  ~Implementation() { free_pictures(); }

  void set_options(const RenderingOptions& options) {
    options.validate();
    const bool is_first = views_.empty();
    const bool moves_cameras =
        is_first || options.calibration_error != options_.calibration_error ||
        options.detail != options_.detail ||
        (options.calibration_error > 0 && options.calibration_seed != options_.calibration_seed);
    const bool changes_pictures =
        moves_cameras || options.multisampling != options_.multisampling ||
        options.shadows != options_.shadows || options.roundness != options_.roundness;
    if (moves_cameras) make_views(options);
    options_ = options;
    if (changes_pictures) make_pictures();
    scene_.set_options(options_);
    sensors_.clear();
    for (const camera::Camera& camera : cameras_) sensors_.emplace_back(camera.format, options_);
  }

  void render(std::span<const double> configuration, std::uint64_t number,
              std::span<const std::span<std::byte>> images) {
    check(configuration, images);
    std::ranges::copy(configuration.first(num_positions()), data_->qpos);
    mj_normalizeQuat(drawn_.get(), data_->qpos);
    mj_kinematics(drawn_.get(), data_.get());
    for (std::vector<std::uint32_t>& sums : sums_) std::ranges::fill(sums, 0U);
    const std::span<const double> velocity = configuration.subspan(num_positions());
    const int steps = velocity.empty() ? 1 : count_steps(velocity);

    const Context::Use use(context_);
    if (steps == 1) {
      draw(*data_);
    } else {
      // In the middle of each of these parts of the exposure, whose middle is the configuration.
      for (int step = 0; step < steps; ++step) {
        move(velocity, ((step + 0.5) / steps - 0.5) * seconds(options_.exposure));
        draw(*later_);
      }
    }
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      const std::uint64_t key = (options_.seed * 0x100000001b3U + number) * 64 + i;
      sensors_[i].expose(sums_[i], steps * views_[i].samples(), key, images[i]);
    }
  }

  [[nodiscard]] const SceneModel& model() const noexcept { return *model_; }
  [[nodiscard]] const std::vector<camera::Camera>& cameras() const noexcept { return cameras_; }
  [[nodiscard]] const std::vector<camera::Camera>& true_cameras() const noexcept {
    return true_cameras_;
  }
  [[nodiscard]] const RenderingOptions& options() const noexcept { return options_; }

 private:
  [[nodiscard]] std::size_t num_positions() const { return static_cast<std::size_t>(drawn_->nq); }
  [[nodiscard]] std::size_t num_velocities() const { return static_cast<std::size_t>(drawn_->nv); }

  mjData& initial_data() {
    model_->reset(*data_);
    mj_forward(drawn_.get(), data_.get());
    return *data_;
  }

  void make_views(const RenderingOptions& options) {
    // Nothing of this object changes if the pictures would be too large.
    std::vector<camera::Camera> true_cameras = cameras_;
    Random random{.seed = options.calibration_seed, .episode = 3};
    if (options.calibration_error > 0) {
      for (camera::Camera& camera : true_cameras) {
        camera = misaligned(camera, options.calibration_error, random);
      }
    }
    std::vector<detail::View> views;
    int width = 0;
    int height = 0;
    for (const camera::Camera& camera : true_cameras) {
      views.emplace_back(camera, options.detail);
      width += views.back().width();
      height = std::max(height, views.back().height());
    }
    require(width <= kLargestPicture && height <= kLargestPicture,
            text_of("the images need pictures of ", width, " x ", height,
                    " pixels side by side, more than ", kLargestPicture));
    int left = 0;
    for (detail::View& view : views) {
      view.place(left, width);
      left += view.width();
    }
    true_cameras_ = std::move(true_cameras);
    width_ = width;
    height_ = height;
    views_ = std::move(views);
    sums_.clear();
    for (const camera::Camera& camera : cameras_) sums_.emplace_back(camera.format.size());
    pixels_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) *
                   detail::kPictureChannels);
  }

  // Makes what MuJoCo needs to draw, inside of OpenGL.
  void make_pictures() {
    const Context::Use use(context_);
    if (std::exchange(has_pictures_, false)) mjr_freeContext(&pictures_);
    mjVisual& visual = drawn_->vis;
    visual.global.offwidth = width_;
    visual.global.offheight = height_;
    visual.quality.offsamples = options_.multisampling;
    visual.quality.numslices = options_.roundness;
    visual.quality.numstacks = std::max(4, options_.roundness / 2);
    // The lamp is far away, so a face of a box has one brightness and needs no parts.
    visual.quality.numquads = 1;
    visual.quality.shadowsize = options_.shadows ? 2048 : 0;
    visual.map.shadowclip = 0.6F;
    mjr_defaultContext(&pictures_);
    mjr_makeContext(drawn_.get(), &pictures_, mjFONTSCALE_50);
    has_pictures_ = true;
    pictures_.readPixelFormat = kRgba;
    mjr_setBuffer(mjFB_OFFSCREEN, &pictures_);
  }

  void free_pictures() noexcept {
    if (!has_pictures_) return;
    try {
      const Context::Use use(context_);
      mjr_freeContext(&pictures_);
    } catch (const Error&) {  // then the context takes it along
    }
  }

  void check(std::span<const double> configuration,
             std::span<const std::span<std::byte>> images) const {
    const std::size_t positions = num_positions();
    require(
        configuration.size() == positions || configuration.size() == positions + num_velocities(),
        text_of("a configuration has ", configuration.size(), " numbers, must have ", positions,
                ", or ", positions + num_velocities(), " with velocities"));
    require(std::ranges::all_of(configuration, [](double number) { return std::isfinite(number); }),
            "a number of the configuration is not finite");
    require(images.size() == cameras_.size(),
            text_of(images.size(), " images were given for ", cameras_.size(), " cameras"));
    for (std::size_t i = 0; i < images.size(); ++i) {
      require(images[i].size() == cameras_[i].format.size(),
              text_of("the image of ", cameras_[i].name, " has ", images[i].size(),
                      " bytes, must have ", cameras_[i].format.size()));
    }
  }

  // Moves `later_` to where the scene is `time` seconds after the configuration.
  void move(std::span<const double> velocity, double time) {
    std::copy_n(data_->qpos, drawn_->nq, later_->qpos);
    mj_integratePos(drawn_.get(), later_->qpos, velocity.data(), time);
    mj_kinematics(drawn_.get(), later_.get());
  }

  // The number of pictures that the blur of this movement needs.
  int count_steps(std::span<const double> velocity) {
    if (options_.blur_steps == 1 || options_.exposure <= Nanoseconds::zero()) return 1;
    move(velocity, seconds(options_.exposure));
    const double displacement = scene_.displacement(*data_, *later_, views_);
    if (displacement < kMinBlur) return 1;
    return std::clamp(static_cast<int>(std::ceil(2 * displacement)), 2, options_.blur_steps);
  }

  // Draws the pictures of all cameras and adds what their images show to the sums.
  void draw(const mjData& data) {
    scene_.move(data);
    int left = 0;
    for (const detail::View& view : views_) {
      mjr_render({left, 0, view.width(), view.height()}, &scene_.seen_by(view), &pictures_);
      left += view.width();
    }
    mjr_readPixels(pixels_.data(), nullptr, {0, 0, width_, height_}, &pictures_);
    for (std::size_t i = 0; i < views_.size(); ++i) views_[i].sample(pixels_.data(), sums_[i]);
  }

  std::shared_ptr<const SceneModel> model_;
  SceneModel::Compiled drawn_;
  SceneModel::Data data_;
  SceneModel::Data later_;
  detail::Scene scene_;
  std::vector<camera::Camera> cameras_;
  std::vector<camera::Camera> true_cameras_;
  RenderingOptions options_{};
  Context context_;
  mjrContext pictures_{};
  bool has_pictures_{false};
  std::vector<detail::View> views_;
  std::vector<detail::Sensor> sensors_;
  std::vector<std::vector<std::uint32_t>> sums_;
  std::vector<std::uint8_t> pixels_;
  int width_{0}, height_{0};  // of all pictures together
};

CameraRenderer::CameraRenderer(const SimulationOptions& robot, std::vector<camera::Camera> cameras,
                               const RenderingOptions& options)
    : implementation_(std::make_unique<Implementation>(robot, std::move(cameras), options)) {}
CameraRenderer::CameraRenderer(CameraRenderer&&) noexcept = default;
CameraRenderer& CameraRenderer::operator=(CameraRenderer&&) noexcept = default;
CameraRenderer::~CameraRenderer() = default;

const SceneModel& CameraRenderer::model() const noexcept {
  return checked(implementation_)->model();
}
const std::vector<camera::Camera>& CameraRenderer::cameras() const noexcept {
  return checked(implementation_)->cameras();
}
const std::vector<camera::Camera>& CameraRenderer::true_cameras() const noexcept {
  return checked(implementation_)->true_cameras();
}
const RenderingOptions& CameraRenderer::options() const noexcept {
  return checked(implementation_)->options();
}
void CameraRenderer::set_options(const RenderingOptions& options) {
  checked(implementation_)->set_options(options);
}
void CameraRenderer::render(std::span<const double> configuration, std::uint64_t number,
                            std::span<const std::span<std::byte>> images) {
  checked(implementation_)->render(configuration, number, images);
}

}  // namespace trifinger::rendering
