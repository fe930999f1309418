// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/rotation_between.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/parts/tips_skill.hpp"
#include "manipulation/parts/torque_figure.hpp"
#include "manipulation/parts/towards.hpp"
#include "manipulation/skills/draw/drawing.hpp"
#include "manipulation/skills/draw/line_way.hpp"
#include "manipulation/skills/draw/pen_grip.hpp"
#include "manipulation/skills/makers.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::manipulation {
namespace {

using config::Range;
using control::PointMotion;
using control::Progress;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr Seconds kLongestClose{5.0};
constexpr Seconds kCheckTime{1.0};
constexpr double kStillPlace = 1e-3;  // Between two looks at a pen that rests [m].
constexpr double kStillTilt = 0.01;   // [rad]
constexpr Seconds kNumbTime{0.1};
constexpr Seconds kRollTime{0.3};     // In which the tips' places in the grip follow rolling tips.
constexpr double kSqueezeRate = 2.0;  // [N/s]
constexpr double kStillSpeed = 5e-3;  // Tips that have closed are slower [m/s].
constexpr Seconds kStillTime{0.1};
constexpr double kFit = 6e-3;           // Largest error of the distance of tips that hold [m].
constexpr double kMostLean = 0.35;      // A pen in its holder leans less [rad].
constexpr double kMostNibError = 0.02;  // A pen that is held is nearer to where it should be [m].
constexpr double kMostTiltError = 0.5;  // [rad]
constexpr double kMostShift = 0.02;     // That the feedback makes up for [m].
constexpr double kYieldRate = 10.0;     // How fast the tips go along with a lean [1/s].
constexpr double kYieldShare = 0.6;     // With which share of it.
constexpr double kMostTilt = 0.35;      // [rad]
constexpr double kSafePress = 5.0;      // Largest force of a tip on the pen [N].
const Vector3d kDown = -Vector3d::UnitZ();

// config/skills/draw.yml explains every key.
struct DrawConfig {
  std::string object;
  double holder_height;
  double hole;
  WantedDrawing wanted;
  Seconds look_time;
  Seconds max_duration;
  double approach_speed;
  PenGripConfig grip;
  double closing_force;
  double closing_damping;
  double friction;
  control::TipGains tips;
  double carry_clearance;
  double carry_speed;
  double holder_speed;
  double line_speed;
  Seconds ramp;
  double press;
  double paper_friction;
  double hop;
  double hop_speed;
  double sight_gain;
  double nib_gain;
  double tilt_gain;
};

WantedDrawing read_drawing(const config::Node& root) {
  const Range length = above_zero("m", 0.3);
  WantedDrawing wanted;
  const config::Node paper = root.section("paper");
  const auto centre =
      paper.required<std::array<double, 2>>("centre", {.unit = "m", .min = -0.2, .max = 0.2});
  const auto size = paper.required<std::array<double, 2>>("size", length);
  wanted.paper = {.centre = Eigen::Vector2d::Map(centre.data()),
                  .size = Eigen::Vector2d::Map(size.data()),
                  .turn = paper.required<double>("turn", {.unit = "rad", .min = -10, .max = 10})};
  const auto word = root.required<std::string>("word");
  const auto strokes = root.required<std::string>("strokes");
  const auto height = root.required<double>("letter_height", above_zero("m", 0.1));
  wanted.lines =
      placed(strokes == "none" ? written(word, height) : load_strokes(strokes), wanted.paper);
  return wanted;
}

DrawConfig read_draw(const config::Node& root) {
  const Range length = above_zero("m", 0.3);
  const Range speed = above_zero("m/s", 1);
  const Range force = above_zero("N", 5);
  const Range damping = above_zero("Ns/m", 100);
  const config::Node holder = root.section("holder");
  const config::Node approach = root.section("approach");
  const config::Node grip = root.section("grip");
  const config::Node carry = root.section("carry");
  const config::Node line = root.section("line");
  const config::Node feedback = root.section("feedback");
  return {.object = root.required<std::string>("object"),
          .holder_height = holder.required<double>("height", length),
          .hole = holder.required<double>("hole", length),
          .wanted = read_drawing(root),
          .look_time = read_time(root, "look_time"),
          .max_duration = read_time(root, "max_duration"),
          .approach_speed = approach.required<double>("speed", speed),
          .grip = {.height = grip.required<double>("height", length),
                   .spread = grip.required<double>("spread", length),
                   .force = grip.required<double>("force", force),
                   .clearance = approach.required<double>("clearance", length),
                   .detour = approach.required<double>("detour", length)},
          .closing_force = grip.required<double>("closing_force", force),
          .closing_damping = grip.required<double>("damping", damping),
          .friction = grip.required<double>("friction", above_zero("", 5)),
          .tips = {.stiffness = grip.required<double>("tip_stiffness", above_zero("N/m", 5000)),
                   .damping = grip.required<double>("tip_damping", damping)},
          .carry_clearance = carry.required<double>("clearance", length),
          .carry_speed = carry.required<double>("speed", speed),
          .holder_speed = carry.required<double>("holder_speed", speed),
          .line_speed = line.required<double>("speed", speed),
          .ramp = read_time(line, "ramp"),
          .press = line.required<double>("force", force),
          .paper_friction = line.required<double>("friction", {.min = 0, .max = 5}),
          .hop = line.required<double>("hop", length),
          .hop_speed = line.required<double>("hop_speed", speed),
          .sight_gain = feedback.required<double>("sight", {.unit = "1/s", .min = 0, .max = 20}),
          .nib_gain = feedback.required<double>("nib", {.unit = "1/s", .min = 0, .max = 100}),
          .tilt_gain = feedback.required<double>("tilt", {.unit = "1/s", .min = 0, .max = 100})};
}

enum class DrawPhase : std::uint8_t {
  kLook,
  kPlan,
  kApproach,
  kClose,
  kGrip,
  kLift,
  kCarry,
  kHop,
  kDraw,
  kReturn,
  kLower,
  kRelease,
  kCheck,
  kDone,
  kFailed,
};

// Takes a pen from its holder, draws with it, and puts it back.
//
// The pen is led at its nib: where the nib and the pen's direction should be follows from the
// drawing, and the tips follow with the pen. Only their distance is not kept: there the force of
// the grip acts. What poses show of the nib and the direction is made up for slowly.
class Draw final : public TipsSkill<Draw, DrawPhase> {
 public:
  Draw(const SkillContext& context, DrawConfig config)
      : TipsSkill(context),
        config_(std::move(config)),
        pen_(object_of(context.description, config_.object, ObjectShape::kStick)),
        limits_(context.limits),
        planning_(context.description),
        pen_radius_(pen_.size[1] / 2),
        reach_(pen_.size[0] / 2 - pen_radius_),
        radii_(pen_radius_ + servo_.tip_radius()) {
    for (const PenStroke& stroke : config_.wanted.lines)
      strokes_.push_back(parts_of(stroke, config_.line_speed, config_.ramp));
  }

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return config_.max_duration; }
  void see(TimeIndex captured, const Pose& pose) noexcept override;
  void plan() override;
  void begin() noexcept override;
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;
  [[nodiscard]] std::vector<ReportFile> report_files(
      const SkillTrace& trace, std::span<const SeenPose> poses) const override;

