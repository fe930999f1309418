// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/ranges.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "commands.hpp"
#include "realtime/limit_remedy.hpp"
#include "robot/doctor_cameras.hpp"
#include "robot/doctor_can.hpp"
#include "robot/finding.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/terminal.hpp"
#include "sim/boards_config.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

struct DoctorOptions {
  std::optional<std::string> robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  std::optional<std::string> root;
  bool json{false};
};

// The machine, as the kernel shows it in /proc and /sys.
class Machine {
 public:
  explicit Machine(std::filesystem::path root) : root_(std::move(root)) {}

  // Returns the file without the newline at its end; nothing if it cannot be read.
  [[nodiscard]] std::optional<std::string> read(const std::string& path) const {
    std::ifstream file(root_ / path);
    if (!file) return std::nullopt;
    std::string text{std::istreambuf_iterator<char>(file), {}};
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text;
  }

  // Returns the rest of the first line that begins with `start`.
  [[nodiscard]] std::optional<std::string> read_line(const std::string& path,
                                                     const std::string& start) const {
    std::istringstream lines(read(path).value_or(""));
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with(start)) return line.substr(start.size());
    }
    return std::nullopt;
  }

  [[nodiscard]] std::filesystem::path path(const std::string& path) const { return root_ / path; }

 private:
  std::filesystem::path root_;
};

// Parses a list of numbers as the kernel writes it: "0-2,5".
std::set<int> parse_list(const std::string& list) {
  std::set<int> numbers;
  std::istringstream ranges(list);
  for (std::string range; std::getline(ranges, range, ',');) {
    std::istringstream ends(range);
    int first = 0;
    if (!(ends >> first)) continue;
    int last = first;
    if (char dash = 0; ends >> dash) ends >> last;
    for (int number = first; number <= last; ++number) numbers.insert(number);
  }
  return numbers;
}

constexpr const char* kIsolated = "sys/devices/system/cpu/isolated";

// Capabilities override limits. The bits are defined in linux/capability.h.
constexpr unsigned kIpcLock = 14;
constexpr unsigned kSysNice = 23;

bool has_capability(const Machine& machine, unsigned bit) {
  const std::string text = machine.read_line("proc/self/status", "CapEff:").value_or("0");
  return (std::strtoull(text.c_str(), nullptr, 16) >> bit & 1U) != 0;
}

// Returns the soft limit of this process: a number or "unlimited".
std::string soft_limit(const Machine& machine, const std::string& name) {
  std::istringstream values(machine.read_line("proc/self/limits", name).value_or("0"));
  std::string soft;
  values >> soft;
  return soft;
}

Finding check_kernel(const Machine& machine) {
  const std::string version = machine.read("proc/version").value_or("unknown");
  const std::string release = machine.read("proc/sys/kernel/osrelease").value_or("unknown");
  constexpr const char* kRemedy =
      "install a kernel with PREEMPT_RT: Debian's package linux-image-rt-amd64";
  if (machine.read("sys/kernel/realtime") == "1" ||
      version.find("PREEMPT_RT") != std::string::npos) {
    return {"kernel", Verdict::kGood, release + ", PREEMPT_RT", ""};
  }
  if (version.find("PREEMPT") != std::string::npos) {
    return {"kernel", Verdict::kNote, release + ", PREEMPT without RT", kRemedy};
  }
  return {"kernel", Verdict::kFails, release + ", not preemptible", kRemedy};
}

Finding check_priority(const Machine& machine) {
  if (has_capability(machine, kSysNice)) {
    return {"real-time priority", Verdict::kGood, "allowed: CAP_SYS_NICE", ""};
  }
  const std::string limit = soft_limit(machine, "Max realtime priority");
  // The loop has priority 80, and its watchdog one more.
  constexpr int kWanted = 81;
  const bool is_enough = limit == "unlimited" || std::strtol(limit.c_str(), nullptr, 10) >= kWanted;
  return {"real-time priority", is_enough ? Verdict::kGood : Verdict::kFails,
          fmt::format("limit {}, {} is wanted", limit, kWanted),
          is_enough ? "" : remedy_for(RealtimeLimit::kPriority, machine.path(""))};
}

Finding check_locked_memory(const Machine& machine) {
  if (has_capability(machine, kIpcLock)) {
    return {"locked memory", Verdict::kGood, "allowed: CAP_IPC_LOCK", ""};
  }
  const std::string limit = soft_limit(machine, "Max locked memory");
  const bool is_enough = limit == "unlimited";
  return {"locked memory", is_enough ? Verdict::kGood : Verdict::kFails,
          is_enough ? "unlimited" : "limit " + limit + " bytes, unlimited is wanted",
          is_enough ? "" : remedy_for(RealtimeLimit::kLockedMemory, machine.path(""))};
}

