// SPDX-License-Identifier: BSD-3-Clause
#include "frontend.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "checks.hpp"
#include "conversion/choice.hpp"
#include "conversion/element.hpp"
#include "conversion/gil.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "joint/hold_action.hpp"
#include "payload.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/guiding/guide.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

// Calls `wait` without the GIL. The handle is released before the GIL is taken again, because that
// release may end a session.
template <class Handle, class Wait>
auto without_gil(std::shared_ptr<Handle> handle, const Wait& wait) {
  const GilRelease release;
  const std::shared_ptr<Handle> user = std::move(handle);
  return wait(user->frontend);
}

constexpr const char* kClosedMeanwhile = "this handle was closed while a thread waited with it";

// The enumerators of `OnLate`.
constexpr std::array<std::string_view, 3> kOnLate{"nothing", "repeat", "hold"};

std::string suggestion(const nb::object& name, const nb::object& names) {
  const nb::object matches =
      nb::module_::import_("difflib").attr("get_close_matches")(name, names, 1);
  if (nb::len(matches) == 0) return {};
  return ". Did you mean '" + nb::cast<std::string>(matches[0]) + "'?";
}

// Assigns like NumPy, but refuses values that an integer field cannot hold instead of cutting them.
void assign(const nb::object& action, const nb::object& name, const nb::object& value) {
  const nb::object dtype = action.attr("dtype")[name];
  const auto text = [&](const std::string& reason) {
    return "field '" + text_of(name) + "' holds " + text_of(dtype) + "; " + reason;
  };
  try {
    action[name] = value;
  } catch (const nb::python_error& error) {
    // NumPy 1 only warns of an integer that does not fit; where warnings are errors, that is one.
    if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError) &&
        !error.matches(PyExc_OverflowError) && !error.matches(PyExc_DeprecationWarning)) {
      throw;
    }
    const std::string wrong = wrong_shape(name, dtype, value);
    throw InvalidArgument(wrong.empty() ? text(text_of(error.value())) : wrong);
  }
  const auto kind = nb::cast<std::string>(dtype.attr("base").attr("kind"));
  if (kind != "i" && kind != "u") return;
  const nb::object is_kept =
      nb::steal(PyObject_RichCompare(nb::object(action[name]).ptr(), value.ptr(), Py_EQ));
  if (!is_kept.is_valid()) throw nb::python_error();
  if (!nb::cast<bool>(nb::bool_(nb::module_::import_("numpy").attr("all")(is_kept)))) {
    throw InvalidArgument(text(std::string(nb::repr(value).c_str()) + " does not fit"));
  }
}

}  // namespace

PythonFrontend::Appending::Appending(PythonFrontend& frontend)
    : is_appending_(frontend.is_appending_) {
  if (is_appending_) {
    throw ControlHeld("another thread is appending with this handle; one thread controls a robot");
  }
  is_appending_ = true;
}

PythonFrontend::PythonFrontend(UntypedFrontend frontend, Role role, nb::object checks)
    : role_(role),
      checks_(std::move(checks)),
      handle_(std::make_shared<Handle>(std::move(frontend))) {
  const Session& session = handle_->frontend.session();
  types_[static_cast<std::size_t>(Series::kObservation)] =
      ElementType(session.element(Series::kObservation), class_of(Series::kObservation));
  if (!session.info().is_companion) {
    for (const Series series : {Series::kDesiredAction, Series::kAppliedAction, Series::kStatus}) {
      types_[static_cast<std::size_t>(series)] =
          ElementType(session.element(series), class_of(series));
    }
    nan_check_ = NanCheck(session.description().action, session.description().default_action);
  }
  if (checks_.is_valid()) interruption_ = nb::cast<const Checks&>(checks_).interruption();
  handle_->frontend.set_interrupt([&is_closed = handle_->is_closed, interruption = interruption_] {
    // The thread of a guide has a reason of its own to end a wait, and knows nothing of Python.
    if (guiding::interrupt_guide()) return;
    // relaxed: a flag that guards no data.
    if (is_closed.load(std::memory_order_relaxed)) {
      throw InvalidArgument(kClosedMeanwhile);
    }
    if (interruption != nullptr) interruption->raise();
    check_signals();
  });
}

