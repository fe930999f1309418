// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/emulated_bus.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::dynamixel {
namespace {

// The answer of a motor that has heard a damaged instruction.
constexpr EmulatedMotor::Reply kMisheard{.is_sent = true,
                                         .error = static_cast<std::uint8_t>(StatusError::kCrc)};

}  // namespace

void InertiaPlant::step(std::span<const double> torque, Nanoseconds duration) noexcept {
  const double seconds = std::chrono::duration<double>(duration).count();
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    double& velocity = velocities_[i];
    // Friction is implicit, so that it stops a shaft and never turns it.
    const double free = velocity + seconds / options_.inertia * torque[i];
    const double dry = seconds / options_.inertia * options_.dry_friction;
    const double left = std::copysign(std::max(std::abs(free) - dry, 0.0), free);
    velocity = left / (1.0 + seconds / options_.inertia * options_.damping);
    positions_[i] += seconds * velocity;
  }
}

EmulatedBus::EmulatedBus(const std::vector<EmulatedMotorOptions>& motors, Plant& plant, Instant now,
                         const EmulatedBusOptions& options)
    : plant_(plant),
      options_(options),
      torques_(motors.size()),
      random_{.seed = options.faults.seed},
      moved_(now),
      host_sends_(now),
      motors_send_(now) {
  using trifinger::detail::require;
  require(options.step > Nanoseconds::zero(),
          "the step of emulated motors is " + duration_text(options.step) + ", must be above 0");
  motors_.reserve(motors.size());
  for (const EmulatedMotorOptions& motor : motors) {
    require(find(motor.id) == nullptr,
            "two emulated motors have number " + std::to_string(motor.id) + " on one bus");
    motors_.emplace_back(motor);
  }
  // The motors are switched on where the plant is, and have measured it.
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    for (const bool is_on : {false, true}) {
      motors_[i].set_power(is_on);
      motors_[i].tick(Nanoseconds(1), plant_.position(i), plant_.velocity(i));
    }
  }
}

