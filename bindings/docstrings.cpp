// SPDX-License-Identifier: BSD-3-Clause
// Comments of headers, for Python. tools/write_docstrings.py writes this file.
#include "docstrings.hpp"

// clang-format off
// NOLINTBEGIN(readability-identifier-naming): the names are those of the declarations.
namespace trifinger::bindings::docs {

namespace Acceleration {
const char* const Acceleration = R"(Rate of change of a body's twist.)";
const char* const angular = R"([rad/s^2])";
const char* const linear = R"([m/s^2])";
}

namespace Approach {
const char* const Approach = R"(The path of a tip to its touch. The centre of the tip's sphere passes these points, given in
the world frame.)";
const char* const above = R"([m])";
const char* const beside = R"([m])";
}

namespace Camera {
const char* const Camera = R"(A calibrated camera.)";
const char* const name = R"(For example "camera60".)";
const char* const pose = R"(Pose of the camera's frame in the world: z up, origin on the table.)";
const char* const reduced = R"(The same camera with smaller images, scaled by 1 / `factor`: 2 makes 270 of 540 pixels.

Raises InvalidArgument if the size cannot be divided by it.)";
const char* const resized = R"(The same camera with images of this width: the middle of its images, scaled by a whole
number. 64 makes a pixel of 8 x 8, of the 512 x 512 in the middle of 540 x 540.

Raises InvalidArgument if it is larger than that of the images, or below 1.)";
const char* const serial = R"(The number of the device that is meant; "any" if nobody said it.)";
}

namespace CameraRenderer {
const char* const CameraRenderer = R"(Draws what cameras see of a simulated scene: lens with distortion, Bayer mosaic, blur of
what moves, noise.

A point of the scene appears where `camera.Camera.project` says, to a tenth of a pixel.
Equal arguments give equal images on one machine, bit for bit.

Any thread may use a renderer, one thread at a time.)";
}

namespace CircleTrajectory {
const char* const CircleTrajectory = R"(A horizontal circle that gains its speed smoothly and loses it at the end.)";
const char* const at = R"(The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
`duration` at its end.)";
const char* const duration = R"(`|turns| * period + ramp_time` [s].)";
}

namespace Companion {
const char* const get_latest_at = R"(Returns the newest element that arrived at or before the robot's step `t`; waits for that
step. Returns None if no element had arrived by then.)";
const char* const payload = R"(The payload of `element`, which was read from this companion, in place.

Raises HistoryLost if it was overwritten, or if its writer was started again;
InvalidArgument if the element has no payload.)";
}

namespace Contact {
const char* const Contact = R"(A point at which a tip touches an object and pushes, with friction and without adhesion.

A tip that does not touch is a contact whose `max_normal_force` is 0. It gets no force.)";
const char* const friction = R"(Coefficient that a controller relies on; it should be lower than the real one.)";
const char* const max_normal_force = R"([N], at least `min_normal_force`.)";
const char* const min_normal_force = R"([N], not negative.)";
const char* const normal = R"(Direction in which the tip can push, into the object; its length must not be zero.)";
const char* const position = R"([m])";
}

namespace CostKind {
const char* const CostKind = R"(A quantity that a cost counts.)";
const char* const kEffort = R"(Length of the vector of torques that the plan asks for [Nm].)";
const char* const kJointPosition = R"(Distance of the joints from `joints`, as a vector [rad].)";
const char* const kJointVelocity = R"(Length of the vector of joint velocities [rad/s].)";
const char* const kObjectOrientation = R"(Angle between the object's orientation and `goal.orientation` [rad].)";
const char* const kObjectPosition = R"(Distance of the object's centre from `goal.position` [m].)";
const char* const kObjectRotation = R"(Angular speed of the object [rad/s].)";
const char* const kObjectVelocity = R"(Speed of the object's centre [m/s].)";
const char* const kTargetDistance = R"(Distance of the joints from the plan's targets [rad]; 0 for torques.)";
const char* const kTipObject = R"(Sum over tips of the distance to the object's centre beyond `distance` [m].)";
const char* const kTipPosition = R"(Distance of the tip of finger `index` from `goal.position` [m].)";
}

namespace CostShape {
const char* const CostShape = R"(How a quantity becomes a cost.)";
const char* const kLinear = R"(The quantity itself: the last centimetre counts like the first.)";
const char* const kSmooth = R"(`sqrt(q^2 + smoothing^2) - smoothing`: like a square below `smoothing`, linear far beyond
it.)";
const char* const kSquare = R"(The square of the quantity.)";
}

namespace CostTerm {
const char* const CostTerm = R"(One ready-made part of a cost: plain data.)";
const char* const distance = R"(Distance of TIP_OBJECT [m].)";
const char* const end_weight = R"(Weight in the cost of the end.)";
const char* const index = R"(The object in the model's list, or the finger.)";
const char* const joints = R"(Joint positions of JOINT_POSITION [rad].)";
const char* const smoothing = R"(Scale of SMOOTH, in the unit of the quantity.)";
const char* const weight = R"(Weight in the running cost [1/s].)";
}

namespace Derivative {
const char* const Derivative = R"(The rate at which up to nine numbers change, low-pass filtered.)";
const char* const reset = R"(Treats the next sample as the first one.)";
const char* const update = R"(Takes the next sample, `elapsed` [s] after the previous one, and returns the rate [1/s]. The
rate of the first sample is zero. A sample with no time since the previous one changes
nothing.)";
}

namespace DirectSimulation {
const char* const DirectSimulation = R"(A simulated robot that its owner moves step by step. There are no sessions, no limits of
positions and speeds, and no faults: it is for programs that bring their own rules, such as
those written for other simulators. `Simulation` is for all others.

Nothing is random. One object must not be used by several threads at once.)";
const char* const configuration_position = R"(Positions and velocities of joints and objects in MuJoCo's layout: `qpos`, and `qvel`.)";
const char* const continue_from = R"(Continues where `other` is: with its joints, and with the objects that both have by their
names. The other objects stay.)";
const char* const place_object = R"(Places an object at rest.

Raises InvalidArgument that names the existing objects, or if the pose is not valid.)";
const char* const push_object = R"(Lets a force [N] and a moment [Nm] act on an object's centre in the next step, in the world
frame. Several add up.

Raises InvalidArgument that names the existing objects, or if a number is not finite.)";
const char* const set_joints = R"(Sets positions [rad] and velocities [rad/s] of all joints, also beyond limits.

Raises InvalidArgument if a number is not finite.)";
const char* const set_object_mass = R"(Sets the mass of an object, which must be above 0 [kg]. Its inertia grows with it.

Raises InvalidArgument that names the existing objects, or if the mass is not valid.)";
}

namespace Environment {
const char* const Environment = R"(Makes a decision process of a robot: starts, goals, observations, rewards, ends. The same
functions serve a robot that is driven through a front-end and thousands of simulations.

The robot is a TriFinger, one of its fingers, or a robot from a file. The goals, points and
rewards of fingers are then those of the frames that the option `frames` names.

An environment is constant. Threads may share one, each with its own episodes.)";
const char* const begin = R"(Draws the beginning of episode `number` of `seed`. The same arguments give the same episode.)";
const char* const entries = R"(The parts of an observation, in the order of `Layout.DICTIONARY`. Images are not among them:
whoever has cameras adds these.)";
const char* const has_goals_of_fingers = R"(True if each finger or frame has a goal of its own.)";
const char* const hidden_entries = R"(Entries that are not observed, for a critic (Pinto et al. 2018): where the object really is,
how it moves, and what varies from robot to robot. Their numbers are in SI units.)";
const char* const judges_by_truth = R"(True if a simulation shall judge the outcome by where the object really is, because its pose
is not observed, or tracked.)";
const char* const num_parts = R"(Number of parts of a goal that are judged one by one: one for each finger or frame if each
has a goal of its own, else 1.)";
const char* const scores = R"(Names of the scores of the task.)";
}

