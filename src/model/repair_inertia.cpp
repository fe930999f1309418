// SPDX-License-Identifier: BSD-3-Clause
#include "repair_inertia.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/text_of.hpp"

namespace trifinger::detail {
namespace {

constexpr double kLeastMass = 1e-3;    // of a moving body [kg]
constexpr double kLeastMoment = 1e-3;  // of the largest moment
constexpr double kLeastOfMujoco = 1e-14;

// True if its moments are those of its principal axes.
bool is_diagonal(const mjsBody& body) { return std::isnan(body.fullinertia[0]); }

Eigen::Matrix3d inertia_of(const mjsBody& body) {
  const double* const n = body.fullinertia;
  if (is_diagonal(body)) return Eigen::Vector3d(body.inertia).asDiagonal();
  Eigen::Matrix3d inertia;
  inertia << n[0], n[3], n[4], n[3], n[1], n[5], n[4], n[5], n[2];
  return inertia;
}

// `moments` increase.
bool is_possible(const Eigen::Vector3d& moments) {
  return moments[0] > kLeastOfMujoco && moments[0] + moments[1] >= moments[2];
}

Eigen::Vector3d nearest_possible(Eigen::Vector3d moments, double mass) {
  if (!(moments[2] > kLeastOfMujoco)) return Eigen::Vector3d::Constant(ball_inertia(mass));
  moments = moments.cwiseMax(kLeastMoment * moments[2]);
  // A thousandth more, so that rounding does not matter.
  moments[0] = std::max(moments[0], 1.001 * moments[2] - moments[1]);
  return moments;
}

void set_inertia(mjsBody& body, const Eigen::Matrix3d& inertia) {
  const Eigen::Matrix3d& n = inertia;
  if (is_diagonal(body)) {
    Eigen::Map<Eigen::Vector3d>(body.inertia) = n.diagonal();
  } else {
    const std::array full{n(0, 0), n(1, 1), n(2, 2), n(0, 1), n(0, 2), n(1, 2)};
    std::ranges::copy(full, body.fullinertia);
  }
  body.explicitinertial = true;
}

bool has_joint(mjsBody* body) { return mjs_firstChild(body, mjOBJ_JOINT, 0) != nullptr; }

// True if the body or what is fixed to it weighs something.
bool has_mass(mjsBody* body) {
  if (body->mass > 0.0) return true;
  for (mjsElement* element = mjs_firstChild(body, mjOBJ_GEOM, 0);
       element != nullptr && !body->explicitinertial; element = mjs_nextChild(body, element, 0)) {
    const mjsGeom& geom = *mjs_asGeom(element);
    if (geom.density > 0.0 || geom.mass > 0.0) return true;
  }
  for (mjsElement* element = mjs_firstChild(body, mjOBJ_BODY, 0); element != nullptr;
       element = mjs_nextChild(body, element, 0)) {
    mjsBody* const inner = mjs_asBody(element);
    if (!has_joint(inner) && has_mass(inner)) return true;
  }
  return false;
}

}  // namespace

double ball_inertia(double mass) {
  constexpr double kDensity = 1e3;  // [kg/m^3]
  const double heavy = std::max(mass, kLeastMass);
  const double radius = std::cbrt(0.75 * heavy / (std::numbers::pi * kDensity));
  return 0.4 * heavy * radius * radius;
}

std::vector<std::string> find_impossible_inertias(mjSpec* spec, bool repairs) {
  std::vector<std::string> found;
  for (mjsElement* element = mjs_firstElement(spec, mjOBJ_BODY); element != nullptr;
       element = mjs_nextElement(spec, element)) {
    mjsBody& body = *mjs_asBody(element);
    const char* const name = mjs_getString(mjs_getName(element));
    if (has_joint(&body) && !has_mass(&body)) {
      found.push_back(text_of("body '", name, "' moves and has no mass"));
      if (!repairs) continue;
      body.mass = kLeastMass;
      std::ranges::fill(body.ipos, 0.0);
      set_inertia(body, ball_inertia(kLeastMass) * Eigen::Matrix3d::Identity());
      continue;
    }
    const Eigen::Matrix3d inertia = inertia_of(body);
    if (!body.explicitinertial || !inertia.allFinite()) continue;
    if (body.mass <= 0.0 && inertia.isZero(0.0)) continue;  // fixed, and nothing but a frame
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(inertia);
    const Eigen::Vector3d& moments = axes.eigenvalues();
    if (is_possible(moments)) continue;
    found.push_back(text_of("body '", name, "' has the moments of inertia ", moments[0], ", ",
                            moments[1], " and ", moments[2],
                            " kgm^2: none may be 0 or less, or more than both others together"));
    if (!repairs) continue;
    set_inertia(body, axes.eigenvectors() * nearest_possible(moments, body.mass).asDiagonal() *
                          axes.eigenvectors().transpose());
  }
  return found;
}

}  // namespace trifinger::detail
