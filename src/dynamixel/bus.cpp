// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/bus.hpp"

#include <algorithm>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {
namespace {

// A status without data: the frame and its error.
constexpr std::size_t kStatusFrame = kPacketFrame + 1;
// What each motor adds to the answer to a fast sync read: error, number and CRC.
constexpr std::size_t kFastFrame = 4;
constexpr std::size_t kFastHeader = kHeaderSize + 1;

}  // namespace

std::string_view name_of(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::kDone:
      return "done";
    case Outcome::kRefused:
      return "refused";
    case Outcome::kNoAnswer:
      return "no answer";
    case Outcome::kBadAnswer:
      return "answer of another size";
    case Outcome::kNotSent:
      return "the line takes no bytes";
    case Outcome::kLineGone:
      return "the line has gone";
    case Outcome::kImpossible:
      return "too much for a packet";
  }
  return "unknown";
}

Bus::Bus(std::unique_ptr<Port> port, const BusOptions& options)
    : port_(std::move(port)), options_(options) {
  trifinger::detail::require(port_ != nullptr, "a bus of motors needs a port, but got none");
  trifinger::detail::require(
      options.slack > Nanoseconds::zero(),
      "slack of a bus is " + duration_text(options.slack) + ", must be above 0");
  trifinger::detail::require(
      options.return_delay >= Nanoseconds::zero(),
      "return_delay of a bus is " + duration_text(options.return_delay) + ", must be at least 0");
}

BusCounts Bus::counts() const noexcept {
  BusCounts counts = counts_;
  counts.damaged = parser_.counts().damaged;
  counts.skipped = parser_.counts().skipped;
  return counts;
}

Instant Bus::deadline_of(std::size_t bytes, std::size_t answers) const noexcept {
  return sent_ + port_->time_of(bytes) +
         static_cast<std::int64_t>(answers) * options_.return_delay + options_.slack;
}

// True if the line cannot have carried so many bytes since the instruction. A tenth is for clocks.
bool Bus::is_too_early(std::size_t bytes, Instant now) const noexcept {
  return now < sent_ + port_->time_of(bytes) * 9 / 10;
}

void Bus::drop_late_answers() noexcept {
  // Longer than any adapter holds bytes back: 16 ms.
  port_->sleep_until(port_->now() + std::chrono::milliseconds(20));
  drop_what_came();
}

// Reads what came since the last exchange. It answers nothing any more.
void Bus::drop_what_came() noexcept {
  while (receive(port_->now())) ++counts_.late;
}

Outcome Bus::send(const Packet& packet) noexcept {
  if (!port_->is_open()) return Outcome::kLineGone;
  drop_what_came();
  const std::size_t size = encode(packet, outgoing_);
  if (size == 0) return Outcome::kImpossible;
  const Instant begin = std::max(port_->now(), sent_);
  sent_ = begin + port_->time_of(size);
  if (!port_->write(std::span(outgoing_).first(size), sent_ + options_.slack)) {
    return port_->is_open() ? Outcome::kNotSent : Outcome::kLineGone;
  }
  ++counts_.instructions;
  return Outcome::kDone;
}

std::optional<Packet> Bus::receive(Instant deadline) noexcept {
  while (true) {
    while (const auto packet = parser_.next()) {
      if (packet->instruction == Instruction::kStatus && !packet->parameters.empty()) return packet;
      ++counts_.echoes;
    }
    if (unread_.empty()) {
      const std::size_t size = port_->read(incoming_, deadline);
      unread_ = std::span(incoming_).first(size);
      if (size == 0 && !parser_.abandon()) return std::nullopt;
    }
    unread_ = unread_.subspan(parser_.feed(unread_));
  }
}

Answer Bus::judge(std::uint8_t error, Instant arrived) const noexcept {
  Answer answer;
  answer.error = static_cast<StatusError>(error & ~kAlertBit);
  answer.alert = (error & kAlertBit) != 0;
  // A motor that heard a damaged instruction has refused nothing: it does not know what was asked.
  answer.outcome = answer.error == StatusError::kNone  ? Outcome::kDone
                   : answer.error == StatusError::kCrc ? Outcome::kNoAnswer
                                                       : Outcome::kRefused;
  answer.asked = sent_;
  answer.arrived = arrived;
  return answer;
}

