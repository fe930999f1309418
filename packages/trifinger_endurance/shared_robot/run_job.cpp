// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/run_job.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <stop_token>
#include <system_error>
#include <thread>
#include <utility>

#include "core/job_claim.hpp"
#include "log/running_recorder.hpp"
#include "shared/child_program.hpp"
#include "shared/exit_code.hpp"
#include "shared/signals.hpp"
#include "shared/terminal.hpp"
#include "shared_robot/bounded_output.hpp"
#include "shared_robot/confined_program.hpp"
#include "shared_robot/control_group.hpp"
#include "shared_robot/job_files.hpp"
#include "shared_robot/job_folder.hpp"
#include "shared_robot/job_report.hpp"
#include "shared_robot/process_tree.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

// How often the usage of a job is measured at most.
constexpr Nanoseconds kMeasurePeriod = std::chrono::milliseconds(100);
constexpr Nanoseconds kLongestPause = std::chrono::seconds(1);
constexpr std::size_t kMaxErrors = 20;

// Somebody has pressed Ctrl-C, or sent such a signal.
struct JobInterrupted : std::exception {
  explicit JobInterrupted(int which) noexcept : signal(which) {}
  int signal;
};

// Returns all that the program gets as environment.
std::vector<std::string> environment_for(const JobOptions& options, const fs::path& folder) {
  std::vector<std::string> names{
      "PATH",     "LANG",       "LANGUAGE", "TZ",          "LC_ALL",
      "LC_CTYPE", "LC_NUMERIC", "LC_TIME",  "LC_MESSAGES", "TRIFINGER_SESSION_DIR"};
  std::vector<std::string> environment;
  const auto add = [&](const std::string& name, const std::string& value) {
    std::erase_if(environment,
                  [&](const std::string& entry) { return entry.starts_with(name + "="); });
    environment.push_back(name + "=" + value);
  };
  const auto add_own = [&](const std::string& name) {
    if (const char* const value = std::getenv(name.c_str())) add(name, value);
  };
  for (const std::string& name : names) add_own(name);
  const char* const user = std::getenv("USER");
  const std::string user_name = options.user.value_or(user == nullptr ? "" : user);
  if (!user_name.empty()) add("USER", user_name);
  if (!user_name.empty()) add("LOGNAME", user_name);
  add("HOME", folder.string());
  add("TMPDIR", (folder / "tmp").string());
  add("TRIFINGER_ROBOT", options.robot);
  add("TRIFINGER_JOB_FOLDER", folder.string());
  add("TRIFINGER_LOG_DIR", folder.string());
  for (const std::string& entry : options.environment) {
    const std::size_t sign = entry.find('=');
    if (sign == std::string::npos) {
      add_own(entry);
    } else {
      add(entry.substr(0, sign), entry.substr(sign + 1));
    }
  }
  return environment;
}

// What is printed and kept of the program's output.
class OutputFile {
 public:
  OutputFile(const fs::path& path, std::uint64_t limit) : output_(limit) {
    file_ = ipc::FileDescriptor([&path] {
      return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    });
    if (!file_) throw SystemError("make " + path.string(), errno);
  }

  void add(std::string_view text) {
    const std::string_view beginning = output_.add(text);
    write(beginning);
    std::fwrite(beginning.data(), 1, beginning.size(), stdout);
    std::fflush(stdout);
  }
  void finish() { write(output_.rest()); }

  [[nodiscard]] const BoundedOutput& output() const noexcept { return output_; }
  // Why something is missing in the file; empty if nothing is.
  [[nodiscard]] const std::string& error() const noexcept { return error_; }

 private:
  void write(std::string_view text) {
    while (!text.empty() && error_.empty()) {
      const ssize_t size = ::write(file_.get(), text.data(), text.size());
      if (size < 0 && errno == EINTR) continue;
      if (size <= 0) {
        error_ = fmt::format("its output is not complete: {}", std::strerror(errno));
        return;
      }
      text.remove_prefix(static_cast<std::size_t>(size));
    }
  }

  BoundedOutput output_;
  ipc::FileDescriptor file_;
  std::string error_;
};

std::string signal_text(int signal) {
  const char* const name = ::sigabbrev_np(signal);
  return name == nullptr ? fmt::format("signal {}", signal) : fmt::format("SIG{}", name);
}

JobEnd cancelled_by(int signal) {
  return {.kind = JobEnd::Kind::kCancelled,
          .signal = signal,
          .text = "was ended because this was interrupted by " + signal_text(signal)};
}

