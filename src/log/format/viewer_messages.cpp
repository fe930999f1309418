// SPDX-License-Identifier: BSD-3-Clause
#include "log/format/viewer_messages.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <locale>
#include <sstream>
#include <system_error>
#include <utility>

#include "log/format/cdr.hpp"

namespace trifinger::log::detail {
namespace {

constexpr std::string_view kDescriptionDocument = "robot.urdf";
constexpr std::string_view kFramesDocument = "frames.txt";
// Far more than any robot has.
constexpr std::size_t kMaxFrames = 1000;
// Limit for elements of a companion whose steps may never come.
constexpr std::size_t kMaxSeen = 1000;

// Rounds to 0.03 mm at the length of an arm: too fine to be seen, and with few bits to compress.
double rounded(double value) noexcept {
  constexpr double kSteps = 1 << 14;
  return std::round(value * kSteps) / kSteps;
}

std::string text_of(const std::vector<Document>& documents, std::string_view name) {
  const auto found = std::ranges::find(documents, name, &Document::name);
  return found == documents.end() ? std::string() : found->text;
}

// Makes the description of one robot among others: its name and its links get the session's name as
// a prefix.
std::string description_of(std::string urdf, const std::string& robot) {
  const auto put = [&urdf](std::string_view before, const std::string& text) {
    for (std::size_t at = 0; (at = urdf.find(before, at)) != std::string::npos;) {
      at += before.size();
      urdf.insert(at, text);
    }
  };
  put("<robot name=\"", robot + " ");
  for (const std::string_view tag : {"<link name=\"", "<parent link=\"", "<child link=\""}) {
    put(tag, robot + "/");
  }
  return urdf;
}

double number_at(const std::byte* element, std::size_t offset) noexcept {
  double number = 0;
  std::memcpy(&number, element + offset, sizeof(number));
  return number;
}

template <std::size_t size>
bool is_finite(const std::array<double, size>& numbers) noexcept {
  return std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); });
}

// Returns the offset in an element of number `index` in a field of `count` float64.
std::optional<std::size_t> offset_of(const ElementDescription& element, std::string_view name,
                                     std::size_t index, std::optional<std::size_t> count) {
  const FieldDescription* const field = element.find(name);
  if (field == nullptr || field->type != ScalarType::kFloat64 || index >= field->count() ||
      (count && field->count() != *count)) {
    return std::nullopt;
  }
  return field->offset + index * sizeof(double);
}

}  // namespace

const std::array<ViewerTopic, kNumViewerTopics>& viewer_topics() {
  static const std::array<ViewerTopic, kNumViewerTopics> topics{
      {{"robot_description", &text_type()},
       {"tf_static", &frames_type()},
       {"tf", &frames_type()},
       {"joint_states", &joint_states_type()}}};
  return topics;
}

// A message with transforms, one after the other. Their number is set at the end.
class ViewerMessages::Message {
 public:
  void add(const Frame& frame, std::int64_t stamp) {
    message_.add_time(stamp);
    message_.add(std::string_view(frame.parent));
    message_.add(std::string_view(frame.child));
    for (const double number : frame.pose.position) message_.add(number);
    for (const std::size_t i : {1U, 2U, 3U, 0U}) message_.add(frame.pose.rotation[i]);
    ++count_;
  }
  [[nodiscard]] bool is_empty() const noexcept { return count_ == 0; }
  [[nodiscard]] std::vector<std::byte> take() {
    std::vector<std::byte> bytes = message_.take();
    std::memcpy(bytes.data() + kCdrHeaderSize, &count_, sizeof(count_));
    return bytes;
  }

 private:
  static CdrWriter begun() {
    CdrWriter message;
    message.add(std::uint32_t{0});
    return message;
  }

  CdrWriter message_{begun()};
  std::uint32_t count_{0};
};

// Reads the lines of "frames.txt". The format is described in docs/log_format.md.
class ViewerMessages::Parser {
 public:
  Parser(ViewerMessages& messages, const SessionHeader& header)
      : messages_(messages), header_(header) {}

  void read(const std::string& text) {
    std::istringstream lines(text);
    std::size_t number = 0;
    for (std::string line; std::getline(lines, line);) {
      ++number;
      if (line.empty() || line.front() == '#') continue;
      if (number <= kMaxFrames && read_line(line)) continue;
      messages_.mistakes_.push_back(
          "Line " + std::to_string(number) + " of " + std::string(kFramesDocument) +
          " is not understood, so viewers do not show that frame: " + line.substr(0, 200));
      return;
    }
  }

 private:
  bool read_line(const std::string& line) {
    std::istringstream words(line);
    words.imbue(std::locale::classic());
    std::string kind;
    Frame frame;
    words >> kind >> frame.parent >> frame.child;
    for (std::string* const name : {&frame.parent, &frame.child}) {
      if (*name != kWorld) *name = header_.name + "/" + *name;
    }
    if (kind == "free") return read_free(words, std::move(frame));
    for (double& number : frame.pose.position) words >> number;
    for (double& number : frame.pose.rotation) words >> number;
    if (!words || !is_finite(frame.pose.position) || !is_finite(frame.pose.rotation)) return false;
    if (kind == "fixed") {
      messages_.still_.push_back(std::move(frame));
      return true;
    }
    return kind == "turning" && read_turning(words, std::move(frame));
  }

