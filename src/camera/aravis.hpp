// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "library.hpp"

namespace trifinger::camera {

// The functions and numbers of Aravis 0.8 that are used here, as its manual gives them. Objects are
// plain pointers. The library is loaded when the first camera of this kind is opened.
struct Aravis {
  struct Error {
    std::uint32_t domain;
    int code;
    char* message;
  };
  // Collects the error of a call, and frees it.
  class Outcome {
   public:
    Outcome() = default;
    Outcome(const Outcome&) = delete;
    Outcome& operator=(const Outcome&) = delete;
    ~Outcome() { clear(); }

    [[nodiscard]] Error** get() {
      clear();
      return &error_;
    }
    [[nodiscard]] bool is_error() const noexcept { return error_ != nullptr; }
    [[nodiscard]] std::string text() const { return error_ == nullptr ? "" : error_->message; }

   private:
    void clear() {
      if (error_ != nullptr) Aravis::instance().clear_error(&error_);
    }

    Error* error_{nullptr};
  };

  static constexpr std::uint32_t kMono8 = 0x01080001;
  static constexpr std::uint32_t kBayerRg8 = 0x01080009;
  static constexpr std::uint32_t kRgb8 = 0x02180014;
  static constexpr int kContinuous = 0;
  static constexpr int kNoPacketSocket = 1;
  static constexpr int kAutomaticSocketBuffer = 1;
  static constexpr int kSuccess = 0;
  static constexpr int kCleared = 1;
  static constexpr int kAborted = 7;

  void (*enable_interface)(const char*);
  void (*update_device_list)();
  unsigned (*get_n_devices)();
  const char* (*get_device_id)(unsigned);
  const char* (*get_device_vendor)(unsigned);
  const char* (*get_device_model)(unsigned);
  const char* (*get_device_serial)(unsigned);
  const char* (*get_device_protocol)(unsigned);
  const char* (*get_device_address)(unsigned);
  void* (*camera_new)(const char*, Error**);
  int (*camera_is_gv)(void*);
  void (*set_region)(void*, int x, int y, int width, int height, Error**);
  void (*get_region)(void*, int* x, int* y, int* width, int* height, Error**);
  void (*set_pixel_format)(void*, std::uint32_t, Error**);
  void (*set_acquisition_mode)(void*, int, Error**);
  void (*set_frame_rate)(void*, double, Error**);
  void (*set_exposure_time)(void*, double microseconds, Error**);
  int (*is_gain_available)(void*, Error**);
  void (*set_gain)(void*, double, Error**);
  void (*gv_set_stream_options)(void*, int);
  unsigned (*gv_auto_packet_size)(void*, Error**);
  unsigned (*get_payload)(void*, Error**);
  void* (*create_stream)(void*, void* callback, void* data, Error**);
  void (*start_acquisition)(void*, Error**);
  void (*stop_acquisition)(void*, Error**);
  void* (*buffer_new)(std::size_t, void*);
  void (*push_buffer)(void* stream, void* buffer);
  void* (*pop_buffer)(void* stream, std::uint64_t microseconds);
  int (*buffer_status)(void*);
  std::uint64_t (*buffer_frame_id)(void*);
  std::uint64_t (*buffer_timestamp)(void*);
  const void* (*buffer_data)(void*, std::size_t*);
  void (*object_set)(void*, const char*, ...);
  void (*object_unref)(void*);
  void (*clear_error)(Error**);

  // Throws trifinger::Error that says what to install.
  static const Aravis& instance() {
    static const Aravis functions;
    return functions;
  }

 private:
  Aravis() {
    const Library library("libaravis-0.8.so.0", "a GenICam camera",
                          "on Debian: apt-get install libaravis-0.8-0");
    library.find("arv_enable_interface", enable_interface);
    library.find("arv_update_device_list", update_device_list);
    library.find("arv_get_n_devices", get_n_devices);
    library.find("arv_get_device_id", get_device_id);
    library.find("arv_get_device_vendor", get_device_vendor);
    library.find("arv_get_device_model", get_device_model);
    library.find("arv_get_device_serial_nbr", get_device_serial);
    library.find("arv_get_device_protocol", get_device_protocol);
    library.find("arv_get_device_address", get_device_address);
    library.find("arv_camera_new", camera_new);
    library.find("arv_camera_is_gv_device", camera_is_gv);
    library.find("arv_camera_set_region", set_region);
    library.find("arv_camera_get_region", get_region);
    library.find("arv_camera_set_pixel_format", set_pixel_format);
    library.find("arv_camera_set_acquisition_mode", set_acquisition_mode);
    library.find("arv_camera_set_frame_rate", set_frame_rate);
    library.find("arv_camera_set_exposure_time", set_exposure_time);
    library.find("arv_camera_is_gain_available", is_gain_available);
    library.find("arv_camera_set_gain", set_gain);
    library.find("arv_camera_gv_set_stream_options", gv_set_stream_options);
    library.find("arv_camera_gv_auto_packet_size", gv_auto_packet_size);
    library.find("arv_camera_get_payload", get_payload);
    library.find("arv_camera_create_stream", create_stream);
    library.find("arv_camera_start_acquisition", start_acquisition);
    library.find("arv_camera_stop_acquisition", stop_acquisition);
    library.find("arv_buffer_new", buffer_new);
    library.find("arv_stream_push_buffer", push_buffer);
    library.find("arv_stream_timeout_pop_buffer", pop_buffer);
    library.find("arv_buffer_get_status", buffer_status);
    library.find("arv_buffer_get_frame_id", buffer_frame_id);
    library.find("arv_buffer_get_timestamp", buffer_timestamp);
    library.find("arv_buffer_get_data", buffer_data);
    library.find("g_object_set", object_set);
    library.find("g_object_unref", object_unref);
    library.find("g_clear_error", clear_error);
  }
};

}  // namespace trifinger::camera
