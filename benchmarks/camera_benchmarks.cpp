// SPDX-License-Identifier: BSD-3-Clause
#include <chrono>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "harness.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/core/payload.hpp"

namespace trifinger::benchmarks {
namespace {

std::vector<camera::Camera> three_cameras() {
  std::vector<camera::Camera> cameras(3);
  for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i].name = "camera" + std::to_string(i);
  return cameras;
}

constexpr int kTriples = 200;

double microseconds_since(Clock::time_point begin, int count) {
  return std::chrono::duration<double, std::micro>(Clock::now() - begin).count() / count;
}

}  // namespace

std::vector<Row> images(const Effort& effort) {
  const std::vector<camera::Camera> cameras = three_cameras();
  const ElementDescription payload = camera::image_payload(cameras);
  const std::vector<std::byte> camera_memory(payload.size(), std::byte{77});
  // The copy goes to as many places in turn as there are in the shared memory.
  PayloadWriter writer = PayloadWriter::anonymous(payload);
  constexpr std::size_t kPlaces = PayloadWriter::kDefaultHistory;
  std::vector<std::vector<std::byte>> places(kPlaces, std::vector<std::byte>(payload.size()));

  const Paired publish = alternate(
      effort.rounds,
      [&] {
        const auto begin = Clock::now();
        for (int i = 0; i < kTriples; ++i) {
          const std::span<std::byte> place = writer.begin();
          std::memcpy(place.data(), camera_memory.data(), place.size());
          static_cast<void>(writer.commit());
        }
        return microseconds_since(begin, kTriples);
      },
      [&] {
        const auto begin = Clock::now();
        for (int i = 0; i < kTriples; ++i) {
          std::memcpy(places[static_cast<std::size_t>(i) % kPlaces].data(), camera_memory.data(),
                      payload.size());
        }
        return microseconds_since(begin, kTriples);
      });

  const PayloadReader reader("anonymous", camera::kCompanion, payload);
  static_cast<void>(writer.begin());
  const PayloadReference newest = writer.commit();
  Samples views;
  for (int round = 0; round < effort.rounds; ++round) {
    constexpr int kViews = 10'000;
    const auto begin = Clock::now();
    int valid = 0;
    for (int i = 0; i < kViews; ++i) valid += reader.view(newest).is_valid() ? 1 : 0;
    if (valid == kViews) views.add(microseconds_since(begin, kViews));
  }

  Samples mosaics;
  std::vector<std::byte> rgb(3 * cameras[0].format.size());
  for (int round = 0; round < effort.rounds; ++round) {
    const auto begin = Clock::now();
    for (int i = 0; i < 3; ++i) {
      camera::to_rgb(cameras[0].format, std::span(camera_memory).first(cameras[0].format.size()),
                     rgb);
    }
    mosaics.add(microseconds_since(begin, 1));
  }
  return {make_row("publish three images of 540 x 540", "µs", publish, "memcpy of the bytes",
                   "<= 1.3x", publish.ratio.median() <= 1.3),
          make_row("get a view of three images and check it", "µs", views, "<= 2 µs",
                   views.median() <= 2),
          make_row("colours of three mosaics of 540 x 540", "µs", mosaics, "", true)};
}

}  // namespace trifinger::benchmarks
