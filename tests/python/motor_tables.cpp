// SPDX-License-Identifier: BSD-3-Clause
// Prints what is known of each Dynamixel motor, in lines of words with tabs between them.
#include <iostream>

#include "dynamixel/control_table.hpp"

int main() {
  using namespace trifinger::dynamixel;
  std::cout << "position\t" << kPositionUnit << '\n';
  for (const MotorModel& model : kMotorModels) {
    std::cout << "model\t" << model.name << '\t' << model.number << '\n';
    for (const Register& which : control_table_of(model)) {
      std::cout << "register\t" << which.name << '\t' << which.address << '\t' << int{which.size}
                << '\t' << which.is_signed << '\t' << which.unit << '\t' << which.scale << '\n';
    }
    for (const IndirectBlock& block : model.series->indirect_blocks) {
      std::cout << "block\t" << block.first_address << '\t' << block.first_data << '\t'
                << block.count() << '\t' << int{block.first_firmware} << '\t'
                << int{block.last_firmware} << '\n';
    }
  }
}
