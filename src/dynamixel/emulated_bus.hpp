// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynamixel/emulated_motor.hpp"
#include "dynamixel/packet.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::dynamixel {

/// What emulated motors move: a simulation, or a few equations. No function allocates or throws.
class Plant {
 public:
  Plant() = default;
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;
  virtual ~Plant() = default;

  /// Angle of the shaft of this motor [rad]; 0 is the middle of its range.
  [[nodiscard]] virtual double position(std::size_t motor) const noexcept = 0;
  [[nodiscard]] virtual double velocity(std::size_t motor) const noexcept = 0;  ///< [rad/s]
  /// Moves on by `duration` with these torques at the shafts [Nm].
  virtual void step(std::span<const double> torque, Nanoseconds duration) noexcept = 0;
};

/// Shafts that know nothing of each other, each with inertia and friction.
class InertiaPlant final : public Plant {
 public:
  struct Options {
    double inertia{0.01};       ///< Of a joint and its motor's rotor [kg m^2].
    double damping{0.05};       ///< [Nms/rad]
    double dry_friction{0.05};  ///< [Nm]
  };

  explicit InertiaPlant(std::size_t count) : InertiaPlant(count, Options{}) {}
  InertiaPlant(std::size_t count, const Options& options)
      : options_(options), positions_(count), velocities_(count) {}

  [[nodiscard]] double position(std::size_t motor) const noexcept override {
    return positions_[motor];
  }
  [[nodiscard]] double velocity(std::size_t motor) const noexcept override {
    return velocities_[motor];
  }
  void step(std::span<const double> torque, Nanoseconds duration) noexcept override;

  void set_position(std::size_t motor, double position) noexcept { positions_[motor] = position; }

 private:
  Options options_;
  std::vector<double> positions_;
  std::vector<double> velocities_;
};

/// What goes wrong on a line. Each number is a probability per packet, 0 to 1.
struct LineFaults {
  double unheard{0.0};  ///< One motor does not hear an instruction.
  /// One motor hears a damaged instruction. It does nothing and answers with the error "crc".
  double misheard{0.0};
  double lost{0.0};        ///< A whole answer is lost on its way.
  double damaged{0.0};     ///< One bit of an answer is wrong.
  double byte_lost{0.0};   ///< One byte of an answer is missing.
  double byte_added{0.0};  ///< There is one byte more in an answer.
  double late{0.0};        ///< An answer arrives `delay` later.
  Nanoseconds delay{std::chrono::milliseconds(20)};
  std::uint64_t seed{0};
};

struct EmulatedBusOptions {
  /// How long a motor computes before its return delay begins.
  Nanoseconds response{0};
  /// The firmware of the motors and the plant move in steps of this size.
  Nanoseconds step{std::chrono::milliseconds(1)};
  /// A silent motor silences those after it in a sync read. Otherwise they answer after its time.
  bool silence_spreads{true};
  LineFaults faults{};
};

/// Numbers since an emulated bus was made.
struct EmulatedBusCounts {
  std::uint64_t instructions{0};  ///< Whole instructions heard on the line.
  std::uint64_t answers{0};       ///< Answers that motors have sent.
  std::uint64_t unheard{0};
  std::uint64_t misheard{0};
  std::uint64_t lost{0};
  std::uint64_t damaged{0};  ///< With a wrong, missing or added byte.
  std::uint64_t late{0};
  std::uint64_t collisions{0};  ///< The host began to send while a motor was sending.
};

/// A line with motors that move a plant, at the times at which each byte would come: ten bits per
/// byte, one sender at a time. It takes time from its caller, so it works with a clock or without.
///
/// Times must not decrease from call to call. One thread uses a bus.
class EmulatedBus {
 public:
  /// Motor i moves shaft i of `plant`, which must outlive the bus.
  /// @throws InvalidArgument
  EmulatedBus(const std::vector<EmulatedMotorOptions>& motors, Plant& plant, Instant now,
              const EmulatedBusOptions& options = {});

  /// The host hands bytes over at `now`. Its line has this rate: motors of another rate hear
  /// nothing.
  void write(std::span<const std::uint8_t> bytes, Instant now, int baud);
  /// The bytes that have arrived by `now`. Returns their number.
  [[nodiscard]] std::size_t read(std::span<std::uint8_t> bytes, Instant now);
  /// When the packet that is on its way will be at the host as a whole; nothing if none is.
  [[nodiscard]] std::optional<Instant> next_arrival() const noexcept;
  /// Lets motors and plant move on to `now`.
  void advance(Instant now) noexcept;

  void set_faults(const LineFaults& faults) noexcept { options_.faults = faults; }
  [[nodiscard]] EmulatedMotor& motor(std::size_t index) noexcept { return motors_[index]; }
  [[nodiscard]] std::size_t num_motors() const noexcept { return motors_.size(); }
  [[nodiscard]] const EmulatedBusCounts& counts() const noexcept { return counts_; }

 private:
  [[nodiscard]] Nanoseconds time_of(std::size_t bytes) const noexcept;
  [[nodiscard]] EmulatedMotor* find(MotorId id) noexcept;
  [[nodiscard]] bool happens(double probability) noexcept;
  // True if the motor is there and has heard the instruction.
  [[nodiscard]] bool hears(const EmulatedMotor* motor) noexcept;
  // True if a motor that has heard the instruction has heard it damaged.
  [[nodiscard]] bool mishears() noexcept;
  void execute(const Packet& packet, Instant heard);
  void read_many(const Packet& packet, Instant heard);
  void fast_read_many(const Packet& packet, Instant heard);
  void write_many(const Packet& packet) noexcept;
  // Sends the answer of a motor, with what is in `data_`. Returns when the line is free again.
  Instant answer(MotorId id, const EmulatedMotor::Reply& reply, Instant begin);
  void put_on_line(std::span<const std::uint8_t> bytes, Instant begin);
  void collide(Instant begin) noexcept;

  Plant& plant_;
  EmulatedBusOptions options_;
  std::vector<EmulatedMotor> motors_;
  std::vector<double> torques_;
  PacketParser parser_;
  Random random_;
  Instant moved_;          // up to when motors and plant have moved
  Instant host_sends_{};   // until when the host's bytes are on the line
  Instant motors_send_{};  // until when the motors' bytes are
  int baud_{1'000'000};
  std::vector<std::uint8_t> bytes_;  // on their way to the host
  std::vector<Instant> arrivals_;    // of each; the bytes of a packet arrive one after the other
  std::vector<std::size_t> ends_;    // where packets end in `bytes_`
  std::size_t read_{0};              // bytes that the host has
  std::size_t ends_read_{0};
  EmulatedBusCounts counts_{};
  std::array<std::uint8_t, kTableSize> data_{};
  std::array<std::uint8_t, kMaxPacket> parameters_{};
  std::array<std::uint8_t, kMaxPacket> packet_{};
};

}  // namespace trifinger::dynamixel
