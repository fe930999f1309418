// SPDX-License-Identifier: BSD-3-Clause
#include "task.hpp"

#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "conversion/array.hpp"
#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace learning;

// An array of NumPy with a row for each robot, and its numbers.
std::pair<nb::object, void*> new_rows(std::size_t rows, std::size_t columns, int type) {
  const auto length = static_cast<npy_intp>(rows);
  return columns > 0 ? new_array({length, static_cast<npy_intp>(columns)}, type)
                     : new_array({length}, type);
}

// One row for each robot, of the numbers that `row_of` returns for it.
template <class Robots, class RowOf>
nb::object rows_of(const Robots& robots, const RowOf& row_of) {
  const std::size_t width = row_of(robots[0]).size();
  auto [array, memory] = new_rows(robots.size(), std::max<std::size_t>(width, 1), NPY_DOUBLE);
  auto* next = static_cast<double*>(memory);
  for (const auto& robot : robots) next = std::ranges::copy(row_of(robot), next).out;
  if (width > 0) return array;
  return array[nb::make_tuple(nb::slice(nb::none(), nb::none(), nb::none()),
                              nb::slice(nb::int_(0), nb::int_(0), nb::none()))];
}

template <class Robots>
nb::object places_of(const Robots& robots) {
  auto [array, memory] = new_rows(robots.size(), 0, NPY_INT64);
  auto* next = static_cast<std::int64_t*>(memory);
  for (const auto& robot : robots) *next++ = static_cast<std::int64_t>(robot.robot);
  return array;
}

// Series of random numbers, one for each of some robots.
using AllSeries = std::vector<Random*>;

// Random numbers for the robots whose episodes or goals a task draws. They can be drawn as long as
// the series are kept by whoever has asked the task.
class RandomOfMany {
 public:
  RandomOfMany(std::span<const Beginning> robots, const std::shared_ptr<AllSeries>& series)
      : robots_(places_of(robots)), series_(series) {
    for (const Beginning& one : robots) {
      chosen_.push_back(series->size());
      series->push_back(&one.episode->random);
    }
  }

  [[nodiscard]] const nb::object& robots() const noexcept { return robots_; }

  // Those of some of the robots.
  [[nodiscard]] RandomOfMany some(const ShownNumbers& which) const {
    const nb::object numpy = nb::module_::import_("numpy");
    RandomOfMany some = *this;
    some.robots_ = robots_[numpy.attr("atleast_1d")(which)];
    const nb::object places = numpy.attr("arange")(chosen_.size());
    some.chosen_.clear();
    for (const auto place : nb::cast<std::vector<std::size_t>>(
             places[numpy.attr("atleast_1d")(which)].attr("tolist")())) {
      some.chosen_.push_back(chosen_[place]);
    }
    return some;
  }

  // `columns` numbers for each robot, or just one (0), in the order of a row.
  template <class T, class Draw>
  nb::object draw(std::size_t columns, int type, const Draw& draw) const {
    const std::shared_ptr<AllSeries> series = series_.lock();
    if (series == nullptr) {
      throw InvalidArgument("a task draws random numbers in draw_start() and draw_goal() only");
    }
    auto [array, memory] = new_rows(chosen_.size(), columns, type);
    auto* next = static_cast<T*>(memory);
    for (const std::size_t place : chosen_) {
      for (std::size_t i = 0; i < std::max<std::size_t>(columns, 1); ++i) {
        *next++ = draw(*(*series)[place], i);
      }
    }
    return array;
  }

 private:
  nb::object robots_;
  std::weak_ptr<AllSeries> series_;
  std::vector<std::size_t> chosen_;
};

// Bounds of one number, or of several.
struct Bounds {
  Bounds(const nb::object& lowest, const nb::object& highest) {
    const nb::object numpy = nb::module_::import_("numpy");
    const nb::object both = numpy.attr("broadcast_arrays")(lowest, highest);
    is_one = nb::cast<int>(both[0].attr("ndim")) == 0;
    if (!read_array(numpy.attr("atleast_1d")(both[0]), low) ||
        !read_array(numpy.attr("atleast_1d")(both[1]), high)) {
      throw InvalidArgument("bounds of random numbers must be numbers, or a list of them");
    }
    if (low.size() == 0) throw InvalidArgument("there are no bounds of random numbers");
    for (Eigen::Index i = 0; i < low.size(); ++i) {
      if (std::isfinite(high[i] - low[i]) && low[i] <= high[i]) continue;
      throw InvalidArgument(detail::text_of("random numbers cannot be from ", low[i], " to ",
                                            high[i],
                                            ": bounds must be finite, the lower one first"));
    }
  }

  Eigen::VectorXd low;
  Eigen::VectorXd high;
  bool is_one{false};
};