 private:
  using Phase = DrawPhase;
  using enum DrawPhase;
  friend TipsSkill;
  friend Phased;
  static const std::array<Row, 15> kPhases;

  // The tips press on the pen.
  [[nodiscard]] bool grips() const noexcept {
    return phase_ >= Phase::kClose && phase_ <= Phase::kLower;
  }
  // The pen follows the tips.
  [[nodiscard]] bool leads() const noexcept {
    return phase_ >= Phase::kLift && phase_ <= Phase::kLower;
  }
  [[nodiscard]] PenAxis axis_of(const Pose& pose) const noexcept {
    const Vector3d along = pose.orientation * Vector3d::UnitX();
    return {.nib = pose.position + reach_ * along, .up = -along};
  }
  [[nodiscard]] double travel_height() const noexcept {
    return config_.holder_height + config_.carry_clearance + pen_radius_;
  }
  [[nodiscard]] Vector3d on_paper(const Eigen::Vector2d& point, double height) const noexcept {
    return {point.x(), point.y(), pen_radius_ + height};
  }
  [[nodiscard]] Vector3d above_holder(double height) const noexcept {
    return {hole_.x(), hole_.y(), height};
  }

  // What happens in phases, between them, and when the skill is stopped; see `kPhases`.
  void look(Seconds elapsed) noexcept;
  void begin_closing() noexcept;
  void close(Seconds elapsed) noexcept;
  void grip(Seconds elapsed) noexcept;
  void hold() noexcept;
  void begin_carrying() noexcept;
  void begin_stroke() noexcept;
  void draw(Seconds elapsed) noexcept;
  void begin_lowering() noexcept;
  void take_tips_off() noexcept;
  void release(Seconds elapsed) noexcept;
  void check(Seconds elapsed) noexcept;
  void watch(Seconds elapsed) noexcept;
  void open(std::string_view failure) noexcept;
  void put_back(std::string_view failure) noexcept;
  [[nodiscard]] bool has_closed() const noexcept { return still_ >= kStillTime; }
  [[nodiscard]] bool has_gripped() const noexcept {
    return squeeze_ >= config_.grip.force && clock_.in_phase() >= config_.look_time + Seconds(0.05);
  }
  [[nodiscard]] bool is_nib_there() const noexcept { return nib_way_.is_complete(); }
  // What the pen has turned in the holder is made up for before it draws.
  [[nodiscard]] bool is_upright_there() const noexcept {
    return is_nib_there() && clock_.in_phase() > Seconds(2.0);
  }

