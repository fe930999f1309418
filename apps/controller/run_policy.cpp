// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger-run-policy`: a trained policy on a robot that runs elsewhere.
#include "learning/run_policy.hpp"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "controller/episode_marks.hpp"
#include "controller/user_program.hpp"
#include "learning/takeover.hpp"
#include "robot/typed_lines.hpp"
#include "shared/exit_code.hpp"
#include "shared/external_command.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/output_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

using learning::EpisodeReport;
using learning::Experience;
using learning::Policy;
using learning::PolicySource;
using learning::Takeover;
using learning::Verdict;

struct RunPolicyOptions {
  std::string policy;
  std::string robot;
  learning::PolicyRunOptions run;
  std::string output;
  std::string marks;
  std::string sentence;
  bool is_json{false};
  bool offers_takeover{false};
  bool is_judged{false};
  Demand scheduling{Demand::kTry};
  learning::Precision precision{learning::Precision::kDouble};
};

// Returns what the policy's file says about its training.
std::string metadata_of(const Policy& policy, const std::string& name, const std::string& file) {
  const auto& metadata = policy.network().metadata;
  const auto found = metadata.find(name);
  if (found != metadata.end()) return found->second;
  throw InvalidArgument(
      fmt::format("{} does not say its '{}': its metadata are those of no "
                  "environment (docs/policies.md)",
                  file, name));
}

void print(const EpisodeReport& report) {
  const auto& outcome = report.outcome;
  double worst = 0.0;
  for (const double distance : outcome.distance) worst = std::max(worst, distance);
  print_safely(
      "  episode {:>4}: {:>4} actions, reward {:>9.3f}, {:>7.2f} mm from the goal{}{}{}{}\n",
      report.number, report.actions, report.total_reward, 1e3 * worst,
      outcome.success ? ", success" : "",
      report.policy > 0 ? fmt::format(", policy {}", report.policy) : "",
      report.repeated_steps > 0
          ? fmt::format(", {} steps without an action in time", report.repeated_steps)
          : "",
      report.interventions > 0 ? fmt::format(", {} actions of a person", report.interventions)
                               : "");
  std::fflush(stdout);
}

// Hands reports on in a thread of its own, because a terminal or a disk that blocks must not stop
// the robot.
class Reporter {
 public:
  explicit Reporter(std::function<void(const EpisodeReport&)> report)
      : report_(std::move(report)), thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void add(const EpisodeReport& report) {
    {
      const std::lock_guard lock(mutex_);
      reports_.push_back(report);
    }
    has_more_.notify_one();
  }

