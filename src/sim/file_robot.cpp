// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/file_robot.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <mutex>

#include "file_robot_parts.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;

// Every saved state begins with this number, so that states of other versions are recognised.
constexpr std::uint64_t kStateMagic = 0x314c494653465254;  // "TRFSFIL1"

struct Header {
  std::uint64_t magic{kStateMagic};
  std::uint64_t model{0};
};

// Components from which MuJoCo continues bit for bit.
constexpr int kWholeState = mjSTATE_INTEGRATION;
// Components that a step changes.
constexpr int kChangedByStep = mjSTATE_FULLPHYSICS | mjSTATE_WARMSTART | mjSTATE_CTRL;

std::size_t state_size_of(const ModelFile& model, int components) {
  return static_cast<std::size_t>(mj_stateSize(model.mujoco(), components));
}

// Returns a hash (FNV-1a) of the model.
std::uint64_t fingerprint_of(const mjModel& model) {
  std::vector<std::byte> bytes(static_cast<std::size_t>(mj_sizeModel(&model)));
  mj_saveModel(&model, nullptr, bytes.data(), static_cast<int>(bytes.size()));
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const std::byte byte : bytes) {
    hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3;
  }
  return hash;
}

std::string_view unit_of(const FileJoint& joint) { return joint.is_slide ? " m" : " rad"; }

// Letters, digits and '_', for names of types.
std::string plain_name(const std::string& name) {
  std::string plain;
  for (const char letter : name) {
    const bool is_plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                          (letter >= '0' && letter <= '9') || letter == '_';
    plain += is_plain ? letter : '_';
  }
  // Programs know robots of these types.
  const bool is_taken = plain == TriFinger::kType || plain == Finger::kType || plain.empty();
  return is_taken ? plain + "_file" : plain;
}

std::vector<std::string> names_of(const ModelFile& model) {
  std::vector<std::string> names;
  names.reserve(model.joints().size());
  for (const FileJoint& joint : model.joints()) names.push_back(joint.name);
  return names;
}

template <class Joints>
std::vector<JointKind> kinds_of(const Joints& joints) {
  std::vector<JointKind> kinds;
  kinds.reserve(joints.size());
  for (const auto& joint : joints) {
    kinds.push_back(joint.is_slide ? JointKind::kSlide : JointKind::kHinge);
  }
  return kinds;
}

}  // namespace

namespace detail {

void silence_warnings() {
  static std::once_flag once;
  std::call_once(once, [] { mju_user_warning = [](const char*) {}; });
}

bool is_finite(const mjModel& model, const mjData& data) noexcept {
  const auto all_finite = [](const double* values, auto count) {
    return std::none_of(values, values + count, [](double value) { return mju_isBad(value) != 0; });
  };
  return all_finite(data.qpos, model.nq) && all_finite(data.qvel, model.nv) &&
         data.warning[mjWARN_BADQACC].number == 0;
}

void compute_weight(const ModelFile& model, mjData& data, std::span<double> torque) noexcept {
  const mjModel& mujoco = *model.mujoco();
  mj_kinematics(&mujoco, &data);
  mj_comPos(&mujoco, &data);
  mj_tendon(&mujoco, &data);
  mj_comVel(&mujoco, &data);
  mj_passive(&mujoco, &data);
  // qfrc_inverse only serves as memory of the right size: no step reads it.
  mj_rne(&mujoco, &data, 0, data.qfrc_inverse);
  mju_subFrom(data.qfrc_inverse, data.qfrc_spring, static_cast<int>(mujoco.nv));
  mju_subFrom(data.qfrc_inverse, data.qfrc_gravcomp, static_cast<int>(mujoco.nv));
  for (std::size_t i = 0; i < torque.size(); ++i) {
    torque[i] = model.torque_of(i, data.qfrc_inverse);
  }
}

}  // namespace detail