  void finish_check() noexcept;
  void finish_part() noexcept;
  void lead(Seconds elapsed) noexcept;
  void press(TipVectors& forces, TipVectors& accelerations, Seconds elapsed) noexcept;
  void add_grip(TipVectors& forces) noexcept;
  void correct(TimeIndex captured, const PenAxis& seen) noexcept;
  void sense_object(const control::JointState& joints, Seconds elapsed) noexcept {
    if (leads()) feel(joints, elapsed);
  }
  void feel(const control::JointState& joints, Seconds elapsed) noexcept;
  void make_up(Seconds elapsed) noexcept;
  [[nodiscard]] Motion desired() const noexcept;
  [[nodiscard]] std::size_t finger(std::size_t k) const noexcept {
    return static_cast<std::size_t>(grip_.fingers[k]);
  }
  // Distance of the first tip from the middle of the others, across the pen.
  [[nodiscard]] double gap(const std::array<Vector3d, 3>& of) const noexcept {
    return ((of[1] + of[2]) / 2 - of[0]).dot(inward_);
  }
  [[nodiscard]] std::array<Vector3d, 3> tips() const noexcept {
    return {servo_.tip(grip_.fingers[0]), servo_.tip(grip_.fingers[1]),
            servo_.tip(grip_.fingers[2])};
  }
  [[nodiscard]] std::array<Vector3d, 3> velocities() const noexcept {
    return {servo_.velocity(grip_.fingers[0]), servo_.velocity(grip_.fingers[1]),
            servo_.velocity(grip_.fingers[2])};
  }
  // The turn of the pen from upright that the tips ask for.
  [[nodiscard]] Quaterniond corrected_turn() const noexcept {
    return control::rotation_from_vector(correction_) * turn_;
  }
  // From a tip to the axis of the pen, as it is felt.
  [[nodiscard]] Vector3d normal_at(std::size_t k) const noexcept {
    Vector3d expected = k == 0 ? inward_ : Vector3d(-inward_);
    if (!leads()) return expected;
    const Vector3d from = felt_.nib - servo_.tip(grip_.fingers[k]);
    const Vector3d across = (from - from.dot(felt_.up) * felt_.up).normalized();
    constexpr double kMostOblique = 0.5;  // Cosine; beyond, the tip is no longer at its side.
    return across.dot(expected) > kMostOblique ? across : expected;
  }
  [[nodiscard]] Drawing smoothed(std::span<const SeenPose> poses) const;

  DrawConfig config_;
  ObjectDescription pen_;
  control::SafetyLimits limits_;
  Kinematics planning_;  // Used by `plan` only, perhaps in another thread.
  control::ForceOptimizer optimizer_;
  double pen_radius_;
  double reach_;  // From the centre of the pen to that of its nib.
  double radii_;  // The radii of the pen and a tip together.
  std::vector<std::vector<LinePart>> strokes_;

  Pose rest_;  // Where the pen is before it is gripped.
  Seconds looked_{0};
  Eigen::Vector2d hole_{0, 0};  // Middle of the holder.
  std::array<Vector3d, 3> tips_at_plan_;
  std::optional<PenGrip> planned_;
  PenGrip grip_;
  Vector3d inward_{Vector3d::UnitX()};  // The direction of the grip as the pen is led.
  std::array<Vector3d, 3> touch_;       // Where the tips should touch the resting pen.

  // From here on in the order of the grip.
  std::array<Vector3d, 3> arms_;     // From the nib to the tips, of the upright pen.
  Vector3d tilt_{Vector3d::Zero()};  // How the pen is turned from upright when it is lifted.
  Quaterniond upright_{Quaterniond::Identity()};  // Orientation of the upright stick.
  TipWay nib_way_;
  PointMotion nib_;                            // Where the nib should be.
  Quaterniond turn_{Quaterniond::Identity()};  // How the pen should be turned from upright.
  Vector3d shift_{Vector3d::Zero()};           // Makes up for errors of the nib.
  Vector3d correction_{Vector3d::Zero()};      // Makes up for errors of the direction.
  double squeeze_{0.0};                        // [N]
  double press_{0.0};                          // The nib presses on the paper with it [N].
  Seconds still_{0};
  Seconds numb_{0};
  bool is_lost_{false};
  std::size_t stroke_{0};
  std::size_t part_{0};
  TimeIndex last_seen_{-1};

