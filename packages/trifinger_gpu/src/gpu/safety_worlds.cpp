// SPDX-License-Identifier: BSD-3-Clause
// One source for processors and GPUs: write_ptx.py compiles it to PTX with clang alone, which needs
// no CUDA.
#ifdef __CUDA__
// <cmath> declares it for processors only, and a GPU has no library to link.
__attribute__((device)) double sqrt(double number) noexcept { return __builtin_sqrt(number); }
// The standard library comes first, because all that follows becomes code for both. Of the library,
// clang takes what is constexpr. Clang's own <new> needs malloc before all others.
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>
#pragma clang force_cuda_host_device begin
#endif

#include "gpu/safety_worlds.hpp"

#ifdef __CUDA__
#pragma clang force_cuda_host_device end

// One thread for each robot. Programs load it by this name.
extern "C" __attribute__((global)) void trifinger_apply_safety(trifinger::gpu::SafetyWorlds all) {
  const auto world =
      static_cast<std::int32_t>(__nvvm_read_ptx_sreg_ctaid_x() * __nvvm_read_ptx_sreg_ntid_x() +
                                __nvvm_read_ptx_sreg_tid_x());
  if (world < all.num_worlds) trifinger::gpu::apply_to_world(all, world);
}
#else
void trifinger::gpu::apply_to_worlds(const SafetyWorlds& all) noexcept {
  for (std::int32_t world = 0; world < all.num_worlds; ++world) apply_to_world(all, world);
}
#endif
