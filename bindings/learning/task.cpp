// SPDX-License-Identifier: BSD-3-Clause
#include "task.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "conversion/text.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace learning;

nb::object array_of(std::span<const double> numbers) {
  return nb::cast(Eigen::VectorXd(
      Eigen::VectorXd::Map(numbers.data(), static_cast<Eigen::Index>(numbers.size()))));
}

// Copies the numbers that a function of the task has returned.
void copy_numbers(const nb::object& numbers, const char* what, std::span<double> target) {
  const nb::object as_array =
      nb::module_::import_("numpy").attr("asarray")(numbers, "dtype"_a = "f8");
  const auto values = nb::cast<std::vector<double>>(as_array.attr("ravel")().attr("tolist")());
  if (values.size() != target.size()) {
    throw InvalidArgument(std::string(what) + " has " + std::to_string(values.size()) +
                          " numbers, must have " + std::to_string(target.size()));
  }
  std::ranges::copy(values, target.begin());
}

class PythonTask final : public Task {
 public:
  PythonTask(nb::handle task, std::size_t num_joints, std::shared_ptr<TaskFailure> failure)
      : task_(task),
        num_joints_(num_joints),
        failure_(std::move(failure)),
        object_name_(nb::cast<std::string>(task_.attr("object_name"))),
        has_goals_of_fingers_(nb::cast<bool>(task_.attr("has_goals_of_fingers"))),
        goal_{.name = "goal",
              .unit = nb::cast<std::string>(task_.attr("goal_unit")),
              .low = nb::cast<std::vector<double>>(task_.attr("goal_low")),
              .high = nb::cast<std::vector<double>>(task_.attr("goal_high"))},
        view_(nb::module_::import_("trifinger.tasks").attr("View")) {
    if (goal_.low.size() != goal_.high.size()) {
      throw InvalidArgument("goal_low has " + std::to_string(goal_.low.size()) +
                            " numbers, goal_high has " + std::to_string(goal_.high.size()));
    }
  }

  [[nodiscard]] std::string_view object_name() const noexcept override { return object_name_; }
  [[nodiscard]] bool has_goals_of_fingers() const noexcept override {
    return has_goals_of_fingers_;
  }
  [[nodiscard]] Entry goal() const override { return goal_; }

  void draw_start(const Workspace& /*workspace*/, Random& random,
                  Start& start) const noexcept override {
    attempt([&] {
      const nb::object drawn =
          task_.attr("draw_start")(nb::cast(&random, nb::rv_policy::reference));
      const auto take = [&drawn](const char* name, std::span<double> target) {
        const nb::object numbers = drawn.attr(name);
        if (!numbers.is_none()) copy_numbers(numbers, name, target);
      };
      take("position", std::span(start.position).first(num_joints_));
      take("object_position", start.object.position);
      take("object_orientation", start.object.orientation);
    });
  }
  void draw_goal(const Workspace& /*workspace*/, Random& random,
                 std::span<double> goal) const noexcept override {
    attempt([&] {
      copy_numbers(task_.attr("draw_goal")(nb::cast(&random, nb::rv_policy::reference)),
                   "draw_goal()", goal);
    });
  }
  [[nodiscard]] std::int64_t num_goals(double time) const noexcept override {
    std::int64_t number = 1;
    attempt([&] { number = nb::cast<std::int64_t>(task_.attr("num_goals")(time)); });
    return number;
  }
  void achieve(const View& view, Episode& /*episode*/,
               std::span<double> achieved) const noexcept override {
    attempt([&] { copy_numbers(task_.attr("achieve")(view_of(view)), "achieve()", achieved); });
  }
  [[nodiscard]] double reward(std::span<const double> achieved,
                              std::span<const double> desired) const noexcept override {
    double reward = 0.0;
    attempt([&] {
      reward =
          nb::cast<double>(nb::float_(task_.attr("reward")(array_of(achieved), array_of(desired))));
    });
    return reward;
  }
  [[nodiscard]] bool is_success(std::span<const double> achieved, std::span<const double> desired,
                                const Episode& /*episode*/) const noexcept override {
    bool success = false;
    attempt([&] {
      success = static_cast<bool>(
          nb::bool_(task_.attr("is_success")(array_of(achieved), array_of(desired))));
    });
    return success;
  }
  [[nodiscard]] bool has_ended(const View& view,
                               const Episode& /*episode*/) const noexcept override {
    bool ended = false;
    attempt([&] { ended = static_cast<bool>(nb::bool_(task_.attr("has_ended")(view_of(view)))); });
    return ended;
  }

 private:
  // After an exception nothing more is asked.
  template <class Call>
  void attempt(const Call& call) const noexcept {
    if (failure_->has_occurred()) return;
    try {
      call();
    } catch (...) {
      failure_->keep();
    }
  }

  [[nodiscard]] nb::object view_of(const View& view) const {
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
    return view_("tips"_a = nb::cast(Rows(Rows::Map(view.tips.data(), view.tips.size() / 3, 3))),
                 "object_position"_a = array_of(view.object.position),
                 "object_orientation"_a = array_of(view.object.orientation), "time"_a = view.time,
                 "position"_a = array_of(view.position), "velocity"_a = array_of(view.velocity),
                 "joint_position"_a = array_of(view.model_position),
                 "joint_velocity"_a = array_of(view.model_velocity));
  }

  nb::handle task_;
  std::size_t num_joints_;
  std::shared_ptr<TaskFailure> failure_;
  std::string object_name_;
  bool has_goals_of_fingers_;
  Entry goal_;
  nb::object view_;
};

}  // namespace

TaskDescription describe_task(nb::handle task, const std::shared_ptr<TaskFailure>& failure) {
  return {.name = nb::cast<std::string>(task.attr("name")),
          .num_fingers = nb::cast<int>(task.attr("num_fingers")),
          .is_for_files = nb::cast<bool>(task.attr("is_for_files")),
          .make = [task, failure](const Workspace& robot) {
            return std::make_unique<PythonTask>(task, robot.low.size(), failure);
          }};
}

}  // namespace trifinger::bindings
