// SPDX-License-Identifier: BSD-3-Clause
// Comments of the public headers, for Python. tools/write_docstrings.py writes this file.
#pragma once

// clang-format off
// NOLINTBEGIN(readability-identifier-naming): the names are those of the declarations.
namespace trifinger::bindings::docs {

namespace Acceleration {
inline constexpr const char* Acceleration = R"(Rate of change of a body's twist.)";
inline constexpr const char* angular = R"([rad/s^2])";
inline constexpr const char* linear = R"([m/s^2])";
}

namespace Approach {
inline constexpr const char* Approach = R"(The way of a tip to its touch. The centre of the tip's sphere passes these points, given in
the world frame.)";
inline constexpr const char* above = R"([m])";
inline constexpr const char* beside = R"([m])";
}

namespace Camera {
inline constexpr const char* Camera = R"(A calibrated camera.)";
inline constexpr const char* name = R"(For example "camera60".)";
inline constexpr const char* pose = R"(Pose of the camera's frame in the world: z up, origin on the table.)";
inline constexpr const char* reduced = R"(The same camera with smaller images, scaled by 1 / `factor`: 2 makes 270 of 540 pixels.

Raises InvalidArgument if the size cannot be divided by it.)";
inline constexpr const char* serial = R"(The number of the device that is meant; "any" if nobody said it.)";
}

namespace CameraRenderer {
inline constexpr const char* CameraRenderer = R"(Draws what cameras see of a simulated scene: lens with distortion, Bayer mosaic, blur of
what moves, noise.

A point of the scene appears where `camera.Camera.project` says, to a tenth of a pixel.
Equal arguments give equal images on one machine, bit for bit.

Any thread may use a renderer, one thread at a time.)";
}

namespace CircleTrajectory {
inline constexpr const char* CircleTrajectory = R"(A horizontal circle that gains its speed smoothly and loses it at the end.)";
inline constexpr const char* at = R"(The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
`duration` at its end.)";
inline constexpr const char* duration = R"(`|turns| * period + ramp_time` [s].)";
}

namespace Companion {
inline constexpr const char* get_latest_at = R"(Returns the newest element that arrived at or before the robot's step `t`; waits for that
step. Returns None if no element had arrived by then.)";
inline constexpr const char* payload = R"(The payload of `element`, which was read from this companion, in place.

Raises HistoryLost if it was overwritten, or if its writer was started again;
InvalidArgument if the element has no payload.)";
}

namespace Contact {
inline constexpr const char* Contact = R"(A point at which a tip touches an object and pushes, with friction and without adhesion.

A tip that does not touch is a contact whose `max_normal_force` is 0. It gets no force.)";
inline constexpr const char* friction = R"(Coefficient that a controller relies on; it should be lower than the real one.)";
inline constexpr const char* max_normal_force = R"([N], at least `min_normal_force`.)";
inline constexpr const char* min_normal_force = R"([N], not negative.)";
inline constexpr const char* normal = R"(Direction in which the tip can push, into the object; its length must not be zero.)";
inline constexpr const char* position = R"([m])";
}

namespace CostKind {
inline constexpr const char* CostKind = R"(A quantity that a cost counts.)";
inline constexpr const char* kEffort = R"(Length of the vector of torques that the plan asks for [Nm].)";
inline constexpr const char* kJointPosition = R"(Distance of the joints from `joints`, as a vector [rad].)";
inline constexpr const char* kJointVelocity = R"(Length of the vector of joint velocities [rad/s].)";
inline constexpr const char* kObjectOrientation = R"(Angle between the object's orientation and `goal.orientation` [rad].)";
inline constexpr const char* kObjectPosition = R"(Distance of the object's centre from `goal.position` [m].)";
inline constexpr const char* kObjectRotation = R"(Angular speed of the object [rad/s].)";
inline constexpr const char* kObjectVelocity = R"(Speed of the object's centre [m/s].)";
inline constexpr const char* kTargetDistance = R"(Distance of the joints from the plan's targets [rad]; 0 for torques.)";
inline constexpr const char* kTipObject = R"(Sum over tips of the distance to the object's centre beyond `distance` [m].)";
inline constexpr const char* kTipPosition = R"(Distance of the tip of finger `index` from `goal.position` [m].)";
}

namespace CostShape {
inline constexpr const char* CostShape = R"(How a quantity becomes a cost.)";
inline constexpr const char* kLinear = R"(The quantity itself: the last centimetre counts like the first.)";
inline constexpr const char* kSmooth = R"(`sqrt(q^2 + smoothing^2) - smoothing`: like a square below `smoothing`, linear far beyond
it.)";
inline constexpr const char* kSquare = R"(The square of the quantity.)";
}

namespace CostTerm {
inline constexpr const char* CostTerm = R"(One ready-made part of a cost: plain data.)";
inline constexpr const char* distance = R"(Of TIP_OBJECT [m].)";
inline constexpr const char* end_weight = R"(Weight in the cost of the end.)";
inline constexpr const char* index = R"(The object in the model's list, or the finger.)";
inline constexpr const char* joints = R"(Of JOINT_POSITION [rad].)";
inline constexpr const char* smoothing = R"(Of SMOOTH, in the unit of the quantity.)";
inline constexpr const char* weight = R"(Weight in the running cost [1/s].)";
}

namespace Derivative {
inline constexpr const char* Derivative = R"(The rate at which up to nine numbers change, low-pass filtered.)";
inline constexpr const char* reset = R"(Treats the next sample as the first one.)";
inline constexpr const char* update = R"(Takes the next sample, `elapsed` [s] after the previous one, and returns the rate [1/s]. The
rate of the first sample is zero. A sample with no time since the previous one changes
nothing.)";
}

namespace DirectSimulation {
inline constexpr const char* DirectSimulation = R"(A simulated robot that its owner moves step by step. There are no sessions, no limits of
positions and speeds, and no faults: it is for programs that bring their own rules, such as
those written for other simulators. `Simulation` is for all others.

Nothing is random. One object must not be used by several threads at once.)";
inline constexpr const char* configuration_position = R"(Positions and velocities of joints and objects in MuJoCo's layout: `qpos`, and `qvel`.)";
inline constexpr const char* continue_from = R"(Continues where `other` is: with its joints, and with the objects that both have by their
names. The other objects stay.)";
inline constexpr const char* place_object = R"(Places an object at rest.

Raises InvalidArgument that names the existing objects, or if the pose is not valid.)";
inline constexpr const char* push_object = R"(Lets a force [N] and a moment [Nm] act on an object's centre in the next step, in the world
frame. Several add up.

Raises InvalidArgument that names the existing objects, or if a number is not finite.)";
inline constexpr const char* set_joints = R"(Sets positions [rad] and velocities [rad/s] of all joints, also beyond limits.

Raises InvalidArgument if a number is not finite.)";
inline constexpr const char* set_object_mass = R"(Sets the mass of an object, which must be above 0 [kg]. Its inertia grows with it.

Raises InvalidArgument that names the existing objects, or if the mass is not valid.)";
}

namespace Environment {
inline constexpr const char* Environment = R"(Makes a decision process of a robot: starts, goals, observations, rewards, ends. The same
functions serve a robot that is driven through a front-end and thousands of simulations.

The robot is a TriFinger, one of its fingers, or a robot from a file. The goals, points and
rewards of fingers are then those of the frames that the option `frames` names.

An environment is constant. Threads may share one, each with its own episodes.)";
inline constexpr const char* begin = R"(Draws the beginning of episode `number` of `seed`. The same arguments give the same episode.)";
inline constexpr const char* entries = R"(The parts of an observation, in the order of `Layout.DICTIONARY`. Images are not among them:
whoever has cameras adds these.)";
inline constexpr const char* has_goals_of_fingers = R"(True if each finger or frame has a goal of its own.)";
inline constexpr const char* judges_by_truth = R"(True if a simulation shall judge the outcome by where the object really is, because its pose
is not observed, or tracked.)";
inline constexpr const char* num_parts = R"(Number of parts of a goal that are judged one by one: one for each finger or frame if each
has a goal of its own, else 1.)";
inline constexpr const char* observe = R"(Computes the observation after the actions that `episode` counts. The outcome is judged by
the goal that was shown before, which is written to `desired`. If a new goal begins now, it
is in `observation`.)";
inline constexpr const char* scores = R"(Names of the scores of the task.)";
}

