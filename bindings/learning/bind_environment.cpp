// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/choice.hpp"
#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "episodes.hpp"
#include "realtime/processors.hpp"
#include "simulation/simulation.hpp"
#include "task.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/environment_batch.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace learning;

using Actions = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Marks = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// In the order of the enumeration.
constexpr std::array<std::string_view, 3> kAutoresets{"NextStep", "SameStep", "Disabled"};

constexpr std::size_t kPoseNumbers = 7;  // position and quaternion

// Numbers that belong to `owner`, as an array with `rows` rows (none: a vector).
template <class T>
nb::object view(nb::handle owner, T* values, std::size_t size, std::size_t rows = 0) {
  const std::array<std::size_t, 2> shape{rows, rows > 0 ? size / rows : 0};
  const std::size_t* const sizes = rows > 0 ? shape.data() : &size;
  return nb::cast(nb::ndarray<nb::numpy, T>(values, rows > 0 ? 2 : 1, sizes, owner));
}

template <class T>
nb::object view(nb::handle owner, std::vector<T>& values, std::size_t rows = 0) {
  return view(owner, values.data(), values.size(), rows);
}

nb::typed<nb::list, nb::typed<nb::tuple, nb::str, int, int>> describe_cameras(
    const std::vector<camera::Camera>& cameras) {
  nb::typed<nb::list, nb::typed<nb::tuple, nb::str, int, int>> all;
  for (const camera::Camera& camera : cameras) {
    all.append(nb::make_tuple(camera.name, camera.format.height, camera.format.width));
  }
  return all;
}

using EntryTuple = std::tuple<std::string, std::string, std::vector<double>, std::vector<double>>;

EntryTuple tuple_of(const Entry& entry) { return {entry.name, entry.unit, entry.low, entry.high}; }

// A row for each simulation, of memory that `owner` keeps.
nb::object view(nb::handle owner, const BatchRows& rows, std::size_t count) {
  const std::array<std::size_t, 2> shape{count, static_cast<std::size_t>(rows.width)};
  const std::array<std::int64_t, 2> strides{rows.stride, 1};
  return nb::cast(
      nb::ndarray<nb::numpy, double>(rows.first, 2, shape.data(), owner, strides.data()));
}

// Calls a function of Python. The batch must not keep it alive: it has views of the batch.
BatchPhysics physics_of(const nb::callable& function) {
  return [weak = nb::weakref(function)](std::span<const std::uint8_t> moves, bool models_changed) {
    const nb::gil_scoped_acquire hold;
    const nb::object called = weak();
    if (called.is_none()) throw Error("the physics of these simulations are gone");
    auto [array, memory] = new_array({static_cast<npy_intp>(moves.size())}, NPY_BOOL);
    std::ranges::copy(moves, static_cast<std::uint8_t*>(memory));
    called(array, models_changed);
  };
}

ResetStates resets_of(const Rows& position, const Rows& torque, const Rows& object, double share) {
  const std::size_t count = position.shape(0);
  if (torque.shape(0) != count || object.shape(0) != count ||
      (object.shape(1) != 0 && object.shape(1) != kPoseNumbers)) {
    throw InvalidArgument("position, torque and object have " + std::to_string(count) + ", " +
                          std::to_string(torque.shape(0)) + " and " +
                          std::to_string(object.shape(0)) +
                          " rows, must have the same number; object has " +
                          std::to_string(object.shape(1)) + " columns, must have 7 or 0");
  }
  const auto row_of = [](const Rows& rows, std::size_t row) {
    const double* const first = rows.data() + row * rows.shape(1);
    return std::vector<double>(first, first + rows.shape(1));
  };
  ResetStates resets{.share = share};
  for (std::size_t i = 0; i < count; ++i) {
    ResetState& state = resets.states.emplace_back();
    state.position = row_of(position, i);
    state.torque = row_of(torque, i);
    const std::vector<double> pose = row_of(object, i);
    if (pose.empty()) continue;
    state.object.emplace();
    std::copy_n(pose.begin(), 3, state.object->position.begin());
    std::copy_n(pose.begin() + 3, 4, state.object->orientation.begin());
  }
  return resets;
}

