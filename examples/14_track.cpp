// SPDX-License-Identifier: BSD-3-Clause
// Finds the cube in the images of three cameras, as `trifinger track` does, and compares with where
// the simulation has put it.
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <iostream>
#include <numbers>
#include <span>
#include <vector>

#include "trifinger/camera/images.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"
#include "trifinger/tracking/tracked_object.hpp"
#include "trifinger/tracking/tracker.hpp"

int main() {
  const auto simulation = trifinger::rendering::make_simulation(
      trifinger::load_robot_config("sim_cameras", {"cameras.rate=20"}));
  // A cube in a corner of the arena, turned about the vertical.
  const double half = 0.3;
  const Eigen::Vector3d truth(0.05, 0.06, 0.0325);
  simulation.robot().place_object("cube", {.position = {truth.x(), truth.y(), truth.z()},
                                           .orientation = {std::cos(half), 0, 0, std::sin(half)}});
  auto robot = simulation.connect();
  const trifinger::camera::CameraReader cameras(robot);
  // The colours of its faces and their sizes come from the scene.
  trifinger::tracking::Tracker tracker(cameras.calibration().cameras,
                                       trifinger::tracking::tracked_object(trifinger::cube()));

  const auto hold = trifinger::hold_position(robot.latest_observation());
  auto t = robot.append_desired_action(hold);
  while (t < 100) t = robot.append_desired_action(hold);
  robot.wait_until_time_index(t);
  const auto images = cameras.get_latest_at(t).value();
  std::vector<std::span<const std::byte>> pixels;
  pixels.reserve(images.cameras().size());
  for (std::size_t i = 0; i < images.cameras().size(); ++i) pixels.push_back(images.pixels(i));

  const trifinger::tracking::Estimate found = tracker.track(pixels);
  if (!found.is_sure()) {
    std::cout << "the cube was not found\n";
    return EXIT_FAILURE;
  }
  const double distance = (found.pose.translation() - truth).norm();
  const Eigen::Quaterniond turn(found.pose.linear());
  const double angle =
      turn.angularDistance(Eigen::Quaterniond(std::cos(half), 0, 0, std::sin(half)));
  std::cout << "the cube is at " << found.pose.translation().transpose() << " m, " << 1e3 * distance
            << " mm and " << angle * 180 / std::numbers::pi << " degrees from the truth, by "
            << found.cameras << " cameras\n";
  return distance < 3e-3 ? EXIT_SUCCESS : EXIT_FAILURE;
}