namespace EnvironmentBatch {
inline constexpr const char* EnvironmentBatch = R"(Many simulations of one decision process, each in an episode of its own. `Environment`
computes the decision process and `Simulator` the physics, on the threads of MuJoCo's
batches.

Each simulation gives the same results, bit for bit, as an `Environment` with a simulation
of its own. One batch must not be used by several threads at once. In a forked child `reset`
and `step` raise InheritedHandle.

Simulations that see share one pair of eyes per thread. An image is drawn when an
observation needs it.)";
inline constexpr const char* cameras = R"(The cameras of each simulation that are observed; none without `Layout.IMAGES`.)";
inline constexpr const char* oldest_sure_age = R"(Age of the newest pose of the object just before the next one arrives [steps]. If it is
older, poses were lost, or the tracker was not sure since then.)";
inline constexpr const char* reset = R"(Begins an episode in the simulations that `which` marks with a number other than 0, or in
all of them without marks.

Raises InvalidArgument if `which` has another size.)";
inline constexpr const char* seed = R"(Makes the next `reset` of simulation `index` begin this episode of `seed`. Each later reset
begins the next episode.

Raises InvalidArgument if there is no such simulation.)";
inline constexpr const char* step = R"(Applies one action in each simulation. `actions` has one row of numbers per simulation, as
for `Environment.take_action`.

Raises InvalidArgument if there are too many or too few numbers, or one is not finite; then
nothing moves. Error if an image could not be drawn; then the episode of that simulation has
ended, and the others have moved on.)";
}

namespace Estimate {
inline constexpr const char* Estimate = R"(Where an object is, as images show it.)";
inline constexpr const char* cameras = R"(Cameras that show the object.)";
inline constexpr const char* confidence = R"(From 0 to 1, at least 0.5 if the state is `SURE`.)";
inline constexpr const char* faces = R"(Faces that at least one camera shows.)";
inline constexpr const char* position_deviation = R"(Standard deviations [m].)";
inline constexpr const char* residual = R"(Root mean square distance of measured from expected edges [pixel].)";
inline constexpr const char* rotation_deviation = R"(Standard deviations of a rotation about the world's axes [rad].)";
}

namespace ForceDistribution {
inline constexpr const char* ForceDistribution = R"(A result of the force optimization.)";
inline constexpr const char* forces = R"(Forces of the tips on the object [N], in the frame of the grasp: three numbers for each of
the three contacts.)";
inline constexpr const char* wrench = R"(The wrench that the forces make.)";
}

namespace ForceOptimizer {
inline constexpr const char* ForceOptimizer = R"(Finds the contact forces that make a wanted wrench, with the paper's quadratic program.

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
inline constexpr const char* solve = R"(Distributes `wrench`, which is given about `centre` [m], over the three contacts. If that is
impossible, the result comes closest to it and its `status` says so.)";
}

namespace ForceStatus {
inline constexpr const char* ForceStatus = R"(Quality of a result of the force optimization, best first.)";
inline constexpr const char* kClosestWrench = R"(No allowed forces make the wanted wrench; these come closest to it.)";
inline constexpr const char* kExact = R"(The forces make exactly the wanted wrench.)";
inline constexpr const char* kInvalid = R"(A number was not finite or out of its range. All forces are zero.)";
inline constexpr const char* kTorqueLimitsExceeded = R"(Even the smallest normal forces need more torque than the limits allow. The torque limits
were ignored. Friction and normal forces are within their limits, and the wrench is the
closest possible.)";
}

namespace FrictionPyramid {
inline constexpr const char* FrictionPyramid = R"(A pyramid of 3 to 8 sides inside Coulomb's friction cone: a contact whose force lies in the
pyramid does not slip.

With four sides it is the paper's pyramid: `|tangential_i| <= friction / sqrt(2) * normal`
for both tangents. Its edges lie on the cone, so more sides use more of the cone.)";
inline constexpr const char* margin = R"(Tangential force that could be added to `force` [N] before it leaves the pyramid, in the
direction with the least room. Negative outside. `force` is in the contact frame.)";
inline constexpr const char* side = R"(Points inward from side `i`, in the contact frame: forces with `side.dot(force) >= 0` are on
its inner side. Its tangential part has length 1.)";
}

namespace Frontend {
inline constexpr const char* Frontend = R"(The user's view of a running robot: append desired actions, read back what happened.

Reading step t waits until the back-end has filled it in. A loop that reads y[t] and appends
a[t+1] is therefore paced by the robot and needs no sleep of its own.

A front-end is not for real-time code: reads block and failures raise. Any number of threads
may read; one thread appends. Every wait ends with the value, with TimedOut, or with
RobotStopped if the session has ended and the value will never come. A handle that went
through fork() raises InheritedHandle.)";
inline constexpr const char* append_desired_action = R"(Appends `action` and returns the step for which it is scheduled. This is the next step or,
if the user's loop is late, the first step that is still open. The first call starts step 0.
The call waits only if the queue is full.

Raises RobotStopped, TimedOut, AcausalAction if strict.)";
inline constexpr const char* append_desired_actions = R"(Appends several actions, one per step, and returns the step of the last one.)";
inline constexpr const char* companion = R"(Reads the companion `name` of this robot, for example "object".)";
inline constexpr const char* current_time_index = R"(Newest step whose observation exists; -1 before step 0.)";
inline constexpr const char* fault = R"(Why the session ended; None while it runs.)";
inline constexpr const char* finish = R"(Says that no further action will come. The session ends without a fault, after the last
appended action. Returns when it has ended.

Raises RobotStopped if the session ended for another reason, so that some actions may not
have been applied; TimedOut.)";
inline constexpr const char* get_applied_action = R"(Returns a'[t], the applied action.)";
inline constexpr const char* get_desired_action = R"(Returns a[t] as the back-end took it. This and the functions below raise like
`get_observation`.)";
inline constexpr const char* get_observation = R"(Returns y[t]; waits for it if `t` lies in the future.

Raises HistoryLost if y[t] was already overwritten, RobotStopped if it will never come,
TimedOut.)";
inline constexpr const char* get_status = R"(Returns the status that the back-end has written for step t.)";
inline constexpr const char* latest_observation = R"(Returns the newest observation, also before step 0: a user can look without acting.)";
inline constexpr const char* recover = R"(Clears the fault that ended the session and waits until the back-end has begun the next one.
This handle remains stopped: connect again. Only the controller can call this;
`trifinger.recover(name)` is for everybody.

Raises InvalidArgument for a handle that only observes, RobotStopped if the back-end is
gone.)";
inline constexpr const char* timing = R"(How well the session keeps its time, up to now or up to its end. None outside real-time mode
and before the first whole step.)";
inline constexpr const char* wait_until_time_index = R"(Waits until y[t] exists.)";
}

namespace GraspController {
inline constexpr const char* GraspController = R"(The paper's controller (docs/control.md): it grasps an object with three tips, makes it
follow a motion, and releases it.

The object's impedance gives the wrench that the object needs. The force optimization gives
the contact forces that make this wrench. The joint torques are

    torque = J' (forces + tip impedance) + M J^-1 (a - dJ/dt dq) + bias + damping dq

where `a` is the desired acceleration of the tips. The last term compensates the damping
that the robot's safety checks add. A round tip rolls on its face. Each contact is therefore
at the measured tip, and the target of the tip's impedance follows it slowly.

Call `update` once per step. Memory is allocated only during construction. One object must
not be used by several threads at once.)";
inline constexpr const char* grasp = R"(Goes to the object, which rests at the pose `object`, and grasps it at three `touches`,
finger 0 first.)";
inline constexpr const char* release = R"(Releases the object in any phase.)";
inline constexpr const char* state = R"(The state after the last `update`.)";
inline constexpr const char* update = R"(Returns the nine joint torques for the next step [Nm], `elapsed` [s] after the previous
step. `object` is the object's pose and motion. `desired` is its desired motion while it is
held; before that, pass the pose where it rests.)";
}

