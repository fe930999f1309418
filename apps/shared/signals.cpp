// SPDX-License-Identifier: BSD-3-Clause
#include "shared/signals.hpp"

#include <unistd.h>

#include <cstdlib>

namespace trifinger::apps {
namespace {

constexpr int kNotification = SIGUSR1;

}  // namespace

Signals::Signals() {
  sigemptyset(&set_);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, kNotification}) sigaddset(&set_, signal);
  pthread_sigmask(SIG_BLOCK, &set_, nullptr);
}

std::optional<int> Signals::wait(Nanoseconds timeout) const {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(timeout);
  const timespec time{.tv_sec = seconds.count(), .tv_nsec = (timeout - seconds).count()};
  const int signal = ::sigtimedwait(&set_, nullptr, &time);
  if (signal <= 0 || signal == kNotification) return std::nullopt;
  return signal;
}

void Signals::notify() noexcept { ::kill(::getpid(), kNotification); }

void Signals::die_of(int signal) {
  sigset_t only;
  sigemptyset(&only);
  sigaddset(&only, signal);
  std::signal(signal, SIG_DFL);
  pthread_sigmask(SIG_UNBLOCK, &only, nullptr);
  ::raise(signal);
  std::_Exit(kNotification);  // never reached: by default, all these signals end the process
}

}  // namespace trifinger::apps
