// SPDX-License-Identifier: BSD-3-Clause
#include "propose_limits.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "in_seconds.hpp"
#include "joint/limit_text.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::detail {
namespace {

// Our own choices.
constexpr double kShrink = 0.02;        // of the range between two stops, at each end
constexpr double kSlack = 0.1;          // of it, from a stop to the hard limit behind it
constexpr double kMinSlack = 0.05;      // [rad], a tenth for slides [m]
constexpr double kMargin = 0.1;         // of it, from where a joint begins to a soft limit
constexpr double kMarginOfKey = 0.02;   // likewise, in a key frame, where somebody wants it
constexpr double kFrequency = 20.0;     // of a joint with its gains, at least [rad/s]
constexpr double kRate = 10.0;          // at which it arrives against its own damping [1/s]
constexpr double kMaxStiffness = 5e5;   // [Nm/rad], [N/m]
constexpr double kMaxFrequency = 60.0;  // above, it gets a rotor [rad/s]
constexpr double kMaxPhase = 0.15;      // frequency times step, at most
constexpr double kSag = 0.02;           // by the weight of the links [rad], a tenth for slides [m]
constexpr double kVelocity = 3.0;       // [rad/s], a tenth for slides [m/s]
constexpr double kShareOfVelocity = 0.2;  // by which the motor changes the speed in a step
constexpr double kMaxChange = 1.0;        // likewise [rad/s], the band in which the chain brakes
constexpr double kSpareTorque = 3.0;      // of a motor, times the weight of the links
constexpr double kLinear = 0.1;           // so many metres of a slide count as a radian

// The nearest number with so many digits.
double rounded(double number, int digits) {
  std::array<char, 40> text{};
  const char* const end = std::to_chars(text.data(), text.data() + text.size(), number,
                                        std::chars_format::scientific, digits - 1)
                              .ptr;
  double result = number;
  std::from_chars(text.data(), end, result);
  return result;
}

double rounded_up(double number, int digits) {
  const double near = rounded(number, digits);
  if (near >= number) return near;
  return rounded(number * (1.0 + 0.6 * std::pow(10.0, 1 - digits)), digits);
}

// A place to four digits of the range, further inside.
double inside(double place, double range, bool is_lower) {
  const double step = std::pow(10.0, std::floor(std::log10(range)) - 3.0);
  // Rounding of numbers such as -0.94 is no reason to go one step further.
  constexpr double kRounding = 1e-6;
  const double steps =
      is_lower ? std::ceil(place / step - kRounding) : std::floor(place / step + kRounding);
  constexpr int kDigits = 12;  // Removes what multiplying has added.
  return rounded(steps * step, kDigits);
}

bool has_stops(const JointLimit& limit) {
  return limit.hard_lower > -kLargestJointLimit && limit.hard_upper < kLargestJointLimit;
}

// True if bodies are tied to each other beside their joints.
bool has_loop(const mjModel& model) {
  for (int i = 0; i < static_cast<int>(model.neq); ++i) {
    const bool ties = model.eq_type[i] == mjEQ_CONNECT || model.eq_type[i] == mjEQ_WELD;
    if (ties && model.eq_active0[i]) return true;
  }
  return false;
}

class Proposer {
 public:
  explicit Proposer(const ModelFile& model)
      : model_(model),
        loads_(model),
        known_(joints_of(model)),
        step_(in_seconds(model.period())),
        has_loop_(has_loop(*model.mujoco())),
        max_frequency_(std::min(kMaxFrequency, kMaxPhase / step_)) {
    for (const NamedJoint& joint : known_) proposal_.joints.push_back({.limit = joint.known});
  }

