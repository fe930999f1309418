// SPDX-License-Identifier: BSD-3-Clause
#include "gain_warnings.hpp"

#include <vector>

#include "base/text_of.hpp"
#include "in_seconds.hpp"
#include "model/joint_loads.hpp"

namespace trifinger::detail {

std::map<std::size_t, std::string> gain_warnings(const SimulationOptions& options) {
  std::map<std::size_t, std::string> warnings;
  if (options.file == nullptr || !options.limits) return warnings;
  const double step = in_seconds(options.period);
  const std::vector<double> inertias = JointLoads(*options.file).inertias();
  for (std::size_t i = 0; i < inertias.size(); ++i) {
    const JointLimit& limit = (*options.limits)[i];
    const double damping = limit.safety_kd + limit.default_kd;
    if (damping * step <= inertias[i]) continue;
    const DrivenJoint& joint = options.file->joints()[i];
    warnings[i] = text_of(
        "joint '", joint.name, "' has an inertia of ", inertias[i],
        joint.is_slide ? " kg" : " kgm^2", ", too little for safety_kd + default_kd = ", damping,
        joint.is_slide ? " Ns/m" : " Nms/rad", " in steps of ", step,
        " s: it will shake. Give it the inertia of its rotor (robot.armature), or smaller gains");
  }
  return warnings;
}

}  // namespace trifinger::detail
