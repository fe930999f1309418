// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/suggestion.hpp"
#include "base/text_of.hpp"
#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/choice.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "conversion/with.hpp"
#include "docstrings.hpp"
#include "guide.hpp"
#include "trifinger/guiding/guide.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using guiding::FramePoints;
using guiding::Guide;
using guiding::GuidedJoints;
using guiding::GuideOptions;
using guiding::GuideSpeeds;
using guiding::GuideState;

// The enumerators of `Demand`.
constexpr std::array<std::string_view, 3> kDemands{"require", "try", "off"};

GuideOptions options_of(std::vector<std::string> frames, double joint_speed,
                        double joint_acceleration, double tip_speed, double max_lead,
                        const std::string& scheduling) {
  GuideOptions options{.speeds = {.joint_speed = joint_speed,
                                  .joint_acceleration = joint_acceleration,
                                  .tip_speed = tip_speed,
                                  .max_lead = max_lead},
                       .frames = std::move(frames)};
  options.realtime.demand = choice<Demand>("scheduling", kDemands, scheduling);
  return options;
}

constexpr const char* kSettings =
    R"(`frames` are the frames that move_frame() can move: names of sites, bodies or geoms of the robot's
model, 8 at most; by default the tips of a TriFinger, or the ends of a robot from a file.

`joint_speed` [rad/s] and `joint_acceleration` [rad/s^2] limit how joints move, `tip_speed` [m/s] how
frames move. `max_lead` [rad] is how far a joint's reference may be ahead of the joint. For a joint
that slides, 0.1 m counts as 1 rad. `scheduling` says whether the guide's thread must have real-time
priority: "require", "try" or "off".)";

// One row of three numbers for each frame.
auto points_of(FramePoints GuideState::* member) {
  return [member](const GuideState& state) { return Array{RowMajor((state.*member).transpose())}; };
}

// The number of a frame or a joint, which may be given by its name.
int number_of(const char* what, const std::variant<int, std::string>& chosen,
              const std::vector<std::string>& all) {
  if (const int* const number = std::get_if<int>(&chosen)) return *number;
  const std::vector<std::string_view> names(all.begin(), all.end());
  const auto& name = std::get<std::string>(chosen);
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) {
    throw InvalidArgument(trifinger::detail::text_of(
        "there is no ", what, " '", name, "'; there are ", trifinger::quoted_list(names, "and")));
  }
  return static_cast<int>(found - names.begin());
}

nb::typed<nb::tuple, nb::str, nb::ellipsis> names_of(const std::vector<std::string>& names) {
  nb::list list;
  for (const std::string& name : names) list.append(to_message(name));
  return nb::tuple(list);
}

// Returns a function that asks the guide.
auto asked(auto question) {
  return [question](const PythonGuide& guide) { return std::invoke(question, guide.guide()); };
}

auto limits_of(double JointLimit::* limit) {
  return asked([limit](const Guide& guide) {
    Array<GuidedJoints> values{GuidedJoints(guide.num_joints())};
    std::ranges::transform(guide.robot().limits, values.value.begin(), limit);
    return values;
  });
}

