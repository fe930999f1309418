// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "endurance/motion.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/joint/reasons.hpp"

// What is counted and measured in a stretch of time. All of it has a fixed size.
namespace trifinger::apps {

// Why a session ended before its time.
enum class Failure : std::uint8_t {
  // Codes of `Fault`.
  kFirstActionLate,
  kActionLate,
  kBackendLate,
  kActionsRejected,
  kMemoryDamaged,
  kDriverHangs,
  kBackendDied,
  kMeasurementStale,
  kMachineSuspended,
  // Faults of a driver: those of the safety checks, and its own.
  kHardLimit,
  kBadMeasurement,
  kOwnCheck,
  kPositionJumped,
  kVelocityMismatch,
  kStuck,
  kOverheated,
  kHoming,
  kDriver,  // motor boards, motors, a simulation that diverged
  // What is no fault of the back-end.
  kSelfTest,     // A joint has not followed in the slow pass at the beginning.
  kEnded,        // Somebody else has ended the session.
  kAbsent,       // Nobody runs the robot.
  kControlHeld,  // Somebody else controls it.
  kOtherRobot,   // Another robot has its name now.
};
inline constexpr std::size_t kNumFailures = 23;
[[nodiscard]] std::string_view name_of(Failure failure) noexcept;
// `driver_text` is what the driver says about its fault.
[[nodiscard]] Failure failure_of(const Fault& fault, std::string_view driver_text) noexcept;

// Counts times in bins: two for each power of two, from 1 µs on. So a quantile is known to a factor
// of the root of two. In contrast to `LatenessHistogram`, two of them can be added.
class Times {
 public:
  static constexpr std::size_t kNumBins = 42;  // the last one begins at about 1 s

  void add(Nanoseconds time) noexcept;
  void add(const Times& others) noexcept;
  [[nodiscard]] std::uint64_t count() const noexcept;
  // The time below which this share of all times lies, rounded up to the end of a bin; at most the
  // longest time.
  [[nodiscard]] Nanoseconds quantile(double fraction) const noexcept;
  [[nodiscard]] Nanoseconds longest() const noexcept { return longest_; }

  [[nodiscard]] nlohmann::ordered_json json() const;
  // Throws InvalidArgument.
  [[nodiscard]] static Times parse(const nlohmann::ordered_json& json);
  friend bool operator==(const Times&, const Times&) = default;

 private:
  [[nodiscard]] static Nanoseconds end_of(std::size_t bin) noexcept;

  std::array<std::uint64_t, kNumBins> counts_{};
  Nanoseconds longest_{0};
};

// What one joint has done.
struct JointTally {
  double travel{0.0};              // [rad]
  double error_squares{0.0};       // sum over steps of (wanted - measured position)^2 [rad^2]
  double pass_error_squares{0.0};  // the same, in slow passes only
  std::uint64_t pass_steps{0};
  double friction_sum{0.0};  // over slow passes [Nm]
  double friction_most{0.0};
  std::uint64_t passes{0};      // slow passes that have measured this joint
  double thermal_margin{1.0};   // the least
  std::uint64_t collisions{0};  // times that something has held the joint up

  void add(const JointTally& other) noexcept;
  friend bool operator==(const JointTally&, const JointTally&) = default;
};

// Everything that happened in a stretch of time.
struct Tally {
  static constexpr std::size_t kNumReasons = 20;

  explicit Tally(std::size_t num_joints = 0) : joints(num_joints) {}

  Nanoseconds time{0};  // including pauses and homing
  std::uint64_t steps{0};
  std::uint64_t sessions{0};
  std::array<std::uint64_t, kNumMoves> moves{};
  std::uint64_t passes_failed{0};  // slow passes in which a joint did not follow
  std::uint64_t collisions{0};
  std::uint64_t late_steps_of_user{0};
  std::uint64_t late_steps_of_scheduler{0};
  std::uint64_t late_steps_of_driver{0};
  std::uint64_t skipped_ticks{0};
  std::uint64_t discarded_actions{0};
  std::uint64_t rejected_actions{0};
  std::uint64_t lost_frames{0};
  std::uint64_t lost_observations{0};                // overwritten before they were read
  std::array<std::uint64_t, kNumReasons> reasons{};  // steps in which a joint had this reason
  std::array<std::uint64_t, kNumFailures> failures{};
  std::uint64_t recoveries{0};
  Times recovery_times;  // from the end of a session to the end of the next one's self-test
  Times lateness;        // of the back-end
  std::vector<JointTally> joints;

  // Both must have the same number of joints.
  void add(const Tally& other) noexcept;
  // Begins anew without releasing memory.
  void clear() noexcept;
  [[nodiscard]] std::uint64_t all_failures() const noexcept;

  [[nodiscard]] nlohmann::ordered_json json() const;
  // Throws InvalidArgument or an exception of nlohmann::json if `json` is none of ours.
  [[nodiscard]] static Tally parse(const nlohmann::ordered_json& json, std::size_t num_joints);
  friend bool operator==(const Tally&, const Tally&) = default;
};

}  // namespace trifinger::apps
