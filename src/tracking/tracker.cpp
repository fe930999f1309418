// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/tracking/tracker.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "base/moved.hpp"
#include "base/text_of.hpp"
#include "colour_table.hpp"
#include "edges.hpp"
#include "judgement.hpp"
#include "light.hpp"
#include "search.hpp"
#include "trifinger/base/error.hpp"
#include "view.hpp"

namespace trifinger::tracking {
namespace {

using detail::Fit;
using detail::Guess;
using detail::Verdict;
using trifinger::detail::text_of;

// The colours of an object, each once. Their places are their labels.
std::vector<std::string> colours_of(const TrackedObject& object, const ColourModel& model) {
  std::vector<std::string> colours;
  for (const ColouredFace& face : object.faces) {
    if (model.find(face.colour) == nullptr) {
      throw InvalidArgument(text_of("a face of '", object.name, "' is ", face.colour,
                                    ", a colour that the colour model does not know; it knows ",
                                    trifinger::detail::joined(model.colours, &Colour::name)));
    }
    if (std::ranges::find(colours, face.colour) == colours.end()) colours.push_back(face.colour);
  }
  constexpr std::size_t kMaxColours = 64;
  constexpr std::size_t kMaxFaces = 256;
  if (colours.empty() || colours.size() > kMaxColours || object.faces.size() > kMaxFaces) {
    throw InvalidArgument(text_of("'", object.name, "' has ", object.faces.size(), " faces in ",
                                  colours.size(), " colours; a tracker knows objects of 1 to ",
                                  kMaxFaces, " faces in up to ", kMaxColours, " colours"));
  }
  return colours;
}

// The number of blocks that a camera shows of each colour at most, with the object near.
std::vector<double> most_blocks(const camera::Camera& camera, const detail::Shape& shape,
                                std::size_t num_colours) {
  constexpr double kNear = 0.7;  // of the distance between camera and the middle of the table
  constexpr double kSpare = 1.3;
  const double distance = kNear * camera.pose.translation().norm();
  const double blocks = camera.lens.fx * camera.lens.fy / (4 * distance * distance);
  std::vector<double> most(num_colours, 0.0);
  for (const detail::Face& face : shape.faces) most[face.label] += kSpare * face.area * blocks;
  return most;
}

std::vector<detail::View> views_of(const std::vector<camera::Camera>& cameras,
                                   const detail::Shape& shape, std::size_t num_colours) {
  if (cameras.empty() || cameras.size() > detail::kMaxCameras) {
    throw InvalidArgument(
        text_of("a tracker of ", cameras.size(), " cameras; it needs 1 to ", detail::kMaxCameras));
  }
  std::vector<detail::View> views;
  for (const camera::Camera& camera : cameras) {
    const camera::ImageFormat& format = camera.format;
    if (format.pixels == camera::PixelFormat::kMono8) {
      throw InvalidArgument(text_of("the images of ", camera.name,
                                    " have no colours (mono8), but faces are told apart by colour; "
                                    "set the camera to bayer_rggb8 or rgb8"));
    }
    if (format.width < 16 || format.height < 16 || format.width % 2 != 0 ||
        format.height % 2 != 0) {
      throw InvalidArgument(text_of("the images of ", camera.name, " have ", format.width, " x ",
                                    format.height,
                                    " pixels; width and height must be even and at least 16"));
    }
    views.emplace_back(camera, most_blocks(camera, shape, num_colours));
  }
  return views;
}

// How much likelier the faces of a pose must be than others to be trusted: log of a ratio.
constexpr double kClearFaces = 2;
// From this confidence on, a guess is taken, and images are not read again in another light.
constexpr double kEnough = 0.7;

constexpr double kSamePlace = 0.03;  // [m]

// Whether two poses are one that is not refined yet.
bool are_same(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) noexcept {
  constexpr double kAngle = 0.35;  // [rad]
  return Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle() < kAngle &&
         (a.translation() - b.translation()).norm() < kSamePlace;
}

// Another pose that explains the images, too: its score relative to that of the best one.
struct Rival {
  double anywhere{0};
  double elsewhere{0};  // at another place, so that it stays one when the best one is turned
};

// The better of two estimates of the same images.
Estimate better(const Estimate& a, const Estimate& b) noexcept {
  const bool is_found = b.state != Estimate::State::kNotFound;
  if (is_found != (a.state != Estimate::State::kNotFound)) return is_found ? b : a;
  return b.confidence > a.confidence ? b : a;
}

}  // namespace

struct Tracker::Parts {
  using Faces = detail::LightFit::Answer;
  // A pose that was refined.
  struct Candidate {
    Eigen::Isometry3d pose{Eigen::Isometry3d::Identity()};
    Fit fit{};
    Verdict verdict{};
  };

