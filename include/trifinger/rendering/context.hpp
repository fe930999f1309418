// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace trifinger::rendering {

/// OpenGL without a screen. The library libEGL is loaded when the first context is made, so
/// programs that draw nothing need no OpenGL.
///
/// Any thread may use a context, one thread at a time.
class Context {
 public:
  /// @throws Error that says what to install if this machine cannot draw
  Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context();

  /// Makes a context the current one of the calling thread as long as the object lives. Then the
  /// context that was current before is current again.
  class Use {
   public:
    /// @throws Error if another thread uses the context
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
  void* display_;
  void* context_;
};

}  // namespace trifinger::rendering
