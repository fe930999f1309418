// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <cmath>
#include <initializer_list>
#include <iomanip>
#include <limits>
#include <locale>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "blueprint.hpp"
#include "model/export.hpp"
#include "model/rotation_between.hpp"

namespace trifinger {
namespace {

using detail::Form;
using detail::Role;
using detail::Solid;

// An exact half turn about x produces some -0. URDF files need not show them.
double tidy(double value) { return value == 0 ? 0.0 : value; }

std::string numbers(std::initializer_list<double> values) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << std::setprecision(std::numeric_limits<double>::max_digits10);
  const char* separator = "";
  for (const double value : values) {
    text << separator << tidy(value);
    separator = " ";
  }
  return text.str();
}

std::string triple(const Eigen::Vector3d& values) {
  return numbers({values.x(), values.y(), values.z()});
}

std::string pose_text(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond rotation(pose.linear());
  return triple(pose.translation()) + ' ' +
         numbers({rotation.w(), rotation.x(), rotation.y(), rotation.z()});
}

// Returns roll, pitch and yaw about fixed axes, as URDF defines them.
Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& rotation) {
  const double level = std::hypot(rotation(0, 0), rotation(1, 0));
  return {std::atan2(rotation(2, 1), rotation(2, 2)), std::atan2(-rotation(2, 0), level),
          std::atan2(rotation(1, 0), rotation(0, 0))};
}

enum class UrdfContent { kRobot, kScene };

// Writes the URDF file, and separately the lines that say where the links are.
class UrdfWriter {
 public:
  UrdfWriter(const RobotDescription& description, UrdfContent content, FrameSources sources = {})
      : description_(description), content_(content), sources_(std::move(sources)) {
    out_.imbue(std::locale::classic());
    out_ << std::setprecision(std::numeric_limits<double>::max_digits10);
    frames_.imbue(std::locale::classic());
    frames_ << "fixed world base_link " << pose_text(Eigen::Isometry3d::Identity()) << '\n';
  }

  void write() {
    out_ << "<?xml version=\"1.0\"?>\n<robot name=\"trifinger-" << figures(description_).name
         << "\">\n"
         // This line is for MuJoCo: it keeps tip and camera frames as separate bodies.
         << "  <mujoco><compiler fusestatic=\"false\" discardvisual=\"false\"/></mujoco>\n"
         << "  <link name=\"base_link\"/>\n";
    empty_link("platform");
    fixed_joint("base_to_platform_joint", "base_link", "platform",
                detail::platform_in_world(description_));
    for (int i = 0; i < num_fingers(description_); ++i) finger(i);
    if (description_.cameras)
      for (const CameraFigures& figures : camera_figures()) camera(figures);
    if (content_ == UrdfContent::kScene) {
      table();
      for (const ObjectDescription& one : description_.objects) object(one);
    }
    out_ << "</robot>\n";
  }

  [[nodiscard]] std::string urdf() const { return out_.str(); }
  [[nodiscard]] std::string frames() const { return frames_.str(); }

 private:
  void empty_link(const std::string& name) { out_ << "  <link name=\"" << name << "\"/>\n"; }

  void origin(const Eigen::Isometry3d& pose) {
    out_ << "    <origin xyz=\"" << triple(pose.translation()) << "\" rpy=\""
         << triple(roll_pitch_yaw(pose.linear())) << "\"/>\n";
  }

  void joint_head(const std::string& name, const char* type, const std::string& parent,
                  const std::string& child, const Eigen::Isometry3d& pose) {
    out_ << "  <joint name=\"" << name << "\" type=\"" << type << "\">\n"
         << "    <parent link=\"" << parent << "\"/>\n    <child link=\"" << child << "\"/>\n";
    origin(pose);
  }

  void fixed_joint(const std::string& name, const std::string& parent, const std::string& child,
                   const Eigen::Isometry3d& pose) {
    joint_head(name, "fixed", parent, child, pose);
    out_ << "  </joint>\n";
    frames_ << "fixed " << parent << ' ' << child << ' ' << pose_text(pose) << '\n';
  }

