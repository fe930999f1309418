// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "endurance/health.hpp"
#include "endurance/motion.hpp"
#include "endurance/recovery.hpp"
#include "endurance/tally.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::apps {

// The user wants the drive to end. What waits throws it.
class Stopped : public std::exception {};

// Where the sessions of a robot come from, and the time in which it lives.
class Place {
 public:
  Place() = default;
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  virtual ~Place() = default;

  // Takes control of the current session. Throws what `UntypedFrontend` throws.
  [[nodiscard]] virtual UntypedFrontend connect() = 0;
  // Clears the fault of the robot. Throws like trifinger::recover.
  virtual void recover() = 0;
  // Lets time pass. Throws Stopped.
  virtual void pause(Nanoseconds time) = 0;
  // The time since any instant.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
  // The next steps are about to be driven. True if their actions shall be unfit, as those of a
  // broken program are. Throws Stopped.
  virtual bool expect(std::uint64_t steps) = 0;
};

// A robot that runs in another process.
class RunningRobot final : public Place {
 public:
  RunningRobot(std::string name, const std::atomic<bool>& stop);

  [[nodiscard]] UntypedFrontend connect() override;
  void recover() override;
  void pause(Nanoseconds time) override;
  [[nodiscard]] Nanoseconds now() const noexcept override;
  bool expect(std::uint64_t steps) override;

 private:
  std::string name_;
  const std::atomic<bool>& stop_;
};

// The limits of the joints according to the configuration in the session.
// Throws InvalidArgument if it has none, or if it is no robot of joints; config::ConfigError.
[[nodiscard]] std::vector<JointLimit> limits_of(const Session& session);

// Where the numbers of the joints are in the elements of a session.
class JointLayout {
 public:
  // Throws InvalidArgument that names the missing field.
  explicit JointLayout(const RobotTypes& types);

  [[nodiscard]] std::size_t joints() const noexcept { return joints_; }

 private:
  friend class Drive;

  RobotTypes types_;
  std::size_t joints_;
  std::size_t wanted_position_;  // offsets [bytes]
  std::size_t wanted_torque_;
  std::size_t position_;
  std::size_t torque_;
  std::size_t reasons_;
  std::size_t thermal_margin_;
};

struct DriveOptions {
  MotionOptions motion{};
  RecoveryOptions recovery{};
  std::uint64_t first_session{0};  // sessions of earlier runs: each has motions of its own
  std::uint64_t most_steps{std::numeric_limits<std::uint64_t>::max()};
  Nanoseconds most_time{Nanoseconds::max()};
  RealtimeOptions realtime{.demand = Demand::kOff};
};

// What happened, in a sentence.
struct Event {
  Failure failure{Failure::kEnded};
  std::string text;
  bool is_over{false};  // The robot moves again after failures.
};

// How a drive has ended.
struct Outcome {
  bool needs_operator{false};
  std::string why{};  // and what the operator has to do
};

// Moves a robot at random, session after session, and goes on after any failure as long as that
// needs no operator. One thread runs it; another one takes what it has counted.
class Drive {
 public:
  // `session` is any session of the robot. Throws InvalidArgument, config::ConfigError.
  Drive(Place& place, const Session& session, DriveOptions options, const std::atomic<bool>& stop);

  // Drives until the time is over, somebody wants it to stop, or an operator is needed. The robot
  // is at rest then, if it can be.
  [[nodiscard]] Outcome run();

  // Adds to `tally` what was counted since the last call. Any thread may call it.
  void take(Tally& tally, std::vector<Event>& events);

 private:
  // A part of the series that is appended at once.
  struct Part {
    TimeIndex first{0};
    std::size_t count{0};
    std::vector<MotionStep> steps;
    std::vector<double> wanted;  // positions, joint after joint
  };
  struct Ended {
    Failure failure{Failure::kEnded};
    std::string text;
    bool needs_recovery{false};
  };

  // Drives one session. Returns why it ended; nothing if all is done.
  std::optional<Ended> drive_session();
  void begin_session(const UntypedFrontend& robot, Nanoseconds period);
  // Moves until the session has done its work, and brings the robot to rest.
  std::optional<Ended> move_at_random(UntypedFrontend& robot);
  void append(UntypedFrontend& robot, Part& part);
  void read(const UntypedFrontend& robot, Part& part);
  void read_rests(const UntypedFrontend& robot) noexcept;
  void read_rest(const UntypedFrontend& robot, Part& part) noexcept;
  void judge(const Part& part, std::size_t count);
  [[nodiscard]] std::optional<Ended> judge_pass();
  void bring_to_rest(UntypedFrontend& robot);
  [[nodiscard]] bool is_over() const noexcept;
  void note(Failure failure, const std::string& text);
  void hand_over(bool at_once);

  Place& place_;
  JointLayout layout_;
  std::string type_;
  DriveOptions options_;
  const std::atomic<bool>& stop_;
  RandomMotion motion_;
  Health health_;
  Recovery recovery_;

  std::vector<double> home_;  // where the first session began
  std::vector<std::byte> actions_;
  std::vector<std::byte> observations_;
  std::vector<std::byte> applied_;
  std::vector<Status> statuses_;
  std::array<Part, 2> parts_;
  Nanoseconds period_{0};
  TimeIndex next_{0};             // the first step of this session that was not judged
  bool is_tested_{false};         // in this session
  int failed_tests_{0};           // in a row
  std::uint32_t lost_frames_{0};  // of this session
  std::uint32_t discarded_{0};
  std::optional<Nanoseconds> failure_since_;
  bool is_missing_{false};  // and this was said

  Tally current_;
  Nanoseconds begun_;
  Nanoseconds handed_over_;
  std::uint64_t steps_{0};
  std::uint64_t sessions_{0};
  int parts_since_{0};

  std::mutex mutex_;  // of the two below
  Tally pending_;
  std::vector<Event> events_;
};

}  // namespace trifinger::apps