namespace GraspControllerConfig {
inline constexpr const char* GraspControllerConfig = R"(Settings of a `GraspController`. docs/control.md explains the gains.)";
inline constexpr const char* approach_speed = R"(Average speed of the tips on the way [m/s].)";
inline constexpr const char* closing_speed = R"(Speed of tips that search for the faces [m/s].)";
inline constexpr const char* closing_time = R"(Time in which all tips must have felt their faces [s].)";
inline constexpr const char* engage_time = R"(Time in which a touch becomes a hold [s].)";
inline constexpr const char* friction = R"(Friction coefficient that the holding forces rely on.)";
inline constexpr const char* friction_sides = R"(Sides of its friction pyramids, 3 to 8.)";
inline constexpr const char* lost_distance = R"(Distance from its target at which the object is lost [m].)";
inline constexpr const char* lost_time = R"(Time without touch after which the object is lost [s].)";
inline constexpr const char* max_normal_force = R"(Largest normal force of each holding tip [N].)";
inline constexpr const char* min_normal_force = R"(Smallest normal force of each holding tip [N].)";
inline constexpr const char* object = R"(How stiffly the object is held.)";
inline constexpr const char* penetration = R"(Depth inside the object up to which tips search for a face [m].)";
inline constexpr const char* roll_time = R"(Time constant with which targets follow rolling tips [s].)";
inline constexpr const char* slip_friction = R"(Largest ratio of tangential to normal force of holding tips.)";
inline constexpr const char* slip_speed = R"(Speed of a tip along its face above which it slips [m/s].)";
inline constexpr const char* tips = R"(How stiffly each tip is held.)";
inline constexpr const char* touch_force = R"(Force that counts as a touch [N].)";
}

namespace GraspPhase {
inline constexpr const char* GraspPhase = R"(The phase of a `GraspController`.)";
inline constexpr const char* kApproach = R"(The tips go to the object without touching it.)";
inline constexpr const char* kClose = R"(The tips move towards the faces until all of them feel a touch.)";
inline constexpr const char* kEngage = R"(The forces grow until they hold the object.)";
inline constexpr const char* kHold = R"(The object follows the desired motion.)";
inline constexpr const char* kIdle = R"(The tips stay where they are.)";
inline constexpr const char* kLost = R"(The object slipped away or was not at its place. The tips stay; release them.)";
inline constexpr const char* kRelease = R"(The tips move off the faces, and then up.)";
}

namespace GraspPlanner {
inline constexpr const char* GraspPlanner = R"(Chooses which finger touches which side face of a box, and where: a face that is upright at
the beginning of the way. The fingers reach the whole way. Only their tips touch anything,
and they touch only the box. They carry it within friction, also during upward acceleration,
with as little torque as possible. One object must not be used by several threads at once.)";
inline constexpr const char* plan = R"(The best grasp to lead the object along `way`, which begins where it is grasped. None if
there is none. The object may be tilted on the way, which takes longer to plan: up to a
second instead of some milliseconds. Allocates memory.)";
}

namespace GraspPlannerConfig {
inline constexpr const char* GraspPlannerConfig = R"(The candidates that a planner compares, and its requirements.)";
inline constexpr const char* clearance = R"(Distance that fingers keep, except at touching tips [m].)";
inline constexpr const char* friction = R"(Friction coefficient that the forces rely on.)";
inline constexpr const char* friction_sides = R"(Sides of its friction pyramids, 3 to 8.)";
inline constexpr const char* heights = R"(Candidate heights above the object's centre [m].)";
inline constexpr const char* largest_torque = R"(Share of the motors' torque that carrying may need.)";
inline constexpr const char* limit_margin = R"(Distance that joints keep from their soft limits [rad].)";
inline constexpr const char* min_normal_force = R"([N])";
inline constexpr const char* offsets = R"(Candidate offsets to both sides of a face's middle [m].)";
}

namespace GraspState {
inline constexpr const char* GraspState = R"(The state of a `GraspController`: its phase and its forces.)";
inline constexpr const char* felt = R"(The motion of the held object as the tips feel it: they roll on its faces without slipping.
Zero while it is not held.)";
inline constexpr const char* is_slipping = R"(True if a tip moves along its face faster than tips roll.)";
inline constexpr const char* normal_forces = R"(Forces with which the three tips press along their faces' normals [N], computed from the
joints' torques.)";
inline constexpr const char* slip_speeds = R"(Speeds of `travel`, low-pass filtered at 5 Hz [m/s].)";
inline constexpr const char* tangential_forces = R"(Forces with which the three tips press across their faces' normals [N], computed from the
joints' torques.)";
inline constexpr const char* torque_share = R"(The largest ratio of a requested torque to its joint's limit. The safety checks cut off
everything above 1.)";
inline constexpr const char* travel = R"(How far each of the three tips has moved along its face by rolling and slipping, since all
tips touched [m].)";
inline constexpr const char* wanted = R"(The wanted contact forces while the object is held, in the world frame.)";
}

namespace Guide {
inline constexpr const char* Guide = R"(Lets slow callers steer a robot that must hear from its controller every millisecond.

A thread of its own drives the robot in every step. It obeys the newest wishes of any number
of threads and never waits for them. The safety checks of the robot apply as always. At
first the robot holds the pose in which it is found.

Any thread may call any function at any time. After a fork only the parent's guide is
usable: in the child all functions raise InheritedHandle.)";
inline constexpr const char* check = R"(Throws what ended the guide, if that was a fault.

Raises RobotStopped, or another error of the guide's thread.)";
inline constexpr const char* finish = R"(Brakes, ends the session in an orderly way and waits for this. Does nothing more if the
guide has ended.

Raises what ended the guide, if that was a fault; TimedOut if the back-end does not answer:
the guide has then ended, and its session may not have.)";
inline constexpr const char* float_freely = R"(Lets a hand move the robot: motors carry the weight of the fingers and overcome the friction
that the model knows. The robot's safety damping (`safety_kd`) still acts, and its soft
limits push back.

Raises like `move_tip`.)";
inline constexpr const char* frontend = R"(The front-end of the robot, for reading.)";
inline constexpr const char* hold = R"(Brakes and keeps the pose.

Raises like `move_tip`.)";
inline constexpr const char* home = R"(Moves to the robot's initial pose.

Raises like `move_tip`.)";
inline constexpr const char* is_running = R"(True until the guide has ended, for whatever reason.)";
inline constexpr const char* move_joints = R"(Moves all joints to `positions` [rad]. Positions beyond soft limits are clamped: see
`GuideState.refusal`.

Raises like `move_tip`.)";
inline constexpr const char* move_tip = R"(Moves the tip of `finger` on a straight line to `position` in the world frame [m]. If the
tip cannot get there, it goes near it: see `GuideState.refusal`. The other fingers keep
their targets.

A wish returns at once. It replaces earlier ones for the same fingers.

Raises InvalidArgument for numbers that are not finite, a finger that does not exist, or
after the end of the guide; otherwise what ended the guide.)";
inline constexpr const char* realtime_lacks = R"(What the guide's thread lacks to be a real-time thread: sentences with the remedies.)";
inline constexpr const char* state = R"(Returns where the robot is. Waits for the first measurement: a robot may first be homing.

Raises what ended the guide before its first measurement, TimedOut.)";
inline constexpr const char* stop = R"(Ends the session at once, whatever other calls wait for; the robot then stops as its driver
does. Faults are left to `check`.

Raises TimedOut like `finish`.)";
inline constexpr const char* wait_until_arrived = R"(Waits until the robot rests at the target of all wishes so far.

Raises InvalidArgument if the robot floats, what ended the guide, TimedOut.)";
}

namespace GuideState {
inline constexpr const char* GuideState = R"(Where a guided robot is and where it goes.)";
inline constexpr const char* has_arrived = R"(All wishes so far are granted, and the robot rests at their target. Always False while
floating.)";
inline constexpr const char* joints = R"(Measured positions [rad].)";
inline constexpr const char* reference_joints = R"(Where the joints should be now [rad].)";
inline constexpr const char* reference_tips = R"(Points that follow from `reference_joints` [m].)";
inline constexpr const char* refusal = R"(One sentence per finger whose last wish cannot be fulfilled: why, and what is done instead.)";
inline constexpr const char* step = R"(Step of the newest measurement; -1 before step 0.)";
inline constexpr const char* target_joints = R"(Where the joints should end [rad].)";
inline constexpr const char* target_tips = R"(Points that follow from `target_joints` [m].)";
inline constexpr const char* tips = R"(Points that follow from `joints` [m].)";
}