Nanoseconds EmulatedBus::time_of(std::size_t bytes) const noexcept {
  return Nanoseconds(static_cast<std::int64_t>(bytes) * 10 * 1'000'000'000 / baud_);
}

EmulatedMotor* EmulatedBus::find(MotorId id) noexcept {
  const auto found = std::ranges::find(motors_, id, &EmulatedMotor::id);
  return found == motors_.end() ? nullptr : &*found;
}

bool EmulatedBus::happens(double probability) noexcept {
  return probability > 0.0 && random_.uniform(0.0, 1.0) < probability;
}

bool EmulatedBus::hears(const EmulatedMotor* motor) noexcept {
  if (motor == nullptr || !motor->is_on() || motor->baud() != baud_) return false;
  if (!happens(options_.faults.unheard)) return true;
  ++counts_.unheard;
  return false;
}

bool EmulatedBus::mishears() noexcept {
  if (!happens(options_.faults.misheard)) return false;
  ++counts_.misheard;
  return true;
}

void EmulatedBus::advance(Instant now) noexcept {
  for (; moved_ + options_.step <= now; moved_ += options_.step) {
    for (std::size_t i = 0; i < motors_.size(); ++i) torques_[i] = motors_[i].torque();
    plant_.step(torques_, options_.step);
    for (std::size_t i = 0; i < motors_.size(); ++i) {
      motors_[i].tick(options_.step, plant_.position(i), plant_.velocity(i));
    }
  }
}

void EmulatedBus::write(std::span<const std::uint8_t> bytes, Instant now, int baud) {
  advance(now);
  baud_ = baud;
  const Instant begin = std::max(now, host_sends_);
  host_sends_ = begin + time_of(bytes.size());
  if (begin < motors_send_) {
    collide(begin);
    return;
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    static_cast<void>(parser_.feed(bytes.subspan(i, 1)));
    while (const auto packet = parser_.next()) {
      ++counts_.instructions;
      execute(*packet, begin + time_of(i + 1));
    }
  }
}

// Two senders at once: nobody understands anything from then on.
void EmulatedBus::collide(Instant begin) noexcept {
  ++counts_.collisions;
  for (std::size_t i = read_; i < bytes_.size(); ++i) {
    if (arrivals_[i] > begin) bytes_[i] ^= 0x55U;
  }
}

void EmulatedBus::execute(const Packet& packet, Instant heard) {
  advance(heard);
  switch (packet.instruction) {
    case Instruction::kStatus:
      return;
    case Instruction::kSyncRead:
    case Instruction::kBulkRead:
      read_many(packet, heard);
      return;
    case Instruction::kFastSyncRead:
      fast_read_many(packet, heard);
      return;
    case Instruction::kSyncWrite:
    case Instruction::kBulkWrite:
      write_many(packet);
      return;
    default:
      break;
  }
  const bool is_for_all = packet.id == kBroadcast;
  Instant free = heard;
  // Pinged motors answer in the order of their numbers.
  for (unsigned id = 0; id <= kMaxId; ++id) {
    if (!is_for_all && id != packet.id) continue;
    EmulatedMotor* const motor = find(static_cast<MotorId>(id));
    if (!hears(motor)) continue;
    // A write may change number and delay; the answer has those from before.
    const Nanoseconds delay = motor->return_delay();
    const EmulatedMotor::Reply reply =
        mishears() ? kMisheard : motor->execute(packet.instruction, packet.parameters, data_);
    const bool is_answered = !is_for_all || packet.instruction == Instruction::kPing;
    if (is_answered && reply.is_sent) {
      free = answer(static_cast<MotorId>(id), reply, free + delay + options_.response);
    }
    if (!is_for_all) return;
  }
}

Instant EmulatedBus::answer(MotorId id, const EmulatedMotor::Reply& reply, Instant begin) {
  parameters_[0] = reply.error;
  std::copy_n(data_.begin(), reply.size, parameters_.begin() + 1);
  const std::size_t size = encode({.id = id,
                                   .instruction = Instruction::kStatus,
                                   .parameters = std::span(parameters_).first(reply.size + 1)},
                                  packet_);
  put_on_line(std::span(packet_).first(size), begin);
  return begin + time_of(size);
}

void EmulatedBus::read_many(const Packet& packet, Instant heard) {
  const bool is_bulk = packet.instruction == Instruction::kBulkRead;
  const auto parameters = packet.parameters;
  const std::size_t first = is_bulk ? 0 : 4;
  const std::size_t entry = is_bulk ? 5 : 1;
  if (parameters.size() < first + entry || (parameters.size() - first) % entry != 0) return;
  Instant free = heard;
  for (std::size_t i = first; i < parameters.size(); i += entry) {
    const auto where = is_bulk ? parameters.subspan(i + 1, 4) : parameters.first(4);
    const std::size_t address = number_in(where.first(2));
    const std::size_t size = number_in(where.subspan(2));
    EmulatedMotor* const motor = find(parameters[i]);
    if (!hears(motor)) {
      if (options_.silence_spreads) return;
      free += time_of(kPacketFrame + 1 + size);
      continue;
    }
    const EmulatedMotor::Reply reply = mishears() ? kMisheard : motor->read(address, size, data_);
    if (reply.is_sent) {
      free = answer(motor->id(), reply, free + motor->return_delay() + options_.response);
    }
  }
}

// Each motor appends its part as soon as the one before has sent its own.
void EmulatedBus::fast_read_many(const Packet& packet, Instant heard) {
  const auto parameters = packet.parameters;
  if (parameters.size() < 5) return;
  const std::size_t address = number_in(parameters.first(2));
  const std::size_t size = number_in(parameters.subspan(2, 2));
  const auto ids = parameters.subspan(4);
  const std::size_t length = 1 + ids.size() * (size + 4);
  if (length + kHeaderSize > packet_.size()) return;
  constexpr std::array<std::uint8_t, 8> kHeader{0xFF, 0xFF, 0xFD, 0x00, kBroadcast, 0, 0, 0x55};
  std::ranges::copy(kHeader, packet_.begin());
  put_number(std::span(packet_).subspan(5), static_cast<std::uint32_t>(length), 2);
  std::size_t end = kHeader.size();
  Instant begin = heard;
  Nanoseconds delays{0};
  for (const MotorId id : ids) {
    EmulatedMotor* const motor = find(id);
    if (!hears(motor) || motor->value(registers::kFirmwareVersion) < kFastSyncReadFirmware) break;
    EmulatedMotor::Reply reply = motor->read(address, size, data_);
    if (!reply.is_sent || reply.size != size) break;
    // All parts of the answer have the same size.
    if (mishears()) reply.error = kMisheard.error;
    delays += motor->return_delay() + options_.response;
    packet_[end++] = reply.error;
    packet_[end++] = id;
    std::copy_n(data_.begin(), size, packet_.begin() + static_cast<std::ptrdiff_t>(end));
    end += size;
    put_number(std::span(packet_).subspan(end), crc16(std::span(packet_).first(end)), 2);
    end += 2;
  }
  if (end == kHeader.size()) return;
  begin += delays;
  put_on_line(std::span(packet_).first(end), begin);
}

void EmulatedBus::write_many(const Packet& packet) noexcept {
  const auto parameters = packet.parameters;
  if (packet.instruction == Instruction::kBulkWrite) {
    for (std::size_t i = 0; i + 5 <= parameters.size();) {
      const std::size_t size = number_in(parameters.subspan(i + 3, 2));
      if (i + 5 + size > parameters.size()) return;
      EmulatedMotor* const motor = find(parameters[i]);
      if (hears(motor) && !mishears()) {
        motor->write(number_in(parameters.subspan(i + 1, 2)), parameters.subspan(i + 5, size));
      }
      i += 5 + size;
    }
    return;
  }
  if (parameters.size() < 4) return;
  const std::size_t address = number_in(parameters.first(2));
  const std::size_t size = number_in(parameters.subspan(2, 2));
  if (size == 0 || (parameters.size() - 4) % (size + 1) != 0) return;
  for (std::size_t i = 4; i < parameters.size(); i += size + 1) {
    EmulatedMotor* const motor = find(parameters[i]);
    if (hears(motor) && !mishears()) motor->write(address, parameters.subspan(i + 1, size));
  }
}

void EmulatedBus::put_on_line(std::span<const std::uint8_t> bytes, Instant begin) {
  ++counts_.answers;
  motors_send_ = std::max(motors_send_, begin + time_of(bytes.size()));
  const LineFaults& faults = options_.faults;
  if (happens(faults.lost)) {
    ++counts_.lost;
    return;
  }
  const auto place = [&] {
    return static_cast<std::size_t>(random_.integer(0, static_cast<std::int64_t>(bytes.size())));
  };
  std::optional<std::size_t> wrong;
  std::optional<std::size_t> missing;
  std::optional<std::size_t> added;
  if (happens(faults.damaged)) wrong = place();
  if (happens(faults.byte_lost)) missing = place();
  if (happens(faults.byte_added)) added = place();
  if (wrong || missing || added) ++counts_.damaged;
  Nanoseconds delay{0};
  if (happens(faults.late)) {
    ++counts_.late;
    delay = faults.delay;
  }
  Instant last = arrivals_.empty() ? Instant::min() : arrivals_.back();
  const auto put = [&](std::uint8_t byte, std::size_t i) {
    last = std::max(last, begin + delay + time_of(i + 1));
    bytes_.push_back(byte);
    arrivals_.push_back(last);
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (added == i) put(static_cast<std::uint8_t>(random_.integer(0, 256)), i);
    if (missing == i) continue;
    const auto flipped = wrong == i ? 1U << static_cast<unsigned>(random_.integer(0, 8)) : 0U;
    put(static_cast<std::uint8_t>(bytes[i] ^ flipped), i);
  }
  ends_.push_back(bytes_.size());
}

std::optional<Instant> EmulatedBus::next_arrival() const noexcept {
  for (std::size_t i = ends_read_; i < ends_.size(); ++i) {
    if (ends_[i] > read_) return arrivals_[ends_[i] - 1];
  }
  return std::nullopt;
}

std::size_t EmulatedBus::read(std::span<std::uint8_t> bytes, Instant now) {
  std::size_t count = 0;
  while (count < bytes.size() && read_ < bytes_.size() && arrivals_[read_] <= now) {
    bytes[count++] = bytes_[read_++];
  }
  while (ends_read_ < ends_.size() && ends_[ends_read_] <= read_) ++ends_read_;
  if (read_ == bytes_.size()) {
    bytes_.clear();
    arrivals_.clear();
    ends_.clear();
    read_ = ends_read_ = 0;
  }
  return count;
}

}  // namespace trifinger::dynamixel
