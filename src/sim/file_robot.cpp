// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/file_robot.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "file_robot_parts.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"

namespace trifinger {
namespace {

using detail::require;
using detail::text_of;

// Every saved state begins with this number, so that states of other versions are recognised.
constexpr std::uint64_t kFileStateMagic = 0x324c494653465254;  // "TRFSFIL2"

struct FileStateHeader {
  std::uint64_t magic{kFileStateMagic};
  std::uint64_t model{0};
};

// Components from which MuJoCo continues bit for bit.
constexpr int kWholeFileState = mjSTATE_INTEGRATION;
// Components that a step changes.
constexpr int kChangedByFileStep = mjSTATE_FULLPHYSICS | mjSTATE_WARMSTART | mjSTATE_CTRL;

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

std::vector<Document> model_documents(const ModelFile& model) {
  return {{"model.xml", "application/xml", model.mjcf()}};
}

FileRobot::FileRobot(Options options)
    : simulator_(std::move(options)),
      chain_(robot_types_of(model()), names_of(model()), this->options().limits),
      fingerprint_(fingerprint_of(*model().mujoco())),
      data_(model().make_data()),
      state_(simulator_.make_state()),
      held_(num_joints()),
      desired_(num_joints()),
      before_step_(state_size_of(model(), kChangedByFileStep)),
      memory_before_step_(state_.memory),
      safety_before_step_(num_joints()),
      after_step_(before_step_.size()),
      physics_(state_size_of(model(), kWholeFileState)) {
  std::vector<std::string> names;
  for (const ObjectAddress& object : model().free_bodies()) names.push_back(object.name);
  if (auto objects = object_companion(names)) companions_.push_back(std::move(*objects));
  begin_state_.resize(state_size());
  spare_state_.resize(state_size());
  reset();
}

FileRobot::~FileRobot() = default;

DriverReport FileRobot::prepare(TimeIndex) noexcept {
  read_state(begin_state_);
  simulator_.begin(state_);
  return DriverReport::ready();
}

DriverReport FileRobot::get_latest_observation(void* observation) noexcept {
  simulator_.observe(*data_, state_);
  write_observation(observation);
  return DriverReport::ready();
}

DriverReport FileRobot::apply_action(const void* desired, void* applied) noexcept {
  keep_state_before_step();
  read_element(desired, desired_);
  const DriverReport report = chain_.apply(desired_, state_.observation, model().period());
  write_element(chain_.applied(), applied);
  if (report.state != DriverReport::State::kReady) return report;
  if (!simulator_.move(chain_.applied().torque, mujoco(), *data_, state_)) {
    chain_.set_fault_text(FixedText("the simulation diverged"));
    keep_state_before_divergence();
    return DriverReport::fault(kDiverged);
  }
  return report;
}

DriverReport FileRobot::hold(const void* observation, void* action) noexcept {
  read_element(observation, held_);
  desired_ = hold_position(held_);
  // Without these torques the robot would sink until its position controllers carry its weight.
  detail::compute_weight(model(), *data_, {desired_.torque.begin(), num_joints()});
  write_element(desired_, action);
  return DriverReport::ready();
}

DriverReport FileRobot::stop(TimeIndex) noexcept { return DriverReport::ready(); }

bool FileRobot::get_companion_element(std::size_t, TimeIndex time_index, void* element) noexcept {
  const auto* const received = simulator_.receive_poses(time_index, *data_, state_);
  if (received == nullptr) return false;
  write_objects({.arrival_index = time_index, .capture_index = received->capture_index},
                received->objects, static_cast<std::byte*>(element));
  return true;
}

std::string_view FileRobot::fault_text(std::int32_t) const noexcept { return chain_.fault_text(); }

std::string_view FileRobot::rejection_text() const noexcept { return chain_.rejection_text(); }

void FileRobot::add_check(Check check) {
  chain_.add_check(std::move(check), [this](void* element) { write_observation(element); });
}

const mjModel_& FileRobot::mujoco() const noexcept {
  return varied_ != nullptr ? *varied_ : *model().mujoco();
}

void FileRobot::reset() { reset(initial_position()); }

void FileRobot::reset(std::span<const double> position, std::span<const double> model_position) {
  simulator_.check(position);
  const std::size_t joints = model().model_joints().size();
  require(model_position.size() <= joints,
          text_of("there are positions for ", model_position.size(),
                  " hinges and slides, the model has ", joints));
  simulator_.reset(position, mujoco(), *data_, state_, model_position);
  chain_.forget();
  begin_here();
}

void FileRobot::vary(const Variation& variation) {
  FileSimulator::check(variation);
  vary_model(variation);
  state_.memory.variation = variation;
  begin_here();
}

void FileRobot::vary_model(const Variation& variation) {
  if (variation == state_.memory.variation) return;
  mj_getState(&mujoco(), data_.get(), physics_.data(), kWholeFileState);
  if (varied_ == nullptr) varied_ = simulator_.make_varied_model();
  simulator_.vary(variation, *varied_, *data_);
  mj_setState(&mujoco(), data_.get(), physics_.data(), kWholeFileState);
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

void FileRobot::place_object(const std::string& name, const ObjectPose& pose) {
  const ObjectAddress& address = object(name);
  double square = 0.0;
  for (const double value : pose.orientation) square += value * value;
  constexpr double kSmallestSquare = 1e-12;
  bool is_pose = std::isfinite(square) && square > kSmallestSquare;
  for (const double value : pose.position) is_pose = is_pose && std::isfinite(value);
  require(is_pose, "object '" + name +
                       "' cannot be placed: its pose is not finite, or its quaternion is zero");
  simulator_.place(address, pose, *data_);
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
  simulator_.set_velocity(address, velocity, *data_);
  begin_here();
}

ObjectPose FileRobot::object_pose(const std::string& name) const {
  return simulator_.object_pose(object(name), *data_);
}

ObjectPose FileRobot::observed_object_pose(const std::string& name) const {
  const ObjectAddress* const first = model().free_bodies().data();
  return state_.objects[static_cast<std::size_t>(&object(name) - first)];
}

ObjectVelocity FileRobot::object_velocity(const std::string& name) const {
  return simulator_.object_velocity(object(name), *data_);
}

SimulationState FileRobot::save() const {
  SimulationState state(state_size());
  write_state(state);
  return state;
}

void FileRobot::restore(std::span<const std::byte> state) {
  FileStateHeader header{.magic = 0};
  if (state.size() >= sizeof(header)) std::memcpy(&header, state.data(), sizeof(header));
  require(header.magic == kFileStateMagic,
          "this is not the saved state of a robot from a file, or one of another version");
  require(header.model == fingerprint_ && state.size() == state_size(),
          "this state was saved from another model");
  Variation variation;
  std::memcpy(&variation, state.data() + sizeof(FileStateHeader), sizeof(variation));
  FileSimulator::check(variation);
  vary_model(variation);
  read_state(state);
  begin_here();
}

std::vector<double> FileRobot::configuration() const {
  const mjModel& mujoco = *model().mujoco();
  std::vector<double> values(data_->qpos, data_->qpos + mujoco.nq);
  values.insert(values.end(), data_->qvel, data_->qvel + mujoco.nv);
  return values;
}

void FileRobot::write_observation(void* element) const noexcept {
  if (model().drives_all()) {
    write_element(state_.observation, element);
  } else {
    write_element(state_.observation, state_.model_position, state_.model_velocity, element);
  }
}

// Call this after the owner has moved the robot: the next session begins here. In a session that
// continues, the next action must not be judged by an observation from before.
void FileRobot::begin_here() noexcept {
  simulator_.observe(*data_, state_);
  write_state(begin_state_);
}

std::size_t FileRobot::state_size() const noexcept {
  const FileSimulator::Memory& memory = state_.memory;
  return sizeof(FileStateHeader) + sizeof(Variation) + sizeof(memory.num_sent) +
         std::span(physics_).size_bytes() + num_joints() * sizeof(double) +
         std::span(memory.sent).size_bytes() + chain_.memory().size_bytes();
}

void FileRobot::write_state(std::span<std::byte> state) const noexcept {
  mj_getState(model().mujoco(), data_.get(), physics_.data(), kWholeFileState);
  write_state(state, state_.memory, chain_.memory());
}

// Writes `physics_` and the rest.
void FileRobot::write_state(std::span<std::byte> state, const FileSimulator::Memory& memory,
                            std::span<const JointMemory> safety) const noexcept {
  std::byte* target = state.data();
  const auto write = [&target](const void* source, std::size_t size) {
    std::memcpy(target, source, size);
    target += size;
  };
  const FileStateHeader header{.model = fingerprint_};
  write(&header, sizeof(header));
  write(&memory.variation, sizeof(memory.variation));
  write(&memory.num_sent, sizeof(memory.num_sent));
  write(physics_.data(), std::span(physics_).size_bytes());
  write(memory.torque.begin(), num_joints() * sizeof(double));
  write(memory.sent.data(), std::span(memory.sent).size_bytes());
  write(safety.data(), safety.size_bytes());
}

// Reads everything but the varied model, which the caller has made already.
void FileRobot::read_state(std::span<const std::byte> state) noexcept {
  const std::byte* source = state.data() + sizeof(FileStateHeader);
  const auto read = [&source](void* target, std::size_t size) {
    std::memcpy(target, source, size);
    source += size;
  };
  FileSimulator::Memory& memory = state_.memory;
  read(&memory.variation, sizeof(memory.variation));
  read(&memory.num_sent, sizeof(memory.num_sent));
  read(physics_.data(), std::span(physics_).size_bytes());
  mj_setState(model().mujoco(), data_.get(), physics_.data(), kWholeFileState);
  data_->warning[mjWARN_BADQACC].number = 0;
  read(memory.torque.begin(), num_joints() * sizeof(double));
  read(memory.sent.data(), std::span(memory.sent).size_bytes());
  read(chain_.memory().data(), chain_.memory().size_bytes());
}

void FileRobot::keep_state_before_step() noexcept {
  mj_getState(model().mujoco(), data_.get(), before_step_.data(), kChangedByFileStep);
  memory_before_step_ = state_.memory;
  std::ranges::copy(chain_.memory(), safety_before_step_.begin());
}

void FileRobot::keep_state_before_divergence() noexcept {
  // The loop calls this, so it must not allocate.
  if (state_before_divergence_.empty()) state_before_divergence_.swap(spare_state_);
  const mjModel* const mujoco = model().mujoco();
  mj_getState(mujoco, data_.get(), after_step_.data(), kChangedByFileStep);
  mj_setState(mujoco, data_.get(), before_step_.data(), kChangedByFileStep);
  mj_getState(mujoco, data_.get(), physics_.data(), kWholeFileState);
  mj_setState(mujoco, data_.get(), after_step_.data(), kChangedByFileStep);
  write_state(state_before_divergence_, memory_before_step_, safety_before_step_);
}

}  // namespace trifinger