namespace HandWriter {
inline constexpr const char* HandWriter = R"(The hand of a simulated robot that `trifinger run` runs in another process.

The robot has one hand. A pull acts while the robot holds its pose and while a session runs,
not during its orderly stop. It begins with the next step, the first one up to 0.1 s after
the writer was made. It ends with `let_go`, with this object, or with its process: 0.1 s
after a kill, and 0.3 s after the process was stopped.

The process of the robot may be started again at any time. The bodies are those of the robot
that ran when this object was made.)";
inline constexpr const char* bodies = R"(What can be pulled, see `pullable_bodies`.)";
inline constexpr const char* let_go = R"(Lets go. Without effect if nothing is pulled, or in a child process after fork.)";
}

namespace ImageFormat {
inline constexpr const char* height = R"([pixel])";
inline constexpr const char* width = R"([pixel])";
}

namespace JointState {
inline constexpr const char* JointState = R"(Measurements of the nine joints, finger 0 first, from the base to the tip.)";
inline constexpr const char* position = R"([rad])";
inline constexpr const char* torque = R"([Nm])";
inline constexpr const char* velocity = R"([rad/s])";
}

namespace Kinematics {
inline constexpr const char* Kinematics = R"(Kinematics and dynamics of the fingers, without contacts and objects. Everything is in the
world frame: z up, origin on the table, whether or not the platform is flipped. Positions of
joints are in rad.

One object must not be used by several threads at once: make one for each.)";
inline constexpr const char* bias_torques = R"(Torques that keep joints at their `velocity` [rad/s] without acceleration, against gravity,
Coriolis and centrifugal forces [Nm]. Friction is not included.)";
inline constexpr const char* gravity_torques = R"(Torques that hold the pose against gravity [Nm].)";
inline constexpr const char* inverse_kinematics = R"(Joint positions of `finger` that bring its tip to `tip` [m], and whether it can reach it. If
it cannot, they are a pose within the hard limits whose tip is near the point. Among up to
four poses it takes the one within the hard limits that is nearest to `near`.)";
inline constexpr const char* mass_matrix = R"(Inertia at the joints, including that of the rotors [kg m^2].)";
inline constexpr const char* num_fingers = R"(Number of fingers: 1 or 3.)";
inline constexpr const char* num_joints = R"(Number of joints: three for each finger.)";
inline constexpr const char* tip_accelerations = R"(Accelerations of the tips when joints move with constant `velocity` [rad/s]: x, y, z for
each finger [m/s^2].)";
inline constexpr const char* tip_jacobian = R"(Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.)";
inline constexpr const char* tip_jacobians = R"(The Jacobians of all tips, one below the other [m/rad]: square, `num_joints` rows and
columns.)";
inline constexpr const char* tip_positions = R"(Centres of all tip spheres: x, y, z for each finger [m].)";
}

namespace KnotSpline {
inline constexpr const char* KnotSpline = R"(Numbers as functions of time: `width` values given at knots of equal distance. Before the
first and after the last knot they rest.

After its construction, no function allocates memory.)";
inline constexpr const char* begin = R"(Time of the first knot [s].)";
inline constexpr const char* end = R"(Time of the last knot [s].)";
inline constexpr const char* knot = R"(The values of one knot.)";
inline constexpr const char* move_to = R"(Moves all knots, so that the first one lies at `begin`.)";
}

namespace LateStep {
inline constexpr const char* LateStep = R"(A step that was late.)";
inline constexpr const char* cause = R"(Who caused it.)";
inline constexpr const char* lateness = R"(How late the tick began. If the user caused it, the time without a new action.)";
}

namespace LatenessHistogram {
inline constexpr const char* LatenessHistogram = R"(Counts times in bins whose width grows with the time: eight bins for each power of two. A
quantile is therefore known to an eighth of its value, however many times were counted.)";
inline constexpr const char* count = R"(Number of counted times.)";
inline constexpr const char* max = R"(The longest time.)";
inline constexpr const char* quantile = R"(The time below which the share `fraction` of all times lies; zero if no time was counted.)";
}

namespace Lens {
inline constexpr const char* Lens = R"(The lens of a camera in OpenCV's model: a pinhole, and radial and tangential distortion.

Points are in the camera's frame: x right, y down, z forward. A pixel is (column, row), and
(0, 0) is the centre of the first one.)";
inline constexpr const char* cropped = R"(The lens of the part of the images that begins at this pixel.)";
inline constexpr const char* cx = R"(Principal point [pixel].)";
inline constexpr const char* distortion = R"(k1 k2 p1 p2 k3.)";
inline constexpr const char* fx = R"(Focal lengths [pixel].)";
inline constexpr const char* scaled = R"(The lens of the same camera with images scaled by `factor`, such as 0.5 for half the size.)";
inline constexpr const char* unproject = R"(The ray (x, y, 1) through a pixel: the inverse of `project`, to 1e-9 of the focal length
within the part of the image plane where the distortion can be inverted.)";
}

namespace LineTrajectory {
inline constexpr const char* LineTrajectory = R"(A straight line with the least jerk.)";
inline constexpr const char* at = R"(The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
`duration` at its end.)";
inline constexpr const char* duration = R"(Time from the start to the end [s].)";
}

namespace LiveBatch {
inline constexpr const char* LiveBatch = R"(What is new since the call before.)";
inline constexpr const char* events = R"(The same sentences are messages of the topic "/events".)";
inline constexpr const char* lost = R"(Number of messages that were left out, because the reader was late or the robot too fast.)";
inline constexpr const char* messages = R"(In the order of each channel.)";
}

namespace LiveChannel {
inline constexpr const char* LiveChannel = R"(Messages of one topic and one type.)";
inline constexpr const char* definition = R"(The text of the schema ("ros2msg"), with the types that it uses.)";
inline constexpr const char* is_image = R"(True if these messages only come while images are wanted.)";
inline constexpr const char* is_latched = R"(True if viewers that come later need the newest message of each `part`: it will not come
again.)";
inline constexpr const char* topic = R"(For example "/sim/step".)";
inline constexpr const char* type = R"(For example "trifinger_msgs/msg/TrifingerStep".)";
}

namespace LiveMessage {
inline constexpr const char* LiveMessage = R"(A message in CDR, with the bytes that a log of the same session has.)";
inline constexpr const char* channel = R"(Its number in `channels()`.)";
inline constexpr const char* log_time = R"(Time since 1970 [ns], as in a log.)";
inline constexpr const char* part = R"(Only latched channels have more than part 0.)";
}

namespace LiveMessages {
inline constexpr const char* LiveMessages = R"(Observes a robot for other programs: gives the messages that a log would have, as soon as
they can be made. It shows the current session of the robot and those that follow.

It only reads, so the robot notices nothing. If the reader is late, it continues with what
is newest. There is at most a second of messages in one batch.

Times of a session in real-time mode may differ from those in a log by the microseconds with
which each of them measured the offset of the clocks.)";
inline constexpr const char* channels = R"(All channels so far; more may come with each batch. If two have the same topic, the later
one counts: the next session has another type.)";
inline constexpr const char* is_running = R"(True if a session is shown that has not ended.)";
inline constexpr const char* take = R"(Returns what is new. Never waits for the robot; call it some 50 times per second.

Raises InvalidArgument if no robot can have this name.)";
inline constexpr const char* want_images = R"(Says whether somebody looks at images. Only then are they copied and compressed, which takes
some milliseconds of a processor per image. At the beginning nobody does.)";
}

namespace Log {
inline constexpr const char* Log = R"(A recording: one file, or all its parts.

If the files are finished and whole, opening reads no messages. Damaged pieces are left out
and named (`damage`, `lost_bytes`, and `gaps` of the sessions); everything else is read.)";
inline constexpr const char* damage = R"(Pieces of the files that could not be read. Reads the whole log once.)";
inline constexpr const char* events = R"(Messages for people. Reads the whole log once.)";
inline constexpr const char* files = R"(The files, in the order of the parts.)";
inline constexpr const char* is_finished = R"(True if every file has the summary that is written at its end.)";
inline constexpr const char* lost_bytes = R"(Number of bytes of the files that could not be used. Reads the whole log once.)";
inline constexpr const char* origin = R"(The program and machine that wrote the log: "trifinger_version", "host", "kernel",
"created". "began" orders the recordings of a folder, even if the clock was set back.)";
inline constexpr const char* session = R"(The newest session with steps of the robot or companion `name`. With an empty name, that of
the only robot in the log.

Raises InvalidArgument with the existing names.)";
inline constexpr const char* sessions = R"(The sessions of robots, in the order in which they began.)";
inline constexpr const char* size = R"(Size of all files together [bytes].)";
}