std::string limit_text(Limit limit, const JobUsage& usage, const JobLimits& limits) {
  switch (limit) {
    case Limit::kNone:
      break;
    case Limit::kTime:
      return fmt::format("its {} are over", duration_text(limits.time));
    case Limit::kCpuTime:
      return fmt::format("it used {} of processors, more than {}", duration_text(usage.cpu_time),
                         duration_text(limits.cpu_time));
    case Limit::kMemory:
      return fmt::format("it used {} of memory, more than {}", size_text(usage.memory),
                         size_text(limits.memory));
    case Limit::kProcesses:
      return fmt::format("it had {} threads, more than {}", usage.processes, limits.processes);
    case Limit::kFiles:
      if (usage.hides_files) return "it had folders that cannot be read, or more than 200 deep";
      return fmt::format("it had {} in {} files, more than {} or {} files", size_text(usage.files),
                         usage.file_count, size_text(limits.files), limits.file_count);
  }
  return "";
}

// Watches in real time, where this program may.
class WatchPriority {
 public:
  WatchPriority() { watch_in_real_time(); }
  WatchPriority(const WatchPriority&) = delete;
  WatchPriority& operator=(const WatchPriority&) = delete;
  ~WatchPriority() { watch_ordinarily(); }
};

// Measuring takes at most a tenth of the time, but is never put off for long.
Nanoseconds pause_after(Nanoseconds measure) {
  return std::clamp<Nanoseconds>(10 * measure, kMeasurePeriod, kLongestPause);
}

// Measures the files of a job in a thread of its own, because a program can make that slow.
class FileWatch {
 public:
  FileWatch(JobFiles& files, pid_t guard, const JobLimits& limits)
      : thread_([this, &files, guard, &limits](const std::stop_token& stop) {
          watch_ordinarily();
          work(files, guard, {.bytes = limits.files, .count = limits.file_count}, stop);
        }) {}

  // Adds the files to `usage`, as they were at the last look.
  void add_to(JobUsage& usage) {
    const std::lock_guard lock(mutex_);
    usage.files = newest_.bytes;
    usage.file_count = newest_.count;
    usage.hides_files = newest_.is_hidden;
  }

 private:
  void work(JobFiles& files, pid_t guard, FilesUsage most, const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const Instant begin = now();
      files.look_at(descendants_of(guard, all_processes()));
      const FilesUsage usage = files.usage(most);
      std::unique_lock lock(mutex_);
      newest_ = usage;
      changed_.wait_for(lock, stop, pause_after(now() - begin), [] { return false; });
    }
  }

  std::mutex mutex_;
  std::condition_variable_any changed_;  // Only a stop ends a wait early.
  FilesUsage newest_;
  std::jthread thread_;  // the last member: it uses all others
};

// Makes the robot fit under a claim, which a robot that does not run yet has not.
PreparationReport make_fit_alone(const std::string& robot, std::optional<JobClaim>& claim,
                                 const PreparationOptions& options) {
  std::vector<std::string> recovered;
  if (!claim) {
    PreparationReport waited = wait_until_free(robot, options);
    if (!waited.is_fit) return waited;
    recovered = std::move(waited.recovered);
    try {
      claim = JobClaim::take(robot);
    } catch (const Error& error) {
      waited.is_fit = false;
      waited.problem = error.what();
      return waited;
    }
  }
  PreparationReport report = make_fit(robot, options);
  report.recovered.insert(report.recovered.begin(), recovered.begin(), recovered.end());
  return report;
}

class Job {
 public:
  explicit Job(const JobOptions& options)
      : options_(options),
        claim_(JobClaim::take(options.robot)),
        preparation_(options.preparation) {
    report_.robot = options.robot;
    report_.words = options.words;
    report_.user = options.user;
    report_.limits = options.limits;
    report_.begin = std::chrono::system_clock::now();
    make_folders();
    preparation_.report = [this](const std::string& sentence) { print(sentence); };
  }

  int run() {
    prepare_program();
    try {
      preparation_.look = [this] { throw_if_interrupted(); };
      report_.before = make_fit_alone(options_.robot, claim_, preparation_);
      if (report_.before.is_fit) {
        record_and_run();
      } else {
        report_.end.text = "was not started: the robot is not fit: " + report_.before.problem;
      }
    } catch (const JobInterrupted& interrupted) {
      report_.end = {
          .kind = JobEnd::Kind::kCancelled,
          .signal = interrupted.signal,
          .text = "was not started: this was interrupted by " + signal_text(interrupted.signal)};
    } catch (const std::exception& error) {
      // Whatever it was, the robot must be brought back.
      is_broken_ = true;
      add_error(error.what());
      if (report_.end.text.empty()) report_.end.text = "was ended, because this failed";
    }
    program_.reset();
    if (report_.before.is_fit || interrupted_by_ || is_broken_) restore();
    note_cancellation();
    report_.end_time = std::chrono::system_clock::now();
    write_report();
    const int code = exit_code_of(report_);
    return is_broken_ && code == kDone ? kFailed : code;
  }

