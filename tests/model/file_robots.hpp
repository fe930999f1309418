// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

namespace trifinger::test {

/// A robot with everything that a file may have: a position actuator with a gear, a motor with a
/// gear, a coupling, a slide without stops, a joint without a motor, and two objects.
inline constexpr const char* kArm = R"(<mujoco model="some arm">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><geom density="500"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <body name="rail" pos="0 0 0.8">
      <joint name="rail" type="slide" axis="1 0 0" damping="5"/>
      <geom type="box" size="0.05 0.05 0.02"/>
      <body name="upper">
        <joint name="shoulder" axis="0 1 0" range="-2 2" damping="0.2" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
        <body name="lower" pos="0 0 -0.2">
          <joint name="elbow" axis="0 1 0" range="-2.5 2.5" damping="0.2" armature="0.01"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
          <body name="near" pos="0 0 -0.2">
            <joint name="near" axis="0 1 0" range="0 1.5" damping="0.05" armature="0.002"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.05" size="0.01" contype="0" conaffinity="0"/>
            <body name="far" pos="0 0 -0.05">
              <joint name="far" axis="0 1 0" range="0 1.5" damping="0.05" armature="0.002"/>
              <geom type="capsule" fromto="0 0 0 0 0 -0.05" size="0.01" contype="0" conaffinity="0"/>
              <body name="flap" pos="0 0.03 0">
                <joint name="flap" axis="1 0 0" range="-1 1" damping="0.01" stiffness="0.5" armature="0.001"/>
                <geom type="box" size="0.01 0.02 0.005" pos="0 0.02 0" contype="0" conaffinity="0"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
    <body name="ball" pos="0.5 0 0.05"><freejoint/><geom type="sphere" size="0.05"/></body>
    <body name="brick" pos="-0.5 0 0.05"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>
  </worldbody>
  <tendon>
    <fixed name="finger" limited="true" range="0 1.5"><joint joint="near" coef="0.5"/><joint joint="far" coef="0.5"/></fixed>
  </tendon>
  <equality><joint joint1="far" joint2="near"/></equality>
  <actuator>
    <position name="servo" joint="shoulder" kp="10" kv="1" gear="2" forcerange="-6 6"/>
    <motor name="drive" joint="elbow" gear="4" ctrllimited="true" ctrlrange="-2 2"/>
    <position name="pull" tendon="finger" kp="3" forcerange="-1 1"/>
    <velocity name="slider" joint="rail" kv="20" forcerange="-30 20"/>
  </actuator>
  <keyframe><key name="up" qpos="0 0.5 1 0.2 0.2 0 0.5 0 0.05 1 0 0 0 -0.5 0 0.05 1 0 0 0" ctrl="1 1 1 1"/></keyframe>
</mujoco>
)";

/// Limits with which this robot may run.
inline constexpr const char* kArmSafety = R"(safety:
  every_joint: {safety_kd: 0.3, max_velocity: 3, braking: 4, default_kp: 20, default_kd: 1}
  shoulder: {soft_lower: -1.8, soft_upper: 1.8}
  elbow: {soft_lower: -2.2, soft_upper: 2.2}
  finger: {soft_lower: 0.1, soft_upper: 1.4, safety_kd: 0.1}
  rail: {soft_lower: -0.8, soft_upper: 0.8, hard_lower: -2, hard_upper: 2, max_torque: 15, safety_kd: 5, max_velocity: 1, default_kp: 100, default_kd: 10}
)";

inline void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path) << text;
}

}  // namespace trifinger::test