namespace EnvironmentBatch {
const char* const EnvironmentBatch = R"(Many simulations of one decision process, each in an episode of its own. `Environment`
computes the decision process and `Simulator` the physics, on the threads of MuJoCo's
batches.

Each simulation gives the same results, bit for bit, as an `Environment` with a simulation
of its own, unless `set_reset_states` is used. One batch must not be used by several threads
at once. In a forked child `reset` and `step` raise InheritedHandle.

Simulations with cameras share one vision pipeline per thread. An image is drawn when an
observation needs it.)";
const char* const cameras = R"(The cameras of each simulation that are observed; none without `Layout.IMAGES`.)";
const char* const configuration = R"(Positions and velocities of joints and objects of simulation `index` in MuJoCo's layout, to
draw it: `qpos`, then `qvel`.

Raises InvalidArgument if there is no such simulation.)";
const char* const first_finger = R"(`Environment.first_finger` of simulation `index`.

Raises InvalidArgument if there is no such simulation.)";
const char* const model_file = R"(The model as a file of MuJoCo, with all pairs of surfaces that may vary.)";
const char* const oldest_sure_age = R"(Age of the newest pose of the object just before the next one arrives [steps]. If it is
older, poses were lost, or the tracker was not sure since then.)";
const char* const reset = R"(Begins an episode in the simulations that `which` marks with a number other than 0, or in
all of them without marks.

Raises InvalidArgument if `which` has another size.)";
const char* const seed = R"(Makes the next `reset` of simulation `index` begin this episode of `seed`. Each later reset
begins the next episode.

Raises InvalidArgument if there is no such simulation.)";
const char* const set_physics = R"(Lets `physics` move the simulations, in place of MuJoCo. Motors, safety checks and the task
stay those of this class. What `physics` raises, `step` raises; the episodes that were under
way have then ended.

Raises InvalidArgument if images are needed.)";
const char* const set_reset_states = R"(Lets a share of the later episodes begin in one of these states, for a training. Not for
tasks that remember where an episode has begun: they remember the start that was drawn.

Raises InvalidArgument if a robot cannot begin in one of the states.)";
const char* const step = R"(Applies one action in each simulation. `actions` has one row of numbers per simulation, as
for `Environment.take_action`.

Raises InvalidArgument if there are too many or too few numbers, or one is not finite; then
nothing moves. Error if an image could not be drawn; then the episode of that simulation has
ended, and the others have moved on. What a task of many raises; then all episodes have
ended.)";
const char* const varied_field = R"(One of these fields of all simulations, one after the other.

Raises InvalidArgument if it is none of these.)";
const char* const varied_fields = R"(What of the model may differ from simulation to simulation: names of fields of `mjModel`;
none if nothing does.)";
}

namespace Estimate {
const char* const Estimate = R"(Where an object is, as images show it.)";
const char* const cameras = R"(Cameras that show the object.)";
const char* const confidence = R"(Confidence from 0 to 1, at least 0.5 if the state is `SURE`.)";
const char* const faces = R"(Faces that at least one camera shows.)";
const char* const position_deviation = R"(Standard deviations [m].)";
const char* const residual = R"(Root mean square distance of measured from expected edges [pixel].)";
const char* const rotation_deviation = R"(Standard deviations of a rotation about the world's axes [rad].)";
}

namespace ForceDistribution {
const char* const ForceDistribution = R"(A result of the force optimization.)";
const char* const forces = R"(Forces of the tips on the object [N], in the frame of the grasp: three numbers for each of
the three contacts.)";
const char* const wrench = R"(The wrench that the forces make.)";
}

namespace ForceOptimizer {
const char* const ForceOptimizer = R"(Finds the contact forces that make a wanted wrench, with the paper's quadratic program.

    minimise    1/2 f' W f
    subject to  G f = wrench                      (grasp map)
                f_i in the friction pyramid of contact i
                min_normal_force <= normal part of f_i <= max_normal_force
                |J' f + bias| <= limits           (where torque limits are given)

If the program has no solution, this minimizes `|G f - wrench|` instead. A small part of the
objective above is added, so that the solution is unique. To compare moments with forces, a
moment is divided by the contacts' mean distance (r.m.s.) from `centre`.

Memory is allocated only during construction, and `solve` always ends. One object must not
be used by several threads at once.)";
const char* const solve = R"(Distributes `wrench`, which is given about `centre` [m], over the three contacts. If that is
impossible, the result comes closest to it and its `status` says so.)";
}

namespace ForceStatus {
const char* const ForceStatus = R"(Quality of a result of the force optimization, best first.)";
const char* const kClosestWrench = R"(No allowed forces make the wanted wrench; these come closest to it.)";
const char* const kExact = R"(The forces make exactly the wanted wrench.)";
const char* const kInvalid = R"(A number was not finite or out of its range. All forces are zero.)";
const char* const kTorqueLimitsExceeded = R"(Even the smallest normal forces need more torque than the limits allow. The torque limits
were ignored. Friction and normal forces are within their limits, and the wrench is the
closest possible.)";
}

namespace FrictionPyramid {
const char* const FrictionPyramid = R"(A pyramid of 3 to 8 sides inside Coulomb's friction cone: a contact whose force lies in the
pyramid does not slip.

With four sides it is the paper's pyramid: `|tangential_i| <= friction / sqrt(2) * normal`
for both tangents. Its edges lie on the cone, so more sides use more of the cone.)";
const char* const margin = R"(Tangential force that could be added to `force` [N] before it leaves the pyramid, in the
direction with the least room. Negative outside. `force` is in the contact frame.)";
const char* const side = R"(Points inward from side `i`, in the contact frame: forces with `side.dot(force) >= 0` are on
its inner side. Its tangential part has length 1.)";
}

namespace Frontend {
const char* const Frontend = R"(The user's view of a running robot: append desired actions, read back what happened.

Reading step t waits until the back-end has filled it in. A loop that reads y[t] and appends
a[t+1] is therefore paced by the robot and needs no sleep of its own.

A front-end is not for real-time code: reads block and failures raise. Any number of threads
may read; one thread appends. Every wait ends with the value, with TimedOut, or with
RobotStopped if the session has ended and the value will never come. A handle that went
through fork() raises InheritedHandle.)";
const char* const append_desired_action = R"(Appends `action` and returns the step for which it is scheduled. This is the next step or,
if the user's loop is late, the first step that is still open. The first call starts step 0.
The call waits only if the queue is full.

Raises RobotStopped, TimedOut, AcausalAction if strict.)";
const char* const append_desired_actions = R"(Appends several actions, one per step, and returns the step of the last one.)";
const char* const companion = R"(Reads the companion `name` of this robot, for example "object".)";
const char* const current_time_index = R"(Newest step whose observation exists; -1 before step 0.)";
const char* const fault = R"(Why the session ended; None while it runs.)";
const char* const finish = R"(Says that no further action will come. The session ends without a fault, after the last
appended action. Returns when it has ended.

Raises RobotStopped if the session ended for another reason, so that some actions may not
have been applied; TimedOut.)";
const char* const get_applied_action = R"(Returns a'[t], the applied action.)";
const char* const get_desired_action = R"(Returns a[t] as the back-end took it. This and the functions below raise like
`get_observation`.)";
const char* const get_observation = R"(Returns y[t]; waits for it if `t` lies in the future.

Raises HistoryLost if y[t] was already overwritten, RobotStopped if it will never come,
TimedOut.)";
const char* const get_status = R"(Returns the status that the back-end has written for step t.)";
const char* const latest_observation = R"(Returns the newest observation, also before step 0: a user can look without acting.)";
const char* const recover = R"(Clears the fault that ended the session and waits until the back-end has begun the next one.
This handle remains stopped: connect again. Only the controller can call this;
`trifinger.recover(name)` is for everybody.

Raises InvalidArgument for a handle that only observes, RobotStopped if the back-end is
gone.)";
const char* const timing = R"(How well the session keeps its time, up to now or up to its end. None outside real-time mode
and before the first whole step.)";
const char* const wait_until_time_index = R"(Waits until y[t] exists.)";
}

namespace GraspController {
const char* const GraspController = R"(The paper's controller (docs/control.md): it grasps an object with three tips, makes it
follow a motion, and releases it.

The object's impedance gives the wrench that the object needs. The force optimization gives
the contact forces that make this wrench. The joint torques are

