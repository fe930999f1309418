// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <memory>
#include <string>
#include <string_view>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/choice.hpp"
#include "conversion/text.hpp"
#include "conversion/with.hpp"
#include "docstrings.hpp"
#include "guide.hpp"
#include "trifinger/guiding/guide.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using guiding::GuideOptions;
using guiding::GuideSpeeds;
using guiding::GuideState;

// The enumerators of `Demand`.
constexpr std::array<std::string_view, 3> kDemands{"require", "try", "off"};

GuideOptions options_of(double joint_speed, double joint_acceleration, double tip_speed,
                        double max_lead, const std::string& scheduling) {
  GuideOptions options{.speeds = {.joint_speed = joint_speed,
                                  .joint_acceleration = joint_acceleration,
                                  .tip_speed = tip_speed,
                                  .max_lead = max_lead}};
  options.realtime.demand = choice<Demand>("scheduling", kDemands, scheduling);
  return options;
}

constexpr const char* kSettings =
    R"(`joint_speed` [rad/s] and `joint_acceleration` [rad/s^2] limit how joints move, `tip_speed` [m/s] how
tips move. `max_lead` [rad] is how far a joint's reference may be ahead of the joint. `scheduling`
says whether the guide's thread must have real-time priority: "require", "try" or "off".)";

// One row of three numbers for each tip.
auto tips_of(TipPositions GuideState::* member) {
  return [member](const GuideState& state) {
    const TipPositions& tips = state.*member;
    Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> rows(tips.size() / 3, 3);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) rows.row(i) = tips.segment<3>(3 * i);
    return Array{RowMajor(rows)};
  };
}

void bind_guide_state(nb::module_& m) {
  using State = GuideState;
  nb::class_<State>(
      m, "GuideState",
      also(docs::GuideState::GuideState,
           R"(Arrays of joints have the shape (num_joints,), arrays of tips (num_fingers, 3).)")
          .c_str())
      .def_ro("step", &State::step, docs::GuideState::step)
      .def_prop_ro(
          "mode", [](const State& state) { return std::string(name_of(state.mode)); },
          R"(What the robot does: "hold", "move_joints", "move_tip", "float" or "home".)")
      .def_prop_ro("joints", array_of(&State::joints), docs::GuideState::joints)
      .def_prop_ro("reference_joints", array_of(&State::reference_joints),
                   docs::GuideState::reference_joints)
      .def_prop_ro("target_joints", array_of(&State::target_joints),
                   docs::GuideState::target_joints)
      .def_prop_ro("tips", tips_of(&State::tips), docs::GuideState::tips)
      .def_prop_ro("reference_tips", tips_of(&State::reference_tips),
                   docs::GuideState::reference_tips)
      .def_prop_ro("target_tips", tips_of(&State::target_tips), docs::GuideState::target_tips)
      .def_ro("has_arrived", &State::has_arrived, docs::GuideState::has_arrived)
      .def_ro("refusal", &State::refusal, docs::GuideState::refusal);
}

}  // namespace