  PenAxis felt_;  // Where the pen is: from how the tips move, corrected by poses.
  std::array<PenAxis, 128> history_;  // The same by step, for poses that come late.
};

constinit const std::array<Draw::Row, 15> Draw::kPhases{{
    // name, when it is stopped, done, next, entry, during
    {"look", &Draw::fail, nullptr, kPlan, nullptr, &Draw::look},
    {"plan", &Draw::fail},
    {"approach", &Draw::open, &Draw::are_tips_there, kClose, &Draw::begin_closing},
    {"close", &Draw::open, &Draw::has_closed, kGrip, nullptr, &Draw::close},
    {"grip", &Draw::open, &Draw::has_gripped, kLift, &Draw::hold, &Draw::grip},
    {"lift", &Draw::put_back, &Draw::is_nib_there, kCarry, &Draw::begin_carrying, &Draw::watch},
    {"carry", &Draw::put_back, &Draw::is_upright_there, kHop, &Draw::begin_stroke, &Draw::watch},
    {"hop", &Draw::put_back, &Draw::is_nib_there, kDraw, nullptr, &Draw::watch},
    {"draw", &Draw::put_back, nullptr, kReturn, nullptr, &Draw::draw},
    {"return", &Draw::note_failure, &Draw::is_upright_there, kLower, &Draw::begin_lowering,
     &Draw::watch},
    {"lower", &Draw::note_failure, &Draw::is_nib_there, kRelease, &Draw::take_tips_off,
     &Draw::watch},
    {"release", &Draw::note_failure, &Draw::has_let_go, kCheck, nullptr, &Draw::release},
    {"check", &Draw::fail, nullptr, kDone, nullptr, &Draw::check},
    {"done"},
    {"failed"},
}};

void Draw::see(TimeIndex captured, const Pose& pose) noexcept {
  if (!estimator_.update(clock_.time_of(captured), pose)) return;
  average_.add(captured, pose);
  if (leads()) correct(captured, axis_of(pose));
  last_seen_ = captured;
}

// Corrects the estimate by what a pose shows of the time when it was captured.
void Draw::correct(TimeIndex captured, const PenAxis& seen) noexcept {
  if (captured < 0 || clock_.step() - captured >= static_cast<TimeIndex>(history_.size())) return;
  // A pose of this very step comes before its joints.
  const PenAxis& then = captured > clock_.step()
                            ? felt_
                            : history_[static_cast<std::size_t>(captured) % history_.size()];
  const Vector3d error = seen.nib - then.nib;
  const Vector3d turn = then.up.cross(seen.up);
  is_lost_ = error.norm() > kMostNibError || turn.norm() > kMostTiltError;
  const Seconds since = clock_.period() * static_cast<double>(captured - last_seen_);
  const double share = std::min(config_.sight_gain * since.count(), 0.2);
  felt_.nib += share * error;
  felt_.up = control::rotation_from_vector(share * turn) * felt_.up;
}

// The tips roll on the pen without slipping: how the pen moves follows from how they move and turn.
void Draw::feel(const control::JointState& joints, Seconds elapsed) noexcept {
  control::Grasp grasp;
  control::ContactForces velocities;
  for (std::size_t k = 0; k < 3; ++k) {
    const int of = grip_.fingers[k];
    const Vector3d arm = servo_.tip_radius() * normal_at(k);
    grasp[k].position = servo_.tip(of) + arm;
    const Vector3d turning = servo_.kinematics().tip_rotation_jacobian(of) * joints.velocity;
    velocities.segment<3>(3 * static_cast<Eigen::Index>(k)) =
        servo_.velocity(of) + turning.cross(arm);
  }
  const control::Twist twist = control::twist_of(grasp, felt_.nib, velocities);
  felt_.nib += elapsed.count() * twist.linear;
  felt_.up =
      (control::rotation_from_vector(elapsed.count() * twist.angular) * felt_.up).normalized();
  const auto now = static_cast<std::size_t>(std::max<TimeIndex>(clock_.step(), 0));
  history_[now % history_.size()] = felt_;
}

