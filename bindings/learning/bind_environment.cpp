// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/choice.hpp"
#include "conversion/garbage.hpp"
#include "conversion/gil.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "docstrings.hpp"
#include "simulation/simulation.hpp"
#include "task.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/learning/environment_batch.hpp"
#include "trifinger/realtime/processors.hpp"
#include "trifinger/rendering/simulation_that_sees.hpp"
#include "trifinger/sim/any_robot_config.hpp"
#include "trifinger/sim/robot_cameras.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace learning;

using Actions = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Goals = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Marks = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// In the order of the enumeration.
constexpr std::array<std::string_view, 3> kAutoresets{"NextStep", "SameStep", "Disabled"};

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

Nanoseconds period_of(const RobotConfig& config) {
  return std::visit([](const auto& options) { return options.period; }, config.simulation);
}

Nanoseconds period_of(const AnyRobotConfig& config) {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return file->robot.model->period();
  }
  return period_of(std::get<RobotConfig>(config));
}

Environment make_environment(const TaskDescription& task, const EnvironmentOptions& options,
                             const AnyRobotConfig& config) {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return {task, options, file->robot};
  }
  const auto& robot = std::get<RobotConfig>(config);
  return {task, options, description_of(robot), period_of(robot)};
}

// Age of the newest pose just before the next one arrives; `is_elsewhere`: of a robot in another
// process, whose poses may be a little late [steps].
TimeIndex oldest_sure_age_of(const AnyRobotConfig& config, bool is_elsewhere) {
  if (const auto* const file = std::get_if<FileRobotConfig>(&config)) {
    return (is_elsewhere ? 2 : 1) * file->robot.object_period - 1;
  }
  const auto& robot = std::get<RobotConfig>(config);
  return is_elsewhere ? rendering::oldest_sure_age_elsewhere(robot)
                      : rendering::oldest_sure_age(robot);
}

// What a configuration names as the files of its robot, none of which is opened.
std::vector<std::string> files_of(const config::File& file) {
  std::vector<std::string> files;
  if (!is_from_file(file)) return files;
  const config::Node robot = file.root().section("robot");
  for (const char* key : {"mjcf", "urdf", "mesh_folder"}) {
    const auto node = robot.find(key);
    files.push_back(node ? node->as<std::string>() : "");
  }
  return files;
}

// Reads the configuration of a robot that anybody may have started: only files that `expected`
// names too are opened.
AnyRobotConfig read_foreign_config(const std::string& text, const AnyRobotConfig& expected) {
  const auto file = config::File::parse(text, "configuration.yml");
  const auto& session = std::visit(
      [](const auto& robot) -> const SessionOptions& { return robot.session; }, expected);
  const auto own = config::File::parse(session.documents.at(0).text, "configuration.yml");
  const std::vector<std::string> files = files_of(file);
  if (!files.empty() && files != files_of(own)) {
    throw InvalidArgument("the robot is a '" + file.root().required<std::string>("name") +
                          "' made of " + files[0] + files[1] +
                          ", which is not the file that `config` names");
  }
  return read_any_robot_config(file);
}

// Throws InvalidArgument if `actual` is another robot than `expected`.
void check_same_robot(const AnyRobotConfig& actual, const AnyRobotConfig& expected) {
  const auto is_same = [&] {
    if (actual.index() != expected.index()) return false;
    if (const auto* const file = std::get_if<FileRobotConfig>(&actual)) {
      const auto names_of = [](const FileRobotConfig& config) {
        std::vector<std::string> names;
        for (const FileJoint& joint : config.robot.model->joints()) names.push_back(joint.name);
        return names;
      };
      return names_of(*file) == names_of(std::get<FileRobotConfig>(expected));
    }
    const RobotDescription description = description_of(std::get<RobotConfig>(actual));
    const RobotDescription wanted = description_of(std::get<RobotConfig>(expected));
    return description.variant == wanted.variant && description.arrangement == wanted.arrangement;
  };
  if (!is_same()) {
    throw InvalidArgument("the robot is a '" +
                          std::visit([](const auto& robot) { return robot.name; }, actual) +
                          "', which is not what `config` says");
  }
  if (period_of(actual) != period_of(expected)) {
    throw InvalidArgument("the robot's period is " + std::to_string(to_seconds(period_of(actual))) +
                          " s, `config` says " + std::to_string(to_seconds(period_of(expected))) +
                          " s");
  }
}

