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
      lights_[place++] = {std::exp(red - mean), std::exp(-mean), std::exp(blue - mean)};
    }
  }
  std::size_t samples = 0;
  for (const Face& face : shape.faces) samples += face.samples.size();
  samples_.reserve(samples);
  shown_.reserve(shape.faces.size());
  evidence_.resize(kLights * shape.faces.size() * table.num_colours());
  seen_.resize(shape.faces.size() * table.num_colours());
  coloured_.resize(table.num_colours());
  for (std::size_t w = 0; w < kWhites; ++w) {
    exchanges_[w].resize(table.num_colours() * (table.num_colours() - 1) / 2);
    scores_[w].resize(shape.turns.size() + 1);
  }
  for (auto& bests : bests_) bests.resize(scores_[0].size());
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

void LightFit::weigh_lights(const LabelledImage& image) noexcept {
  const Eigen::Vector3d other = image.balance().cwiseQuotient(image.other_balance());
  const auto cost = [](const Eigen::Vector3d& gains) {
    const double red = std::log(gains[0] / gains[1]);
    const double blue = std::log(gains[2] / gains[1]);
    return (red * red + blue * blue) / (2 * kUsual * kUsual);
  };
  for (std::size_t l = 0; l < kLights; ++l) {
    costs_[0][l] = cost(lights_[l]);
    costs_[1][l] = cost(lights_[l].cwiseProduct(other));
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
  return weight * sum;
}

LightFit::Best LightFit::best(std::size_t turn, const Exchange& exchange) const noexcept {
  Best best{};
  best.scores.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t l = 0; l < kLights; ++l) {
    const double fits = score(l, turn, exchange);
    for (std::size_t w = 0; w < kWhites; ++w) {
      if (fits - costs_[w][l] <= best.scores[w]) continue;
      best.scores[w] = fits - costs_[w][l];
      best.lights[w] = l;
    }
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

// The exchange that speaks most against the object decides. If much is seen of two colours, it must
// be clear that they are not exchanged.
double LightFit::exchanged_colours() const noexcept {
  constexpr double kClear = 0.3;
  constexpr int kMany = 74;  // samples with a colour: two faces
  const double as_it_is = std::max(unexchanged_[0], unexchanged_[1]);
  double worst = 0;
  std::size_t place = 0;
  for (std::size_t b = 1; b < table_->num_colours(); ++b) {
    for (std::size_t a = 0; a < b; ++a, ++place) {
      const double likelier = std::max(exchanges_[0][place], exchanges_[1][place]) - as_it_is;
      const double many = std::min(1.0, static_cast<double>(coloured_[a] + coloured_[b]) / kMany);
      worst = std::max(worst, likelier + kClear * many);
    }
  }
  return worst;
}

// Adds what the samples of an image say of exchanges. `light` is that of the object as it is.
void LightFit::try_exchanges(std::size_t light, Exchanges& exchanges) noexcept {
  // In another light, a finger in front of a face may look like any colour. So only what has a
  // colour in the light of the object as it is counts.
  const float coloured = std::log(0.3F);  // probability of its likeliest colour
  const Eigen::Vector3f gains = lights_[light].cast<float>();
  const auto has_colour = [&](const Rgb& colour) {
    const float* const densities = table_->evidence(colour.cwiseProduct(gains));
    return *std::max_element(densities, densities + table_->num_colours()) >= coloured;
  };
  const auto exchange_channels = [&] {
    for (Sample& sample : samples_) std::swap(sample.colour[0], sample.colour[2]);
  };
  // An image with red and blue exchanged may show nothing that has a colour before they are put
  // right.
  std::erase_if(samples_, [&](const Sample& sample) {
    return !has_colour(sample.colour) && !has_colour(sample.colour.reverse());
  });
  exchange_channels();
  weigh_faces();
  const double exchanged = best(0).score();
  exchange_channels();
  weigh_faces();
  exchanges.channels = std::max(exchanges.channels, exchanged - best(0).score());
  if (std::erase_if(samples_, [&](const Sample& each) { return !has_colour(each.colour); }) > 0) {
    weigh_faces();
  }
  for (const Sample& sample : samples_) ++coloured_[shape_->faces[sample.face].label];
  const Best as_it_is = best(0);
  for (std::size_t w = 0; w < kWhites; ++w) unexchanged_[w] += as_it_is.scores[w];
  std::size_t place = 0;
  for (std::size_t b = 1; b < table_->num_colours(); ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      const Exchange exchange{static_cast<Label>(a), static_cast<Label>(b)};
      const Best changed = best(0, exchange);
      for (std::size_t w = 0; w < kWhites; ++w) exchanges_[w][place] += changed.scores[w];
      ++place;
    }
  }
}

LightFit::Exchanges LightFit::exchanges(const std::vector<View>& views,
                                        const Eigen::Isometry3d& pose) noexcept {
  Exchanges exchanges;
  for (auto& scores : exchanges_) std::ranges::fill(scores, 0.0);
  std::ranges::fill(coloured_, 0);
  unexchanged_.fill(0);
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (!is_read_[c]) continue;
    read_samples(views[c], pose);
    weigh_lights(views[c].image);
    try_exchanges(bests_[c][0].lights[white()], exchanges);
  }
  exchanges.colours = exchanged_colours();
  return exchanges;
}

LightFit::Answer LightFit::fit(const std::vector<View>& views,
                               const Eigen::Isometry3d& pose) noexcept {
  Answer answer;
  answer.lights.fill(Eigen::Vector3d::Ones());
  answer.lights_as_it_is.fill(Eigen::Vector3d::Ones());
  for (auto& scores : scores_) std::ranges::fill(scores, 0.0);
  std::ranges::fill(seen_, 0.0);
  is_read_.fill(false);
  for (std::size_t c = 0; c < views.size(); ++c) {
    const View& view = views[c];
    if (!view.image.exists() || view.seen(pose.translation()).z() < 1.5 * shape_->radius) continue;
    is_read_[c] = true;
    read_samples(view, pose);
    weigh_lights(view.image);
    weigh_faces();
    for (std::size_t t = 0; t < bests_[c].size(); ++t) {
      bests_[c][t] = best(t);
      for (std::size_t w = 0; w < kWhites; ++w) scores_[w][t] += bests_[c][t].scores[w];
    }
    const float* const evidence = evidence_.data() + bests_[c][0].lights[0] * seen_.size();
    for (std::size_t i = 0; i < seen_.size(); ++i) seen_[i] += static_cast<double>(evidence[i]);
  }
  answer.contradiction = contradiction();
  std::size_t place = 0;
  std::size_t place_white = white();
  for (std::size_t w = 0; w < kWhites; ++w) {
    for (std::size_t t = 0; t < scores_[w].size(); ++t) {
      if (scores_[w][t] <= scores_[place_white][place]) continue;
      place = t;
      place_white = w;
    }
  }
  if (place > 0) answer.turn = &shape_->turns[place - 1];
  double next = -std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < scores_[0].size(); ++t) {
    if (t != place) next = std::max({next, scores_[0][t], scores_[1][t]});
  }
  answer.margin = scores_[place_white][place] - next;
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (!is_read_[c]) continue;
    answer.lights[c] = lights_[bests_[c][place].lights[0]];
    answer.lights_as_it_is[c] = lights_[bests_[c][0].lights[0]];
  }
  return answer;
}

}  // namespace trifinger::tracking::detail