// Moves the tips against the errors that are felt.
void Draw::make_up(Seconds elapsed) noexcept {
  if (phase_ == Phase::kLift || phase_ == Phase::kLower) return;  // The holder leads it, too.
  Vector3d error = nib_.position - felt_.nib;
  if (phase_ == Phase::kDraw) error.z() = 0.0;  // There a force acts.
  shift_ += config_.nib_gain * elapsed.count() * error;
  shift_ = shift_.cwiseMax(-kMostShift).cwiseMin(kMostShift);
  const Vector3d turn = felt_.up.cross(turn_ * Vector3d::UnitZ());
  // Turned about the direction of the grip against a pen that leans, the two tips come to lie
  // beside it and push it over all the more. There they go along with most of the lean.
  const Vector3d lean = turn.dot(inward_) * inward_;
  const Vector3d aside = correction_.dot(inward_) * inward_;
  correction_ += elapsed.count() *
                 (config_.tilt_gain * (turn - lean) - kYieldRate * (kYieldShare * lean + aside));
  if (correction_.norm() > kMostTilt) correction_ *= kMostTilt / correction_.norm();
}

void Draw::plan() {
  std::vector<Vector3d> nibs{above_holder(travel_height())};
  Eigen::AlignedBox2d box;
  for (const PenStroke& stroke : config_.wanted.lines)
    for (const Eigen::Vector2d& point : stroke) box.extend(point);
  for (const auto corner : {Eigen::AlignedBox2d::BottomLeft, Eigen::AlignedBox2d::BottomRight,
                            Eigen::AlignedBox2d::TopLeft, Eigen::AlignedBox2d::TopRight})
    nibs.push_back(on_paper(box.corner(corner), 0.0));
  nibs.push_back(on_paper(box.center(), travel_height()));
  planned_ = choose_pen_grip(planning_, limits_, tips_at_plan_, axis_of(rest_), pen_.size[0], nibs,
                             config_.grip, radii_);
}

void Draw::begin() noexcept {
  if (phase_ != Phase::kPlan) return;  // It was stopped meanwhile.
  if (!planned_) {
    fail("the fingers cannot hold the pen where it stands and where it should draw");
    return;
  }
  grip_ = *planned_;
  inward_ = grip_.inward;
  const PenAxis pen = axis_of(rest_);
  touch_ = tips_of(grip_, pen, config_.grip, radii_, 0.0);
  const auto around = tips_of(grip_, pen, config_.grip, radii_, config_.grip.detour - radii_);
  const auto beside = tips_of(grip_, pen, config_.grip, radii_, config_.grip.clearance);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d now = servo_.tip(grip_.fingers[k]);
    Vector3d away = now - pen.nib;
    away.z() = 0.0;
    Vector3d back = pen.nib + std::max(config_.grip.detour, away.norm()) * away.normalized();
    back.z() = around[k].z();
    ways_[finger(k)].begin({back, around[k], beside[k]}, config_.approach_speed);
  }
  enter(Phase::kApproach);
}

void Draw::look(Seconds /*elapsed*/) noexcept {
  if (average_.count() > 0 && clock_.in_phase() >= config_.look_time) {
    const Pose before = std::exchange(rest_, average_.mean());
    const PenAxis pen = axis_of(rest_);
    const bool rests = (rest_.position - before.position).norm() < kStillPlace &&
                       pen.up.cross(axis_of(before).up).norm() < kStillTilt;
    if (!rests && looked_ < kLongestLook) {
      looked_ += clock_.in_phase();
      average_.restart(clock_.step());
      enter(Phase::kLook);
      return;
    }
    if (pen.up.z() < std::cos(kMostLean)) {
      fail("the pen does not stand in its holder, nib down");
      return;
    }
    // It leans about the middle of the hole.
    const double up = (config_.holder_height / 2 - pen.nib.z()) / pen.up.z();
    hole_ = (pen.nib + up * pen.up).head<2>();
    for (int i = 0; i < 3; ++i) tips_at_plan_[static_cast<std::size_t>(i)] = servo_.tip(i);
    enter(Phase::kPlan);
  } else if (clock_.in_phase() >= kLongestLook) {
    fail("the pen was not seen");
  }
}

// From now on the pen is led.
void Draw::hold() noexcept {
  const PenAxis pen = axis_of(average_.count() > 0 ? average_.mean() : rest_);
  const Quaterniond turn = rotation_between(kDown, -pen.up);
  tilt_ = control::rotation_vector(turn);
  turn_ = turn;
  upright_ = turn.conjugate() * rest_.orientation;
  const auto now = tips();
  for (std::size_t k = 0; k < 3; ++k) arms_[k] = turn.conjugate() * (now[k] - pen.nib);
  grip_.inward = turn.conjugate() * grip_.inward;  // As it is with the upright pen.
  shift_.setZero();
  correction_.setZero();
  nib_way_.rest_at(pen.nib);
  Vector3d up = pen.nib;
  up.z() = travel_height();
  nib_way_.begin({up}, config_.holder_speed);
  numb_ = Seconds(0);
  is_lost_ = false;
  felt_ = pen;
  history_.fill(pen);
}