// What both classes tell of their task.
template <class T>
void bind_description(nb::class_<T>& type, const Environment& (*environment_of)(const T&)) {
  const auto told = [environment_of](auto ask) {
    return [environment_of, ask](const T& self) { return std::invoke(ask, environment_of(self)); };
  };
  type.def_prop_ro("entries", told([](const Environment& each) {
                     std::vector<EntryTuple> entries;
                     for (const Entry& entry : each.entries()) entries.push_back(tuple_of(entry));
                     return entries;
                   }),
                   also(docs::Environment::entries, R"(Each is name, unit, low and high.)"))
      .def_prop_ro("hidden_entries", told([](const Environment& each) {
                     std::vector<EntryTuple> entries;
                     for (const Entry& entry : each.hidden_entries()) {
                       entries.push_back(tuple_of(entry));
                     }
                     return entries;
                   }),
                   docs::Environment::hidden_entries)
      .def_prop_ro("goal", told([](const Environment& each) { return tuple_of(each.goal()); }))
      .def_prop_ro("flat_names", told(&Environment::flat_names))
      .def_prop_ro("episode_actions", told(&Environment::episode_actions))
      .def_prop_ro(
          "oldest_image_age", [](const T&) { return kOldestImage; },
          "Images that are older count as this old [steps].")
      .def_prop_ro("judges_by_truth", told(&Environment::judges_by_truth),
                   docs::Environment::judges_by_truth)
      .def_prop_ro("num_parts", told(&Environment::num_parts), docs::Environment::num_parts)
      .def_prop_ro("has_goals_of_fingers", told(&Environment::has_goals_of_fingers),
                   docs::Environment::has_goals_of_fingers)
      .def_prop_ro("score_names", told(&Environment::scores), docs::Environment::scores)
      .def_prop_ro("num_joints", told(&Environment::num_joints))
      .def_prop_ro("object_name",
                   told([](const Environment& each) { return std::string(each.object_name()); }))
      .def(
          "compute_reward",
          [environment_of](const T& self, const Rows& achieved, const Rows& desired) {
            if (achieved.shape(0) != desired.shape(0)) {
              throw InvalidArgument("there are " + std::to_string(achieved.shape(0)) +
                                    " achieved goals, but " + std::to_string(desired.shape(0)) +
                                    " desired ones");
            }
            Eigen::VectorXd rewards(static_cast<Eigen::Index>(achieved.shape(0)));
            environment_of(self).rewards({achieved.data(), achieved.size()},
                                         {desired.data(), desired.size()},
                                         {rewards.data(), achieved.shape(0)});
            return rewards;
          },
          "achieved"_a, "desired"_a, "One reward for each row.");
}

std::tuple<TimeIndex, double, bool, bool, bool, TimeIndex> told(const Episodes& self,
                                                                const Episodes::Seen& seen) {
  const Outcome& outcome = self.outcome;
  return {seen.time_index,   outcome.reward,  outcome.terminated,
          outcome.truncated, outcome.success, seen.object_age};
}

