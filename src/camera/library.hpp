// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <dlfcn.h>

#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::camera {

// A shared library that is loaded when somebody needs it, and never unloaded.
class Library {
 public:
  // `remedy` says how to get it: "install Debian's libturbojpeg0". Throws Error.
  Library(const char* file, const std::string& purpose, const std::string& remedy)
      : handle_(::dlopen(file, RTLD_NOW | RTLD_LOCAL)), file_(file) {
    if (handle_ == nullptr) {
      throw Error(purpose + " needs the library " + file_ + ", which cannot be loaded; " + remedy);
    }
  }

  // Sets `function` to that of the library with this name. Throws Error.
  template <class Function>
  void find(const char* name, Function*& function) const {
    function = reinterpret_cast<Function*>(::dlsym(handle_, name));
    if (function == nullptr) {
      throw Error("the library " + file_ + " has no function " + name +
                  "; another version of it is needed");
    }
  }

 private:
  void* handle_;
  std::string file_;
};

}  // namespace trifinger::camera
