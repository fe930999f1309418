// SPDX-License-Identifier: BSD-3-Clause
#include "learning/policy_source.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::learning {
namespace {

constexpr Timeout kLong = std::chrono::seconds(120);

// Its only output is `value`, whatever it sees.
Network constant(double value, int inputs = 2) {
  return {.layers = {{.weights = Eigen::MatrixXf::Zero(1, inputs),
                      .bias = Eigen::VectorXf::Constant(1, static_cast<float>(value))}}};
}

double output_of(Policy& policy) {
  std::vector<double> seen(policy.num_inputs());
  std::array<double, 1> action{};
  EXPECT_TRUE(policy.evaluate(seen, action));
  return action[0];
}

class PolicySources : public ::testing::Test {
 protected:
  void write(const Network& network) const { Policy(network).save(path()); }
  [[nodiscard]] std::filesystem::path path() const { return folder_.path() / "one.policy"; }
  [[nodiscard]] PolicySource open() {
    return PolicySource(path(), Precision::kSingle, [this](const std::string& why) {
      const std::lock_guard lock(mutex_);
      refused_.push_back(why);
    });
  }
  // Waits until a file has been refused with this text.
  void wait_for_refusal(const std::string& text) {
    const Deadline deadline(kLong);
    while (!deadline.passed()) {
      {
        const std::lock_guard lock(mutex_);
        const auto has_text = [&](const auto& why) { return why.find(text) != std::string::npos; };
        if (std::ranges::any_of(refused_, has_text)) return;
      }
      std::this_thread::yield();
    }
    ADD_FAILURE() << "nobody has said: " << text;
  }

 private:
  trifinger::test::Folder folder_;
  std::mutex mutex_;
  std::vector<std::string> refused_;
};

// Takes the newest policy until `is_wanted`.
template <class Wanted>
PolicySource::Numbered& wait_for(PolicySource& source, const Wanted& is_wanted) {
  const Deadline deadline(kLong);
  while (true) {
    PolicySource::Numbered& newest = source.newest();
    if (is_wanted(newest)) return newest;
    if (deadline.passed()) {
      ADD_FAILURE() << "the file was not taken";
      return newest;
    }
    std::this_thread::yield();
  }
}

TEST_F(PolicySources, TakeEachFileThatReplacesTheOneBefore) {
  write(constant(0.0));
  PolicySource source = open();
  EXPECT_EQ(source.newest().number, 0);
  for (int i = 1; i <= 20; ++i) {
    write(constant(i));
    PolicySource::Numbered& newest =
        wait_for(source, [i](const auto& one) { return one.number == i; });
    EXPECT_EQ(output_of(newest.policy), i);
  }
}

TEST_F(PolicySources, CallAPolicyByTheNumberInItsFile) {
  Network network = constant(1.0);
  network.metadata["number"] = "4711";
  write(network);
  EXPECT_EQ(open().newest().number, 4711);
}

TEST_F(PolicySources, KeepThePolicyIfTheFileIsNone) {
  write(constant(3.0));
  PolicySource source = open();
  std::ofstream(path()) << "no policy";
  wait_for_refusal("one.policy");
  write(constant(4.0, 3));
  wait_for_refusal("has 3 inputs and 1 outputs; the one before it has 2 and 1");
  EXPECT_EQ(output_of(source.newest().policy), 3.0);
  std::filesystem::remove(path());
  write(constant(5.0));
  wait_for(source, [](auto& one) { return output_of(one.policy) == 5.0; });
}

TEST_F(PolicySources, NeverTakeAwayThePolicyThatActs) {
  constexpr int kFiles = 200;
  write(constant(0.0));
  PolicySource source = open();
  std::jthread learner([this] {
    for (int i = 1; i <= kFiles; ++i) write(constant(i));
  });
  double last = 0.0;
  const Deadline deadline(kLong);
  while (last < kFiles) {
    ASSERT_FALSE(deadline.passed());
    const double value = output_of(source.newest().policy);
    ASSERT_GE(value, last);  // never an older one
    last = value;
  }
}

TEST_F(PolicySources, TakeAPolicyWithoutAllocation) {
  write(constant(0.0));
  PolicySource source = open();
  write(constant(1.0));
  std::array<double, 2> seen{};
  std::array<double, 1> action{};
  const Deadline deadline(kLong);
  int taken = 0;
  while (action[0] != 1.0) {
    ASSERT_FALSE(deadline.passed());
    const trifinger::test::AllocationCounter counter;
    PolicySource::Numbered& newest = source.newest();
    ASSERT_TRUE(newest.policy.evaluate(seen, action));
    ASSERT_EQ(counter.count(), 0);
    ++taken;
  }
  EXPECT_GT(taken, 0);
}

}  // namespace
}  // namespace trifinger::learning
