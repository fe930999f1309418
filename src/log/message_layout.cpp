// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/log/message_layout.hpp"
