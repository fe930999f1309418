// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/model_file.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <span>
#include <system_error>
#include <utility>

#include "base/text_of.hpp"
#include "file_objects.hpp"
#include "finish_urdf.hpp"
#include "foreign_model.hpp"
#include "model/mujoco_messages.hpp"
#include "repair_inertia.hpp"
#include "self_contained.hpp"
#include "spec.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;

std::string name_of(const mjModel& model, mjtObj type, int id) {
  const char* const name = mj_id2name(&model, type, id);
  return name != nullptr ? name : "";
}

bool is_scalar(int type) { return type == mjJNT_HINGE || type == mjJNT_SLIDE; }

bool is_scalar(const mjModel& model, int joint) { return is_scalar(model.jnt_type[joint]); }

// A joint or a fixed tendon of the model.
struct Target {
  mjtObj type{mjOBJ_JOINT};
  int id{-1};

  friend bool operator==(const Target&, const Target&) = default;
};

bool is_fixed_tendon(const mjModel& model, int tendon) {
  return model.wrap_type[model.tendon_adr[tendon]] == mjWRAP_JOINT;
}

// What an actuator drives: nothing if it lets bodies stick to each other. `problem` says why a
// motor cannot take its place; empty if it can.
struct Drive {
  Target target;
  std::string problem;
};

Drive drive_of(const mjModel& model, int actuator) {
  const int id = model.actuator_trnid[2 * actuator];
  switch (model.actuator_trntype[actuator]) {
    case mjTRN_JOINT:
    case mjTRN_JOINTINPARENT:
      if (!is_scalar(model, id)) return {{}, "it turns a ball joint or moves a free body"};
      break;
    case mjTRN_TENDON:
      if (!is_fixed_tendon(model, id)) return {{}, "it pulls a tendon that runs along bodies"};
      break;
    case mjTRN_BODY:
      return {};
    default:
      return {{}, "it acts on a site or a crank"};
  }
  if (model.actuator_dyntype[actuator] == mjDYN_MUSCLE) return {{}, "it is a muscle"};
  const bool is_tendon = model.actuator_trntype[actuator] == mjTRN_TENDON;
  return {{.type = is_tendon ? mjOBJ_TENDON : mjOBJ_JOINT, .id = id}, ""};
}

std::vector<Drive> drives_of(const mjModel& model) {
  // An actuator may have any number of inputs, so `nu` is not the number of actuators.
  const int num_actuators = static_cast<int>(model.nactuator);
  std::vector<Drive> drives;
  drives.reserve(static_cast<std::size_t>(num_actuators));
  for (int i = 0; i < num_actuators; ++i) drives.push_back(drive_of(model, i));
  return drives;
}

// The names of all that a motor can drive.
std::vector<std::string> drivable_names(const mjModel& model) {
  std::vector<std::string> names;
  for (int i = 0; i < static_cast<int>(model.njnt); ++i) {
    if (is_scalar(model, i)) names.push_back(name_of(model, mjOBJ_JOINT, i));
  }
  for (int i = 0; i < static_cast<int>(model.ntendon); ++i) {
    if (is_fixed_tendon(model, i)) names.push_back(name_of(model, mjOBJ_TENDON, i));
  }
  return names;
}

// The joints and tendons of these names. `file` begins the text of an error.
std::vector<Target> named_targets(const mjModel& model, const std::vector<std::string>& names,
                                  const std::string& file) {
  std::vector<Target> targets;
  for (const std::string& name : names) {
    const int joint = mj_name2id(&model, mjOBJ_JOINT, name.c_str());
    const int tendon = mj_name2id(&model, mjOBJ_TENDON, name.c_str());
    const Target target = joint >= 0 ? Target{mjOBJ_JOINT, joint} : Target{mjOBJ_TENDON, tendon};
    const bool is_drivable =
        joint >= 0 ? is_scalar(model, joint) : tendon >= 0 && is_fixed_tendon(model, tendon);
    const std::vector<std::string> known = drivable_names(model);
    require(is_drivable,
            text_of(file, "no joint or fixed tendon '", name, "' can be driven; there are ",
                    known.empty() ? "none" : detail::joined(known)));
    require(std::ranges::find(targets, target) == targets.end(),
            text_of(file, "joint '", name, "' is named twice"));
    targets.push_back(target);
  }
  return targets;
}