Finding check_governor(const Machine& machine) {
  std::set<std::string> governors;
  std::error_code ignored;
  for (const auto& entry :
       std::filesystem::directory_iterator(machine.path("sys/devices/system/cpu"), ignored)) {
    const std::string cpu = "sys/devices/system/cpu/" + entry.path().filename().string();
    if (const auto governor = machine.read(cpu + "/cpufreq/scaling_governor")) {
      governors.insert(*governor);
    }
  }
  if (governors.empty()) {
    return {"frequency governor", Verdict::kGood, "none: the frequency is not ours to change", ""};
  }
  const bool is_fast = governors == std::set<std::string>{"performance"};
  return {"frequency governor", is_fast ? Verdict::kGood : Verdict::kFails,
          fmt::format("{}", fmt::join(governors, ", ")),
          is_fast ? "" : "cpupower frequency-set --governor performance"};
}

Finding check_isolated_processors(const Machine& machine) {
  const std::string isolated = machine.read(kIsolated).value_or("");
  if (!isolated.empty()) return {"isolated processors", Verdict::kGood, isolated, ""};
  return {"isolated processors", Verdict::kNote, "none",
          "boot with isolcpus=N nohz_full=N rcu_nocbs=N and run with --cpu N: other programs then "
          "leave the loop alone"};
}

bool has_process(const Machine& machine, const std::string& name) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(machine.path("proc"), ignored)) {
    const std::string process = entry.path().filename().string();
    const bool is_number = std::ranges::all_of(
        process, [](char digit) { return std::isdigit(static_cast<unsigned char>(digit)) != 0; });
    if (is_number && machine.read("proc/" + process + "/comm") == name) return true;
  }
  return false;
}

Finding check_interrupts(const Machine& machine) {
  const std::string isolated = machine.read(kIsolated).value_or("");
  const std::set<int> quiet = parse_list(isolated);
  if (quiet.empty()) {
    return {"interrupts", Verdict::kGood, "anywhere: no processor is isolated", ""};
  }
  std::size_t total = 0;
  std::size_t disturbing = 0;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(machine.path("proc/irq"), ignored)) {
    const std::string interrupt = "proc/irq/" + entry.path().filename().string();
    // The kernel may have left out some of the processors that were asked for.
    auto allowed = machine.read(interrupt + "/effective_affinity_list");
    if (!allowed || allowed->empty()) allowed = machine.read(interrupt + "/smp_affinity_list");
    if (!allowed) continue;
    ++total;
    const std::set<int> cpus = parse_list(*allowed);
    disturbing += std::ranges::any_of(cpus, [&](int cpu) { return quiet.contains(cpu); }) ? 1U : 0U;
  }
  if (disturbing > 0) {
    return {"interrupts", Verdict::kNote,
            fmt::format("{} of {} are allowed on the isolated processor {}", disturbing, total,
                        isolated),
            "boot with irqaffinity=M, M being the other processors, or write M to "
            "/proc/irq/*/smp_affinity_list"};
  }
  if (has_process(machine, "irqbalance")) {
    return {"interrupts", Verdict::kNote, "irqbalance moves them about",
            "systemctl disable --now irqbalance, or set IRQBALANCE_BANNED_CPULIST=" + isolated +
                " in /etc/default/irqbalance"};
  }
  return {"interrupts", Verdict::kGood, "none on the isolated processor " + isolated, ""};
}

Finding check_throttling(const Machine& machine) {
  const std::string runtime =
      machine.read("proc/sys/kernel/sched_rt_runtime_us").value_or("unknown");
  if (runtime == "-1") return {"real-time throttling", Verdict::kGood, "off", ""};
  constexpr const char* kRemedy = "sysctl kernel.sched_rt_runtime_us=-1";
  const double period =
      std::strtod(machine.read("proc/sys/kernel/sched_rt_period_us").value_or("").c_str(), nullptr);
  const double share = period > 0.0 ? 100.0 * std::strtod(runtime.c_str(), nullptr) / period : 0.0;
  // The kernel's default. Other real-time programs decide whether the limit is ever reached.
  constexpr double kUsual = 95.0;
  return {"real-time throttling", share >= kUsual ? Verdict::kNote : Verdict::kFails,
          fmt::format("at {:.0f} % of a processor all real-time threads on it are stopped", share),
          kRemedy};
}