  void inertial(const detail::Inertia& inertia) {
    const auto& [xx, yy, zz, xy, xz, yz] = inertia.moment;
    out_ << "    <inertial>\n      <origin xyz=\"" << triple(detail::vector(inertia.centre))
         << "\"/>\n      <mass value=\"" << inertia.mass << "\"/>\n      <inertia ixx=\"" << xx
         << "\" iyy=\"" << yy << "\" izz=\"" << zz << "\" ixy=\"" << xy << "\" ixz=\"" << xz
         << "\" iyz=\"" << yz << "\"/>\n    </inertial>\n";
  }

  void shape(const char* tag, const Eigen::Isometry3d& pose, const std::string& geometry,
             const detail::Colour& colour) {
    out_ << "    <" << tag << ">\n  ";
    origin(pose);
    out_ << "      <geometry>" << geometry << "</geometry>\n";
    if (std::string_view(tag) == "visual") {
      std::ostringstream rgba;
      rgba.imbue(std::locale::classic());
      rgba << colour.red << ' ' << colour.green << ' ' << colour.blue << ' ' << colour.opacity;
      out_ << "      <material name=\"" << rgba.str() << "\"><color rgba=\"" << rgba.str()
           << "\"/></material>\n";
    }
    out_ << "    </" << tag << ">\n";
  }

  void solid(const Solid& solid, int finger) {
    const detail::Colour colour = detail::colour(solid.paint, description_.variant, finger);
    if (solid.role != Role::kTouches) solid_as("visual", solid, colour);
    if (solid.role != Role::kLooks && content_ == UrdfContent::kRobot)
      solid_as("collision", solid, colour);
  }