    torque = J' (forces + tip impedance) + M J^-1 (a - dJ/dt dq) + bias + damping dq

where `a` is the desired acceleration of the tips. The last term compensates the damping
that the robot's safety checks add. A round tip rolls on its face. Each contact is therefore
at the measured tip, and the target of the tip's impedance follows it slowly.

Call `update` once per step. Memory is allocated only during construction. One object must
not be used by several threads at once.)";
const char* const grasp = R"(Goes to the object, which rests at the pose `object`, and grasps it at three `touches`,
finger 0 first.)";
const char* const release = R"(Releases the object in any phase.)";
const char* const state = R"(The state after the last `update`.)";
const char* const update = R"(Returns the nine joint torques for the next step [Nm], `elapsed` [s] after the previous
step. `object` is the object's pose and motion. `desired` is its desired motion while it is
held; before that, pass the pose where it rests.)";
}

namespace GraspControllerConfig {
const char* const GraspControllerConfig = R"(Settings of a `GraspController`. docs/control.md explains the gains.)";
const char* const approach_speed = R"(Average speed of the tips on the way [m/s].)";
const char* const closing_speed = R"(Speed of tips that search for the faces [m/s].)";
const char* const closing_time = R"(Time in which all tips must have felt their faces [s].)";
const char* const engage_time = R"(Time in which a touch becomes a hold [s].)";
const char* const friction = R"(Friction coefficient that the holding forces rely on.)";
const char* const friction_sides = R"(Sides of its friction pyramids, 3 to 8.)";
const char* const lost_distance = R"(Distance from its target at which the object is lost [m].)";
const char* const lost_time = R"(Time without touch after which the object is lost [s].)";
const char* const max_normal_force = R"(Largest normal force of each holding tip [N].)";
const char* const min_normal_force = R"(Smallest normal force of each holding tip [N].)";
const char* const object = R"(How stiffly the object is held.)";
const char* const penetration = R"(Depth inside the object up to which tips search for a face [m].)";
const char* const roll_time = R"(Time constant with which targets follow rolling tips [s].)";
const char* const slip_friction = R"(Largest ratio of tangential to normal force of holding tips.)";
const char* const slip_speed = R"(Speed of a tip along its face above which it slips [m/s].)";
const char* const tips = R"(How stiffly each tip is held.)";
const char* const touch_force = R"(Force that counts as a touch [N].)";
}

namespace GraspPhase {
const char* const GraspPhase = R"(The phase of a `GraspController`.)";
const char* const kApproach = R"(The tips go to the object without touching it.)";
const char* const kClose = R"(The tips move towards the faces until all of them feel a touch.)";
const char* const kEngage = R"(The forces grow until they hold the object.)";
const char* const kHold = R"(The object follows the desired motion.)";
const char* const kIdle = R"(The tips stay where they are.)";
const char* const kLost = R"(The object slipped away or was not at its place. The tips stay; release them.)";
const char* const kRelease = R"(The tips move off the faces, and then up.)";
}

namespace GraspPlanner {
const char* const GraspPlanner = R"(Chooses which finger touches which side face of a box, and where: a face that is upright at
the beginning of the trajectory. The fingers reach the whole trajectory. Only their tips
touch anything, and they touch only the box. They carry it within friction, also during
upward acceleration, with as little torque as possible. One object must not be used by
several threads at once.)";
const char* const plan = R"(The best grasp to lead the object along `trajectory`, which begins where it is grasped. None
if there is none. The object may be tilted on the way, which takes longer to plan: up to a
second instead of some milliseconds. Allocates memory.)";
}

namespace GraspPlannerConfig {
const char* const GraspPlannerConfig = R"(The candidates that a planner compares, and its requirements.)";
const char* const clearance = R"(Distance that fingers keep, except at touching tips [m].)";
const char* const friction = R"(Friction coefficient that the forces rely on.)";
const char* const friction_sides = R"(Sides of its friction pyramids, 3 to 8.)";
const char* const heights = R"(Candidate heights above the object's centre [m].)";
const char* const largest_torque = R"(Share of the motors' torque that carrying may need.)";
const char* const limit_margin = R"(Distance that joints keep from their soft limits [rad].)";
const char* const min_normal_force = R"([N])";
const char* const offsets = R"(Candidate offsets to both sides of a face's middle [m].)";
const char* const shared_faces = R"(Two tips may touch one face, as a long box needs.)";
}

namespace GraspState {
const char* const GraspState = R"(The state of a `GraspController`: its phase and its forces.)";
const char* const felt = R"(The motion of the held object as the tips feel it: they roll on its faces without slipping.
Zero while it is not held.)";
const char* const is_slipping = R"(True if a tip moves along its face faster than tips roll.)";
const char* const normal_forces = R"(Forces with which the three tips press along their faces' normals [N], computed from the
joints' torques.)";
const char* const slip_speeds = R"(Speeds of `travel`, low-pass filtered at 5 Hz [m/s].)";
const char* const tangential_forces = R"(Forces with which the three tips press across their faces' normals [N], computed from the
joints' torques.)";
const char* const torque_share = R"(The largest ratio of a requested torque to its joint's limit. The safety checks cut off
everything above 1.)";
const char* const travel = R"(How far each of the three tips has moved along its face by rolling and slipping, since all
tips touched [m].)";
const char* const wanted = R"(The wanted contact forces while the object is held, in the world frame.)";
}

namespace Guide {
const char* const Guide = R"(Lets slow callers steer a robot that must hear from its controller every millisecond.

A thread of its own drives the robot in every step. It follows the newest setpoints of any
number of threads and never waits for them. The safety checks of the robot apply as always.
At first the robot holds the pose in which it is found.

Any thread may call any function at any time. After a fork only the parent's guide is
usable: in the child all functions raise InheritedHandle.)";
const char* const check = R"(Throws what ended the guide, if that was a fault.

Raises RobotStopped, or another error of the guide's thread.)";
const char* const finish = R"(Brakes, ends the session in an orderly way and waits for this. Does nothing more if the
guide has ended.

Raises what ended the guide, if that was a fault; TimedOut if the back-end does not answer:
the guide has then ended, and its session may not have.)";
const char* const float_freely = R"(Lets a hand move the robot: motors carry its weight and overcome the friction that its model
knows. The robot's safety damping (`safety_kd`) still acts, and its soft limits push back.

Raises like `move_frame`; InvalidArgument if the robot's motors refuse torques.)";
const char* const frontend = R"(The front-end of the robot, for reading.)";
const char* const hold = R"(Brakes and keeps the pose.

Raises like `move_frame`.)";
const char* const home = R"(Moves to the robot's initial pose.

Raises like `move_frame`.)";
const char* const is_running = R"(True until the guide has ended, for whatever reason.)";
const char* const move_frame = R"(Moves a frame on a straight line to `position` in the world frame [m]. If the frame cannot
get there, it goes near it: see `GuideState.refusal`. Joints of other frames keep their
targets.

A setpoint returns at once. It replaces earlier ones for the same frames and joints.

Raises InvalidArgument for numbers that are not finite, a frame that does not exist, or
after the end of the guide; otherwise what ended the guide.)";
const char* const move_joint = R"(`move_joints` for one joint. The other joints keep their targets. If it moves a frame that
is on its way to a point, this frame gives up its point, and so do frames that share joints
with it.

Raises like `move_frame`.)";
const char* const move_joints = R"(Moves all joints to `positions` [rad], [m]. Positions beyond soft limits are clamped: see
`GuideState.refusal`.

Raises like `move_frame`.)";
const char* const move_tip = R"(`move_frame` for the tip of a finger.)";
const char* const realtime_warnings = R"(What keeps the guide's thread from being a real-time thread: sentences with the remedies.)";
const char* const state = R"(Returns where the robot is. Waits for the first measurement: a robot may first be homing.

Raises what ended the guide before its first measurement, TimedOut.)";
const char* const stop = R"(Ends the session at once, whatever other calls wait for; the robot then stops as its driver
does. Faults are left to `check`.

Raises TimedOut like `finish`.)";
const char* const wait_until_arrived = R"(Waits until the robot rests at the target of all setpoints so far.

Raises InvalidArgument if the robot floats, what ended the guide, TimedOut.)";
}

