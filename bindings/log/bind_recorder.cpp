// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include <filesystem>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/text.hpp"
#include "trifinger/log/recorder_thread.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {

void bind_recorder(nb::module_& m) {
  nb::class_<log::RecorderThread>(
      m, "Recorder",
      "Records a robot of this process in a thread of its own. Nothing is lost, because the "
      "simulation\nwaits for the recorder. The end of the program stops it.")
      .def(
          "stop",
          [](log::RecorderThread& recorder) {
            const GilRelease release;
            recorder.stop();
          },
          "Writes what is left and finishes the file. Nothing is recorded after this.")
      .def_prop_ro(
          "file",
          [](const log::RecorderThread& recorder) -> nb::object {
            const std::filesystem::path file = recorder.file();
            return file.empty() ? nb::none() : to_python(file);
          },
          nb::sig("def file(self) -> pathlib.Path | None"),
          "The newest file; None before the first session.")
      .def(
          "__enter__", [](nb::handle self) { return nb::borrow(self); },
          nb::sig("def __enter__(self) -> Recorder"))
      .def(
          "__exit__",
          [](log::RecorderThread& recorder, const nb::args&) {
            const GilRelease release;
            recorder.stop();
          },
          nb::sig("def __exit__(self, *exception: object) -> None"));
}

}  // namespace trifinger::bindings
