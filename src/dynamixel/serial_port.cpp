// SPDX-License-Identifier: BSD-3-Clause
#include <asm/termbits.h>  // not <termios.h>: any baud rate needs the kernel's own struct
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <thread>
#include <utility>

#include "dynamixel/emulator.hpp"
#include "dynamixel/port.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {
namespace {

int open_device(const std::string& path) noexcept {
  return ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
}

std::string_view remedy_of(int error) {
  switch (error) {
    case EACCES:
      return "; put this user into the group 'dialout' ('sudo usermod -aG dialout $USER') and log "
             "in again";
    case ENOENT:
      return "; check the adapter's plug, and 'ls /dev/serial/by-id' for its name";
    case EBUSY:
      return "; another program has it, end that first";
    default:
      return "";
  }
}

}  // namespace

SerialPort::SerialPort(const std::string& path, const SerialOptions& options)
    : path_(path), options_(options) {
  trifinger::detail::require(options.baud >= 300 && options.baud <= 20'000'000,
                             "the baud rate of " + path + " is " + std::to_string(options.baud) +
                                 ", must be 300 to 20000000");
  open();
}

void SerialPort::open() {
  close();
  ipc::FileDescriptor device([this] { return open_device(path_); });
  const int error = errno;
  // Opening comes first: as long as an emulator lives, no other terminal gets the name of its own.
  if (options_.is_emulated && !Emulator::is_at(path_)) {
    throw InvalidArgument("no motors are emulated at " + path_ +
                          "; start them with 'trifinger emulate' in another terminal");
  }
  if (!device) {
    throw SystemError("open the serial device " + path_ + std::string(remedy_of(error)), error);
  }
  device_ = std::move(device);
  try {
    set_up();
  } catch (...) {
    close();
    throw;
  }
}

// A device that is kept open would have another name when it is plugged in again.
void SerialPort::close() noexcept {
  if (!device_) return;
  static_cast<void>(::ioctl(device_.get(), TIOCNXCL));
  device_ = ipc::FileDescriptor();
}

void SerialPort::set_up() {
  termios2 settings{};
  if (::ioctl(device_.get(), TCGETS2, &settings) != 0) {
    throw InvalidArgument(path_ + " is no serial device; choose one of 'ls /dev/serial/by-id'");
  }
  // The lock keeps out programs that lock, TIOCEXCL all others.
  if (::flock(device_.get(), LOCK_EX | LOCK_NB) != 0) {
    throw SystemError("open the serial device " + path_ + std::string(remedy_of(EBUSY)), EBUSY);
  }
  static_cast<void>(::ioctl(device_.get(), TIOCEXCL));

  settings.c_iflag = 0;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  settings.c_ispeed = static_cast<speed_t>(options_.baud);
  settings.c_ospeed = static_cast<speed_t>(options_.baud);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  if (::ioctl(device_.get(), TCSETS2, &settings) != 0) {
    throw SystemError("set " + path_ + " to " + std::to_string(options_.baud) + " baud", errno);
  }
  // A driver takes the nearest rate that it can make, and says which.
  if (::ioctl(device_.get(), TCGETS2, &settings) == 0) {
    const auto made = static_cast<double>(settings.c_ospeed);
    const double wanted = options_.baud;
    if (made < 0.97 * wanted || made > 1.03 * wanted) {
      throw InvalidArgument(path_ + " cannot make " + std::to_string(options_.baud) +
                            " baud, the nearest rate is " + std::to_string(settings.c_ospeed) +
                            "; choose a rate of the adapter");
    }
  }
  static_cast<void>(::ioctl(device_.get(), TCFLSH, TCIOFLUSH));
  warnings_.clear();
  if (options_.low_latency) lower_latency();
}

SerialPort::~SerialPort() { close(); }

void SerialPort::lower_latency() {
  serial_struct serial{};
  if (::ioctl(device_.get(), TIOCGSERIAL, &serial) != 0) {
    // Pseudo-terminals and some adapters have no such setting, and no timer either.
    const bool has_none = errno == ENOTTY || errno == EINVAL || errno == EOPNOTSUPP;
    if (!has_none) warnings_.push_back("the latency of " + path_ + " cannot be read");
    return;
  }
  serial.flags = static_cast<int>(static_cast<unsigned>(serial.flags) | ASYNC_LOW_LATENCY);
  if (::ioctl(device_.get(), TIOCSSERIAL, &serial) == 0) return;
  std::error_code ignored;
  const std::string name = std::filesystem::weakly_canonical(path_, ignored).filename().string();
  warnings_.push_back("the adapter of " + path_ +
                      " may hold bytes back for 16 ms; as root: echo 1 > "
                      "/sys/bus/usb-serial/devices/" +
                      name + "/latency_timer");
}

bool SerialPort::wait_for(short events, Instant deadline) noexcept {
  while (is_open()) {
    const Nanoseconds left = std::max(Nanoseconds(deadline - now()), Nanoseconds::zero());
    timespec time{.tv_sec = left.count() / 1'000'000'000, .tv_nsec = left.count() % 1'000'000'000};
    pollfd device{.fd = device_.get(), .events = events, .revents = 0};
    const int ready = ::ppoll(&device, 1, &time, nullptr);
    if (ready > 0) {
      // A line that was hung up can be read for ever, and gives nothing.
      if ((device.revents & (POLLHUP | POLLERR | POLLNVAL)) == 0) return true;
      close();
    } else if (ready == 0) {
      return false;
    } else if (errno != EINTR) {
      close();
    }
  }
  return false;
}

bool SerialPort::write(std::span<const std::uint8_t> bytes, Instant deadline) noexcept {
  while (!bytes.empty() && is_open()) {
    const ssize_t written = ::write(device_.get(), bytes.data(), bytes.size());
    if (written > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    } else if (written == 0 || errno == EAGAIN) {
      if (!wait_for(POLLOUT, deadline)) return false;
    } else if (errno != EINTR) {
      close();
    }
  }
  return bytes.empty();
}

std::size_t SerialPort::read(std::span<std::uint8_t> bytes, Instant deadline) noexcept {
  while (is_open()) {
    const ssize_t received = ::read(device_.get(), bytes.data(), bytes.size());
    if (received > 0) return static_cast<std::size_t>(received);
    // With VMIN 0, nothing to read is 0 bytes; so is a line that has been hung up, which poll
    // tells.
    if (received < 0 && errno != EAGAIN && errno != EINTR) {
      close();
    } else if (!wait_for(POLLIN, deadline)) {
      return 0;
    }
  }
  return 0;
}

void SerialPort::sleep_until(Instant instant) noexcept {
  while (now() < instant) std::this_thread::sleep_until(instant);
}

}  // namespace trifinger::dynamixel
