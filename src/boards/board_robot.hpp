// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "boards/board.hpp"
#include "boards/homing.hpp"
#include "boards/joint_sweep.hpp"
#include "boards/self_test.hpp"
#include "boards/wear.hpp"
#include "boards/wiring_test.hpp"
#include "joint/counted_driver.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::boards {

/// A motor, or an analog input, of one of a robot's boards.
struct Terminal {
  std::size_t board{0};
  std::size_t number{0};  ///< 0 or 1

  friend bool operator==(const Terminal&, const Terminal&) = default;
};

/// The motor of a joint, and what is between its current and the joint.
struct BoardMotor {
  Terminal place{};
  double polarity{1.0};          ///< 1, or -1 for a motor that turns the other way.
  double gear_ratio{9.0};        ///< Revolutions of the motor per revolution of the joint.
  double torque_constant{0.02};  ///< Torque of the motor per ampere [Nm/A].
  HomingOptions homing{};

  /// Torque of the joint per ampere [Nm/A].
  [[nodiscard]] constexpr double torque_per_ampere() const noexcept {
    return torque_constant * gear_ratio;
  }
  /// Angle of the joint per revolution of the motor [rad].
  [[nodiscard]] double angle_per_revolution() const noexcept;
};

/// How the value of an analog input becomes the force of a tip.
struct TipSensor {
  double zero{0.05};  ///< Value without force.
  double scale{5.0};  ///< Force at a value of `zero` + 1 [N].
};

/// The settings of a robot on motor boards, whose joints turn.
struct BoardRobotOptions : CountedDriverOptions {
  std::vector<std::string> interfaces{};  ///< The bus of each board, such as "can0".
  std::vector<BoardMotor> motors{};       ///< The motor of each joint.
  std::vector<Terminal> tips{};           ///< The analog input of each tip.
  TipSensor tip_sensor{};
  double max_current{2.0};  ///< No motor ever gets more [A].
  double max_travel{8.0};   ///< Longest travel of a joint to its end stop [rad].
  Nanoseconds max_homing_time{std::chrono::seconds(20)};  ///< For each part of the homing.
  std::string serial{"any"};  ///< What is written on the robot; "any" if it does not matter.
  bool self_test{false};      ///< Tests the wiring before every homing, see `WiringTest`.
  /// How long the robot moves to its initial position after homing.
  Nanoseconds move_time{std::chrono::seconds(3)};
  BoardOptions board{};

  /// What texts call a key of the configuration, such as "homing.method": that of a joint or, as a
  /// subject in the singular, those of all joints. A robot whose joints have names has a key for
  /// each of them.
  [[nodiscard]] std::string key_text(std::string_view key,
                                     std::optional<std::size_t> joint = {}) const;
  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;
};

/// What `prepare` does beyond what is necessary: for those who look after a robot.
struct Preparation {
  bool home{false};  ///< Homes the joints even if their places are known.
  bool test{false};  ///< Tests the wiring, homes, and measures load and friction of each joint.
  /// Leaves the motors without current until somebody has put the joints at these angles [rad]
  /// (`BoardRobot::take_reference`) and has taken the hands away (`leave_reference`). Then homes
  /// the joints, and finds out where their homes are.
  std::optional<std::vector<double>> reference{};
};

/// A robot with any number of joints, which are driven by motor boards: six for a TriFinger, one
/// for a test rig.
///
/// `prepare` starts the boards, homes the joints if their places are not known, and moves to the
/// initial position. It moves there, too, if a joint is beyond a soft limit. Every action passes
/// the same safety chain as in simulation. The companion "wear" has its running hours.
class BoardRobot final : public CountedDriver {
 public:
  using Options = BoardRobotOptions;

  /// What `prepare` is doing.
  enum class Phase : std::uint8_t {
    kStarting,   ///< The boards switch their motors on.
    kReference,  ///< The motors are without current until `leave_reference`.
    kTesting,    ///< Each motor is driven, one after the other.
    kHoming,
    kMoving,    ///< To the initial position.
    kSweeping,  ///< Each joint moves by 2 degrees and back, one after the other.
    kReady,
  };

  /// `buses` has the bus of each board. `clock`, which must outlive the robot, is the back-end's.
  /// @throws InvalidArgument
  BoardRobot(Options options, std::vector<std::unique_ptr<can::Bus>> buses, const Clock& clock);
  ~BoardRobot() override;

  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const std::vector<Board>& boards() const noexcept { return boards_; }
  /// True if the places of all joints are known.
  [[nodiscard]] bool is_homed() const noexcept;
  /// Its running hours. Call this only while nobody runs the robot.
  [[nodiscard]] const Wear& wear() const noexcept { return wear_; }
  /// They are an element of this companion.
  [[nodiscard]] const CompanionDescription& wear_description() const noexcept {
    return companions_[0];
  }
  [[nodiscard]] std::vector<std::byte> wear_bytes() const;
  /// Goes on counting from what was kept. No bytes: from zero. Call it once, before the robot runs:
  /// it counts a start.
  /// @throws InvalidArgument if these are the running hours of another robot
  void continue_wear(std::span<const std::byte> kept);

