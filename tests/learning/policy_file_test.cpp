// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "random_networks.hpp"
#include "support/folder.hpp"
#include "support/soak.hpp"
#include "trifinger/learning/policy.hpp"

namespace trifinger::learning {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Each test has a folder of its own.
class PolicyFile : public testing::Test {
 protected:
  [[nodiscard]] const fs::path& folder() const { return folder_.path(); }
  [[nodiscard]] fs::path path() const { return folder_ / "reach.policy"; }

  static void write(const fs::path& path, std::string_view bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }
  static std::string read(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  // Returns the error for a file with these bytes; nothing if it is accepted.
  [[nodiscard]] std::string refusal(std::string_view bytes) const {
    write(path(), bytes);
    try {
      static_cast<void>(Policy::load(path()));
      return {};
    } catch (const PolicyFileError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path().string()));
      return error.what();
    }
  }

 private:
  trifinger::test::Folder folder_;
};

constexpr std::string_view kLine = "trifinger policy 1\n";

std::string bytes_of(std::initializer_list<float> numbers) {
  std::string bytes;
  for (const float number : numbers) {
    const auto word = std::bit_cast<std::uint32_t>(number);
    for (unsigned shift = 0; shift < 32; shift += 8) {
      bytes.push_back(static_cast<char>(word >> shift & 0xffU));
    }
  }
  return bytes;
}

// A file byte by byte, as docs/policies.md describes it.
std::string golden() {
  return std::string(kLine) +
         R"({"layers": [{"inputs": 2, "outputs": 1, "activation": "relu"},)"
         R"( {"inputs": 1, "outputs": 2, "activation": "identity"}],)"
         R"( "normalization": {"mean": [1, 2], "variance": [4, 0.25], "epsilon": 1e-300,)"
         R"( "clip": 3},)"
         R"( "bounds": {"low": [-1, -1], "high": [1, 7.5], "bounding": "clip"},)"
         R"( "metadata": {"robot": "trifinger_pro", "rate": "50 Hz"}})"
         "\n" +
         bytes_of({2, -3, 0.5F, 1, -1, 0.25F, 8});
}

// Returns the golden file with a replacement in its header.
std::string with(std::string_view there, std::string_view instead) {
  std::string bytes = golden();
  const std::size_t place = bytes.find(there);
  EXPECT_NE(place, std::string::npos) << there;
  return bytes.replace(place, there.size(), instead);
}

void expect_same(const Network& a, const Network& b) {
  ASSERT_EQ(a.layers.size(), b.layers.size());
  for (std::size_t i = 0; i < a.layers.size(); ++i) {
    EXPECT_EQ(a.layers[i].weights, b.layers[i].weights);
    EXPECT_EQ(a.layers[i].bias, b.layers[i].bias);
    EXPECT_EQ(a.layers[i].activation, b.layers[i].activation);
  }
  ASSERT_EQ(a.normalization.has_value(), b.normalization.has_value());
  if (a.normalization) {
    EXPECT_EQ(a.normalization->mean, b.normalization->mean);
    EXPECT_EQ(a.normalization->variance, b.normalization->variance);
    EXPECT_EQ(a.normalization->epsilon, b.normalization->epsilon);
    EXPECT_EQ(a.normalization->clip, b.normalization->clip);
  }
  ASSERT_EQ(a.bounds.has_value(), b.bounds.has_value());
  if (a.bounds) {
    EXPECT_EQ(a.bounds->low, b.bounds->low);
    EXPECT_EQ(a.bounds->high, b.bounds->high);
    EXPECT_EQ(a.bounds->bounding, b.bounds->bounding);
  }
  EXPECT_EQ(a.metadata, b.metadata);
}

TEST_F(PolicyFile, MeansWhatItsDescriptionSays) {
  write(path(), golden());
  Policy policy = Policy::load(path());
  EXPECT_EQ(policy.num_inputs(), 2);
  EXPECT_EQ(policy.num_outputs(), 2);
  EXPECT_THAT(policy.network().metadata,
              testing::UnorderedElementsAre(testing::Pair("robot", "trifinger_pro"),
                                            testing::Pair("rate", "50 Hz")));
  std::vector<double> action(2);
  // (2 - 1) / 2 = 0.5 and (2.5 - 2) / 0.5 = 1; 2 * 0.5 - 3 * 1 + 0.5 is below 0.
  ASSERT_TRUE(policy.evaluate(std::vector{2.0, 2.5}, action));
  EXPECT_THAT(action, testing::ElementsAre(0.25, 7.5));
  // The clip gives 3, and the second input 0.5; 2 * 3 - 3 * 0.5 + 0.5 = 5.
  ASSERT_TRUE(policy.evaluate(std::vector{100.0, 2.25}, action));
  EXPECT_THAT(action, testing::ElementsAre(1, 3));
}

