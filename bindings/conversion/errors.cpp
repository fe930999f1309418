// SPDX-License-Identifier: BSD-3-Clause
#include "errors.hpp"

#include <exception>
#include <string_view>

#include "log/recorder.hpp"
#include "text.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/learning/policy.hpp"
#include "trifinger/log/log.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

template <class... Data>
void raise(const char* name, const Error& error, const Data&... data) {
  const nb::object type = nb::module_::import_("trifinger.errors").attr(name);
  const nb::object exception = type(to_message(error.what()), data...);
  PyErr_SetObject(type.ptr(), exception.ptr());
}

void set_error(const std::exception_ptr& thrown) {
  try {
    std::rethrow_exception(thrown);
  } catch (const RobotStopped& error) {
    raise("RobotStopped", error, to_python(error.fault()));
  } catch (const HistoryLost& error) {
    raise("HistoryLost", error, error.oldest());
  } catch (const AcausalAction& error) {
    raise("AcausalAction", error);
  } catch (const ActionMissing& error) {
    raise("ActionMissing", error);
  } catch (const SessionNotFound& error) {
    raise("SessionNotFound", error);
  } catch (const ControlHeld& error) {
    raise("ControlHeld", error);
  } catch (const RobotOwned& error) {
    raise("RobotOwned", error);
  } catch (const IncompatibleSession& error) {
    raise("IncompatibleSession", error);
  } catch (const InheritedHandle& error) {
    raise("InheritedHandle", error);
  } catch (const log::AlreadyRecorded& error) {
    raise("AlreadyRecorded", error);
  } catch (const log::NotInLog& error) {
    raise("NotInLog", error);
  } catch (const learning::PolicyFileError& error) {
    raise("PolicyFileError", error);
  } catch (const InvalidArgument& error) {
    raise("InvalidArgument", error);
  } catch (const TimedOut& error) {
    raise("TimedOut", error);
  } catch (const SystemError& error) {
    // Python chooses the subclass from the number: PermissionError, FileNotFoundError.
    const nb::object exception =
        nb::module_::import_("builtins")
            .attr("OSError")(error.error_number(), to_message(error.what()));
    PyErr_SetObject(exception.type().ptr(), exception.ptr());
  } catch (const Error& error) {
    raise("Error", error);
  }
}

void translate(const std::exception_ptr& thrown, void* /*payload*/) {
  try {
    set_error(thrown);
  } catch (nb::python_error& error) {
    // Ctrl-C came while the exception was made. Out of here, it would end the program.
    error.restore();
  }
}

}  // namespace

void register_errors() { nb::register_exception_translator(translate); }

Shown<"trifinger.session_info.Fault | None"> to_python(const std::optional<Fault>& fault) {
  if (!fault || !*fault) return nb::none();
  const std::string_view code = name_of(fault->code);
  return nb::module_::import_("trifinger.session_info")
      .attr("Fault")(nb::str(code.data(), code.size()), fault->detail, fault->time_index,
                     fault->needs_recovery());
}

}  // namespace trifinger::bindings
