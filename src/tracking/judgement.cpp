// SPDX-License-Identifier: BSD-3-Clause
#include "judgement.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trifinger::tracking::detail {
namespace {

constexpr double kMinFace = 12;    // that counts as shown [block]
constexpr double kMinShare = 0.2;  // of a face that counts as shown

}  // namespace

Judge::Judge(const Shape& shape)
    : shape_(&shape), outlines_(shape.faces.size()), shown_(shape.faces.size()) {
  for (std::size_t i = 0; i < outlines_.size(); ++i) {
    outlines_[i].sides.reserve(shape.faces[i].corners.size());
  }
}

Verdict Judge::judge(const std::vector<View>& views, const Eigen::Isometry3d& pose) noexcept {
  Verdict verdict;
  std::ranges::fill(shown_, 0.0);
  for (const View& view : views) {
    if (!view.image.exists()) continue;
    if (view.seen(pose.translation()).z() < 1.5 * shape_->radius) continue;
    const double matched_before = verdict.matched;
    for (std::size_t i = 0; i < shape_->faces.size(); ++i) {
      const Face& face = shape_->faces[i];
      const double cosine = facing(view, pose, face);
      if (cosine <= 0.05) continue;
      const Projected centre = view.project_with_slope(pose * face.centre);
      const double pixels = centre.slope.squaredNorm() / 2 * face.area * cosine;
      const double blocks =
          view.image.weight(face.label) * pixels / 4 / static_cast<double>(face.samples.size());
      double matched = 0;
      double other = 0;
      double all = 0;
      for (const Eigen::Vector3d& sample : face.samples) {
        const Eigen::Vector2d pixel = view.project(pose * sample);
        if (!view.image.contains(pixel, 0)) continue;
        all += blocks;
        const Labels labels = view.image.labels_at(pixel);
        if (labels.may_be(face.label)) {
          matched += blocks;
        } else if (labels.is_coloured()) {
          other += blocks;
        } else {
          verdict.hidden += blocks;
        }
      }
      verdict.matched += matched;
      verdict.other += other;
      if (other > matched && other > 0.4 * all) verdict.contradicted += other;
      if (matched >= kMinFace && matched >= kMinShare * all) shown_[i] += matched;
    }
    if (verdict.matched - matched_before >= kMinFace) ++verdict.cameras;
    draw_outlines(view, pose);
    verdict.unexplained += unexplained(view, pose);
  }
  for (std::size_t i = 0; i < shown_.size(); ++i) {
    if (shown_[i] <= 0) continue;
    ++verdict.faces;
    const bool is_new = std::none_of(
        shown_.begin(), shown_.begin() + static_cast<std::ptrdiff_t>(i), [&](const double& other) {
          const auto j = static_cast<std::size_t>(&other - shown_.data());
          return other > 0 && std::abs(shape_->faces[i].normal.dot(shape_->faces[j].normal)) > 0.9;
        });
    if (is_new) ++verdict.directions;
  }
  verdict.twin = twin();
  return verdict;
}

double Judge::twin() const noexcept {
  double best = 0;
  for (const Turn& turn : shape_->turns) {
    double all = 0;
    double score = 0;
    for (std::size_t i = 0; i < turn.order.size(); ++i) {
      all += shown_[i];
      const bool is_same = shape_->faces[turn.order[i]].label == shape_->faces[i].label;
      score += is_same ? shown_[i] : -kOther * shown_[i];
    }
    if (all > 0) best = std::max(best, score / all);
  }
  return best;
}

// Draws the visible faces, a little larger than they are: the blocks on their edges belong to them.
void Judge::draw_outlines(const View& view, const Eigen::Isometry3d& pose) noexcept {
  constexpr double kMargin = 3;  // [pixel]
  for (std::size_t i = 0; i < outlines_.size(); ++i) {
    const Face& face = shape_->faces[i];
    Outline& outline = outlines_[i];
    outline.label = face.label;
    outline.sides.clear();
    if (facing(view, pose, face) <= 0) continue;
    const Eigen::Vector2d middle = view.project(pose * face.centre);
    Eigen::Vector2d from = view.project(pose * face.corners.back());
    for (const Eigen::Vector3d& corner : face.corners) {
      const Eigen::Vector2d to = view.project(pose * corner);
      const Eigen::Vector2d along = (to - from).normalized();
      Eigen::Vector3d side(-along.y(), along.x(), along.y() * from.x() - along.x() * from.y());
      if (side.dot(middle.homogeneous()) < 0) side = -side;
      side.z() += kMargin;
      outline.sides.push_back(side);
      from = to;
    }
  }
}

double Judge::unexplained(const View& view, const Eigen::Isometry3d& pose) const noexcept {
  const Projected at = view.project_with_slope(pose.translation());
  const double reach = 1.1 * shape_->radius * at.slope.norm() / std::numbers::sqrt2 / 2;  // [block]
  const Eigen::Vector2d middle = at.pixel / 2;
  if (!middle.allFinite() || middle.cwiseAbs().maxCoeff() > 1e4) return 0;
  const LabelledImage& image = view.image;
  const int top = std::max(0, static_cast<int>(middle.y() - reach));
  const int bottom = std::min(image.rows(), static_cast<int>(middle.y() + reach) + 1);
  const int left = std::max(0, static_cast<int>(middle.x() - reach));
  const int right = std::min(image.columns(), static_cast<int>(middle.x() + reach) + 1);
  double count = 0;
  for (int row = top; row < bottom; ++row) {
    for (int column = left; column < right; ++column) {
      const Labels labels = image.labels(column, row);
      if (!labels.is_coloured()) continue;
      if ((Eigen::Vector2d(column, row) - middle).squaredNorm() > reach * reach) continue;
      const Eigen::Vector3d pixel(2 * column + 0.5, 2 * row + 0.5, 1);
      const bool is_explained = std::ranges::any_of(outlines_, [&](const Outline& outline) {
        return labels.may_be(outline.label) && !outline.sides.empty() &&
               std::ranges::all_of(
                   outline.sides, [&](const Eigen::Vector3d& side) { return side.dot(pixel) > 0; });
      });
      if (!is_explained) count += image.weight(labels.first);
    }
  }
  return count;
}

}  // namespace trifinger::tracking::detail