  Parts(std::vector<camera::Camera> given_cameras, TrackedObject given_object,
        const ColourModel& model, const TrackerOptions& options)
      : cameras(std::move(given_cameras)),
        object(std::move(given_object)),
        colours(colours_of(object, model)),
        shape(object, colours),
        has_look_alikes(look_alikes(object) > 0),
        table_height(options.search_bottom),
        views(views_of(cameras, shape, colours.size())),
        table(model, colours),
        search(views, shape, colours.size(), options),
        edges(views, shape, table, options.calibration_error),
        judge(shape),
        light(shape, table) {}

  [[nodiscard]] Candidate refined(Eigen::Isometry3d pose) noexcept {
    Candidate candidate;
    candidate.fit = edges.refine(views, pose);
    candidate.pose = pose;
    candidate.verdict = judge.judge(views, pose);
    return candidate;
  }
  [[nodiscard]] Estimate searched() noexcept;
  [[nodiscard]] Estimate in_its_light(const Candidate& candidate, const Rival& rival) noexcept;
  [[nodiscard]] bool can_be_sure() const noexcept;
  [[nodiscard]] Estimate estimate(const Candidate& candidate, double rival,
                                  const Faces& faces) noexcept;
  [[nodiscard]] double height_above_table(const Eigen::Isometry3d& pose) const noexcept;