namespace LoggedSession {
inline constexpr const char* LoggedSession = R"(A session in a log. It belongs to a robot or to one of its companions. A companion has only
observations and counts its own elements. Copies refer to the same log. Any number of
threads may read.)";
inline constexpr const char* between = R"(The range of the elements measured from `begin` to before `end`. Both count from the first
element in the log.)";
inline constexpr const char* companion = R"(One companion, by "object" or its full name.

Raises InvalidArgument with the existing names.)";
inline constexpr const char* companions = R"(The companions of a robot.)";
inline constexpr const char* fault = R"(Why the session ended; `None` if it was still running when the recording ended.)";
inline constexpr const char* fault_text = R"(The reason of `fault` as a sentence.)";
inline constexpr const char* gaps = R"(Elements that are missing in the range of the applied actions, because the recorder said so
or because the file is damaged. Reads the whole log once.)";
inline constexpr const char* name = R"(Name of the session, "sim", or "sim.object" for a companion.)";
inline constexpr const char* range = R"(The first index of `series` in the log, and the first index after the last one. Observations
and statuses may have one more element than actions: that of the end.)";
inline constexpr const char* read = R"(Reads the existing whole steps from `first` to before `last`.)";
inline constexpr const char* steps = R"(Number of whole steps of the session. None if it was still running when the recording ended.)";
inline constexpr const char* timing = R"(How well the session kept its time from step `first` to before `last`, including the status
of its end. It equals the back-end's own record if no step is missing. None outside
real-time mode, or if the statuses have another version. Reads all statuses.)";
inline constexpr const char* type = R"(Type of the robot, for example "trifinger", or of the companion.)";
}

namespace LowPassFilter {
inline constexpr const char* LowPassFilter = R"(A first-order low-pass for up to nine numbers. Samples may come at uneven intervals.)";
inline constexpr const char* reset = R"(Treats the next sample as the first one.)";
inline constexpr const char* update = R"(Takes the next sample, `elapsed` [s] after the previous one, and returns the filtered
signal. The first sample passes unchanged. A sample with another number of values passes
unchanged, too.)";
}

namespace Motion {
inline constexpr const char* Motion = R"(A body at one instant of a motion.)";
}

namespace Network {
inline constexpr const char* metadata = R"(Facts for the program that runs the policy. docs/policies.md lists the usual names.)";
}

namespace ObjectAddress {
inline constexpr const char* ObjectAddress = R"(The place of one loose object in the state of a `RobotModel`.)";
inline constexpr const char* body = R"(Index of the body.)";
inline constexpr const char* position = R"(First of 7 numbers in `qpos`: x y z, then the quaternion w x y z.)";
inline constexpr const char* velocity = R"(First of 6 numbers in `qvel`.)";
}

namespace ObjectGains {
inline constexpr const char* ObjectGains = R"(How stiffly an object is held.)";
inline constexpr const char* damping = R"([Ns/m])";
inline constexpr const char* rotational_damping = R"([Nms/rad])";
inline constexpr const char* rotational_stiffness = R"([Nm/rad])";
inline constexpr const char* stiffness = R"([N/m])";
}

namespace OnlinePlanner {
inline constexpr const char* OnlinePlanner = R"(Plans in threads of its own, beside a loop at 1 HZ.

The loop hands over its newest state, and reads the newest plan at any time. A plan takes
tens of milliseconds. So the state is first simulated forward along the plan that the loop
follows, to the instant at which the new plan will be ready, and the new plan begins there.
Until that instant the loop still follows the old plan.

The planner's threads are ordinary ones, also if the thread that makes it has real-time
priority. Results depend on how fast this machine plans; only with `lead` and
`wait_for_plan` after each state they do not.)";
inline constexpr const char* model = R"(The model, for making states.)";
inline constexpr const char* set_state = R"(Hands over a state, whose time must not be before that of the last one. Ignores a state that
does not fit the model, and then returns False.)";
inline constexpr const char* set_terms = R"(Changes the terms of the task from the next plan on. Ignores them and returns False if their
number is not that of the task, or if one of them does not fit the model or has a number
that is not finite.)";
inline constexpr const char* status = R"(The status as it is now.)";
inline constexpr const char* wait_for_plan = R"(Waits until `count` plans were made since the beginning. Any thread may call it.

Raises TimedOut; and once, the exception of a cost function, which has ended the planning.)";
}

namespace OnlinePlannerOptions {
inline constexpr const char* OnlinePlannerOptions = R"(Settings of an `OnlinePlanner`. All times are on the clock of the states.)";
inline constexpr const char* lead = R"(Time from the state of a plan to the instant from which it is used. Default: as long as
plans took until now.)";
inline constexpr const char* period = R"(Least time from the state of one plan to that of the next one. It is longer if `lead` is:
the next plan is made from a state after the newest one has begun.)";
}

namespace OnlinePlannerStatus {
inline constexpr const char* OnlinePlannerStatus = R"(How plans were made. Plain data.)";
inline constexpr const char* begin = R"(Instant from which the newest plan is used.)";
inline constexpr const char* cost = R"(`Plan.cost`)";
inline constexpr const char* duration = R"(What the newest plan took, from its state on.)";
inline constexpr const char* has_failed = R"(A cost function has thrown, so no other plan will come.)";
inline constexpr const char* lateness = R"(How long after its `begin` it was ready; 0 if in time.)";
inline constexpr const char* median_cost = R"(`Plan.median_cost`)";
inline constexpr const char* num_masked = R"(`Plan.num_masked`)";
inline constexpr const char* num_refused_states = R"(States with numbers that are not finite.)";
inline constexpr const char* state_time = R"(Time of the state from which the newest plan was made.)";
}

namespace PixelFormat {
inline constexpr const char* PixelFormat = R"(How the pixels of an image are stored, row by row without gaps, 8 bits per channel.)";
}

namespace PlannedCommand {
inline constexpr const char* PlannedCommand = R"(What the numbers of a plan are.)";
inline constexpr const char* kPosition = R"(Joint targets [rad], which the joints follow like springs with dampers.)";
inline constexpr const char* kTorque = R"(Torques [Nm].)";
}

namespace PlannedGrasp {
inline constexpr const char* PlannedGrasp = R"(The result of a planner.)";
inline constexpr const char* torque_share = R"(Largest share of a motor's torque that carrying the object needs anywhere on the way.)";
inline constexpr const char* touches = R"(Touches of the three tips, finger 0 first.)";
}

namespace PlannedJoint {
inline constexpr const char* PlannedJoint = R"(A joint with a motor, as plans see it.)";
inline constexpr const char* lower = R"(Range of targets [rad].)";
inline constexpr const char* max_torque = R"(Largest torque of a plan [Nm].)";
inline constexpr const char* upper = R"([rad])";
}

namespace PlannedStates {
inline constexpr const char* PlannedStates = R"(The states of one rollout, from its start on: one more than its steps.)";
}

namespace PlannerOptions {
inline constexpr const char* PlannerOptions = R"(Settings of a planner. The defaults turn and flip cubes; docs/planning.md says what each
does.)";
inline constexpr const char* constant_share = R"(Share of rollouts that change all knots equally.)";
inline constexpr const char* elites = R"(Of CROSS_ENTROPY: number of best rollouts.)";
inline constexpr const char* horizon = R"(Rounded to whole steps of the model, at least one.)";
inline constexpr const char* kd = R"(Damping with which they follow [Nms/rad].)";
inline constexpr const char* kp = R"(Stiffness with which joints follow their targets [Nm/rad].)";
inline constexpr const char* least_sigma = R"(Each rollout changes the knots by normal numbers with a standard deviation between these
two, in the unit of the command. Its logarithm is spread evenly. Cross-entropy begins each
plan with the larger one and does not go below the smaller one.)";
inline constexpr const char* num_threads = R"(The calling thread included; 0: one per processor that the process may use.)";
inline constexpr const char* one_finger_share = R"(Share of rollouts that change one finger only.)";
inline constexpr const char* rounds = R"(Rounds per plan.)";
inline constexpr const char* samples = R"(Rollouts per round. The first one is the plan before the round.)";
inline constexpr const char* seed = R"(Of all random numbers.)";
inline constexpr const char* temperature = R"(Of PATH_INTEGRAL: the costs' scale, as a share of the median's distance from the least cost.)";
}