// `Environment`, one episode of it, and what was seen last.
struct Episodes {
  Episodes(nb::object its_task, const EnvironmentOptions& options, AnyRobotConfig its_config,
           std::vector<camera::Camera> its_cameras)
      : task(std::move(its_task)),
        environment(make_environment(nb::isinstance<nb::str>(task)
                                         ? find_task(nb::cast<std::string>(task))
                                         : describe_task(task, failure),
                                     options, its_config)),
        config(std::move(its_config)),
        oldest_sure_age(oldest_sure_age_of(config, /*is_elsewhere=*/false)),
        cameras(std::move(its_cameras)),
        observation(environment.observation_size()),
        achieved(environment.goal_size()),
        desired(environment.goal_size()) {}

  // A task may refer to its environment.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(task.ptr());
    return 0;
  }
  void clear() noexcept { task.reset(); }

  nb::object task;  // a name, or an object of Python's class
  std::shared_ptr<TaskFailure> failure = std::make_shared<TaskFailure>();
  Environment environment;
  AnyRobotConfig config;
  TimeIndex oldest_sure_age;            // of a pose [steps]
  std::vector<camera::Camera> cameras;  // that are observed
  Start start;
  Episode episode;
  Outcome outcome;
  std::vector<float> observation;
  std::vector<double> achieved;
  std::vector<double> desired;
};

// Where the hinges and slides of a robot from a file begin.
std::vector<double> model_positions(const Episodes& episodes, const Start& start) {
  const auto* const file = std::get_if<FileRobotConfig>(&episodes.config);
  if (file == nullptr) return {};
  const std::size_t joints =
      std::min(file->robot.model->model_joints().size(), start.model_position.size());
  return {start.model_position.begin(),
          start.model_position.begin() + static_cast<std::ptrdiff_t>(joints)};
}

// A pose from position and quaternion, if there is one.
std::optional<ObjectPose> to_pose(nb::handle given) {
  if (given.is_none()) return std::nullopt;
  const auto [at, turned] =
      nb::cast<std::tuple<Array<Eigen::Vector3d>, Array<Eigen::Vector4d>>>(given);
  ObjectPose pose;
  std::copy_n(at.value.data(), 3, pose.position.begin());
  std::copy_n(turned.value.data(), 4, pose.orientation.begin());
  return pose;
}

// Torques, positions and velocities of the model, and poses of free bodies.
using More = std::tuple<Array<Eigen::VectorXd>, Array<Eigen::VectorXd>, Array<Eigen::VectorXd>,
                        std::vector<nb::object>>;

void add_measurement_of_file(const Episodes& episodes, const More& more,
                             std::vector<ObjectPose>& bodies, Measurement& measurement) {
  const auto* const file = std::get_if<FileRobotConfig>(&episodes.config);
  if (file == nullptr) throw InvalidArgument("more is for robots from files");
  const auto& [torque, position, velocity, poses] = more;
  const ModelFile& model = *file->robot.model;
  const auto span_of = [](const auto& array, std::size_t size, const char* name) {
    const auto given = static_cast<std::size_t>(array.value.size());
    if (given == size) return std::span(array.value.data(), size);
    throw InvalidArgument(std::string(name) + " has " + std::to_string(given) +
                          " numbers, must have " + std::to_string(size));
  };
  const std::size_t joints = model.drives_all() ? 0 : model.model_joints().size();
  measurement.torque = span_of(torque, model.joints().size(), "torque");
  measurement.model_position = span_of(position, joints, "joint_position");
  measurement.model_velocity = span_of(velocity, joints, "joint_velocity");
  if (poses.size() != model.free_bodies().size()) {
    throw InvalidArgument("there are " + std::to_string(poses.size()) + " poses for " +
                          std::to_string(model.free_bodies().size()) + " free bodies");
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::optional<ObjectPose> pose = to_pose(poses[i]);
    if (!pose) {
      throw InvalidArgument("the pose of '" + model.free_bodies()[i].name + "' is missing");
    }
    bodies.push_back(*pose);
  }
  measurement.bodies = bodies;
}