void Draw::begin_stroke() noexcept {
  const Eigen::Vector2d start = strokes_[stroke_].front().at(Seconds(0)).position;
  Vector3d up = nib_.position;
  up.z() = on_paper(start, config_.hop).z();
  nib_way_.rest_at(nib_.position);
  nib_way_.begin({up, on_paper(start, config_.hop), on_paper(start, 0.0)}, config_.hop_speed);
  part_ = 0;
}

void Draw::finish_part() noexcept {
  if (++part_ < strokes_[stroke_].size()) {
    clock_.begin_phase();
    return;
  }
  if (++stroke_ < strokes_.size()) {
    begin_stroke();
    enter(Phase::kHop);
  } else {
    put_back({});
  }
}

// Brings the pen back to its holder, then fails if there is a failure.
void Draw::put_back(std::string_view failure) noexcept {
  note_failure(failure);
  Vector3d up = nib_.position;
  up.z() = travel_height();
  nib_way_.rest_at(nib_.position);
  nib_way_.begin({up, above_holder(travel_height())}, config_.carry_speed);
  // A pen that has not been turned upright yet is turned on the way.
  tilt_ = control::rotation_vector(turn_);
  enter(Phase::kReturn);
}

// Takes the tips off the pen, then fails.
void Draw::open(std::string_view failure) noexcept {
  note_failure(failure);
  take_tips_off();
  enter(Phase::kRelease);
}

void Draw::take_tips_off() noexcept {
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d now = servo_.tip(grip_.fingers[k]);
    const double side = k == 0 ? -1.0 : 1.0;
    TipWay& way = ways_[finger(k)];
    way.rest_at(now);
    constexpr double kOpeningSpeed = 0.05;
    if (phase_ != Phase::kApproach)
      way.begin({now + side * config_.grip.clearance * inward_}, kOpeningSpeed);
  }
}

void Draw::finish_check() noexcept {
  const PenAxis pen = axis_of(average_.mean());
  const double off = (pen.nib.head<2>() - hole_).norm();
  if (average_.count() == 0) {
    fail("the pen was not seen at the end");
  } else if (pen.up.z() < std::cos(kMostLean) || off > config_.hole ||
             pen.nib.z() > config_.holder_height / 2) {
    fail("the pen does not stand in its holder at the end");
  } else {
    enter(Phase::kDone);
  }
}

// Notices a pen that is no longer between the tips, or not as it should be.
void Draw::watch(Seconds elapsed) noexcept {
  const bool fits = std::abs(gap(tips()) - 2 * radii_) < kFit && !is_lost_;
  numb_ = fits ? Seconds(0) : numb_ + elapsed;
  if (numb_ > kNumbTime) open("the pen slipped away");
}

void Draw::begin_closing() noexcept {
  squeeze_ = 0.0;
  still_ = Seconds(0);
}

void Draw::close(Seconds elapsed) noexcept {
  const bool is_still =
      std::abs(gap(velocities())) < kStillSpeed && std::abs(gap(tips()) - 2 * radii_) < kFit;
  still_ = is_still ? still_ + elapsed : Seconds(0);
  if (!has_closed() && clock_.in_phase() > kLongestClose) open("the pen was not between the tips");
}

void Draw::grip(Seconds /*elapsed*/) noexcept {
  if (squeeze_ >= config_.grip.force) return;
  average_.restart(clock_.step());
  clock_.begin_phase();
}

void Draw::begin_carrying() noexcept {
  const Eigen::Vector2d start = strokes_.front().front().at(Seconds(0)).position;
  nib_way_.begin({on_paper(start, travel_height())}, config_.carry_speed);
}

void Draw::draw(Seconds elapsed) noexcept {
  if (clock_.in_phase() >= strokes_[stroke_][part_].duration()) finish_part();
  watch(elapsed);
}

void Draw::begin_lowering() noexcept {
  nib_way_.begin({above_holder(pen_radius_)}, config_.holder_speed);
}

void Draw::release(Seconds /*elapsed*/) noexcept {
  if (!next_failure_.empty() && are_tips_there()) enter(Phase::kFailed);
}

void Draw::check(Seconds /*elapsed*/) noexcept {
  if (clock_.in_phase() < kCheckTime / 2) {
    average_.restart(clock_.step());
  } else if (clock_.in_phase() >= kCheckTime) {
    finish_check();
  }
}