namespace GuideState {
const char* const GuideState = R"(Where a guided robot is and where it goes. Positions of joints are in rad, those of slides
in m.)";
const char* const frames = R"(Points that follow from `joints` [m].)";
const char* const has_arrived = R"(The robot has reached all setpoints so far and rests at their target. Always False while
floating.)";
const char* const joints = R"(Measured positions.)";
const char* const reference_frames = R"(Points that follow from `reference_joints` [m].)";
const char* const reference_joints = R"(Where the joints should be now.)";
const char* const refusal = R"(One sentence per frame or joint whose last setpoint cannot be reached: what is done instead,
and why. For a point it comes up to tens of milliseconds after `mode`.)";
const char* const step = R"(Step of the newest measurement; -1 before step 0.)";
const char* const target_frames = R"(Points that follow from `target_joints` [m].)";
const char* const target_joints = R"(Where the joints should end.)";
}

namespace HandWriter {
const char* const HandWriter = R"(The hand of a simulated robot that `trifinger run` runs in another process.

The robot has one hand. A pull acts while the robot holds its pose and while a session runs,
not during its orderly stop. It begins with the next step, the first one up to 0.1 s after
the writer was made. It ends with `let_go`, with this object, or with its process: 0.1 s
after a kill, and 0.3 s after the process was stopped.

The process of the robot may be started again at any time. The bodies are those of the robot
that ran when this object was made.)";
const char* const bodies = R"(What can be pulled, see `pullable_bodies`.)";
const char* const let_go = R"(Lets go. Without effect if nothing is pulled, or in a child process after fork.)";
}

namespace ImageFormat {
const char* const height = R"([pixel])";
const char* const width = R"([pixel])";
}

namespace JointSolution {
const char* const JointSolution = R"(A result of the inverse kinematics. It is always finite and within the ranges.)";
const char* const angle = R"(Between their orientations [rad]; 0 if none was asked for.)";
const char* const distance = R"(From the frame to its goal [m].)";
const char* const is_reached = R"(Both are at most 1e-6.)";
const char* const position = R"(One for each driven joint [rad], [m].)";
}

namespace JointState {
const char* const JointState = R"(Measurements of the nine joints, finger 0 first, from the base to the tip.)";
const char* const position = R"([rad])";
const char* const torque = R"([Nm])";
const char* const velocity = R"([rad/s])";
}

namespace Kinematics {
const char* const Kinematics = R"(Kinematics and dynamics of the fingers, without contacts and objects. Everything is in the
world frame: z up, origin on the table, whether or not the platform is flipped. Positions of
joints are in rad.

One object must not be used by several threads at once: make one for each.)";
const char* const bias_torques = R"(Torques that keep joints at their `velocity` [rad/s] without acceleration, against gravity,
Coriolis and centrifugal forces [Nm]. Friction is not included.)";
const char* const gravity_torques = R"(Torques that hold the pose against gravity [Nm].)";
const char* const inverse_kinematics = R"(Joint positions of `finger` that bring its tip to `tip` [m], and whether it can reach it. If
it cannot, they are a pose within the hard limits whose tip is near the point. Among up to
four poses it takes the one within the hard limits that is nearest to `near`.)";
const char* const mass_matrix = R"(Inertia at the joints, including that of the rotors [kg m^2].)";
const char* const num_fingers = R"(Number of fingers: 1 or 3.)";
const char* const num_joints = R"(Number of joints: three for each finger.)";
const char* const tip_accelerations = R"(Accelerations of the tips when joints move with constant `velocity` [rad/s]: x, y, z for
each finger [m/s^2].)";
const char* const tip_jacobian = R"(Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.)";
const char* const tip_jacobians = R"(The Jacobians of all tips, one below the other [m/rad]: square, `num_joints` rows and
columns.)";
const char* const tip_positions = R"(Centres of all tip spheres: x, y, z for each finger [m].)";
}

namespace KnotSpline {
const char* const KnotSpline = R"(Numbers as functions of time: `width` values given at knots of equal distance. Before the
first and after the last knot they rest.

After its construction, no function allocates memory.)";
const char* const begin = R"(Time of the first knot [s].)";
const char* const end = R"(Time of the last knot [s].)";
const char* const knot = R"(The values of one knot.)";
const char* const move_to = R"(Moves all knots, so that the first one lies at `begin`.)";
}

namespace LateStep {
const char* const LateStep = R"(A step that was late.)";
const char* const cause = R"(Who caused it.)";
const char* const lateness = R"(How late the tick began. If the user caused it, the time without a new action.)";
}

namespace LatenessHistogram {
const char* const LatenessHistogram = R"(Counts times in bins whose width grows with the time: eight bins for each power of two. A
quantile is therefore known to an eighth of its value, however many times were counted.)";
const char* const count = R"(Number of counted times.)";
const char* const max = R"(The longest time.)";
const char* const quantile = R"(The time below which the share `fraction` of all times lies; zero if no time was counted.)";
}

namespace Lens {
const char* const Lens = R"(The lens of a camera in OpenCV's model: a pinhole, and radial and tangential distortion.

Points are in the camera's frame: x right, y down, z forward. A pixel is (column, row), and
(0, 0) is the centre of the first one.)";
const char* const cropped = R"(The lens of the part of the images that begins at this pixel.)";
const char* const cx = R"(Principal point [pixel].)";
const char* const distortion = R"(k1 k2 p1 p2 k3.)";
const char* const fx = R"(Focal lengths [pixel].)";
const char* const scaled = R"(The lens of the same camera with images scaled by `factor`, such as 0.5 for half the size.)";
const char* const unproject = R"(The ray (x, y, 1) through a pixel: the inverse of `project`, to 1e-9 of the focal length
within the part of the image plane where the distortion can be inverted.)";
}

namespace LineTrajectory {
const char* const LineTrajectory = R"(A straight line with the least jerk.)";
const char* const at = R"(The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
`duration` at its end.)";
const char* const duration = R"(Time from the start to the end [s].)";
}

namespace LiveBatch {
const char* const LiveBatch = R"(What is new since the call before.)";
const char* const events = R"(The same sentences are messages of the topic "/events".)";
const char* const lost = R"(Number of messages that were left out, because the reader was late or the robot too fast.)";
const char* const messages = R"(In the order of each channel.)";
}

namespace LiveChannel {
const char* const LiveChannel = R"(Messages of one topic and one type.)";
const char* const definition = R"(The text of the schema ("ros2msg"), with the types that it uses.)";
const char* const is_image = R"(True if these messages only come while images are wanted.)";
const char* const is_latched = R"(True if viewers that come later need the newest message of each `part`: it will not come
again.)";
const char* const topic = R"(For example "/sim/step".)";
const char* const type = R"(For example "trifinger_msgs/msg/TrifingerStep".)";
}

namespace LiveMessage {
const char* const LiveMessage = R"(A message in CDR, with the bytes that a log of the same session has.)";
const char* const channel = R"(Its number in `channels()`.)";
const char* const log_time = R"(Time since 1970 [ns], as in a log.)";
const char* const part = R"(Only latched channels have more than part 0.)";
}

namespace LiveMessages {
const char* const LiveMessages = R"(Observes a robot for other programs: gives the messages that a log would have, as soon as
they can be made. It shows the current session of the robot and those that follow.

It only reads, so the robot notices nothing. If the reader is late, it continues with what
is newest. There is at most a second of messages in one batch.

Times of a session in real-time mode may differ from those in a log by the microseconds with
which each of them measured the offset of the clocks.)";
const char* const channels = R"(All channels so far; more may come with each batch. If two have the same topic, the later
one counts: the next session has another type.)";
const char* const is_running = R"(True if a session is shown that has not ended.)";
const char* const take = R"(Returns what is new. Never waits for the robot; call it some 50 times per second.

Raises InvalidArgument if no robot can have this name.)";
const char* const want_images = R"(Says whether somebody looks at images. Only then are they copied and compressed, which takes
some milliseconds of a processor per image. At the beginning nobody does.)";
}

