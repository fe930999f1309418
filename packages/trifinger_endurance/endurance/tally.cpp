// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/tally.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "trifinger/base/error.hpp"
#include "trifinger/joint/safety_report.hpp"

namespace trifinger::apps {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, kNumFailures> kNames{"first_action_late",
                                                            "action_late",
                                                            "backend_late",
                                                            "actions_rejected",
                                                            "memory_damaged",
                                                            "driver_hangs",
                                                            "backend_died",
                                                            "measurement_stale",
                                                            "machine_suspended",
                                                            "hard_limit",
                                                            "bad_measurement",
                                                            "own_check",
                                                            "position_jumped",
                                                            "velocity_mismatch",
                                                            "stuck",
                                                            "overheated",
                                                            "homing",
                                                            "driver",
                                                            "self_test",
                                                            "ended_by_others",
                                                            "absent",
                                                            "control_held",
                                                            "other_robot"};

// Numbers that are written by their names, so that a reader needs no list of positions.
template <class Names>
Json named(std::span<const std::uint64_t> counts, const Names& name) {
  Json json = Json::object();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] > 0) json[std::string(name(i))] = counts[i];
  }
  return json;
}

template <class Names>
void parse_named(const Json& json, std::span<std::uint64_t> counts, const Names& name) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const auto entry = json.find(std::string(name(i)));
    if (entry == json.end()) continue;
    counts[i] = entry->template get<std::uint64_t>();
    ++found;
  }
  if (found != json.size()) throw InvalidArgument("a count has a name that this version lacks");
}

std::string_view failure_name(std::size_t i) { return kNames[i]; }
std::string_view move_name(std::size_t i) { return name_of(static_cast<Move>(i)); }
std::string_view reason_name(std::size_t i) { return name_of(all_reasons()[i]); }

// The plain counts of a tally with their names.
constexpr std::array<std::pair<const char*, std::uint64_t Tally::*>, 13> kCounts{{
    {"steps", &Tally::steps},
    {"sessions", &Tally::sessions},
    {"passes_failed", &Tally::passes_failed},
    {"collisions", &Tally::collisions},
    {"late_steps_of_user", &Tally::late_steps_of_user},
    {"late_steps_of_scheduler", &Tally::late_steps_of_scheduler},
    {"late_steps_of_driver", &Tally::late_steps_of_driver},
    {"skipped_ticks", &Tally::skipped_ticks},
    {"discarded_actions", &Tally::discarded_actions},
    {"rejected_actions", &Tally::rejected_actions},
    {"lost_frames", &Tally::lost_frames},
    {"lost_observations", &Tally::lost_observations},
    {"recoveries", &Tally::recoveries},
}};

constexpr std::array<std::pair<const char*, double JointTally::*>, 6> kJointNumbers{{
    {"way", &JointTally::travel},
    {"error_squares", &JointTally::error_squares},
    {"pass_error_squares", &JointTally::pass_error_squares},
    {"friction_sum", &JointTally::friction_sum},
    {"friction_most", &JointTally::friction_most},
    {"thermal_margin", &JointTally::thermal_margin},
}};
constexpr std::array<std::pair<const char*, std::uint64_t JointTally::*>, 3> kJointCounts{{
    {"pass_steps", &JointTally::pass_steps},
    {"passes", &JointTally::passes},
    {"collisions", &JointTally::collisions},
}};

// Returns one member of all joints as a list.
template <class Member>
Json list_of(const std::vector<JointTally>& joints, Member member) {
  Json list = Json::array();
  for (const JointTally& joint : joints) list.push_back(joint.*member);
  return list;
}

template <class Member>
void parse_list(const Json& list, std::vector<JointTally>& joints, Member member) {
  if (list.size() != joints.size()) throw InvalidArgument("it is about another number of joints");
  for (std::size_t i = 0; i < joints.size(); ++i) list.at(i).get_to(joints[i].*member);
}

}  // namespace

std::string_view name_of(Failure failure) noexcept {
  return kNames[static_cast<std::size_t>(failure)];
}

Failure failure_of(const Fault& fault, std::string_view driver_text) noexcept {
  using Code = Fault::Code;
  switch (fault.code) {
    case Code::kFirstActionLate:
      return Failure::kFirstActionLate;
    case Code::kActionLate:
      return Failure::kActionLate;
    case Code::kBackendLate:
      return Failure::kBackendLate;
    case Code::kActionsRejected:
      return Failure::kActionsRejected;
    case Code::kMemoryDamaged:
      return Failure::kMemoryDamaged;
    case Code::kDriverHangs:
      return Failure::kDriverHangs;
    case Code::kBackendDied:
      return Failure::kBackendDied;
    case Code::kMeasurementStale:
      return Failure::kMeasurementStale;
    case Code::kMachineSuspended:
      return Failure::kMachineSuspended;
    case Code::kDriver:
      break;
    default:
      return Failure::kEnded;
  }
  switch (static_cast<SafetyFault>(fault.detail & 0xff)) {
    case SafetyFault::kHardLimit:
      return Failure::kHardLimit;
    case SafetyFault::kBadMeasurement:
      return Failure::kBadMeasurement;
    case SafetyFault::kOwnCheck:
      return Failure::kOwnCheck;
    case SafetyFault::kPositionJumped:
      return Failure::kPositionJumped;
    case SafetyFault::kVelocityMismatch:
      return Failure::kVelocityMismatch;
    case SafetyFault::kStuck:
      return Failure::kStuck;
    case SafetyFault::kOverheated:
      return Failure::kOverheated;
    default:
      break;
  }
  // Drivers number their own faults as they like; the word is in the text.
  if (driver_text.find("homing") != std::string_view::npos ||
      driver_text.find("end stop") != std::string_view::npos) {
    return Failure::kHoming;
  }
  return Failure::kDriver;
}