TEST_F(PolicyFile, HoldsEveryNetworkBitForBit) {
  Random random{.seed = 1};
  for (int i = 0; i < 50; ++i) {
    Network network = test::random_network(random);
    network.metadata = {{"robot", "sim"}, {"", "ä \n\"\\ \t\x01"}, {"rate", std::to_string(i)}};
    Policy(network).save(path());
    expect_same(Policy::load(path()).network(), network);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder()), {}), 1);
}

TEST_F(PolicyFile, IsRefusedWhereverItIsCutOff) {
  const std::string whole = golden();
  EXPECT_EQ(refusal(whole), "");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(refusal(whole.substr(0, size)), "") << size;
  }
}

TEST_F(PolicyFile, IsRefusedWithAnythingAfterItsEnd) {
  EXPECT_THAT(refusal(golden() + '\n'),
              HasSubstr("29 bytes after its header, and its layers need 28"));
  EXPECT_NE(refusal(golden() + bytes_of({1})), "");
}

TEST_F(PolicyFile, SaysWhatIsWrongWithIt) {
  const std::vector<std::array<std::string, 2>> cases{
      {std::string(1000, 'x'), "does not begin with 'trifinger policy '"},
      {"", "ends in its first line"},
      {with("policy 1", "policy 2"), "its version is not 1"},
      {with("policy 1", "policy 17"), "its version is not 1"},
      {std::string(kLine) + std::string(2'000'000, ' '), "does not end within 1048576 bytes"},
      {std::string(kLine) + "\n", "its header is not JSON"},
      {std::string(kLine) + "[]\n", "the header is not a JSON object"},
      {std::string(kLine) + "{}\n", "the header has no 'layers'"},
      {with(R"("rate")", "\"ra\xff\""), "its header is not JSON"},
      {with(R"({"layers")", R"({"size": 1, "layers")"), "the header has the unknown key 'size'"},
      {with(R"("inputs": 2)", R"("inputs": 2, "x": 0)"), "layer 0 has the unknown key 'x'"},
      {with(R"("clip": 3)", R"("klip": 3)"), "of the header has the unknown key 'klip'"},
      {with(R"(, "clip": 3)", "") + " ", "'normalization' of the header has no 'clip'"},
      {with(R"("relu")", R"("sigmoid")"),
       "'activation' of layer 0 is 'sigmoid', must be 'identity', 'relu', 'tanh' or 'elu'"},
      {with(R"("relu")", "7"), "'activation' of layer 0 is not a string"},
      {with(R"("clip"})", R"("fold"})"), "is 'fold', must be 'scale' or 'clip'"},
      {with(R"("inputs": 2)", R"("inputs": 0)"),
       "'inputs' of layer 0 is 0, must be a whole number"},
      {with(R"("inputs": 2)", R"("inputs": -2)"), "'inputs' of layer 0 is -2"},
      {with(R"("inputs": 2)", R"("inputs": 2.0)"), "'inputs' of layer 0 is 2.0"},
      {with(R"("inputs": 2)", R"("inputs": 3)"),
       "28 bytes after its header, and its layers need 32"},
      {with(R"("inputs": 1)", R"("inputs": 70000)"),
       "is 70000, must be a whole number from 1 to 65536"},
      {with(R"("inputs": 1)", R"("inputs": 18446744073709551617)"), "must be a whole number"},
      {with(R"("inputs": 2, "outputs": 1)", R"("inputs": 65536, "outputs": 65536)"),
       "its layers have 4295032836 numbers, more than 100000000"},
      {with(R"("inputs": 2, "outputs": 1)", R"("inputs": 1, "outputs": 1)"),
       "28 bytes after its header, and its layers need 24"},
      {with(R"("inputs": 2, "outputs": 1)", R"("inputs": 1, "outputs": 2)").append(bytes_of({1})),
       "layer 1 has 1 inputs, but the layer before it has 2 outputs"},
      {with(R"("mean": [1, 2])", R"("mean": [1])"), "the mean of the inputs has 1 numbers"},
      {with(R"("mean": [1, 2])", R"("mean": [1, null])"), "is null, not a number"},
      {with(R"("mean": [1, 2])", R"("mean": {})"),
       "'mean' of 'normalization' of the header is not"},
      {with(R"("mean": [1, 2])", R"("mean": [1, 1e999])"), "its header is not JSON"},
      {with(R"("mean": [1, 2])", R"("mean": [1, NaN])"), "its header is not JSON"},
      {with(R"("mean": [1, 2])", R"("mean": )" + std::string(100'000, '[')), "nested too deeply"},
      {with(R"("rate": "50 Hz")", R"("rate": 50)"), "'rate' of 'metadata' of the header is not a"},
      {with(R"([{"inputs": 2)", R"({"inputs": 2)"), "its header is not JSON"},
  };
  for (const auto& [bytes, said] : cases) {
    EXPECT_THAT(refusal(bytes), HasSubstr(said)) << bytes.substr(0, 400);
  }
}

TEST_F(PolicyFile, IsRefusedWithAWeightThatIsNotFinite) {
  const std::string whole = golden();
  for (const std::uint32_t bits : {0x7fc00000U, 0xffc00000U, 0x7f800000U, 0xff800000U}) {
    for (std::size_t place = whole.size() - 28; place < whole.size(); place += 4) {
      std::string bytes = whole;
      bytes.replace(place, 4, bytes_of({std::bit_cast<float>(bits)}));
      EXPECT_THAT(refusal(bytes), HasSubstr("not finite"));
    }
  }
}

TEST_F(PolicyFile, IsTakenOrRefusedWhateverBytesAreChanged) {
  Random random{.seed = 2};
  std::int64_t taken = 0;
  const std::int64_t tries = trifinger::test::repetitions(3000, 300'000);
  for (std::int64_t i = 0; i < tries; ++i) {
    std::string bytes = golden();
    for (std::int64_t k = random.integer(1, 4); k > 0; --k) {
      const auto place = random.integer(0, static_cast<std::int64_t>(bytes.size()));
      bytes[static_cast<std::size_t>(place)] = static_cast<char>(random.integer(0, 256));
    }
    if (!refusal(bytes).empty()) continue;
    ++taken;
    Policy policy = Policy::load(path());
    std::vector<double> action(policy.num_outputs());
    static_cast<void>(policy.evaluate(std::vector<double>(policy.num_inputs(), 1.0), action));
  }
  EXPECT_GT(taken, 0);
  EXPECT_LT(taken, tries);
}

TEST_F(PolicyFile, ThatCannotBeReadIsAnErrorOfTheSystem) {
  const auto number = [](const fs::path& path) {
    try {
      static_cast<void>(Policy::load(path));
      return 0;
    } catch (const SystemError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path.string()));
      return error.error_number();
    }
  };
  EXPECT_EQ(number(path()), ENOENT);
  EXPECT_EQ(number(folder()), EISDIR);
  // Nobody will ever write into this pipe.
  ASSERT_EQ(::mkfifo((folder() / "pipe").c_str(), 0600), 0);
  EXPECT_NE(number(folder() / "pipe"), 0);
}

TEST_F(PolicyFile, IsReplacedAsAWholeOrNotAtAll) {
  Random random{.seed = 3};
  const Policy first(test::random_network(random));
  const Policy second(test::random_network(random));
  first.save(path());
  const std::string before = read(path());
  // A folder occupies the path of the new file.
  const fs::path part = path().string() + ".new";
  fs::create_directory(part);
  EXPECT_THROW(second.save(path()), SystemError);
  EXPECT_EQ(read(path()), before);
  fs::remove(part);
  fs::permissions(path(), fs::perms::owner_read | fs::perms::owner_write);
  second.save(path());
  EXPECT_EQ(fs::status(path()).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  expect_same(Policy::load(path()).network(), second.network());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder()), {}), 1);
  EXPECT_THROW(second.save(folder() / "nowhere" / "a.policy"), SystemError);
}

TEST_F(PolicyFile, HasOnlyMetadataThatCanBeReadAgain) {
  Random random{.seed = 4};
  Network network = test::random_network(random);
  network.metadata["robot"] = "\xff";
  EXPECT_THROW(Policy(network).save(path()), InvalidArgument);
  network.metadata["robot"] = std::string(2'000'000, 'x');
  EXPECT_THROW(Policy(network).save(path()), InvalidArgument);
  EXPECT_FALSE(fs::exists(path()));
}

}  // namespace
}  // namespace trifinger::learning