namespace PlanningMethod {
inline constexpr const char* PlanningMethod = R"(How the next plan follows from the rollouts of a round. docs/planning.md has the equations.)";
inline constexpr const char* kCrossEntropy = R"(The mean of the best rollouts, around which the next round samples with their deviation. R.
Y. Rubinstein: Optimization of computer simulation models with rare events. 1997; M.
Kobilarov: Cross-entropy motion planning. 2012.)";
inline constexpr const char* kPathIntegral = R"(The mean of all rollouts, weighted with the exponentials of their costs. G. Williams et al.:
Information theoretic MPC for model-based reinforcement learning. 2017.)";
inline constexpr const char* kPredictiveSampling = R"(The best rollout. T. Howell et al.: Predictive Sampling: Real-time Behaviour Synthesis with
MuJoCo. 2022.)";
}

namespace PlanningModel {
inline constexpr const char* PlanningModel = R"(A model for planning, with the same joints and objects in the same order as a `RobotModel`.

Steps are long. Contacts have pyramids of friction and few iterations. The wall and all
parts of fingers but tips and lower links touch nothing. The damping of the safety checks is
damping of the joints. Fingers do not pass through the table, and joints stop at their
limits.)";
inline constexpr const char* check = R"(Raises InvalidArgument if the numbers are too few, too many or not finite.)";
inline constexpr const char* initial_state = R"(The initial pose at rest, at time 0.)";
inline constexpr const char* object = R"(Raises InvalidArgument that names the existing objects.)";
inline constexpr const char* set_joints = R"(Sets positions [rad] and velocities [rad/s] of the joints. Does not allocate.)";
inline constexpr const char* set_object = R"(Sets pose and twist of an object, both in the world frame. Does not allocate.)";
inline constexpr const char* tip_sites = R"(Sites at the tips of the fingers.)";
}

namespace PlanningModelOptions {
inline constexpr const char* PlanningModelOptions = R"(What a `PlanningModel` leaves out. docs/planning.md says what each figure costs.)";
inline constexpr const char* fingers_touch = R"(The fingers touch each other, with tips and lower links.)";
inline constexpr const char* impratio = R"(Ratio of the stiffness of friction to that of normal forces; higher: held objects slip less.)";
inline constexpr const char* iterations = R"(Iterations of the solver of contacts in a step, at most.)";
inline constexpr const char* lower_links = R"(The lower links touch objects, each as one capsule. Otherwise only the tips do.)";
inline constexpr const char* time_step = R"([s]; more than 6 ms lets fast tips sink into objects.)";
inline constexpr const char* torque_share = R"(Share of the largest torque that plans may use; the rest is for feedback.)";
}

namespace PlanningState {
inline constexpr const char* PlanningState = R"(A state from which a plan may begin: everything that moves in a `PlanningModel`.)";
inline constexpr const char* position = R"(MuJoCo's `qpos`: the joints, then the objects.)";
inline constexpr const char* time = R"(Time [s] on any clock; the same one for all states of a plan.)";
inline constexpr const char* velocity = R"(MuJoCo's `qvel`.)";
}

namespace PlanningTask {
inline constexpr const char* PlanningTask = R"(A cost is the sum of all parts that are given.)";
inline constexpr const char* late_share = R"(The running cost of `terms` and `cost` counts `late_factor` times in the last `late_share`
of the horizon.)";
}

namespace PointMotion {
inline constexpr const char* PointMotion = R"(A point at one instant of a motion.)";
inline constexpr const char* acceleration = R"([m/s^2])";
inline constexpr const char* position = R"([m])";
inline constexpr const char* velocity = R"([m/s])";
}

namespace Policy {
inline constexpr const char* Policy = R"(A trained policy: it computes actions from observations, in C++ alone. docs/policies.md
describes its file.

One policy must not be used by several threads at once: each needs its own.)";
inline constexpr const char* save = R"(Writes the file at `path` in one step: an old file stays whole until the new one replaces
it.

Raises InvalidArgument if the metadata are not UTF-8 or too long, OSError.)";
}

namespace Pose {
inline constexpr const char* Pose = R"(Position and orientation of a body.)";
inline constexpr const char* orientation = R"(Rotation from the body's frame: a quaternion w, x, y, z of unit length.)";
inline constexpr const char* position = R"(Position of its centre of mass [m].)";
}

namespace PoseEstimator {
inline constexpr const char* PoseEstimator = R"(Estimates the current pose and motion of an object from poses that are few, noisy and old.

The estimator needs a known motion, such as the one on which the object is led. It estimates
how far the object deviates from that motion, and how the deviation changes. The deviation
changes much more slowly than the object's pose. It can therefore be filtered strongly and
predicted across the delay. The filter is critically damped and follows a deviation of
constant rate without lag. If there is no known motion, leave it out: the known pose then
rests at the origin.

Times [s] may begin anywhere, but must have the same beginning in all calls.)";
inline constexpr const char* last_time = R"(Time of the newest pose; negative infinity before the first.)";
inline constexpr const char* predict = R"(The pose and motion of the object at `time`, when the known motion is at `known`. Before the
first pose the result is `known`.)";
inline constexpr const char* reset = R"(Forgets all poses.)";
inline constexpr const char* update = R"(Takes `pose`, measured at `time`, when the known motion was at `known`. Ignores a pose that
is not newer than the previous one or not finite, and then returns False.)";
}

namespace PoseTrajectory {
inline constexpr const char* PoseTrajectory = R"(A straight line, and a rotation about a fixed axis through the smaller angle, with least
jerk.)";
inline constexpr const char* at = R"(The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
`duration` at its end.)";
inline constexpr const char* duration = R"(Time from the start to the end [s].)";
}

namespace PredictivePlanner {
inline constexpr const char* PredictivePlanner = R"(Finds joint targets or torques that make a cost small, by trying many in simulations.

`plan` begins with the previous plan, moved to the new start. In each round it changes this
plan at random, simulates every change over the horizon, and takes the best or a mean. Only
the start and the task count, so it plans through contacts that nobody described.

Results depend on options, seed, task and the starts so far, and not on the number of
threads. `plan` does not allocate after the first call, unless a cost function does. One
planner must not be used by several threads at once; its own threads run while `plan` does.)";
inline constexpr const char* begin_with = R"(Makes the next plan begin with these commands.

Raises InvalidArgument if their width is not the number of joints.)";
inline constexpr const char* costs = R"(Costs of the rollouts of the last round; infinite for those that diverged.)";
inline constexpr const char* newest = R"(The newest plan.)";
inline constexpr const char* restart = R"(Forgets the previous plan: the next one begins with targets where the joints are at the
start, or with zero torques.)";
inline constexpr const char* set_task = R"(Changes what the next plans shall achieve.

Raises InvalidArgument as the constructor does.)";
inline constexpr const char* weights = R"(Weights of these rollouts in the plan; their sum is 1.)";
}

namespace Random {
inline constexpr const char* Random = R"(The random numbers of one episode: Philox4x32-10 with `seed` as its key, and with `count`
and `episode` as its counter.

Only these three numbers decide which number comes next. A copy therefore continues exactly
like the original, and episodes may run in any order. The numbers are the same on every
machine, bit for bit.)";
inline constexpr const char* integer = R"(An integer from `low` up to but not including `high`, each with exactly the same
probability. Returns `low` if there is no integer between them.)";
inline constexpr const char* normal = R"(A normally distributed number with mean 0 and standard deviation 1.)";
inline constexpr const char* uniform = R"(A number from `low` up to but not including `high`. Their difference must be finite. Returns
`low` if they are equal.)";
}

namespace Reason {
inline constexpr const char* Reason = R"(Why a joint did not get the action that was asked for. These are bits of `reasons` in an
applied action.)";
}

namespace RecorderThread {
inline constexpr const char* RecorderThread = R"(Records a robot of this process in a thread of its own. Outside real-time mode nothing is
lost, because the robot waits for the recorder.)";
inline constexpr const char* stop = R"(Writes the available steps and finishes the file. Nothing is recorded after that, and no
back-end waits.

Raises OSError if the end could not be written.)";
}

namespace RigidBody {
inline constexpr const char* RigidBody = R"(Mass and inertia of a rigid body.)";
inline constexpr const char* inertia = R"(Inertia about the centre of mass, in the body's frame [kg m^2].)";
inline constexpr const char* mass = R"([kg])";
}

