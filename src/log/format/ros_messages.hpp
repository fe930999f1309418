// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace trifinger::log::detail {

// A message type of ROS 2 and its definition ("ros2msg"), with the types that it uses.
struct MessageType {
  std::string_view name;
  std::string definition;
};

// The one frame that all robots share.
inline constexpr std::string_view kWorld = "world";

// Returns the text with which a definition continues for a type that it uses.
[[nodiscard]] inline std::string used_type(std::string_view name, std::string_view fields) {
  return std::string(80, '=').append("\nMSG: ").append(name).append("\n").append(fields);
}

[[nodiscard]] inline std::string time_definition() {
  return used_type("builtin_interfaces/Time",
                   "int32 sec\n"
                   "uint32 nanosec\n");
}

[[nodiscard]] inline std::string header_definition() {
  return used_type("std_msgs/Header",
                   "builtin_interfaces/Time stamp\n"
                   "string frame_id\n") +
         time_definition();
}

[[nodiscard]] inline const MessageType& event_type() {
  static const MessageType type{"rcl_interfaces/msg/Log",
                                "byte DEBUG=10\n"
                                "byte INFO=20\n"
                                "byte WARN=30\n"
                                "byte ERROR=40\n"
                                "byte FATAL=50\n"
                                "builtin_interfaces/Time stamp\n"
                                "uint8 level\n"
                                "string name\n"
                                "string msg\n"
                                "string file\n"
                                "string function\n"
                                "uint32 line\n" +
                                    time_definition()};
  return type;
}

[[nodiscard]] inline const MessageType& text_type() {
  static const MessageType type{"std_msgs/msg/String", "string data\n"};
  return type;
}

[[nodiscard]] inline const MessageType& frames_type() {
  static const MessageType type{
      "tf2_msgs/msg/TFMessage",
      "geometry_msgs/TransformStamped[] transforms\n" +
          used_type("geometry_msgs/TransformStamped",
                    "std_msgs/Header header\n"
                    "string child_frame_id\n"
                    "geometry_msgs/Transform transform\n") +
          header_definition() +
          used_type("geometry_msgs/Transform",
                    "geometry_msgs/Vector3 translation\n"
                    "geometry_msgs/Quaternion rotation\n") +
          used_type("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n") +
          used_type("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n")};
  return type;
}

[[nodiscard]] inline const MessageType& joint_states_type() {
  static const MessageType type{"sensor_msgs/msg/JointState",
                                "std_msgs/Header header\n"
                                "string[] name\n"
                                "float64[] position\n"
                                "float64[] velocity\n"
                                "float64[] effort\n" +
                                    header_definition()};
  return type;
}

[[nodiscard]] inline const MessageType& compressed_image_type() {
  static const MessageType type{"sensor_msgs/msg/CompressedImage",
                                "std_msgs/Header header\n"
                                "string format\n"
                                "uint8[] data\n" +
                                    header_definition()};
  return type;
}

[[nodiscard]] inline const MessageType& raw_image_type() {
  static const MessageType type{"sensor_msgs/msg/Image",
                                "std_msgs/Header header\n"
                                "uint32 height\n"
                                "uint32 width\n"
                                "string encoding\n"
                                "uint8 is_bigendian\n"
                                "uint32 step\n"
                                "uint8[] data\n" +
                                    header_definition()};
  return type;
}

[[nodiscard]] inline const MessageType& camera_info_type() {
  static const MessageType type{"sensor_msgs/msg/CameraInfo",
                                "std_msgs/Header header\n"
                                "uint32 height\n"
                                "uint32 width\n"
                                "string distortion_model\n"
                                "float64[] d\n"
                                "float64[9] k\n"
                                "float64[9] r\n"
                                "float64[12] p\n"
                                "uint32 binning_x\n"
                                "uint32 binning_y\n"
                                "sensor_msgs/RegionOfInterest roi\n" +
                                    header_definition() +
                                    used_type("sensor_msgs/RegionOfInterest",
                                              "uint32 x_offset\n"
                                              "uint32 y_offset\n"
                                              "uint32 height\n"
                                              "uint32 width\n"
                                              "bool do_rectify\n")};
  return type;
}

}  // namespace trifinger::log::detail
