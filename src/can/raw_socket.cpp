// SPDX-License-Identifier: BSD-3-Clause
#include "raw_socket.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <utility>

#include "arrival_time.hpp"
#include "error_frame.hpp"

namespace trifinger::can {
namespace {

SendResult refused(std::size_t sent, int error) noexcept {
  switch (error) {
    case EAGAIN:   // the socket's own queue is full
    case ENOBUFS:  // the interface's queue is full
      return {.sent = sent, .refusal = Refusal::kQueueFull};
    case ENETDOWN:
      return {.sent = sent, .refusal = Refusal::kDown};
    case ENODEV:
    case ENXIO:  // the socket has lost its interface
      return {.sent = sent, .refusal = Refusal::kGone};
    default:
      return {.sent = sent, .refusal = Refusal::kFailed, .error_number = error};
  }
}

}  // namespace

RawSocket::RawSocket(ipc::FileDescriptor socket, std::string interface, SocketCalls& calls)
    : socket_(std::move(socket)),
      interface_(std::move(interface)),
      calls_(calls),
      empty_(std::chrono::steady_clock::now()) {}

std::size_t RawSocket::do_receive(std::span<Frame> budget) noexcept {
  std::size_t count = 0;
  // Error frames use the budget, too: a broken bus can send thousands of them.
  std::size_t left = budget.size();
  while (left > 0) {
    const Instant before = std::chrono::steady_clock::now();
    const std::size_t wanted = std::min(left, kBatchSize);
    const int result = incoming_.receive(calls_, socket_.get(), wanted);
    if (result < 0 && result != -EAGAIN) {
      // The kernel reports such an error once, before messages that still wait.
      note_error(-result);
      --left;
      continue;
    }
    const auto messages = static_cast<std::size_t>(std::max(result, 0));
    const ClockPair now = ClockPair::now();
    for (std::size_t i = 0; i < messages; ++i) {
      if (const auto frame = take(incoming_[i], now)) budget[count++] = *frame;
    }
    left -= messages;
    if (messages < wanted) {
      empty_ = before;
      const bool is_silent = left == budget.size();
      const bool seems_up = state_.link == Link::kUp || state_.link == Link::kPassive;
      if (is_silent && seems_up && !is_running()) note_down();
      return count;
    }
  }
  if (!budget.empty()) ++state_.overloads;
  return count;
}

std::optional<Frame> RawSocket::take(const Incoming& message, const ClockPair& now) noexcept {
  if (message.size != CAN_MTU) {
    ++state_.invalid;
    return std::nullopt;
  }
  if (message.overflow) {
    state_.lost += *message.overflow - overflow_;  // modulo 2^32, as the kernel counts
    overflow_ = *message.overflow;
  }
  if ((message.packet.frame.can_id & CAN_ERR_FLAG) != 0) {
    note_error_frame(message.packet.frame, state_);
    return std::nullopt;
  }
  const Instant time = arrival_time(message.stamp.value_or(now.wall), now, empty_);
  const auto frame = from_wire(message.packet.frame, time);
  if (!frame) {
    ++state_.invalid;
    return std::nullopt;
  }
  // Frames that arrived before the interface went down may be read after that.
  if (state_.link == Link::kBusOff || (state_.link == Link::kDown && time > down_)) {
    state_.link = Link::kUp;
  }
  return frame;
}

SendResult RawSocket::do_send(std::span<const Frame> frames) noexcept {
  if (state_.link == Link::kGone) return {.refusal = Refusal::kGone};
  // The kernel drops what is sent in this state, and reports success.
  if (state_.link == Link::kBusOff) return {.refusal = Refusal::kBusOff};
  std::size_t sent = 0;
  while (sent < frames.size()) {
    const std::size_t count = outgoing_.fill(frames.subspan(sent));
    int error = 0;
    const std::size_t now_sent = outgoing_.send(calls_, socket_.get(), error);
    sent += now_sent;
    if (now_sent > 0 && state_.link == Link::kDown && is_running()) state_.link = Link::kUp;
    if (now_sent < count) {
      note_error(error);
      return refused(sent, error);
    }
  }
  return {.sent = sent};
}

void RawSocket::note_error(int error) noexcept {
  switch (refused(0, error).refusal) {
    case Refusal::kDown:
      note_down();
      break;
    case Refusal::kGone:
      state_.link = Link::kGone;
      break;
    default:
      break;
  }
}

void RawSocket::note_down() noexcept {
  state_.link = Link::kDown;
  down_ = std::chrono::steady_clock::now();
}

// While an interface goes down, the kernel drops all frames for some milliseconds and still reports
// that they were sent. Only then does it tell its sockets.
bool RawSocket::is_running() noexcept { return calls_.is_running(socket_.get(), interface_); }

}  // namespace trifinger::can