// The cameras that an environment with these options observes.
std::vector<camera::Camera> observed_cameras(const EnvironmentOptions& options,
                                             const AnyRobotConfig& config) {
  if (options.layout != Layout::kImages) return {};
  const auto* const robot = std::get_if<RobotConfig>(&config);
  if (robot == nullptr) return {};  // The environment refuses the layout.
  return camera_calibration(*robot, robot->name).cameras;
}

nb::list describe_cameras(const std::vector<camera::Camera>& cameras) {
  nb::list all;
  for (const camera::Camera& camera : cameras) {
    all.append(nb::make_tuple(camera.name, camera.format.height, camera.format.width));
  }
  return all;
}

// What both classes tell of their task.
template <class T>
void bind_description(nb::class_<T>& type, const Environment& (*environment_of)(const T&)) {
  type.def_prop_ro(
          "entries",
          [environment_of](const T& self) {
            nb::list entries;
            for (const Entry& entry : environment_of(self).entries()) {
              entries.append(nb::make_tuple(entry.name, entry.unit, entry.low, entry.high));
            }
            return entries;
          },
          nb::sig("def entries(self) -> list[tuple[str, str, list[float], list[float]]]"),
          also(docs::Environment::entries, R"(Each is name, unit, low and high.)").c_str())
      .def_prop_ro(
          "goal",
          [environment_of](const T& self) {
            const Entry& goal = environment_of(self).goal();
            return nb::make_tuple(goal.name, goal.unit, goal.low, goal.high);
          },
          nb::sig("def goal(self) -> tuple[str, str, list[float], list[float]]"))
      .def_prop_ro("flat_names",
                   [environment_of](const T& self) { return environment_of(self).flat_names(); })
      .def_prop_ro(
          "episode_actions",
          [environment_of](const T& self) { return environment_of(self).episode_actions(); })
      .def_prop_ro(
          "oldest_image_age", [](const T&) { return kOldestImage; },
          "Images that are older count as this old [steps].")
      .def_prop_ro(
          "judges_by_truth",
          [environment_of](const T& self) { return environment_of(self).judges_by_truth(); },
          docs::Environment::judges_by_truth)
      .def_prop_ro(
          "num_parts", [environment_of](const T& self) { return environment_of(self).num_parts(); },
          docs::Environment::num_parts)
      .def_prop_ro(
          "has_goals_of_fingers",
          [environment_of](const T& self) { return environment_of(self).has_goals_of_fingers(); },
          docs::Environment::has_goals_of_fingers)
      .def_prop_ro(
          "score_names", [environment_of](const T& self) { return environment_of(self).scores(); },
          docs::Environment::scores)
      .def_prop_ro("num_joints",
                   [environment_of](const T& self) { return environment_of(self).num_joints(); })
      .def_prop_ro("object_name",
                   [environment_of](const T& self) {
                     const std::string_view name = environment_of(self).object_name();
                     return std::string(name);
                   })
      .def(
          "compute_reward",
          [environment_of](const T& self, const Goals& achieved, const Goals& desired) {
            const Environment& environment = environment_of(self);
            const std::size_t size = environment.goal_size();
            if (achieved.shape(1) != size || desired.shape(1) != size ||
                achieved.shape(0) != desired.shape(0)) {
              throw InvalidArgument("goals must have " + std::to_string(size) +
                                    " numbers each, as many of them achieved as desired");
            }
            Eigen::VectorXd rewards(static_cast<Eigen::Index>(achieved.shape(0)));
            for (std::size_t i = 0; i < achieved.shape(0); ++i) {
              rewards[static_cast<Eigen::Index>(i)] = environment.reward(
                  {achieved.data() + i * size, size}, {desired.data() + i * size, size});
            }
            if constexpr (std::is_same_v<T, Episodes>) self.failure->rethrow();
            return rewards;
          },
          "achieved"_a, "desired"_a, "One reward for each row.");
}

