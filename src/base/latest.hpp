// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace trifinger {

/// The newest value that one thread hands to another. Nobody waits, and a value is never torn: the
/// writer and the reader have a slot each, and swap it for the third one.
///
/// Values may own memory. If all have the same size, writing and reading allocate nothing.
template <class T>
class Latest {
 public:
  Latest() = default;
  /// Until the first write, the reader reads `initial`.
  explicit Latest(const T& initial) : slots_{initial, initial, initial} {}

  /// @name For the one thread that writes
  /// @{

  void write(const T& value) noexcept {
    slots_[own_] = value;
    publish();
  }
  /// A value for the writer to fill in place. It still holds some older value.
  [[nodiscard]] T& own() noexcept { return slots_[own_]; }
  /// Hands `own()` over.
  void publish() noexcept {
    // release: whoever takes this slot sees the value. acquire: what the reader has read from the
    // slot that comes back was read before it is written again.
    own_ = middle_.exchange(own_ | kIsNew, std::memory_order_acq_rel) & kSlot;
  }
  /// @}

  /// @name For the one thread that reads
  /// @{

  /// Copies the newest value. False if it is the one of the last call.
  bool read(T& value) noexcept {
    const bool is_new = update();
    value = slots_[theirs_];
    return is_new;
  }
  /// Takes the newest value for `seen`. False if it is the one of the last call.
  bool update() noexcept {
    // relaxed: the exchange below orders what is read.
    const bool is_new = (middle_.load(std::memory_order_relaxed) & kIsNew) != 0;
    // acquire and release: as in `publish`, from the other side.
    if (is_new) theirs_ = middle_.exchange(theirs_, std::memory_order_acq_rel) & kSlot;
    return is_new;
  }
  /// The value that was taken last. It stays as it is until the next `update` or `read`.
  [[nodiscard]] const T& seen() const noexcept { return slots_[theirs_]; }
  /// @}

 private:
  static constexpr std::uint8_t kSlot = 3;
  static constexpr std::uint8_t kIsNew = 4;

  std::array<T, 3> slots_{};
  std::atomic<std::uint8_t> middle_{1};
  alignas(64) std::uint8_t own_{0};     // of the writer
  alignas(64) std::uint8_t theirs_{2};  // of the reader
};

}  // namespace trifinger
