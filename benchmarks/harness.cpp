// SPDX-License-Identifier: BSD-3-Clause
#include "harness.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "trifinger/base/error.hpp"

namespace trifinger::benchmarks {
namespace {

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char character : text) {
    if (character == '"' || character == '\\') result += '\\';
    result += character;
  }
  return result + "\"";
}

// Writes a whole line at once, because another process reads it.
void report(const std::string& object) {
  fmt::print("{}\n", object);
  static_cast<void>(std::fflush(stdout));
}

std::string or_null(const std::optional<double>& value) {
  return value ? fmt::format("{:.6g}", *value) : "null";
}

// Returns what /proc says about this process under a name such as "Cpus_allowed_list".
std::string status_of(const std::string& name) {
  std::ifstream file("/proc/self/status");
  std::string word;
  while (file >> word) {
    if (word != name + ":") continue;
    file >> word;
    return word;
  }
  throw Error("/proc/self/status has no " + name);
}

}  // namespace

double Samples::quantile(double p) const {
  std::vector<double> sorted = values_;
  std::ranges::sort(sorted);
  if (sorted.empty()) return std::nan("");
  const double position = p * static_cast<double>(sorted.size() - 1);
  return sorted[static_cast<std::size_t>(std::lround(position))];
}

Paired alternate(int rounds, const std::function<double()>& measure,
                 const std::function<double()>& reference) {
  Paired paired;
  // The first measurement of each side does not count. It loads pages and caches.
  static_cast<void>(measure());
  static_cast<void>(reference());
  for (int i = 0; i < rounds; ++i) {
    report_progress(i, rounds);
    const double a = measure();
    const double b = reference();
    paired.measure.add(a);
    paired.reference.add(b);
    paired.ratio.add(a / b);
  }
  return paired;
}

Row make_row(std::string measure, std::string unit, const Samples& samples, std::string reach,
             bool holds, std::string remark) {
  return {.measure = std::move(measure),
          .value = samples.median(),
          .low = samples.quantile(0.0),
          .high = samples.quantile(1.0),
          .unit = std::move(unit),
          .reference = {},
          .reference_value = {},
          .ratio = {},
          .reach = std::move(reach),
          .holds = holds,
          .remark = std::move(remark)};
}

Row make_row(std::string measure, std::string unit, const Paired& paired, std::string reference,
             std::string reach, bool holds) {
  Row row = make_row(std::move(measure), std::move(unit), paired.measure, std::move(reach), holds);
  row.reference = std::move(reference);
  row.reference_value = paired.reference.median();
  row.ratio = paired.ratio.median();
  return row;
}

void report_process() {
  sched_param parameters{};
  ::sched_getparam(0, &parameters);
  report(fmt::format(
      R"({{"process": {{"processors": {}, "scheduler": {}, "priority": {}, "nice": {}, "locked": {}}}}})",
      quoted(status_of("Cpus_allowed_list")), ::sched_getscheduler(0), parameters.sched_priority,
      ::getpriority(PRIO_PROCESS, 0), status_of("VmLck")));
}

void report_progress(std::int64_t done, std::int64_t total) {
  static Clock::time_point next;
  const auto now = Clock::now();
  if (now < next) return;
  next = now + std::chrono::milliseconds(500);
  report(fmt::format(R"({{"done": {}, "total": {}}})", done, total));
}

void report_row(const Row& row) {
  report(fmt::format(
      R"({{"row": {{"measure": {}, "value": {:.6g}, "low": {:.6g}, "high": {:.6g}, "unit": {}, )"
      R"("reference": {}, "reference_value": {}, "ratio": {}, "reach": {}, "holds": {}, )"
      R"("remark": {}}}}})",
      quoted(row.measure), row.value, row.low, row.high, quoted(row.unit),
      row.reference.empty() ? "null" : quoted(row.reference), or_null(row.reference_value),
      or_null(row.ratio), quoted(row.reach), row.holds ? "true" : "false", quoted(row.remark)));
}

bool pin(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  return ::sched_setaffinity(0, sizeof(set), &set) == 0;
}

Child::Child(const std::function<void()>& body, int end_signal)
    : pid_(::fork()), end_signal_(end_signal) {
  if (pid_ < 0) throw SystemError("fork", errno);
  if (pid_ != 0) return;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent_) ::_exit(1);  // it has died already
  try {
    body();
  } catch (const std::exception& error) {
    fmt::print(stderr, "child: {}\n", error.what());
    ::_exit(1);
  }
  ::_exit(0);
}

Child::~Child() {
  ::kill(pid_, end_signal_);
  ::waitpid(pid_, nullptr, 0);
}

bool Child::has_ended() const noexcept {
  siginfo_t end{};
  // WNOWAIT leaves the end for the destructor to collect, so that the number stays this child's.
  constexpr int kHow = WEXITED | WNOHANG | WNOWAIT;
  return ::waitid(P_PID, static_cast<id_t>(pid_), &end, kHow) == 0 && end.si_pid == pid_;
}

void* make_shared_memory(std::size_t size) {
  void* const memory =
      ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw SystemError("map shared memory", errno);
  return memory;
}

}  // namespace trifinger::benchmarks
