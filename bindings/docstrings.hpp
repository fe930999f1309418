// SPDX-License-Identifier: BSD-3-Clause
// Comments of headers, for Python. tools/write_docstrings.py writes this file.
#pragma once

// clang-format off
// NOLINTBEGIN(readability-identifier-naming): the names are those of the declarations.
namespace trifinger::bindings::docs {

namespace Acceleration {
extern const char* const Acceleration;
extern const char* const angular;
extern const char* const linear;
}

namespace Approach {
extern const char* const Approach;
extern const char* const above;
extern const char* const beside;
}

namespace Camera {
extern const char* const Camera;
extern const char* const name;
extern const char* const pose;
extern const char* const reduced;
extern const char* const resized;
extern const char* const serial;
}

namespace CameraRenderer {
extern const char* const CameraRenderer;
}

namespace CircleTrajectory {
extern const char* const CircleTrajectory;
extern const char* const at;
extern const char* const duration;
}

namespace Companion {
extern const char* const get_latest_at;
extern const char* const payload;
}

namespace Contact {
extern const char* const Contact;
extern const char* const friction;
extern const char* const max_normal_force;
extern const char* const min_normal_force;
extern const char* const normal;
extern const char* const position;
}

namespace CostKind {
extern const char* const CostKind;
extern const char* const kEffort;
extern const char* const kJointPosition;
extern const char* const kJointVelocity;
extern const char* const kObjectOrientation;
extern const char* const kObjectPosition;
extern const char* const kObjectRotation;
extern const char* const kObjectVelocity;
extern const char* const kTargetDistance;
extern const char* const kTipObject;
extern const char* const kTipPosition;
}

namespace CostShape {
extern const char* const CostShape;
extern const char* const kLinear;
extern const char* const kSmooth;
extern const char* const kSquare;
}

namespace CostTerm {
extern const char* const CostTerm;
extern const char* const distance;
extern const char* const end_weight;
extern const char* const index;
extern const char* const joints;
extern const char* const smoothing;
extern const char* const weight;
}

namespace Derivative {
extern const char* const Derivative;
extern const char* const reset;
extern const char* const update;
}

namespace DirectSimulation {
extern const char* const DirectSimulation;
extern const char* const configuration_position;
extern const char* const continue_from;
extern const char* const place_object;
extern const char* const push_object;
extern const char* const set_joints;
extern const char* const set_object_mass;
}

namespace Environment {
extern const char* const Environment;
extern const char* const begin;
extern const char* const entries;
extern const char* const has_goals_of_fingers;
extern const char* const hidden_entries;
extern const char* const judges_by_truth;
extern const char* const num_parts;
extern const char* const scores;
}

namespace EnvironmentBatch {
extern const char* const EnvironmentBatch;
extern const char* const cameras;
extern const char* const configuration;
extern const char* const first_finger;
extern const char* const model_file;
extern const char* const oldest_sure_age;
extern const char* const reset;
extern const char* const seed;
extern const char* const set_physics;
extern const char* const set_reset_states;
extern const char* const step;
extern const char* const varied_field;
extern const char* const varied_fields;
}

namespace Estimate {
extern const char* const Estimate;
extern const char* const cameras;
extern const char* const confidence;
extern const char* const faces;
extern const char* const position_deviation;
extern const char* const residual;
extern const char* const rotation_deviation;
}

namespace ForceDistribution {
extern const char* const ForceDistribution;
extern const char* const forces;
extern const char* const wrench;
}

namespace ForceOptimizer {
extern const char* const ForceOptimizer;
extern const char* const solve;
}

namespace ForceStatus {
extern const char* const ForceStatus;
extern const char* const kClosestWrench;
extern const char* const kExact;
extern const char* const kInvalid;
extern const char* const kTorqueLimitsExceeded;
}

namespace FrictionPyramid {
extern const char* const FrictionPyramid;
extern const char* const margin;
extern const char* const side;
}

namespace Frontend {
extern const char* const Frontend;
extern const char* const append_desired_action;
extern const char* const append_desired_actions;
extern const char* const companion;
extern const char* const current_time_index;
extern const char* const fault;
extern const char* const finish;
extern const char* const get_applied_action;
extern const char* const get_desired_action;
extern const char* const get_observation;
extern const char* const get_status;
extern const char* const latest_observation;
extern const char* const recover;
extern const char* const timing;
extern const char* const wait_until_time_index;
}

namespace GraspController {
extern const char* const GraspController;
extern const char* const grasp;
extern const char* const release;
extern const char* const state;
extern const char* const update;
}

namespace GraspControllerConfig {
extern const char* const GraspControllerConfig;
extern const char* const approach_speed;
extern const char* const closing_speed;
extern const char* const closing_time;
extern const char* const engage_time;
extern const char* const friction;
extern const char* const friction_sides;
extern const char* const lost_distance;
extern const char* const lost_time;
extern const char* const max_normal_force;
extern const char* const min_normal_force;
extern const char* const object;
extern const char* const penetration;
extern const char* const roll_time;
extern const char* const slip_friction;
extern const char* const slip_speed;
extern const char* const tips;
extern const char* const touch_force;
}

namespace GraspPhase {
extern const char* const GraspPhase;
extern const char* const kApproach;
extern const char* const kClose;
extern const char* const kEngage;
extern const char* const kHold;
extern const char* const kIdle;
extern const char* const kLost;
extern const char* const kRelease;
}

namespace GraspPlanner {
extern const char* const GraspPlanner;
extern const char* const plan;
}

namespace GraspPlannerConfig {
extern const char* const GraspPlannerConfig;
extern const char* const clearance;
extern const char* const friction;
extern const char* const friction_sides;
extern const char* const heights;
extern const char* const largest_torque;
extern const char* const limit_margin;
extern const char* const min_normal_force;
extern const char* const offsets;
extern const char* const shared_faces;
}

namespace GraspState {
extern const char* const GraspState;
extern const char* const felt;
extern const char* const is_slipping;
extern const char* const normal_forces;
extern const char* const slip_speeds;
extern const char* const tangential_forces;
extern const char* const torque_share;
extern const char* const travel;
extern const char* const wanted;
}

namespace Guide {
extern const char* const Guide;
extern const char* const check;
extern const char* const finish;
extern const char* const float_freely;
extern const char* const frontend;
extern const char* const hold;
extern const char* const home;
extern const char* const is_running;
extern const char* const move_frame;
extern const char* const move_joint;
extern const char* const move_joints;
extern const char* const move_tip;
extern const char* const realtime_warnings;
extern const char* const state;
extern const char* const stop;
extern const char* const wait_until_arrived;
}

namespace GuideState {
extern const char* const GuideState;
extern const char* const frames;
extern const char* const has_arrived;
extern const char* const joints;
extern const char* const reference_frames;
extern const char* const reference_joints;
extern const char* const refusal;
extern const char* const step;
extern const char* const target_frames;
extern const char* const target_joints;
}

namespace HandWriter {
extern const char* const HandWriter;
extern const char* const bodies;
extern const char* const let_go;
}

namespace ImageFormat {
extern const char* const height;
extern const char* const width;
}

namespace JointSolution {
extern const char* const JointSolution;
extern const char* const angle;
extern const char* const distance;
extern const char* const is_reached;
extern const char* const position;
}

namespace JointState {
extern const char* const JointState;
extern const char* const position;
extern const char* const torque;
extern const char* const velocity;
}

namespace Kinematics {
extern const char* const Kinematics;
extern const char* const bias_torques;
extern const char* const gravity_torques;
extern const char* const inverse_kinematics;
extern const char* const mass_matrix;
extern const char* const num_fingers;
extern const char* const num_joints;
extern const char* const tip_accelerations;
extern const char* const tip_jacobian;
extern const char* const tip_jacobians;
extern const char* const tip_positions;
}

namespace KnotSpline {
extern const char* const KnotSpline;
extern const char* const begin;
extern const char* const end;
extern const char* const knot;
extern const char* const move_to;
}

namespace LateStep {
extern const char* const LateStep;
extern const char* const cause;
extern const char* const lateness;
}

namespace LatenessHistogram {
extern const char* const LatenessHistogram;
extern const char* const count;
extern const char* const max;
extern const char* const quantile;
}

namespace Lens {
extern const char* const Lens;
extern const char* const cropped;
extern const char* const cx;
extern const char* const distortion;
extern const char* const fx;
extern const char* const scaled;
extern const char* const unproject;
}

namespace LineTrajectory {
extern const char* const LineTrajectory;
extern const char* const at;
extern const char* const duration;
}

namespace LiveBatch {
extern const char* const LiveBatch;
extern const char* const events;
extern const char* const lost;
extern const char* const messages;
}

namespace LiveChannel {
extern const char* const LiveChannel;
extern const char* const definition;
extern const char* const is_image;
extern const char* const is_latched;
extern const char* const topic;
extern const char* const type;
}

namespace LiveMessage {
extern const char* const LiveMessage;
extern const char* const channel;
extern const char* const log_time;
extern const char* const part;
}

namespace LiveMessages {
extern const char* const LiveMessages;
extern const char* const channels;
extern const char* const is_running;
extern const char* const take;
extern const char* const want_images;
}

namespace Log {
extern const char* const Log;
extern const char* const damage;
extern const char* const events;
extern const char* const files;
extern const char* const is_finished;
extern const char* const lost_bytes;
extern const char* const origin;
extern const char* const session;
extern const char* const sessions;
extern const char* const size;
}

namespace LoggedSession {
extern const char* const LoggedSession;
extern const char* const between;
extern const char* const companion;
extern const char* const companions;
extern const char* const fault;
extern const char* const fault_text;
extern const char* const gaps;
extern const char* const name;
extern const char* const range;
extern const char* const read;
extern const char* const steps;
extern const char* const timing;
extern const char* const type;
}

namespace LowPassFilter {
extern const char* const LowPassFilter;
extern const char* const reset;
extern const char* const update;
}

namespace ModelKinematics {
extern const char* const bias_torques;
extern const char* const gravity_torques;
extern const char* const jacobian;
extern const char* const mass_matrix;
extern const char* const null_space_torques;
}

namespace Motion {
extern const char* const Motion;
}

namespace Network {
extern const char* const metadata;
}

namespace ObjectAddress {
extern const char* const ObjectAddress;
extern const char* const body;
extern const char* const position;
extern const char* const velocity;
}

namespace ObjectGains {
extern const char* const ObjectGains;
extern const char* const damping;
extern const char* const rotational_damping;
extern const char* const rotational_stiffness;
extern const char* const stiffness;
}

namespace OnlinePlanner {
extern const char* const OnlinePlanner;
extern const char* const model;
extern const char* const set_state;
extern const char* const set_terms;
extern const char* const status;
extern const char* const wait_for_plan;
}

namespace OnlinePlannerOptions {
extern const char* const OnlinePlannerOptions;
extern const char* const lead;
extern const char* const period;
}

namespace OnlinePlannerStatus {
extern const char* const OnlinePlannerStatus;
extern const char* const begin;
extern const char* const cost;
extern const char* const duration;
extern const char* const has_failed;
extern const char* const lateness;
extern const char* const median_cost;
extern const char* const num_masked;
extern const char* const num_refused_states;
extern const char* const state_time;
}

namespace PixelFormat {
extern const char* const PixelFormat;
}

namespace PlannedCommand {
extern const char* const PlannedCommand;
extern const char* const kPosition;
extern const char* const kTorque;
}

namespace PlannedGrasp {
extern const char* const PlannedGrasp;
extern const char* const torque_share;
extern const char* const touches;
}

namespace PlannedJoint {
extern const char* const PlannedJoint;
extern const char* const lower;
extern const char* const max_torque;
extern const char* const upper;
}

namespace PlannedStates {
extern const char* const PlannedStates;
}

namespace PlannerOptions {
extern const char* const PlannerOptions;
extern const char* const constant_share;
extern const char* const elites;
extern const char* const horizon;
extern const char* const kd;
extern const char* const kp;
extern const char* const least_sigma;
extern const char* const num_threads;
extern const char* const one_finger_share;
extern const char* const rounds;
extern const char* const samples;
extern const char* const seed;
extern const char* const temperature;
}

namespace PlanningMethod {
extern const char* const PlanningMethod;
extern const char* const kCrossEntropy;
extern const char* const kPathIntegral;
extern const char* const kPredictiveSampling;
}

namespace PlanningModel {
extern const char* const PlanningModel;
extern const char* const check;
extern const char* const initial_state;
extern const char* const object;
extern const char* const set_joints;
extern const char* const set_object;
extern const char* const tip_sites;
}

namespace PlanningModelOptions {
extern const char* const PlanningModelOptions;
extern const char* const fingers_touch;
extern const char* const impratio;
extern const char* const iterations;
extern const char* const lower_links;
extern const char* const time_step;
extern const char* const torque_share;
}

namespace PlanningState {
extern const char* const PlanningState;
extern const char* const position;
extern const char* const time;
extern const char* const velocity;
}

namespace PlanningTask {
extern const char* const PlanningTask;
extern const char* const late_share;
}

namespace PointMotion {
extern const char* const PointMotion;
extern const char* const acceleration;
extern const char* const position;
extern const char* const velocity;
}

namespace Policy {
extern const char* const Policy;
extern const char* const has_state;
extern const char* const reset;
extern const char* const save;
}

namespace Pose {
extern const char* const Pose;
extern const char* const orientation;
extern const char* const position;
}

namespace PoseEstimator {
extern const char* const PoseEstimator;
extern const char* const last_time;
extern const char* const predict;
extern const char* const reset;
extern const char* const update;
}

namespace PoseTrajectory {
extern const char* const PoseTrajectory;
extern const char* const at;
extern const char* const duration;
}

namespace PredictivePlanner {
extern const char* const PredictivePlanner;
extern const char* const begin_with;
extern const char* const costs;
extern const char* const newest;
extern const char* const restart;
extern const char* const set_task;
extern const char* const weights;
}

namespace Reason {
extern const char* const Reason;
}

namespace RecorderThread {
extern const char* const RecorderThread;
extern const char* const stop;
}

namespace RigidBody {
extern const char* const RigidBody;
extern const char* const inertia;
extern const char* const mass;
}

namespace RolloutBatch {
extern const char* const begin;
extern const char* const num_states;
extern const char* const positions;
extern const char* const targets;
extern const char* const time_step;
extern const char* const torques;
extern const char* const velocities;
}

namespace Session {
extern const char* const documents;
}

namespace SessionInfo {
extern const char* const SessionInfo;
}

namespace SimulatedRobot {
extern const char* const configuration;
extern const char* const let_go;
extern const char* const object_pose;
extern const char* const object_velocity;
extern const char* const observed_object_pose;
extern const char* const place_object;
extern const char* const pull;
extern const char* const push_object;
extern const char* const restore;
extern const char* const save;
extern const char* const set_object_velocity;
extern const char* const state_before_divergence;
}

namespace Simulation {
extern const char* const connect;
}

namespace SplineKind {
extern const char* const SplineKind;
extern const char* const kConstant;
extern const char* const kCubic;
extern const char* const kLinear;
}

namespace Status::Flag {
extern const char* const Flag;
extern const char* const kAcausal;
extern const char* const kActionRejected;
extern const char* const kActionRepeated;
extern const char* const kDriverLate;
extern const char* const kEnd;
extern const char* const kSchedulerLate;
}

namespace TimingRecord {
extern const char* const TimingRecord;
extern const char* const late_steps;
extern const char* const lateness;
extern const char* const steps;
extern const char* const success_rate;
extern const char* const worst;
}

namespace TipGains {
extern const char* const TipGains;
extern const char* const damping;
extern const char* const stiffness;
}

namespace TorqueLimits {
extern const char* const TorqueLimits;
extern const char* const bias;
extern const char* const jacobians;
extern const char* const limits;
}

namespace Touch {
extern const char* const Touch;
extern const char* const normal;
extern const char* const point;
}

namespace TrackedObject {
extern const char* const TrackedObject;
}

namespace Tracker {
extern const char* const Tracker;
extern const char* const track;
}

namespace Twist {
extern const char* const Twist;
extern const char* const angular;
extern const char* const linear;
}

namespace UntypedFrontend {
extern const char* const is_late;
extern const char* const range;
}

namespace Wrench {
extern const char* const Wrench;
extern const char* const force;
extern const char* const moment;
}

extern const char* const approach_to;
extern const char* const balanced_blocks;
extern const char* const checked_model_text;
extern const char* const coloured_box;
extern const char* const coloured_mesh;
extern const char* const connect;
extern const char* const contact_frame;
extern const char* const duration_text;
extern const char* const elite_weights;
extern const char* const export_mjcf;
extern const char* const export_urdf;
extern const char* const faces_in_blocks;
extern const char* const grasp_map;
extern const char* const gravity;
extern const char* const lateness_of;
extern const char* const list_sessions;
extern const char* const minimum_jerk;
extern const char* const moved;
extern const char* const num_processors;
extern const char* const object_impedance;
extern const char* const observe;
extern const char* const path_integral_weights;
extern const char* const point_of_body;
extern const char* const pullable_bodies;
extern const char* const recover;
extern const char* const rigid_body;
extern const char* const rotation_error;
extern const char* const rotation_from_vector;
extern const char* const rotation_vector;
extern const char* const running_robot;
extern const char* const simulate;
extern const char* const task_names;
extern const char* const tip_impedance;
extern const char* const tracked_object;
extern const char* const wrench_of;

namespace camera::Calibration {
extern const char* const Calibration;
extern const char* const date;
extern const char* const residual;
extern const char* const text;
}

namespace camera {
extern const char* const calibration_file;
extern const char* const read_calibration;
}

namespace control::Plan {
extern const char* const Plan;
extern const char* const commands;
extern const char* const cost;
extern const char* const least_cost;
extern const char* const median_cost;
extern const char* const num_masked;
extern const char* const number;
extern const char* const previous_cost;
extern const char* const states;
}

namespace control::Progress {
extern const char* const Progress;
extern const char* const acceleration;
extern const char* const rate;
extern const char* const value;
}

namespace log::SessionHeader {
extern const char* const realtime_warnings;
}

}  // namespace trifinger::bindings::docs
// NOLINTEND(readability-identifier-naming)