  RobotProposal propose() {
    for (std::size_t i = 0; i < known_.size(); ++i) {
      set_places(i);
      set_start(i);
    }
    proposal_.overlaps = loads_.overlaps();
    std::vector<JointLoad> loads = loads_.loads(ranges());
    for (std::size_t i = 0; i < loads.size(); ++i) {
      proposal_.joints[i].load = loads[i];
      suggest_torque(i);
      add_rotor(i);
    }
    const std::vector<double> inertias = loads_.inertias();
    for (std::size_t i = 0; i < inertias.size(); ++i) {
      proposal_.joints[i].load.inertia = inertias[i];
      set_gains(i);
    }
    return std::move(proposal_);
  }

 private:
  JointLimit& limit(std::size_t i) { return proposal_.joints[i].limit; }
  [[nodiscard]] double unit(std::size_t i) const {
    return known_[i].kind == JointKind::kSlide ? kLinear : 1.0;
  }
  // The motor's torque, or that of one that would do.
  double torque(std::size_t i) {
    return is_said(limit(i).max_torque) ? limit(i).max_torque
                                        : proposal_.joints[i].suggested_torque;
  }

  void set_places(std::size_t i) {
    JointLimit& joint = limit(i);
    set_soft_limits(joint);
    if (!is_said(joint.max_velocity)) joint.max_velocity = rounded(kVelocity * unit(i), 1);
    if (!has_stops(joint)) return;
    // Stops of a simulation give way, so a joint that is pushed against one is beyond it.
    const double range = joint.hard_upper - joint.hard_lower;
    const double slack = std::max(kSlack * range, kMinSlack * unit(i));
    constexpr int kDigits = 4;
    joint.hard_lower = rounded(joint.hard_lower - slack, kDigits);
    joint.hard_upper = rounded(joint.hard_upper + slack, kDigits);
  }

  static void set_soft_limits(JointLimit& joint) {
    const double infinity = std::numeric_limits<double>::infinity();
    const double range = joint.hard_upper - joint.hard_lower;
    const bool stops = has_stops(joint);
    if (!is_said(joint.soft_lower)) {
      joint.soft_lower =
          stops ? inside(joint.hard_lower + kShrink * range, range, true) : -infinity;
    }
    if (!is_said(joint.soft_upper)) {
      joint.soft_upper =
          stops ? inside(joint.hard_upper - kShrink * range, range, false) : infinity;
    }
  }

  void set_start(std::size_t i) {
    const JointLimit& joint = limit(i);
    if (std::isinf(joint.soft_lower) || std::isinf(joint.soft_upper)) return;
    const double range = joint.soft_upper - joint.soft_lower;
    const bool has_key = model_.mujoco()->nkey > 0;
    const double margin = (has_key ? kMarginOfKey : kMargin) * range;
    const double lower = joint.soft_lower + margin;
    const double upper = joint.soft_upper - margin;
    const double start = loads_.start(i);
    if (start >= lower && start <= upper) return;
    if (has_loop_) {  // A joint that is moved would tear it apart.
      limit(i).soft_lower = std::min(joint.soft_lower, start);
      limit(i).soft_upper = std::max(joint.soft_upper, start);
      limit(i).hard_lower = std::min(joint.hard_lower, start - kMinSlack * unit(i));
      limit(i).hard_upper = std::max(joint.hard_upper, start + kMinSlack * unit(i));
      return;
    }
    const double middle = 0.5 * (joint.soft_lower + joint.soft_upper);
    constexpr int kDigits = 4;
    const double place = rounded(has_key ? std::clamp(start, lower, upper) : middle, kDigits);
    const auto followers = loads_.begin_at(i, place);
    proposal_.initial_position.emplace_back(known_[i].name, place);
    for (const auto& [name, follower] : followers) {
      proposal_.initial_position.emplace_back(name, rounded(follower, kDigits));
    }
  }

  // Where the weight is tried.
  std::vector<std::pair<double, double>> ranges() {
    std::vector<std::pair<double, double>> ranges;
    for (std::size_t i = 0; i < known_.size(); ++i) {
      const double start = loads_.start(i);
      const double reach = std::numbers::pi * unit(i);
      ranges.emplace_back(std::max(limit(i).soft_lower, start - reach),
                          std::min(limit(i).soft_upper, start + reach));
    }
    return ranges;
  }

