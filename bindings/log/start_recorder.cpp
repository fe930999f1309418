// SPDX-License-Identifier: BSD-3-Clause
#include "start_recorder.hpp"

#include <nanobind/nanobind.h>

#include <utility>
#include <vector>

#include "conversion/choice.hpp"
#include "conversion/gil.hpp"

namespace trifinger::bindings {
namespace {

// All recorders of this process; changed under the GIL only.
std::vector<std::weak_ptr<log::RecorderThread>> recorders;

}  // namespace

std::shared_ptr<log::RecorderThread> start_recorder(const std::string& robot,
                                                    const std::filesystem::path& folder,
                                                    const std::string& precision,
                                                    const std::string& images) {
  log::RecorderOptions options;
  options.folder = folder;
  options.precision = choice<log::Precision>("precision", kPrecisions, precision);
  options.images = choice<log::ImageStorage>("images", kImageStorages, images);
  auto recorder = std::make_shared<log::RecorderThread>(robot, std::move(options));
  std::erase_if(recorders, [](const auto& other) { return other.expired(); });
  recorders.push_back(recorder);
  return recorder;
}

void stop_recorders_at_exit() {
  nanobind::module_::import_("atexit").attr("register")(nanobind::cpp_function([] {
    for (const auto& weak : std::exchange(recorders, {})) {
      if (const auto recorder = weak.lock(); recorder && !recorder->is_inherited()) {
        const GilRelease release;
        recorder->stop();
      }
    }
  }));
}

}  // namespace trifinger::bindings
