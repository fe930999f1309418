// SPDX-License-Identifier: BSD-3-Clause
#include "urdf.hpp"

#include <algorithm>
#include <set>
#include <string_view>
#include <vector>

#include "base/text_of.hpp"
#include "model_limits.hpp"
#include "repair_inertia.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
namespace {

std::string place_of(const std::string& source, const XmlElement& element) {
  return text_of(source, ":", element.line, ": ");
}

XmlElement* find_child(XmlElement& parent, std::string_view name) {
  const auto found = std::ranges::find(parent.children, name, &XmlElement::name);
  return found == parent.children.end() ? nullptr : &*found;
}

XmlElement& child(XmlElement& parent, std::string_view name) {
  if (XmlElement* const found = find_child(parent, name)) return *found;
  return parent.children.emplace_back(XmlElement{.name = std::string(name), .line = parent.line});
}

// The number of an attribute; nothing if it is missing or no number.
std::optional<double> number_of(const XmlElement& element, std::string_view attribute) {
  const std::string* const value = element.find(attribute);
  const std::vector<double> numbers = value != nullptr ? numbers_of(*value) : std::vector<double>{};
  return numbers.size() == 1 ? std::optional(numbers.front()) : std::nullopt;
}

void require_expanded(const XmlElement& element, const std::string& source) {
  require(!element.name.starts_with("xacro:"),
          text_of(place_of(source, element), "<", element.name,
                  "> belongs to a template of xacro. Make a URDF of it first: xacro ", source,
                  " > robot.urdf"));
  for (const XmlElement& inner : element.children) require_expanded(inner, source);
}

// A link of which only the mass is known.
void complete_inertia(XmlElement& link, const std::string& source, bool repairs) {
  XmlElement* const inertial = find_child(link, "inertial");
  if (inertial == nullptr || find_child(*inertial, "inertia") != nullptr) return;
  const XmlElement* const mass = find_child(*inertial, "mass");
  const double kilograms = mass != nullptr ? number_of(*mass, "value").value_or(0.0) : 0.0;
  const std::string* const name = link.find("name");
  require(repairs, text_of(place_of(source, *inertial), "link '", name != nullptr ? *name : "",
                           "' has a mass, but no <inertia>; ", kHowToRepair));
  const std::string moment = text_of(ball_inertia(kilograms));
  inertial->children.push_back({.name = "inertia",
                                .line = inertial->line,
                                .attributes = {{"ixx", moment},
                                               {"iyy", moment},
                                               {"izz", moment},
                                               {"ixy", "0"},
                                               {"ixz", "0"},
                                               {"iyz", "0"}}});
}

UrdfJoint read_joint(XmlElement& joint) {
  UrdfJoint facts;
  if (const XmlElement* const limit = find_child(joint, "limit")) {
    const auto velocity = number_of(*limit, "velocity");
    if (velocity && *velocity > 0.0) facts.max_velocity = velocity;
  }
  if (const XmlElement* const soft = find_child(joint, "safety_controller")) {
    const auto lower = number_of(*soft, "soft_lower_limit");
    const auto upper = number_of(*soft, "soft_upper_limit");
    if (lower && upper && *lower < *upper) facts.soft_range = {*lower, *upper};
  }
  return facts;
}

// Takes the name from shapes that are called like one before. MuJoCo would print a line for each.
void forget_repeated_names(XmlElement& link, std::set<std::string>& known) {
  for (XmlElement& shape : link.children) {
    if (shape.name != "visual" && shape.name != "collision") continue;
    std::erase_if(shape.attributes, [&](const auto& attribute) {
      return attribute.first == "name" && !known.insert(attribute.second).second;
    });
  }
}

// What MuJoCo does with the description. An own <mujoco> in it goes before.
void add_settings(XmlElement& robot) {
  const auto set = [](XmlElement& element, const char* setting, const char* value) {
    if (element.find(setting) == nullptr) element.attributes.emplace_back(setting, value);
  };
  XmlElement& own = child(robot, "mujoco");
  // Fixed links keep their names, and what only looks is drawn.
  set(child(own, "compiler"), "fusestatic", "false");
  set(child(own, "compiler"), "discardvisual", "false");
  // A URDF cannot say a step; MuJoCo's own 2 ms are coarse for a light link.
  set(child(own, "option"), "timestep", "0.001");
}

}  // namespace

std::map<std::string, UrdfJoint> prepare_urdf(XmlElement& robot, const std::string& source,
                                              bool repairs) {
  require_expanded(robot, source);
  add_settings(robot);
  std::map<std::string, UrdfJoint> joints;
  std::set<std::string> shapes;
  for (XmlElement& element : robot.children) {
    if (element.name == "link") {
      complete_inertia(element, source, repairs);
      forget_repeated_names(element, shapes);
    }
    const std::string* const name = element.find("name");
    if (element.name != "joint" || name == nullptr) continue;
    require(joints.emplace(*name, read_joint(element)).second,
            text_of(place_of(source, element), "there is another joint '", *name,
                    "'; rename one of them"));
  }
  return joints;
}

}  // namespace trifinger::detail