void bind_episodes(nb::module_& m) {
  nb::class_<Episodes> type(
      m, "Episodes", nb::type_slots(garbage_collected<Episodes>()),
      also(docs::Environment::Environment, R"(`trifinger.environments` uses it.)").c_str());
  type.def(
          "__init__",
          [](Episodes* self, const nb::object& task, const std::string& options,
             const std::string& config, const nb::dict& overrides) {
            AnyRobotConfig robot = load_any_config(config, overrides);
            const EnvironmentOptions wanted = read_options(options);
            std::vector<camera::Camera> cameras = observed_cameras(wanted, robot);
            new (self) Episodes(task, wanted, std::move(robot), std::move(cameras));
          },
          "task"_a, "options"_a, "config"_a, "overrides"_a,
          nb::sig("def __init__(self, task: object, options: str, config: str, "
                  "overrides: dict[str, object]) -> None"))
      .def(
          "begin",
          [](Episodes& self, std::uint64_t seed, std::uint64_t number) {
            self.start = self.environment.begin(seed, number, self.episode);
            self.failure->rethrow();
            const Start& start = self.start;
            const auto list = [](const auto& numbers, std::size_t count) {
              return std::vector<double>(numbers.begin(), numbers.begin() + count);
            };
            return nb::make_tuple(list(start.position, self.environment.num_joints()),
                                  list(start.object.position, 3), list(start.object.orientation, 4),
                                  list(start.object_velocity.linear, 3), start.variation,
                                  start.random.episode, model_positions(self, start));
          },
          "seed"_a, "number"_a,
          nb::sig("def begin(self, seed: int, number: int) -> tuple[list[float], list[float], "
                  "list[float], list[float], Variation, int, list[float]]"),
          also(
              docs::Environment::begin,
              R"(Returns the joints [rad], the object's position [m], quaternion and velocity [m/s], the variation,
the series of random numbers, and positions of the first hinges and slides of a robot from a file; NaN: as always.)")
              .c_str())
      .def(
          "check_robot",
          [](Episodes& self, const std::optional<std::string>& configuration) {
            const AnyRobotConfig actual =
                configuration ? read_foreign_config(*configuration, self.config) : self.config;
            check_same_robot(actual, self.config);
            self.oldest_sure_age = oldest_sure_age_of(actual, /*is_elsewhere=*/true);
          },
          "configuration"_a.none(),
          "Refuses another robot than that of `config`, by its configuration if that is known, and "
          "takes\n"
          "the age of its poses from there.")
      .def_prop_ro(
          "oldest_sure_age", [](const Episodes& self) { return self.oldest_sure_age; },
          "Age of a pose up to which it is sure; of a connected robot once it was checked [steps].")
      .def(
          "way",
          [](const Episodes& self, const Array<Eigen::VectorXd>& from) {
            const auto joints = static_cast<Eigen::Index>(self.environment.num_joints());
            if (from.value.size() != joints) {
              throw InvalidArgument("from_position must have " + std::to_string(joints) +
                                    " numbers");
            }
            RowMajor way(self.environment.way_actions(), joints);
            const auto size = static_cast<std::size_t>(joints);
            for (Eigen::Index i = 0; i < way.rows(); ++i) {
              self.environment.way_point({from.value.data(), size}, self.start, i,
                                         {way.row(i).data(), size});
            }
            return way;
          },
          "from_position"_a,
          nb::sig("def way(self, from_position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Joint positions that bring a robot to where the episode begins: a row for each action "
          "[rad].")
      .def(
          "take_action",
          [](Episodes& self, const Actions& numbers) {
            const std::size_t joints = self.environment.num_joints();
            if (numbers.ndim() != 1 || numbers.size() != joints) {
              throw InvalidArgument("an action must be an array of " + std::to_string(joints) +
                                    " numbers");
            }
            Eigen::VectorXd torque(static_cast<Eigen::Index>(joints));
            Eigen::VectorXd position(static_cast<Eigen::Index>(joints));
            if (!self.environment.take_action({numbers.data(), joints}, self.episode,
                                              {torque.data(), joints}, {position.data(), joints})) {
              throw InvalidArgument("an action must be finite");
            }
            return std::pair(torque, position);
          },
          "numbers"_a,
          nb::sig(
              "def take_action(self, numbers: numpy.typing.NDArray[numpy.float32]) -> "
              "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]"),
          "Torques [Nm] and positions [rad] of the joints for one action.")
      .def(
          "observe",
          [](Episodes& self, const Array<Eigen::VectorXd>& position,
             const Array<Eigen::VectorXd>& velocity, nb::handle object, nb::handle true_object,
             const std::optional<More>& more) {
            const auto joints = static_cast<Eigen::Index>(self.environment.num_joints());
            if (position.value.size() != joints || velocity.value.size() != joints) {
              throw InvalidArgument("a measurement must have " + std::to_string(joints) +
                                    " positions and velocities");
            }
            if (object.is_none() != self.environment.object_name().empty()) {
              throw InvalidArgument("the pose of an object is for tasks that have one");
            }
            if (!more && std::holds_alternative<FileRobotConfig>(self.config)) {
              throw InvalidArgument(
                  "a measurement of a robot from a file needs `more`: torques, positions and "
                  "velocities of its joints, poses of its bodies");
            }
            const std::optional<ObjectPose> pose = to_pose(object);
            const std::optional<ObjectPose> truth = to_pose(true_object);
            const auto size = static_cast<std::size_t>(joints);
            Measurement measurement{.position = {position.value.data(), size},
                                    .velocity = {velocity.value.data(), size},
                                    .object = pose ? &*pose : nullptr,
                                    .true_object = truth ? &*truth : nullptr};
            std::vector<ObjectPose> bodies;
            if (more) add_measurement_of_file(self, *more, bodies, measurement);
            self.outcome = self.environment.observe(measurement, self.episode, self.observation,
                                                    self.achieved, self.desired);
            self.failure->rethrow();
            const Outcome& outcome = self.outcome;
            return nb::make_tuple(outcome.reward, outcome.terminated, outcome.truncated,
                                  outcome.success);
          },
          "position"_a, "velocity"_a, "object"_a = nb::none(), "true_object"_a = nb::none(),
          "more"_a.none() = nb::none(),
          nb::sig("def observe(self, position: numpy.typing.ArrayLike, velocity: "
                  "numpy.typing.ArrayLike, object: tuple[numpy.typing.ArrayLike, "
                  "numpy.typing.ArrayLike] | None = None, true_object: "
                  "tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | None = None, more: "
                  "tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike, numpy.typing.ArrayLike, "
                  "list[tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike]]] | None = None) -> "
                  "tuple[float, bool, bool, bool]"),
          also(
              docs::Environment::observe,
              R"(`more` is for robots from files: torques, positions and velocities of all hinges and slides (empty if
each has a motor), and poses of the free bodies. Returns reward, terminated, truncated, success; the arrays below
change.)")
              .c_str());
  type.def_prop_ro("is_from_file", [](const Episodes& self) {
    return std::holds_alternative<FileRobotConfig>(self.config);
  });
  type.def_prop_ro(
      "bodies",
      [](const Episodes& self) {
        std::vector<std::string> names;
        if (const auto* const file = std::get_if<FileRobotConfig>(&self.config)) {
          for (const ObjectAddress& body : file->robot.model->free_bodies()) {
            names.push_back(body.name);
          }
        }
        return names;
      },
      "Names of the free bodies of a robot from a file.");
  type.def_prop_ro(
      "cameras", [](const Episodes& self) { return describe_cameras(self.cameras); },
      nb::sig("def cameras(self) -> list[tuple[str, int, int]]"),
      "Name, height and width of each camera that is observed.");
  bind_description<Episodes>(
      type, [](const Episodes& self) -> const Environment& { return self.environment; });
  const auto array = [&type](const char* name, const char* signature, auto get) {
    type.def_prop_ro(
        name, [get](nb::handle self) { return get(self, nb::cast<Episodes&>(self)); },
        nb::sig(signature));
  };
  array("observation", "def observation(self) -> numpy.typing.NDArray[numpy.float32]",
        [](nb::handle owner, Episodes& self) { return view(owner, self.observation); });
  array("achieved", "def achieved(self) -> numpy.typing.NDArray[numpy.float64]",
        [](nb::handle owner, Episodes& self) { return view(owner, self.achieved); });
  array("desired", "def desired(self) -> numpy.typing.NDArray[numpy.float64]",
        [](nb::handle owner, Episodes& self) { return view(owner, self.desired); });
  array("distance", "def distance(self) -> numpy.typing.NDArray[numpy.float64]",
        [](nb::handle owner, Episodes& self) {
          return view(owner, self.outcome.distance.data(), self.environment.num_parts());
        });
  array("finger_rewards", "def finger_rewards(self) -> numpy.typing.NDArray[numpy.float64]",
        [](nb::handle owner, Episodes& self) {
          return view(owner, self.outcome.finger_rewards.data(), self.environment.num_parts());
        });
  array("scores", "def scores(self) -> numpy.typing.NDArray[numpy.float64]",
        [](nb::handle owner, Episodes& self) {
          return view(owner, self.outcome.scores.data(), self.environment.scores().size());
        });
}

