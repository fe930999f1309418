// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include <filesystem>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "conversion/with.hpp"
#include "docstrings.hpp"
#include "log/recorder_thread.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {

void bind_recorder(nb::module_& m) {
  nb::class_<log::RecorderThread> type(
      m, "Recorder",
      also(docs::RecorderThread::RecorderThread, R"(The end of the program stops it.)"));
  type.def(
          "stop",
          [](log::RecorderThread& recorder) {
            const GilRelease release;
            recorder.stop();
          },
          docs::RecorderThread::stop)
      .def_prop_ro(
          "file", [](const log::RecorderThread& recorder)->Shown<"pathlib.Path | None"> {
            const std::filesystem::path file = recorder.file();
            if (file.empty()) return nb::none();
            return to_python(file);
          },
          "The newest file; None before the first session.");
  bind_with(type, "Recorder", [](log::RecorderThread& recorder, bool /*is_clean*/) {
    const GilRelease release;
    recorder.stop();
  });
}

}  // namespace trifinger::bindings
