# SPDX-License-Identifier: BSD-3-Clause
"""Options of environments; tools/write_stub.py writes them from those of C++."""

import dataclasses
from collections.abc import Mapping
from typing import Literal

FloatRange = tuple[float, float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class OptionFields:
    """The settings of an environment, without their functions."""

    steps_per_action: int = 20
    """Number of steps of the robot for which an action acts."""
    mapping: Literal["state_augmentation", "approximation"] = "approximation"
    """How steps of the robot become states and actions; docs/learning.md compares both."""
    action: Literal["position", "position_change", "relative_position", "torque"] = "position"
    """What numbers from -1 to 1 mean: positions in their range, changes of the desired
    positions, desired positions relative to the measured ones, or shares of the largest
    torque."""
    position_change: float = 0.1
    """Largest change of a desired position by one action, or largest distance from the measured
    one [rad]."""
    leash: float = 0.12
    """Largest distance of a desired position from the measured one, if actions are changes of it
    [rad]. It is observed as `tracking_error`."""
    position_kp: float = 0.0
    """Stiffness with which joints go to desired positions [Nm/rad]; 0: that of the robot. A
    robot whose torques or measurements are late trembles if it is stiff."""
    observation: Literal["flat", "dictionary", "goal", "images"] = "flat"
    """One vector scaled to -1 to 1, its parts in SI units, the vector with a separate goal, or
    the parts with images of the cameras instead of poses of objects."""
    duration: float = 2.0
    """Duration of an episode [s]."""
    per_finger: bool = False
    """Whether observations are ordered finger by finger, with goals in the frame of each finger.
    A policy that the fingers share needs this."""
    symmetric_view: bool = False
    """Whether positions are shown turned about the middle by thirds of a circle, and fingers in
    another order, so that the goal of an object is on the side of finger 0. The fingers are
    turned copies of one, so a policy has a third of the goals to learn."""
    symmetric_object: bool = False
    """Whether it is observed how a cube lies, whatever the colours of its faces, in place of its
    orientation: nine numbers, the same for the 24 orientations that differ in colours only.
    For goals that are positions."""
    object_offsets: bool = False
    """Whether the offsets from the object, and from where a tip would push it to its goal, to
    the tips are observed, too, and how far and in which direction the goal is. They follow
    from the rest, but 2 cm are little among its numbers."""
    keypoints: bool = False
    """Whether the corners of a cube of 65 mm at the object, and at its goal if that has an
    orientation, are observed in place of quaternions."""
    frames: tuple[str, ...] = ()
    """Names of sites, bodies or geoms of a robot from a file, which take the place of tips:
    tasks such as reach have a goal for each."""
    position_noise: float = 0.0
    """Standard deviation of measured joint positions [rad]."""
    velocity_noise: float = 0.0
    """Standard deviation of measured joint velocities [rad/s]."""
    object_poses: Literal["exact", "tracked"] = "exact"
    """How poses of objects are known: exactly, apart from the delay, noise and losses below; or
    from a tracker, in images of the cameras."""
    object_period: float = 0.01
    """Time between two measured poses of a simulated object [s]."""
    object_delay: float = 0.0
    """Delay from measuring a pose of a simulated object to its arrival [s]. Tracked poses arrive
    with their images if these are later."""
    object_position_noise: float = 0.0
    """Standard deviation of measured object positions, per axis [m]."""
    object_orientation_noise: float = 0.0
    """Standard deviation of measured object orientations, per axis [rad]."""
    object_loss: float = 0.0
    """Probability that a pose of a simulated object never arrives."""
    camera_rate: float = 30.0
    """Images of each simulated camera per second [Hz]. Tracked poses come at this rate."""
    camera_delay: float = 0.02
    """Delay from the middle of the exposure of a simulated image to its arrival [s]."""
    camera_size: int = 540
    """Width and height of simulated images [pixel], up to 540: the middle of the image, scaled
    by a whole number."""
    camera_varies: bool = False
    """Whether light, colours, dust and noise of simulated images differ in each episode.
    docs/simulated_cameras.md says how much."""
    condition: Literal["as documented", "as built", "worn"] = "as documented"
    """State of the simulated robot: with perfect joints, with errors of homing, friction, play,
    delays and noise of a robot that was built with care, or with twice as much. Each episode
    has another robot. Options below that are not at their defaults take the place of what
    this says."""
    object_mass: FloatRange = (1.0, 1.0)
    """Factor on the mass of simulated objects."""
    friction: FloatRange = (1.0, 1.0)
    """Factor on the friction of all simulated surfaces."""
    motor_gain: FloatRange = (1.0, 1.0)
    """Share of the applied torque that simulated motors deliver."""
    torque_delay: tuple[int, int] = (0, 0)
    """Delay until simulated motors deliver a torque, up to 10 [steps]."""
    pair_friction: Mapping[str, FloatRange] = dataclasses.field(default_factory=dict, hash=False)
    """Factors on the friction of pairs of simulated surfaces, in addition to `friction`:
    {"tip_object": (0.7, 1.2)}. docs/simulation.md names the pairs."""
    contact_time: FloatRange = (1.0, 1.0)
    """Factor on the time constants of simulated contacts: larger is softer."""
    rotor_inertia: FloatRange = (1.0, 1.0)
    """Factor on the rotor inertia of simulated motors."""
    joint_damping: FloatRange = (1.0, 1.0)
    """Factor on the damping of simulated joints; the damping of the safety checks stays."""
    joint_friction: FloatRange = (0.0, 0.0)
    """Dry friction that is added to that of simulated joints [Nm]."""
    stop_margin: FloatRange = (1.0, 1.0)
    """Factor on the distance from hard limits to mechanical stops."""
    homing_error: FloatRange = (0.0, 0.0)
    """Largest error of the zero of simulated encoders [rad], [m]."""
    motor_spread: FloatRange = (0.0, 0.0)
    """Share by which `motor_gain` of a simulated motor differs at most."""
    torque_ripple: FloatRange = (0.0, 0.0)
    """Share of the torque that comes and goes as a simulated motor turns."""
    backlash: FloatRange = (0.0, 0.0)
    """Play between simulated motors and their joints [rad], [m]."""
    measurement_delay: tuple[int, int] = (0, 0)
    """Age of measured positions and velocities of simulated joints [steps]."""
    motor_heat: FloatRange = (0.0, 0.0)
    """Heat of simulated motors at the start of an episode, as a share of their limit."""
    tip_radius: FloatRange = (1.0, 1.0)
    """Factor on the radius of simulated tips."""
    object_speed: FloatRange = (0.0, 0.0)
    """Speed of a simulated object at the start of an episode, in a random direction [m/s]."""