void bind_episodes(nb::module_& m) {
  nb::class_<Episodes> type(
      m, "Episodes", also(docs::Environment::Environment, R"(`trifinger.environments` uses it.)"));
  type.def(
          "__init__",
          [](Episodes* self, const nb::object& task, const std::string& options,
             const std::string& config, const Overrides& overrides) {
            new (self) Episodes(describe_task(task), read_options(options),
                                load_config(config, overrides));
          },
          "task"_a, "options"_a, "config"_a, "overrides"_a)
      .def(
          "begin",
          [](Episodes& self, std::uint64_t seed, std::uint64_t number) {
            self.begin(seed, number);
            const Start& start = self.start;
            const auto list = [](const auto& numbers, std::size_t count) {
              return std::vector<double>(numbers.begin(), numbers.begin() + count);
            };
            return std::tuple(list(start.position, self.environment.num_joints()),
                              list(start.object.position, 3), list(start.object.orientation, 4),
                              list(start.object_velocity.linear, 3), start.variation,
                              start.random.episode, self.model_positions());
          },
          "seed"_a, "number"_a,
          also(
              docs::Environment::begin,
              R"(Returns the joints [rad], the object's position [m], quaternion and velocity [m/s], the variation,
the series of random numbers, and positions of the first hinges and slides of a robot from a file; NaN: as always.)"))
      .def(
          "check_robot",
          [](Episodes& self, const std::optional<std::string>& configuration) {
            self.check_robot(configuration);
          },
          "configuration"_a.none(),
          "Refuses another robot than that of `config`, by its configuration if that is known, and "
          "takes\n"
          "the age of its poses from there.")
      .def_prop_ro(
          "oldest_sure_age", [](const Episodes& self) { return self.oldest_sure_age; },
          "Age of a pose up to which it is sure; of a connected robot once it was checked [steps].")
      .def(
          "approach",
          [](const Episodes& self, const Array<Eigen::VectorXd>& from) {
            const auto joints = static_cast<Eigen::Index>(self.environment.num_joints());
            if (from.value.size() != joints) {
              throw InvalidArgument("from_position must have " + std::to_string(joints) +
                                    " numbers");
            }
            RowMajor approach(self.environment.approach_actions(), joints);
            const auto size = static_cast<std::size_t>(joints);
            for (Eigen::Index i = 0; i < approach.rows(); ++i) {
              self.environment.approach_point({from.value.data(), size}, self.start, i,
                                              {approach.row(i).data(), size});
            }
            return Array{std::move(approach)};
          },
          "from_position"_a,
          "Joint positions that bring a robot to where the episode begins: a row for each action "
          "[rad].")
      .def(
          "step",
          [](Episodes& self, PythonFrontend& robot, const Actions& numbers,
             const PythonFrontend* poses, const PythonSimulation* simulation) {
            return told(self,
                        self.step(robot, {numbers.data(), numbers.size()}, poses, simulation));
          },
          "robot"_a, "numbers"_a, "poses"_a.none(), "simulation"_a.none(),
          nb::sig("def step(self, robot: Frontend, numbers: numpy.typing.NDArray[numpy.float32], "
                  "poses: Frontend | None, simulation: Simulation | None) -> tuple[int, float, "
                  "bool, bool, bool, int]"),
          "Applies an action, and looks at what follows it: `look`.")
      .def(
          "look",
          [](Episodes& self, PythonFrontend& robot, TimeIndex t, const PythonFrontend* poses,
             const PythonSimulation* simulation) {
            return told(self, self.look(robot, t, poses, simulation));
          },
          "robot"_a, "t"_a, "poses"_a.none(), "simulation"_a.none(),
          "Looks at what the robot measured at step `t`. `poses` is the companion with the poses "
          "of objects;\n`simulation` knows where they really are. Returns the step, reward, "
          "terminated, truncated, success\nand the age of the object's pose [steps], -1 if it was "
          "not found yet; the arrays below change.");
  type.def_prop_ro(
      "last_step", [](const Episodes& self) { return self.last_step; },
      "Step of the robot that followed the last action, whatever the task said of it; -1: none.");
  type.def_prop_ro(
      "bodies",
      [](const Episodes& self) {
        std::vector<std::string> names;
        if (const auto& file = self.config.simulation.file) {
          for (const ObjectAddress& body : file->objects()) names.push_back(body.name);
        }
        return names;
      },
      "Names of the free bodies of a robot from a file.");
  type.def_prop_ro(
      "cameras", [](const Episodes& self) { return describe_cameras(self.cameras); },
      "Name, height and width of each camera that is observed.");
  bind_description<Episodes>(
      type, [](const Episodes& self) -> const Environment& { return self.environment; });
  const auto array = [&type](const char* name, const char* number, auto get) {
    const std::string signature =
        "def " + std::string(name) + "(self) -> numpy.typing.NDArray[numpy." + number + "]";
    type.def_prop_ro(
        name,
        [get](nb::handle self) {
          const auto numbers = get(nb::cast<Episodes&>(self));
          return view(self, numbers.data(), numbers.size());
        },
        nb::sig(signature.c_str()));
  };
  array("observation", "float32", [](Episodes& self) { return std::span(self.observation); });
  array("achieved", "float64", [](Episodes& self) { return std::span(self.achieved); });
  array("desired", "float64", [](Episodes& self) { return std::span(self.desired); });
  array("distance", "float64", [](Episodes& self) {
    return std::span(self.outcome.distance).first(self.environment.num_parts());
  });
  array("finger_rewards", "float64", [](Episodes& self) {
    return std::span(self.outcome.finger_rewards).first(self.environment.num_parts());
  });
  array("scores", "float64", [](Episodes& self) {
    return std::span(self.outcome.scores).first(self.environment.scores().size());
  });
}

void bind_environments(nb::module_& m) {
  nb::class_<EnvironmentBatch> type(m, "EnvironmentBatch",
                                    also(docs::EnvironmentBatch::EnvironmentBatch,
                                         R"(`trifinger.environments.VectorEnvironment` uses it.)"));
  type.def(
          "__init__",
          [](EnvironmentBatch* self, const nb::object& named, const std::string& options, int size,
             int num_threads, double physics_step, const std::string& config,
             const Overrides& overrides) {
            RobotConfig robot = load_config(config, overrides);
            robot.simulation.physics_step = Nanoseconds(std::llround(physics_step * 1e9));
            const EnvironmentOptions wanted = read_options(options);
            const TaskDescription task = describe_task(named);
            new (self) EnvironmentBatch(task, wanted, robot.simulation, size, num_threads,
                                        wanted.needs_cameras() || robot.tracks_objects
                                            ? rendering::vision_options(robot, robot.name)
                                            : std::nullopt);
          },
          "task"_a, "options"_a, "size"_a, "num_threads"_a, "physics_step"_a, "config"_a,
          "overrides"_a)
      .def("__len__", &EnvironmentBatch::size)
      .def_prop_ro("num_threads", &EnvironmentBatch::num_threads)
      .def_prop_ro("oldest_sure_age", &EnvironmentBatch::oldest_sure_age,
                   docs::EnvironmentBatch::oldest_sure_age)
      .def("first_finger", &EnvironmentBatch::first_finger, "index"_a,
           docs::EnvironmentBatch::first_finger)
      .def("configuration", &EnvironmentBatch::configuration, "index"_a,
           docs::EnvironmentBatch::configuration)
      .def("seed", &EnvironmentBatch::seed, "index"_a, "seed"_a, "episode"_a = 0,
           docs::EnvironmentBatch::seed)
      .def(
          "reset",
          [](EnvironmentBatch& self, std::optional<Marks> which) {
            std::vector<std::uint8_t> marks;
            if (which) marks.assign(which->data(), which->data() + which->size());
            const GilRelease release;
            self.reset(marks);
          },
          "which"_a.none() = nb::none(),
          nb::sig("def reset(self, which: numpy.typing.NDArray[numpy.bool_] | None = None) -> "
                  "None"),
          docs::EnvironmentBatch::reset)
      .def(
          "step",
          [](EnvironmentBatch& self, const Actions& actions, const std::string& autoreset) {
            const auto mode = choice<Autoreset>("autoreset", kAutoresets, autoreset);
            const std::span numbers(actions.data(), actions.size());
            const GilRelease release;
            self.step(numbers, mode);
          },
          "actions"_a, "autoreset"_a,
          nb::sig("def step(self, actions: numpy.typing.NDArray[numpy.float32], autoreset: str) "
                  "-> None"),
          also(docs::EnvironmentBatch::step, R"(The arrays below change.)"));
  type.def(
      "set_reset_states",
      [](EnvironmentBatch& self, const Rows& position, const Rows& torque, const Rows& object,
         double share) { self.set_reset_states(resets_of(position, torque, object, share)); },
      "position"_a, "torque"_a, "object"_a, "share"_a,
      also(docs::EnvironmentBatch::set_reset_states,
           R"(Each array has a row for each state: joint positions, torques, and position [m] and
quaternion (w, x, y, z) of the object, or no numbers where the task has none.)"));
  type.def(
          "set_physics",
          [](EnvironmentBatch& self, const nb::callable& physics) {
            self.set_physics(physics_of(physics));
          },
          "physics"_a,
          nb::sig("def set_physics(self, physics: Callable[[numpy.typing.NDArray[numpy.bool_], "
                  "bool], None]) -> None"),
          also(
              docs::EnvironmentBatch::set_physics,
              R"(`physics` gets marks of the simulations that it must move, and whether models have changed.
The caller keeps it alive.)"))
      .def_prop_ro(
          "memory",
          [](nb::handle self) {
            auto& batch = nb::cast<EnvironmentBatch&>(self);
            const BatchMemory memory = batch.memory();
            nb::typed<nb::dict, nb::str, nb::ndarray<nb::numpy, double>> all;
            all["qpos"] = view(self, memory.qpos, batch.size());
            all["qvel"] = view(self, memory.qvel, batch.size());
            all["qacc_warmstart"] = view(self, memory.qacc_warmstart, batch.size());
            all["ctrl"] = view(self, memory.ctrl, batch.size());
            return all;
          },
          "What other physics read and write: a row for each simulation. They do not write `ctrl`.")
      .def_prop_ro(
          "substeps", [](EnvironmentBatch& self) { return self.memory().substeps; },
          "Steps of the model in each call of other physics.")
      .def_prop_ro(
          "model_file",
          [](const EnvironmentBatch& self) {
            const std::vector<std::byte> file = self.model_file();
            return nb::bytes(file.data(), file.size());
          },
          docs::EnvironmentBatch::model_file)
      .def_prop_ro(
          "varied_fields",
          [](const EnvironmentBatch& self) {
            const auto names = self.varied_fields();
            return std::vector<std::string>(names.begin(), names.end());
          },
          docs::EnvironmentBatch::varied_fields)
      .def(
          "varied_field",
          [](nb::handle self, std::string_view name) {
            const auto& batch = nb::cast<const EnvironmentBatch&>(self);
            const std::vector<double> values = batch.varied_field(name);
            const auto rows = static_cast<Eigen::Index>(batch.size());
            return RowMajor(Eigen::Map<const RowMajor>(
                values.data(), rows, static_cast<Eigen::Index>(values.size()) / rows));
          },
          "name"_a, docs::EnvironmentBatch::varied_field);
  bind_description<EnvironmentBatch>(
      type, [](const EnvironmentBatch& self) -> const Environment& { return self.environment(); });
  const auto array = [&type](const char* name, const char* number, auto get, bool has_rows) {
    const std::string signature =
        "def " + std::string(name) + "(self) -> numpy.typing.NDArray[numpy." + number + "]";
    type.def_prop_ro(
        name,
        [get, has_rows](nb::handle self) {
          auto& batch = nb::cast<EnvironmentBatch&>(self);
          return view(self, get(batch.results()), has_rows ? batch.size() : 0);
        },
        nb::sig(signature.c_str()));
  };
  constexpr bool kRows = true;
  array("observation", "float32", [](Results& r) -> auto& { return r.seen.observation; }, kRows);
  array("achieved", "float64", [](Results& r) -> auto& { return r.seen.achieved; }, kRows);
  array("desired", "float64", [](Results& r) -> auto& { return r.seen.desired; }, kRows);
  array(
      "final_observation", "float32", [](Results& r) -> auto& { return r.final.observation; },
      kRows);
  array("final_achieved", "float64", [](Results& r) -> auto& { return r.final.achieved; }, kRows);
  array("final_desired", "float64", [](Results& r) -> auto& { return r.final.desired; }, kRows);
  array("distance", "float64", [](Results& r) -> auto& { return r.seen.distance; }, kRows);
  array(
      "finger_rewards", "float64", [](Results& r) -> auto& { return r.seen.finger_rewards; },
      kRows);
  array("scores", "float64", [](Results& r) -> auto& { return r.seen.scores; }, kRows);
  array("final_scores", "float64", [](Results& r) -> auto& { return r.final.scores; }, kRows);
  array("final_distance", "float64", [](Results& r) -> auto& { return r.final.distance; }, kRows);
  array(
      "final_finger_rewards", "float64", [](Results& r) -> auto& { return r.final.finger_rewards; },
      kRows);
  array("reward", "float64", [](Results& r) -> auto& { return r.reward; }, !kRows);
  array("terminated", "uint8", [](Results& r) -> auto& { return r.terminated; }, !kRows);
  array("truncated", "uint8", [](Results& r) -> auto& { return r.truncated; }, !kRows);
  array("success", "uint8", [](Results& r) -> auto& { return r.seen.success; }, !kRows);
  array("final_success", "uint8", [](Results& r) -> auto& { return r.final.success; }, !kRows);
  array("fault", "int32", [](Results& r) -> auto& { return r.fault; }, !kRows);
  array("object_age", "int64", [](Results& r) -> auto& { return r.seen.object_age; }, !kRows);
  array(
      "final_object_age", "int64", [](Results& r) -> auto& { return r.final.object_age; }, !kRows);
  array("hidden", "float32", [](Results& r) -> auto& { return r.seen.hidden; }, kRows);
  array("final_hidden", "float32", [](Results& r) -> auto& { return r.final.hidden; }, kRows);
  array("image_age", "float32", [](Results& r) -> auto& { return r.seen.image_age; }, kRows);
  array("final_image_age", "float32", [](Results& r) -> auto& { return r.final.image_age; }, kRows);
  type.def_prop_ro(
      "cameras", [](const EnvironmentBatch& self) { return describe_cameras(self.cameras()); },
      docs::EnvironmentBatch::cameras);
  const auto images = [&type](const char* name, auto get) {
    const std::string signature =
        "def " + std::string(name) + "(self) -> list[numpy.typing.NDArray[numpy.uint8]]";
    type.def_prop_ro(
        name,
        [get](nb::handle self) {
          auto& batch = nb::cast<EnvironmentBatch&>(self);
          nb::list all;
          for (std::size_t k = 0; k < batch.cameras().size(); ++k) {
            const camera::ImageFormat& format = batch.cameras()[k].format;
            const std::array<std::size_t, 4> shape{batch.size(),
                                                   static_cast<std::size_t>(format.height),
                                                   static_cast<std::size_t>(format.width), 3};
            std::uint8_t* const pixels = get(batch.results())[k].data();
            all.append(nb::ndarray<nb::numpy, std::uint8_t>(pixels, 4, shape.data(), self));
          }
          return all;
        },
        nb::sig(signature.c_str()));
  };
  images("images", [](Results& r) -> auto& { return r.seen.images; });
  images("final_images", [](Results& r) -> auto& { return r.final.images; });
}

}  // namespace

void bind_environment(nb::module_& m) {
  bind_random(m);
  bind_episodes(m);
  bind_environments(m);
  m.def("task_names", [] { return task_names(); }, docs::task_names);
  m.def("num_processors", &num_processors, docs::num_processors);
  m.def(
      "default_environment_options",
      [](const std::string& task) { return write_options(default_options(task)); }, "task"_a,
      "Default options of a task, as JSON.");
  m.def(
      "environment_overrides",
      [](const std::variant<std::string, Overrides>& task, const std::string& options,
         const std::string& config, const Overrides& own) {
        const nb::object loads = nb::module_::import_("json").attr("loads");
        const bool is_from_file = is_robot_from_file(config, own);
        const auto* const name = std::get_if<std::string>(&task);
        const TaskDescription described =
            name != nullptr ? find_task(*name) : TaskDescription{.config_overrides = {}};
        Overrides overrides;
        for (const std::string& text :
             config_overrides(described, read_options(options), is_from_file)) {
          const std::size_t end = text.find('=');
          overrides[text.substr(0, end).c_str()] = loads(text.substr(end + 1));
        }
        if (name == nullptr && !is_from_file) overrides.update(std::get<Overrides>(task));
        overrides.update(own);
        return overrides;
      },
      "task"_a, "options"_a, "config"_a = "trifinger_edu", "config_overrides"_a = nb::dict(),
      "The overrides with which a robot's configuration is that of an environment: those that its\n"
      "options (JSON) need, those of a task, and the user's own, which win. `task` is the name of "
      "a\n"
      "task in C++, or what one in Python needs of a TriFinger.");
  m.def(
      "robot_of_task", [](const std::string& task) { return find_task(task).robot; }, "task"_a,
      "Name of the configuration of the robot that a task is usually for.");
  m.def(
      "describe_environment_options",
      [] {
        std::vector<std::tuple<std::string, std::string, std::string, std::string>> all;
        for (OptionDescription& option : describe_options()) {
          all.emplace_back(std::move(option.name), std::move(option.type), std::move(option.value),
                           std::move(option.meaning));
        }
        return all;
      },
      "Name, type, default (JSON) and meaning of each option.");
  m.def(
      "limits_of_file_robot",
      [](const std::string& config, const Overrides& overrides) {
        nb::typed<nb::dict, nb::str, nb::typed<nb::dict, nb::str, double>> limits;
        const SimulationOptions robot = load_config(config, overrides).simulation;
        if (robot.file == nullptr) return limits;
        for (std::size_t i = 0; i < robot.limits->size(); ++i) {
          nb::dict values;
          for (const JointLimitField& field : JointLimit::fields()) {
            const double value = (*robot.limits)[i].*field.value;
            if (!std::isnan(value)) values[to_str(field.name)] = value;
          }
          limits[to_str(robot.file->joints()[i].name)] = std::move(values);
        }
        return limits;
      },
      "config"_a, "config_overrides"_a = nb::dict(),
      "What each joint of a robot from a file may do, whether its configuration or its file says "
      "it:\nkeys and values of its section in `safety`. Empty for other robots.");
  m.def(
      "robot_configuration",
      [](const std::string& config, const Overrides& overrides) {
        return load_config(config, overrides).session.documents.front().text;
      },
      "config"_a, "config_overrides"_a = nb::dict(),
      "The whole text of a configuration, with what it extends and its overrides, as sessions have "
      "it.");
}

}  // namespace trifinger::bindings