RobotTypes robot_types_of(const ModelFile& model) {
  std::vector<FieldDescription> more;
  if (!model.drives_all()) {
    const std::vector<JointKind> kinds = kinds_of(model.model_joints());
    const bool has_slide = std::ranges::find(kinds, JointKind::kSlide) != kinds.end();
    const bool has_hinge = std::ranges::find(kinds, JointKind::kHinge) != kinds.end();
    const std::string length = !has_slide ? "rad" : !has_hinge ? "m" : "rad or m";
    const std::string rate = !has_slide ? "rad/s" : !has_hinge ? "m/s" : "rad/s or m/s";
    const auto add = [&](const char* name, const std::string& unit) {
      more.push_back({.name = name,
                      .type = ScalarType::kFloat64,
                      .shape = {kinds.size()},
                      .unit = unit,
                      .offset = 0});
    };
    add("joint_position", length);
    add("joint_velocity", rate);
  }
  return describe_counted(plain_name(model.name()), kinds_of(model.joints()), more);
}

std::vector<NamedJoint> joints_of(const ModelFile& model) {
  std::vector<NamedJoint> joints;
  for (const FileJoint& joint : model.joints()) {
    JointLimit known;
    known.max_torque = joint.max_torque.value_or(kNotGiven);
    known.default_kp = joint.kp.value_or(kNotGiven);
    known.default_kd = joint.kd.value_or(kNotGiven);
    // A joint without stops may be anywhere.
    known.hard_lower = joint.range ? (*joint.range)[0] : -kLargestJointLimit;
    known.hard_upper = joint.range ? (*joint.range)[1] : kLargestJointLimit;
    joints.push_back({.name = joint.name,
                      .kind = joint.is_slide ? JointKind::kSlide : JointKind::kHinge,
                      .known = known});
  }
  return joints;
}

void FileRobotOptions::validate() const {
  require(model != nullptr, "a robot from a file has no model");
  require(limits.size() == model->joints().size(),
          text_of("there are limits for ", limits.size(), " joints, but the model has ",
                  model->joints().size()));
  trifinger::validate(limits);
  require(object_period >= 1, text_of("object_period is ", object_period, ", must be at least 1"));
}

void FileRobotOptions::put_at_start(mjData& data) const noexcept {
  const mjModel& mujoco = *model->mujoco();
  const int key =
      keyframe ? mj_name2id(&mujoco, mjOBJ_KEY, keyframe->c_str()) : (mujoco.nkey > 0 ? 0 : -1);
  if (key >= 0) {
    mj_resetDataKeyframe(&mujoco, &data, key);
  } else {
    mj_resetData(&mujoco, &data);
  }
  for (const auto& [name, position] : initial_position) {
    const auto driven = std::ranges::find(model->joints(), name, &FileJoint::name);
    if (driven != model->joints().end()) {
      const auto index = static_cast<std::size_t>(driven - model->joints().begin());
      model->set_position(index, position, data);
      continue;
    }
    const auto any = std::ranges::find(model->model_joints(), name, &ModelJoint::name);
    if (any == model->model_joints().end()) continue;
    model->set_model_position(static_cast<std::size_t>(any - model->model_joints().begin()),
                              position, data);
  }
}

std::vector<Document> model_documents(const ModelFile& model) {
  return {{"model.xml", "application/xml", model.mjcf()}};
}

FileRobot::FileRobot(Options options)
    : options_((options.validate(), std::move(options))),
      chain_(robot_types_of(model()), names_of(model()), options_.limits),
      fingerprint_(fingerprint_of(*model().mujoco())),
      data_(model().make_data()),
      observation_(num_joints()),
      torque_(num_joints(), 0.0),
      objects_at_observation_(model().free_bodies().size()),
      held_(num_joints()),
      desired_(num_joints()),
      sent_objects_(model().free_bodies().size()),
      before_step_(state_size_of(model(), kChangedByStep)),
      memory_before_step_(num_joints()),
      torque_before_step_(num_joints(), 0.0),
      after_step_(before_step_.size()),
      physics_(state_size_of(model(), kWholeState)) {
  detail::silence_warnings();
  std::vector<std::string> names;
  for (const ObjectAddress& object : model().free_bodies()) names.push_back(object.name);
  if (auto objects = object_companion(names)) companions_.push_back(std::move(*objects));
  begin_state_.resize(state_size());
  spare_state_.resize(state_size());
  if (options_.keyframe) {
    const int key = mj_name2id(model().mujoco(), mjOBJ_KEY, options_.keyframe->c_str());
    require(key >= 0, "the model has no key frame '" + *options_.keyframe + "'");
  }
  for (const auto& [name, position] : options_.initial_position) {
    const auto driven = std::ranges::find(model().joints(), name, &FileJoint::name);
    const auto any = std::ranges::find(model().model_joints(), name, &ModelJoint::name);
    require(driven != model().joints().end() || any != model().model_joints().end(),
            "the model has no joint '" + name + "', for which there is an initial position");
    require(std::isfinite(position), "the initial position of joint '" + name + "' is not finite");
  }
  options_.put_at_start(*data_);
  for (std::size_t i = 0; i < num_joints(); ++i) {
    initial_position_.push_back(model().position(i, *data_));
  }
  std::string beyond;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = options_.limits[i];
    if (initial_position_[i] >= limit.soft_lower && initial_position_[i] <= limit.soft_upper)
      continue;
    beyond += (beyond.empty() ? "" : "; ") + text_of(model().joints()[i].name, " begins at ",
                                                     initial_position_[i], ", its soft limits are ",
                                                     limit.soft_lower, " and ", limit.soft_upper);
  }
  require(beyond.empty(),
          "some joints begin beyond their soft limits: give them an initial position "
          "within (robot.initial_position). " +
              beyond);
  reset();
}

