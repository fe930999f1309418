// SPDX-License-Identifier: BSD-3-Clause
#include "tasks/tasks.hpp"

#include <algorithm>
#include <iomanip>
#include <iterator>
#include <mutex>
#include <sstream>

#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "make_task.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

using trifinger::detail::text_of;

class Tasks {
 public:
  static Tasks& instance() {
    static Tasks tasks;
    return tasks;
  }

  void add(TaskDescription task) {
    const std::lock_guard lock(mutex_);
    if (std::ranges::find(tasks_, task.name, &TaskDescription::name) != tasks_.end()) {
      throw InvalidArgument(text_of("there is a task '", task.name, "' already"));
    }
    tasks_.push_back(std::move(task));
  }

  [[nodiscard]] TaskDescription find(std::string_view name) const {
    const std::lock_guard lock(mutex_);
    const auto found = std::ranges::find(tasks_, name, &TaskDescription::name);
    if (found != tasks_.end()) return *found;
    const std::vector<std::string> known = names_locked();
    throw InvalidArgument(text_of("there is no task '", name, "'; there are ",
                                  quoted_list({known.begin(), known.end()}, "and")));
  }

  [[nodiscard]] std::vector<std::string> names() const {
    const std::lock_guard lock(mutex_);
    return names_locked();
  }

 private:
  Tasks() {
    for (const auto make : {reach_tasks, move_cube_tasks, throw_tasks, dclaw_tasks}) {
      std::ranges::move(make(), std::back_inserter(tasks_));
    }
  }

  [[nodiscard]] std::vector<std::string> names_locked() const {
    std::vector<std::string> names;
    names.reserve(tasks_.size());
    for (const TaskDescription& task : tasks_) names.push_back(task.name);
    return names;
  }

  mutable std::mutex mutex_;
  std::vector<TaskDescription> tasks_;
};

}  // namespace

void add_task(TaskDescription task) { Tasks::instance().add(std::move(task)); }

TaskDescription find_task(std::string_view name) { return Tasks::instance().find(name); }

std::vector<std::string> task_names() { return Tasks::instance().names(); }

EnvironmentOptions default_options(std::string_view task) { return find_task(task).options; }

std::vector<std::string> config_overrides(const TaskDescription& task,
                                          const EnvironmentOptions& options, bool is_from_file) {
  std::vector<std::string> overrides;
  if (!is_from_file) {
    overrides = task.config_overrides;
    overrides.emplace_back(
        "backend.history=1024");  // A session with a short history begins faster.
  }
  const auto add = [&overrides](const char* name, double value) {
    std::ostringstream text;
    text << name << "=" << std::setprecision(17) << value;
    overrides.push_back(text.str());
  };
  const bool is_tracked = options.object_poses == ObjectPoses::kTracked;
  // Poses of a robot from a file are as its configuration says, unless somebody asks for others:
  // the usual period need not fit its steps.
  const auto add_poses = [&](const char* name, double EnvironmentOptions::* value) {
    if (!is_from_file || options.*value != EnvironmentOptions{}.*value) add(name, options.*value);
  };
  if (!is_from_file || is_tracked) {
    overrides.push_back(
        text_of("simulation.object_poses=", is_tracked ? "\"tracked\"" : "\"exact\""));
  }
  add_poses("simulation.object_period", &EnvironmentOptions::object_period);
  add_poses("simulation.object_delay", &EnvironmentOptions::object_delay);
  add_poses("simulation.object_position_noise", &EnvironmentOptions::object_position_noise);
  add_poses("simulation.object_orientation_noise", &EnvironmentOptions::object_orientation_noise);
  add_poses("simulation.object_loss", &EnvironmentOptions::object_loss);
  if (!options.needs_cameras()) return overrides;
  overrides.emplace_back("cameras.source=\"simulated\"");
  add("cameras.rate", options.camera_rate);
  add("cameras.delay", options.camera_delay);
  add("cameras.size", options.camera_size);
  overrides.push_back(text_of("cameras.varies=", options.camera_varies ? "true" : "false"));
  return overrides;
}

std::unique_ptr<const AnyTask> make_task(const TaskDescription& description, Workspace& robot) {
  if (robot.kinematics != nullptr && description.num_fingers == 0) {
    throw InvalidArgument(text_of("the task '", description.name,
                                  "' is for a robot from a file, such as ", description.robot));
  }
  if (robot.kinematics != nullptr && description.num_fingers != robot.kinematics->num_fingers()) {
    throw InvalidArgument(text_of("the task '", description.name, "' is for a robot with ",
                                  description.num_fingers, " fingers, this one has ",
                                  robot.kinematics->num_fingers()));
  }
  auto task = description.make(robot);
  const std::string_view object = task->object_name();
  const auto is_object = [object](const auto& candidate) { return candidate.name == object; };
  const bool has_object =
      object.empty() ||
      (robot.file != nullptr
           ? std::ranges::any_of(robot.file->model().objects(), is_object)
           : std::ranges::any_of(robot.kinematics->description().objects, is_object));
  if (!has_object) {
    throw InvalidArgument(text_of("the task '", description.name, "' needs an object called '",
                                  object, "' in the robot's configuration"));
  }
  const std::size_t goal_size = task->goal().low.size();
  if (goal_size == 0 || goal_size > kMaxGoal) {
    throw InvalidArgument(text_of("goals of the task '", description.name, "' have ", goal_size,
                                  " numbers, must have 1 to ", kMaxGoal));
  }
  return task;
}

}  // namespace trifinger::learning
