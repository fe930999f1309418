// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "trifinger/base/time.hpp"

namespace trifinger {

struct Identified;

/// A row of `Identified::fields()`.
struct IdentifiedField {
  const char* name;
  const char* unit;
  std::vector<double> Identified::* value;
  double min;
  double max;
};

/// What was measured on one robot, in place of what its description or its file says of its joints.
/// Each list is empty, or has a number for each driven joint.
struct Identified {
  std::vector<double> rotor_inertia{};  ///< At the joint [kg m^2].
  std::vector<double> damping{};        ///< Viscous [Nms/rad].
  std::vector<double> friction{};       ///< Dry [Nm].
  std::vector<double> torque_scale{};   ///< Torque that acts, as a share of the measured one.
  std::vector<double> backlash{};       ///< Play between motor and joint [rad].
  std::vector<double> zero_offset{};    ///< Measured less true position [rad].
  /// Factor on mass and inertia of the link that the joint moves. If several driven joints move
  /// the same link, the last one counts.
  std::vector<double> link_mass{};
  /// Where the centre of mass of that link is, less where it is described [m], in its frame.
  std::vector<double> link_center_x{};
  std::vector<double> link_center_y{};
  std::vector<double> link_center_z{};
  TimeIndex torque_delay{0};       ///< Steps until motors deliver a torque.
  TimeIndex measurement_delay{0};  ///< Steps by which positions and velocities are old.

  /// One row for each list. Reading, checking and Python loop over them.
  [[nodiscard]] static constexpr auto fields() noexcept {
    return std::array{IdentifiedField{"rotor_inertia", "kgm^2", &Identified::rotor_inertia, 0, 1e3},
                      IdentifiedField{"damping", "Nms/rad", &Identified::damping, 0, 1e3},
                      IdentifiedField{"friction", "Nm", &Identified::friction, 0, 1e3},
                      IdentifiedField{"torque_scale", "", &Identified::torque_scale, 0.1, 10},
                      IdentifiedField{"backlash", "rad", &Identified::backlash, 0, 0.5},
                      IdentifiedField{"zero_offset", "rad", &Identified::zero_offset, -1, 1},
                      IdentifiedField{"link_mass", "", &Identified::link_mass, 0.1, 10},
                      IdentifiedField{"link_center_x", "m", &Identified::link_center_x, -1, 1},
                      IdentifiedField{"link_center_y", "m", &Identified::link_center_y, -1, 1},
                      IdentifiedField{"link_center_z", "m", &Identified::link_center_z, -1, 1}};
  }

  /// Checks the lists; how late a simulation may be is its own matter.
  /// @throws InvalidArgument that names the value found and the values allowed
  void validate(std::size_t joints) const;

  /// The value of a joint, or `usual` if the list is empty.
  [[nodiscard]] static double of(const std::vector<double>& list, std::size_t joint,
                                 double usual) noexcept {
    return list.empty() ? usual : list[joint];
  }
};

}  // namespace trifinger
