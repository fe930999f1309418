// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/emulator.hpp"

#include <asm/termbits.h>  // not <termios.h>: the rate that the host has set needs the kernel's struct
#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::dynamixel {
namespace {

// Motors and plant move on at least this often, so that no call has much to catch up with.
constexpr Nanoseconds kLongestSleep = std::chrono::milliseconds(5);

// An emulator has locked this file: `Lock::kClaim` as long as it lives, `Lock::kOwner` as long as
// the link leads to its terminal.
std::string lock_of(const std::string& link) { return link + ".lock"; }

}  // namespace

struct Emulator::State {
  State(const std::vector<EmulatedMotorOptions>& motors, Plant& plant,
        const EmulatedBusOptions& options)
      : bus(motors, plant, std::chrono::steady_clock::now(), options) {}

  void open();
  void make_link(const std::string& name);
  void run();
  void apply_changes();
  [[nodiscard]] int baud_of_host() const noexcept;

  EmulatedBus bus;  // used by the thread only
  ipc::FileDescriptor master;
  // The terminal stays as it is while no host has it open.
  ipc::FileDescriptor terminal;
  ipc::FileDescriptor bell;
  std::string path;
  std::string link;
  ipc::FileDescriptor link_lock;
  std::mutex mutex;
  std::vector<std::packaged_task<void()>> changes;  // guarded by mutex
  bool shall_end{false};                            // guarded by mutex
  std::jthread thread;                              // the last member: it uses all others
};

void Emulator::State::open() {
  const char* const doing = "make a pseudo-terminal for emulated motors";
  master = ipc::FileDescriptor(
      [] { return ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC); });
  std::array<char, 64> name{};
  if (!master || ::grantpt(master.get()) != 0 || ::unlockpt(master.get()) != 0 ||
      ::ptsname_r(master.get(), name.data(), name.size()) != 0) {
    throw SystemError(doing, errno);
  }
  path = name.data();
  terminal =
      ipc::FileDescriptor([this] { return ::open(path.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC); });
  bell = ipc::FileDescriptor([] { return ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC); });
  termios2 settings{};
  if (!terminal || !bell || ::ioctl(terminal.get(), TCGETS2, &settings) != 0) {
    throw SystemError(doing, errno);
  }
  // Raw, so that nothing is echoed before a host opens it.
  settings.c_iflag = settings.c_oflag = settings.c_lflag = 0;
  if (::ioctl(terminal.get(), TCSETS2, &settings) != 0) throw SystemError(doing, errno);
}

void Emulator::State::make_link(const std::string& name) {
  if (name.empty()) return;
  const ipc::LockTimeout timeout;
  while (true) {
    link_lock = ipc::open_lock_file(lock_of(name));
    if (ipc::try_lock(link_lock, ipc::Lock::kClaim) && ipc::is_named(link_lock, lock_of(name))) {
      break;
    }
    if (timeout.wait(false)) continue;
    throw InvalidArgument("the link " + name +
                          " belongs to motors that are emulated already; end that emulator, or "
                          "choose another name");
  }
  std::error_code error;
  if (std::filesystem::is_symlink(name)) std::filesystem::remove(name, error);
  std::filesystem::create_symlink(path, name, error);
  if (error) {
    ipc::leave_lock_file(link_lock, lock_of(name));
    throw SystemError("make the link " + name + " to " + path + "; choose another name",
                      error.value());
  }
  link = name;
  static_cast<void>(ipc::try_lock(link_lock));
}

// The rate that the host has set at its end.
int Emulator::State::baud_of_host() const noexcept {
  termios2 settings{};
  if (::ioctl(terminal.get(), TCGETS2, &settings) != 0) return 1;
  return std::max(static_cast<int>(settings.c_ospeed), 1);
}

void Emulator::State::apply_changes() {
  std::uint64_t rings = 0;
  static_cast<void>(::read(bell.get(), &rings, sizeof(rings)));
  std::vector<std::packaged_task<void()>> tasks;
  {
    const std::lock_guard lock(mutex);
    tasks.swap(changes);
  }
  for (auto& task : tasks) task();
}

void Emulator::State::run() {
  // Sleeps end in time, not up to 50 µs later.
  static_cast<void>(::prctl(PR_SET_TIMERSLACK, 1UL));
  std::array<std::uint8_t, 4096> bytes{};
  while (true) {
    {
      const std::lock_guard lock(mutex);
      if (shall_end) return;
    }
    Instant now = std::chrono::steady_clock::now();
    const Instant wake = std::min(bus.next_arrival().value_or(Instant::max()), now + kLongestSleep);
    const Nanoseconds left = std::max(Nanoseconds(wake - now), Nanoseconds::zero());
    const timespec time{.tv_sec = 0, .tv_nsec = left.count()};
    std::array<pollfd, 2> files{{{.fd = master.get(), .events = POLLIN, .revents = 0},
                                 {.fd = bell.get(), .events = POLLIN, .revents = 0}}};
    static_cast<void>(::ppoll(files.data(), files.size(), &time, nullptr));
    now = std::chrono::steady_clock::now();
    if (files[1].revents != 0) apply_changes();
    if ((files[0].revents & POLLIN) != 0) {
      const ssize_t received = ::read(master.get(), bytes.data(), bytes.size());
      if (received > 0) {
        bus.write(std::span(bytes).first(static_cast<std::size_t>(received)), now, baud_of_host());
      }
    }
    bus.advance(now);
    const std::size_t count = bus.read(bytes, now);
    // If nobody reads, the terminal is full one day, and the bytes are lost as on a line.
    if (count > 0) static_cast<void>(::write(master.get(), bytes.data(), count));
  }
}

Emulator::Emulator(const std::vector<EmulatedMotorOptions>& motors, Plant& plant,
                   const EmulatedBusOptions& options, const std::string& link)
    : state_(std::make_unique<State>(motors, plant, options)) {
  state_->open();
  state_->make_link(link);
  state_->thread = std::jthread([state = state_.get()] { state->run(); });
}

Emulator::~Emulator() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->shall_end = true;
  }
  const std::uint64_t one = 1;
  static_cast<void>(::write(state_->bell.get(), &one, sizeof(one)));
  state_->thread.join();
  if (state_->link.empty()) return;
  ipc::unlock(state_->link_lock);
  std::error_code ignored;
  if (std::filesystem::read_symlink(state_->link, ignored) == state_->path) {
    std::filesystem::remove(state_->link, ignored);
  }
  ipc::leave_lock_file(state_->link_lock, lock_of(state_->link));
}

bool Emulator::is_at(const std::string& link) {
  try {
    return ipc::is_locked_by_other(ipc::FileDescriptor(
        [&link] { return open_regular_file(lock_of(link), O_RDONLY, NamedBy::kProgram); }));
  } catch (const SystemError& error) {
    if (error.error_number() == ENOENT) return false;
    throw;
  }
}

const std::string& Emulator::path() const noexcept { return state_->path; }

void Emulator::change(const std::function<void(EmulatedBus&)>& change) {
  std::packaged_task<void()> task([this, &change] { change(state_->bus); });
  auto done = task.get_future();
  {
    const std::lock_guard lock(state_->mutex);
    state_->changes.push_back(std::move(task));
  }
  const std::uint64_t one = 1;
  static_cast<void>(::write(state_->bell.get(), &one, sizeof(one)));
  done.get();
}

}  // namespace trifinger::dynamixel