 private:
  void print(const std::string& text, Style style = Style::kPlain) {
    console_.print(options_.robot, text, style);
  }

  // Returns the first signal that has come. A second one ends this program.
  std::optional<int> look_for_signal() {
    const std::optional<int> signal = signals_.wait(Nanoseconds::zero());
    if (!signal) return std::nullopt;
    if (interrupted_by_) Signals::die_of(*signal);
    interrupted_by_ = signal;
    print("ends early and brings the robot back; a second Ctrl-C ends at once", Style::kWarning);
    return signal;
  }
  void throw_if_interrupted() {
    if (const std::optional<int> signal = look_for_signal()) throw JobInterrupted(*signal);
  }

  void make_folders() {
    const auto whole = std::chrono::floor<std::chrono::seconds>(report_.begin.time_since_epoch());
    const fs::path usual =
        fs::path("jobs") / fmt::format("{}_{:%Y-%m-%d_%H-%M-%S}_{}", options_.robot,
                                       fmt::gmtime(whole.count()), ::getpid());
    if (options_.user) user_ = SystemUser::find(*options_.user);
    folder_ = make_job_folder(options_.output.value_or(usual));
    if (fs::exists(folder_ / "job.json") || fs::exists(folder_ / "output.txt")) {
      throw UsageError(folder_.string() + " has another job; --output names a new folder");
    }
    work_ = folder_ / "work";
    make_work_folder(folder_, user_);
  }

  void prepare_program() {
    group_ = ControlGroup::make(options_.limits.memory);
    Confinement confinement{.words = options_.words,
                            .folder = work_,
                            .environment = environment_for(options_, work_),
                            .user = user_,
                            .limits = options_.limits,
                            .writable = {},
                            .group = group_.get(),
                            .with_namespaces = options_.with_namespaces};
    for (const fs::path& path : {session_folder(), fs::path("/dev/shm")}) {
      std::error_code ignored;
      const fs::path real = fs::canonical(path, ignored);
      auto& writable = confinement.writable;
      if (!ignored && std::ranges::find(writable, real) == writable.end()) {
        writable.push_back(real);
      }
    }
    shared_ = confinement.writable;
    program_.emplace(std::move(confinement));  // before any thread
    report_.confined_by = program_->confined_by();
  }

  void record_and_run() {
    log::RecorderOptions recorder{.folder = folder_ / "log"};
    recorder.max_total = options_.limits.log;
    std::optional<RunningRecorder> recording;
    try {
      recording.emplace(std::vector{options_.robot}, std::move(recorder));
    } catch (const Error& error) {
      add_error(fmt::format("there is no log: {}", error.what()));
    }
    run_program();
    program_.reset();
    // The log also has how the last session ended.
    report_.after = wait_until_free(options_.robot, preparation_after());
    if (recording) finish(*recording);
    report_.driving = driving_in(folder_ / "log");
    report_.leftovers = files_->remove_leftovers();
  }

