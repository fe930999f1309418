// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/robot_test.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <span>

#include "boards/joint_sweep.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/joint/orderly_stop.hpp"
#include "trifinger/sim/object_observation.hpp"

namespace trifinger::apps {
namespace {

constexpr Nanoseconds kHold = std::chrono::milliseconds(500);
// Actions are appended so far ahead, because nobody promises this program the processor.
constexpr Nanoseconds kAhead = std::chrono::milliseconds(300);
// A robot that holds its pose does not move further than this while another joint moves [rad].
constexpr double kStill = 0.1;
constexpr double kMoves = 0.007;  // a fifth of the way of a sweep [rad]
constexpr Nanoseconds kTestTimeout = std::chrono::seconds(30);
constexpr Nanoseconds kMove = std::chrono::seconds(2);  // to another position
constexpr int kPlaces = 6;          // at most, of which the first is the initial position
constexpr double kElsewhere = 0.3;  // as far from it the others are at most [rad], [m]

// Reads and writes the numbers of one field in the bytes of an element.
class NumberField {
 public:
  // `name` must be a list of double numbers, otherwise the field is empty.
  NumberField(const ElementDescription& element, std::string_view name) {
    const FieldDescription* const field = element.find(name);
    if (field == nullptr || field->type != ScalarType::kFloat64) return;
    offset_ = field->offset;
    count_ = field->count();
  }

  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] std::vector<double> read(const std::vector<std::byte>& element) const {
    std::vector<double> values(count_);
    if (count_ > 0) std::memcpy(values.data(), element.data() + offset_, count_ * sizeof(double));
    return values;
  }
  void write(const std::vector<double>& values, std::byte* element) const {
    if (count_ > 0) std::memcpy(element + offset_, values.data(), count_ * sizeof(double));
  }

 private:
  std::size_t offset_{0};
  std::size_t count_{0};
};

// Drives a robot to positions that are known in advance.
class TestDrive {
 public:
  TestDrive(UntypedFrontend& robot, const std::function<void()>& look, const KnownRobot& known)
      : robot_(robot),
        look_(look),
        known_(known),
        action_(robot.session().element(Series::kDesiredAction)),
        observation_(robot.session().element(Series::kObservation)),
        target_(action_, "position"),
        position_(observation_, "position"),
        torque_(observation_, "torque"),
        period_(robot.session().info().period) {
    std::vector<std::byte> element(observation_.size());
    robot_.latest_observation(element.data(), kTestTimeout);
    start_ = position_.read(element);
  }

  // False for robots that obey no positions.
  [[nodiscard]] bool has_joints() const noexcept {
    return target_.count() > 0 && target_.count() == position_.count() &&
           torque_.count() == position_.count();
  }
  [[nodiscard]] std::size_t joints() const noexcept { return position_.count(); }
  [[nodiscard]] double period() const noexcept {
    return 1e-9 * static_cast<double>(period_.count());
  }
  [[nodiscard]] const std::vector<double>& start() const noexcept { return start_; }
  [[nodiscard]] TimeIndex steps() const noexcept { return next_; }

  // Moves to `targets`, one per step, and calls `see(i, position, torque)` for each of them.
  template <class See>
  void follow(const std::vector<std::vector<double>>& targets, const See& see) {
    const auto ahead = static_cast<std::size_t>(std::max<Nanoseconds::rep>(kAhead / period_, 1));
    std::size_t appended = 0;
    const TimeIndex first = next_;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      // In blocks, so that the queue is at least half full while there are targets left.
      if (appended < targets.size() && appended < i + ahead / 2 + 1) {
        const std::size_t count = std::min(ahead, targets.size() - appended);
        append(std::span(targets).subspan(appended, count));
        appended += count;
        look_();
      }
      std::vector<std::byte> element(observation_.size());
      const TimeIndex t = first + static_cast<TimeIndex>(i);
      robot_.get(Series::kObservation, t, element.data(), kTestTimeout);
      see(i, position_.read(element), torque_.read(element));
      next_ = t + 1;
    }
  }

  void hold(Nanoseconds time) {
    const auto steps = static_cast<std::size_t>(std::max<Nanoseconds::rep>(time / period_, 1));
    follow(std::vector(steps, start_),
           [](std::size_t /*i*/, const auto& /*position*/, const auto& /*torque*/) {});
  }

  // Moves to `place`, or until something is in the way, and stays there.
  void move_to(const std::vector<double>& place) {
    std::vector<std::vector<double>> targets;
    for (Nanoseconds time = period_; time <= kMove; time += period_) {
      const double way = std::chrono::duration<double>(time) / kMove;
      targets.push_back(start_);
      for (std::size_t i = 0; i < place.size(); ++i) {
        targets.back()[i] += trifinger::detail::smooth(way) * (place[i] - start_[i]);
      }
    }
    follow(targets, [&](std::size_t /*i*/, const std::vector<double>& position,
                        const auto& /*torque*/) { start_ = position; });
    hold(kHold);
  }

  // Where the cube is; nothing if the robot has none, or does not see it.
  [[nodiscard]] std::optional<std::array<double, 3>> cube() const {
    const auto& names = robot_.session().companion_names();
    if (std::ranges::find(names, kObjectCompanion) == names.end()) return std::nullopt;
    const UntypedFrontend objects = robot_.companion(kObjectCompanion);
    const ElementDescription& layout = objects.session().element(Series::kObservation);
    const NumberField place(layout, "cube.position");
    std::vector<std::byte> element(layout.size());
    if (place.count() != 3 || !objects.get_latest_at(next_ - 1, element.data(), kTestTimeout)) {
      return std::nullopt;
    }
    const std::vector<double> found = place.read(element);
    return std::array{found[0], found[1], found[2]};
  }