// Sets where the nib and the pen should be now.
void Draw::lead(Seconds elapsed) noexcept {
  Quaterniond turn = control::rotation_from_vector(tilt_);
  if (phase_ == Phase::kDraw) {
    const NibMotion motion = strokes_[stroke_][part_].at(clock_.in_phase());
    nib_ = {.position = on_paper(motion.position, 0.0),
            .velocity = {motion.velocity.x(), motion.velocity.y(), 0.0},
            .acceleration = {motion.acceleration.x(), motion.acceleration.y(), 0.0}};
  } else {
    nib_ = nib_way_.advance(elapsed);
  }
  if (phase_ == Phase::kCarry || phase_ == Phase::kReturn) {
    const Progress progress = control::minimum_jerk(clock_.in_phase(), Seconds(1.5));
    turn = control::rotation_from_vector((1.0 - progress.value) * tilt_);
  } else if (phase_ != Phase::kLift) {
    turn = Quaterniond::Identity();
  }
  turn_ = turn;
}

// The forces of the tips that hold the pen: the weight, what the paper does, and the grip.
void Draw::add_grip(TipVectors& forces) noexcept {
  const auto now = tips();
  const double share = std::min(squeeze_ / config_.grip.force, 1.0);
  control::Grasp grasp;
  Vector3d centre = Vector3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d normal = normal_at(k);
    grasp[k] = {.position = now[k] + servo_.tip_radius() * normal,
                .normal = normal,
                .friction = config_.friction,
                .min_normal_force = k == 0 ? squeeze_ : 0.25 * squeeze_,
                .max_normal_force = kSafePress};
    centre += grasp[k].position / 3;
  }
  const Quaterniond turn = corrected_turn();
  const Vector3d nib = nib_.position + shift_;
  const Vector3d middle = nib + reach_ * (turn * Vector3d::UnitZ());
  const Vector3d weight = share * pen_.mass * control::gravity();
  Vector3d paper = press_ * Vector3d::UnitZ();
  const double speed = nib_.velocity.norm();
  // A nib that hardly moves rubs less.
  constexpr double kRubbing = 2e-3;  // [m/s]
  paper -= config_.paper_friction * press_ * nib_.velocity / std::max(speed, kRubbing);
  const control::Wrench wrench{
      .force = -weight - paper,
      .moment = -(middle - centre).cross(weight) - (nib - centre).cross(paper)};
  const control::ForceDistribution wanted = optimizer_.solve(grasp, centre, wrench);
  for (std::size_t k = 0; k < 3; ++k)
    forces[finger(k)] += wanted.forces.segment<3>(3 * static_cast<Eigen::Index>(k));
}

void Draw::press(TipVectors& forces, TipVectors& accelerations, Seconds elapsed) noexcept {
  if (!grips()) {
    for (int i = 0; i < control::kContacts; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const PointMotion motion = ways_[k].advance(elapsed);
      forces[k] = control::tip_impedance(motion, servo_.tip(i), servo_.velocity(i), config_.tips);
      accelerations[k] = motion.acceleration;
    }
    return;
  }
  std::array<PointMotion, 3> motions;
  for (std::size_t k = 0; k < 3; ++k) motions[k].position = touch_[k];
  if (leads()) {
    lead(elapsed);
    make_up(elapsed);
    const Quaterniond turn = corrected_turn();
    inward_ = turn * grip_.inward;
    for (std::size_t k = 0; k < 3; ++k) {
      motions[k] = nib_;
      motions[k].position += shift_ + turn * arms_[k];
    }
  }
  const auto now = tips();
  if (phase_ == Phase::kDraw) {
    // On the paper a force acts instead of a height: the tips keep their heights among each other.
    double above = 0.0;
    for (std::size_t k = 0; k < 3; ++k) above += (motions[k].position - now[k]).z() / 3;
    for (PointMotion& motion : motions) motion.position.z() -= above;
    shift_.z() -= above;
  }
  const double wanted_press = phase_ == Phase::kDraw ? config_.press : 0.0;
  constexpr double kPressRate = 2.0;  // [N/s]
  press_ = towards(press_, wanted_press, kPressRate * elapsed.count());
  const double squeeze = phase_ == Phase::kClose ? config_.closing_force : config_.grip.force;
  squeeze_ = towards(squeeze_, squeeze, kSqueezeRate * elapsed.count());

  std::array<Vector3d, 3> errors;
  std::array<Vector3d, 3> rates;
  const auto speeds = velocities();
  for (std::size_t k = 0; k < 3; ++k) {
    errors[k] = motions[k].position - now[k];
    rates[k] = motions[k].velocity - speeds[k];
  }
  if (leads()) {
    // Tips roll differently. What moves them against each other must not become a force.
    control::Grasp places;
    control::ContactForces all;
    for (std::size_t k = 0; k < 3; ++k) {
      places[k].position = now[k];
      all.segment<3>(3 * static_cast<Eigen::Index>(k)) = errors[k];
    }
    const control::Twist together = control::twist_of(places, now[0], all);
    const Quaterniond turn = corrected_turn();
    const double share = std::min(elapsed / kRollTime, 1.0);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d rest = errors[k] - together.linear - together.angular.cross(now[k] - now[0]);
      arms_[k] -= share * (turn.conjugate() * rest);
    }
  }
  const double gap_error = gap(errors);
  const double gap_rate = gap(rates);
  for (std::size_t k = 0; k < 3; ++k) {
    const double side = k == 0 ? 1.0 : -1.0;
    const double share = k == 0 ? 1.0 : 0.5;
    const Vector3d error = errors[k] + side * gap_error / 2 * inward_;
    const Vector3d rate = rates[k] + side * gap_rate / 2 * inward_;
    forces[finger(k)] = config_.tips.stiffness * error + config_.tips.damping * rate -
                        side * share * config_.closing_damping * gap_rate / 2 * inward_;
    accelerations[finger(k)] = motions[k].acceleration;
    if (phase_ == Phase::kClose) forces[finger(k)] += side * share * squeeze_ * inward_;
  }
  if (phase_ != Phase::kClose) add_grip(forces);
}

