// SPDX-License-Identifier: BSD-3-Clause
#include "object_reader.hpp"

#include <cstring>

#include "trifinger/core/errors.hpp"
#include "trifinger/sim/object_observation.hpp"

namespace trifinger::manipulation {
namespace {

// Where a pose is in an element, so that it can be copied in one piece.
std::size_t offset_of_pose(const Session& session, const std::string& object) {
  const ElementDescription& element = session.description().observation;
  const FieldDescription* const found = element.find(object + ".position");
  if (found == nullptr) {
    throw IncompatibleSession("'" + session.info().name + "' does not say where an object '" +
                              object + "' is; its elements are\n" + element.text());
  }
  for (FieldDescription field : describe<ObjectPose>().fields()) {
    field.name = object + "." + field.name;
    field.offset += found->offset;
    const FieldDescription* const there = element.find(field.name);
    if (there == nullptr || *there != field) {
      throw IncompatibleSession("'" + session.info().name + "' has no pose '" + object +
                                "' as this program expects it; build both from the same version");
    }
  }
  return found->offset;
}

std::size_t offset_of_stamp(const Session& session) {
  const FieldDescription* const found =
      session.description().observation.find("stamp.arrival_index");
  if (found == nullptr)
    throw IncompatibleSession("the elements of '" + session.info().name + "' have no stamp");
  return found->offset;
}

}  // namespace

ObjectReader::ObjectReader(const Frontend<TriFinger>& robot, const std::string& object)
    : companion_(robot.companion(kObjectCompanion)),
      element_(companion_.session().description().observation.size()),
      stamp_offset_(offset_of_stamp(companion_.session())),
      pose_offset_(offset_of_pose(companion_.session(), object)) {}

std::optional<SeenPose> ObjectReader::new_pose(TimeIndex t) {
  if (!companion_.get_latest_at(t, element_.data(), kForever)) return std::nullopt;
  Stamp stamp;
  std::memcpy(&stamp, element_.data() + stamp_offset_, sizeof(stamp));
  if (last_ && stamp.capture_index <= *last_) return std::nullopt;
  last_ = stamp.capture_index;
  ObjectPose pose;
  std::memcpy(&pose, element_.data() + pose_offset_, sizeof(pose));
  const auto& q = pose.orientation;
  return SeenPose{stamp.capture_index,
                  {.position = Eigen::Vector3d::Map(pose.position.data()),
                   .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized()}};
}

}  // namespace trifinger::manipulation