Answer Bus::receive_from(MotorId id, Instant deadline, std::size_t size,
                         std::span<const std::uint8_t>& data) noexcept {
  while (const auto packet = receive(deadline)) {
    if (packet->id != id) {
      ++counts_.late;
      continue;
    }
    Answer answer = judge(packet->parameters[0], port_->now());
    if (answer.outcome == Outcome::kNoAnswer) {
      ++counts_.missing;
      return answer;
    }
    ++counts_.answers;
    if (answer.outcome == Outcome::kRefused) {
      ++counts_.refused;
      return answer;
    }
    data = packet->parameters.subspan(1);
    if (data.size() != size) answer.outcome = Outcome::kBadAnswer;
    return answer;
  }
  ++counts_.missing;
  return {.outcome = port_->is_open() ? Outcome::kNoAnswer : Outcome::kLineGone, .asked = sent_};
}

Answer Bus::exchange(const Packet& packet, std::size_t size,
                     std::span<const std::uint8_t>& data) noexcept {
  if (const Outcome sent = send(packet); sent != Outcome::kDone) return {.outcome = sent};
  // Stuffing adds a third at most.
  const std::size_t most = kStatusFrame + size + size / 3 + 1;
  return receive_from(packet.id, deadline_of(most, 1), size, data);
}

Answer Bus::ping(MotorId id, Identity& identity) noexcept {
  std::span<const std::uint8_t> data;
  const Answer answer = exchange({.id = id, .instruction = Instruction::kPing}, 3, data);
  if (answer) {
    identity = {.id = id,
                .model_number = static_cast<std::uint16_t>(number_in(data.first(2))),
                .firmware = data[2]};
  }
  return answer;
}

std::size_t Bus::find_motors(std::span<Identity> found) noexcept {
  if (send({.id = kBroadcast, .instruction = Instruction::kPing}) != Outcome::kDone) return 0;
  constexpr std::size_t kIds = kMaxId + 1;
  // A motor waits for those with lower numbers, whether or not there are any.
  const Instant deadline = deadline_of(kIds * (kStatusFrame + 3), kIds) +
                           static_cast<std::int64_t>(kIds) * std::chrono::milliseconds(3);
  std::size_t count = 0;
  while (const auto packet = receive(deadline)) {
    if (packet->parameters.size() != 4) {
      ++counts_.late;
      continue;
    }
    ++counts_.answers;
    if (count == found.size()) continue;
    found[count++] = {
        .id = packet->id,
        .model_number = static_cast<std::uint16_t>(number_in(packet->parameters.subspan(1, 2))),
        .firmware = packet->parameters[3]};
  }
  return count;
}

Answer Bus::read(MotorId id, std::uint16_t address, std::span<std::uint8_t> data) noexcept {
  std::array<std::uint8_t, 4> parameters{};
  put_number(parameters, address, 2);
  put_number(std::span(parameters).subspan(2), static_cast<std::uint32_t>(data.size()), 2);
  std::span<const std::uint8_t> received;
  const Answer answer =
      exchange({.id = id, .instruction = Instruction::kRead, .parameters = parameters}, data.size(),
               received);
  if (answer) std::ranges::copy(received, data.begin());
  return answer;
}

Answer Bus::read(MotorId id, const Register& which, std::int32_t& value) noexcept {
  std::array<std::uint8_t, 4> bytes{};
  const auto data = std::span(bytes).first(which.size);
  const Answer answer = read(id, which.address, data);
  if (answer) {
    value = which.is_signed ? signed_number_in(data) : static_cast<std::int32_t>(number_in(data));
  }
  return answer;
}

Answer Bus::write(MotorId id, std::uint16_t address, std::span<const std::uint8_t> data) noexcept {
  if (data.size() + 2 > parameters_.size()) return {.outcome = Outcome::kImpossible};
  put_number(parameters_, address, 2);
  std::ranges::copy(data, parameters_.begin() + 2);
  const Packet packet{.id = id,
                      .instruction = Instruction::kWrite,
                      .parameters = std::span(parameters_).first(data.size() + 2)};
  if (id == kBroadcast) return {.outcome = send(packet), .asked = sent_};
  std::span<const std::uint8_t> nothing;
  return exchange(packet, 0, nothing);
}

