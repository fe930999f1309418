// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <tuple>

#include "trifinger/core/description.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

// Large data of a sensor, such as images, is the *payload* of its elements. It stays in a shared
// memory of the sensor's process, a ring with room for a few payloads. Elements only say where it
// lies, so the robot's loop neither maps nor copies it. Readers look at it in place and ask
// afterwards whether it was overwritten meanwhile.

/// Where the payload of an element lies. It is the second member of such an element, called
/// "payload", after the `Stamp`.
struct PayloadReference {
  std::uint64_t memory{0};  ///< Every writer makes a memory of its own. 0: there is no payload.
  std::int64_t number{-1};  ///< Counts the payloads of this memory from 0.

  static constexpr auto fields() {
    return std::tuple{field("memory", &PayloadReference::memory),
                      field("number", &PayloadReference::number)};
  }
};

/// @throws InvalidArgument unless elements of this kind begin with a `Stamp stamp` and a
/// `PayloadReference payload`
void require_payload_reference(const ElementDescription& element);

namespace detail {
class PayloadMemory;
}  // namespace detail

/// Hands out large data. One thread writes; any number of readers in any process look at it.
///
/// A payload stays whole until `history` others have been begun after it. A reader that is too slow
/// is told so; the writer never waits for anybody. A child process after fork must not use it.
class PayloadWriter {
 public:
  static constexpr std::size_t kDefaultHistory = 16;

  /// Makes the memory for the payloads of the sensor `sensor` of `robot`. All of it is allocated
  /// now.
  /// @throws InvalidArgument, SystemError, Error if another process writes them already
  PayloadWriter(const std::string& robot, const std::string& sensor,
                const ElementDescription& payload, std::size_t history = kDefaultHistory);
  /// Makes a memory that only readers in this process can find.
  /// @throws InvalidArgument, SystemError
  [[nodiscard]] static PayloadWriter anonymous(const ElementDescription& payload,
                                               std::size_t history = kDefaultHistory);
  PayloadWriter(PayloadWriter&&) noexcept;
  PayloadWriter& operator=(PayloadWriter&&) noexcept;
  ~PayloadWriter();

  /// The place of the next payload, to be filled in. What was there is gone from now on. A second
  /// call before `commit` gives the same place.
  [[nodiscard]] std::span<std::byte> begin() noexcept TRIFINGER_REALTIME;
  /// Makes the payload readable that was begun last. Put the answer into its element.
  [[nodiscard]] PayloadReference commit() noexcept TRIFINGER_REALTIME;

 private:
  struct State;
  explicit PayloadWriter(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

/// A payload, read in place. It keeps the memory, also when its writer has ended.
class PayloadView {
 public:
  /// The fields that the payload's description lists. Check `is_valid()` after using them: the
  /// bytes may change at any time.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }
  /// False if the writer has begun to overwrite the bytes. What was read before a call that returns
  /// true was whole.
  [[nodiscard]] bool is_valid() const noexcept;
  /// @throws HistoryLost unless `is_valid()`
  void require_valid() const;
  /// Copies all bytes to `target`. @throws HistoryLost if they were overwritten meanwhile
  void copy_to(void* target) const;

 private:
  friend class PayloadReader;
  PayloadView(std::shared_ptr<const detail::PayloadMemory> memory, std::int64_t number);

  std::shared_ptr<const detail::PayloadMemory> memory_;
  std::int64_t number_;
  std::span<const std::byte> bytes_;
};

/// Finds the payloads of a sensor. Any number of threads may use it.
class PayloadReader {
 public:
  /// Reads payloads of the sensor `sensor` of `robot`, whose fields are `payload`. The sensor need
  /// not run yet.
  PayloadReader(std::string robot, std::string sensor, ElementDescription payload);
  ~PayloadReader();

  /// The payload of an element. The first call, and the first one after the sensor's process was
  /// started again, maps the memory; all others take less than a microsecond.
  /// @throws HistoryLost if it was overwritten, or if the memory is gone because the process was
  /// started again; InvalidArgument if the element has no payload; IncompatibleSession if the
  /// memory has other fields; SystemError
  [[nodiscard]] PayloadView view(const PayloadReference& reference) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trifinger