 private:
  void append(std::span<const std::vector<double>> targets) {
    // All numbers that are not given are NaN, but torques are 0.
    std::vector<std::byte> actions(action_.size() * targets.size());
    for (std::size_t i = 0; i < targets.size(); ++i) {
      std::byte* const action = actions.data() + i * action_.size();
      if (!has_joints()) continue;  // zeros
      for (const FieldDescription& field : action_.fields()) {
        const NumberField numbers(action_, field.name);
        numbers.write(std::vector(numbers.count(), std::numeric_limits<double>::quiet_NaN()),
                      action);
      }
      // Without these torques it would sink until its position controllers carry its weight.
      NumberField(action_, "torque")
          .write(known_.weight ? known_.weight(targets[i]) : std::vector(joints(), 0.0), action);
      target_.write(targets[i], action);
    }
    robot_.append_desired_actions(actions.data(), targets.size(), kTestTimeout);
  }

  UntypedFrontend& robot_;
  const std::function<void()>& look_;
  const KnownRobot& known_;
  const ElementDescription& action_;
  const ElementDescription& observation_;
  NumberField target_;
  NumberField position_;
  NumberField torque_;
  Nanoseconds period_;
  std::vector<double> start_;
  TimeIndex next_{0};
};

// Moves one joint there and back, while the others hold. Returns what is wrong with others.
std::string sweep(TestDrive& drive, std::size_t joint, boards::JointReport& report,
                  std::vector<double>& middle) {
  boards::JointSweep plan;
  plan.begin();
  std::vector<std::vector<double>> targets;
  while (!plan.is_done()) {
    targets.push_back(drive.start());
    targets.back()[joint] += plan.next(drive.period());
  }
  boards::JointSweep measured;
  measured.begin();
  std::vector<double> furthest(drive.joints(), 0.0);
  std::vector<double> from;
  drive.follow(targets, [&](std::size_t /*i*/, const std::vector<double>& position,
                            const std::vector<double>& torque) {
    if (from.empty()) middle = from = position;
    static_cast<void>(measured.next(drive.period()));
    measured.add(torque[joint], position[joint] - from[joint]);
    for (std::size_t k = 0; k < furthest.size(); ++k) {
      const double displacement = position[k] - from[k];
      if (std::abs(displacement) > std::abs(furthest[k])) furthest[k] = displacement;
    }
  });
  report.sweep = measured.result();
  const auto most = std::ranges::max_element(
      furthest, {}, [](double displacement) { return std::abs(displacement); });
  report.wiring = boards::WiringFinding{.moves = std::abs(*most) > kMoves,
                                        .joint = static_cast<std::size_t>(most - furthest.begin()),
                                        .is_reversed = furthest[joint] < -kMoves};
  for (std::size_t k = 0; k < furthest.size(); ++k) {
    if (k != joint && std::abs(furthest[k]) > kStill) {
      return fmt::format("joint {} moves by {:.2f} rad while joint {} should", k, furthest[k],
                         joint);
    }
  }
  return "";
}

// Returns what is wrong with a joint where the robot is.
std::string test_joint(TestDrive& drive, std::size_t joint, const KnownRobot& known,
                       boards::JointReport& report) {
  std::vector<double> position;
  std::string problem = sweep(drive, joint, report, position);
  if (known.weight) report.weight = known.weight(position).at(joint);
  if (!problem.empty()) return problem;
  const std::string own = boards::problem_of(report, 0.0, "");
  if (!own.empty()) return fmt::format("joint {} {}", joint, own);
  if (report.wiring->is_good(joint)) return "";
  return fmt::format("joint {} turns the wrong way, or joint {} turns in its place", joint,
                     report.wiring->joint);
}

// A joint that does its work at one place has no defect: elsewhere something was in its way.
void test_joints(TestDrive& drive, const KnownRobot& known, RobotTestReport& report) {
  report.joints.resize(drive.joints());
  std::vector<std::string> problems(drive.joints(), "was not tested");
  const bool can_move = known.initial_position.size() == drive.joints();
  Random random;
  for (int place = 0; place < (can_move ? kPlaces : 1); ++place) {
    if (can_move) {
      std::vector<double> position = known.initial_position;
      for (double& joint : position) {
        if (place > 0) joint += random.uniform(-kElsewhere, kElsewhere);
      }
      drive.move_to(position);
    }
    for (std::size_t i = 0; i < problems.size(); ++i) {
      if (!problems[i].empty()) problems[i] = test_joint(drive, i, known, report.joints[i]);
    }
    const auto bad = std::ranges::find_if_not(problems, &std::string::empty);
    if (bad == problems.end()) {
      report.problem.clear();
      return;
    }
    report.problem = *bad;
  }
}

}  // namespace

RobotTestReport test_robot(UntypedFrontend& robot, SelfTest kind, const std::function<void()>& look,
                           const KnownRobot& known) {
  RobotTestReport report{.kind = kind, .problem = {}, .joints = {}, .cube = {}};
  if (kind == SelfTest::kOff) return report;
  try {
    TestDrive drive(robot, look, known);
    drive.hold(kHold);
    if (kind == SelfTest::kJoints && drive.has_joints()) test_joints(drive, known, report);
    report.cube = drive.cube();
    report.steps = drive.steps();
    robot.finish(kTestTimeout);
  } catch (const RobotStopped& stopped) {
    report.problem = stopped.what();
  } catch (const TimedOut& error) {
    report.problem = error.what();
  }
  return report;
}

}  // namespace trifinger::apps
