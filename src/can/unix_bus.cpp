// SPDX-License-Identifier: BSD-3-Clause
#include "can/unix_bus.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "arrival_time.hpp"
#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "messages.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

// docs/decisions/bus_between_processes.md says why this is as it is.
namespace trifinger::can {
namespace {

constexpr int kSocketFlags = SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC;

// Marks folders that nodes have made. It has no other effect on a folder in which only its owner
// may write.
constexpr mode_t kMadeByNode = S_ISVTX;

// Opens the folder of a bus, in which nobody else may put a socket.
ipc::FileDescriptor open_folder(const std::filesystem::path& path) {
  const std::string doing = "join the bus in the folder " + path.string();
  if (::mkdir(path.c_str(), S_IRWXU | kMadeByNode) != 0 && errno != EEXIST) {
    throw SystemError(doing, errno);
  }
  ipc::FileDescriptor folder(
      [&path] { return ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC); });
  if (!folder) throw SystemError(doing, errno);
  struct stat status{};
  if (::fstat(folder.get(), &status) != 0) throw SystemError(doing, errno);
  if (status.st_uid != ::geteuid() && status.st_uid != 0) {
    throw SystemError(doing + ", which belongs to user " + user_name(status.st_uid) + "; let " +
                          user_name(status.st_uid) +
                          " or the administrator remove it, or choose another folder",
                      EPERM);
  }
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    throw SystemError(doing +
                          ", in which other users may write; change that with 'chmod go-w' or "
                          "choose another folder",
                      EPERM);
  }
  return folder;
}

// The path of a file in the open folder, whatever has become of the folder's name.
std::string path_in(const ipc::FileDescriptor& folder, const std::string& name) {
  return "/proc/self/fd/" + std::to_string(folder.get()) + "/" + name;
}

constexpr const char* kLock = "lock";

// A folder, and the lock under which its nodes join and leave one by one.
struct LockedFolder {
  ipc::FileDescriptor folder;
  ipc::FileDescriptor lock;
};

// False if another node has the lock, or if the folder or the lock has lost its name.
bool try_to_lock(LockedFolder& locked, const std::filesystem::path& path) {
  const std::string lock = path_in(locked.folder, kLock);
  locked.lock = ipc::open_lock_file(lock);
  return ipc::try_lock(locked.lock) && ipc::is_named(locked.lock, lock) &&
         ipc::is_named(locked.folder, path);
}