std::shared_ptr<PythonFrontend::Handle> PythonFrontend::open() const {
  if (handle_ == nullptr) throw InvalidArgument("this handle is closed; connect again");
  return handle_;
}

const ElementType& PythonFrontend::type_of(Series series) const {
  const ElementType& type = types_[static_cast<std::size_t>(series)];
  if (!type.dtype().is_valid())
    static_cast<void>(open()->frontend.session().element(series));  // throws
  return type;
}

TimeIndex PythonFrontend::append_desired_action(nb::handle action, const ShownSeconds& timeout) {
  std::shared_ptr<Handle> handle = open();
  const std::byte* const bytes = type_of(Series::kDesiredAction).bytes_of(action);
  nan_check_.require_numbers(bytes);
  const Timeout limit = to_timeout(timeout);
  const Appending appending(*this);
  // Inline, a full queue needs only one step of the robot. Releasing the
  // GIL is not worth it for so short a wait.
  if (role_.is_inline && is_own_thread())
    return handle->frontend.append_desired_action(bytes, limit);
  return without_gil(std::move(handle), [&](UntypedFrontend& frontend) {
    return frontend.append_desired_action(bytes, limit);
  });
}

TimeIndex PythonFrontend::append_desired_actions(nb::handle actions, const ShownSeconds& timeout) {
  // A burst is many waits, and each is too short for the core to check for Ctrl-C.
  constexpr std::size_t kActionsPerLook = 4096;
  const std::shared_ptr<Handle> handle = open();
  const ElementType& type = type_of(Series::kDesiredAction);
  const auto [array, bytes, count] = type.contiguous(actions);
  for (std::size_t i = 0; i < count; ++i) nan_check_.require_numbers(bytes + i * type.size());
  const Timeout limit = to_timeout(timeout);
  const Appending appending(*this);
  TimeIndex t = -1;
  for (std::size_t i = 0; i == 0 || i < count; i += kActionsPerLook) {
    const std::byte* const first = bytes + i * type.size();
    const std::size_t length = std::min(kActionsPerLook, count - i);
    t = without_gil(handle, [&](UntypedFrontend& frontend) {
      return frontend.append_desired_actions(first, length, limit);
    });
    check_signals();
  }
  return t;
}

void PythonFrontend::set_on_late(const std::string& on_late) {
  const std::shared_ptr<Handle> handle = open();
  const Appending appending(*this);
  const auto what = choice<OnLate>("on_late", kOnLate, on_late);
  handle->frontend.set_on_late(
      what, what == OnLate::kHold ? hold_action_of(handle->frontend.session()) : HoldAction{});
}

PythonFrontend::Held::~Held() {
  if (frontend_.handle_ == handle_) return;
  // It was closed meanwhile: this may end the session, which can need the GIL.
  const GilRelease release;
  handle_.reset();
}

template <class Wait>
auto PythonFrontend::Held::wait(const Wait& wait) const {
  auto result = without_gil(handle_, wait);
  if (frontend_.handle_ != handle_) throw InvalidArgument(kClosedMeanwhile);
  return result;
}

void PythonFrontend::Held::copy(TimeIndex t, std::byte* observation) const {
  wait([&](const UntypedFrontend& frontend) {
    frontend.get(Series::kObservation, t, observation, kForever);
    return true;
  });
}

bool PythonFrontend::Held::copy_latest_at(TimeIndex t, std::byte* element) const {
  return wait([&](const UntypedFrontend& frontend) {
    return frontend.get_latest_at(t, element, kForever);
  });
}