namespace RolloutBatch {
inline constexpr const char* begin = R"(Time of the first state.)";
inline constexpr const char* num_states = R"(Per rollout: one more than its steps.)";
inline constexpr const char* positions = R"(MuJoCo's `qpos`.)";
inline constexpr const char* targets = R"(Joint targets or torques, after the last step repeated.)";
inline constexpr const char* time_step = R"(From one state to the next one.)";
inline constexpr const char* torques = R"([Nm]; after the last step 0.)";
inline constexpr const char* velocities = R"(MuJoCo's `qvel`.)";
}

namespace Session {
inline constexpr const char* documents = R"(The documents that explain the robot, by name: "configuration.yml", "model.xml". Companions
have none.

Raises IncompatibleSession if the file is damaged.)";
}

namespace SessionInfo {
inline constexpr const char* SessionInfo = R"(Facts about a session for everybody: name, type, period, who takes part. Reading them does
not need a front-end.)";
}

namespace SimulatedRobot {
inline constexpr const char* configuration = R"(Positions and velocities of joints and objects in MuJoCo's layout, to draw the scene:
`qpos`, then `qvel`.)";
inline constexpr const char* let_go = R"(Lets go of what `pull` pulls.)";
inline constexpr const char* object_pose = R"(The object's pose now, without delay and noise: position [m] and quaternion w, x, y, z.

Raises InvalidArgument that names the existing objects.)";
inline constexpr const char* object_velocity = R"(The object's velocity now, without delay and noise: velocity of its centre [m/s] and angular
velocity [rad/s].

Raises InvalidArgument that names the existing objects.)";
inline constexpr const char* observed_object_pose = R"(The object's pose at the newest observation, without delay and noise. The action of that
step may have moved it since.

Raises InvalidArgument that names the existing objects.)";
inline constexpr const char* place_object = R"(Places an object at rest at `pose`. The orientation is normalized.

Raises InvalidArgument that names the existing objects, or if the pose is not valid.)";
inline constexpr const char* pull = R"(Pulls at a tip or an object, one of `pullable_bodies`, in place of what was pulled before.
It acts from the next step on until `let_go`, `reset`, `restore` or the next session. It is
no part of a saved state. A hand in another process counts more while it pulls.

Raises InvalidArgument that names the existing bodies, or if the pull is not valid.)";
inline constexpr const char* push_object = R"(Applies a force to an object's centre of mass [N], in the world frame, like a hand that
pushes. It acts from the next step on until the next call, `reset` or session.

Raises InvalidArgument that names the existing objects, or if the force is not finite.)";
inline constexpr const char* restore = R"(Continues from `state` exactly as the saved simulation continued, bit for bit.

Raises InvalidArgument if it was saved from another model or by another version.)";
inline constexpr const char* save = R"(Saves the state: physics, safety chain, delays, random numbers.)";
inline constexpr const char* set_object_velocity = R"(Sets an object in motion from where it is, in the world frame: velocity of its centre [m/s]
and angular velocity [rad/s].

Raises InvalidArgument that names the existing objects, or if a number is not finite.)";
inline constexpr const char* state_before_divergence = R"(The last state before the simulation diverged, for a report or another try. Empty if it has
not diverged. `trifinger run` saves it in `log_folder()`.)";
}

namespace Simulation {
inline constexpr const char* connect = R"(Controls the robot in a new session.

Raises ControlHeld while another front-end controls it.)";
}

namespace SplineKind {
inline constexpr const char* SplineKind = R"(How values follow from knots.)";
inline constexpr const char* kConstant = R"(A knot holds until the next one.)";
inline constexpr const char* kCubic = R"(Cubic polynomials whose rates at the knots are those of the parabolas through the neighbours
(Catmull and Rom). Values and rates are continuous.)";
inline constexpr const char* kLinear = R"(Straight lines between knots.)";
}

namespace Status::Flag {
inline constexpr const char* Flag = R"(What happened in a step: bits of the field `flags` of its status.)";
inline constexpr const char* kAcausal = R"(The action was appended by someone who had already read y_t.)";
inline constexpr const char* kActionRejected = R"(The action could not be applied; a safe one was applied instead.)";
inline constexpr const char* kActionRepeated = R"(The action for this step was missing; the previous one was applied again.)";
inline constexpr const char* kDriverLate = R"(The tick began late: calls of the driver used up the tick before.)";
inline constexpr const char* kEnd = R"(The last status of the session: no action was applied at this step.)";
inline constexpr const char* kSchedulerLate = R"(The tick began late: the back-end did not get the processor in time.)";
}

namespace TimingRecord {
inline constexpr const char* TimingRecord = R"(How well a session in real time keeps its time: a summary of all its statuses, including the
last one. It is plain data of a fixed size. The back-end keeps one for everybody to read,
and a log gives the same.)";
inline constexpr const char* late_steps = R"(Number of late steps: all of them, or those late because of `cause`.)";
inline constexpr const char* lateness = R"(The `lateness_of` all steps.)";
inline constexpr const char* steps = R"(Number of steps so far, including the one that ended the session.)";
inline constexpr const char* success_rate = R"(The share of the newest 1000 steps that were in time: 1 if all of them were.)";
inline constexpr const char* worst = R"(The worst late steps, the worst one first. In a row of steps with growing lateness only the
last one is listed.)";
}

namespace TipGains {
inline constexpr const char* TipGains = R"(How stiffly a tip is held.)";
inline constexpr const char* damping = R"([Ns/m])";
inline constexpr const char* stiffness = R"([N/m])";
}

namespace TorqueLimits {
inline constexpr const char* TorqueLimits = R"(The torques that the joints can give to press with the tips. Row i of the Jacobian tells how
coordinate i of the contacts' positions changes when the joints move.)";
inline constexpr const char* bias = R"(Torques that the joints need without any contact [Nm]: `Kinematics.bias_torques`.)";
inline constexpr const char* jacobians = R"(Jacobians of the contacts in the frame of the grasp, 9 x 9 [m/rad]. For the world frame this
is `Kinematics.tip_jacobians`.)";
inline constexpr const char* limits = R"([Nm], not negative.)";
}

namespace Touch {
inline constexpr const char* Touch = R"(The place where one tip touches an object, in the object's frame.)";
inline constexpr const char* normal = R"(Direction into the object, of unit length.)";
inline constexpr const char* point = R"(Point on the surface, from the centre [m].)";
}

namespace TrackedObject {
inline constexpr const char* TrackedObject = R"(A convex object whose faces have known colours.)";
}

namespace Tracker {
inline constexpr const char* Tracker = R"(Finds an object with coloured faces in the images of calibrated cameras, taken at one time.

Knows nothing of earlier images: the same images give the same estimate. Not thread-safe.)";
inline constexpr const char* track = R"(Where the object is in these images, one of each camera. An empty image stands for one that
is missing or damaged. `guess` is where the object may be, such as its last pose. It saves
time if it is near, and it is forgotten if the images do not confirm it or if a number in it
is not finite. Does not allocate.

Raises InvalidArgument if the number of images or the size of one is wrong.)";
}

namespace Twist {
inline constexpr const char* Twist = R"(Velocity and angular velocity of a body.)";
inline constexpr const char* angular = R"([rad/s], not in the body's frame.)";
inline constexpr const char* linear = R"(Velocity of its centre of mass [m/s].)";
}

namespace UntypedFrontend {
inline constexpr const char* range = R"(The first index of `series` that can still be read, and the first index not yet written.)";
}

namespace Wrench {
inline constexpr const char* Wrench = R"(A force and a moment. The moment is about a point that is stated with each use.)";
inline constexpr const char* force = R"([N])";
inline constexpr const char* moment = R"([Nm])";
}

inline constexpr const char* approach_to = R"(The approach of a tip with radius `tip_radius` [m] to an object that rests at the pose
`object`.)";
inline constexpr const char* balanced_blocks = R"(The mean red, green and blue of each block, 0 to 255, with a white balance that makes most
of the image grey.

Raises InvalidArgument if the image has no colours, or another size than its format says.)";
inline constexpr const char* checked_model_text = R"(Judges the text of a model, MJCF or URDF, that somebody else has written, such as the
document "model.xml" of a log, and returns it in a form that MuJoCo may read: it names no
file, and what it asks for stays below limits. MuJoCo itself would open any path and obey
any number.

Raises InvalidArgument that names the line, what it asks for and the largest value allowed.)";
inline constexpr const char* coloured_box = R"(A box with whole lengths `size` [m]. The colour of a face ends `rim` before its edges [m];
the rest is dark.

