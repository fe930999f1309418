// SPDX-License-Identifier: BSD-3-Clause
#include "rendering/context.hpp"

#include "egl.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::rendering {

using detail::Egl;

Context::Context() {
  const Egl& egl = Egl::instance();
  display_ = egl.display;
  const std::uint32_t api = egl.query_api();
  if (egl.bind_api(Egl::kOpenGlApi) == 0) throw Error("cannot draw: libEGL knows no OpenGL");
  context_ = egl.create_context(display_, egl.config, nullptr, nullptr);
  egl.bind_api(api);  // this thread may draw with another one elsewhere
  if (context_ == nullptr) throw Error("cannot draw: the driver refuses a context of OpenGL");
}

Context::~Context() {
  if (fork_.is_inherited()) return;
  Egl::instance().destroy_context(display_, context_);
}

Context::Use::Use(const Context& context) : display_(context.display_) {
  if (context.fork_.is_inherited()) {
    throw InheritedHandle(
        "what draws was made before fork(); make it in the child process, which must be started as "
        "a new program (multiprocessing's \"spawn\" or \"forkserver\")");
  }
  const Egl& egl = Egl::instance();
  previous_context_ = egl.get_current_context();
  previous_draw_ = egl.get_current_surface(Egl::kDraw);
  previous_read_ = egl.get_current_surface(Egl::kRead);
  if (void* display = egl.get_current_display(); display != nullptr) display_ = display;
  if (egl.make_current(context.display_, nullptr, nullptr, context.context_) == 0) {
    throw Error("cannot draw: another thread draws with the same context");
  }
}

Context::Use::~Use() {
  Egl::instance().make_current(display_, previous_draw_, previous_read_, previous_context_);
}

}  // namespace trifinger::rendering