namespace Log {
const char* const Log = R"(A recording: one file, or all its parts.

If the files are finished and whole, opening reads no messages. Damaged pieces are left out
and named (`damage`, `lost_bytes`, and `gaps` of the sessions); everything else is read.)";
const char* const damage = R"(Pieces of the files that could not be read. Reads the whole log once.)";
const char* const events = R"(Messages for people. Reads the whole log once.)";
const char* const files = R"(The files, in the order of the parts.)";
const char* const is_finished = R"(True if every file has the summary that is written at its end.)";
const char* const lost_bytes = R"(Number of bytes of the files that could not be used. Reads the whole log once.)";
const char* const origin = R"(The program and machine that wrote the log: "trifinger_version", "host", "kernel",
"created". "began" orders the recordings of a folder, even if the clock was set back.)";
const char* const session = R"(The newest session with steps of the robot or companion `name`. With an empty name, that of
the only robot in the log.

Raises InvalidArgument with the existing names.)";
const char* const sessions = R"(The sessions of robots, in the order in which they began.)";
const char* const size = R"(Size of all files together [bytes].)";
}

namespace LoggedSession {
const char* const LoggedSession = R"(A session in a log. It belongs to a robot or to one of its companions. A companion has only
observations and counts its own elements. Copies refer to the same log. Any number of
threads may read.)";
const char* const between = R"(The range of the elements measured from `begin` to before `end`. Both count from the first
element in the log.)";
const char* const companion = R"(One companion, by "object" or its full name.

Raises InvalidArgument with the existing names.)";
const char* const companions = R"(The companions of a robot.)";
const char* const fault = R"(Why the session ended; `None` if it was still running when the recording ended.)";
const char* const fault_text = R"(The reason of `fault` as a sentence.)";
const char* const gaps = R"(Elements that are missing in the range of the applied actions, because the recorder said so
or because the file is damaged. Reads the whole log once.)";
const char* const name = R"(Name of the session, "sim", or "sim.object" for a companion.)";
const char* const range = R"(The first index of `series` in the log, and the first index after the last one. Observations
and statuses may have one more element than actions: that of the end.)";
const char* const read = R"(Reads the existing whole steps from `first` to before `last`.)";
const char* const steps = R"(Number of whole steps of the session. None if it was still running when the recording ended.)";
const char* const timing = R"(How well the session kept its time from step `first` to before `last`, including the status
of its end. It equals the back-end's own record if no step is missing. None outside
real-time mode, or if the statuses have another version. Reads all statuses.)";
const char* const type = R"(Type of the robot, for example "trifinger", or of the companion.)";
}

namespace LowPassFilter {
const char* const LowPassFilter = R"(A first-order low-pass for up to nine numbers. Samples may come at uneven intervals.)";
const char* const reset = R"(Treats the next sample as the first one.)";
const char* const update = R"(Takes the next sample, `elapsed` [s] after the previous one, and returns the filtered
signal. The first sample passes unchanged. A sample with another number of values passes
unchanged, too.)";
}

namespace ModelKinematics {
const char* const bias_torques = R"(Torques that keep joints at their `velocity` [rad/s], [m/s] without acceleration, against
gravity, springs, Coriolis and centrifugal forces. Damping and friction are not included.)";
const char* const gravity_torques = R"(Torques that hold the pose against gravity and springs.)";
const char* const jacobian = R"(Linear velocity of a frame, above its angular velocity, for a velocity of 1 of each joint: 6
rows, `num_joints` columns.)";
const char* const mass_matrix = R"(Inertia at the joints, including that of the rotors [kg m^2], [kg].)";
const char* const null_space_torques = R"(The part of `torques` that does not accelerate a frame, only the joints around it: (1 - J'
(J M^-1 J')^-1 J M^-1) torques. With it an arm of seven joints keeps its elbow where it
should be. O. Khatib: A unified approach for motion and force control of robot manipulators.
IEEE Journal on Robotics and Automation, 1987.)";
}

namespace Motion {
const char* const Motion = R"(A body at one instant of a motion.)";
}

namespace Network {
const char* const metadata = R"(Facts for the program that runs the policy. docs/policies.md lists the usual names.)";
}

namespace ObjectAddress {
const char* const ObjectAddress = R"(The place of one loose object in the state of a `SceneModel`.)";
const char* const body = R"(Index of the body.)";
const char* const position = R"(First of 7 numbers in `qpos`: x y z, then the quaternion w x y z.)";
const char* const velocity = R"(First of 6 numbers in `qvel`.)";
}

namespace ObjectGains {
const char* const ObjectGains = R"(How stiffly an object is held.)";
const char* const damping = R"([Ns/m])";
const char* const rotational_damping = R"([Nms/rad])";
const char* const rotational_stiffness = R"([Nm/rad])";
const char* const stiffness = R"([N/m])";
}

namespace OnlinePlanner {
const char* const OnlinePlanner = R"(Plans in threads of its own, beside a loop at 1 HZ.

The loop hands over its newest state, and reads the newest plan at any time. A plan takes
tens of milliseconds. So the state is first simulated forward along the plan that the loop
follows, to the instant at which the new plan will be ready, and the new plan begins there.
Until that instant the loop still follows the old plan.

The planner's threads are ordinary ones, also if the thread that makes it has real-time
priority. Results depend on how fast this machine plans; only with `lead` and
`wait_for_plan` after each state they do not.)";
const char* const model = R"(The model, for making states.)";
const char* const set_state = R"(Hands over a state, whose time must not be before that of the last one. Ignores a state that
does not fit the model, and then returns False.)";
const char* const set_terms = R"(Changes the terms of the task from the next plan on. Ignores them and returns False if their
number is not that of the task, or if one of them does not fit the model or has a number
that is not finite.)";
const char* const status = R"(The status as it is now.)";
const char* const wait_for_plan = R"(Waits until `count` plans were made since the beginning. Any thread may call it.

Raises TimedOut; and once, the exception of a cost function, which has ended the planning.)";
}

namespace OnlinePlannerOptions {
const char* const OnlinePlannerOptions = R"(Settings of an `OnlinePlanner`. All times are on the clock of the states.)";
const char* const lead = R"(Time from the state of a plan to the instant from which it is used. Default: as long as
plans took until now.)";
const char* const period = R"(Least time from the state of one plan to that of the next one. It is longer if `lead` is:
the next plan is made from a state after the newest one has begun.)";
}

namespace OnlinePlannerStatus {
const char* const OnlinePlannerStatus = R"(How plans were made. Plain data.)";
const char* const begin = R"(Instant from which the newest plan is used.)";
const char* const cost = R"(`Plan.cost` of the newest plan.)";
const char* const duration = R"(What the newest plan took, from its state on.)";
const char* const has_failed = R"(A cost function has thrown, so no other plan will come.)";
const char* const lateness = R"(How long after its `begin` it was ready; 0 if in time.)";
const char* const median_cost = R"(`Plan.median_cost` of the newest plan.)";
const char* const num_masked = R"(`Plan.num_masked` of the newest plan.)";
const char* const num_refused_states = R"(States with numbers that are not finite.)";
const char* const state_time = R"(Time of the state from which the newest plan was made.)";
}

namespace PixelFormat {
const char* const PixelFormat = R"(How the pixels of an image are stored, row by row without gaps, 8 bits per channel.)";
}

namespace PlannedCommand {
const char* const PlannedCommand = R"(What the numbers of a plan are.)";
const char* const kPosition = R"(Joint targets [rad], which the joints follow like springs with dampers.)";
const char* const kTorque = R"(Torques [Nm].)";
}

namespace PlannedGrasp {
const char* const PlannedGrasp = R"(The result of a planner.)";
const char* const torque_share = R"(Largest share of a motor's torque that carrying the object needs anywhere on the way.)";
const char* const touches = R"(Touches of the three tips, finger 0 first.)";
}

namespace PlannedJoint {
const char* const PlannedJoint = R"(A joint with a motor, as plans see it.)";
const char* const lower = R"(Range of targets [rad].)";
const char* const max_torque = R"(Largest torque of a plan [Nm].)";
const char* const upper = R"([rad])";
}

namespace PlannedStates {
const char* const PlannedStates = R"(The states of one rollout, from its start on: one more than its steps.)";
}