// Opens or makes the folder, and waits for its lock. The last node removes a folder, so this begins
// again if the folder has lost its name meanwhile.
LockedFolder lock_folder(const std::filesystem::path& path) {
  const Deadline deadline(std::chrono::seconds(10));
  while (true) {
    try {
      LockedFolder locked{.folder = open_folder(path), .lock = {}};
      if (try_to_lock(locked, path)) return locked;
    } catch (const SystemError& error) {
      if (error.error_number() != ENOENT || deadline.passed()) throw;
    }
    if (deadline.passed()) {
      throw TimedOut("another process has been joining the bus in " + path.string() +
                     " for 10 s; end it: 'fuser " + (path / kLock).string() + "' shows its number");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

std::string name_of_node(std::size_t number) { return "node." + std::to_string(number); }

// The address of a node's socket. It is relative to the open folder, so its length is bounded and
// nobody can exchange the folder.
sockaddr_un address_of(const ipc::FileDescriptor& folder, std::size_t number) {
  const std::string path = path_in(folder, name_of_node(number));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(std::data(address.sun_path), sizeof(address.sun_path) - 1);
  return address;
}

const sockaddr* generic(const sockaddr_un& address) noexcept {
  return reinterpret_cast<const sockaddr*>(&address);
}

class UnixNode final : public UnixBus {
 public:
  ~UnixNode() override;

  // If this throws, the destructor undoes what was done.
  void join(const std::filesystem::path& path);

  void set_link(Link link) noexcept override;

 private:
  // Another node. It was accepted in the loop, where ipc::FileDescriptor must not be made.
  struct Peer {
    int socket{-1};
    Instant empty;         // when the socket was last found empty
    bool is_deaf{false};   // it has closed its end; what it sent before may still wait here
    bool has_left{false};  // it has closed its end, and nothing waits any more
    Link link{Link::kUp};  // what it says of ours
    std::uint32_t dropped_by_us{0};
    std::uint32_t dropped_by_it{0};
  };

  std::size_t do_receive(std::span<Frame> budget) noexcept override;
  SendResult do_send(std::span<const Frame> frames) noexcept override;

  void meet(std::size_t number);
  void listen(std::size_t number);
  void add(int socket) noexcept;
  void accept_newcomers() noexcept;
  void remove_those_who_left() noexcept;
  // Hands what was filled in to all other nodes.
  void send_to_all(std::size_t count) noexcept;
  void update_link() noexcept;
  // Adds at most budget.size() - count frames to `budget`. True if the peer has sent no more.
  bool receive_from(Peer& peer, std::span<Frame> budget, std::size_t& count) noexcept;
  // Returns the frame of a message, and notes what else the message tells.
  std::optional<Frame> take(const Incoming& message, Peer& peer, const ClockPair& now) noexcept;

  // Removes the folder if no other node is in it and a node has made it.
  void leave() noexcept;

  std::filesystem::path path_;
  ipc::FileDescriptor folder_;
  ipc::FileDescriptor listener_;
  std::string own_name_;     // of the file in the folder; empty until it exists
  std::vector<Peer> peers_;  // its memory is reserved
  std::size_t first_{0};     // the peer from which the next call receives first
  IncomingBatch incoming_{sizeof(Packet)};
  OutgoingBatch outgoing_{sizeof(Packet)};
  Link sent_link_{Link::kUp};  // what the others were sent as theirs
};

void UnixNode::join(const std::filesystem::path& path) {
  peers_.reserve(kMaxUnixNodes);
  // The program may change its own folder before this node leaves.
  std::error_code error;
  path_ = std::filesystem::absolute(path, error);
  if (error) throw SystemError("join the bus in the folder " + path.string(), error.value());
  LockedFolder locked = lock_folder(path_);
  folder_ = std::move(locked.folder);
  std::optional<std::size_t> free;
  for (std::size_t number = 0; number < kMaxUnixNodes; ++number) {
    const std::size_t known = peers_.size();
    meet(number);
    if (peers_.size() == known && !free) free = number;
  }
  detail::require(free.has_value(), "the bus in " + path.string() + " already has " +
                                        std::to_string(kMaxUnixNodes) + " nodes");
  listen(*free);
}

UnixNode::~UnixNode() {
  if (folder_ && !is_inherited()) leave();
  for (const Peer& peer : peers_) ::close(peer.socket);
}

void UnixNode::leave() noexcept {
  // The file is removed before its socket is closed: after that its name may be another node's.
  if (!own_name_.empty()) ::unlinkat(folder_.get(), own_name_.c_str(), 0);
  try {
    LockedFolder locked{.folder = std::move(folder_), .lock = {}};
    // The last of two that leave at once removes the folder, so each waits for the other.
    constexpr int kLooks = 500;
    for (int look = 0; !try_to_lock(locked, path_); ++look) {
      if (look == kLooks || !ipc::is_named(locked.folder, path_)) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    for (const auto& entry : std::filesystem::directory_iterator(path_)) {
      if (entry.path().filename() != kLock) return;
    }
    ::unlinkat(locked.folder.get(), kLock, 0);
    struct stat status{};
    if (::fstat(locked.folder.get(), &status) == 0 && (status.st_mode & kMadeByNode) != 0) {
      ::rmdir(path_.c_str());
    }
  } catch (const std::exception&) {
    // The folder is gone already, or somebody has changed its permissions: then it stays.
  }
}

// Connects to the node of this number, if there is one. Removes what a dead node left.
void UnixNode::meet(std::size_t number) {
  const int socket = ::socket(AF_UNIX, kSocketFlags, 0);
  if (socket < 0) throw SystemError("make a socket", errno);
  const sockaddr_un address = address_of(folder_, number);
  if (::connect(socket, generic(address), sizeof(address)) == 0) {
    add(socket);
    return;
  }
  const int error = errno;
  ::close(socket);
  if (error == ENOENT) return;
  // The lock is ours, so nobody is between the making of this file and listening.
  const std::string name = name_of_node(number);
  struct stat status{};
  if (error == ECONNREFUSED &&
      ::fstatat(folder_.get(), name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 &&
      S_ISSOCK(status.st_mode) && ::unlinkat(folder_.get(), name.c_str(), 0) == 0) {
    return;
  }
  throw SystemError("connect to " + name + " of a bus between processes", error);
}

void UnixNode::listen(std::size_t number) {
  listener_ = ipc::FileDescriptor([] { return ::socket(AF_UNIX, kSocketFlags, 0); });
  const sockaddr_un address = address_of(folder_, number);
  // The socket's mode becomes that of its file.
  if (!listener_ || ::fchmod(listener_.get(), S_IRUSR | S_IWUSR) != 0 ||
      ::bind(listener_.get(), generic(address), sizeof(address)) != 0) {
    throw SystemError("make " + name_of_node(number) + " of a bus between processes", errno);
  }
  own_name_ = name_of_node(number);
  if (::listen(listener_.get(), kMaxUnixNodes) != 0) {
    throw SystemError("listen as " + own_name_ + " of a bus between processes", errno);
  }
}

void UnixNode::add(int socket) noexcept {
  // A message without a stamp counts as received when it is read.
  static_cast<void>(enable_stamps(socket));
  peers_.push_back({.socket = socket, .empty = std::chrono::steady_clock::now()});
}

void UnixNode::accept_newcomers() noexcept {
  if (peers_.size() == kMaxUnixNodes) {
    // This node never receives, else it would have noticed who has left.
    for (Peer& peer : peers_) peer.has_left = peer.is_deaf;
    remove_those_who_left();
  }
  // The peers must fit into the memory that is reserved.
  while (peers_.size() < kMaxUnixNodes) {
    const int socket = ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket < 0) return;
    add(socket);
  }
}

void UnixNode::remove_those_who_left() noexcept {
  std::erase_if(peers_, [](const Peer& peer) {
    if (peer.has_left) ::close(peer.socket);
    return peer.has_left;
  });
}

std::size_t UnixNode::do_receive(std::span<Frame> budget) noexcept {
  accept_newcomers();
  if (budget.empty() || peers_.empty()) return 0;
  // Each call begins with another peer, so nobody who sends much can keep the others from being
  // heard.
  first_ = (first_ + 1) % peers_.size();
  std::size_t count = 0;
  bool all_empty = true;
  for (std::size_t i = 0; i < peers_.size(); ++i) {
    all_empty &= receive_from(peers_[(first_ + i) % peers_.size()], budget, count);
  }
  if (!all_empty) ++state_.overloads;
  remove_those_who_left();
  update_link();
  return count;
}

void UnixNode::update_link() noexcept {
  Link link = Link::kUp;
  for (const Peer& peer : peers_) link = std::max(link, peer.link);
  if (link == state_.link) return;
  if (link == Link::kBusOff) ++state_.bus_offs;
  if (state_.link == Link::kBusOff && link == Link::kUp) ++state_.restarts;
  state_.link = link;
}

bool UnixNode::receive_from(Peer& peer, std::span<Frame> budget, std::size_t& count) noexcept {
  std::size_t left = budget.size() - count;
  while (left > 0) {
    const Instant before = std::chrono::steady_clock::now();
    const std::size_t wanted = std::min(left, kBatchSize);
    const int result = incoming_.receive(SocketCalls::of_kernel(), peer.socket, wanted);
    const auto messages = static_cast<std::size_t>(std::max(result, 0));
    const ClockPair now = ClockPair::now();
    peer.has_left = result < 0 && result != -EAGAIN;
    for (std::size_t i = 0; i < messages && !peer.has_left; ++i) {
      if (const auto frame = take(incoming_[i], peer, now)) budget[count++] = *frame;
    }
    if (peer.has_left || messages < wanted) {
      peer.empty = before;
      return true;
    }
    left -= messages;
  }
  return false;
}

std::optional<Frame> UnixNode::take(const Incoming& message, Peer& peer,
                                    const ClockPair& now) noexcept {
  peer.has_left = message.size == 0;
  if (peer.has_left) return std::nullopt;
  if (message.size == sizeof(Packet)) {
    peer.link =
        static_cast<Link>(std::min(message.packet.link, static_cast<std::uint32_t>(Link::kGone)));
    if (message.packet.frame.can_id == CAN_ERR_FLAG) return std::nullopt;
  }
  const Instant time = arrival_time(message.stamp.value_or(now.wall), now, peer.empty);
  const auto frame = from_wire(message.packet.frame, time);
  if (message.size != sizeof(Packet) || !frame) {
    ++state_.invalid;
    return std::nullopt;
  }
  state_.lost += message.packet.dropped - peer.dropped_by_it;  // modulo 2^32
  peer.dropped_by_it = message.packet.dropped;
  return frame;
}

SendResult UnixNode::do_send(std::span<const Frame> frames) noexcept {
  accept_newcomers();
  if (const Refusal refusal = refusal_of(state_.link); refusal != Refusal::kNone) {
    return {.refusal = refusal};
  }
  for (std::size_t sent = 0; sent < frames.size();) {
    const std::size_t count = outgoing_.fill(frames.subspan(sent));
    send_to_all(count);
    sent += count;
  }
  return {.sent = frames.size()};
}

void UnixNode::set_link(Link link) noexcept {
  const bool is_new = link != sent_link_ || link != Link::kUp;
  sent_link_ = link;
  if (!is_new) return;
  outgoing_.fill_without_frame();
  send_to_all(0);
}

void UnixNode::send_to_all(std::size_t count) noexcept {
  outgoing_.set_link(sent_link_);
  for (Peer& peer : peers_) {
    if (peer.is_deaf) continue;
    outgoing_.set_dropped(peer.dropped_by_us);
    int error = 0;
    const std::size_t arrived = outgoing_.send(SocketCalls::of_kernel(), peer.socket, error);
    if (arrived < count) peer.dropped_by_us += static_cast<std::uint32_t>(count - arrived);
    peer.is_deaf = error == EPIPE || error == ECONNRESET;
  }
}

}  // namespace

std::unique_ptr<UnixBus> join_unix_bus(const std::filesystem::path& folder) {
  auto node = std::make_unique<UnixNode>();
  node->join(folder);
  return node;
}

}  // namespace trifinger::can