// Marks the joints that follow another one, by an equality that holds from the beginning.
std::vector<bool> followers_of(const mjModel& model) {
  std::vector<bool> follows(static_cast<std::size_t>(model.njnt), false);
  for (int i = 0; i < static_cast<int>(model.neq); ++i) {
    if (model.eq_type[i] != mjEQ_JOINT || model.eq_obj2id[i] < 0 || !model.eq_active0[i]) continue;
    follows[static_cast<std::size_t>(model.eq_obj1id[i])] = true;
  }
  return follows;
}

// What the actuators drive; all hinges and slides that follow no other one if there are no
// actuators.
std::vector<Target> driven_targets(const mjModel& model, const std::vector<Drive>& drives,
                                   const std::string& file) {
  std::vector<Target> targets;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const auto& [target, problem] = drives[i];
    require(problem.empty(),
            text_of(file, "no motor can take the place of actuator '",
                    name_of(model, mjOBJ_ACTUATOR, static_cast<int>(i)), "', because ", problem,
                    "; name the joints to be driven (robot.joints), without it"));
    const bool is_new = std::ranges::find(targets, target) == targets.end();
    if (target.id >= 0 && is_new) targets.push_back(target);
  }
  if (!targets.empty()) return targets;
  const std::vector<bool> follows = followers_of(model);
  for (int joint = 0; joint < static_cast<int>(model.njnt); ++joint) {
    if (is_scalar(model, joint) && !follows[static_cast<std::size_t>(joint)])
      targets.push_back({.type = mjOBJ_JOINT, .id = joint});
  }
  return targets;
}

// The same limit in both directions; nothing for a range that is not symmetric, because the torque
// of a motor is limited in both directions.
std::optional<double> symmetric(const double* range) {
  const bool is_symmetric = range[1] > 0.0 && std::abs(range[0] + range[1]) <= 1e-9 * range[1];
  return is_symmetric ? std::optional(range[1]) : std::nullopt;
}

void take_smaller(std::optional<double>& value, std::optional<double> other) {
  if (other && (!value || *other < *value)) value = other;
}

// Replaces whatever computes the actuator's force: now its input is its force, at once and in full.
void make_motor(mjsActuator* actuator) {
  mjs_setToMotor(actuator);
  actuator->ctrlspec = 0;
  actuator->ctrllimited = mjLIMITED_FALSE;
  actuator->forcelimited = mjLIMITED_FALSE;
  actuator->actlimited = mjLIMITED_FALSE;
  actuator->inheritrange = 0.0;
  actuator->delay = 0.0;
  actuator->nsample = 0;
  actuator->interp = 0;
}

// The actuators in the order of the compiled model.
std::vector<mjsActuator*> actuators_of(mjSpec* spec, std::size_t count) {
  std::vector<mjsActuator*> actuators(count, nullptr);
  for (mjsElement* element = mjs_firstElement(spec, mjOBJ_ACTUATOR); element != nullptr;
       element = mjs_nextElement(spec, element)) {
    actuators[static_cast<std::size_t>(mjs_getId(element))] = mjs_asActuator(element);
  }
  return actuators;
}

// Makes the actuator's force the torque of its joint. Its rotor and friction stay what they are at
// the joint.
void act_without_gear(mjsActuator* actuator) {
  const double gear = actuator->gear[0];
  double factor = gear * gear;
  actuator->armature *= factor;
  for (double& damping : actuator->damping) {
    damping *= factor;
    factor *= std::abs(gear);
  }
  std::ranges::fill(actuator->gear, 0.0);
  actuator->gear[0] = 1.0;
}

// The largest torque that the file allows at a joint of the model, if it is one number.
std::optional<double> joint_limit(const mjModel& model, int joint) {
  if (!model.jnt_actfrclimited[joint]) return std::nullopt;
  return symmetric(model.jnt_actfrcrange + 2 * joint);
}

