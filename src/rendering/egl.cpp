// SPDX-License-Identifier: BSD-3-Clause
#include "egl.hpp"

#include <dlfcn.h>

#include <array>
#include <span>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::rendering::detail {
namespace {

constexpr const char* kRemedy =
    "; on Debian, `apt-get install libegl1 libgl1-mesa-dri` is all that drawing without a screen "
    "needs";

template <class Function>
void load(void* library, const char* name, Function*& function) {
  function = reinterpret_cast<Function*>(dlsym(library, name));
  if (function == nullptr) {
    throw Error("cannot draw: libEGL.so.1 has no function " + std::string(name) + kRemedy);
  }
}

// True if `display` can draw with OpenGL; then it is the one that is used.
bool try_display(Egl& egl, Egl::Display display) {
  if (display == nullptr || egl.initialize(display, nullptr, nullptr) == 0) return false;
  const std::array attributes{Egl::kSurfaceType, Egl::kPbufferBit, Egl::kRenderableType,
                              Egl::kOpenGlBit, Egl::kNone};
  std::int32_t count = 0;
  if (egl.choose_config(display, attributes.data(), &egl.config, 1, &count) == 0 || count < 1) {
    return false;
  }
  egl.display = display;
  return true;
}

// Graphics hardware comes first in the list of devices, Mesa's software last.
bool open_display(Egl& egl) {
  if (egl.query_devices != nullptr) {
    std::array<Egl::Device, 16> devices{};
    std::int32_t count = 0;
    if (egl.query_devices(static_cast<std::int32_t>(devices.size()), devices.data(), &count) != 0) {
      for (Egl::Device device : std::span(devices).first(static_cast<std::size_t>(count))) {
        if (try_display(egl, egl.get_platform_display(Egl::kPlatformDevice, device, nullptr))) {
          return true;
        }
      }
    }
  }
  return try_display(egl, egl.get_platform_display(Egl::kPlatformSurfaceless, nullptr, nullptr));
}

Egl load_egl() {
  // MuJoCo looks for this library among those that are loaded for everybody. It is never unloaded,
  // because drivers leave threads and handlers behind.
  void* library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr)
    throw Error("cannot draw: there is no libEGL.so.1" + std::string(kRemedy));
  Egl egl;
  load(library, "eglGetProcAddress", egl.get_proc_address);
  load(library, "eglInitialize", egl.initialize);
  load(library, "eglChooseConfig", egl.choose_config);
  load(library, "eglBindAPI", egl.bind_api);
  load(library, "eglQueryAPI", egl.query_api);
  load(library, "eglCreateContext", egl.create_context);
  load(library, "eglDestroyContext", egl.destroy_context);
  load(library, "eglMakeCurrent", egl.make_current);
  load(library, "eglGetCurrentContext", egl.get_current_context);
  load(library, "eglGetCurrentDisplay", egl.get_current_display);
  load(library, "eglGetCurrentSurface", egl.get_current_surface);
  egl.get_platform_display = reinterpret_cast<decltype(egl.get_platform_display)>(
      egl.get_proc_address("eglGetPlatformDisplayEXT"));
  egl.query_devices =
      reinterpret_cast<decltype(egl.query_devices)>(egl.get_proc_address("eglQueryDevicesEXT"));
  if (egl.get_platform_display == nullptr || !open_display(egl)) {
    throw Error("cannot draw: libEGL.so.1 finds no driver with OpenGL" + std::string(kRemedy));
  }
  return egl;
}

}  // namespace

const Egl& Egl::instance() {
  struct Opened {
    ipc::ForkGuard fork;
    Egl egl = load_egl();
  };
  static const Opened opened;  // after an exception the next call tries again
  if (opened.fork.is_inherited()) {
    throw InheritedHandle(
        "cannot draw: this process was forked from one that has drawn, and drivers of OpenGL do "
        "not survive that; start it as a new program (multiprocessing's \"spawn\" or "
        "\"forkserver\")");
  }
  return opened.egl;
}

}  // namespace trifinger::rendering::detail
