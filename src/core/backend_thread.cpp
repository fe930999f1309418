// SPDX-License-Identifier: BSD-3-Clause
#include <exception>
#include <functional>
#include <future>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger {

BackendThread::BackendThread(Backend& backend, const RealtimeOptions& realtime,
                             std::function<void()> on_end)
    : backend_(backend) {
  std::promise<std::vector<std::string>> entered;
  std::promise<void> end;
  auto refused = entered.get_future();
  end_ = end.get_future();
  thread_ = std::jthread([&backend, realtime, on_end = std::move(on_end),
                          entered = std::move(entered), end = std::move(end)]() mutable {
    try {
      entered.set_value(enter_realtime(realtime));
    } catch (...) {
      entered.set_exception(std::current_exception());
      return;
    }
    try {
      backend.run();
      end.set_value();
    } catch (...) {
      // This thread cannot throw to anybody. Front-ends see that the session has ended.
      end.set_exception(std::current_exception());
    }
    if (on_end) on_end();
  });
  refused_ = refused.get();
}

BackendThread::~BackendThread() { backend_.request_stop(); }

bool BackendThread::wait_for_end(Timeout timeout) const {
  if (timeout == kForever) {
    end_.wait();
    return true;
  }
  return end_.wait_for(timeout) == std::future_status::ready;
}

void BackendThread::stop() {
  backend_.request_stop();
  end_.get();
}

}  // namespace trifinger