// Adds to `joint` what the actuator says about it.
void describe_actuator(const mjModel& model, int actuator, DrivenJoint& joint) {
  const double gear = model.actuator_gear[6 * model.actuator_outadr[actuator]];
  const double* const gain = model.actuator_gainprm + mjNGAIN * actuator;
  const double* const bias = model.actuator_biasprm + mjNBIAS * actuator;
  const bool has_fixed_gain = model.actuator_gaintype[actuator] == mjGAIN_FIXED;
  const auto at_joint = [gear](double value) { return std::abs(gear) * value; };
  if (model.actuator_forcelimited[actuator]) {
    if (const auto limit = symmetric(model.actuator_forcerange + 2 * actuator)) {
      take_smaller(joint.max_torque, at_joint(*limit));
    }
  }
  const bool is_motor = has_fixed_gain && model.actuator_biastype[actuator] == mjBIAS_NONE &&
                        model.actuator_dyntype[actuator] == mjDYN_NONE;
  const int input = model.actuator_ctrladr[actuator];
  if (is_motor && model.actuator_ctrlnum[actuator] == 1 && model.actuator_ctrllimited[input]) {
    if (const auto limit = symmetric(model.actuator_ctrlrange + 2 * input)) {
      take_smaller(joint.max_torque, at_joint(std::abs(gain[0]) * *limit));
    }
  }
  if (!has_fixed_gain || model.actuator_biastype[actuator] != mjBIAS_AFFINE) return;
  if (bias[1] < 0.0) joint.kp = -bias[1] * gear * gear;
  if (bias[2] < 0.0) joint.kd = -bias[2] * gear * gear;
  if (joint.kp && !joint.kd) joint.kd = 0.0;
}

// The first text, and how many more there are.
std::string summary_of(const std::vector<std::string>& texts) {
  const std::size_t others = texts.size() - 1;
  return texts.front() + (others > 0 ? text_of(", and so on for ", others, " more") : "");
}

// Adds to `joint` what MuJoCo does not read of a URDF.
void add_urdf(const detail::UrdfJoint& said, DrivenJoint& joint) {
  joint.max_velocity = said.max_velocity;
  joint.soft_range = said.soft_range;
  if (!joint.soft_range || !joint.range) return;
  auto& [lower, upper] = *joint.soft_range;
  lower = std::max(lower, (*joint.range)[0]);
  upper = std::min(upper, (*joint.range)[1]);
  if (!(lower < upper)) joint.soft_range.reset();
}

// Throws InvalidArgument for a name that no configuration can have as a key.
void require_usable_name(const std::string& name, const std::string& what) {
  const auto is_control = [](char letter) { return static_cast<unsigned char>(letter) < ' '; };
  require(
      std::ranges::none_of(name, is_control) && name.find_first_not_of(' ') != std::string::npos,
      text_of(what, " cannot be called '", name,
              "', which is empty or has more than one line; rename it"));
}

}  // namespace

void ModelFile::DeleteSpec::operator()(mjSpec_* spec) const noexcept { mj_deleteSpec(spec); }

