// SPDX-License-Identifier: BSD-3-Clause
// Runs the robot my_robot until Ctrl-C or `trifinger stop my_robot`.
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <string>

#include "my_robot.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"

int main(int argument_count, char** arguments) {
  // These signals are blocked in all threads, so that they wait for sigwait below.
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  try {
    const std::string path = argument_count > 1 ? arguments[1] : "my_robot.yml";
    const MyRobotConfig config = MyRobotConfig::load(path);
    MyRobotDriver driver(config);
    auto host = trifinger::SessionHost::named(config.name, config.session);
    trifinger::Backend backend(driver, host, config.backend);
    // Ends the program, too, if the back-end cannot go on.
    trifinger::BackendThread loop(backend, {.demand = trifinger::Demand::kTry},
                                  [] { kill(getpid(), SIGTERM); });
    for (const std::string& sentence : loop.refused()) std::cerr << sentence << '\n';
    std::cout << config.name << " runs until Ctrl-C\n" << std::flush;
    int signal = 0;
    sigwait(&ends, &signal);
    loop.stop();
    std::cout << config.name << " has stopped\n";
    return EXIT_SUCCESS;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
