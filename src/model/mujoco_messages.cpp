// SPDX-License-Identifier: BSD-3-Clause
#include "model/mujoco_messages.hpp"

#include <mujoco/mujoco.h>

#include <mutex>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger {

void silence_mujoco() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (mju_user_warning == nullptr) mju_user_warning = [](const char*) {};
    if (mju_user_error == nullptr) {
      mju_user_error = [](const char* problem) { throw Error(std::string("MuJoCo: ") + problem); };
    }
  });
}

}  // namespace trifinger
