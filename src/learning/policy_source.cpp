// SPDX-License-Identifier: BSD-3-Clause
#include "learning/policy_source.hpp"

#include <sys/stat.h>

#include <charconv>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <system_error>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::learning {
namespace {

// How often the thread looks for another file. A policy acts so much later at the most.
constexpr auto kLook = std::chrono::milliseconds(10);

// Reads a number of the metadata, if the file has it. Throws InvalidArgument.
template <class Number>
void read_number(const Network& network, const char* name, double low, double high,
                 Number& number) {
  const auto found = network.metadata.find(name);
  if (found == network.metadata.end()) return;
  const std::string& text = found->second;
  const char* const end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, number);
  const auto value = static_cast<double>(number);
  const bool is_within = value >= low && value <= high;  // not if it is no number
  if (error != std::errc() || stopped != end || !is_within) {
    throw InvalidArgument(trifinger::detail::text_of(
        "the policy's ", name, " is '", text, "', must be a number from ", low, " to ", high));
  }
}

}  // namespace

PolicySource::PolicySource(std::filesystem::path path, Precision precision,
                           std::function<void(const std::string&)> refuse)
    : path_(std::move(path)),
      seen_(identity()),  // before it is read: what takes its place meanwhile is new
      precision_(precision),
      refuse_(std::move(refuse)),
      current_(read()) {
  num_inputs_ = current_->policy.num_inputs();
  num_outputs_ = current_->policy.num_outputs();
  thread_ = std::jthread([this](const std::stop_token& stop) { follow(stop); });
}

PolicySource::~PolicySource() {
  thread_ = {};
  delete offered_.load(std::memory_order_relaxed);
  free_returned();
}

PolicySource::Numbered& PolicySource::newest() noexcept {
  // acquire: what the other thread has read. It does not touch again what was taken from here.
  if (Numbered* const fresh = offered_.exchange(nullptr, std::memory_order_acquire)) {
    Numbered* const old = current_.release();
    current_.reset(fresh);
    old->next = returned_.load(std::memory_order_relaxed);
    // release: the other thread frees it. It only ever empties the list, so this ends at once.
    while (!returned_.compare_exchange_weak(old->next, old, std::memory_order_release,
                                            std::memory_order_relaxed)) {
    }
  }
  return *current_;
}

void PolicySource::follow(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any nothing;
  std::unique_lock lock(mutex);
  while (!nothing.wait_for(lock, stop, kLook, [&] { return stop.stop_requested(); })) {
    free_returned();
    const Identity now = identity();
    // A file that is not there is one that is just now replaced, or will be.
    if (now == seen_ || now == Identity{}) continue;
    seen_ = now;
    try {
      std::unique_ptr<Numbered> fresh = read();
      const Policy& policy = fresh->policy;
      if (policy.num_inputs() != num_inputs_ || policy.num_outputs() != num_outputs_) {
        throw InvalidArgument(trifinger::detail::text_of(
            path_.string(), ": the policy has ", policy.num_inputs(), " inputs and ",
            policy.num_outputs(), " outputs; the one before it has ", num_inputs_, " and ",
            num_outputs_));
      }
      // release: see newest. What nobody has taken is replaced.
      delete offered_.exchange(fresh.release(), std::memory_order_acq_rel);
    } catch (const Error& error) {
      refuse_(error.what());
    }
  }
}

void PolicySource::free_returned() noexcept {
  for (Numbered* old = returned_.exchange(nullptr, std::memory_order_acquire); old != nullptr;) {
    delete std::exchange(old, old->next);
  }
}

PolicySource::Identity PolicySource::identity() const noexcept {
  struct stat status{};
  if (::stat(path_.c_str(), &status) != 0) return {};
  return {.inode = status.st_ino,
          .modified = status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec,
          .size = status.st_size};
}

std::unique_ptr<PolicySource::Numbered> PolicySource::read() {
  auto one = std::make_unique<Numbered>(Policy::load(path_, precision_));
  one->number = read_++;
  const Network& network = one->policy.network();
  read_number(network, "number", 0.0, 9e15, one->number);
  read_number(network, "exploration_noise", 0.0, 1.0, one->noise);
  read_number(network, "exploration_color", 0.0, 2.0, one->noise_color);
  return one;
}

}  // namespace trifinger::learning