Motion Draw::desired() const noexcept {
  Motion desired{.pose = rest_};
  if (leads()) {
    desired.pose.orientation = turn_ * upright_;
    desired.pose.position = nib_.position - reach_ * (desired.pose.orientation * Vector3d::UnitX());
    desired.twist.linear = nib_.velocity;
  }
  return desired;
}

// What was drawn, from noisy poses: the mean of all within 50 ms.
Drawing Draw::smoothed(std::span<const SeenPose> poses) const {
  const auto half = static_cast<TimeIndex>(Seconds(0.05) / clock_.period());
  constexpr double kTouch = 1.5e-3;  // Less than a hop, more than the noise of a mean [m].
  std::vector<SeenPose> means;
  means.reserve(poses.size());
  std::size_t first = 0;
  std::size_t end = 0;
  for (const SeenPose& seen : poses) {
    while (end < poses.size() && poses[end].step <= seen.step + half) ++end;
    while (poses[first].step < seen.step - half) ++first;
    PoseAverage mean;
    const std::size_t every = std::max<std::size_t>(1, (end - first) / 16);
    for (std::size_t i = first; i < end; i += every) mean.add(poses[i].pose);
    means.push_back({seen.step, mean.count() > 0 ? mean.mean() : seen.pose});
  }
  return drawn_by(pen_, means, config_.wanted.paper, kTouch);
}

std::vector<Figure> Draw::figures(const SkillTrace& trace, std::span<const SeenPose> poses) const {
  const double time = trace.period.count() * static_cast<double>(trace.steps.size());
  const Drawing drawn = smoothed(poses);
  const DrawingError error = compare(config_.wanted.lines, drawn);
  return {{.name = "time", .value = time, .unit = "s", .meaning = "from the first step to the end"},
          torque_share_figure(trace),
          {.name = "line_rms",
           .value = error.rms,
           .unit = "m",
           .meaning = "of the distances of the drawn line from the wanted one"},
          {.name = "line_max", .value = error.largest, .unit = "m", .meaning = "largest of these"},
          {.name = "line_share",
           .value = error.share,
           .unit = "1",
           .meaning = "of the wanted line that was drawn"},
          {.name = "strokes",
           .value = static_cast<double>(stroke_),
           .unit = "",
           .meaning = "drawn to their ends"},
          {.name = "nib_reach",
           .value = reach_,
           .unit = "m",
           .meaning = "from the centre of the pen to its nib"}};
}

std::vector<ReportFile> Draw::report_files(const SkillTrace& /*trace*/,
                                           std::span<const SeenPose> poses) const {
  const Drawing drawn = smoothed(poses);
  return {
      {.name = "drawing.csv", .text = csv_of(config_.wanted.lines, drawn)},
      {.name = "drawing.svg", .text = svg_of(config_.wanted.lines, drawn, config_.wanted.paper)}};
}

}  // namespace

std::unique_ptr<Skill> make_draw(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Draw>(context, read_draw(root));
}

WantedDrawing load_wanted_drawing(const std::string& config,
                                  const std::vector<std::string>& overrides) {
  return read_drawing(load_skill_file(config.empty() ? "draw" : config, overrides).root());
}

}  // namespace trifinger::manipulation
