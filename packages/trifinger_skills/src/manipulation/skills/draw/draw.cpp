// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/draw/draw.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "manipulation/parts/torque_figure.hpp"
#include "manipulation/skills/draw/drawing.hpp"
#include "manipulation/skills/makers.hpp"
#include "model/rotation_between.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr Seconds kLongestClose{5.0};
constexpr Seconds kCheckTime{1.0};
constexpr double kStillPlace = 1e-3;  // Between two looks at a pen that rests [m].
constexpr double kStillTilt = 0.01;   // [rad]
constexpr Seconds kNumbTime{0.1};
constexpr double kOver = 3e-4;  // A nib so near to the beginning of a line may go down [m].
constexpr Seconds kOverTime{0.2};
constexpr Seconds kLongestHover{2.0};
constexpr Seconds kSettling{0.1};  // The nib rests on the paper so long before a line begins.
constexpr double kFit = 6e-3;      // Largest error of the distance of tips that hold [m].
constexpr double kMaxLean = 0.35;  // A pen in its holder leans less [rad].
const Vector3d kDown = -Vector3d::UnitZ();

}  // namespace

constinit const std::array<Draw::Row, 16> Draw::kPhases{{
    // name, when it is stopped, done, next, entry, during
    {"look", &Draw::fail, nullptr, kPlan, nullptr, &Draw::look},
    {"plan", &Draw::fail},
    {"approach", &Draw::open, &Draw::are_tips_there, kClose, &Draw::begin_closing},
    {"close", &Draw::open, &Draw::has_closed, kGrip, nullptr, &Draw::close},
    {"grip", &Draw::open, &Draw::has_gripped, kLift, &Draw::hold, &Draw::grip},
    {"lift", &Draw::put_back, &Draw::is_nib_there, kCarry, &Draw::begin_carrying, &Draw::watch},
    {"carry", &Draw::put_back, &Draw::is_upright_there, kHop, &Draw::begin_stroke, &Draw::watch},
    {"hop", &Draw::put_back, &Draw::is_over_line, kLand, &Draw::land, &Draw::hover},
    {"land", &Draw::put_back, &Draw::is_nib_there, kDraw, nullptr, &Draw::watch},
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
    trajectories_[finger(k)].begin({back, around[k], beside[k]}, config_.approach_speed);
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
    if (pen.up.z() < std::cos(kMaxLean)) {
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
  twist_ = 0.0;
  shift_.setZero();
  correction_.setZero();
  nib_trajectory_.rest_at(pen.nib);
  Vector3d up = pen.nib;
  up.z() = travel_height();
  nib_trajectory_.begin({up}, config_.holder_speed);
  numb_ = Seconds(0);
  is_lost_ = false;
  felt_ = pen;
  history_.fill(pen);
}

void Draw::begin_stroke() noexcept {
  const Eigen::Vector2d start = strokes_[stroke_].front().at(Seconds(0)).position;
  Vector3d up = nib_.position;
  up.z() = on_paper(start, config_.hop).z();
  nib_trajectory_.rest_at(nib_.position);
  nib_trajectory_.begin({up, on_paper(start, config_.hop)}, config_.hop_speed);
  part_ = 0;
  hovers_ = over_ = Seconds(0);
}

// The nib waits over the beginning of a line until it is where it should be.
void Draw::hover(Seconds elapsed) noexcept {
  if (is_nib_there()) hovers_ += elapsed;
  const bool is_over = (nib_.position - felt_.nib).head<2>().norm() < kOver;
  over_ = is_over ? over_ + elapsed : Seconds(0);
  watch(elapsed);
}

bool Draw::is_over_line() const noexcept {
  return is_nib_there() && (over_ > kOverTime || hovers_ > kLongestHover);
}

void Draw::land() noexcept {
  extra_press_ = 0.0;
  landed_ = Seconds(0);
  nib_trajectory_.begin({on_paper(nib_.position.head<2>(), 0.0)}, config_.hop_speed);
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
  nib_trajectory_.rest_at(nib_.position);
  nib_trajectory_.begin({up, above_holder(travel_height())}, config_.carry_speed);
  // A pen that has not been turned upright yet is turned on the way.
  tilt_ = control::rotation_vector(control::rotation_from_vector(-twist_ * grip_.inward) * turn_);
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
    TipTrajectory& trajectory = trajectories_[finger(k)];
    trajectory.rest_at(now);
    constexpr double kOpeningSpeed = 0.05;
    if (phase_ != Phase::kApproach)
      trajectory.begin({now + side * config_.grip.clearance * inward_}, kOpeningSpeed);
  }
}

void Draw::finish_check() noexcept {
  const PenAxis pen = axis_of(average_.mean());
  const double off = (pen.nib.head<2>() - hole_).norm();
  if (average_.count() == 0) {
    fail("the pen was not seen at the end");
  } else if (pen.up.z() < std::cos(kMaxLean) || off > config_.hole ||
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
  closing_.begin(gap(tips()));
}

void Draw::close(Seconds elapsed) noexcept {
  const double distance = gap(tips());
  closing_.follow(distance, std::abs(distance - 2 * radii_) < kFit, elapsed);
  if (!has_closed() && clock_.in_phase() > kLongestClose) open("the pen was not between the tips");
}

bool Draw::has_closed() const noexcept { return closing_.has_closed(); }

void Draw::grip(Seconds /*elapsed*/) noexcept {
  if (squeeze_ >= config_.grip.force) return;
  average_.restart(clock_.step());
  clock_.begin_phase();
}

void Draw::begin_carrying() noexcept {
  const Eigen::Vector2d start = strokes_.front().front().at(Seconds(0)).position;
  nib_trajectory_.begin({on_paper(start, travel_height())}, config_.carry_speed);
}

void Draw::draw(Seconds elapsed) noexcept {
  landed_ += elapsed;
  if (landed_ < kSettling) clock_.begin_phase();
  if (clock_.in_phase() >= strokes_[stroke_][part_].duration()) finish_part();
  watch(elapsed);
}

void Draw::begin_lowering() noexcept {
  nib_trajectory_.begin({above_holder(pen_radius_)}, config_.holder_speed);
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

std::unique_ptr<Skill> make_draw(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Draw>(context, read_draw(root));
}

}  // namespace trifinger::manipulation