namespace PlannerOptions {
const char* const PlannerOptions = R"(Settings of a planner. The defaults turn and flip cubes; docs/planning.md says what each
does.)";
const char* const constant_share = R"(Share of rollouts that change all knots equally.)";
const char* const elites = R"(Number of best rollouts of CROSS_ENTROPY.)";
const char* const horizon = R"(Rounded to whole steps of the model, at least one.)";
const char* const kd = R"(Damping with which they follow [Nms/rad].)";
const char* const kp = R"(Stiffness with which joints follow their targets [Nm/rad].)";
const char* const least_sigma = R"(Each rollout changes the knots by normal numbers with a standard deviation between these
two, in the unit of the command. Its logarithm is spread evenly. Cross-entropy begins each
plan with the larger one and does not go below the smaller one.)";
const char* const num_threads = R"(The calling thread included; 0: one per processor that the process may use.)";
const char* const one_finger_share = R"(Share of rollouts that change one finger only.)";
const char* const rounds = R"(Rounds per plan.)";
const char* const samples = R"(Rollouts per round. The first one is the plan before the round.)";
const char* const seed = R"(Seed of all random numbers.)";
const char* const temperature = R"(The costs' scale of PATH_INTEGRAL, as a share of the median's distance from the least cost.)";
}

namespace PlanningMethod {
const char* const PlanningMethod = R"(How the next plan follows from the rollouts of a round. docs/planning.md has the equations.)";
const char* const kCrossEntropy = R"(The mean of the best rollouts, around which the next round samples with their deviation. R.
Y. Rubinstein: Optimization of computer simulation models with rare events. 1997; M.
Kobilarov: Cross-entropy motion planning. 2012.)";
const char* const kPathIntegral = R"(The mean of all rollouts, weighted with the exponentials of their costs. G. Williams et al.:
Information theoretic MPC for model-based reinforcement learning. 2017.)";
const char* const kPredictiveSampling = R"(The best rollout. T. Howell et al.: Predictive Sampling: Real-time Behaviour Synthesis with
MuJoCo. 2022.)";
}

namespace PlanningModel {
const char* const PlanningModel = R"(A model for planning, with the same joints and objects in the same order as a `RobotModel`.

Steps are long. Contacts have pyramids of friction and few iterations. The wall and all
parts of fingers but tips and lower links touch nothing. The damping of the safety checks is
damping of the joints. Fingers do not pass through the table, and joints stop at their
limits.)";
const char* const check = R"(Raises InvalidArgument if the numbers are too few, too many or not finite.)";
const char* const initial_state = R"(The initial pose at rest, at time 0.)";
const char* const object = R"(Raises InvalidArgument that names the existing objects.)";
const char* const set_joints = R"(Sets positions [rad] and velocities [rad/s] of the joints. Does not allocate.)";
const char* const set_object = R"(Sets pose and twist of an object, both in the world frame. Does not allocate.)";
const char* const tip_sites = R"(Sites at the tips of the fingers.)";
}

namespace PlanningModelOptions {
const char* const PlanningModelOptions = R"(What a `PlanningModel` leaves out. docs/planning.md says what each figure costs.)";
const char* const fingers_touch = R"(The fingers touch each other, with tips and lower links.)";
const char* const impratio = R"(Ratio of the stiffness of friction to that of normal forces; higher: held objects slip less.)";
const char* const iterations = R"(Iterations of the solver of contacts in a step, at most.)";
const char* const lower_links = R"(The lower links touch objects, each as one capsule. Otherwise only the tips do.)";
const char* const time_step = R"([s]; more than 6 ms lets fast tips sink into objects.)";
const char* const torque_share = R"(Share of the largest torque that plans may use; the rest is for feedback.)";
}

namespace PlanningState {
const char* const PlanningState = R"(A state from which a plan may begin: everything that moves in a `PlanningModel`.)";
const char* const position = R"(MuJoCo's `qpos`: the joints, then the objects.)";
const char* const time = R"(Time [s] on any clock; the same one for all states of a plan.)";
const char* const velocity = R"(MuJoCo's `qvel`.)";
}

namespace PlanningTask {
const char* const PlanningTask = R"(A cost is the sum of all parts that are given.)";
const char* const late_share = R"(The running cost of `terms` and `cost` counts `late_factor` times in the last `late_share`
of the horizon.)";
}

namespace PointMotion {
const char* const PointMotion = R"(A point at one instant of a motion.)";
const char* const acceleration = R"([m/s^2])";
const char* const position = R"([m])";
const char* const velocity = R"([m/s])";
}

namespace Policy {
const char* const Policy = R"(A trained policy: it computes actions from observations, in C++ alone. Its file is of ONNX,
or of our own format; docs/policies.md describes both.

One policy must not be used by several threads at once: each needs its own.)";
const char* const has_state = R"(True if an action depends on earlier observations, as that of GRU and LSTM does.)";
const char* const reset = R"(Forgets earlier observations: an episode begins.)";
const char* const save = R"(Writes the file at `path` in one step: an old file stays whole until the new one replaces
it.

Raises InvalidArgument if the metadata are not UTF-8 or too long, or the policy is of ONNX;
OSError.)";
}

namespace Pose {
const char* const Pose = R"(Position and orientation of a body.)";
const char* const orientation = R"(Rotation from the body's frame: a quaternion w, x, y, z of unit length.)";
const char* const position = R"(Position of its centre of mass [m].)";
}

namespace PoseEstimator {
const char* const PoseEstimator = R"(Estimates the current pose and motion of an object from poses that are few, noisy and old.

The estimator needs a known motion, such as the one on which the object is led. It estimates
how far the object deviates from that motion, and how the deviation changes. The deviation
changes much more slowly than the object's pose. It can therefore be filtered strongly and
predicted across the delay. The filter is critically damped and follows a deviation of
constant rate without lag. If there is no known motion, leave it out: the known pose then
rests at the origin.

Times [s] may begin anywhere, but must have the same beginning in all calls.)";
const char* const last_time = R"(Time of the newest pose; negative infinity before the first.)";
const char* const predict = R"(The pose and motion of the object at `time`, when the known motion is at `known`. Before the
first pose the result is `known`.)";
const char* const reset = R"(Forgets all poses.)";
const char* const update = R"(Takes `pose`, measured at `time`, when the known motion was at `known`. Ignores a pose that
is not newer than the previous one or not finite, and then returns False.)";
}

namespace PoseTrajectory {
const char* const PoseTrajectory = R"(A straight line, and a rotation about a fixed axis through the smaller angle, with least
jerk.)";
const char* const at = R"(The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
`duration` at its end.)";
const char* const duration = R"(Time from the start to the end [s].)";
}

namespace PredictivePlanner {
const char* const PredictivePlanner = R"(Finds joint targets or torques that make a cost small, by trying many in simulations.

`plan` begins with the previous plan, moved to the new start. In each round it changes this
plan at random, simulates every change over the horizon, and takes the best or a mean. Only
the start and the task count, so it plans through contacts that nobody described.

Results depend on options, seed, task and the starts so far, and not on the number of
threads. `plan` does not allocate after the first call, unless a cost function does. One
planner must not be used by several threads at once; its own threads run while `plan` does.)";
const char* const begin_with = R"(Makes the next plan begin with these commands.

Raises InvalidArgument if their width is not the number of joints.)";
const char* const costs = R"(Costs of the rollouts of the last round; infinite for those that diverged.)";
const char* const newest = R"(The newest plan.)";
const char* const restart = R"(Forgets the previous plan: the next one begins with targets where the joints are at the
start, or with zero torques.)";
const char* const set_task = R"(Changes what the next plans shall achieve.

Raises InvalidArgument as the constructor does.)";
const char* const weights = R"(Weights of these rollouts in the plan; their sum is 1.)";
}

namespace Reason {
const char* const Reason = R"(Why a joint did not get the action that was asked for. These are bits of `reasons` in an
applied action.)";
}

namespace RecorderThread {
const char* const RecorderThread = R"(Records a robot of this process in a thread of its own. Outside real-time mode nothing is
lost, because the robot waits for the recorder.)";
const char* const stop = R"(Writes the available steps and finishes the file. Nothing is recorded after that, and no
back-end waits.

