// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

// The few functions of libEGL that we call. The library is loaded at run time, and its headers are
// not needed to compile.
namespace trifinger::rendering::detail {

struct Egl {
  using Display = void*;
  using Surface = void*;
  using Handle = void*;  // of a context
  using Config = void*;
  using Device = void*;
  using Boolean = std::uint32_t;

  static constexpr std::int32_t kNone = 0x3038;
  static constexpr std::int32_t kSurfaceType = 0x3033;
  static constexpr std::int32_t kPbufferBit = 0x0001;
  static constexpr std::int32_t kRenderableType = 0x3040;
  static constexpr std::int32_t kOpenGlBit = 0x0008;
  static constexpr std::uint32_t kOpenGlApi = 0x30A2;
  static constexpr std::uint32_t kPlatformDevice = 0x313F;
  static constexpr std::uint32_t kPlatformSurfaceless = 0x31DD;
  static constexpr std::int32_t kDraw = 0x3059;
  static constexpr std::int32_t kRead = 0x305A;

  void* (*get_proc_address)(const char*){};
  Display (*get_platform_display)(std::uint32_t platform, void* native,
                                  const std::int32_t* attributes){};
  Boolean (*query_devices)(std::int32_t most, Device* devices, std::int32_t* count){};
  Boolean (*initialize)(Display, std::int32_t* major, std::int32_t* minor){};
  Boolean (*choose_config)(Display, const std::int32_t* attributes, Config*, std::int32_t most,
                           std::int32_t* count){};
  Boolean (*bind_api)(std::uint32_t){};
  std::uint32_t (*query_api)(){};
  Handle (*create_context)(Display, Config, Handle shared, const std::int32_t* attributes){};
  Boolean (*destroy_context)(Display, Handle){};
  Boolean (*make_current)(Display, Surface draw, Surface read, Handle){};
  Handle (*get_current_context)(){};
  Display (*get_current_display)(){};
  Surface (*get_current_surface)(std::int32_t){};

  // A display and a configuration that can draw with OpenGL.
  Display display{};
  Config config{};

  // Loads libEGL and opens a display, once per process. The display stays open: it belongs to the
  // process, and others may use it, such as MuJoCo's Python package.
  // Throws Error that says what to install.
  static const Egl& instance();
};

}  // namespace trifinger::rendering::detail