ModelFile::ModelFile(ModelFileOptions options) : options_(std::move(options)) {
  const std::string file = options_.path.string();
  std::error_code ignored;
  require(std::filesystem::exists(options_.path, ignored), file + ": there is no such file");
  silence_mujoco();
  const detail::ForeignModel source(options_.path, options_.mesh_folder, options_.repair_inertia,
                                    options_.angle_in_radians);
  try {
    spec_.reset(source.parse().release());
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(file + ": MuJoCo cannot read it: " + error.what() +
                          "; correct it in the file");
  }
  std::vector<std::string> impossible =
      detail::find_impossible_inertias(spec_.get(), options_.repair_inertia);
  if (options_.repair_inertia) repairs_ = std::exchange(impossible, {});
  if (source.is_urdf()) detail::finish_urdf(spec_.get(), source, options_.collision);
  detail::add_objects(spec_.get(), options_.objects);
  // The motors must work, whatever the file says of its actuators.
  spec_->option.disableflags &= ~mjDSBL_ACTUATION;
  spec_->option.disableactuator = 0;
  // A scene that needs more memory than a file allows would end the process, and parts that sleep
  // would make a restored state go on otherwise.
  spec_->memory = spec_->nstack = -1;
  spec_->njmax = spec_->nconmax = -1;
  spec_->option.enableflags &= ~mjENBL_SLEEP;
  const auto compile = [&] {
    model_.reset(mj_compile(spec_.get(), source.files()));
    if (model_ != nullptr) {
      detail::leave_divergence_visible(*model_);
      return;
    }
    const std::string problem = source.explained(mjs_getError(spec_.get()));
    if (source.is_missing_file()) {
      throw InvalidArgument(file + ": MuJoCo refuses the model: " + problem +
                            "; say in which folder the meshes are (robot.mesh_folder, --meshes)");
    }
    if (!impossible.empty()) {
      throw InvalidArgument(
          text_of(file, ": ", summary_of(impossible), "; ", detail::kHowToRepair));
    }
    throw InvalidArgument(file + ": MuJoCo refuses the model: " + problem);
  };
  compile();
  const bool names_joints = name_elements(mjOBJ_JOINT, "joint");
  if (name_elements(mjOBJ_BODY, "body") || names_joints) compile();
  find_joints();
  for (DrivenJoint& joint : joints_) add_urdf(source.urdf_joint(joint.name), joint);
  add_motors();
  set_step();
  compile();
  for (Motor& motor : motors_) motor.ctrl = model_->actuator_ctrladr[motor.actuator];
  const std::string name = mjs_getString(spec_->modelname);
  // "MuJoCo Model" is what MuJoCo calls a model without a name.
  name_ = name.empty() || name == "MuJoCo Model" ? options_.path.stem().string() : name;
  find_objects();
  find_followers();
  find_start();
  if (exclude_overlaps(source.is_urdf())) compile();
  // They may refer to what lives no longer than this call.
  options_.armature = nullptr;
  options_.initial_position = nullptr;
}

ModelFile::ModelFile(ModelFile&&) noexcept = default;
ModelFile& ModelFile::operator=(ModelFile&&) noexcept = default;
ModelFile::~ModelFile() = default;

// Gives a name to each body, or to each hinge and slide, without one, because configurations,
// motors and exclusions find them by their names. Returns true if there were some.
bool ModelFile::name_elements(int type, const std::string& word) {
  bool is_renamed = false;
  for (mjsElement* element = mjs_firstElement(spec_.get(), static_cast<mjtObj>(type));
       element != nullptr; element = mjs_nextElement(spec_.get(), element)) {
    if (type == mjOBJ_JOINT && !is_scalar(mjs_asJoint(element)->type)) continue;
    if (*mjs_getString(mjs_getName(element)) != '\0') continue;
    const std::string name = word + std::to_string(mjs_getId(element));
    require(mjs_setName(element, name.c_str()) == 0,
            text_of(options_.path.string(), ": a ", word, " without a name would be called '", name,
                    "', as another one is; give it a name"));
    is_renamed = true;
  }
  return is_renamed;
}

