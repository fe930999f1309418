// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/gil.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "conversion/with.hpp"
#include "docstrings.hpp"
#include "simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/hand.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// A HandWriter with an end that Python can choose.
class PythonHand {
 public:
  explicit PythonHand(std::string robot)
      : robot_(std::move(robot)), writer_(make(robot_)), bodies_(writer_->bodies()) {}
  ~PythonHand() { close(); }

  [[nodiscard]] const std::string& robot() const noexcept { return robot_; }
  [[nodiscard]] const std::vector<std::string>& bodies() const noexcept { return bodies_; }

  void pull(const std::variant<std::int64_t, std::string>& body, const Pull& pull,
            Timeout length) const {
    if (writer_ == nullptr) throw Error("the hand of robot '" + robot_ + "' was closed");
    std::visit([&](const auto& which) { writer_->pull(which, pull, length); }, body);
  }
  void let_go() const noexcept {
    if (writer_ != nullptr) writer_->let_go();
  }
  void close() {
    // Its end waits for its thread.
    std::unique_ptr<HandWriter> ending = std::move(writer_);
    if (ending == nullptr) return;
    const GilRelease release;
    ending.reset();
  }

 private:
  // Waits for a hand that is just ending.
  static std::unique_ptr<HandWriter> make(const std::string& robot) {
    const GilRelease release;
    return std::make_unique<HandWriter>(robot);
  }

  std::string robot_;
  std::unique_ptr<HandWriter> writer_;
  std::vector<std::string> bodies_;
};

}  // namespace

void bind_hand(nb::module_& m) {
  nb::class_<PythonHand> type(m, "Hand", docs::HandWriter::HandWriter);
  type.def(nb::init<std::string>(), "robot"_a = "sim")
      .def("__repr__", [](const PythonHand& hand) { return "<Hand of '" + hand.robot() + "'>"; })
      .def_prop_ro("bodies", &PythonHand::bodies, docs::HandWriter::bodies)
      .def(
          "pull",
          [](const PythonHand& hand, const std::variant<std::int64_t, std::string>& body,
             const Vector3& target, const Vector3& point, double stiffness,
             const ShownSeconds& seconds) {
            hand.pull(body, to_pull(target, point, stiffness), to_timeout(seconds));
          },
          "body"_a, "target"_a, nb::kw_only(), "point"_a = zeros(),
          "stiffness"_a = Pull{}.stiffness, "seconds"_a = nb::none(),
          R"(Pulls at a body, a name or a number in `bodies`, in place of what was pulled before: a damped
spring from `point` to `target`. `target` is in the world frame [m]. `point` is where the spring is
fixed, from the centre of the tip or object, in the axes of its body [m]. `stiffness` is above 0
and at most 5000 [N/m]. The hand lets go by itself after `seconds`, unless it pulls again. Does not
block. Raises InvalidArgument.)")
      .def("let_go", &PythonHand::let_go, docs::HandWriter::let_go)
      .def("close", &PythonHand::close,
           "Lets go and ends. Another hand can then pull. Closing twice does nothing.");
  bind_with(type, "Hand", [](PythonHand& hand, bool) { hand.close(); });

  m.def(
      "hand", [](std::string robot) { return std::make_unique<PythonHand>(std::move(robot)); },
      "robot"_a = "sim",
      R"(The hand of a simulated robot that `trifinger run` runs, to pull at its tips and objects:

    with trifinger.hand("sim") as hand:
        hand.pull("tip_0", target=(0.0, 0.1, 0.1))
        time.sleep(1.0)
        hand.let_go()

A robot has one hand. Raises Error with the number of the process that is the hand already.)");
}

}  // namespace trifinger::bindings