void bind_guide_state(nb::module_& m) {
  using State = GuideState;
  nb::class_<State>(
      m, "GuideState",
      also(
          docs::GuideState::GuideState,
          R"(Arrays of joints have the shape (num_joints,), arrays of frames (number of frames, 3).)"))
      .def_ro("step", &State::step, docs::GuideState::step)
      .def_prop_ro(
          "mode", [](const State& state) { return std::string(name_of(state.mode)); },
          R"(What the robot does: "hold", "move_joints", "move_frame", "float" or "home".)")
      .def_prop_ro("joints", array_of(&State::joints), docs::GuideState::joints)
      .def_prop_ro("reference_joints", array_of(&State::reference_joints),
                   docs::GuideState::reference_joints)
      .def_prop_ro("target_joints", array_of(&State::target_joints),
                   docs::GuideState::target_joints)
      .def_prop_ro("frames", points_of(&State::frames), docs::GuideState::frames)
      .def_prop_ro("reference_frames", points_of(&State::reference_frames),
                   docs::GuideState::reference_frames)
      .def_prop_ro("target_frames", points_of(&State::target_frames),
                   docs::GuideState::target_frames)
      .def_prop_ro("tips", points_of(&State::frames), "`frames`, for the tips of a TriFinger.")
      .def_prop_ro("reference_tips", points_of(&State::reference_frames),
                   "`reference_frames`, for the tips of a TriFinger.")
      .def_prop_ro("target_tips", points_of(&State::target_frames),
                   "`target_frames`, for the tips of a TriFinger.")
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
makes a guide of a running robot by its name.)"));
  type.def(
          "__init__",
          [](PythonGuide* self, Shown<"Frontend"> frontend, std::vector<std::string> frames,
             double joint_speed, double joint_acceleration, double tip_speed, double max_lead,
             const std::string& scheduling) {
            if (!nb::isinstance<PythonFrontend>(frontend)) {
              throw nb::type_error(
                  "a guide needs a Frontend; trifinger.guide() takes the name of a robot");
            }
            new (self) PythonGuide(std::move(frontend), false,
                                   options_of(std::move(frames), joint_speed, joint_acceleration,
                                              tip_speed, max_lead, scheduling));
          },
          "frontend"_a, nb::kw_only(), "frames"_a = nb::tuple(),
          "joint_speed"_a = usual.joint_speed, "joint_acceleration"_a = usual.joint_acceleration,
          "tip_speed"_a = usual.tip_speed, "max_lead"_a = usual.max_lead, "scheduling"_a = "try",
          also(
              R"(Drives the robot of `frontend`, which must control it. Until the guide has ended, nobody else can
append actions with `frontend`; everybody can read.)",
              kSettings))
      .def_prop_ro("num_joints", asked(&Guide::num_joints), "Number of joints.")
      .def_prop_ro(
          "joint_names",
          [](const PythonGuide& guide) {
            return names_of(guide.guide().robot().model->joint_names());
          },
          "Names of the joints, in the order of actions.")
      .def_prop_ro(
          "joint_units",
          [](const PythonGuide& guide) {
            std::vector<std::string> units;
            for (const DrivenJoint& joint : guide.guide().robot().model->joints())
              units.emplace_back(joint.is_slide ? "m" : "rad");
            return names_of(units);
          },
          R"(The unit of each joint's position: "rad", or "m" of a joint that slides.)")
      .def_prop_ro("soft_lower", limits_of(&JointLimit::soft_lower),
                   "Lower soft limits of the joints [rad], [m].")
      .def_prop_ro("soft_upper", limits_of(&JointLimit::soft_upper),
                   "Upper soft limits of the joints [rad], [m].")
      .def_prop_ro(
          "frame_names",
          [](const PythonGuide& guide) { return names_of(guide.guide().robot().frames); },
          "Names of the frames that move_frame() moves.")
      .def_prop_ro(
          "num_fingers",
          [](const PythonGuide& guide) { return guide.guide().robot().frames.size(); },
          "Number of frames; of a TriFinger that of its fingers.")
      .def_prop_ro(
          "frontend", [](const PythonGuide& guide) { return Shown<"Frontend">(guide.frontend()); },
          docs::Guide::frontend)
      .def_prop_ro(
          "realtime_warnings",
          [](const PythonGuide& guide) {
            nb::typed<nb::list, nb::str> warnings;
            for (const std::string& warning : guide.guide().realtime_warnings())
              warnings.append(to_message(warning));
            return warnings;
          },
          docs::Guide::realtime_warnings)
      .def(
          "move_frame",
          [](const PythonGuide& guide, const std::variant<int, std::string>& frame,
             const Vector3& position) {
            guide.guide().move_frame(number_of("frame", frame, guide.guide().robot().frames),
                                     position.value);
          },
          "frame"_a, "position"_a,
          also(docs::Guide::move_frame, "A frame is given by number or by name."))
      .def(
          "move_tip",
          [](const PythonGuide& guide, int finger, const Vector3& position) {
            guide.guide().move_tip(finger, position.value);
          },
          "finger"_a, "position"_a, docs::Guide::move_tip)
      .def(
          "move_joints",
          [](const PythonGuide& guide, const Array<GuidedJoints>& positions) {
            guide.guide().move_joints(positions.value);
          },
          "positions"_a, docs::Guide::move_joints)
      .def(
          "move_joint",
          [](const PythonGuide& guide, const std::variant<int, std::string>& joint,
             double position) {
            guide.guide().move_joint(
                number_of("joint", joint, guide.guide().robot().model->joint_names()), position);
          },
          "joint"_a, "position"_a,
          also(docs::Guide::move_joint, "A joint is given by number or by name."))
      .def("home", asked(&Guide::home), docs::Guide::home)
      .def("hold", asked(&Guide::hold), docs::Guide::hold)
      .def("float_freely", asked(&Guide::float_freely), docs::Guide::float_freely)
      .def("state", &PythonGuide::state, "timeout"_a = nb::none(), docs::Guide::state)
      .def("wait_until_arrived", &PythonGuide::wait_until_arrived, "timeout"_a = nb::none(),
           docs::Guide::wait_until_arrived)
      .def("is_running", asked(&Guide::is_running), docs::Guide::is_running)
      .def("check", asked(&Guide::check), docs::Guide::check)
      .def("finish", &PythonGuide::finish, "timeout"_a.none() = 5.0, docs::Guide::finish)
      .def("stop", &PythonGuide::stop, "timeout"_a.none() = 2.0, docs::Guide::stop);
  bind_with(type, "Guide", [](PythonGuide& guide, bool is_clean) { guide.exit(is_clean); });

  m.def(
      "guide",
      [](const std::string& name, std::vector<std::string> frames, double joint_speed,
         double joint_acceleration, double tip_speed, double max_lead,
         const std::string& scheduling, const ShownSeconds& timeout) {
        GuideOptions options = options_of(std::move(frames), joint_speed, joint_acceleration,
                                          tip_speed, max_lead, scheduling);
        nb::object frontend = nb::cast(attach(name, {.control = true}, timeout));
        return std::make_unique<PythonGuide>(std::move(frontend), true, std::move(options));
      },
      "name"_a, nb::kw_only(), "frames"_a = nb::tuple(), "joint_speed"_a = usual.joint_speed,
      "joint_acceleration"_a = usual.joint_acceleration, "tip_speed"_a = usual.tip_speed,
      "max_lead"_a = usual.max_lead, "scheduling"_a = "try", "timeout"_a.none() = 5.0,
      also(
          R"(Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`), and
guides it: see Guide.

    with trifinger.guide("sim") as guide:
        guide.move_tip(0, (0.0, 0.1, 0.08))
        guide.wait_until_arrived()

`timeout` is how long to wait for a session that is about to begin [s].)",
          kSettings));
}

}  // namespace trifinger::bindings
