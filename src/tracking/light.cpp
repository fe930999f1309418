// SPDX-License-Identifier: BSD-3-Clause
#include "light.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trifinger::tracking::detail {
namespace {

constexpr double kStep = 0.12;         // between lights: log of a gain
constexpr double kUsual = 0.1;         // standard deviation of the log of a gain
constexpr double kIndependent = 0.05;  // what a sample of a face says that the others do not say
constexpr double kGrazingLight = 0.15;

}  // namespace

LightFit::LightFit(const Shape& shape, const ColourTable& table) : shape_(&shape), table_(&table) {
  constexpr int kMiddle = kSteps / 2;  // the usual light
  std::size_t place = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double red = kStep * (i - kMiddle);
      const double blue = kStep * (j - kMiddle);
      const double mean = (red + blue) / 3;  // the brightness stays
      lights_[place] = {std::exp(red - mean), std::exp(-mean), std::exp(blue - mean)};
      costs_[place++] = (red * red + blue * blue) / (2 * kUsual * kUsual);
    }
  }
  std::size_t samples = 0;
  for (const Face& face : shape.faces) samples += face.samples.size();
  samples_.reserve(samples);
  shown_.reserve(shape.faces.size());
  evidence_.resize(kLights * shape.faces.size() * table.num_colours());
  seen_.resize(shape.faces.size() * table.num_colours());
  scores_.resize(shape.turns.size() + 1);
  for (auto& lights : best_lights_) lights.resize(scores_.size());
}

void LightFit::read_samples(const View& view, const Eigen::Isometry3d& pose) noexcept {
  samples_.clear();
  shown_.clear();
  for (std::size_t i = 0; i < shape_->faces.size(); ++i) {
    const Face& face = shape_->faces[i];
    if (facing(view, pose, face) < kGrazingLight) continue;
    shown_.push_back(i);
    for (const Eigen::Vector3d& point : face.samples) {
      const Eigen::Vector2d pixel = view.project(pose * point);
      if (!view.image.contains(pixel, 3)) continue;
      samples_.push_back(
          {i, view.image.colour(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()))});
    }
  }
}

void LightFit::weigh_faces(const View& view) noexcept {
  std::ranges::fill(evidence_, 0.0F);
  const std::size_t colours = table_->num_colours();
  for (std::size_t l = 0; l < kLights; ++l) {
    const Eigen::Vector3f gains = (view.image.balance().array() * lights_[l].array()).cast<float>();
    float* const evidence = evidence_.data() + l * shape_->faces.size() * colours;
    for (const Sample& sample : samples_) {
      const float* const densities = table_->evidence(sample.colour.cwiseProduct(gains));
      float* const sum = evidence + sample.face * colours;
      for (std::size_t k = 0; k < colours; ++k) sum[k] += densities[k];
    }
  }
}

// How well the shown faces have their colours in this light, after this turn.
double LightFit::score(std::size_t light, std::size_t turn) const noexcept {
  // Many small faces do not say more than a few large ones.
  constexpr double kMost = 111;  // samples: three faces of a box
  const std::size_t colours = table_->num_colours();
  const float* const evidence = evidence_.data() + light * shape_->faces.size() * colours;
  double sum = 0;
  for (const std::size_t i : shown_) {
    const std::size_t face = turn == 0 ? i : shape_->turns[turn - 1].order[i];
    sum += static_cast<double>(evidence[i * colours + shape_->faces[face].label]);
  }
  const double weight =
      kIndependent * std::min(1.0, kMost / std::max(1.0, static_cast<double>(samples_.size())));
  return weight * sum - costs_[light];
}

// Of the face for whose samples another colour is the likeliest by most.
template <class Number>
double LightFit::contradiction(const Number* evidence) const noexcept {
  double worst = 0;
  const std::size_t colours = table_->num_colours();
  for (std::size_t i = 0; i < shape_->faces.size(); ++i) {
    const Number* const own = evidence + i * colours;
    const auto over =
        static_cast<double>(*std::max_element(own, own + colours) - own[shape_->faces[i].label]);
    worst = std::max(worst, kIndependent * over);
  }
  return worst;
}

LightFit::Answer LightFit::fit(const std::vector<View>& views,
                               const Eigen::Isometry3d& pose) noexcept {
  Answer answer;
  answer.lights.fill(Eigen::Vector3d::Ones());
  answer.lights_as_it_is.fill(Eigen::Vector3d::Ones());
  std::ranges::fill(scores_, 0.0);
  std::ranges::fill(seen_, 0.0);
  std::array<bool, kMaxCameras> is_read{};
  for (std::size_t c = 0; c < views.size(); ++c) {
    const View& view = views[c];
    if (!view.image.exists() || view.seen(pose.translation()).z() < 1.5 * shape_->radius) continue;
    is_read[c] = true;
    read_samples(view, pose);
    weigh_faces(view);
    for (std::size_t t = 0; t < scores_.size(); ++t) {
      double best = -std::numeric_limits<double>::infinity();
      for (std::size_t l = 0; l < kLights; ++l) {
        const double score_here = score(l, t);
        if (score_here <= best) continue;
        best = score_here;
        best_lights_[c][t] = l;
      }
      scores_[t] += best;
    }
    const float* const evidence = evidence_.data() + best_lights_[c][0] * seen_.size();
    answer.image_contradiction = std::max(answer.image_contradiction, contradiction(evidence));
    for (std::size_t i = 0; i < seen_.size(); ++i) seen_[i] += static_cast<double>(evidence[i]);
  }
  answer.contradiction = contradiction(seen_.data());
  const auto best = std::ranges::max_element(scores_);
  const auto place = static_cast<std::size_t>(best - scores_.begin());
  if (place > 0) answer.turn = &shape_->turns[place - 1];
  double next = -std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < scores_.size(); ++t) {
    if (t != place) next = std::max(next, scores_[t]);
  }
  answer.margin = *best - next;
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (!is_read[c]) continue;
    answer.lights[c] = lights_[best_lights_[c][place]];
    answer.lights_as_it_is[c] = lights_[best_lights_[c][0]];
  }
  return answer;
}

}  // namespace trifinger::tracking::detail
