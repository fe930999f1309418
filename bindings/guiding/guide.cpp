// SPDX-License-Identifier: BSD-3-Clause
#include "guide.hpp"

#include <chrono>
#include <set>
#include <utility>

#include "conversion/gil.hpp"
#include "conversion/timeout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

constexpr Timeout kFinishTime = std::chrono::seconds(5);

// All guides of this process; changed under the GIL only.
std::set<PythonGuide*> guides;

}  // namespace

PythonGuide::PythonGuide(nb::object frontend, bool owns_frontend, guiding::GuideOptions options)
    : frontend_(std::move(frontend)), owns_frontend_(owns_frontend) {
  options.interrupt = check_signals;
  auto& lender = nb::cast<PythonFrontend&>(frontend_);
  std::shared_ptr<UntypedFrontend> lent = lender.lend();
  try {
    const GilRelease release;
    guide_ = std::make_unique<guiding::Guide>(std::move(lent), std::move(options));
  } catch (...) {
    lender.take_back();
    throw;
  }
  guides.insert(this);
}

PythonGuide::~PythonGuide() {
  guides.erase(this);
  {
    const GilRelease release;
    guide_.reset();
  }
  give_back();
}

guiding::GuideState PythonGuide::state(const ShownSeconds& timeout) const {
  const Timeout limit = to_timeout(timeout);
  const GilRelease release;
  return guide_->state(limit);
}

void PythonGuide::wait_until_arrived(const ShownSeconds& timeout) const {
  const Timeout limit = to_timeout(timeout);
  const GilRelease release;
  guide_->wait_until_arrived(limit);
}

void PythonGuide::finish(const ShownSeconds& timeout) {
  const Timeout limit = to_timeout(timeout);
  const GilRelease release;
  guide_->finish(limit);
}

void PythonGuide::stop(const ShownSeconds& timeout) {
  const Timeout limit = to_timeout(timeout);
  const GilRelease release;
  guide_->stop(limit);
}

void PythonGuide::exit(bool is_clean) {
  try {
    const GilRelease release;
    guide_->finish(kFinishTime);
  } catch (const Error&) {
    give_back();
    // The exception of the block says more.
    if (is_clean) throw;
    return;
  } catch (...) {
    // Ctrl-C while the robot brakes.
    try {
      const GilRelease release;
      guide_->stop();
    } catch (const Error&) {
      // What interrupted the end says more.
    } catch (...) {
      give_back();
      throw;
    }
    give_back();
    throw;
  }
  give_back();
}

void PythonGuide::give_back() noexcept {
  auto& lender = nb::cast<PythonFrontend&>(frontend_);
  lender.take_back();
  if (!owns_frontend_) return;
  try {
    lender.close();
  } catch (...) {
    // Only checks of inline robots make it throw, and a guide has none of these.
  }
}

void stop_guides_at_exit() {
  nb::module_::import_("atexit").attr("register")(nb::cpp_function([] {
    while (!guides.empty()) {
      PythonGuide* const guide = *guides.begin();
      guides.erase(guides.begin());
      try {
        const GilRelease release;
        guide->guide_->stop();
      } catch (const Error&) {
        // The program ends; nobody is left to hear it.
      }
    }
  }));
}

}  // namespace trifinger::bindings