  std::vector<camera::Camera> cameras;
  TrackedObject object;
  std::vector<std::string> colours;
  detail::Shape shape;
  bool has_look_alikes;
  double table_height;  // [m]
  std::vector<detail::View> views;
  detail::ColourTable table;
  detail::Search search;
  detail::EdgeFit edges;
  detail::Judge judge;
  detail::LightFit light;
};

// Of the lowest corner [m].
double Tracker::Parts::height_above_table(const Eigen::Isometry3d& pose) const noexcept {
  double lowest = std::numeric_limits<double>::infinity();
  for (const detail::Face& face : shape.faces) {
    for (const Eigen::Vector3d& corner : face.corners)
      lowest = std::min(lowest, (pose * corner).z());
  }
  return lowest - table_height;
}

// Judges a candidate. `rival` is the score of the best other pose, relative to that of the
// candidate.
Estimate Tracker::Parts::estimate(const Candidate& candidate, double rival,
                                  const Faces& faces) noexcept {
  const Verdict& verdict = candidate.verdict;
  const Fit& fit = candidate.fit;
  Estimate estimate;
  constexpr double kMinMatched = 25;  // [block]
  if (verdict.matched < kMinMatched || verdict.score() <= 0) return estimate;
  estimate.pose = candidate.pose;
  estimate.cameras = verdict.cameras;
  estimate.faces = verdict.faces;
  estimate.residual = fit.residual;
  estimate.position_deviation = fit.covariance.diagonal().head<3>().cwiseSqrt();
  estimate.rotation_deviation = fit.covariance.diagonal().tail<3>().cwiseSqrt();
  // Each is 1 if all is well, 0.5 at the limit of what can be trusted, and 0 far beyond.
  const auto at_least = [](double value, double limit, double good) {
    return std::clamp(0.5 + 0.5 * (value - limit) / (good - limit), 0.0, 1.0);
  };
  const auto at_most = [&](double value, double limit, double good) {
    return at_least(-value, -limit, -good);
  };
  const double shown = fit.looked > 0 ? static_cast<double>(fit.used) / fit.looked : 0;
  double confidence = 1;
  for (const double each : {
           at_least(verdict.purity(), 0.50, 0.80),
           at_most(verdict.contradicted / verdict.matched, 0.05, 0.02),
           // A lamp may make one face look like another colour.
           at_most(faces.contradiction, 3, 2.4),
           at_least(verdict.completeness(), 0.25, 0.6),
           at_least(faces.as_it_is(), kClearFaces, 5),
           // One camera alone may be another one than it is said to be.
           at_least(verdict.cameras, 1.5, 2),
           at_least(shown, 0.18, 0.4),
           // Every image and every side must confirm the pose, and no image may contradict it.
           at_least(fit.image_confirmed, 0.03, 0.06),
           at_least(fit.side_confirmed, 0.05, 0.1),
           at_least(fit.ending, 0.85, 0.92),
           at_least(fit.image_agreeing, 0.6, 0.7),
           // Blur and rims make right faces look up to 0.55 pixels larger, 15 mm of size from 0.68.
           at_most(fit.growth, 0.6, 0.45),
           // Calibrations of the original lie 6 mm and 2 degrees beside their tables.
           at_least(height_above_table(candidate.pose), -0.012, -0.009),
           at_least(fit.used, 24, 80),
           at_least(verdict.matched, 80, 300),
           // Edges that are off must be outweighed by many that are seen.
           at_most(fit.residual / std::max(shown, 1e-3), 2, 1.2),
           at_most(fit.residual, 1.0, 0.6),
           at_most(estimate.position_deviation.norm(), 0.003, 0.001),
           at_most(estimate.rotation_deviation.norm(), 0.04, 0.012),
           at_most(std::max(rival, verdict.twin), 0.75, 0.4),
           at_least(verdict.directions, 1.5, 2),
       }) {
    confidence = each >= 0 ? std::min(confidence, each) : 0;  // also if it is no number
  }
  if (confidence >= 0.5) {
    // Another object explains all faces better, and so does an image whose channels are exchanged.
    const auto exchanges = light.exchanges(views, candidate.pose);
    // An image of an instant before shows edges elsewhere, more than the 14 places of one edge.
    const int elsewhere = edges.places_elsewhere(views, candidate.pose);
    confidence = std::min({confidence, at_most(exchanges.colours, 0.2, 0.05),
                           at_most(exchanges.channels, 0.5, 0.2), at_most(elsewhere, 14, 8)});
  }
  estimate.confidence = confidence;
  estimate.state = confidence >= 0.5 ? Estimate::State::kSure : Estimate::State::kUnsure;
  return estimate;
}

Estimate Tracker::Parts::searched() noexcept {
  constexpr std::size_t kFinalists = 3;
  std::array<std::pair<double, Eigen::Isometry3d>, kFinalists> finalists;
  std::size_t count = 0;
  bool is_clear = false;
  search.begin(views);
  // The places come in the order of how much speaks for them. One that leaves little to explain is
  // the last one.
  for (auto guesses = search.next(views); !guesses.empty(); guesses = search.next(views)) {
    for (const Guess& guess : guesses) {
      Eigen::Isometry3d pose = guess.pose;
      edges.approach(views, pose);
      const Verdict verdict = judge.judge(views, pose);
      is_clear = is_clear || (verdict.purity() > 0.9 && verdict.completeness() > 0.55 &&
                              verdict.directions > 1 && verdict.matched > 200);
      const double score = verdict.score();
      std::size_t place = 0;
      while (place < count && !are_same(finalists[place].second, pose)) ++place;
      if (place < count) {  // the same pose again
        if (score > finalists[place].first) finalists[place] = {score, pose};
      } else if (count < kFinalists) {
        finalists[count++] = {score, pose};
      } else {
        auto* const worst = std::ranges::min_element(
            finalists, {}, [](const auto& finalist) { return finalist.first; });
        if (score > worst->first) *worst = {score, pose};
      }
    }
    if (is_clear) break;
  }
  if (count == 0) return {};
  std::array<Candidate, kFinalists> candidates;
  std::size_t best = 0;
  const double leader =
      std::max_element(finalists.begin(), finalists.begin() + count,
                       [](const auto& a, const auto& b) { return a.first < b.first; })
          ->first;
  for (std::size_t i = 0; i < count; ++i) {
    constexpr double kChance = 0.4;  // refining moves a pose by a few pixels only
    if (finalists[i].first < kChance * leader) continue;
    candidates[i] = refined(finalists[i].second);
    if (candidates[best].verdict.matched <= 0) best = i;
    if (candidates[i].verdict.score() > candidates[best].verdict.score()) best = i;
  }
  Rival rival;
  for (std::size_t i = 0; i < count; ++i) {
    if (candidates[i].verdict.matched <= 0) continue;
    if (are_same(candidates[i].pose, candidates[best].pose)) continue;
    const double score =
        candidates[i].verdict.score() / std::max(1.0, candidates[best].verdict.score());
    rival.anywhere = std::max(rival.anywhere, score);
    if ((candidates[i].pose.translation() - candidates[best].pose.translation()).norm() >
        kSamePlace) {
      rival.elsewhere = std::max(rival.elsewhere, score);
    }
  }
  return in_its_light(candidates[best], rival);
}

// Whether these images of this object can give a sure estimate at all.
bool Tracker::Parts::can_be_sure() const noexcept {
  const auto exists = [](const detail::View& view) { return view.image.exists(); };
  return !has_look_alikes && std::ranges::count_if(views, exists) > 1;
}

// Judges a candidate. If that leaves doubts, reads the images again in the light in which its faces
// have the colours that they should have, turns it if other faces fit clearly better, and judges it
// once more.
Estimate Tracker::Parts::in_its_light(const Candidate& candidate, const Rival& rival) noexcept {
  const Faces faces = light.fit(views, candidate.pose);
  Estimate first = estimate(candidate, rival.anywhere, faces);
  if (first.confidence >= kEnough || first.state == Estimate::State::kNotFound || !can_be_sure()) {
    return first;
  }
  const bool is_turned = faces.as_it_is() < -kClearFaces;
  Eigen::Isometry3d pose = candidate.pose;
  if (is_turned) pose.linear() = pose.linear() * faces.turn->rotation;
  const auto& lights = is_turned ? faces.lights : faces.lights_as_it_is;
  for (std::size_t c = 0; c < views.size(); ++c) views[c].image.read_again(lights[c], table);
  edges.approach(views, pose);
  const Candidate again = refined(pose);
  Estimate second =
      estimate(again, is_turned ? rival.elsewhere : rival.anywhere, light.fit(views, again.pose));
  for (detail::View& view : views) view.image.read_again(Eigen::Vector3d::Ones(), table);
  const bool is_found = second.state != Estimate::State::kNotFound;
  if (is_found && !first.is_sure() && !second.is_sure()) {
    return again.verdict.score() > candidate.verdict.score() ? second : first;
  }
  return better(first, second);
}

Tracker::Tracker(std::vector<camera::Camera> cameras, TrackedObject object,
                 const ColourModel& colours, const TrackerOptions& options)
    : parts_(std::make_unique<Parts>(std::move(cameras), std::move(object), colours, options)) {}
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;
Tracker::~Tracker() = default;

const std::vector<camera::Camera>& Tracker::cameras() const noexcept {
  return checked(parts_)->cameras;
}
const TrackedObject& Tracker::object() const noexcept { return checked(parts_)->object; }

Estimate Tracker::track(std::span<const std::span<const std::byte>> images,
                        const Eigen::Isometry3d* guess) {
  Parts& parts = *checked(parts_);
  if (images.size() != parts.cameras.size()) {
    throw InvalidArgument(text_of(images.size(), " images for ", parts.cameras.size(),
                                  " cameras; give one for each, empty if it is missing"));
  }
  for (std::size_t i = 0; i < images.size(); ++i) {
    const std::size_t size = parts.cameras[i].format.size();
    if (!images[i].empty() && images[i].size() != size) {
      throw InvalidArgument(text_of("the image of ", parts.cameras[i].name, " has ",
                                    images[i].size(), " bytes, must have ", size));
    }
  }
  for (std::size_t i = 0; i < images.size(); ++i) parts.views[i].image.read(images[i], parts.table);
  if (guess != nullptr && guess->matrix().allFinite()) {
    Eigen::Isometry3d pose = *guess;
    parts.edges.approach(parts.views, pose);
    Estimate near = parts.in_its_light(parts.refined(pose), {});
    // A guess is taken if it leaves nothing to explain, so a search could find nothing better.
    if (near.confidence >= kEnough) return near;
  }
  Estimate first = parts.searched();
  if (first.is_sure() || !parts.can_be_sure()) return first;
  // A table of wood or a wall in a colour misleads the white balance: once more without it.
  for (detail::View& view : parts.views) view.image.read_unbalanced(parts.table);
  return better(first, parts.searched());
}

}  // namespace trifinger::tracking