Finding check_sleep(const Machine& machine) {
  constexpr const char* kFile = "dev/cpu_dma_latency";
  const std::filesystem::path file = machine.path(kFile);
  if (::access(file.c_str(), W_OK) == 0) {
    return {"processor sleep", Verdict::kGood, "can be kept light while a robot runs", ""};
  }
  if (::access(file.c_str(), F_OK) != 0) {
    return {"processor sleep", Verdict::kNote, "cannot be kept light: no /dev/cpu_dma_latency",
            "in a container: --device /dev/cpu_dma_latency; otherwise boot with "
            "processor.max_cstate=1 intel_idle.max_cstate=0"};
  }
  return {"processor sleep", Verdict::kNote, "may be deep: no access to /dev/cpu_dma_latency",
          "add the udev rule KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\" in "
          "/etc/udev/rules.d/99-realtime.rules and restart"};
}

Finding check_clock(const Machine& machine) {
  const std::string clock =
      machine.read("sys/devices/system/clocksource/clocksource0/current_clocksource")
          .value_or("unknown");
  // These clocks are read without a system call.
  const std::set<std::string> fast{"tsc", "kvm-clock", "hyperv_clocksource_tsc_page",
                                   "arch_sys_counter"};
  if (fast.contains(clock)) return {"clock source", Verdict::kGood, clock, ""};
  return {"clock source", Verdict::kNote, clock + ", slow to read",
          "see why the kernel rejects the TSC: dmesg | grep -i tsc; 'tsc=reliable' at boot insists "
          "on it"};
}

Finding check_shared_memory(const Machine& machine) {
  struct statvfs file_system{};
  if (::statvfs(machine.path("dev/shm").c_str(), &file_system) != 0) {
    return {"/dev/shm", Verdict::kFails, "missing", "mount -t tmpfs tmpfs /dev/shm"};
  }
  constexpr std::uint64_t kWanted = 64;  // [MiB]: a few robots with the default history
  const std::uint64_t free = file_system.f_bavail * file_system.f_frsize >> 20U;
  const bool is_enough = free >= kWanted;
  return {"/dev/shm", is_enough ? Verdict::kGood : Verdict::kFails,
          fmt::format("{} MiB free, {} MiB are wanted", free, kWanted),
          is_enough
              ? ""
              : "mount -o remount,size=256M /dev/shm (in a container: --shm-size=256m), or set "
                "TRIFINGER_SESSION_DIR to another tmpfs"};
}

Finding check_protected_files(const Machine& machine) {
  const std::string value = machine.read("proc/sys/fs/protected_regular").value_or("unknown");
  if (value == "1" || value == "2") return {"fs.protected_regular", Verdict::kGood, value, ""};
  return {"fs.protected_regular", Verdict::kNote, value,
          "sysctl fs.protected_regular=2: others then cannot lay files in a session's place"};
}

Finding check_steal(const Machine& machine) {
  // user nice system idle iowait irq softirq steal, in ticks since boot
  std::istringstream fields(machine.read_line("proc/stat", "cpu ").value_or(""));
  const std::vector<double> times{std::istream_iterator<double>(fields), {}};
  constexpr std::size_t kSteal = 7;
  if (times.size() <= kSteal) return {"stolen time", Verdict::kGood, "not counted", ""};
  double sum = 0;
  for (std::size_t i = 0; i <= kSteal; ++i) sum += times[i];
  const double percent = sum > 0 ? 100 * times[kSteal] / sum : 0;
  const std::string found = fmt::format("{:.2f} % since boot", percent);
  constexpr const char* kRemedy =
      "the hypervisor gives this machine's processors to others: pin them there, or use a machine "
      "of your own";
  if (percent >= 1.0) return {"stolen time", Verdict::kFails, found, kRemedy};
  if (percent >= 0.01) return {"stolen time", Verdict::kNote, found, kRemedy};
  return {"stolen time", Verdict::kGood, found, ""};
}

const char* word_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kGood:
      return "ok";
    case Verdict::kNote:
      return "note";
    case Verdict::kFails:
      break;
  }
  return "fails";
}

std::vector<Finding> examine(const DoctorOptions& options) {
  const Machine machine(options.root.value_or("/"));
  std::vector<Finding> findings{
      check_kernel(machine),     check_priority(machine),      check_locked_memory(machine),
      check_governor(machine),   check_sleep(machine),         check_isolated_processors(machine),
      check_interrupts(machine), check_throttling(machine),    check_clock(machine),
      check_steal(machine),      check_shared_memory(machine), check_protected_files(machine)};
  std::vector<Finding> of_can;
  if (options.robot) {
    const RobotConfig config = load_robot_config(*options.robot, options.overrides);
    if (config.boards) {
      of_can = examine_boards(*config.boards, *options.robot, options.name.value_or(config.name));
    }
  } else if (!options.root) {
    // A copy of files does not have what the kernel knows of interfaces.
    of_can = examine_can_interfaces();
  }
  std::ranges::move(of_can, std::back_inserter(findings));
  return findings;
}