void Times::add(Nanoseconds time) noexcept {
  std::size_t bin = 0;
  while (bin + 1 < kNumBins && time >= end_of(bin)) ++bin;
  ++counts_[bin];
  longest_ = std::max(longest_, time);
}

void Times::add(const Times& others) noexcept {
  for (std::size_t bin = 0; bin < kNumBins; ++bin) counts_[bin] += others.counts_[bin];
  longest_ = std::max(longest_, others.longest_);
}

std::uint64_t Times::count() const noexcept {
  return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
}

Nanoseconds Times::quantile(double fraction) const noexcept {
  const auto wanted = fraction * static_cast<double>(count());
  std::uint64_t below = 0;
  for (std::size_t bin = 0; bin + 1 < kNumBins; ++bin) {
    below += counts_[bin];
    if (below > 0 && static_cast<double>(below) >= wanted) return std::min(longest_, end_of(bin));
  }
  return longest_;
}

Nanoseconds Times::end_of(std::size_t bin) noexcept {
  // 1 µs, 1.5 µs, 2 µs, 3 µs, 4 µs, 6 µs, ...
  const std::int64_t power = std::int64_t{1000} << (bin / 2);
  return Nanoseconds(bin % 2 == 0 ? power : power + power / 2);
}

Json Times::json() const {
  // Bins in pairs of their number and count, because most are empty.
  Json bins = Json::array();
  for (std::size_t bin = 0; bin < kNumBins; ++bin) {
    if (counts_[bin] > 0) bins.push_back({bin, counts_[bin]});
  }
  return {{"longest", longest_.count()}, {"bins", bins}};
}

Times Times::parse(const Json& json) {
  Times times;
  times.longest_ = Nanoseconds(json.at("longest").get<std::int64_t>());
  for (const Json& entry : json.at("bins")) {
    const auto bin = entry.at(0).get<std::size_t>();
    if (bin >= kNumBins) throw InvalidArgument("a time has a bin that does not exist");
    times.counts_[bin] = entry.at(1).get<std::uint64_t>();
  }
  return times;
}

void JointTally::add(const JointTally& other) noexcept {
  travel += other.travel;
  error_squares += other.error_squares;
  pass_error_squares += other.pass_error_squares;
  pass_steps += other.pass_steps;
  friction_sum += other.friction_sum;
  friction_most = std::max(friction_most, other.friction_most);
  passes += other.passes;
  thermal_margin = std::min(thermal_margin, other.thermal_margin);
  collisions += other.collisions;
}

void Tally::add(const Tally& other) noexcept {
  time += other.time;
  for (const auto& [name, count] : kCounts) this->*count += other.*count;
  for (std::size_t i = 0; i < moves.size(); ++i) moves[i] += other.moves[i];
  for (std::size_t i = 0; i < reasons.size(); ++i) reasons[i] += other.reasons[i];
  for (std::size_t i = 0; i < failures.size(); ++i) failures[i] += other.failures[i];
  recovery_times.add(other.recovery_times);
  lateness.add(other.lateness);
  for (std::size_t i = 0; i < joints.size(); ++i) joints[i].add(other.joints[i]);
}

void Tally::clear() noexcept {
  std::vector<JointTally> kept = std::move(joints);
  std::ranges::fill(kept, JointTally());
  *this = Tally();
  joints = std::move(kept);
}

std::uint64_t Tally::all_failures() const noexcept {
  return std::accumulate(failures.begin(), failures.end(), std::uint64_t{0});
}

Json Tally::json() const {
  Json json{{"time", time.count()}};
  for (const auto& [name, count] : kCounts) json[name] = this->*count;
  json["moves"] = named(moves, move_name);
  json["reasons"] = named(reasons, reason_name);
  json["troubles"] = named(failures, failure_name);
  json["recovery_times"] = recovery_times.json();
  json["lateness"] = lateness.json();
  for (const auto& [name, member] : kJointNumbers)
    json["joint_" + std::string(name)] = list_of(joints, member);
  for (const auto& [name, member] : kJointCounts)
    json["joint_" + std::string(name)] = list_of(joints, member);
  return json;
}

Tally Tally::parse(const Json& json, std::size_t num_joints) {
  Tally tally(num_joints);
  tally.time = Nanoseconds(json.at("time").get<std::int64_t>());
  for (const auto& [name, count] : kCounts) json.at(name).get_to(tally.*count);
  parse_named(json.at("moves"), tally.moves, move_name);
  parse_named(json.at("reasons"), tally.reasons, reason_name);
  parse_named(json.at("troubles"), tally.failures, failure_name);
  tally.recovery_times = Times::parse(json.at("recovery_times"));
  tally.lateness = Times::parse(json.at("lateness"));
  for (const auto& [name, member] : kJointNumbers)
    parse_list(json.at("joint_" + std::string(name)), tally.joints, member);
  for (const auto& [name, member] : kJointCounts)
    parse_list(json.at("joint_" + std::string(name)), tally.joints, member);
  return tally;
}

}  // namespace trifinger::apps