  void run_program() {
    files_.emplace(work_, shared_, user_ ? user_->user : ::geteuid());
    OutputFile output(folder_ / "output.txt", options_.limits.output);
    print("starts the program; its folder is " + work_.string());
    const WatchPriority priority;
    const Instant begin = now();
    program_->start();
    FileWatch file_watch(*files_, program_->guard(), options_.limits);
    Instant next_measure = begin;
    std::optional<Instant> asked;
    bool was_killed = false;
    const auto ask = [&](JobEnd why) {
      report_.end = std::move(why);
      program_->ask_to_end();
      asked = now();
    };
    const auto kill = [&] {
      if (!std::exchange(was_killed, true)) program_->kill();
    };
    // Nothing in this loop takes long, so that time and signals are looked at in each round.
    while (!program_->is_gone()) {
      constexpr Nanoseconds kSlice = std::chrono::milliseconds(20);
      const std::string text = program_->take_output(kSlice);
      output.add(text);
      // The program waits if it prints more than anybody will see.
      if (output.output().left_out() > 0 && !text.empty()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
      const std::optional<int> signal = look_for_signal();
      if (program_->end() || was_killed) continue;
      if (signal && !asked) {
        ask(cancelled_by(*signal));
      }
      if (now() - begin > options_.limits.time && !asked) {
        ask({.kind = JobEnd::Kind::kLimit,
             .limit = Limit::kTime,
             .text = "was ended: " + limit_text(Limit::kTime, {}, options_.limits)});
      }
      if (asked && now() - *asked > options_.limits.grace) kill();
      if (now() < next_measure) continue;
      const Instant before = now();
      JobUsage usage = measure_processes();
      file_watch.add_to(usage);
      next_measure = now() + pause_after(now() - before);
      raise_to(report_.most, usage);
      // These limits hold also for a program that has been asked to end.
      const Limit limit = exceeded(usage, options_.limits);
      if (limit == Limit::kNone) continue;
      if (!asked) {
        report_.end = {.kind = JobEnd::Kind::kLimit,
                       .limit = limit,
                       .text = "was ended: " + limit_text(limit, usage, options_.limits)};
      }
      kill();
    }
    report_.most.time = std::max<Nanoseconds>(report_.most.time, now() - begin);
    report_.end.was_killed = was_killed;
    output.finish();
    report_.output_bytes = output.output().total();
    report_.output_left_out = output.output().left_out();
    if (!output.error().empty()) add_error(output.error());
    if (report_.end.kind == JobEnd::Kind::kNotStarted) note_end(*program_->end());
  }

  // What the program uses but files.
  [[nodiscard]] JobUsage measure_processes() const {
    const std::vector<ProcessEntry> all = all_processes();
    const std::vector<ProcessEntry> processes = descendants_of(program_->guard(), all);
    JobUsage usage;
    for (const ProcessEntry& process : all) {
      // The guard has waited for orphans.
      if (process.pid == program_->guard()) usage.cpu_time += process.children_cpu_time;
    }
    for (const ProcessEntry& process : processes) {
      usage.cpu_time += process.cpu_time + process.children_cpu_time;
      usage.processes += process.has_ended ? 1 : process.threads;
    }
    // The rest takes time that a fork bomb would use.
    if (usage.processes > options_.limits.processes) return usage;
    if (group_) usage.memory = group_->memory();
    if (!group_ || may_leave_group()) {
      usage.memory = std::max(usage.memory, memory_of(processes, options_.limits.memory));
    }
    return usage;
  }

  // A program of this user may go to another group where it can write to the files of groups.
  [[nodiscard]] bool may_leave_group() const {
    const bool is_other_user = user_ && user_->user != ::geteuid();
    return !is_other_user && !program_->confined_by().read_only;
  }

  void note_end(const ProgramEnd& end) {
    JobEnd& job_end = report_.end;
    if (end.start_error != 0) {
      job_end.text = fmt::format("could not be started: {}: {}", options_.words.front(),
                                 std::strerror(end.start_error));
      // To the shell, too, a command that is not found has failed.
      job_end.kind = JobEnd::Kind::kExited;
      job_end.exit_code = 127;
    } else if (group_ && group_->was_too_large()) {
      job_end.kind = JobEnd::Kind::kLimit;
      job_end.limit = Limit::kMemory;
      job_end.text = fmt::format("was ended: it used more than {} of memory",
                                 size_text(options_.limits.memory));
    } else if (WIFSIGNALED(end.status)) {
      job_end.kind = JobEnd::Kind::kSignal;
      job_end.signal = WTERMSIG(end.status);
      job_end.text = "was ended by " + signal_text(job_end.signal);
      if (job_end.signal == SIGXFSZ) {
        job_end.kind = JobEnd::Kind::kLimit;
        job_end.limit = Limit::kFiles;
        job_end.text = fmt::format("was ended: it wrote a file of more than {}",
                                   size_text(options_.limits.file_size));
      } else if (job_end.signal == SIGXCPU) {
        job_end.kind = JobEnd::Kind::kLimit;
        job_end.limit = Limit::kCpuTime;
        // Two limits of the kernel send this signal.
        const bool has_used_it =
            report_.most.cpu_time + std::chrono::seconds(2) > options_.limits.cpu_time;
        job_end.text = has_used_it ? fmt::format("was ended: it used more than {} of a processor",
                                                 duration_text(options_.limits.cpu_time))
                                   : "was ended: a thread with real-time priority did not wait for "
                                     "more than 200 ms";
      }
    } else {
      job_end.kind = JobEnd::Kind::kExited;
      job_end.exit_code = WEXITSTATUS(end.status);
      job_end.text = fmt::format("ended with exit code {}", job_end.exit_code);
    }
  }

  // Whoever gives a job up may signal all its processes one after the other, as Slurm does. Then
  // the program may end before this one has got the signal: it dies of it, or says so as a shell
  // does.
  void note_cancellation() {
    static_cast<void>(look_for_signal());
    if (!interrupted_by_) return;
    constexpr int kOfShells = 128;
    const JobEnd& end = report_.end;
    const bool is_of_signal =
        (end.kind == JobEnd::Kind::kSignal && end.signal == *interrupted_by_) ||
        (end.kind == JobEnd::Kind::kExited && end.exit_code == kOfShells + *interrupted_by_);
    if (is_of_signal) report_.end = cancelled_by(*interrupted_by_);
  }

  [[nodiscard]] PreparationOptions preparation_after() {
    PreparationOptions preparation = preparation_;
    preparation.look = [this] { static_cast<void>(look_for_signal()); };
    return preparation;
  }

  void restore() {
    std::vector<std::string> recovered;
    if (report_.after) recovered = std::move(report_.after->recovered);
    print("brings the robot back");
    report_.after = make_fit(options_.robot, preparation_after());
    report_.after->recovered.insert(report_.after->recovered.begin(), recovered.begin(),
                                    recovered.end());
  }

  void finish(RunningRecorder& recording) {
    constexpr Nanoseconds kTimeout = std::chrono::seconds(10);
    recording.recorder().request_stop();
    const Deadline deadline(kTimeout);
    while (!recording.has_ended(std::chrono::milliseconds(20)) && !deadline.passed()) {
      static_cast<void>(look_for_signal());
    }
    for (const log::Event& event : recording.take_events()) {
      if (event.level != log::Level::kInfo && event.source == "recorder") add_error(event.text);
    }
    if (!recording.has_ended()) {
      add_error("the log lacks its end: its disk does not take it");
      return;
    }
    try {
      recording.require_success();
    } catch (const Error& error) {
      add_error(error.what());
    }
    const log::RecorderState state = recording.recorder().state();
    if (state.lost_steps > 0) {
      add_error(fmt::format("{} steps are not in the log", state.lost_steps));
    }
  }

  void add_error(const std::string& text) {
    if (report_.errors.size() < kMaxErrors) report_.errors.push_back(text);
  }

  void write_report() {
    std::string problem;
    try {
      write_json(report_, folder_);
    } catch (const Error& error) {
      problem = error.what();
    } catch (const fs::filesystem_error& error) {
      problem = error.what();
    }
    if (!problem.empty()) add_error("the report could not be written: " + problem);
    const bool is_good = exit_code_of(report_) == kDone;
    for (const std::string& line : lines_of(report_)) {
      print(line, is_good ? Style::kPlain : Style::kWarning);
    }
    if (problem.empty()) print("report: " + (folder_ / "job.json").string());
  }

  const Signals signals_;  // before any thread
  const JobOptions& options_;
  std::optional<JobClaim> claim_;
  PreparationOptions preparation_;
  Console console_;
  JobReport report_;
  fs::path folder_;
  fs::path work_;
  std::vector<fs::path> shared_;
  std::optional<SystemUser> user_;     // only if root runs the program as somebody else
  std::optional<int> interrupted_by_;  // the first signal that came
  bool is_broken_{false};              // This program has failed.
  std::unique_ptr<ControlGroup> group_;
  std::optional<ConfinedProgram> program_;
  std::optional<JobFiles> files_;
};

}  // namespace

int run_job(const JobOptions& options) { return Job(options).run(); }

int restore_robot(const std::string& robot, const PreparationOptions& preparation) {
  const Signals signals;
  std::optional<JobClaim> claim = JobClaim::take(robot);
  Console console;
  PreparationOptions options = preparation;
  options.report = [&](const std::string& sentence) { console.print(robot, sentence); };
  options.look = [&signals] {
    if (const std::optional<int> signal = signals.wait(Nanoseconds::zero())) {
      throw JobInterrupted(*signal);
    }
  };
  try {
    const PreparationReport report = make_fit_alone(robot, claim, options);
    if (!report.is_fit) {
      console.print(robot, "not fit: " + report.problem, Style::kBad);
      return kNeedsOperator;
    }
    console.print(robot, report.cube.empty() ? "fit" : "fit; the cube is " + report.cube,
                  Style::kGood);
    return kDone;
  } catch (const JobInterrupted& interrupted) {
    return 128 + interrupted.signal;
  }
}

}  // namespace trifinger::apps