Raises InvalidArgument if the rim leaves nothing of a face.)";
inline constexpr const char* coloured_mesh = R"(A convex mesh: the hull of `vertices` [m], whose triangles have colours. Triangles of one
colour in one plane become one face.

Raises InvalidArgument if a triangle has no area or the mesh is not convex.)";
inline constexpr const char* connect = R"(Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`).

Raises SessionNotFound with the names of running robots and how to start one, ControlHeld
that names the controlling process, IncompatibleSession if it is another robot, RobotStopped
if a fault must first be cleared with `recover`.)";
inline constexpr const char* contact_frame = R"(A matrix whose columns are two tangents and `normal`, orthonormal and right-handed. The
first tangent is perpendicular to z, or to x if the normal is nearly along z.)";
inline constexpr const char* duration_text = R"(The duration in words: "850 ns", "12 µs", "1.28 ms", "2 s". With a decimal point it has at
most three digits.)";
inline constexpr const char* elite_weights = R"(Equal weights for the `count` least costs; of equal costs the first ones.)";
inline constexpr const char* export_mjcf = R"(The whole scene in MuJoCo's own format, with objects, cameras and lights. It needs no other
file.

MuJoCo writes six digits, so a model that is read back agrees with the built one to about
1e-6 m.

Raises InvalidArgument if the description cannot be built.)";
inline constexpr const char* export_urdf = R"(The robot as URDF, for planners and other simulations: links with the source's inertias,
joints with limits, tips and cameras as frames (cameras as `NAME_optical_frame`: x right, y
down, z forward). It has no boundary and needs no other file. Gravity points along the root
link's -z, flipped or not.

Raises InvalidArgument if the description cannot be built.)";
inline constexpr const char* faces_in_blocks = R"(For each block of a camera's image the index of the face that it shows if the object has
this `pose`, or a `BlockContent`. Whatever stands in front of the object is not known.)";
inline constexpr const char* grasp_map = R"(The map from contact forces to the wrench on the object about `centre` [m]. It has 6 rows,
force and moment, and 9 columns, three for each of the three contacts. Its rank is 6 if the
contacts do not lie on one line.)";
inline constexpr const char* gravity = R"(Standard gravity as in MuJoCo's models [m/s^2], in the world frame.)";
inline constexpr const char* lateness_of = R"(How late the step of `status` was: the time from the deadline to the beginning of the tick.
If ticks were left out before it, the time counts from the deadline of the first of them.
Zero without deadlines. Everything that is shown as "lateness" is this value; `TimingRecord`
keeps its quantiles and its maximum.)";
inline constexpr const char* list_sessions = R"(All sessions in the session folder, robots and companions, sorted by name. Sessions whose
back-end died are included; sessions that cannot be opened are left out.)";
inline constexpr const char* minimum_jerk = R"(The movement of least jerk from rest to rest: `10 s^3 - 15 s^4 + 6 s^5`, where s is the
share of `duration` that has passed. It is complete if `duration` is not positive.)";
inline constexpr const char* moved = R"(The pose after moving from `pose` with a constant `twist` for `duration` [s], which may be
negative.)";
inline constexpr const char* num_processors = R"(Number of processors that the calling thread was given, at least 1: those of its affinity
(taskset, cpusets of containers and of batch systems), but no more than the quota of its
control groups, rounded up (`docker run --cpus`, `CPUQuota=` of systemd).)";
inline constexpr const char* object_impedance = R"(The wrench about the object's centre that keeps the object on its way, in the world frame:

    force  = stiffness * dx + damping * dv + mass * (a - gravity)
    moment = rotational_stiffness * dr + rotational_damping * dw + I alpha + w x I w

where `dx`, `dv`, `dw` are the errors of position, velocity and angular velocity (desired
minus actual), `dr` is the rotation error, and `a`, `alpha`, `w` belong to the desired
motion.)";
inline constexpr const char* observe = R"(Observes the robot `name` without controlling it.)";
inline constexpr const char* path_integral_weights = R"(`exp(-(cost - least) / scale)`, divided by the sum, where `scale` is `temperature` times the
median's distance from the least cost. Adding a number to all costs, or multiplying them
all, changes nothing.)";
inline constexpr const char* point_of_body = R"(The motion of a point that is fixed to a body. `point` is in the body's frame, from its
centre [m].)";
inline constexpr const char* pullable_bodies = R"(Names of what can be pulled: "tip_0" and so on, one for each finger, then the names of the
objects.)";
inline constexpr const char* recover = R"(Clears the fault of the robot `name`, so that the next session begins. This is for an
operator who has looked at the robot.

Raises SessionNotFound, TimedOut, RobotStopped if the back-end is gone.)";
inline constexpr const char* rigid_body = R"(Mass and inertia of an object whose mass is evenly spread: a box, a stick along x, or a
ball. Its size has the whole lengths x, y, z of a box, the length and diameter of a stick,
or the diameter of a ball [m].)";
inline constexpr const char* rotation_error = R"(The rotation that still turns `actual` into `desired` [rad], in the frame in which both are
given: `log(desired * actual^-1)`.)";
inline constexpr const char* rotation_from_vector = R"(The rotation about the direction of `vector` by its length [rad]: the exponential map, as a
quaternion w, x, y, z.)";
inline constexpr const char* rotation_vector = R"(The shortest vector [rad] that `rotation_from_vector` turns into `rotation`: the logarithm.
Its length is at most pi.)";
inline constexpr const char* simulate = R"(Starts a simulated robot in this process and controls it strictly: an action that would be
late on a real robot raises. For a robot that runs elsewhere, use `connect`.)";
inline constexpr const char* task_names = R"(Names of all tasks, for example "reach".)";
inline constexpr const char* tip_impedance = R"(The force that brings a tip to its desired position [N]: `stiffness * dx + damping * dv`.
Add the force with which the tip should press. The joint torques for a force are `J' force`
plus `Kinematics.bias_torques`.)";
inline constexpr const char* tracked_object = R"(An object of a scene as the simulation draws it: boxes have colours and rims.

Raises InvalidArgument if it has no faces with different colours, like a stick or a ball.)";
inline constexpr const char* wrench_of = R"(The total wrench of nine `forces` [N] at the three contacts, about `centre` [m].)";

namespace camera::Calibration {
inline constexpr const char* Calibration = R"(The cameras of a robot as they were calibrated, in the order of its images.)";
inline constexpr const char* date = R"(When it was measured: "2026-11-22 21:50:00 UTC"; empty if unknown.)";
inline constexpr const char* residual = R"(Root mean square of what the calibration could not explain [pixel].)";
inline constexpr const char* text = R"(As the text of a file, in YAML.)";
}

namespace camera {
inline constexpr const char* calibration_file = R"(The file with the calibration of the cameras of the robot `robot`: ROBOT.cameras.yml in the
folder of calibrations, $TRIFINGER_CALIBRATION_DIR or ~/.config/trifinger/calibration.

Raises InvalidArgument if the environment names no folder.)";
inline constexpr const char* read_calibration = R"(Reads the section or file of a calibration.

Raises config.ConfigError at what makes no sense.)";
}

namespace control::Plan {
inline constexpr const char* Plan = R"(A plan, and how good it is. All is from the planning model.)";
inline constexpr const char* commands = R"(Its `begin` is the time of the start.)";
inline constexpr const char* cost = R"(Of a rollout of this plan; infinite if it diverged.)";
inline constexpr const char* least_cost = R"(Of the best rollout of the last round.)";
inline constexpr const char* median_cost = R"(Of the last round, without masked rollouts.)";
inline constexpr const char* num_masked = R"(Rollouts of the last round that diverged.)";
inline constexpr const char* number = R"(Counts plans from 1.)";
inline constexpr const char* previous_cost = R"(Of the plan with which this one began.)";
inline constexpr const char* states = R"(What this plan leads to.)";
}

namespace control::Progress {
inline constexpr const char* Progress = R"(Progress of a movement, with its derivatives.)";
inline constexpr const char* acceleration = R"([1/s^2])";
inline constexpr const char* rate = R"([1/s])";
inline constexpr const char* value = R"(0 at the beginning, 1 at the end.)";
}

namespace log::SessionHeader {
inline constexpr const char* realtime_lacks = R"(In real-time mode: what the loop lacked to be a real-time thread, one sentence each. None if
it was not recorded.)";
}

}  // namespace trifinger::bindings::docs
// NOLINTEND(readability-identifier-naming)