// What Python's class says and does. `trifinger.task_answers` asks it and checks the answers, each
// a matrix with a row for every robot.
class PythonTask final : public TaskOfMany {
 public:
  PythonTask(nb::handle task, std::size_t num_joints)
      : task_(task),
        num_joints_(num_joints),
        object_name_(nb::cast<std::string>(task_.attr("object_name"))),
        has_goals_of_fingers_(nb::cast<bool>(task_.attr("has_goals_of_fingers"))),
        goal_{.name = "goal",
              .unit = nb::cast<std::string>(task_.attr("goal_unit")),
              .low = nb::cast<std::vector<double>>(task_.attr("goal_low")),
              .high = nb::cast<std::vector<double>>(task_.attr("goal_high"))},
        answers_(nb::module_::import_("trifinger.task_answers")) {
    check(goal_, "goal_low", "goal_high");
    for (const nb::handle entry : nb::object(task_.attr("entries"))) {
      entries_.push_back({.name = nb::cast<std::string>(entry.attr("name")),
                          .unit = nb::cast<std::string>(entry.attr("unit")),
                          .low = nb::cast<std::vector<double>>(entry.attr("low")),
                          .high = nb::cast<std::vector<double>>(entry.attr("high"))});
      check(entries_.back(), "low", "high");
    }
  }

  [[nodiscard]] std::string_view object_name() const noexcept override { return object_name_; }
  [[nodiscard]] bool has_goals_of_fingers() const noexcept override {
    return has_goals_of_fingers_;
  }
  [[nodiscard]] Entry goal() const override { return goal_; }
  [[nodiscard]] std::vector<Entry> entries() const override { return entries_; }

  void begin(std::span<const Beginning> robots) const override {
    const GilHold hold;
    const RowMajor drawn = drawn_by("start", robots, num_joints_);
    for (std::size_t k = 0; k < robots.size(); ++k) {
      Start& start = *robots[k].start;
      // Where nothing is given, all numbers are NaN.
      const double* next = drawn.row(static_cast<Eigen::Index>(k)).data();
      const auto take = [&next](std::span<double> target) {
        if (!std::isnan(*next)) std::copy_n(next, target.size(), target.begin());
        next += target.size();
      };
      take(std::span(start.position).first(num_joints_));
      take(start.object.position);
      take(start.object.orientation);
    }
    draw_goals(robots);
  }

  void draw_goals(std::span<const Beginning> robots) const override {
    const GilHold hold;
    const RowMajor drawn = drawn_by("goal", robots, goal_.low.size());
    for (std::size_t k = 0; k < robots.size(); ++k) {
      std::copy_n(drawn.row(static_cast<Eigen::Index>(k)).data(), goal_.low.size(),
                  robots[k].episode->goal.begin());
    }
  }

  void judge(std::span<Observed> robots) const override {
    const GilHold hold;
    const auto answer = nb::cast<Array<RowMajor>>(
        answers_.attr("judged")(task_, view_of(std::span<const Observed>(robots))));
    for (std::size_t k = 0; k < robots.size(); ++k) {
      const double* const row = answer.value.row(static_cast<Eigen::Index>(k)).data();
      Observed& one = robots[k];
      one.outcome.reward = row[0];
      one.outcome.success = row[1] != 0.0;
      one.outcome.terminated = row[2] != 0.0;
      one.goals = std::llround(row[3]);
      std::copy_n(row + 4, one.achieved.size(), one.achieved.begin());
    }
  }

  void reward(std::span<const double> achieved, std::span<const double> desired,
              std::span<double> rewards) const override {
    const GilHold hold;
    const auto rows = [&](std::span<const double> goals) {
      auto [array, memory] = new_rows(rewards.size(), goal_.low.size(), NPY_DOUBLE);
      std::ranges::copy(goals, static_cast<double*>(memory));
      return array;
    };
    const auto answer = nb::cast<Array<Eigen::VectorXd>>(
        answers_.attr("rewards")(task_, rows(achieved), rows(desired)));
    std::copy_n(answer.value.data(), rewards.size(), rewards.begin());
  }

  void show(std::span<const Observed> robots, std::span<double> shown) const override {
    const GilHold hold;
    const auto answer = nb::cast<Array<RowMajor>>(answers_.attr("shown")(task_, view_of(robots)));
    std::copy_n(answer.value.data(), shown.size(), shown.begin());
  }

 private:
  static void check(const Entry& entry, const char* low, const char* high) {
    if (entry.low.size() == entry.high.size()) return;
    throw InvalidArgument(std::string(low) + " has " + std::to_string(entry.low.size()) +
                          " numbers, " + high + " has " + std::to_string(entry.high.size()));
  }