FileRobot::~FileRobot() = default;

DriverReport FileRobot::prepare(TimeIndex) noexcept {
  read_state(begin_state_);
  next_poses_ = -1;
  return DriverReport::ready();
}

DriverReport FileRobot::get_latest_observation(void* observation) noexcept {
  observe();
  write_observation(observation);
  return DriverReport::ready();
}

DriverReport FileRobot::apply_action(const void* desired, void* applied) noexcept {
  keep_state_before_step();
  read_element(desired, desired_);
  const DriverReport report = chain_.apply(desired_, observation_, model().period());
  write_element(chain_.applied(), applied);
  if (report.state != DriverReport::State::kReady) return report;
  for (std::size_t i = 0; i < num_joints(); ++i) {
    torque_[i] = chain_.applied().torque[i];
    model().set_torque(i, torque_[i], *data_);
  }
  for (int i = 0; i < model().substeps(); ++i) mj_step(model().mujoco(), data_.get());
  if (!detail::is_finite(*model().mujoco(), *data_)) {
    chain_.set_fault_text(FixedText("the simulation diverged"));
    keep_state_before_divergence();
    return DriverReport::fault(kDiverged);
  }
  return report;
}

DriverReport FileRobot::hold(const void* observation, void* action) noexcept {
  read_element(observation, held_);
  desired_ = CountedAction(num_joints());
  desired_.position = held_.position;
  // Without these torques the robot would sink until its position controllers carry its weight.
  detail::compute_weight(model(), *data_, {desired_.torque.begin(), num_joints()});
  write_element(desired_, action);
  return DriverReport::ready();
}

DriverReport FileRobot::stop(TimeIndex) noexcept { return DriverReport::ready(); }

bool FileRobot::get_companion_element(std::size_t, TimeIndex time_index, void* element) noexcept {
  if (time_index < next_poses_) return false;
  // The first poses are those before step 0; the others count from there.
  next_poses_ = time_index < 0 ? 0 : time_index + options_.object_period;
  for (std::size_t i = 0; i < sent_objects_.size(); ++i) {
    sent_objects_[i] = pose_of(model().free_bodies()[i]);
  }
  write_objects({.arrival_index = time_index, .capture_index = time_index}, sent_objects_,
                static_cast<std::byte*>(element));
  return true;
}

std::string_view FileRobot::fault_text(std::int32_t) const noexcept { return chain_.fault_text(); }

std::string_view FileRobot::rejection_text() const noexcept { return chain_.rejection_text(); }

void FileRobot::add_check(Check check) {
  chain_.add_check(std::move(check), [this](void* element) { write_observation(element); });
}

void FileRobot::reset() {
  options_.put_at_start(*data_);
  forget();
}

void FileRobot::reset(std::span<const double> position) {
  require(position.size() == num_joints(),
          text_of("position has ", position.size(), " numbers, must have ", num_joints()));
  for (std::size_t i = 0; i < num_joints(); ++i) {
    const JointLimit& limit = options_.limits[i];
    require(position[i] >= limit.hard_lower && position[i] <= limit.hard_upper,
            text_of("joint ", i, " (", model().joints()[i].name, ") cannot begin at ", position[i],
                    unit_of(model().joints()[i]), ", its hard limits are ", limit.hard_lower,
                    " and ", limit.hard_upper));
  }
  options_.put_at_start(*data_);
  for (std::size_t i = 0; i < num_joints(); ++i) model().set_position(i, position[i], *data_);
  forget();
}

