// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "view.hpp"

namespace trifinger::tracking::detail {

// Which faces an object shows, and in which light.
//
// Edges tell where a box is, but not which of its faces is in front, and a lamp can make one colour
// look like another one. But all faces that a camera shows are in the same light. For each turn of
// the object onto itself and each camera, the light is sought in which the faces show their colours
// best. Unusual light costs. The turn with the best sum over all cameras wins.
class LightFit {
 public:
  LightFit(const Shape& shape, const ColourTable& table);

  // The light of each camera: factors of its channels in addition to its white balance.
  using Lights = std::array<Eigen::Vector3d, kMaxCameras>;

  struct Answer {
    // The best turn; null if the object is best as it is.
    const Turn* turn{nullptr};
    // How much likelier it is than the next best one: difference of the logs of likelihoods.
    double margin{0};
    // How much likelier a face of the object as it is has another colour in all images together, of
    // the face that speaks most against it.
    double contradiction{0};
    Lights lights{};           // of the best turn
    Lights lights_as_it_is{};  // of the object as it is

    // How much likelier the object is as it is than after any turn; negative if it is not.
    [[nodiscard]] double as_it_is() const noexcept { return turn == nullptr ? margin : -margin; }
  };
  [[nodiscard]] Answer fit(const std::vector<View>& views, const Eigen::Isometry3d& pose) noexcept;

  struct Exchanges {
    // The larger it is, the more two exchanged colours speak against the object: how much likelier
    // it is with them exchanged, plus a margin that grows with how much is seen of them. Of the
    // pair that speaks most against it.
    double colours{0};
    // How much likelier it is with red and blue of an image exchanged, of the image that speaks
    // most against it.
    double channels{0};
  };
  // Call fit() with the same images and pose before: it finds the light.
  [[nodiscard]] Exchanges exchanges(const std::vector<View>& views,
                                    const Eigen::Isometry3d& pose) noexcept;

 private:
  struct Sample {
    std::size_t face;
    Rgb colour;  // in white balance
  };
  // Two colours that change places.
  struct Exchange {
    Label a;
    Label b;
  };
  static constexpr Exchange kNone{0, 0};
  // Which light is usual is not known: that in which the white balance makes the image grey, or, as
  // a table of wood misleads the balance, that in which the camera took it. It is the same kind for
  // all images. They are read in the first one.
  static constexpr std::size_t kWhites = 2;
  // The lights near each of these in which the faces have their colours best.
  struct Best {
    std::array<double, kWhites> scores;
    std::array<std::size_t, kWhites> lights;

    [[nodiscard]] double score() const noexcept { return std::max(scores[0], scores[1]); }
  };
  static constexpr int kSteps = 7;  // of the gains of red and of blue
  static constexpr std::size_t kLights = kSteps * kSteps;

  [[nodiscard]] double score(std::size_t light, std::size_t turn,
                             const Exchange& exchange) const noexcept;
  [[nodiscard]] Best best(std::size_t turn, const Exchange& exchange = kNone) const noexcept;
  void read_samples(const View& view, const Eigen::Isometry3d& pose) noexcept;
  void weigh_faces() noexcept;
  void weigh_lights(const LabelledImage& image) noexcept;
  void try_exchanges(std::size_t light, Exchanges& exchanges) noexcept;
  [[nodiscard]] double contradiction() const noexcept;
  [[nodiscard]] double exchanged_colours() const noexcept;
  [[nodiscard]] std::size_t white() const noexcept { return scores_[1][0] > scores_[0][0] ? 1 : 0; }

  const Shape* shape_;
  const ColourTable* table_;
  std::array<Eigen::Vector3d, kLights> lights_;
  // How unusual each light is for the image whose samples were read.
  std::array<std::array<double, kLights>, kWhites> costs_;
  std::vector<Sample> samples_;
  std::vector<std::size_t> shown_;  // the faces of the samples
  std::vector<float> evidence_;     // for each light, face, and label
  std::vector<double> seen_;        // for each face and label, the evidence as the object is
  std::vector<int> coloured_;       // for each label, samples of its faces that have a colour
  // Scores of these samples: for each pair of labels with the two exchanged, and as the object is.
  std::array<std::vector<double>, kWhites> exchanges_;
  std::array<double, kWhites> unexchanged_;
  // Of each turn; the first one leaves the object as it is.
  std::array<std::vector<double>, kWhites> scores_;
  std::array<bool, kMaxCameras> is_read_{};  // with the object in front of its camera
  std::array<std::vector<Best>, kMaxCameras> bests_;
};

}  // namespace trifinger::tracking::detail