Answer Bus::write(MotorId id, const Register& which, std::int32_t value) noexcept {
  std::array<std::uint8_t, 4> bytes{};
  const std::size_t size = std::min<std::size_t>(which.size, bytes.size());
  put_number(bytes, static_cast<std::uint32_t>(value), size);
  return write(id, which.address, std::span(bytes).first(size));
}

Answer Bus::reboot(MotorId id) noexcept {
  std::span<const std::uint8_t> nothing;
  return exchange({.id = id, .instruction = Instruction::kReboot}, 0, nothing);
}

std::size_t Bus::sync_read(std::span<const MotorId> ids, std::uint16_t address, std::size_t size,
                           std::span<MotorAnswer> answers, bool is_fast) noexcept {
  for (MotorAnswer& answer : answers.first(ids.size())) answer.answer = {};
  const auto fail = [&](Outcome outcome) {
    for (MotorAnswer& answer : answers.first(ids.size())) answer.answer.outcome = outcome;
    return std::size_t{0};
  };
  if (size > MotorAnswer::kMaxData || ids.size() + 4 > parameters_.size() ||
      kFastHeader + ids.size() * (size + kFastFrame) > kMaxPacket) {
    return fail(Outcome::kImpossible);
  }
  put_number(parameters_, address, 2);
  put_number(std::span(parameters_).subspan(2), static_cast<std::uint32_t>(size), 2);
  std::ranges::copy(ids, parameters_.begin() + 4);
  const Outcome sent =
      send({.id = kBroadcast,
            .instruction = is_fast ? Instruction::kFastSyncRead : Instruction::kSyncRead,
            .parameters = std::span(parameters_).first(ids.size() + 4)});
  if (sent != Outcome::kDone) return fail(sent);
  for (MotorAnswer& answer : answers.first(ids.size())) answer.answer.asked = sent_;
  is_fast ? receive_fast_sync(ids, size, answers) : receive_sync(ids, size, answers);
  const auto count = static_cast<std::size_t>(std::ranges::count_if(
      answers.first(ids.size()),
      [](const MotorAnswer& answer) { return answer.answer.outcome != Outcome::kNoAnswer; }));
  counts_.answers += count;
  counts_.missing += ids.size() - count;
  if (!port_->is_open()) {
    for (MotorAnswer& answer : answers.first(ids.size())) {
      if (!answer.answer) answer.answer.outcome = Outcome::kLineGone;
    }
  }
  return count;
}

void Bus::receive_sync(std::span<const MotorId> ids, std::size_t size,
                       std::span<MotorAnswer> answers) noexcept {
  const std::size_t most = kStatusFrame + size + size / 3 + 1;
  const Instant end = deadline_of(ids.size() * most, ids.size());
  // If the next answer does not come, no other will: motors answer one after the other.
  const Nanoseconds gap = port_->time_of(most) + options_.return_delay + options_.slack;
  Instant deadline = std::min(end, sent_ + gap);
  // The line cannot have carried more by now: an answer that is here earlier is an old one.
  std::size_t carried = 0;
  for (std::size_t next = 0; next < ids.size();) {
    const auto packet = receive(deadline);
    if (!packet) break;
    const auto rest = ids.subspan(next);
    const auto place = static_cast<std::size_t>(std::ranges::find(rest, packet->id) - rest.begin());
    const Instant now = port_->now();
    const std::size_t before =
        carried + place * kStatusFrame + kPacketFrame + packet->parameters.size();
    if (place == rest.size() || is_too_early(before, now)) {
      ++counts_.late;
      continue;
    }
    carried = before;
    MotorAnswer& answer = answers[next + place];
    answer.answer = judge(packet->parameters[0], now);
    next += place + 1;
    deadline = std::min(end, now + gap);
    const auto data = packet->parameters.subspan(1);
    if (answer.answer.outcome == Outcome::kRefused) {
      ++counts_.refused;
    } else if (answer.answer && data.size() != size) {
      answer.answer.outcome = Outcome::kBadAnswer;
    } else if (answer.answer) {
      std::ranges::copy(data, answer.data.begin());
    }
  }
}

