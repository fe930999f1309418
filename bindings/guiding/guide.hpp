// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <memory>

#include "session/frontend.hpp"
#include "trifinger/guiding/guide.hpp"

namespace trifinger::bindings {

/// A guide for Python. All functions are called with the GIL held, and release it while they wait.
class PythonGuide {
 public:
  /// Takes over `frontend`, a PythonFrontend. If it is the guide's own, the end of a `with` block
  /// closes it.
  PythonGuide(nanobind::object frontend, bool owns_frontend, guiding::GuideOptions options);
  ~PythonGuide();

  [[nodiscard]] guiding::Guide& guide() const noexcept { return *guide_; }
  [[nodiscard]] const nanobind::object& frontend() const noexcept { return frontend_; }

  [[nodiscard]] guiding::GuideState state(const ShownSeconds& timeout) const;
  void wait_until_arrived(const ShownSeconds& timeout) const;
  void finish(const ShownSeconds& timeout);
  void stop(const ShownSeconds& timeout);
  /// Ends a `with` block: finishes. After an exception in the block its own errors are not raised.
  void exit(bool is_clean);

 private:
  friend void stop_guides_at_exit();

  void give_back() noexcept;

  nanobind::object frontend_;
  bool owns_frontend_;
  std::unique_ptr<guiding::Guide> guide_;
};

/// Makes the end of the program stop all guides, before their robots' back-ends in this process.
void stop_guides_at_exit();

}  // namespace trifinger::bindings