  bool read_turning(std::istringstream& words, Frame frame) {
    Turning turning{.frame = std::move(frame), .joint = {}};
    for (double& number : turning.axis) words >> number;
    std::string field;
    words >> turning.joint >> field;
    std::size_t index = 0;
    if (const std::size_t bracket = field.find('['); bracket != std::string::npos) {
      const char* const end = field.data() + field.size();
      const auto [rest, error] = std::from_chars(field.data() + bracket + 1, end, index);
      if (error != std::errc{} || std::string_view(rest, end) != "]") return false;
      field.resize(bracket);
    }
    const auto offset = offset_of(header_.types.observation, field, index, std::nullopt);
    if (!words || !offset || !is_finite(turning.axis)) return false;
    turning.offset = *offset;
    messages_.turning_.push_back(std::move(turning));
    return true;
  }

  bool read_free(std::istringstream& words, Frame frame) {
    std::string companion;
    std::string position;
    std::string orientation;
    words >> companion >> position >> orientation;
    const auto found = std::ranges::find(header_.companions, header_.name + "." + companion,
                                         &SessionHeader::Companion::name);
    // A log that was cut may lack a companion that the session had.
    if (!words || found == header_.companions.end()) return static_cast<bool>(words);
    const auto position_offset = offset_of(found->element, position, 0, 3);
    const auto orientation_offset = offset_of(found->element, orientation, 0, 4);
    if (!position_offset || !orientation_offset) return false;
    messages_.free_.push_back(
        {.frame = std::move(frame),
         .companion = static_cast<std::size_t>(found - header_.companions.begin()),
         .position = *position_offset,
         .orientation = *orientation_offset});
    return true;
  }

  ViewerMessages& messages_;
  const SessionHeader& header_;
};

ViewerMessages::ViewerMessages(const SessionHeader& header, double rate)
    : seen_(header.companions.size()) {
  if (!(rate > 0)) return;
  if (std::string urdf = text_of(header.documents, kDescriptionDocument); !urdf.empty()) {
    description_ = description_of(std::move(urdf), header.name);
  }
  Parser(*this, header).read(text_of(header.documents, kFramesDocument));
  constexpr double kSecond = 1e9;
  const auto period = std::llround(std::clamp(kSecond / rate, 1.0, 1e18));
  every_ = std::max<TimeIndex>(
      header.period > Nanoseconds::zero() ? period / header.period.count() : 1, 1);
}

std::vector<ViewerMessage> ViewerMessages::still(std::int64_t time) const {
  std::vector<ViewerMessage> messages;
  if (has_description()) {
    CdrWriter message;
    message.add(std::string_view(description_));
    messages.push_back({kRobotDescription, time, message.take()});
  }
  if (!still_.empty()) {
    Message message;
    for (const Frame& frame : still_) message.add(frame, time);
    messages.push_back({kStaticFrames, time, message.take()});
  }
  return messages;
}

void ViewerMessages::see(std::size_t companion, std::int64_t arrival, std::int64_t capture,
                         const std::byte* element) {
  Seen one{.arrival = arrival, .capture = capture, .poses = {}};
  for (const Free& free : free_) {
    if (free.companion != companion) continue;
    Pose& pose = one.poses.emplace_back();
    std::memcpy(pose.position.data(), element + free.position, sizeof(pose.position));
    std::memcpy(pose.rotation.data(), element + free.orientation, sizeof(pose.rotation));
  }
  if (one.poses.empty()) return;
  std::deque<Seen>& seen = seen_[companion];
  if (seen.size() == kMaxSeen) seen.pop_front();
  seen.push_back(std::move(one));
}

std::vector<ViewerMessage> ViewerMessages::at(std::int64_t time, const std::byte* observation) {
  Message frames;
  CdrWriter joints;
  std::vector<const Turning*> shown;
  for (const Turning& turning : turning_) {
    const double angle = number_at(observation, turning.offset);
    if (!std::isfinite(angle)) continue;
    shown.push_back(&turning);
    const auto& [a, b, c, d] = turning.frame.pose.rotation;
    const double cosine = std::cos(angle / 2);
    const auto [x, y, z] = turning.axis;
    const double sine = std::sin(angle / 2);
    Frame frame = turning.frame;
    frame.pose.rotation = {rounded(a * cosine - (b * x + c * y + d * z) * sine),
                           rounded(b * cosine + (a * x + c * z - d * y) * sine),
                           rounded(c * cosine + (a * y + d * x - b * z) * sine),
                           rounded(d * cosine + (a * z + b * y - c * x) * sine)};
    frames.add(frame, time);
  }
  for (std::size_t companion = 0; companion < seen_.size(); ++companion) {
    std::deque<Seen>& seen = seen_[companion];
    while (seen.size() > 1 && seen[1].arrival <= time) seen.pop_front();
    if (seen.empty() || seen.front().arrival > time) continue;
    auto pose = seen.front().poses.begin();
    for (const Free& free : free_) {
      if (free.companion != companion) continue;
      Frame frame = free.frame;
      std::ranges::transform(pose->position, frame.pose.position.begin(), rounded);
      std::ranges::transform(pose->rotation, frame.pose.rotation.begin(), rounded);
      if (is_finite(pose->position) && is_finite(pose->rotation)) {
        frames.add(frame, seen.front().capture);
      }
      ++pose;
    }
    seen.pop_front();
  }
  std::vector<ViewerMessage> messages;
  if (!frames.is_empty()) messages.push_back({kMovingFrames, time, frames.take()});
  if (shown.empty()) return messages;
  joints.add_time(time);
  joints.add(std::string_view());
  joints.add(static_cast<std::uint32_t>(shown.size()));
  for (const Turning* const turning : shown) joints.add(std::string_view(turning->joint));
  joints.add(static_cast<std::uint32_t>(shown.size()));
  for (const Turning* const turning : shown) {
    joints.add(rounded(number_at(observation, turning->offset)));
  }
  joints.add(std::uint32_t{0});  // velocity
  joints.add(std::uint32_t{0});  // effort
  messages.push_back({kJointStates, time, joints.take()});
  return messages;
}

}  // namespace trifinger::log::detail
