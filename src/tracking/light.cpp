// SPDX-License-Identifier: BSD-3-Clause
#include "light.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

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
  exchanges_.resize(table.num_colours() * (table.num_colours() - 1) / 2);
  scores_.resize(shape.turns.size() + 1);
  for (auto& lights : best_lights_) lights.resize(scores_.size());
}

void LightFit::read_samples(const View& view, const Eigen::Isometry3d& pose) noexcept {
  const Eigen::Vector3f balance = view.image.balance().cast<float>();
  samples_.clear();
  shown_.clear();
  for (std::size_t i = 0; i < shape_->faces.size(); ++i) {
    const Face& face = shape_->faces[i];
    if (facing(view, pose, face) < kGrazingLight) continue;
    shown_.push_back(i);
    for (const Eigen::Vector3d& point : face.samples) {
      const Eigen::Vector2d pixel = view.project(pose * point);
      if (!view.image.contains(pixel, 3)) continue;
      const Rgb colour =
          view.image.colour(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
      samples_.push_back({i, colour.cwiseProduct(balance)});
    }
  }
}

void LightFit::weigh_faces() noexcept {
  std::ranges::fill(evidence_, 0.0F);
  const std::size_t colours = table_->num_colours();
  for (std::size_t l = 0; l < kLights; ++l) {
    const Eigen::Vector3f gains = lights_[l].cast<float>();
    float* const evidence = evidence_.data() + l * shape_->faces.size() * colours;
    for (const Sample& sample : samples_) {
      const float* const densities = table_->evidence(sample.colour.cwiseProduct(gains));
      float* const sum = evidence + sample.face * colours;
      for (std::size_t k = 0; k < colours; ++k) sum[k] += densities[k];
    }
  }
}

// How well the shown faces have their colours in this light, after this turn and exchange.
double LightFit::score(std::size_t light, std::size_t turn,
                       const Exchange& exchange) const noexcept {
  // Many small faces do not say more than a few large ones.
  constexpr double kMost = 111;  // samples: three faces of a box
  const std::size_t colours = table_->num_colours();
  const float* const evidence = evidence_.data() + light * shape_->faces.size() * colours;
  double sum = 0;
  for (const std::size_t i : shown_) {
    const std::size_t face = turn == 0 ? i : shape_->turns[turn - 1].order[i];
    Label label = shape_->faces[face].label;
    if (label == exchange.a) {
      label = exchange.b;
    } else if (label == exchange.b) {
      label = exchange.a;
    }
    sum += static_cast<double>(evidence[i * colours + label]);
  }
  const double weight =
      kIndependent * std::min(1.0, kMost / std::max(1.0, static_cast<double>(samples_.size())));
  return weight * sum - costs_[light];
}

LightFit::Best LightFit::best(std::size_t turn, const Exchange& exchange) const noexcept {
  Best best{-std::numeric_limits<double>::infinity(), 0};
  for (std::size_t l = 0; l < kLights; ++l) {
    const double score_here = score(l, turn, exchange);
    if (score_here > best.score) best = {score_here, l};
  }
  return best;
}

// Of the face for whose samples another colour is the likeliest by most.
double LightFit::contradiction() const noexcept {
  double worst = 0;
  const std::size_t colours = table_->num_colours();
  for (std::size_t i = 0; i < shape_->faces.size(); ++i) {
    const double* const own = seen_.data() + i * colours;
    const double over = *std::max_element(own, own + colours) - own[shape_->faces[i].label];
    worst = std::max(worst, kIndependent * over);
  }
  return worst;
}

// Adds what the samples of an image say of exchanges. `light` is that of the object as it is.
void LightFit::try_exchanges(std::size_t light, Answer& answer) noexcept {
  // In another light, a finger in front of a face may look like any colour. So only what has a
  // colour in the light of the object as it is counts.
  const float coloured = std::log(0.3F);  // probability of its likeliest colour
  const Eigen::Vector3f gains = lights_[light].cast<float>();
  std::erase_if(samples_, [&](const Sample& sample) {
    const float* const densities = table_->evidence(sample.colour.cwiseProduct(gains));
    return *std::max_element(densities, densities + table_->num_colours()) < coloured;
  });
  weigh_faces();
  const double as_it_is = best(0).score;
  std::size_t place = 0;
  for (std::size_t b = 1; b < table_->num_colours(); ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      const Exchange exchange{static_cast<Label>(a), static_cast<Label>(b)};
      exchanges_[place++] += best(0, exchange).score - as_it_is;
    }
  }
  for (Sample& sample : samples_) std::swap(sample.colour[0], sample.colour[2]);
  weigh_faces();
  answer.exchanged_channels = std::max(answer.exchanged_channels, best(0).score - as_it_is);
}

LightFit::Answer LightFit::fit(const std::vector<View>& views,
                               const Eigen::Isometry3d& pose) noexcept {
  Answer answer;
  answer.lights.fill(Eigen::Vector3d::Ones());
  answer.lights_as_it_is.fill(Eigen::Vector3d::Ones());
  std::ranges::fill(scores_, 0.0);
  std::ranges::fill(seen_, 0.0);
  std::ranges::fill(exchanges_, 0.0);
  std::array<bool, kMaxCameras> is_read{};
  for (std::size_t c = 0; c < views.size(); ++c) {
    const View& view = views[c];
    if (!view.image.exists() || view.seen(pose.translation()).z() < 1.5 * shape_->radius) continue;
    is_read[c] = true;
    read_samples(view, pose);
    weigh_faces();
    for (std::size_t t = 0; t < scores_.size(); ++t) {
      const Best light = best(t);
      best_lights_[c][t] = light.light;
      scores_[t] += light.score;
    }
    const float* const evidence = evidence_.data() + best_lights_[c][0] * seen_.size();
    for (std::size_t i = 0; i < seen_.size(); ++i) seen_[i] += static_cast<double>(evidence[i]);
    try_exchanges(best_lights_[c][0], answer);
  }
  answer.contradiction = contradiction();
  for (const double exchange : exchanges_) {
    answer.exchanged_colours = std::max(answer.exchanged_colours, exchange);
  }
  const auto likeliest = std::ranges::max_element(scores_);
  const auto place = static_cast<std::size_t>(likeliest - scores_.begin());
  if (place > 0) answer.turn = &shape_->turns[place - 1];
  double next = -std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < scores_.size(); ++t) {
    if (t != place) next = std::max(next, scores_[t]);
  }
  answer.margin = *likeliest - next;
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (!is_read[c]) continue;
    answer.lights[c] = lights_[best_lights_[c][place]];
    answer.lights_as_it_is[c] = lights_[best_lights_[c][0]];
  }
  return answer;
}

}  // namespace trifinger::tracking::detail