  // Hands on what is left, then throws what a report has thrown. No report may follow.
  void finish() {
    thread_.request_stop();
    thread_.join();
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void run(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (has_more_.wait(lock, stop, [this] { return !reports_.empty(); })) {
      const EpisodeReport report = reports_.front();
      reports_.pop_front();
      lock.unlock();
      try {
        report_(report);
      } catch (...) {
        if (!error_) error_ = std::current_exception();
      }
      lock.lock();
    }
  }

  std::function<void(const EpisodeReport&)> report_;
  std::exception_ptr error_;
  std::mutex mutex_;
  std::condition_variable_any has_more_;
  std::deque<EpisodeReport> reports_;
  std::jthread thread_;  // Last member, because the thread uses the others.
};

Variant variant_of(const RobotConfig& config) { return description_of(config).variant; }

// Returns the configuration that the policy was trained with, if its file has one. Files of older
// versions only have its name.
std::optional<config::File> trained_with(const Policy& policy, const std::string& file) {
  const auto& metadata = policy.network().metadata;
  const auto text = metadata.find("configuration");
  if (text == metadata.end()) return std::nullopt;
  return config::File::parse(text->second, "the configuration in " + file);
}

// Refuses a policy for other fingers, which would move these to places where they must not be.
void check_robot(const Policy& policy, const std::string& file, const config::File& robot) {
  const Variant variant = variant_of(read_robot_config(robot));
  const std::optional<config::File> trained = trained_with(policy, file);
  const auto& metadata = policy.network().metadata;
  const auto name = metadata.find("robot");
  const bool is_other =
      trained ? trained->values()["robot.variant"] != robot.values()["robot.variant"]
              : name != metadata.end() && variant_of(load_robot_config(name->second)) != variant;
  if (is_other) {
    throw InvalidArgument(
        fmt::format("{} was trained for a {}, which this robot is not", file,
                    name != metadata.end() ? name->second : trained->values()["robot.variant"]));
  }
}

// Warns of differences between this robot and the training.
void warn_of_differences(const Policy& policy, const RunPolicyOptions& options,
                         const config::File& robot) {
  const std::optional<config::File> trained = trained_with(policy, options.policy);
  if (!trained) return;
  const std::vector<ConfigDifference> different = differences(robot, *trained);
  if (different.empty()) return;
  print_safely(stderr,
               "trifinger run-policy: warning: '{}' is not what {} was trained on, and may not do "
               "what it did there:\n",
               options.robot, options.policy);
  for (const ConfigDifference& difference : different) {
    print_safely(stderr, "  {}: {} here, {} in the training\n", difference.key,
                 difference.value.value_or("none"), difference.other.value_or("none"));
  }
}

// The distances are those of the parts of the goal.
nlohmann::ordered_json json_of(const EpisodeReport& report, std::size_t parts) {
  const std::span distance = std::span(report.outcome.distance).first(parts);
  return {{"episode", report.number},
          {"policy", report.policy},
          {"actions", report.actions},
          {"total_reward", report.total_reward},
          {"distance", std::vector(distance.begin(), distance.end())},
          {"is_success", report.outcome.success},
          {"is_terminated", report.outcome.terminated},
          {"repeated_steps", report.repeated_steps},
          {"interventions", report.interventions}};
}

// The robot's companion of experience; nothing for a back-end that does not have it.
std::unique_ptr<SensorWriter<Experience>> experience_of(const Session& robot) {
  const std::vector<std::string>& companions = robot.companion_names();
  if (std::ranges::find(companions, Experience::kCompanion) == companions.end()) return {};
  return std::make_unique<SensorWriter<Experience>>(robot.info().name, Experience::kCompanion,
                                                    Experience::kKept);
}

// Offers a session to people who take over. Without it the policy acts alone.
template <class R>
std::unique_ptr<Takeover<R>> takeover_of(const Session& robot, const RobotConfig& config,
                                         const RealtimeOptions& realtime) {
  const SimulationOptions& options = config.simulation;
  const std::vector<JointLimit> limits =
      options.limits ? *options.limits : default_limits(options.description);
  try {
    auto takeover = std::make_unique<Takeover<R>>(robot, limits_of<R::kJoints>(limits), realtime);
    print_safely(stderr, "a person can take over: trifinger teleop {}\n",
                 Takeover<R>::name_for(robot.info().name));
    return takeover;
  } catch (const Error& error) {
    print_safely(stderr, "trifinger run-policy: nobody can take over: {}\n", error.what());
    return nullptr;
  }
}

// Reads verdicts on episodes from standard input, until that ends.
void read_verdicts(const std::stop_token& stop, std::atomic<Verdict>& verdict) {
  TypedLines typed;
  while (!stop.stop_requested() && !typed.has_ended()) {
    for (const std::string& line : typed.take(std::chrono::milliseconds(100))) {
      if (line == "success" || line == "failure") {
        // relaxed: no other data depends on it.
        verdict.store(line == "success" ? Verdict::kSuccess : Verdict::kFailure,
                      std::memory_order_relaxed);
      } else {
        print_safely(stderr, "a verdict is \"success\" or \"failure\", not \"{}\"\n", line);
      }
    }
  }
}

// Says why the robot needs care, and returns the exit code.
int say(const learning::NeedsCare& care) {
  print_safely(stderr, "trifinger run-policy: {}\n", care.text);
  return care.kind == learning::NeedsCare::Kind::kWarmMotors ? kNeedsRest : kOutOfReach;
}

template <class R>
int run_on(Frontend<R>& robot, PolicySource& source, const RunPolicyOptions& options) {
  const Policy& policy = source.newest().policy;
  const config::File described = config_file_of(robot.session());
  const RobotConfig config = read_robot_config(described);
  const std::string task = metadata_of(policy, "task", options.policy);
  check_robot(policy, options.policy, described);
  const std::string settings = metadata_of(policy, "options", options.policy);
  auto trained = learning::read_options(settings);
  // Real measurements have their own noise, so none is added.
  trained.position_noise = trained.velocity_noise = 0.0;
  const learning::Environment environment(task, trained, description_of(config),
                                          robot.session().info().period);

  warn_of_differences(policy, options, described);

  std::optional<EpisodeMarks> marks;
  if (!options.marks.empty()) marks.emplace(options.marks);
  const std::uint64_t session_id = robot.session().info().session_id;
  const auto tell = [&](const EpisodeReport& report) {
    if (options.is_json) {
      print_safely("{}\n", json_of(report, environment.num_parts()).dump());
      std::fflush(stdout);
    } else {
      print(report);
    }
    if (marks && report.last_step > report.first_step) {
      marks->write({.session_id = session_id,
                    .first = report.first_step,
                    .end = report.last_step,
                    .task = options.sentence,
                    .terminated = report.outcome.terminated,
                    .success = report.outcome.success});
    }
  };

  const std::atomic<bool>& stop = stop_on_signals();
  print_safely(options.is_json ? stderr : stdout, "'{}' shall do '{}' with {}: {}\n", options.robot,
               task, options.policy, learning::write_options(trained));
  std::fflush(stdout);
  // The threads of these are started here, with the usual priority.
  Reporter reporter(tell);
  std::atomic<Verdict> verdict{Verdict::kNone};
  std::jthread judge;
  if (options.is_judged) {
    std::signal(SIGTTIN, SIG_IGN);  // in the background of a terminal there are no verdicts
    judge = std::jthread([&](const std::stop_token& end) { read_verdicts(end, verdict); });
  }
  const RealtimeOptions realtime = realtime_beside(robot.session().info(), options.scheduling);
  const auto takeover =
      options.offers_takeover ? takeover_of<R>(robot.session(), config, realtime) : nullptr;
  static_cast<void>(enter_realtime(realtime));
  std::vector<EpisodeReport> reports;  // for the file
  std::size_t successes = 0;
  std::size_t episodes = 0;
  learning::PolicyRunOptions run = options.run;
  run.stop = &stop;
  if (options.is_judged) run.verdict = &verdict;
  const auto experience = experience_of(robot.session());
  run.experience = experience.get();
  run.process = learning::digest(task, settings);
  run.on_episode = [&](const EpisodeReport& report) {
    ++episodes;
    successes += report.outcome.success ? 1 : 0;
    if (!options.output.empty()) reports.push_back(report);
    reporter.add(report);
  };
  const auto care = learning::run_policy(robot, environment, source, run, takeover.get());
  reporter.finish();

  if (!options.is_json) {
    print_safely("{} of {} episodes ended at their goal.\n", successes, episodes);
  }
  if (!options.output.empty()) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const EpisodeReport& report : reports)
      json.push_back(json_of(report, environment.num_parts()));
    write_output_file(options.output, json.dump(2) + "\n");
  }
  if (care) return say(*care);
  return stop.load(std::memory_order_relaxed) ? kInterrupted : kDone;
}