Raises OSError if the end could not be written.)";
}

namespace RigidBody {
const char* const RigidBody = R"(Mass and inertia of a rigid body.)";
const char* const inertia = R"(Inertia about the centre of mass, in the body's frame [kg m^2].)";
const char* const mass = R"([kg])";
}

namespace RolloutBatch {
const char* const begin = R"(Time of the first state.)";
const char* const num_states = R"(Per rollout: one more than its steps.)";
const char* const positions = R"(MuJoCo's `qpos`.)";
const char* const targets = R"(Joint targets or torques, after the last step repeated.)";
const char* const time_step = R"(Time from one state to the next one.)";
const char* const torques = R"([Nm]; after the last step 0.)";
const char* const velocities = R"(MuJoCo's `qvel`.)";
}

namespace Session {
const char* const documents = R"(The documents that explain the robot, by name: "configuration.yml", "model.xml". Companions
have none.

Raises IncompatibleSession if the file is damaged.)";
}

namespace SessionInfo {
const char* const SessionInfo = R"(Facts about a session for everybody: name, type, period, who takes part. Reading them does
not need a front-end.)";
}

namespace SimulatedRobot {
const char* const configuration = R"(Positions and velocities of joints and objects in MuJoCo's layout, to draw the scene:
`qpos`, then `qvel`.)";
const char* const let_go = R"(Lets go of what `pull` pulls.)";
const char* const object_pose = R"(The object's pose now, without delay and noise: position [m] and quaternion w, x, y, z.

Raises InvalidArgument that names the existing objects.)";
const char* const object_velocity = R"(The object's velocity now, without delay and noise: velocity of its centre [m/s] and angular
velocity [rad/s].

Raises InvalidArgument that names the existing objects.)";
const char* const observed_object_pose = R"(The object's pose at the newest observation, without delay and noise. The action of that
step may have moved it since.

Raises InvalidArgument that names the existing objects.)";
const char* const place_object = R"(Places an object at rest at `pose`. The orientation is normalized.

Raises InvalidArgument that names the existing objects, or if the pose is not valid.)";
const char* const pull = R"(Pulls at a tip or an object, one of `pullable_bodies`, in place of what was pulled before.
It acts from the next step on until `let_go`, `reset`, `restore` or the next session. It is
no part of a saved state. A hand in another process counts more while it pulls.

Raises InvalidArgument that names the existing bodies, or if the pull is not valid.)";
const char* const push_object = R"(Applies a force to an object's centre of mass [N], in the world frame, like a hand that
pushes. It acts from the next step on until the next call, `reset` or session.

Raises InvalidArgument that names the existing objects, or if the force is not finite.)";
const char* const restore = R"(Continues from `state` exactly as the saved simulation continued, bit for bit.

Raises InvalidArgument if it was saved from another model or by another version.)";
const char* const save = R"(Saves the state: physics, safety chain, delays, random numbers.)";
const char* const set_object_velocity = R"(Sets an object in motion from where it is, in the world frame: velocity of its centre [m/s]
and angular velocity [rad/s].

Raises InvalidArgument that names the existing objects, or if a number is not finite.)";
const char* const state_before_divergence = R"(The last state before the simulation diverged, for a report or another try. Empty if it has
not diverged. `trifinger run` saves it in `log_folder()`.)";
}

namespace Simulation {
const char* const connect = R"(Controls the robot, of type R, in a new session.

Raises ControlHeld while another front-end controls it, Error if its type is another.)";
}

namespace SplineKind {
const char* const SplineKind = R"(How values follow from knots.)";
const char* const kConstant = R"(A knot holds until the next one.)";
const char* const kCubic = R"(Cubic polynomials whose rates at the knots are those of the parabolas through the neighbours
(Catmull and Rom). Values and rates are continuous.)";
const char* const kLinear = R"(Straight lines between knots.)";
}

namespace Status::Flag {
const char* const Flag = R"(What happened in a step: bits of the field `flags` of its status.)";
const char* const kAcausal = R"(The action was appended by someone who had already read y_t.)";
const char* const kActionRejected = R"(The action could not be applied; a safe one was applied instead.)";
const char* const kActionRepeated = R"(The action for this step was missing; the previous one was applied again.)";
const char* const kDriverLate = R"(The tick began late: calls of the driver used up the tick before.)";
const char* const kEnd = R"(The last status of the session: no action was applied at this step.)";
const char* const kSchedulerLate = R"(The tick began late: the back-end did not get the processor in time.)";
}

namespace TimingRecord {
const char* const TimingRecord = R"(How well a session in real time keeps its time: a summary of all its statuses, including the
last one. It is plain data of a fixed size. The back-end keeps one for everybody to read,
and a log gives the same.)";
const char* const late_steps = R"(Number of late steps: all of them, or those late because of `cause`.)";
const char* const lateness = R"(The `lateness_of` all steps.)";
const char* const steps = R"(Number of steps so far, including the one that ended the session.)";
const char* const success_rate = R"(The share of the newest 1000 steps that were in time: 1 if all of them were.)";
const char* const worst = R"(The worst late steps, the worst one first. In a row of steps with growing lateness only the
last one is listed.)";
}

namespace TipGains {
const char* const TipGains = R"(How stiffly a tip is held.)";
const char* const damping = R"([Ns/m])";
const char* const stiffness = R"([N/m])";
}

namespace TorqueLimits {
const char* const TorqueLimits = R"(The torques that the joints can give to press with the tips. Row i of the Jacobian tells how
coordinate i of the contacts' positions changes when the joints move.)";
const char* const bias = R"(Torques that the joints need without any contact [Nm]: `Kinematics.bias_torques`.)";
const char* const jacobians = R"(Jacobians of the contacts in the frame of the grasp, 9 x 9 [m/rad]. For the world frame this
is `Kinematics.tip_jacobians`.)";
const char* const limits = R"([Nm], not negative.)";
}

namespace Touch {
const char* const Touch = R"(The place where one tip touches an object, in the object's frame.)";
const char* const normal = R"(Direction into the object, of unit length.)";
const char* const point = R"(Point on the surface, from the centre [m].)";
}

namespace TrackedObject {
const char* const TrackedObject = R"(A convex object whose faces have known colours.)";
}

namespace Tracker {
const char* const Tracker = R"(Finds an object with coloured faces in the images of calibrated cameras, taken at one time.

Knows nothing of earlier images: the same images give the same estimate. Not thread-safe.)";
const char* const track = R"(Where the object is in these images, one of each camera. An empty image stands for one that
is missing or damaged. `guess` is where the object may be, such as its last pose. It saves
time if it is near, and it is forgotten if the images do not confirm it or if a number in it
is not finite. Does not allocate.

Raises InvalidArgument if the number of images or the size of one is wrong.)";
}

namespace Twist {
const char* const Twist = R"(Velocity and angular velocity of a body.)";
const char* const angular = R"([rad/s], not in the body's frame.)";
const char* const linear = R"(Velocity of its centre of mass [m/s].)";
}

namespace UntypedFrontend {
const char* const is_late = R"(True if the newest action is not the program's, because that did not come in time.)";
const char* const range = R"(The first index of `series` that can still be read, and the first index not yet written.)";
}

namespace Wrench {
const char* const Wrench = R"(A force and a moment. The moment is about a point that is stated with each use.)";
const char* const force = R"([N])";
const char* const moment = R"([Nm])";
}

const char* const approach_to = R"(The approach of a tip with radius `tip_radius` [m] to an object that rests at the pose
`object`.)";
const char* const balanced_blocks = R"(The mean red, green and blue of each block, 0 to 255, with a white balance that makes most
of the image grey.

Raises InvalidArgument if the image has no colours, or another size than its format says.)";
const char* const checked_model_text = R"(Judges the text of a model, MJCF or URDF, that somebody else has written, such as the
document "model.xml" of a log, and returns it in a form that MuJoCo may read: it names no
file, and what it asks for stays below limits. MuJoCo itself would open any path and obey
any number.

Raises InvalidArgument that names the line, what it asks for and the largest value allowed.)";
const char* const coloured_box = R"(A box with whole lengths `size` [m]. The colour of a face ends `rim` before its edges [m];
the rest is dark.