void bind_batch(nb::module_& m) {
  nb::class_<EnvironmentBatch> type(m, "EnvironmentBatch",
                                    also(docs::EnvironmentBatch::EnvironmentBatch,
                                         R"(`trifinger.environments.VectorEnvironment` uses it.)")
                                        .c_str());
  type.def(
          "__init__",
          [](EnvironmentBatch* self, const std::string& task, const std::string& options, int size,
             int num_threads, const std::string& config, const nb::dict& overrides) {
            const AnyRobotConfig any = load_any_config(config, overrides);
            const EnvironmentOptions wanted = read_options(options);
            if (const auto* const file = std::get_if<FileRobotConfig>(&any)) {
              new (self) EnvironmentBatch(task, wanted, file->robot, size, num_threads);
              return;
            }
            const auto& robot = std::get<RobotConfig>(any);
            std::visit(
                [&](const auto& simulation) {
                  new (self) EnvironmentBatch(task, wanted, simulation, size, num_threads,
                                              wanted.needs_cameras() || robot.tracks_objects
                                                  ? rendering::sight_options(robot, robot.name)
                                                  : std::nullopt);
                },
                robot.simulation);
          },
          "task"_a, "options"_a, "size"_a, "num_threads"_a, "config"_a, "overrides"_a,
          nb::sig("def __init__(self, task: str, options: str, size: int, "
                  "num_threads: int, config: str, overrides: dict[str, object]) -> None"))
      .def("__len__", &EnvironmentBatch::size)
      .def_prop_ro("num_threads", &EnvironmentBatch::num_threads)
      .def_prop_ro("oldest_sure_age", &EnvironmentBatch::oldest_sure_age,
                   docs::EnvironmentBatch::oldest_sure_age)
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
          also(docs::EnvironmentBatch::step, R"(The arrays below change.)").c_str());
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
  array("image_age", "float32", [](Results& r) -> auto& { return r.seen.image_age; }, kRows);
  array("final_image_age", "float32", [](Results& r) -> auto& { return r.final.image_age; }, kRows);
  type.def_prop_ro(
      "cameras", [](const EnvironmentBatch& self) { return describe_cameras(self.cameras()); },
      nb::sig("def cameras(self) -> list[tuple[str, int, int]]"), docs::EnvironmentBatch::cameras);
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
  nb::class_<Random>(m, "Random", docs::Random::Random)
      .def("uniform", &Random::uniform, "low"_a, "high"_a, docs::Random::uniform)
      .def("normal", &Random::normal, docs::Random::normal)
      .def("integer", &Random::integer, "low"_a, "high"_a, docs::Random::integer);
  bind_episodes(m);
  bind_batch(m);
  m.def("task_names", [] { return task_names(); }, docs::task_names);
  m.def("num_processors", &num_processors, docs::num_processors);
  m.def(
      "default_environment_options",
      [](const std::string& task) { return write_options(default_options(task)); }, "task"_a,
      "Default options of a task, as JSON.");
  m.def(
      "environment_overrides",
      [](const std::optional<std::string>& task, const std::string& options, bool is_from_file) {
        const nb::object loads = nb::module_::import_("json").attr("loads");
        nb::dict overrides;
        const TaskDescription described =
            task ? find_task(*task) : TaskDescription{.config_overrides = {}};
        for (const std::string& text :
             config_overrides(described, read_options(options), is_from_file)) {
          const std::size_t end = text.find('=');
          overrides[text.substr(0, end).c_str()] = loads(text.substr(end + 1));
        }
        return overrides;
      },
      "task"_a, "options"_a, "is_from_file"_a = false,
      nb::sig("def environment_overrides(task: str | None, options: str, is_from_file: bool = "
              "False) -> dict[str, object]"),
      "The overrides that a robot's configuration needs for options (JSON), and for a task.");
  m.def(
      "robot_of_task", [](const std::string& task) { return find_task(task).robot; }, "task"_a,
      "Name of the configuration of the robot that a task is usually for.");
  m.def(
      "is_from_file",
      [](const std::string& config, const nb::dict& overrides) {
        return is_robot_from_file(config, overrides);
      },
      "config"_a, "overrides"_a = nb::dict(),
      nb::sig("def is_from_file(config: str, overrides: dict[str, object] = {}) -> bool"),
      "Whether the robot of a configuration is from a file.");
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
      [](const std::string& config, const nb::dict& overrides) {
        nb::dict limits;
        const AnyRobotConfig any = load_any_config(config, overrides);
        const auto* const file = std::get_if<FileRobotConfig>(&any);
        if (file == nullptr) return limits;
        const FileRobotOptions& robot = file->robot;
        for (std::size_t i = 0; i < robot.limits.size(); ++i) {
          nb::dict values;
          for (const JointLimitField& field : JointLimit::fields()) {
            const double value = robot.limits[i].*field.value;
            if (!std::isnan(value)) values[to_str(field.name)] = value;
          }
          limits[to_str(robot.model->joints()[i].name)] = std::move(values);
        }
        return limits;
      },
      "config"_a, "config_overrides"_a = nb::dict(),
      nb::sig("def limits_of_file_robot(config: str, config_overrides: dict[str, object] = {}) -> "
              "dict[str, dict[str, float]]"),
      "What each joint of a robot from a file may do, whether its configuration or its file says "
      "it:\nkeys and values of its section in `safety`. Empty for other robots.");
  m.def(
      "robot_configuration",
      [](const std::string& config, const nb::dict& overrides) {
        return std::visit([](const auto& robot) { return robot.session.documents.front().text; },
                          load_any_config(config, overrides));
      },
      "config"_a, "config_overrides"_a = nb::dict(),
      nb::sig("def robot_configuration(config: str, config_overrides: dict[str, object] = {}) -> "
              "str"),
      "The whole text of a configuration, with what it extends and its overrides, as sessions have "
      "it.");
}

}  // namespace trifinger::bindings