  /// Sets what `prepare` does from now on. Call it while nobody runs the robot.
  void set_preparation(Preparation preparation) { preparation_ = std::move(preparation); }
  /// The joints are at the angles of the reference now. Motors stay without current. Any thread may
  /// call it.
  void take_reference() noexcept { reference_step_ = ReferenceStep::kTaken; }
  /// Nobody touches the robot any more: after `take_reference` it goes on. Any thread may call it.
  void leave_reference() noexcept { reference_step_ = ReferenceStep::kLeft; }
  /// What `prepare` is doing. Any thread may ask.
  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// What a test has found out. Call it while nobody runs the robot.
  [[nodiscard]] const JointReport& report(std::size_t joint) const noexcept {
    return reports_[joint];
  }
  /// The angle of each joint at its home [rad]: that of the options, or what a reference has given.
  [[nodiscard]] const std::vector<double>& home_position() const noexcept { return home_position_; }

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  /// Nothing: the boards let their motors go by themselves when no currents come.
  void cut() noexcept override {}

  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override {
    return companions_;
  }
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;

 private:
  enum class ReferenceStep : std::uint8_t { kWaiting, kTaken, kStored, kLeft };

  struct NewestIndex {
    double angle{0.0};
    std::uint64_t pulses{0};
  };

  // Fault codes beside those of the safety chain, with the board or the joint from 1 in the higher
  // bits.
  static constexpr std::int32_t kBoardFaultCode = 64;
  static constexpr std::int32_t kHomingCode = 96;

  [[nodiscard]] DriverReport fault_of_boards() noexcept;
  [[nodiscard]] DriverReport joint_fault(std::size_t joint, std::string_view text) noexcept;
  void append_joints(std::size_t board, FixedText& text) const noexcept;
  void start_what_is_not_ready(TimeIndex step, Instant now) noexcept;
  [[nodiscard]] std::uint64_t lost_frames() const noexcept;
  void receive(Instant now) noexcept;
  void count_wear(Instant now) noexcept;
  void note_fault() noexcept;
  void observe() noexcept;
  [[nodiscard]] HomingMeasurement measure(std::size_t joint) const noexcept;
  [[nodiscard]] HomingGains gains(std::size_t joint) const noexcept;
  // True if a joint is beyond a soft limit.
  [[nodiscard]] bool is_outside() noexcept;
  // Begins the next phase of `prepare` that has something to do.
  void begin_phase_after(Phase phase) noexcept;
  [[nodiscard]] DriverReport do_phase() noexcept;
  void begin_reference() noexcept;
  [[nodiscard]] DriverReport wait_for_reference() noexcept;
  void begin_test() noexcept;
  [[nodiscard]] DriverReport test() noexcept;
  void begin_homing() noexcept;
  void begin_push() noexcept;
  // Pushes the joints to and fro, before they go to their end stops.
  [[nodiscard]] DriverReport free_joints() noexcept;
  [[nodiscard]] double free_torque(std::size_t joint,
                                   const HomingMeasurement& measured) const noexcept;
  // The joints have come to rest: is that where their end stops are?
  [[nodiscard]] DriverReport confirm_stops() noexcept;
  [[nodiscard]] DriverReport home() noexcept;
  [[nodiscard]] bool homes_at_end_stops() const noexcept;
  void begin_move() noexcept;
  [[nodiscard]] DriverReport move() noexcept;
  void begin_sweeps() noexcept;
  [[nodiscard]] DriverReport sweep() noexcept;
  // Torques that move the joints towards `target` and carry their weight.
  [[nodiscard]] PerJoint<double> torques_towards(const PerJoint<double>& target) const noexcept;
  void measure_index_distances() noexcept;
  void drive(const PerJoint<double>& torque) noexcept;
  void release() noexcept;

  Options options_;
  const Clock& clock_;
  std::vector<Board> boards_;
  Preparation preparation_{};
  // Both atomics carry nothing but themselves between two threads, a few times per minute, so the
  // default order, the strictest one, costs nothing.
  std::atomic<ReferenceStep> reference_step_{ReferenceStep::kWaiting};
  std::atomic<Phase> phase_{Phase::kStarting};
  WiringTest wiring_;
  std::vector<JointHoming> homing_;
  std::vector<double> home_position_;
  std::size_t swept_{0};  // the joint that sweeps
  JointSweep sweep_{};
  std::vector<JointReport> reports_;
  std::vector<NewestIndex> newest_index_;
  std::uint64_t lost_before_{0};  // frames lost before this session
  TimeIndex part_steps_{0};       // of this part of homing, or of the move
  bool must_free_{false};         // something was in the way of the last move
  int free_pushes_{0};            // to and fro, before the next push to the end stops
  int stop_pushes_{0};            // to the end stops, in this homing
  // The step of a push in which each joint begins.
  std::vector<TimeIndex> turn_;
  std::vector<double> stops_;  // where the joints came to rest in the one before
  bool has_stops_{false};      // the joints came to rest there twice
  Random pushes_{};
  std::vector<double> push_;
  std::vector<double> zero_;  // raw angle of each joint at 0 rad
  PerJoint<double> start_;    // where the move begins
  bool is_homed_{false};
  CountedAction desired_;
  std::array<CompanionDescription, 1> companions_;
  Wear wear_;
  std::vector<MotorMeter> meters_;
  Instant counted_{};                    // when wear was counted last
  std::optional<Instant> wear_shown_{};  // when its newest element was made
};

}  // namespace trifinger::boards