void bind_guide(nb::module_& m) {
  bind_guide_state(m);
  const GuideSpeeds usual;
  nb::class_<PythonGuide> type(
      m, "Guide",
      also(
          docs::Guide::Guide,
          R"(A `with` block calls finish() at its end, also after an exception, which it keeps. trifinger.guide()
makes a guide of a running robot by its name.)")
          .c_str());
  type.def(
          "__init__",
          [](PythonGuide* self, nb::object frontend, double joint_speed, double joint_acceleration,
             double tip_speed, double max_lead, const std::string& scheduling) {
            if (!nb::isinstance<PythonFrontend>(frontend)) {
              throw nb::type_error(
                  "a guide needs a Frontend; trifinger.guide() takes the name of a robot");
            }
            new (self) PythonGuide(
                std::move(frontend), false,
                options_of(joint_speed, joint_acceleration, tip_speed, max_lead, scheduling));
          },
          "frontend"_a, nb::kw_only(), "joint_speed"_a = usual.joint_speed,
          "joint_acceleration"_a = usual.joint_acceleration, "tip_speed"_a = usual.tip_speed,
          "max_lead"_a = usual.max_lead, "scheduling"_a = "try",
          nb::sig("def __init__(self, frontend: Frontend, *, joint_speed: float = ..., "
                  "joint_acceleration: float = ..., tip_speed: float = ..., max_lead: float = ..., "
                  "scheduling: str = 'try') -> None"),
          also(
              R"(Drives the robot of `frontend`, which must control it. Until the guide has ended, nobody else can
append actions with `frontend`; everybody can read.)",
              kSettings)
              .c_str())
      .def_prop_ro(
          "num_fingers", [](const PythonGuide& guide) { return guide.guide().num_fingers(); },
          "Number of fingers: 1 or 3.")
      .def_prop_ro(
          "num_joints", [](const PythonGuide& guide) { return guide.guide().num_joints(); },
          "Number of joints: three for each finger.")
      .def_prop_ro(
          "frontend", [](const PythonGuide& guide) { return guide.frontend(); },
          nb::sig("def frontend(self) -> Frontend"), docs::Guide::frontend)
      .def_prop_ro(
          "realtime_warnings",
          [](const PythonGuide& guide) {
            nb::list warnings;
            for (const std::string& warning : guide.guide().realtime_warnings())
              warnings.append(to_message(warning));
            return warnings;
          },
          nb::sig("def realtime_warnings(self) -> list[str]"), docs::Guide::realtime_warnings)
      .def(
          "move_tip",
          [](const PythonGuide& guide, int finger, const Vector3& position) {
            guide.guide().move_tip(finger, position.value);
          },
          "finger"_a, "position"_a, docs::Guide::move_tip)
      .def(
          "move_joints",
          [](const PythonGuide& guide, const Array<JointValues>& positions) {
            guide.guide().move_joints(positions.value);
          },
          "positions"_a, docs::Guide::move_joints)
      .def(
          "home", [](const PythonGuide& guide) { guide.guide().home(); }, docs::Guide::home)
      .def(
          "hold", [](const PythonGuide& guide) { guide.guide().hold(); }, docs::Guide::hold)
      .def(
          "float_freely", [](const PythonGuide& guide) { guide.guide().float_freely(); },
          docs::Guide::float_freely)
      .def("state", &PythonGuide::state, "timeout"_a = nb::none(),
           nb::sig("def state(self, timeout: float | None = None) -> GuideState"),
           docs::Guide::state)
      .def("wait_until_arrived", &PythonGuide::wait_until_arrived, "timeout"_a = nb::none(),
           nb::sig("def wait_until_arrived(self, timeout: float | None = None) -> None"),
           docs::Guide::wait_until_arrived)
      .def(
          "is_running", [](const PythonGuide& guide) { return guide.guide().is_running(); },
          docs::Guide::is_running)
      .def(
          "check", [](const PythonGuide& guide) { guide.guide().check(); }, docs::Guide::check)
      .def("finish", &PythonGuide::finish, "timeout"_a.none() = 5.0,
           nb::sig("def finish(self, timeout: float | None = 5.0) -> None"), docs::Guide::finish)
      .def("stop", &PythonGuide::stop, "timeout"_a.none() = 2.0,
           nb::sig("def stop(self, timeout: float | None = 2.0) -> None"), docs::Guide::stop);
  bind_with(type, "Guide", [](PythonGuide& guide, bool is_clean) { guide.exit(is_clean); });

  m.def(
      "guide",
      [](const std::string& name, double joint_speed, double joint_acceleration, double tip_speed,
         double max_lead, const std::string& scheduling, nb::handle timeout) {
        GuideOptions options =
            options_of(joint_speed, joint_acceleration, tip_speed, max_lead, scheduling);
        nb::object frontend = nb::cast(attach(name, {.control = true}, timeout));
        return std::make_unique<PythonGuide>(std::move(frontend), true, std::move(options));
      },
      "name"_a, nb::kw_only(), "joint_speed"_a = usual.joint_speed,
      "joint_acceleration"_a = usual.joint_acceleration, "tip_speed"_a = usual.tip_speed,
      "max_lead"_a = usual.max_lead, "scheduling"_a = "try", "timeout"_a.none() = 5.0,
      nb::sig("def guide(name: str, *, joint_speed: float = ..., joint_acceleration: float = ..., "
              "tip_speed: float = ..., max_lead: float = ..., scheduling: str = 'try', timeout: "
              "float | None = 5.0) -> Guide"),
      also(
          R"(Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`), and
guides it: see Guide.

    with trifinger.guide("sim") as guide:
        guide.move_tip(0, (0.0, 0.1, 0.08))
        guide.wait_until_arrived()

`timeout` is how long to wait for a session that is about to begin [s].)",
          kSettings)
          .c_str());
}

}  // namespace trifinger::bindings
