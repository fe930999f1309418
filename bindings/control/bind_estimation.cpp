// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "trifinger/control/filters.hpp"
#include "trifinger/control/pose_estimator.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {

using namespace control;

void bind_estimation(nb::module_& m) {
  using AnySignal = Array<Signal>;
  const auto bind_filter = []<class T>(nb::class_<T> type, const char* doc) {
    type.def(nb::init<double>(), "cutoff_frequency"_a)
        .def(
            "update",
            [](T& filter, const AnySignal& sample, double elapsed) {
              return AnySignal{filter.update(sample, Seconds(elapsed))};
            },
            "sample"_a, "elapsed"_a, doc)
        .def("reset", &T::reset, "Treats the next sample as the first one.");
  };
  bind_filter(nb::class_<LowPassFilter>(
                  m, "LowPassFilter",
                  "A first-order low-pass for up to nine numbers. Samples may come at uneven "
                  "intervals."),
              "Takes the next sample, `elapsed` [s] after the previous one, and returns the "
              "filtered signal. The\nfirst sample passes unchanged. A sample with another number "
              "of values passes unchanged, too.");
  bind_filter(nb::class_<Derivative>(m, "Derivative",
                                     "The rate at which up to nine numbers change, low-pass "
                                     "filtered."),
              "Takes the next sample, `elapsed` [s] after the previous one, and returns the rate "
              "[1/s]. The rate of\nthe first sample is zero, and so is that of a sample with "
              "another number of values.");

  nb::class_<PoseEstimator>(
      m, "PoseEstimator",
      "Estimates the current pose and motion of an object from poses that are few, noisy and "
      "old.\n\nThe estimator needs a known motion, such as the one on which the object is led. It "
      "filters how far\nthe object deviates from that motion and predicts the deviation across the "
      "delay. Times [s] may\nbegin anywhere, but must have the same beginning in all calls.")
      .def(nb::init<double>(), "bandwidth"_a = 3.0)
      .def(
          "update",
          [](PoseEstimator& estimator, double time, const Pose& pose, const Motion& known) {
            return estimator.update(Seconds(time), pose, known);
          },
          "time"_a, "pose"_a, "known"_a = Motion{},
          nb::sig("def update(self, time: float, pose: Pose, known: Motion = ...) -> bool"),
          "Takes `pose`, measured at `time`, when the known motion was at `known`. Returns False "
          "if the pose\nwas ignored because it is not newer than the previous one or not finite.")
      .def(
          "predict",
          [](const PoseEstimator& estimator, double time, const Motion& known) {
            return estimator.predict(Seconds(time), known);
          },
          "time"_a, "known"_a = Motion{},
          nb::sig("def predict(self, time: float, known: Motion = ...) -> Motion"),
          "The pose and motion of the object at `time`, when the known motion is at `known`. "
          "Before the first\npose the result is `known`.")
      .def_prop_ro(
          "last_time", [](const PoseEstimator& estimator) { return estimator.last_time().count(); },
          "Time of the newest pose; negative infinity before the first.")
      .def("reset", &PoseEstimator::reset, "Forgets all poses.");
}

}  // namespace trifinger::bindings
