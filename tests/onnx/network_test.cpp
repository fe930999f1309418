// SPDX-License-Identifier: BSD-3-Clause
#include "onnx/network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "onnx/model.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::onnx {
namespace {

using ::testing::HasSubstr;
using ::testing::Pointwise;
using ::testing::ThrowsMessage;

std::string bytes_of(const std::string& name) {
  std::ifstream file(std::string(TRIFINGER_ONNX_DIR) + "/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Network network_of(const std::string& name) { return Network(model_of(bytes_of(name))); }

std::vector<double> sines(std::size_t count) {
  std::vector<double> numbers;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(std::sin(static_cast<double>(i)));
  return numbers;
}

// Fields of protocol buffers, as https://protobuf.dev/programming-guides/encoding says.
std::string varint(std::uint64_t value) {
  std::string bytes;
  for (; value >= 0x80U; value >>= 7U) bytes += static_cast<char>((value & 0x7FU) | 0x80U);
  return bytes + static_cast<char>(value);
}
std::string number(std::uint64_t field, std::uint64_t value) {
  return varint(field << 3U) + varint(value);
}
std::string message(std::uint64_t field, const std::string& bytes) {
  return varint(field << 3U | 2U) + varint(bytes.size()) + bytes;
}
std::string place(const std::string& name, const std::string& dimensions) {
  return message(1, name) + message(2, message(1, number(1, 1) + message(2, dimensions)));
}
std::string node(const std::string& op, const std::string& in, const std::string& out) {
  return message(1, message(1, in) + message(2, out) + message(4, op));
}
// A network from x to y.
std::string model(const std::string& nodes, const std::string& tensors = "",
                  const std::string& dimensions = message(1, number(1, 3))) {
  return message(8, number(2, 17)) +
         message(7, nodes + tensors + message(11, place("x", dimensions)) +
                        message(12, place("y", dimensions)));
}

struct Known {
  std::string name;
  std::vector<float> first;   // as onnxruntime 1.32 computes them for `sines`
  std::vector<float> second;  // with the state of the first

  friend void PrintTo(const Known& known, std::ostream* out) { *out << known.name; }
};

class Files : public ::testing::TestWithParam<Known> {};

TEST_P(Files, GiveTheNumbersOfOnnxruntime) {
  Network network = network_of(GetParam().name);
  EXPECT_EQ(network.has_state(), GetParam().first != GetParam().second);
  const std::vector<double> observation = sines(network.num_inputs());
  std::vector<double> action(network.num_outputs());
  for (int episode = 0; episode < 2; ++episode) {
    for (const auto& expected : {GetParam().first, GetParam().second}) {
      const test::AllocationCounter allocations;
      ASSERT_TRUE(network.evaluate(observation, action));
      EXPECT_EQ(allocations.count(), 0);
      EXPECT_THAT(action, Pointwise(testing::DoubleNear(1e-6), expected));
    }
    network.reset();
  }
}

TEST_P(Files, ForgetAllIfSomethingIsNotFinite) {
  Network network = network_of(GetParam().name);
  std::vector<double> observation = sines(network.num_inputs());
  std::vector<double> action(network.num_outputs());
  ASSERT_TRUE(network.evaluate(observation, action));
  for (const double wrong :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e39}) {
    const std::vector<double> before = action;
    observation.back() = wrong;
    EXPECT_FALSE(network.evaluate(observation, action));
    EXPECT_EQ(action, before);
    EXPECT_FALSE(network.evaluate(std::vector<double>(observation.size() + 1), action));
    ASSERT_TRUE(network.evaluate(sines(observation.size()), action));
    EXPECT_THAT(action, Pointwise(testing::DoubleNear(1e-6), GetParam().first));
  }
}

// However a file is damaged, it is refused or is a network: nothing else happens.
TEST_P(Files, MayBeDamagedAnywhere) {
  const std::string whole = bytes_of(GetParam().name);
  const auto read = [](const std::string& bytes) {
    try {
      Network network(model_of(bytes));
      std::vector<double> action(network.num_outputs());
      (void)network.evaluate(std::vector<double>(network.num_inputs(), 0.5), action);
    } catch (const InvalidArgument& error) {
      EXPECT_STRNE(error.what(), "");
    }
  };
  for (std::size_t i = 0; i < whole.size(); ++i) {
    read(whole.substr(0, i));
    for (const unsigned bit : {0U, 3U, 7U}) {
      std::string changed = whole;
      changed[i] = static_cast<char>(static_cast<unsigned char>(changed[i]) ^ (1U << bit));
      read(changed);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Onnx, Files,
    ::testing::Values(
        Known{"elu.onnx",
              {-0.013485461F, 0.076514572F, 0.053556841F},
              {-0.013485461F, 0.076514572F, 0.053556841F}},
        Known{"gru.onnx", {0.341542095F, 0.393624723F}, {0.377704531F, 0.380581707F}},
        Known{"lstm.onnx", {0.584654272F, -0.117298879F}, {0.589782059F, -0.114143819F}},
        Known{"cnn.onnx", {-0.617939055F, 0.235976309F}, {-0.617939055F, 0.235976309F}}),
    [](const auto& known) { return known.param.name.substr(0, known.param.name.find('.')); });

TEST(Network, SaysWhatIsNotKnown) {
  const auto refused = [](const std::string& bytes, const std::string& why) {
    EXPECT_THAT([&] { Network network(model_of(bytes)); },
                ThrowsMessage<InvalidArgument>(HasSubstr(why)));
  };
  EXPECT_EQ(Network(model_of(model(node("Tanh", "x", "y")))).num_outputs(), 3U);
  refused("", "no ONNX file");
  refused("a text about policies", "no ONNX file");
  refused(model(node("Foo", "x", "y")), "the operator 'Foo' is not known");
  refused(model(node("Tanh", "z", "y")), "needs 'z' before it is made");
  refused(model(node("Tanh", "x", "z")), "nothing makes the output 'y'");
  // The first size may have a name, as that of many observations; no other.
  const std::string named = message(1, message(2, "batch"));
  EXPECT_EQ(Network(model_of(model(node("Tanh", "x", "y"), "", named + message(1, number(1, 3)))))
                .num_inputs(),
            3U);
  refused(model(node("Tanh", "x", "y"), "", message(1, number(1, 1)) + named), "is not fixed");
  refused(model(node("Tanh", "x", "y"), "", message(1, number(1, 1'000'000'000))), "is not fixed");
  const auto tensor = [](const std::string& fields) {
    return message(5, fields + message(8, "w"));
  };
  const std::string add =
      message(1, message(1, "x") + message(1, "w") + message(2, "y") + message(4, "Add"));
  const std::string floats = number(2, 1);
  refused(model(add, tensor(number(1, 1'000'000'000) + floats)), "claims more numbers");
  refused(model(add, tensor(number(1, 1'000'000) + floats)), "has 0 numbers");
  refused(model(add, tensor(number(1, 1) + floats + message(9, std::string(3, 'x')))), "has 0");
  refused(model(add, tensor(number(1, 1) + floats + message(9, "\xFF\xFF\xFF\x7F"))), "(NaN)");
  refused(model(add, tensor(number(1, 1) + floats + number(14, 1))), "in another file");
  refused(model(add, tensor(number(1, 1) + number(2, 8))), "of type 8");
  refused(model(add, tensor(number(1, 1) + number(2, 7) + message(7, varint(1)) +
                            message(4, std::string(4, '\0')))),
          "of two types");
  refused(message(8, number(2, 6)) +
              model(node("Tanh", "x", "y")).substr(message(8, number(2, 17)).size()),
          "version 6");
  refused(model(message(1, message(1, "x") + message(2, "y") + message(4, "Gelu") +
                               message(7, "com.microsoft"))),
          "of 'com.microsoft'");
}

// Names of one thing cost nothing in the file, so there is a limit to them.
TEST(Network, RefusesASmallFileThatWouldTakeMuchMemoryOrTime) {
  const auto refused = [](const std::string& bytes, const std::string& why) {
    EXPECT_THAT([&] { Network network(model_of(bytes)); },
                ThrowsMessage<InvalidArgument>(HasSubstr(why)));
  };
  const std::string whole = message(
      5, number(1, 2) + number(2, 7) + message(7, varint(1) + varint(2)) + message(8, "i0"));
  std::string doubled;
  for (int i = 0; i < 40; ++i) {
    const std::string in = "i" + std::to_string(i);
    doubled += message(1, message(1, in) + message(1, in) +
                              message(2, "i" + std::to_string(i + 1)) + message(4, "Concat"));
  }
  refused(model(doubled, whole), "too many whole numbers");
  const std::string size =
      message(5, number(1, 1) + number(2, 7) + message(7, varint(8'000'000)) + message(8, "s"));
  std::string means = node("ConstantOfShape", "s", "c");
  for (int i = 0; i < 100; ++i) means += node("Neg", "c", "c" + std::to_string(i));
  refused(model(means, size), "");
}

// A state may become what another state was.
TEST(Network, DelaysByAStateOfAState) {
  const auto place_of_one = [](const char* name) { return place(name, message(1, number(1, 1))); };
  std::string graph =
      node("Identity", "x", "h1n") + node("Identity", "h1", "h2n") + node("Identity", "h2", "y");
  for (const char* name : {"x", "h1", "h2"}) graph += message(11, place_of_one(name));
  for (const char* name : {"y", "h1n", "h2n"}) graph += message(12, place_of_one(name));
  Network network(model_of(message(8, number(2, 17)) + message(7, graph)));
  std::vector<double> action(1);
  std::vector<double> seen;
  for (const double x : {1.0, 2.0, 3.0, 4.0}) {
    ASSERT_TRUE(network.evaluate(std::vector<double>{x}, action));
    seen.push_back(action[0]);
  }
  EXPECT_THAT(seen, testing::ElementsAre(0.0, 0.0, 1.0, 2.0));
}

}  // namespace
}  // namespace trifinger::onnx