// Finds out which joints are driven, and what the file says about them.
void ModelFile::find_joints() {
  const mjModel& model = *model_;
  const std::string file = options_.path.string() + ": ";
  for (int joint = 0; joint < static_cast<int>(model.njnt); ++joint) {
    if (!is_scalar(model, joint)) continue;
    const std::string body = name_of(model, mjOBJ_BODY, model.jnt_bodyid[joint]);
    require_usable_name(name_of(model, mjOBJ_JOINT, joint),
                        text_of(file, "a joint of body '", body, "'"));
    model_joints_.push_back({.name = name_of(model, mjOBJ_JOINT, joint),
                             .is_slide = model.jnt_type[joint] == mjJNT_SLIDE});
    model_parts_.push_back(
        {.position = model.jnt_qposadr[joint], .velocity = model.jnt_dofadr[joint], .share = 1.0});
  }
  require(!model_joints_.empty(), file + "the model has no hinge and no slide, so nothing moves");

  const std::vector<Drive> drives = drives_of(model);
  for (const auto& [type, id] : options_.joints.empty()
                                    ? driven_targets(model, drives, file)
                                    : named_targets(model, options_.joints, file)) {
    DrivenJoint joint;
    Motor motor;
    joint.name = name_of(model, type, id);
    if (type == mjOBJ_JOINT) {
      describe_joint(id, joint, motor);
    } else {
      describe_tendon(id, joint, motor);
    }
    for (std::size_t i = 0; i < drives.size(); ++i) {
      if (!drives[i].problem.empty() || drives[i].target != Target{type, id}) continue;
      const int actuator = static_cast<int>(i);
      if (motor.actuator < 0) motor.actuator = actuator;
      describe_actuator(model, actuator, joint);
    }
    joints_.push_back(std::move(joint));
    motors_.push_back(std::move(motor));
  }
  require(!joints_.empty(), file +
                                "each joint follows another one, so none can be driven; name "
                                "the joints to be driven (robot.joints)");
  drives_all_ = motors_.size() == model_parts_.size();
  for (std::size_t i = 0; drives_all_ && i < motors_.size(); ++i) {
    drives_all_ = joints_[i].name == model_joints_[i].name;
  }
}

// Adds to `joint` and `motor` what the model says about a joint.
void ModelFile::describe_joint(int id, DrivenJoint& joint, Motor& motor) const {
  const mjModel& model = *model_;
  joint.is_slide = model.jnt_type[id] == mjJNT_SLIDE;
  if (model.jnt_limited[id]) joint.range = {model.jnt_range[2 * id], model.jnt_range[2 * id + 1]};
  joint.max_torque = joint_limit(model, id);
  motor.parts.push_back(
      {.position = model.jnt_qposadr[id], .velocity = model.jnt_dofadr[id], .share = 1.0});
}

// Adds to `joint` and `motor` what the model says about a fixed tendon.
void ModelFile::describe_tendon(int id, DrivenJoint& joint, Motor& motor) const {
  const mjModel& model = *model_;
  require_usable_name(joint.name, options_.path.string() + ": a driven tendon");
  require(std::ranges::find(model_joints_, joint.name, &ModelJoint::name) == model_joints_.end(),
          text_of(options_.path.string(), ": tendon '", joint.name,
                  "' has the name of a joint; rename one of them"));
  if (model.tendon_limited[id]) {
    joint.range = {model.tendon_range[2 * id], model.tendon_range[2 * id + 1]};
  }
  if (model.tendon_actfrclimited[id]) {
    joint.max_torque = symmetric(model.tendon_actfrcrange + 2 * id);
  }
  motor.sum_of_squares = 0.0;
  bool has_hinge = false;
  for (int i = 0; i < model.tendon_num[id]; ++i) {
    const int wrap = model.tendon_adr[id] + i;
    const int coupled = model.wrap_objid[wrap];
    const double share = model.wrap_prm[wrap];
    const auto limit = joint_limit(model, coupled);
    if (limit && share != 0.0) take_smaller(joint.max_torque, *limit / std::abs(share));
    has_hinge = has_hinge || model.jnt_type[coupled] == mjJNT_HINGE;
    motor.parts.push_back({.position = model.jnt_qposadr[coupled],
                           .velocity = model.jnt_dofadr[coupled],
                           .share = share});
    motor.sum_of_squares += share * share;
  }
  joint.is_slide = !has_hinge;
  require(motor.sum_of_squares > 0.0, text_of(options_.path.string(), ": tendon '", joint.name,
                                              "' moves no joint, so it cannot be driven"));
}

