// SPDX-License-Identifier: BSD-3-Clause
#include "can/memory_bus.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"

namespace trifinger::can {
namespace {

using Kind = BusFault::Kind;

// The frames that wait for a node, in the order of their times. Its memory is made once.
class Inbox {
 public:
  explicit Inbox(std::size_t capacity) : frames_(capacity) {}

  // False if there is no room.
  bool insert(const Frame& frame) noexcept {
    if (size_ == frames_.size()) return false;
    std::size_t place = size_++;
    for (; place > 0 && at(place - 1).time > frame.time; --place) at(place) = at(place - 1);
    at(place) = frame;
    return true;
  }

  // The oldest frame; null if there is none that has arrived by `now`.
  [[nodiscard]] const Frame* front(Instant now) noexcept {
    return size_ > 0 && at(0).time <= now ? &at(0) : nullptr;
  }

  void pop() noexcept {
    first_ = (first_ + 1) % frames_.size();
    --size_;
  }

 private:
  [[nodiscard]] Frame& at(std::size_t i) noexcept { return frames_[(first_ + i) % frames_.size()]; }

  std::vector<Frame> frames_;
  std::size_t first_{0};
  std::size_t size_{0};
};

struct ScriptedFault {
  BusFault fault;
  std::uint64_t flooded{0};  // frames sent so far

  [[nodiscard]] bool is_active(Instant now) const noexcept {
    return fault.begin <= now && (now < fault.end || fault.kind == Kind::kGone);
  }
  [[nodiscard]] bool concerns(std::size_t node) const noexcept {
    return !fault.node || *fault.node == node;
  }
};

}  // namespace

class MemoryBus::Wire {
 public:
  Wire(const Clock& clock, const MemoryBusOptions& options)
      : clock_(clock), options_(options), random_{.seed = options.seed} {}

  [[nodiscard]] std::size_t queue() const noexcept { return options_.queue; }
  std::size_t attach(Node& node) {
    nodes_.push_back(&node);
    return node_count_++;
  }
  void detach(Node& node) noexcept { std::erase(nodes_, &node); }
  void add(const BusFault& fault) { faults_.push_back({.fault = fault}); }

  // Brings everybody up to date with the clock, and returns its time.
  Instant pass_time() noexcept;
  [[nodiscard]] Link link_of(std::size_t node, Instant now) const noexcept;
  // True if the node's queue takes no further frame.
  [[nodiscard]] bool refuses(const Frame& frame, std::size_t sender, Instant now) noexcept;
  void carry(Frame frame, std::size_t sender, Instant now) noexcept;

 private:
  // True if the fault happens to this frame of this sender now.
  [[nodiscard]] bool hits(const ScriptedFault& scripted, const Frame& frame, std::size_t sender,
                          Instant now) noexcept;
  void corrupt(Frame& frame) noexcept;
  void flood(ScriptedFault& scripted, Instant now) noexcept;

  const Clock& clock_;
  MemoryBusOptions options_;
  Random random_;
  std::vector<ScriptedFault> faults_;
  std::vector<Node*> nodes_;
  std::size_t node_count_{0};
};

class MemoryBus::Node final : public Bus {
 public:
  explicit Node(Wire& wire) : wire_(wire), number_(wire.attach(*this)), inbox_(wire.queue()) {}
  ~Node() override { wire_.detach(*this); }

  [[nodiscard]] std::size_t number() const noexcept { return number_; }
  [[nodiscard]] bool is_up() const noexcept { return state_.link == Link::kUp; }
  void lose(std::uint64_t count) noexcept { state_.lost += count; }
  void put(const Frame& frame) noexcept {
    if (!inbox_.insert(frame)) lose(1);
  }
  void set_link(Link link) noexcept {
    if (link == state_.link) return;
    if (link == Link::kBusOff) ++state_.bus_offs;
    if (state_.link == Link::kBusOff && link == Link::kUp) ++state_.restarts;
    state_.link = link;
  }

 private:
  std::size_t do_receive(std::span<Frame> budget) noexcept override {
    const Instant now = wire_.pass_time();
    for (std::size_t count = 0; count < budget.size(); ++count) {
      const Frame* const frame = inbox_.front(now);
      if (frame == nullptr) return count;
      budget[count] = *frame;
      inbox_.pop();
    }
    if (!budget.empty()) ++state_.overloads;
    return budget.size();
  }

  SendResult do_send(std::span<const Frame> frames) noexcept override {
    const Instant now = wire_.pass_time();
    if (const Refusal refusal = refusal_of(state_.link); refusal != Refusal::kNone) {
      return {.refusal = refusal};
    }
    for (std::size_t sent = 0; sent < frames.size(); ++sent) {
      if (wire_.refuses(frames[sent], number_, now)) {
        return {.sent = sent, .refusal = Refusal::kQueueFull};
      }
      wire_.carry(frames[sent], number_, now);
    }
    return {.sent = frames.size()};
  }

