// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "trifinger/learning/policy.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::learning {

/// The policy of a file that somebody replaces now and then, such as a learner. A thread reads what
/// is new and frees what is old; whoever acts takes the newest policy between two actions.
class PolicySource {
 public:
  /// A policy, and what the metadata of its file say.
  struct Numbered {
    explicit Numbered(Policy its_policy) : policy(std::move(its_policy)) {}

    Policy policy;
    /// "number", or else how many files were taken before it.
    std::int64_t number{0};
    /// "exploration_noise": standard deviation of the noise that is added to its actions when it
    /// explores; 0 if the file does not say it.
    double noise{0.0};
    double noise_color{0.0};  ///< "exploration_color", see ColoredNoise.
    Numbered* next{nullptr};  ///< For the source alone.
  };

  /// Reads the file at `path`, and again whenever another one has taken its place. `refuse` gets a
  /// sentence, in a thread of its own, if that one is no policy or has other sizes than the first;
  /// the policy before stays.
  /// @throws PolicyFileError, SystemError if the first one cannot be read
  PolicySource(std::filesystem::path path, Precision precision,
               std::function<void(const std::string&)> refuse);
  PolicySource(const PolicySource&) = delete;
  PolicySource& operator=(const PolicySource&) = delete;
  ~PolicySource();

  /// The newest policy, until the next call. One thread may call it; it does not block, allocate or
  /// throw.
  [[nodiscard]] Numbered& newest() noexcept TRIFINGER_REALTIME;

 private:
  // Offers each new file that fits.
  void follow(const std::stop_token& stop);
  void free_returned() noexcept;

  // What tells a file from another that was at its place before.
  struct Identity {
    std::uint64_t inode{0};
    std::int64_t modified{0};  // [ns]
    std::int64_t size{-1};     // [bytes]
    friend bool operator==(const Identity&, const Identity&) = default;
  };
  [[nodiscard]] Identity identity() const noexcept;
  [[nodiscard]] std::unique_ptr<Numbered> read();

  std::filesystem::path path_;
  Identity seen_;
  Precision precision_;
  std::function<void(const std::string&)> refuse_;
  std::int64_t read_{0};                      // files so far
  std::size_t num_inputs_, num_outputs_;      // of the first one
  std::unique_ptr<Numbered> current_;         // of the thread that acts
  std::atomic<Numbered*> offered_{nullptr};   // to that thread, which owns what it takes from here
  std::atomic<Numbered*> returned_{nullptr};  // by that thread: a list, for the other one to free
  std::jthread thread_;                       // last member, because the thread uses the others
};

}  // namespace trifinger::learning