  void sphere(const char* tag, const Eigen::Vector3d& centre, double radius,
              const detail::Colour& colour) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << "<sphere radius=\"" << radius << "\"/>";
    shape(tag, Eigen::Isometry3d(Eigen::Translation3d(centre)), text.str(), colour);
  }

  void solid_as(const char* tag, const Solid& solid, const detail::Colour& colour) {
    const Eigen::Vector3d from = detail::vector(solid.from);
    const Eigen::Vector3d to = detail::vector(solid.to);
    if (solid.form == Form::kSphere) {
      sphere(tag, from, solid.radius, colour);
      return;
    }
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (solid.form == Form::kBox) {
      pose.translation() = from;
      shape(tag, pose, "<box size=\"" + triple(2 * to) + "\"/>", colour);
      return;
    }
    // URDF has no capsules: a cylinder with a ball at each end replaces one.
    pose.translation() = (from + to) / 2;
    pose.linear() = rotation_between(Eigen::Vector3d::UnitZ(), to - from).toRotationMatrix();
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << "<cylinder radius=\"" << solid.radius << "\" length=\"" << (to - from).norm() << "\"/>";
    shape(tag, pose, text.str(), colour);
    if (solid.form == Form::kCapsule) {
      sphere(tag, from, solid.radius, colour);
      sphere(tag, to, solid.radius, colour);
    }
  }

  void finger(int index) {
    const detail::Finger& finger = detail::finger_blueprint(description_);
    const std::string suffix = detail::finger_suffix(description_, index);
    const VariantFigures& limits = figures(description_);
    const ActuatorParameters drive = actuator(description_);
    const std::vector<std::string> joints = joint_names(description_);
    const char* links[] = {"finger_upper_link", "finger_middle_link", "finger_lower_link"};

    std::string parent = "finger_base_link" + suffix;
    out_ << "  <link name=\"" << parent << "\">\n";
    for (const Solid& part : finger.base) solid(part, index);
    out_ << "  </link>\n";
    fixed_joint("platform_to_" + parent + "_joint", "platform", parent,
                detail::base_in_platform(description_, index));

    for (std::size_t j = 0; j < kJointsPerFinger; ++j) {
      const detail::Link& link = finger.links[j];
      const std::string child = links[j] + suffix;
      out_ << "  <link name=\"" << child << "\">\n";
      inertial(link.inertia);
      for (const Solid& part : link.solids) solid(part, index);
      out_ << "  </link>\n";
      const std::size_t joint = static_cast<std::size_t>(index * kJointsPerFinger) + j;
      const Eigen::Isometry3d pose(Eigen::Translation3d(detail::vector(link.origin)));
      joint_head(joints[joint], "revolute", parent, child, pose);
      frames_ << "turning " << parent << ' ' << child << ' ' << pose_text(pose) << ' '
              << triple(detail::vector(link.axis)) << ' ' << joints[joint] << ' '
              << sources_.joint_field << '[' << joint << "]\n";
      out_ << "    <axis xyz=\"" << triple(detail::vector(link.axis)) << "\"/>\n"
           << "    <limit lower=\"" << limits.hard_lower[j] << "\" upper=\"" << limits.hard_upper[j]
           << "\" effort=\"" << drive.torque_limit << "\" velocity=\"" << drive.no_load_speed
           << "\"/>\n"
           << "    <safety_controller soft_lower_limit=\"" << limits.soft_lower[j]
           << "\" soft_upper_limit=\"" << limits.soft_upper[j] << "\" k_position=\"" << limits.kp[j]
           << "\" k_velocity=\"" << limits.safety_kd[j] << "\"/>\n"
           << "    <dynamics damping=\"" << drive.damping << "\" friction=\"" << drive.friction
           << "\"/>\n  </joint>\n";
      parent = child;
    }

    const std::string tip = tip_names(description_)[static_cast<std::size_t>(index)];
    const Solid ball{Form::kSphere,     {0, 0, 0},           {},
                     limits.tip_radius, detail::Paint::kTip, Role::kBoth};
    out_ << "  <link name=\"" << tip << "\">\n";
    inertial(finger.tip);
    solid(ball, index);
    for (const Solid& part : finger.tip_solids) solid(part, index);
    out_ << "  </link>\n";
    fixed_joint("finger_lower_to_tip_joint" + suffix, parent, tip,
                Eigen::Isometry3d(Eigen::Translation3d(detail::vector(finger.tip_origin))));
  }

  void camera(const CameraFigures& figures) {
    const std::string frame = std::string(figures.name) + "_optical_frame";
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = detail::vector(figures.position);
    pose.linear() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(figures.rotation.data());
    empty_link(frame);
    fixed_joint("platform_to_" + frame + "_joint", "platform", frame, pose);
  }

  void table() {
    const Solid slab{.form = Form::kBox,
                     .from = {0, 0, -0.015},
                     .to = {0.5, 0.5, 0.015},
                     .radius = 0,
                     .paint = detail::Paint::kShell,
                     .role = Role::kBoth};
    out_ << "  <link name=\"table\">\n";
    solid(slab, 0);
    out_ << "  </link>\n";
    fixed_joint("base_to_table_joint", "base_link", "table", Eigen::Isometry3d::Identity());
  }

  void object(const ObjectDescription& object) {
    const Eigen::Vector3d size = detail::vector(object.size);
    Solid body{.form = Form::kBox,
               .from = {},
               .to = {size.x() / 2, size.y() / 2, size.z() / 2},
               .radius = 0,
               .paint = detail::Paint::kFinger,
               .role = Role::kBoth};
    if (object.shape == ObjectShape::kStick) {
      body.form = Form::kCapsule;
      body.radius = size.y() / 2;
      body.from = {body.radius - size.x() / 2, 0, 0};
      body.to = {size.x() / 2 - body.radius, 0, 0};
    } else if (object.shape == ObjectShape::kBall) {
      body.form = Form::kSphere;
      body.radius = size.x() / 2;
    }
    constexpr int kBlue = 2;  // the colour of the third finger
    out_ << "  <link name=\"" << object.name << "\">\n";
    solid(body, kBlue);
    out_ << "  </link>\n";
    joint_head("base_to_" + object.name + "_joint", "floating", "base_link", object.name,
               Eigen::Isometry3d::Identity());
    out_ << "  </joint>\n";
    frames_ << "free base_link " << object.name << ' ' << sources_.object_companion << ' '
            << object.name << ".position " << object.name << ".orientation\n";
  }

  const RobotDescription& description_;
  UrdfContent content_;
  FrameSources sources_;
  std::ostringstream out_;
  std::ostringstream frames_;
};

}  // namespace

std::string export_urdf(const RobotDescription& description) {
  validate(description);
  UrdfWriter writer(description, UrdfContent::kRobot);
  writer.write();
  return writer.urdf();
}

ViewerScene export_scene(const RobotDescription& description, const FrameSources& sources) {
  validate(description);
  UrdfWriter writer(description, UrdfContent::kScene, sources);
  writer.write();
  return {.urdf = writer.urdf(), .frames = writer.frames()};
}

}  // namespace trifinger