// Replaces the actuators: one motor for each driven joint, and nothing else. From here on only the
// safety chain limits their torque.
void ModelFile::add_motors() {
  std::vector<std::string> with_rotor;
  for (mjsElement* element = mjs_firstElement(spec_.get(), mjOBJ_JOINT); element != nullptr;
       element = mjs_nextElement(spec_.get(), element)) {
    mjsJoint* const joint = mjs_asJoint(element);
    joint->actfrclimited = mjLIMITED_FALSE;
    if (!is_scalar(joint->type) || !options_.armature) continue;
    const std::string name = mjs_getString(mjs_getName(element));
    if (const auto armature = options_.armature(name)) {
      joint->armature = *armature;
      with_rotor.push_back(name);
    }
  }
  for (mjsElement* element = mjs_firstElement(spec_.get(), mjOBJ_TENDON); element != nullptr;
       element = mjs_nextElement(spec_.get(), element)) {
    mjs_asTendon(element)->actfrclimited = mjLIMITED_FALSE;
  }
  const std::vector<mjsActuator*> actuators =
      actuators_of(spec_.get(), static_cast<std::size_t>(model_->nactuator));
  for (std::size_t i = 0; i < actuators.size(); ++i) {
    make_motor(actuators[i]);
    const bool is_at_joint =
        actuators[i]->trntype == mjTRN_JOINT || actuators[i]->trntype == mjTRN_JOINTINPARENT;
    if (is_at_joint &&
        std::ranges::find(with_rotor, mjs_getString(actuators[i]->target)) != with_rotor.end()) {
      actuators[i]->armature = 0.0;
    }
    const bool is_used =
        std::ranges::find(motors_, static_cast<int>(i), &Motor::actuator) != motors_.end();
    if (is_used) {
      act_without_gear(actuators[i]);
    } else {
      actuators[i]->gainprm[0] = 0.0;
    }
  }
  int next = static_cast<int>(actuators.size());
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    if (motors_[i].actuator >= 0) continue;
    motors_[i].actuator = next++;
    mjsActuator* const actuator = mjs_addActuator(spec_.get(), nullptr);
    make_motor(actuator);
    // A new actuator begins with the defaults of the file.
    actuator->armature = 0.0;
    std::ranges::fill(actuator->damping, 0.0);
    act_without_gear(actuator);
    const bool is_joint =
        std::ranges::find(model_joints_, joints_[i].name, &ModelJoint::name) != model_joints_.end();
    actuator->trntype = is_joint ? mjTRN_JOINT : mjTRN_TENDON;
    mjs_setString(actuator->target, joints_[i].name.c_str());
  }
  // Inputs and activations of the file's actuators mean nothing to the motors.
  for (mjsElement* element = mjs_firstElement(spec_.get(), mjOBJ_KEY); element != nullptr;
       element = mjs_nextElement(spec_.get(), element)) {
    mjsKey* const key = mjs_asKey(element);
    mjs_setDouble(key->ctrl, nullptr, 0);
    mjs_setDouble(key->act, nullptr, 0);
  }
}

void ModelFile::set_step() {
  const double longest = model_->opt.timestep;
  require(longest >= 1e-6 && longest <= 1.0,
          text_of(options_.path.string(), ": its timestep is ", longest, " s, must be 1e-6 to 1"));
  period_ = options_.period.value_or(
      std::chrono::round<Nanoseconds>(std::chrono::duration<double>(longest)));
  const double period = std::chrono::duration<double>(period_).count();
  // A quotient that is a whole number but for rounding is this number.
  constexpr double kRounding = 1e-6;
  substeps_ = std::max(1, static_cast<int>(std::ceil(period / longest - kRounding)));
  spec_->option.timestep = period / substeps_;
}

// Finds the bodies that float freely.
void ModelFile::find_objects() {
  for (int joint = 0; joint < static_cast<int>(model_->njnt); ++joint) {
    if (model_->jnt_type[joint] != mjJNT_FREE) continue;
    const int body = model_->jnt_bodyid[joint];
    std::string body_name = name_of(*model_, mjOBJ_BODY, body);
    // Names of fields begin with it.
    std::ranges::replace_if(
        body_name, [](char letter) { return letter == ' ' || letter == '\n'; }, '_');
    objects_.push_back({.name = std::move(body_name),
                        .body = body,
                        .position = model_->jnt_qposadr[joint],
                        .velocity = model_->jnt_dofadr[joint]});
  }
}