int print_findings(const std::vector<Finding>& findings) {
  const auto fails = [](const Finding& one) { return one.verdict == Verdict::kFails; };
  const bool is_ready = std::ranges::none_of(findings, fails);
  print_json(
      Json::object({{"is_ready", is_ready}, {"findings", list_of(findings, [](const Finding& one) {
                                               return Json{{"what", one.what},
                                                           {"verdict", word_of(one.verdict)},
                                                           {"found", one.found},
                                                           {"remedy", one.remedy}};
                                             })}}));
  return is_ready ? kDone : kFailed;
}

// Returns how many fail.
std::size_t print_table(const std::vector<Finding>& findings) {
  const Terminal terminal;
  const std::size_t width = terminal.width();
  constexpr std::size_t kIndent = 29;
  const std::size_t room = std::max<std::size_t>(width - std::min(width, kIndent), 20);
  std::size_t failing = 0;
  for (const Finding& finding : findings) {
    failing += finding.verdict == Verdict::kFails ? 1 : 0;
    const Style style = finding.verdict == Verdict::kGood   ? Style::kGood
                        : finding.verdict == Verdict::kNote ? Style::kWarning
                                                            : Style::kBad;
    fmt::print("{}  {}\n", terminal.paint(pad(word_of(finding.verdict), 5), style),
               terminal.paint(pad(finding.what, kIndent - 7) + finding.found, Style::kPlain));
    if (finding.remedy.empty()) continue;
    const std::string indent(kIndent, ' ');
    for (const std::string& line : hang(indent, finding.remedy, room, terminal, Style::kDim)) {
      fmt::print("{}\n", line);
    }
  }
  return failing;
}

int doctor(const DoctorOptions& options) {
  const std::vector<Finding> findings = examine(options);
  if (options.json) return print_findings(findings);
  const std::size_t failing = print_table(findings);
  const std::string purpose = options.robot ? *options.robot : "real time";
  if (failing == 0) {
    print_safely("\nThis machine has what {} needs.\n", purpose);
    return kDone;
  }
  print_safely("\nThis machine fails {} of {} checks for {}; simulation works without.\n", failing,
               findings.size(), purpose);
  return kFailed;
}

struct DoctorCamerasOptions {
  std::string robot;
  bool json{false};
};

int doctor_cameras(const DoctorCamerasOptions& options) {
  const std::vector<Finding> findings = examine_cameras(options.robot);
  if (options.json) return print_findings(findings);
  return print_table(findings) == 0 ? kDone : kFailed;
}

void add_doctor_cameras(CLI::App& parent, Action& action) {
  const auto& [command, options] = add_command(
      parent, action, "cameras",
      "Check by a robot's objects whether the images of its cameras fit together", doctor_cameras);
  add_robot(command, options.robot, "Name of a running robot that has cameras and objects");
  add_json(command, options.json);
  command.footer(
      "Lay the object where all cameras see it, away from the fingers. Says which cameras are\n"
      "exchanged, whether images are mirrored, upside down, old or have red and blue exchanged,\n"
      "and whether the object has another size or other colours than its configuration says.\n"
      "Exit code 0 if nothing is wrong, 1 otherwise.\n"
      "Example:\n"
      "  trifinger doctor cameras trifinger-pro-3");
}

}  // namespace

void add_doctor(CLI::App& program, Action& action) {
  const auto& [command, options] = add_command(
      program, action, "doctor",
      "Check whether this machine is ready for real time and for a robot, with the remedies",
      doctor);
  CLI::Option* const robot = add_configured_robot(
      command, options,
      "A configuration, by name or file: judge its CAN interfaces, too, and listen whether its "
      "motor boards answer",
      "boards.bus=socketcan");
  for (const char* const name : {"--name", "--set"}) command.get_option(name)->needs(robot);
  add_json(command, options.json);
  command
      .add_option("--root", options.root,
                  "Look at the copy of another machine's /proc, /sys and /dev in this folder")
      ->check(CLI::ExistingDirectory)
      ->option_text("FOLDER")
      ->excludes(robot);
  command.footer(
      "Without ROBOT, every CAN interface of this machine is judged by what motor boards need, as "
      "a\n"
      "note. Nothing is sent and nothing is changed, so a robot may run meanwhile.\n"
      "Exit code 0 if no check fails, 1 otherwise. Notes do not count.\n"
      "Example:\n"
      "  trifinger doctor\n"
      "  trifinger doctor trifinger_edu_can\n"
      "  trifinger doctor cameras trifinger-pro-3");
  add_doctor_cameras(command, action);
}

}  // namespace trifinger::apps
