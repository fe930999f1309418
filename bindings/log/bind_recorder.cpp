// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include <filesystem>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/text.hpp"
#include "conversion/with.hpp"
#include "docstrings.hpp"
#include "log/recorder_thread.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {

void bind_recorder(nb::module_& m) {
  nb::class_<log::RecorderThread> type(
      m, "Recorder",
      also(docs::RecorderThread::RecorderThread, R"(The end of the program stops it.)").c_str());
  type.def(
          "stop",
          [](log::RecorderThread& recorder) {
            const GilRelease release;
            recorder.stop();
          },
          docs::RecorderThread::stop)
      .def_prop_ro(
          "file",
          [](const log::RecorderThread& recorder) -> nb::object {
            const std::filesystem::path file = recorder.file();
            return file.empty() ? nb::none() : to_python(file);
          },
          nb::sig("def file(self) -> pathlib.Path | None"),
          "The newest file; None before the first session.");
  bind_with(type, "Recorder", [](log::RecorderThread& recorder, bool /*is_clean*/) {
    const GilRelease release;
    recorder.stop();
  });
}

}  // namespace trifinger::bindings