// One packet has the answers of all motors. Each part ends with the CRC of everything before it, so
// the parts in front of damage, or of a silent motor, can be used.
void Bus::receive_fast_sync(std::span<const MotorId> ids, std::size_t size,
                            std::span<MotorAnswer> answers) noexcept {
  const std::size_t part = size + kFastFrame;
  const std::size_t whole = kFastHeader + ids.size() * part;
  const Instant end = deadline_of(whole, ids.size());
  const auto is_ours = [&](std::span<const std::uint8_t> bytes) {
    return bytes.size() >= kFastHeader && bytes[4] == kBroadcast &&
           number_in(bytes.subspan(5, 2)) == whole - kHeaderSize &&
           bytes[kHeaderSize] == static_cast<std::uint8_t>(Instruction::kStatus);
  };
  // Takes the part of ids[i], which begins with its error.
  const auto take = [&](std::size_t i, std::span<const std::uint8_t> bytes) {
    answers[i].answer = judge(bytes[0], port_->now());
    if (answers[i].answer.outcome == Outcome::kRefused) ++counts_.refused;
    std::ranges::copy(bytes.subspan(2).first(size), answers[i].data.begin());
  };
  // Takes the parts in front of the first one that is damaged or missing.
  const auto take_good_parts = [&](std::span<const std::uint8_t> bytes) {
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const std::size_t first = kFastHeader + i * part;
      const std::size_t crc = first + part - 2;
      if (bytes.size() < first + part || bytes[first + 1] != ids[i] ||
          number_in(bytes.subspan(crc, 2)) != crc16(bytes.first(crc))) {
        return;
      }
      take(i, bytes.subspan(first, part));
    }
  };
  const auto count_others = [&](const Packet& packet) {
    packet.instruction == Instruction::kStatus ? ++counts_.late : ++counts_.echoes;
  };

  while (true) {
    if (is_ours(parser_.begun())) {
      if (parser_.begun().size() >= whole && is_too_early(whole, port_->now())) {
        if (parser_.next()) ++counts_.late;
        continue;
      }
      if (parser_.begun().size() >= whole) {
        take_good_parts(parser_.begun());
        // The parser lets go of the packet, and counts it as whole or damaged.
        while (const auto packet = parser_.next()) {
          if (packet->id != kBroadcast) count_others(*packet);
        }
        return;
      }
    } else if (const auto packet = parser_.next()) {
      // Our packet comes from here if there was damage in front.
      const auto bytes = packet->parameters;
      if (packet->id != kBroadcast || packet->instruction != Instruction::kStatus ||
          bytes.size() != ids.size() * part - 2 || is_too_early(whole, port_->now())) {
        count_others(*packet);
        continue;
      }
      for (std::size_t i = 0; i < ids.size() && bytes[i * part + 1] == ids[i]; ++i) {
        take(i, bytes.subspan(i * part, size + 2));
      }
      return;
    } else if (is_ours(parser_.begun()) && parser_.begun().size() >= whole) {
      continue;
    }
    if (unread_.empty()) {
      unread_ = std::span(incoming_).first(port_->read(incoming_, end));
      if (unread_.empty()) {
        if (is_ours(parser_.begun())) {
          take_good_parts(parser_.begun());
          static_cast<void>(parser_.abandon());
          return;
        }
        if (!parser_.abandon()) return;
      }
    }
    unread_ = unread_.subspan(parser_.feed(unread_));
  }
}

Outcome Bus::sync_write(std::span<const MotorId> ids, std::uint16_t address, std::size_t size,
                        std::span<const std::uint8_t> data) noexcept {
  const std::size_t all = 4 + ids.size() * (size + 1);
  if (all > parameters_.size() || data.size() != ids.size() * size) return Outcome::kImpossible;
  put_number(parameters_, address, 2);
  put_number(std::span(parameters_).subspan(2), static_cast<std::uint32_t>(size), 2);
  auto* out = parameters_.begin() + 4;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    *out++ = ids[i];
    out = std::ranges::copy(data.subspan(i * size, size), out).out;
  }
  return send({.id = kBroadcast,
               .instruction = Instruction::kSyncWrite,
               .parameters = std::span(parameters_).first(all)});
}

}  // namespace trifinger::dynamixel