// After a reset, nothing of what happened before counts.
void FileRobot::forget() noexcept {
  chain_.forget();
  torque_ = PerJoint<double>(num_joints(), 0.0);
  begin_here();
}

const ObjectAddress& FileRobot::object(const std::string& name) const {
  const auto& objects = model().free_bodies();
  const auto found = std::ranges::find(objects, name, &ObjectAddress::name);
  if (found != objects.end()) return *found;
  std::string known;
  for (const ObjectAddress& other : objects) known += (known.empty() ? "" : ", ") + other.name;
  throw InvalidArgument("There is no object '" + name + "'; " +
                        (known.empty() ? "the scene has none." : "the scene has " + known + "."));
}

ObjectPose FileRobot::pose_of(const ObjectAddress& object) const noexcept {
  ObjectPose pose;
  const double* const values = data_->qpos + object.position;
  std::copy_n(values, pose.position.size(), pose.position.begin());
  std::copy_n(values + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
}

void FileRobot::place_object(const std::string& name, const ObjectPose& pose) {
  const ObjectAddress& address = object(name);
  double square = 0.0;
  for (const double value : pose.orientation) square += value * value;
  constexpr double kSmallestSquare = 1e-12;
  bool is_pose = std::isfinite(square) && square > kSmallestSquare;
  for (const double value : pose.position) is_pose = is_pose && std::isfinite(value);
  require(is_pose, "object '" + name +
                       "' cannot be placed: its pose is not finite, or its quaternion is zero");
  double* const values = data_->qpos + address.position;
  std::ranges::copy(pose.position, values);
  const double norm = std::sqrt(square);
  std::ranges::transform(pose.orientation, values + pose.position.size(),
                         [norm](double value) { return value / norm; });
  std::fill_n(data_->qvel + address.velocity, 6, 0.0);
  begin_here();
}

void FileRobot::push_object(const std::string& name, const std::array<double, 3>& force) {
  const ObjectAddress& address = object(name);
  for (const double value : force) {
    require(std::isfinite(value), "the force on object '" + name + "' is not finite");
  }
  constexpr std::ptrdiff_t kWrench = 6;  // The force, then the moment.
  std::ranges::copy(force, data_->xfrc_applied + kWrench * address.body);
}

void FileRobot::set_object_velocity(const std::string& name, const ObjectVelocity& velocity) {
  const ObjectAddress& address = object(name);
  for (const auto& part : {velocity.linear, velocity.angular}) {
    for (const double value : part) {
      require(std::isfinite(value), "the velocity of object '" + name + "' is not finite");
    }
  }
  double* const values = data_->qvel + address.velocity;
  std::ranges::copy(velocity.linear, values);
  // MuJoCo expresses the rotation of a free body in the body's frame.
  std::array<double, 4> inverse{};
  mju_negQuat(inverse.data(), data_->qpos + address.position + 3);
  mju_rotVecQuat(values + 3, velocity.angular.data(), inverse.data());
  begin_here();
}

ObjectPose FileRobot::object_pose(const std::string& name) const { return pose_of(object(name)); }

ObjectPose FileRobot::observed_object_pose(const std::string& name) const {
  const ObjectAddress* const first = model().free_bodies().data();
  return objects_at_observation_[static_cast<std::size_t>(&object(name) - first)];
}

ObjectVelocity FileRobot::object_velocity(const std::string& name) const {
  const ObjectAddress& address = object(name);
  const double* const values = data_->qvel + address.velocity;
  ObjectVelocity velocity;
  std::copy_n(values, velocity.linear.size(), velocity.linear.begin());
  mju_rotVecQuat(velocity.angular.data(), values + 3, data_->qpos + address.position + 3);
  return velocity;
}

SimulationState FileRobot::save() const {
  SimulationState state(state_size());
  write_state(state);
  return state;
}

void FileRobot::restore(std::span<const std::byte> state) {
  Header header{.magic = 0};
  if (state.size() >= sizeof(header)) std::memcpy(&header, state.data(), sizeof(header));
  require(header.magic == kStateMagic,
          "this is not the saved state of a robot from a file, or one of another version");
  require(header.model == fingerprint_ && state.size() == state_size(),
          "this state was saved from another model");
  read_state(state);
  begin_here();
}

std::vector<double> FileRobot::configuration() const {
  const mjModel& mujoco = *model().mujoco();
  std::vector<double> values(data_->qpos, data_->qpos + mujoco.nq);
  values.insert(values.end(), data_->qvel, data_->qvel + mujoco.nv);
  return values;
}

void FileRobot::observe() noexcept {
  for (std::size_t i = 0; i < num_joints(); ++i) {
    observation_.position[i] = model().position(i, *data_);
    observation_.velocity[i] = model().velocity(i, *data_);
    observation_.torque[i] = torque_[i];
  }
  for (std::size_t i = 0; i < objects_at_observation_.size(); ++i) {
    objects_at_observation_[i] = pose_of(model().free_bodies()[i]);
  }
}

void FileRobot::write_observation(void* element) const noexcept {
  write_element(observation_, element);
  if (model().drives_all()) return;
  auto* next = static_cast<std::byte*>(element) + 3 * num_joints() * sizeof(double);
  const auto write = [&next](double value) {
    std::memcpy(next, &value, sizeof(value));
    next += sizeof(value);
  };
  const std::size_t count = model().model_joints().size();
  for (std::size_t i = 0; i < count; ++i) write(model().model_position(i, *data_));
  for (std::size_t i = 0; i < count; ++i) write(model().model_velocity(i, *data_));
}

// Call this after the owner has moved the robot: the next session begins here. In a session that
// continues, the next action must not be judged by an observation from before.
void FileRobot::begin_here() noexcept {
  observe();
  write_state(begin_state_);
}

std::size_t FileRobot::state_size() const noexcept {
  return sizeof(Header) + std::span(physics_).size_bytes() +
         num_joints() * (sizeof(double) + sizeof(JointMemory));
}

void FileRobot::write_state(std::span<std::byte> state) const noexcept {
  mj_getState(model().mujoco(), data_.get(), physics_.data(), kWholeState);
  write_state(state, torque_, chain_.memory());
}

// Writes `physics_` and the rest.
void FileRobot::write_state(std::span<std::byte> state, const PerJoint<double>& torque,
                            std::span<const JointMemory> memory) const noexcept {
  std::byte* target = state.data();
  const auto write = [&target](const void* source, std::size_t size) {
    std::memcpy(target, source, size);
    target += size;
  };
  const Header header{.model = fingerprint_};
  write(&header, sizeof(header));
  write(physics_.data(), std::span(physics_).size_bytes());
  write(torque.begin(), num_joints() * sizeof(double));
  write(memory.data(), memory.size_bytes());
}

void FileRobot::read_state(std::span<const std::byte> state) noexcept {
  const std::byte* source = state.data() + sizeof(Header);
  const auto read = [&source](void* target, std::size_t size) {
    std::memcpy(target, source, size);
    source += size;
  };
  read(physics_.data(), std::span(physics_).size_bytes());
  mj_setState(model().mujoco(), data_.get(), physics_.data(), kWholeState);
  data_->warning[mjWARN_BADQACC].number = 0;
  read(torque_.begin(), num_joints() * sizeof(double));
  read(chain_.memory().data(), num_joints() * sizeof(JointMemory));
}

void FileRobot::keep_state_before_step() noexcept {
  mj_getState(model().mujoco(), data_.get(), before_step_.data(), kChangedByStep);
  std::ranges::copy(chain_.memory(), memory_before_step_.begin());
  torque_before_step_ = torque_;
}

void FileRobot::keep_state_before_divergence() noexcept {
  // The loop calls this, so it must not allocate.
  if (state_before_divergence_.empty()) state_before_divergence_.swap(spare_state_);
  const mjModel* const mujoco = model().mujoco();
  mj_getState(mujoco, data_.get(), after_step_.data(), kChangedByStep);
  mj_setState(mujoco, data_.get(), before_step_.data(), kChangedByStep);
  mj_getState(mujoco, data_.get(), physics_.data(), kWholeState);
  mj_setState(mujoco, data_.get(), after_step_.data(), kChangedByStep);
  write_state(state_before_divergence_, torque_before_step_, memory_before_step_);
}

}  // namespace trifinger
