// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/unique_ptr.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/text.hpp"
#include "log.hpp"
#include "log/replay.hpp"
#include "session/frontend.hpp"
#include "session/running_backend.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// Returns the session `log`, or the newest session of `robot` in the log or path `log`.
log::LoggedSession to_session(nb::handle log, const std::string& robot) {
  if (nb::isinstance<PythonLoggedSession>(log)) {
    return nb::cast<const PythonLoggedSession&>(log).session();
  }
  if (nb::isinstance<log::Log>(log)) return nb::cast<const log::Log&>(log).session(robot);
  const std::vector<std::filesystem::path> paths = to_paths(log);
  const GilRelease release;
  return (paths.size() == 1 ? log::Log(paths.front()) : log::Log(paths)).session(robot);
}

std::unique_ptr<PythonFrontend> replay(nb::handle log, const std::string& robot,
                                       std::optional<TimeIndex> first,
                                       std::optional<TimeIndex> last, bool strict) {
  const log::LoggedSession session = to_session(log, robot);
  std::unique_ptr<log::ReplayDriver> driver;
  {
    const GilRelease release;
    driver = std::make_unique<log::ReplayDriver>(session,
                                                 log::ReplayOptions{.first = first, .last = last});
  }
  const BackendOptions backend = driver->backend_options();
  const SessionOptions options = driver->session_options();
  return std::make_unique<PythonFrontend>(
      start_inline(session.name(), std::move(driver), backend, options, {.strict = strict}),
      PythonFrontend::Role{.controls = true, .is_inline = true});
}

}  // namespace

void bind_replay(nb::module_& m) {
  m.def("replay", &replay, "log"_a, nb::kw_only(), "robot"_a = "", "first"_a = nb::none(),
        "last"_a = nb::none(), "strict"_a = true,
        nb::sig("def replay(log: str | os.PathLike[str] | collections.abc.Sequence[str | "
                "os.PathLike[str]] | Log | LoggedSession, *, robot: str = '', first: int | None = "
                "None, last: int | None = None, strict: bool = True) -> Frontend"),
        R"(Plays a session of a log as if it were the robot, inside the waits of the front-end.

Observations, companions and applied actions are those of the log, whatever the user does. If a
desired action differs from the logged one, the status of the step has the flag ACTION_REJECTED.
After the last step the session ends with the fault "exhausted". It needs no recovery, and finish()
does not raise because of it.

`log` may be a session; otherwise the newest session of `robot` is played. `robot` is needed if the
log has several robots. The steps from `first` to before `last` are played, `first` as step 0;
default: all.

Raises NotInLog if a step is missing in the log, InvalidArgument.)");
}

}  // namespace trifinger::bindings