TimeIndex PythonFrontend::Turn::act(const std::byte* actions, std::size_t count, bool is_first,
                                    std::byte* observation) const {
  return wait([&](UntypedFrontend& frontend) {
    // The first action is appended alone, to know its step. A burst returns only its last step, and
    // in real time its steps need not be successive.
    TimeIndex t = frontend.append_desired_action(actions, kForever);
    if (count > 1) {
      const std::size_t size = frontend.session().description().action.size();
      const TimeIndex last = frontend.append_desired_actions(actions + size, count - 1, kForever);
      if (!is_first) t = last;
    }
    frontend.get(Series::kObservation, t, observation, kForever);
    return t;
  });
}

Shown<"Action"> PythonFrontend::new_action(const nb::kwargs& fields) const {
  const std::shared_ptr<Handle> handle = open();
  const ElementType& type = type_of(Series::kDesiredAction);
  auto [action, memory] = type.new_element();
  const auto& bytes = handle->frontend.session().description().default_action;
  std::memcpy(memory, bytes.data(), bytes.size());
  const nb::object names = type.dtype().attr("names");
  for (const auto& [key, value] : fields) {
    const nb::object name = nb::borrow(key);
    if (PySequence_Contains(names.ptr(), name.ptr()) != 1) {
      throw InvalidArgument(
          "an action of this robot has no field '" + text_of(name) + "'; its fields are " +
          nb::cast<std::string>(nb::str(", ").attr("join")(names)) + suggestion(name, names));
    }
    assign(action, name, nb::borrow(value));
  }
  return action;
}

nb::object PythonFrontend::get(Series series, TimeIndex t, const ShownSeconds& timeout) const {
  std::shared_ptr<Handle> handle = open();
  const Timeout limit = to_timeout(timeout);
  auto [element, bytes] = type_of(series).new_element();
  if (!handle->frontend.try_get(series, t, bytes)) {
    without_gil(std::move(handle), [&, target = bytes](const UntypedFrontend& frontend) {
      frontend.get(series, t, target, limit);
    });
  }
  return element;
}

nb::object PythonFrontend::get_many(Series series, TimeIndex first, TimeIndex last,
                                    const ShownSeconds& timeout) const {
  std::shared_ptr<Handle> handle = open();
  const Timeout limit = to_timeout(timeout);
  if (first < 0 || last < first) {
    throw InvalidArgument("the steps from " + std::to_string(first) + " to before " +
                          std::to_string(last) + " are no range: 0 <= first <= last");
  }
  const auto count = static_cast<std::size_t>(last - first);
  auto [elements, bytes] = type_of(series).new_array(count);
  without_gil(std::move(handle), [&, target = bytes](const UntypedFrontend& frontend) {
    frontend.get(series, first, count, target, limit);
  });
  return elements;
}

Shown<"Observation"> PythonFrontend::latest_observation(const ShownSeconds& timeout) const {
  std::shared_ptr<Handle> handle = open();
  const Timeout limit = to_timeout(timeout);
  auto [element, bytes] = type_of(Series::kObservation).new_element();
  without_gil(std::move(handle), [&, target = bytes](const UntypedFrontend& frontend) {
    frontend.latest_observation(target, limit);
  });
  return element;
}

Shown<"Observation | None"> PythonFrontend::get_latest_at(TimeIndex t,
                                                          const ShownSeconds& timeout) const {
  std::shared_ptr<Handle> handle = open();
  const Timeout limit = to_timeout(timeout);
  auto [element, bytes] = type_of(Series::kObservation).new_element();
  const bool is_there =
      without_gil(std::move(handle), [&, target = bytes](const UntypedFrontend& frontend) {
        return frontend.get_latest_at(t, target, limit);
      });
  return is_there ? element : nb::none();
}

nb::object PythonFrontend::payload(nb::handle element) const {
  const std::shared_ptr<Handle> handle = open();
  const UntypedFrontend& frontend = handle->frontend;
  const std::byte* const bytes = type_of(Series::kObservation).bytes_of(element);
  return nb::cast(
      PythonPayload{frontend.payload(bytes), ElementType(frontend.session().payload())});
}