// Finds out where sessions begin.
void ModelFile::find_start() {
  key_ = model_->nkey > 0 ? 0 : -1;
  if (options_.keyframe) {
    key_ = mj_name2id(model_.get(), mjOBJ_KEY, options_.keyframe->c_str());
    require(key_ >= 0, "the model has no key frame '" + *options_.keyframe + "'");
  }
  if (!options_.initial_position) return;
  const auto begin_at = [this](const ModelJoint& joint, std::size_t index, auto& positions) {
    const auto position = options_.initial_position(joint);
    if (!position) return;
    require(std::isfinite(*position),
            "the initial position of joint '" + joint.name + "' is not finite");
    positions.emplace_back(index, *position);
  };
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    begin_at({.name = joints_[i].name, .is_slide = joints_[i].is_slide}, i, initial_position_);
  }
  for (std::size_t i = 0; i < model_joints_.size(); ++i) {
    const bool is_driven =
        std::ranges::find(joints_, model_joints_[i].name, &DrivenJoint::name) != joints_.end();
    if (!is_driven) begin_at(model_joints_[i], i, initial_model_position_);
  }
}

// Lets parts of the robot pass through each other. MuJoCo itself keeps a base that is fixed apart
// from what turns on it: many have a mesh around their first joint, and would throw it. Of a URDF,
// these are all parts with a joint between them, and all that overlap where sessions begin. The
// author of an MJCF has said what touches, so there it is a base and what turns on it that overlap;
// if that is asked for, all parts in a tree of bodies that do. Returns true if there are some.
bool ModelFile::exclude_overlaps(bool is_urdf) {
  const mjModel& model = *model_;
  const auto is_base_of = [&model](int parent, int body) {
    return model.body_parentid[body] == parent && model.body_weldid[parent] == 0 &&
           model.body_jntnum[body] > 0;
  };
  std::set<std::pair<int, int>> pairs;
  for (int body = 1; is_urdf && body < static_cast<int>(model.nbody); ++body) {
    const int parent = model.body_parentid[body];
    if (is_base_of(parent, body)) pairs.emplace(parent, body);
  }
  const Data data = make_data();
  reset(*data);
  mj_fwdPosition(&model, data.get());
  for (int i = 0; i < data->ncon; ++i) {
    const mjContact& contact = data->contact[i];
    if (contact.dist >= 0.0 || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
    const auto [first, second] =
        std::minmax(model.geom_bodyid[contact.geom[0]], model.geom_bodyid[contact.geom[1]]);
    const bool is_part =
        is_base_of(first, second) ||
        (options_.exclude_overlaps && model.body_rootid[first] == model.body_rootid[second]);
    if (is_urdf || (is_part && first != 0)) pairs.emplace(first, second);
  }
  const auto is_object = [this](int body) {
    return std::ranges::find(objects_, body, &ObjectAddress::body) != objects_.end();
  };
  bool excludes = false;
  for (const auto& [first, second] : pairs) {
    if (is_object(first) || is_object(second)) continue;
    mjsExclude* const exclude = mjs_addExclude(spec_.get());
    mjs_setString(exclude->bodyname1, name_of(model, mjOBJ_BODY, first).c_str());
    mjs_setString(exclude->bodyname2, name_of(model, mjOBJ_BODY, second).c_str());
    excludes = true;
  }
  return excludes;
}

void ModelFile::reset(mjData_& data) const noexcept {
  if (key_ >= 0) {
    mj_resetDataKeyframe(model_.get(), &data, key_);
  } else {
    mj_resetData(model_.get(), &data);
  }
  for (const ObjectDescription& object : options_.objects) {
    const auto body = std::ranges::find(objects_, object.name, &ObjectAddress::name);
    set_velocity(*body, object.velocity, object.angular_velocity, data);
  }
  for (const auto& [joint, position] : initial_model_position_) {
    set_model_position(joint, position, data);
  }
  for (const auto& [joint, position] : initial_position_) set_position(joint, position, data);
}

std::string ModelFile::mjcf() const { return detail::self_contained_mjcf(*spec_, *model_); }

}  // namespace trifinger