  Wire& wire_;
  std::size_t number_;
  Inbox inbox_;
};

Instant MemoryBus::Wire::pass_time() noexcept {
  const Instant now = clock_.now();
  for (Node* const node : nodes_) node->set_link(link_of(node->number(), now));
  for (ScriptedFault& scripted : faults_) {
    if (scripted.fault.kind == Kind::kFlood && scripted.fault.begin <= now) flood(scripted, now);
  }
  return now;
}

Link MemoryBus::Wire::link_of(std::size_t node, Instant now) const noexcept {
  Link link = Link::kUp;
  for (const ScriptedFault& scripted : faults_) {
    if (!scripted.is_active(now) || !scripted.concerns(node)) continue;
    // The worst of several faults counts.
    if (scripted.fault.kind == Kind::kBusOff) link = std::max(link, Link::kBusOff);
    if (scripted.fault.kind == Kind::kDown) link = std::max(link, Link::kDown);
    if (scripted.fault.kind == Kind::kGone) link = Link::kGone;
  }
  return link;
}

bool MemoryBus::Wire::hits(const ScriptedFault& scripted, const Frame& frame, std::size_t sender,
                           Instant now) noexcept {
  const BusFault& fault = scripted.fault;
  return scripted.is_active(now) && scripted.concerns(sender) &&
         (!fault.id || *fault.id == frame.id) && random_.uniform(0.0, 1.0) < fault.probability;
}

bool MemoryBus::Wire::refuses(const Frame& frame, std::size_t sender, Instant now) noexcept {
  return std::ranges::any_of(faults_, [&](const ScriptedFault& scripted) {
    return scripted.fault.kind == Kind::kQueueFull && hits(scripted, frame, sender, now);
  });
}

void MemoryBus::Wire::carry(Frame frame, std::size_t sender, Instant now) noexcept {
  frame.time = now;
  int copies = 1;
  for (const ScriptedFault& scripted : faults_) {
    const Kind kind = scripted.fault.kind;
    if (kind > Kind::kCorrupt || !hits(scripted, frame, sender, now)) continue;
    if (kind == Kind::kLose) return;
    if (kind == Kind::kDuplicate) ++copies;
    if (kind == Kind::kCorrupt) corrupt(frame);
    if (kind == Kind::kDelay) {
      frame.time += Nanoseconds(random_.integer(0, scripted.fault.delay.count() + 1));
    }
  }
  for (Node* const node : nodes_) {
    if (node->number() == sender || !node->is_up()) continue;
    for (int i = 0; i < copies; ++i) node->put(frame);
  }
}

void MemoryBus::Wire::corrupt(Frame& frame) noexcept {
  const auto below = [this](std::size_t end) {
    return static_cast<std::size_t>(random_.integer(0, static_cast<std::int64_t>(end)));
  };
  switch (below(3)) {
    case 0:
      frame.id ^= 1U << below(11);
      break;
    case 1:
      frame.dlc = static_cast<std::uint8_t>((frame.dlc + 1 + below(Frame::kMaxData)) % 9);
      std::fill(frame.data.begin() + frame.dlc, frame.data.end(), std::uint8_t{0});
      break;
    default:
      if (frame.dlc > 0) frame.data[below(frame.dlc)] ^= static_cast<std::uint8_t>(1U << below(8));
      break;
  }
}

void MemoryBus::Wire::flood(ScriptedFault& scripted, Instant now) noexcept {
  const BusFault& fault = scripted.fault;
  const auto seconds = [](Nanoseconds time) { return std::chrono::duration<double>(time).count(); };
  const auto due = static_cast<std::uint64_t>(
      fault.rate * std::max(seconds(std::min(now, fault.end) - fault.begin), 0.0));
  // What no inbox can hold need not be made.
  const std::uint64_t too_many =
      due - scripted.flooded > options_.queue ? due - scripted.flooded - options_.queue : 0;
  scripted.flooded += too_many;
  for (Node* const node : nodes_) node->lose(too_many);
  for (; scripted.flooded < due; ++scripted.flooded) {
    const std::chrono::duration<double> since(static_cast<double>(scripted.flooded) / fault.rate);
    const Frame frame{.id = fault.id.value_or(Frame::kMaxId),
                      .dlc = Frame::kMaxData,
                      .time = fault.begin + std::chrono::duration_cast<Nanoseconds>(since)};
    for (Node* const node : nodes_) {
      if (node->is_up()) node->put(frame);
    }
  }
}

MemoryBus::MemoryBus(const Clock& clock, const MemoryBusOptions& options)
    : wire_(std::make_unique<Wire>(clock, options)) {
  detail::require(options.queue > 0, "a bus in memory needs room for one frame or more per node");
}

MemoryBus::~MemoryBus() = default;

std::unique_ptr<Bus> MemoryBus::connect() { return std::make_unique<Node>(*wire_); }

void MemoryBus::add(const BusFault& fault) {
  detail::require(fault.begin <= fault.end, "a fault of a bus ends before it begins");
  detail::require(fault.probability >= 0.0 && fault.probability <= 1.0,
                  "the probability of a fault of a bus is " + std::to_string(fault.probability) +
                      ", not between 0 and 1");
  detail::require(fault.delay >= Nanoseconds::zero(), "frames cannot arrive before they are sent");
  if (fault.kind == Kind::kFlood) {
    detail::require(fault.rate > 0.0 && fault.rate <= 1e9,
                    "a flood has a rate above 0 and up to 1e9 frames per second, not " +
                        std::to_string(fault.rate));
    detail::require(fault.begin != Instant::min(), "a flood needs the instant of its begin");
    detail::require(!fault.id || *fault.id <= Frame::kMaxId, "an id has 11 bits");
  }
  wire_->add(fault);
}

}  // namespace trifinger::can