// True for what only Python can ask: tasks in Python, which are MODULE:CLASS, and cameras.
bool needs_python(const std::map<std::string, std::string>& metadata) {
  const auto task = metadata.find("task");
  if (task != metadata.end() && task->second.find(':') != std::string::npos) return true;
  const auto options = metadata.find("options");
  return options != metadata.end() &&
         learning::read_options(options->second).layout == learning::Layout::kImages;
}

int run(const RunPolicyOptions& options, const std::vector<std::string>& words) {
  PolicySource source(options.policy, options.precision, [](const std::string& why) {
    print_safely(stderr, "trifinger run-policy: the policy before goes on: {}\n", why);
  });
  if (needs_python(source.newest().policy.network().metadata)) {
    run_python("run-policy-of-python", "run-policy", words);
  }
  if (!options.sentence.empty() && options.marks.empty()) {
    throw InvalidArgument("--task says what the marks of episodes mean: it needs --marks");
  }
  if (Session::open(options.robot).info().type == Finger::kType) {
    auto robot = connect<Finger>(options.robot);
    return run_on(robot, source, options);
  }
  auto robot = connect<TriFinger>(options.robot);
  return run_on(robot, source, options);
}

int run_policy_command(const std::vector<std::string>& words) {
  RunPolicyOptions options;
  CLI::App program(
      "Runs a trained policy on a robot, in the same way as the environment that trained it.",
      "trifinger run-policy");
  set_up_help(program);
  program.footer(
      "Example:\n"
      "  trifinger run trifinger_edu --name sim         in one terminal\n"
      "  trifinger run-policy reach.policy              in another\n"
      "  trifinger run trifinger_edu --name sim --record logs\n"
      "  trifinger run-policy reach.policy --marks logs/reach.episodes.jsonl");
  program.add_option("POLICY", options.policy, "File of the policy")->required();
  add_robot_option(program, options.robot);
  program.add_option("--episodes", options.run.episodes, "Number of episodes")
      ->capture_default_str();
  program.add_option("--seed", options.run.seed, "Seed of starts and goals")->capture_default_str();
  program.add_option("--first", options.run.first_episode, "Number of the first episode")
      ->capture_default_str();
  add_output(program, options.output, "Also write the episodes to this file, in JSON");
  program
      .add_option("--marks", options.marks,
                  "Also mark the episodes for `trifinger export --episodes marks`, in the file "
                  "FILE.episodes.jsonl beside the robot's log")
      ->option_text("FILE");
  program
      .add_option("--task", options.sentence,
                  "What the episodes do, for the marks; of a policy of a task in Python: that "
                  "task, MODULE:CLASS")
      ->option_text("SENTENCE");
  program.add_flag(
      "--explore", options.run.explores,
      "Add the noise to the actions that the policy's file asks for, so that a learner "
      "sees something new");
  program
      .add_option("--approach-every", options.run.approach_every,
                  "Move to the start of every N-th episode; the others begin where the one before "
                  "has ended")
      ->option_text("N")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  program.add_flag("--takeover", options.offers_takeover,
                   "Let people take over by the session NAME-takeover, which is controlled like "
                   "the robot, as by `trifinger teleop NAME-takeover`");
  program.add_flag("--judge", options.is_judged,
                   "Let standard input judge: a line \"success\" or \"failure\" ends the episode, "
                   "with reward 1 or 0, whatever the task says");
  program
      .add_option("--rest-below", options.run.rest_below,
                  "End after an episode that leaves a motor with less than this thermal margin, 0 "
                  "to 1, with exit status 5")
      ->option_text("MARGIN")
      ->check(CLI::Range(0.0, 1.0));
  program.add_flag("--end-out-of-reach", options.run.ends_out_of_reach,
                   "End after an episode that leaves the object more than 2 cm beyond where "
                   "episodes begin, with exit status 6");
  program.add_flag("--json", options.is_json, "Print a line of JSON for each episode");
  add_user_scheduling(program, options.scheduling);
  add_choice(program, "--precision", options.precision,
             {{"double", learning::Precision::kDouble}, {"single", learning::Precision::kSingle}},
             "Precision of the policy's sums: single takes half the time and rounds as much as "
             "PyTorch; default: double");
  return run_user_program(program, words, [&] { return run(options, words); });
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  return trifinger::apps::run_policy_command({arguments + 1, arguments + argument_count});
}
