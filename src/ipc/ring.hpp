// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

namespace trifinger::ipc {

/// Size of a ring in memory. A slot holds a 64-bit sequence number and the element, in 64-bit
/// words.
struct RingShape {
  std::uint64_t capacity{0};      ///< Number of elements kept; a power of two.
  std::uint64_t element_size{0};  ///< [bytes]

  [[nodiscard]] constexpr std::uint64_t words() const noexcept { return (element_size + 7) / 8; }
  [[nodiscard]] constexpr std::uint64_t slot_size() const noexcept { return 8 * (1 + words()); }
  [[nodiscard]] constexpr std::uint64_t size() const noexcept { return capacity * slot_size(); }
  [[nodiscard]] constexpr bool is_valid() const noexcept {
    // The bounds keep size() far from overflow, even with the values of a damaged file.
    return std::has_single_bit(capacity) && capacity <= (1U << 30U) && element_size > 0 &&
           element_size <= (1U << 30U);
  }
};

enum class ReadResult : std::uint8_t {
  kDone,
  kNotYet,  ///< The element has not been written.
  kLost,    ///< A newer element has taken its place.
};

/// A history of numbered elements in shared memory, with one writer and any number of readers.
/// Nobody waits.
///
/// Slot i % capacity holds element i when its sequence number is 2 i + 2. While the writer is at
/// work the number is 2 i + 1. A reader that sees the same even number before and after its copy
/// has the whole element. The words are atomics: a reader discards a torn copy, and the race is
/// defined behavior.
class Ring {
 public:
  Ring() = default;
  /// Uses `size()` bytes at `memory`, which must be zero at first and aligned to 8.
  Ring(std::byte* memory, const RingShape& shape) noexcept
      : memory_(memory), shape_(shape), words_(shape.words()), slot_size_(shape.slot_size()) {}

  [[nodiscard]] const RingShape& shape() const noexcept { return shape_; }

  /// Writes element `index`. Only the one writer may call this. `commit` orders the store that
  /// makes the element visible: seq_cst if a look at another word must not come before it.
  void write(std::int64_t index, const void* element,
             std::memory_order commit = std::memory_order_release) const noexcept {
    Word* const slot = slot_of(index);
    const std::uint64_t sequence = sequence_of(index);
    // relaxed: each release below carries this store, so whoever sees a new word also sees the odd
    // number.
    slot[0].store(sequence - 1, std::memory_order_relaxed);
    const auto* const source = static_cast<const std::byte*>(element);
    for_each_word([slot, source](std::uint64_t i) {
      std::uint64_t word;
      std::memcpy(&word, source + 8 * i, 8);
      slot[1 + i].store(word, std::memory_order_release);
    });
    if (const std::uint64_t rest = shape_.element_size % 8; rest != 0) {
      std::uint64_t last{0};
      std::memcpy(&last, source + shape_.element_size - rest, rest);
      slot[words_].store(last, std::memory_order_release);
    }
    // At least release: whoever sees the even number sees the whole element.
    // Each order is a constant here: where this function is not inlined, a compiler makes the
    // strongest order of one that it does not know.
    if (commit == std::memory_order_seq_cst) {
      slot[0].store(sequence, std::memory_order_seq_cst);
    } else {
      slot[0].store(sequence, std::memory_order_release);
    }
    // The next slot was last used a whole history ago. This loads its lines into the cache while
    // others work; otherwise the stores of the next write would wait for them.
    const auto* const next = reinterpret_cast<const std::byte*>(slot_of(index + 1));
    for (std::uint64_t offset = 0; offset < slot_size_; offset += kCacheLine)
      __builtin_prefetch(next + offset, 1);
  }

  /// Copies element `index` to `element`. `element` is valid only if the answer is kDone.
  [[nodiscard]] ReadResult read(std::int64_t index, void* element) const noexcept {
    const Word* const slot = slot_of(index);
    // acquire: the words read below are at least as new as this number.
    const std::uint64_t before = slot[0].load(std::memory_order_acquire);
    if (before != sequence_of(index)) {
      return before > sequence_of(index) ? ReadResult::kLost : ReadResult::kNotYet;
    }
    auto* const target = static_cast<std::byte*>(element);
    for_each_word([slot, target](std::uint64_t i) {
      // acquire: whoever reads a word of a newer element also sees that element's odd number.
      const std::uint64_t word = slot[1 + i].load(std::memory_order_acquire);
      std::memcpy(target + 8 * i, &word, 8);
    });
    if (const std::uint64_t rest = shape_.element_size % 8; rest != 0) {
      // acquire: see the words above.
      const std::uint64_t last = slot[words_].load(std::memory_order_acquire);
      std::memcpy(target + shape_.element_size - rest, &last, rest);
    }
    // relaxed: this load comes after the loads above because they acquire.
    return slot[0].load(std::memory_order_relaxed) == before ? ReadResult::kDone
                                                             : ReadResult::kLost;
  }

  /// The first word of element `index`, which must be in the ring. Only the one writer may call
  /// this.
  [[nodiscard]] std::uint64_t first_word(std::int64_t index) const noexcept {
    // relaxed: the writer itself stored this word.
    return slot_of(index)[1].load(std::memory_order_relaxed);
  }

  /// The sequence number in the slot of `index`, for readers that do not trust the writer.
  [[nodiscard]] std::uint64_t sequence_in_slot(std::int64_t index) const noexcept {
    // seq_cst: after closing an index the back-end looks once more (see Loop::close_index).
    return slot_of(index)[0].load(std::memory_order_seq_cst);
  }
  [[nodiscard]] static constexpr std::uint64_t sequence_of(std::int64_t index) noexcept {
    return 2 * static_cast<std::uint64_t>(index) + 2;
  }

 private:
  static constexpr std::uint64_t kCacheLine = 64;  // [bytes]

  using Word = std::atomic<std::uint64_t>;
  static_assert(sizeof(Word) == 8 && Word::is_always_lock_free);

  [[nodiscard]] Word* slot_of(std::int64_t index) const noexcept {
    const std::uint64_t position = static_cast<std::uint64_t>(index) & (shape_.capacity - 1);
    return reinterpret_cast<Word*>(memory_ + position * slot_size_);
  }
  // Calls `copy` for each whole word of an element. Compilers neither join copies of atomics nor
  // unroll their loops. Without this unrolling, four of five instructions would belong to the loop.
  template <class Copy>
  void for_each_word(const Copy& copy) const noexcept {
    constexpr std::uint64_t kAtOnce = 8;
    const std::uint64_t count = shape_.element_size / 8;
    std::uint64_t i = 0;
    for (; i + kAtOnce <= count; i += kAtOnce) {
      [&]<std::uint64_t... k>(std::integer_sequence<std::uint64_t, k...>) {
        (copy(i + k), ...);
      }(std::make_integer_sequence<std::uint64_t, kAtOnce>());
    }
    for (; i < count; ++i) copy(i);
  }

  std::byte* memory_{nullptr};
  RingShape shape_;
  std::uint64_t words_{0};
  std::uint64_t slot_size_{0};
};

}  // namespace trifinger::ipc
