// SPDX-License-Identifier: BSD-3-Clause
// Three cameras look at the robot. Like poses of objects, images have their own rate and delay:
// `get_latest_at(t)` returns those that had arrived at step t. Pixels are looked at in place.
#include <cstddef>
#include <cstdlib>
#include <iostream>
#include <span>
#include <vector>

#include "trifinger/camera/images.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/rendering/simulation_with_cameras.hpp"

namespace {

// The mean red, green and blue of an image, from 0 to 255.
std::vector<double> mean_colour(const trifinger::camera::ImageFormat& format,
                                std::span<const std::byte> pixels) {
  std::vector<std::byte> rgb(pixels.size() * 3 / trifinger::camera::channels(format.pixels));
  trifinger::camera::to_rgb(format, pixels, rgb);
  std::vector<double> sum(3);
  for (std::size_t i = 0; i < rgb.size(); ++i) sum[i % 3] += std::to_integer<int>(rgb[i]);
  const auto pixel_count = static_cast<double>(rgb.size()) / 3;
  for (double& value : sum) value /= pixel_count;
  return sum;
}

}  // namespace

int main(int argument_count, char** arguments) {
  // Simulated cameras at 20 Hz, whose images are 20 ms old when they arrive.
  const auto simulation = trifinger::rendering::make_simulation(
      trifinger::load_robot_config("sim_cameras", {"cameras.rate=20", "cameras.delay=0.02"}));
  auto robot = argument_count > 1 ? trifinger::connect<trifinger::TriFinger>(arguments[1])
                                  : simulation.connect();
  const trifinger::camera::CameraReader cameras(robot);

  const auto hold = trifinger::hold_position(robot.latest_observation());
  int seen = 0;
  auto t = robot.append_desired_action(hold);
  for (; t < 300; t = robot.append_desired_action(hold)) {
    robot.wait_until_time_index(t);
    if (t % 100 != 0) continue;
    const auto images = cameras.get_latest_at(t);  // nothing if none had arrived
    if (!images) continue;
    for (const trifinger::camera::Camera& camera : images->cameras()) {
      const auto colour = mean_colour(camera.format, images->pixels(camera.name));
      images->require_valid();  // nobody has overwritten the pixels meanwhile
      std::cout << "step " << t << ": " << camera.name << " saw at step "
                << images->stamp().capture_index << " a mean colour of " << colour[0] << " "
                << colour[1] << " " << colour[2] << "\n";
      ++seen;
    }
  }
  return seen > 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
