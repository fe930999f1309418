// SPDX-License-Identifier: BSD-3-Clause
#include "messages.hpp"

#include <net/if.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>

namespace trifinger::can {
namespace {

// Repeats a system call that a signal interrupted.
template <class Call>
int uninterrupted(const Call& call) noexcept {
  while (true) {
    const int result = call();
    if (result >= 0) return result;
    if (errno != EINTR) return -errno;
  }
}

template <class T>
T value_of(const cmsghdr& control) noexcept {
  T value{};
  std::memcpy(&value, CMSG_DATA(&control), sizeof(value));
  return value;
}

// Points each header at its packet.
void connect(std::vector<Packet>& packets, std::vector<iovec>& parts, std::vector<mmsghdr>& headers,
             std::size_t size) {
  packets.resize(kBatchSize);
  parts.resize(kBatchSize);
  headers.resize(kBatchSize);
  for (std::size_t i = 0; i < kBatchSize; ++i) {
    parts[i] = {.iov_base = &packets[i], .iov_len = size};
    headers[i].msg_hdr.msg_iov = &parts[i];
    headers[i].msg_hdr.msg_iovlen = 1;
  }
}

}  // namespace

int SocketCalls::receive(int socket, std::span<mmsghdr> messages) noexcept {
  return uninterrupted([&] {
    return ::recvmmsg(socket, messages.data(), static_cast<unsigned>(messages.size()), MSG_DONTWAIT,
                      nullptr);
  });
}

int SocketCalls::send(int socket, std::span<mmsghdr> messages) noexcept {
  return uninterrupted([&] {
    return ::sendmmsg(socket, messages.data(), static_cast<unsigned>(messages.size()),
                      MSG_DONTWAIT | MSG_NOSIGNAL);
  });
}

bool SocketCalls::is_running(int socket, const std::string& interface) noexcept {
  ifreq request{};
  interface.copy(static_cast<char*>(request.ifr_name), IFNAMSIZ - 1);
  if (::ioctl(socket, SIOCGIFFLAGS, &request) != 0) return false;
  return (request.ifr_flags & (IFF_UP | IFF_RUNNING)) == (IFF_UP | IFF_RUNNING);
}

SocketCalls& SocketCalls::of_kernel() noexcept {
  static SocketCalls calls;
  return calls;
}

can_frame to_wire(const Frame& frame) noexcept {
  can_frame wire{};
  wire.can_id = frame.id;
  wire.len = frame.dlc;
  std::copy_n(frame.data.begin(), frame.dlc, std::begin(wire.data));
  return wire;
}

std::optional<Frame> from_wire(const can_frame& wire, Instant time) noexcept {
  // An id above the maximum has a flag: extended, remote or error frame.
  Frame frame{.id = wire.can_id, .dlc = wire.len, .time = time};
  if (!frame.is_valid()) return std::nullopt;
  std::copy_n(std::begin(wire.data), frame.dlc, frame.data.begin());
  return frame;
}

bool enable_stamps(int socket) noexcept {
  const int on = 1;
  return ::setsockopt(socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof(on)) == 0;
}

IncomingBatch::IncomingBatch(std::size_t size) : controls_(kBatchSize) {
  connect(packets_, parts_, headers_, size);
  for (std::size_t i = 0; i < kBatchSize; ++i) headers_[i].msg_hdr.msg_control = &controls_[i];
}

int IncomingBatch::receive(SocketCalls& calls, int socket, std::size_t count) noexcept {
  const auto headers = std::span(headers_).first(std::min(count, kBatchSize));
  // The kernel overwrites the size with what it has used.
  for (mmsghdr& header : headers) header.msg_hdr.msg_controllen = kControlSize;
  return calls.receive(socket, headers);
}

Incoming IncomingBatch::operator[](std::size_t i) const noexcept {
  Incoming message{.size = headers_[i].msg_len, .packet = packets_[i], .stamp = {}, .overflow = {}};
  if ((headers_[i].msg_hdr.msg_flags & MSG_TRUNC) != 0) message.size = sizeof(Packet) + 1;
  // The macros that walk through control messages need a header that is not const.
  msghdr header = headers_[i].msg_hdr;
  for (cmsghdr* control = CMSG_FIRSTHDR(&header); control != nullptr;
       control = CMSG_NXTHDR(&header, control)) {
    if (control->cmsg_level != SOL_SOCKET) continue;
    if (control->cmsg_type == SCM_TIMESTAMPNS) {
      const auto stamp = value_of<timespec>(*control);
      message.stamp = std::chrono::seconds(stamp.tv_sec) + Nanoseconds(stamp.tv_nsec);
    } else if (control->cmsg_type == SO_RXQ_OVFL) {
      message.overflow = value_of<std::uint32_t>(*control);
    }
  }
  return message;
}

OutgoingBatch::OutgoingBatch(std::size_t size) { connect(packets_, parts_, headers_, size); }

std::size_t OutgoingBatch::fill(std::span<const Frame> frames) noexcept {
  count_ = std::min(frames.size(), kBatchSize);
  for (std::size_t i = 0; i < count_; ++i) packets_[i].frame = to_wire(frames[i]);
  return count_;
}

void OutgoingBatch::fill_without_frame() noexcept {
  count_ = 1;
  packets_[0].frame = {};
  packets_[0].frame.can_id = CAN_ERR_FLAG;
}

void OutgoingBatch::set_link(Link link) noexcept {
  for (std::size_t i = 0; i < count_; ++i) packets_[i].link = static_cast<std::uint32_t>(link);
}

void OutgoingBatch::set_dropped(std::uint32_t dropped) noexcept {
  for (std::size_t i = 0; i < count_; ++i) packets_[i].dropped = dropped;
}

std::size_t OutgoingBatch::send(SocketCalls& calls, int socket, int& error) noexcept {
  error = 0;
  std::size_t sent = 0;
  // A call that could send only a part does not say why. The next one does.
  while (sent < count_) {
    const int result = calls.send(socket, std::span(headers_).subspan(sent, count_ - sent));
    if (result <= 0) {
      error = result < 0 ? -result : EAGAIN;
      break;
    }
    sent += static_cast<std::size_t>(result);
  }
  return sent;
}

}  // namespace trifinger::can
