// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/counted.hpp"

#include <cstring>
#include <string_view>
#include <utility>

namespace trifinger {
namespace {

// Goes through the values of an element, one joint vector after the other.
class Reader {
 public:
  explicit Reader(const void* element) noexcept : next_(static_cast<const std::byte*>(element)) {}
  template <class T>
  void read(PerJoint<T>& values) noexcept {
    std::memcpy(values.begin(), next_, values.size() * sizeof(T));
    next_ += values.size() * sizeof(T);
  }

 private:
  const std::byte* next_;
};

class Writer {
 public:
  explicit Writer(void* element) noexcept : next_(static_cast<std::byte*>(element)) {}
  template <class T>
  void write(const PerJoint<T>& values) noexcept {
    std::memcpy(next_, values.begin(), values.size() * sizeof(T));
    next_ += values.size() * sizeof(T);
  }
  void write(std::span<const double> values) noexcept {
    next_ = std::ranges::copy(std::as_bytes(values), next_).out;
  }

 private:
  std::byte* next_;
};

// A unit of hinges, of slides, and of a robot that has both.
std::string unit_of(std::string_view angular, std::string_view linear,
                    std::span<const JointKind> joints) {
  if (std::ranges::find(joints, JointKind::kSlide) == joints.end()) return std::string(angular);
  if (std::ranges::find(joints, JointKind::kHinge) == joints.end()) return std::string(linear);
  return std::string(angular) + " or " + std::string(linear);
}

// Describes the fields of a described struct of one joint, but for all `joints`.
class Fields {
 public:
  explicit Fields(std::span<const JointKind> joints) : joints_(joints) {}

  Fields& add(std::string name, std::string_view angular, std::string_view linear) {
    return add(std::move(name), ScalarType::kFloat64, unit_of(angular, linear, joints_));
  }
  Fields& add(std::string name, ScalarType type, std::string unit = "") {
    return add({.name = std::move(name),
                .type = type,
                .shape = {joints_.size()},
                .unit = std::move(unit),
                .offset = 0});
  }
  Fields& add(FieldDescription field) {
    field.offset = size_;
    size_ += field.count() * size_of(field.type);
    fields_.push_back(std::move(field));
    return *this;
  }
  [[nodiscard]] ElementDescription description() { return ElementDescription(fields_); }

 private:
  std::span<const JointKind> joints_;
  std::vector<FieldDescription> fields_;
  std::size_t size_{0};
};

Fields action_fields(std::span<const JointKind> joints) {
  return Fields(joints)
      .add("torque", "Nm", "N")
      .add("position", "rad", "m")
      .add("position_kp", "Nm/rad", "N/m")
      .add("position_kd", "Nms/rad", "Ns/m");
}

}  // namespace

void read_element(const void* element, CountedAction& target) noexcept {
  Reader reader(element);
  reader.read(target.torque);
  reader.read(target.position);
  reader.read(target.position_kp);
  reader.read(target.position_kd);
}

void read_element(const void* element, CountedObservation& target) noexcept {
  Reader reader(element);
  reader.read(target.position);
  reader.read(target.velocity);
  reader.read(target.torque);
}

void write_element(const CountedAction& action, void* element) noexcept {
  Writer writer(element);
  writer.write(action.torque);
  writer.write(action.position);
  writer.write(action.position_kp);
  writer.write(action.position_kd);
}

void write_element(const CountedObservation& observation, void* element) noexcept {
  write_element(observation, {}, {}, {}, element);
}

void write_element(const CountedObservation& observation, std::span<const double> joint_position,
                   std::span<const double> joint_velocity, std::span<const double> tip_force,
                   void* element) noexcept {
  Writer writer(element);
  writer.write(observation.position);
  writer.write(observation.velocity);
  writer.write(observation.torque);
  writer.write(joint_position);
  writer.write(joint_velocity);
  writer.write(tip_force);
}

void write_element(const CountedAppliedAction& applied, void* element) noexcept {
  Writer writer(element);
  writer.write(applied.torque);
  writer.write(applied.position);
  writer.write(applied.position_kp);
  writer.write(applied.position_kd);
  writer.write(applied.reasons);
  writer.write(applied.thermal_margin);
}

RobotTypes describe_counted(std::string type, std::span<const JointKind> joints,
                            std::span<const FieldDescription> more) {
  if (joints.empty() || joints.size() > kMaxCountedJoints) {
    throw InvalidArgument("a robot has " + std::to_string(joints.size()) +
                          " joints, must have 1 to " + std::to_string(kMaxCountedJoints));
  }
  Fields observation(joints);
  observation.add("position", "rad", "m").add("velocity", "rad/s", "m/s").add("torque", "Nm", "N");
  for (const FieldDescription& field : more) observation.add(field);
  RobotTypes types{.type = std::move(type),
                   .action = action_fields(joints).description(),
                   .applied_action = action_fields(joints)
                                         .add("reasons", ScalarType::kUint64)
                                         .add("thermal_margin", ScalarType::kFloat64)
                                         .description(),
                   .observation = observation.description(),
                   .default_action = {}};
  types.default_action.resize(types.action.size());
  write_element(CountedAction(joints.size()), types.default_action.data());
  return types;
}

}  // namespace trifinger