void PythonFrontend::wait_until_time_index(TimeIndex t, const ShownSeconds& timeout) const {
  const Timeout limit = to_timeout(timeout);
  without_gil(open(),
              [&](const UntypedFrontend& frontend) { frontend.wait_until_time_index(t, limit); });
}

TimeIndex PythonFrontend::current_time_index() const {
  return open()->frontend.current_time_index();
}

std::pair<TimeIndex, TimeIndex> PythonFrontend::range(Series series) const {
  const std::shared_ptr<Handle> handle = open();
  static_cast<void>(type_of(series));  // throws if there is none
  return handle->frontend.range(series);
}

void PythonFrontend::finish(const ShownSeconds& timeout) const {
  const Timeout limit = to_timeout(timeout);
  without_gil(open(), [&](UntypedFrontend& frontend) { frontend.finish(limit); });
}

void PythonFrontend::recover(const ShownSeconds& timeout) const {
  const std::shared_ptr<Handle> handle = open();
  in_slices(to_timeout(timeout), [&](Timeout slice) { handle->frontend.recover(slice); });
}

std::optional<Fault> PythonFrontend::fault() const { return open()->frontend.fault(); }

std::optional<TimingRecord> PythonFrontend::timing() const {
  return open()->frontend.session().timing();
}

std::unique_ptr<PythonFrontend> PythonFrontend::companion(const std::string& name) const {
  const std::shared_ptr<Handle> handle = open();
  return std::make_unique<PythonFrontend>(handle->frontend.companion(name),
                                          Role{.is_inline = role_.is_inline}, checks_);
}

SessionInfo PythonFrontend::session_info() const { return open()->frontend.session().info(); }
std::vector<Document> PythonFrontend::documents() const {
  return open()->frontend.session().documents();
}

nb::str PythonFrontend::text() const {
  if (handle_ == nullptr) return nb::str("<Frontend, closed>");
  std::string text = "<Frontend";
  try {
    const SessionInfo info = handle_->frontend.session().info();
    text += " of '" + info.name + "'";
    const bool has_ended = info.phase == SessionInfo::Phase::kEnded;
    if (has_ended) {
      text += ", ended (" + std::string(name_of(info.fault.code)) + ")";
    } else {
      text += info.backend_is_alive ? ", " + std::string(name_of(info.phase))
                                    : std::string(", its back-end is gone");
    }
    if (info.is_companion) {
      text += ", " + std::to_string(info.steps) + " elements";
    } else if (const TimeIndex t = handle_->frontend.current_time_index(); t >= 0) {
      text += ", step " + std::to_string(t);
    }
  } catch (const std::exception& error) {
    text += ": " + std::string(error.what());
  }
  return to_text(text + ">");
}

std::shared_ptr<UntypedFrontend> PythonFrontend::lend() {
  const std::shared_ptr<Handle> handle = open();
  if (is_appending_)
    throw ControlHeld("another thread is appending with this handle; one thread controls a robot");
  is_appending_ = true;
  return {handle, &handle->frontend};
}

void PythonFrontend::close() {
  let_go();
  // The robot may have called a check again on its way to rest.
  if (interruption_ != nullptr) interruption_->raise();
}

void PythonFrontend::let_go() noexcept {
  if (handle_ == nullptr) return;
  // relaxed: a flag that guards no data.
  handle_->is_closed.store(true, std::memory_order_relaxed);
  std::shared_ptr<Handle> handle = std::move(handle_);
  const GilRelease release;
  handle.reset();
}

void PythonFrontend::exit(bool is_clean) {
  if (is_clean && role_.controls && handle_ != nullptr) {
    try {
      finish(nb::none());
    } catch (...) {
      let_go();
      throw;
    }
  }
  close();
}

}  // namespace trifinger::bindings