  void suggest_torque(std::size_t i) {
    constexpr double kSecondsToFullSpeed = 0.1;
    const JointLoad& load = proposal_.joints[i].load;
    proposal_.joints[i].suggested_torque =
        rounded_up(std::max(kSpareTorque * load.largest_weight,
                            load.inertia * limit(i).max_velocity / kSecondsToFullSpeed),
                   2);
  }

  // Stiff enough for the weight and for what resists the motion.
  double stiffness(std::size_t i, double inertia) {
    const JointLoad& load = proposal_.joints[i].load;
    const double stiff = std::max({inertia * kFrequency * kFrequency, load.damping * kRate,
                                   (load.largest_weight + load.friction) / (kSag * unit(i))});
    // Some files brake a joint that shall never move with a huge damping.
    return std::min(stiff, kMaxStiffness);
  }

  // A light link behind a strong motor gets a rotor.
  void add_rotor(std::size_t i) {
    const double inertia = proposal_.joints[i].load.inertia;
    const double change = std::min(kShareOfVelocity * limit(i).max_velocity, kMaxChange * unit(i));
    const double needed = std::max(stiffness(i, inertia) / (max_frequency_ * max_frequency_),
                                   torque(i) * step_ / change);
    if (needed <= inertia) return;
    for (const auto& [joint, armature] : loads_.add_rotor(i, needed - inertia)) {
      proposal_.rotors[joint] = rounded_up(armature, 2);
    }
  }

  void set_gains(std::size_t i) {
    JointLimit& joint = limit(i);
    JointProposal& proposal = proposal_.joints[i];
    const double inertia = proposal.load.inertia;
    constexpr int kDigits = 3;
    const bool has_gains = is_said(joint.default_kp) && is_said(joint.default_kd);
    if (has_gains && !are_usable(joint, proposal.load)) proposal.replaces_gains = true;
    if (!is_said(joint.default_kp) || proposal.replaces_gains) {
      joint.default_kp = rounded(stiffness(i, inertia), kDigits);
    }
    const double critical = 2.0 * std::sqrt(joint.default_kp * inertia);
    if (!is_said(joint.default_kd) || proposal.replaces_gains) {
      joint.default_kd = rounded(critical, kDigits);
    }
    joint.safety_kd = rounded(0.1 * critical, kDigits);
    const double fastest = torque(i) / inertia;
    const double spare = (torque(i) - proposal.load.weight) / inertia;
    joint.braking = rounded(
        std::max(std::min(0.5 * spare, 100.0 * joint.max_velocity), 0.1 * fastest), kDigits);
  }

  // True if gains of the file hold the joint and are stable in steps.
  [[nodiscard]] bool are_usable(const JointLimit& joint, const JointLoad& load) const {
    constexpr double kLeastDamping = 0.3;  // of the critical one
    constexpr double kMostSag = 5.0;       // times ours
    constexpr double kMostDamping = 0.5;   // of the speed, in a step
    const double critical = 2.0 * std::sqrt(joint.default_kp * load.inertia);
    return joint.default_kd + load.damping >= kLeastDamping * critical &&
           joint.default_kp * kMostSag * kSag >= load.largest_weight + load.friction &&
           joint.default_kp * kMostSag >= load.damping * kRate &&
           joint.default_kp * step_ * step_ <= kMaxPhase * load.inertia &&
           joint.default_kd * step_ <= kMostDamping * load.inertia;
  }

  const ModelFile& model_;
  JointLoads loads_;
  std::vector<NamedJoint> known_;
  double step_;
  bool has_loop_;
  double max_frequency_;
  RobotProposal proposal_;
};

}  // namespace

RobotProposal propose_limits(const ModelFile& model) { return Proposer(model).propose(); }

}  // namespace trifinger::detail
