// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/ipc/fork.hpp"

namespace trifinger::rendering {

/// OpenGL without a screen. The library libEGL is loaded when the first context is made, so
/// programs that draw nothing need no OpenGL.
///
/// Any thread may use a context, one thread at a time. Drivers of OpenGL have threads, which a
/// forked child does not have. So a context belongs to the process that made it, and a child of a
/// process that has drawn can draw only if it was started as a new program ("spawn").
class Context {
 public:
  /// @throws Error that says what to install if this machine cannot draw, InheritedHandle in a
  /// forked child of a process that has drawn
  Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context();

  /// Makes a context the current one of the calling thread as long as the object lives. Then the
  /// context that was current before is current again.
  class Use {
   public:
    /// @throws Error if another thread uses the context, InheritedHandle in a forked child
    explicit Use(const Context& context);
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    ~Use();

   private:
    void* display_;
    void* previous_context_;
    void* previous_draw_;
    void* previous_read_;
  };

 private:
  ipc::ForkGuard fork_;
  void* display_;
  void* context_;
};

}  // namespace trifinger::rendering