  [[nodiscard]] RowMajor drawn_by(const char* what, std::span<const Beginning> robots,
                                  std::size_t width) const {
    const auto series = std::make_shared<AllSeries>();
    const RandomOfMany random(robots, series);
    return nb::cast<Array<RowMajor>>(
               answers_.attr(what)(task_, nb::cast(random), robots.size(), width))
        .value;
  }

  [[nodiscard]] nb::object view_of(std::span<const Observed> robots) const {
    const auto of = [&robots](const auto& row) { return rows_of(robots, row); };
    const std::size_t joints = num_joints_;
    const std::size_t goals = goal_.low.size();
    const auto time = [](const Observed& one) { return std::span(&one.view.time, 1); };
    return answers_.attr("view")(
        places_of(robots), of(time), of([](const Observed& one) {
          return std::span(one.view.tips.data(), static_cast<std::size_t>(one.view.tips.size()));
        }),
        of([](const Observed& one) { return std::span(one.view.object.position); }),
        of([](const Observed& one) { return std::span(one.view.object.orientation); }),
        of([](const Observed& one) { return one.view.position; }),
        of([](const Observed& one) { return one.view.velocity; }),
        of([](const Observed& one) { return one.view.model_position; }),
        of([](const Observed& one) { return one.view.model_velocity; }),
        of([goals](const Observed& one) { return std::span(one.episode->goal).first(goals); }),
        of([joints](const Observed& one) { return std::span(one.episode->action).first(joints); }));
  }

  nb::handle task_;
  std::size_t num_joints_;
  std::string object_name_;
  bool has_goals_of_fingers_;
  Entry goal_;
  std::vector<Entry> entries_;
  nb::object answers_;
};

}  // namespace

TaskDescription describe_task(nb::handle task) {
  if (nb::isinstance<nb::str>(task)) return find_task(nb::cast<std::string>(task));
  return {.name = nb::cast<std::string>(task.attr("name")),
          .num_fingers = nb::cast<int>(task.attr("num_fingers")),
          .is_for_files = nb::cast<bool>(task.attr("is_for_files")),
          .robot = nb::cast<std::string>(task.attr("robot")),
          .make = [task](const Workspace& robot) {
            return std::make_unique<PythonTask>(task, robot.low.size());
          }};
}

void bind_random(nb::module_& m) {
  nb::class_<RandomOfMany>(
      m, "Random",
      "Random numbers for robots, one series for each, which only the seed and "
      "the number of its\nepisode decide.")
      .def_prop_ro(
          "robots",
          [](const RandomOfMany& self) {
            return Shown<"numpy.typing.NDArray[numpy.int64]">(self.robots());
          },
          "Places of these robots in their environment, from 0.")
      .def("__len__", [](const RandomOfMany& self) { return nb::len(self.robots()); })
      .def("__getitem__", &RandomOfMany::some, "which"_a,
           "Those of some of the robots, by marks (bool) or indices: to draw again where a draw is "
           "not fit.")
      .def(
          "uniform",
          [](const RandomOfMany& self, const ShownNumbers& low, const ShownNumbers& high) {
            const Bounds bounds(low, high);
            const auto columns = static_cast<std::size_t>(bounds.low.size());
            return self.draw<double>(bounds.is_one ? 0 : columns, NPY_DOUBLE,
                                     [&](Random& random, std::size_t i) {
                                       const auto k = static_cast<Eigen::Index>(i);
                                       return random.uniform(bounds.low[k], bounds.high[k]);
                                     });
          },
          "low"_a, "high"_a,
          nb::sig("def uniform(self, low: numpy.typing.ArrayLike, high: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Numbers from `low` up to but not including `high`: one for each robot, or with k bounds "
          "a "
          "row of k\nnumbers for each.")
      .def(
          "normal",
          [](const RandomOfMany& self) {
            return self.draw<double>(0, NPY_DOUBLE,
                                     [](Random& random, std::size_t) { return random.normal(); });
          },
          nb::sig("def normal(self) -> numpy.typing.NDArray[numpy.float64]"),
          "A normally distributed number with mean 0 and standard deviation 1 for each robot.")
      .def(
          "integer",
          [](const RandomOfMany& self, std::int64_t low, std::int64_t high) {
            if (low >= high) {
              throw InvalidArgument(detail::text_of("there is no integer from ", low,
                                                    " up to but not including ", high));
            }
            return self.draw<std::int64_t>(0, NPY_INT64, [&](Random& random, std::size_t) {
              return random.integer(low, high);
            });
          },
          "low"_a, "high"_a,
          nb::sig("def integer(self, low: int, high: int) -> numpy.typing.NDArray[numpy.int64]"),
          "An integer from `low` up to but not including `high` for each robot.");
}

}  // namespace trifinger::bindings
