// SPDX-License-Identifier: BSD-3-Clause
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "harness.hpp"
#include "rendering/context.hpp"
#include "sim/robot_cameras.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/rendering/camera_renderer.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr int kTriples = 30;

// The fingers move a little from image to image.
std::vector<double> scene(const RobotModel& model, int number) {
  const mjModel& mujoco = *model.mujoco();
  std::vector<double> configuration(mujoco.key_qpos, mujoco.key_qpos + mujoco.nq);
  for (int i = 0; i < model.num_joints(); ++i) {
    configuration[static_cast<std::size_t>(i)] += 0.05 * std::sin(0.3 * number);
  }
  return configuration;
}

// The same views by MuJoCo alone: without lens, mosaic and noise, and without shadows.
class BarePictures {
 public:
  BarePictures(const RobotModel& model, int size)
      : use_(context_), model_(model.copy()), data_(model.make_data()), size_(size) {
    model_->vis.global.offwidth = model_->vis.global.offheight = size;
    model_->vis.quality.offsamples = 0;
    mjv_defaultOption(&option_);
    mjv_defaultCamera(&camera_);
    camera_.type = mjCAMERA_FIXED;
    mjv_defaultScene(&scene_);
    mjv_makeScene(model_.get(), &scene_, 1000);
    scene_.flags[mjRND_SHADOW] = scene_.flags[mjRND_REFLECTION] = 0;
    mjr_defaultContext(&pictures_);
    mjr_makeContext(model_.get(), &pictures_, mjFONTSCALE_50);
    mjr_setBuffer(mjFB_OFFSCREEN, &pictures_);
    pixels_.resize(3 * static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
  }
  BarePictures(const BarePictures&) = delete;
  BarePictures& operator=(const BarePictures&) = delete;
  ~BarePictures() {
    mjr_freeContext(&pictures_);
    mjv_freeScene(&scene_);
  }

  void draw(std::span<const double> configuration) {
    std::ranges::copy(configuration, data_->qpos);
    mj_forward(model_.get(), data_.get());
    for (camera_.fixedcamid = 0; camera_.fixedcamid < 3; ++camera_.fixedcamid) {
      mjv_updateScene(model_.get(), data_.get(), &option_, nullptr, &camera_, mjCAT_ALL, &scene_);
      const mjrRect whole{0, 0, size_, size_};
      mjr_render(whole, &scene_, &pictures_);
      mjr_readPixels(pixels_.data(), nullptr, whole, &pictures_);
    }
  }

 private:
  rendering::Context context_;
  rendering::Context::Use use_;
  SceneModel::Compiled model_;
  SceneModel::Data data_;
  int size_;
  mjvOption option_{};
  mjvCamera camera_{};
  mjvScene scene_{};
  mjrContext pictures_{};
  std::vector<unsigned char> pixels_;
};

Row rendered(const Effort& effort, int reduction, const std::string& reach, double least) {
  const RobotModel model({}, Detail::kPictures);
  std::vector<camera::Camera> cameras = calibration_of_figures({}).cameras;
  for (camera::Camera& camera : cameras) camera = camera.reduced(reduction);
  const int size = cameras[0].format.width;
  rendering::CameraRenderer renderer({}, cameras);
  BarePictures bare(model, size);
  std::vector<std::vector<std::byte>> images(cameras.size());
  std::vector<std::span<std::byte>> places;
  for (std::size_t i = 0; i < images.size(); ++i) {
    images[i].resize(cameras[i].format.size());
    places.emplace_back(images[i]);
  }
  const int triples = static_cast<int>(kTriples * effort.share);
  const auto rate = [&](const auto& draw) {
    const auto begin = Clock::now();
    for (int number = 0; number < triples; ++number) draw(number, scene(model, number));
    return triples / seconds_since(begin);
  };
  const Paired paired = alternate(
      effort.rounds,
      [&] {
        return rate([&](int number, const std::vector<double>& configuration) {
          renderer.render(configuration, static_cast<std::uint64_t>(number), places);
        });
      },
      [&] {
        return rate(
            [&](int, const std::vector<double>& configuration) { bare.draw(configuration); });
      });
  return make_row("three simulated images " + std::to_string(size) + " x " + std::to_string(size) +
                      ", lens, mosaic and noise, one processor",
                  "triples/s", paired, "three pictures by MuJoCo without lens, mosaic and shadows",
                  reach, least == 0 || paired.measure.median() >= least);
}

}  // namespace

std::vector<Row> cameras(const Effort& effort) {
  // Mesa draws with a thread per processor that it may use.
  pin(0);
  return {rendered(effort, 2, ">= 60 triples/s", 60), rendered(effort, 1, "", 0)};
}

}  // namespace trifinger::benchmarks