Raises InvalidArgument if the rim leaves nothing of a face.)";
const char* const coloured_mesh = R"(A convex mesh: the hull of `vertices` [m], whose triangles have colours. Triangles of one
colour in one plane become one face.

Raises InvalidArgument if a triangle has no area or the mesh is not convex.)";
const char* const connect = R"(Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`).

Raises SessionNotFound with the names of running robots and how to start one, ControlHeld
that names the controlling process, IncompatibleSession if it is another robot, RobotStopped
if a fault must first be cleared with `recover`.)";
const char* const contact_frame = R"(A matrix whose columns are two tangents and `normal`, orthonormal and right-handed. The
first tangent is perpendicular to z, or to x if the normal is nearly along z.)";
const char* const duration_text = R"(The duration in words: "850 ns", "12 µs", "1.28 ms", "2 s". With a decimal point it has at
most three digits.)";
const char* const elite_weights = R"(Equal weights for the `count` least costs; of equal costs the first ones.)";
const char* const export_mjcf = R"(The whole scene in MuJoCo's own format, with objects, cameras and lights. It needs no other
file.

MuJoCo writes six digits, so a model that is read back agrees with the built one to about
1e-6 m.

Raises InvalidArgument if the description cannot be built.)";
const char* const export_urdf = R"(The robot as URDF, for planners and other simulations: links with the source's inertias,
joints with limits, tips and cameras as frames (cameras as `NAME_optical_frame`: x right, y
down, z forward). It has no boundary and needs no other file. Gravity points along the root
link's -z, flipped or not.

Raises InvalidArgument if the description cannot be built.)";
const char* const faces_in_blocks = R"(For each block of a camera's image the index of the face that it shows if the object has
this `pose`, or a `BlockContent`. Whatever stands in front of the object is not known.)";
const char* const grasp_map = R"(The map from contact forces to the wrench on the object about `centre` [m]. It has 6 rows,
force and moment, and 9 columns, three for each of the three contacts. Its rank is 6 if the
contacts do not lie on one line.)";
const char* const gravity = R"(Standard gravity as in MuJoCo's models [m/s^2], in the world frame.)";
const char* const lateness_of = R"(How late the step of `status` was: the time from the deadline to the beginning of the tick.
If ticks were left out before it, the time counts from the deadline of the first of them.
Zero without deadlines. Everything that is shown as "lateness" is this value; `TimingRecord`
keeps its quantiles and its maximum.)";
const char* const list_sessions = R"(All sessions in the session folder, robots and companions, sorted by name. Sessions whose
back-end died are included; sessions that cannot be opened are left out.)";
const char* const minimum_jerk = R"(The movement of least jerk from rest to rest: `10 s^3 - 15 s^4 + 6 s^5`, where s is the
share of `duration` that has passed. It is complete if `duration` is not positive.)";
const char* const moved = R"(The pose after moving from `pose` with a constant `twist` for `duration` [s], which may be
negative.)";
const char* const num_processors = R"(Number of processors that the calling thread was given, at least 1: those of its affinity
(taskset, cpusets of containers and of batch systems), but no more than the quota of its
control groups, rounded up (`docker run --cpus`, `CPUQuota=` of systemd).)";
const char* const object_impedance = R"(The wrench about the object's centre that keeps the object on its way, in the world frame:

    force  = stiffness * dx + damping * dv + mass * (a - gravity)
    moment = rotational_stiffness * dr + rotational_damping * dw + I alpha + w x I w

where `dx`, `dv`, `dw` are the errors of position, velocity and angular velocity (desired
minus actual), `dr` is the rotation error, and `a`, `alpha`, `w` belong to the desired
motion.)";
const char* const observe = R"(Observes the robot `name` without controlling it.)";
const char* const path_integral_weights = R"(`exp(-(cost - least) / scale)`, divided by the sum, where `scale` is `temperature` times the
median's distance from the least cost. Adding a number to all costs, or multiplying them
all, changes nothing.)";
const char* const point_of_body = R"(The motion of a point that is fixed to a body. `point` is in the body's frame, from its
centre [m].)";
const char* const pullable_bodies = R"(Names of what can be pulled: "tip_0" and so on, one for each finger, then the names of the
objects. A robot from a file has no tips: its `end_frames` come after the objects.)";
const char* const recover = R"(Clears the fault of the robot `name`, so that the next session begins. This is for an
operator who has looked at the robot.

Raises SessionNotFound, TimedOut, RobotStopped if the back-end is gone.)";
const char* const rigid_body = R"(Mass and inertia of an object whose mass is evenly spread: a box, a stick along x, or a
ball. Its size has the whole lengths x, y, z of a box, the length and diameter of a stick,
or the diameter of a ball [m].)";
const char* const rotation_error = R"(The rotation that still turns `actual` into `desired` [rad], in the frame in which both are
given: `log(desired * actual^-1)`.)";
const char* const rotation_from_vector = R"(The rotation about the direction of `vector` by its length [rad]: the exponential map, as a
quaternion w, x, y, z.)";
const char* const rotation_vector = R"(The shortest vector [rad] that `rotation_from_vector` turns into `rotation`: the logarithm.
Its length is at most pi.)";
const char* const running_robot = R"(Which robot a command is for: `name`, or the only robot that runs on this machine if `name`
is empty. Looks once and never waits.

Raises SessionNotFound with the names of running robots and how to start one,
InvalidArgument with these names if several run and `name` is empty.)";
const char* const simulate = R"(Starts a simulated robot in this process and controls it strictly: an action that would be
late on a real robot raises. For a robot that runs elsewhere, use `connect`.)";
const char* const task_names = R"(Names of all tasks, for example "reach".)";
const char* const tip_impedance = R"(The force that brings a tip to its desired position [N]: `stiffness * dx + damping * dv`.
Add the force with which the tip should press. The joint torques for a force are `J' force`
plus `Kinematics.bias_torques`.)";
const char* const tracked_object = R"(An object of a scene as the simulation draws it: boxes have colours and rims.

Raises InvalidArgument if it has no faces with different colours, like a stick or a ball.)";
const char* const wrench_of = R"(The total wrench of nine `forces` [N] at the three contacts, about `centre` [m].)";

namespace camera::Calibration {
const char* const Calibration = R"(The cameras of a robot as they were calibrated, in the order of its images.)";
const char* const date = R"(When it was measured: "2026-11-22 21:50:00 UTC"; empty if unknown.)";
const char* const residual = R"(Root mean square of what the calibration could not explain [pixel].)";
const char* const text = R"(Returns the text of a file, in YAML.)";
}

namespace camera {
const char* const calibration_file = R"(The file with the calibration of the cameras of the robot `robot`: ROBOT.cameras.yml in the
folder of calibrations, $TRIFINGER_CALIBRATION_DIR or ~/.config/trifinger/calibration.

Raises InvalidArgument if the environment names no folder.)";
const char* const read_calibration = R"(Reads the section or file of a calibration.

Raises config.ConfigError at what makes no sense.)";
}

namespace control::Plan {
const char* const Plan = R"(A plan, and how good it is. All is from the planning model.)";
const char* const commands = R"(Its `begin` is the time of the start.)";
const char* const cost = R"(Cost of a rollout of this plan; infinite if it diverged.)";
const char* const least_cost = R"(Cost of the best rollout of the last round.)";
const char* const median_cost = R"(Median cost of the last round, without masked rollouts.)";
const char* const num_masked = R"(Rollouts of the last round that diverged.)";
const char* const number = R"(Counts plans from 1.)";
const char* const previous_cost = R"(Cost of the plan with which this one began.)";
const char* const states = R"(What this plan leads to.)";
}

namespace control::Progress {
const char* const Progress = R"(Progress of a movement, with its derivatives.)";
const char* const acceleration = R"([1/s^2])";
const char* const rate = R"([1/s])";
const char* const value = R"(0 at the beginning, 1 at the end.)";
}

namespace log::SessionHeader {
const char* const realtime_warnings = R"(In real-time mode: what kept the loop from being a real-time thread, one sentence each. None
if it was not recorded.)";
}

}  // namespace trifinger::bindings::docs
// NOLINTEND(readability-identifier-naming)
