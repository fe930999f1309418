// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include "bindings.hpp"
#include "control/filters.hpp"
#include "conversion/array.hpp"
#include "docstrings.hpp"
#include "trifinger/control/pose_estimator.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {

using namespace control;

void bind_estimation(nb::module_& m) {
  using AnySignal = Array<Signal>;
  const auto bind_filter = []<class T>(nb::class_<T> type, const char* update, const char* reset) {
    type.def(nb::init<double>(), "cutoff_frequency"_a)
        .def(
            "update",
            [](T& filter, const AnySignal& sample, double elapsed) {
              return AnySignal{filter.update(sample, Seconds(elapsed))};
            },
            "sample"_a, "elapsed"_a, update)
        .def("reset", &T::reset, reset);
  };
  bind_filter(nb::class_<LowPassFilter>(m, "LowPassFilter", docs::LowPassFilter::LowPassFilter),
              docs::LowPassFilter::update, docs::LowPassFilter::reset);
  bind_filter(nb::class_<Derivative>(m, "Derivative", docs::Derivative::Derivative),
              docs::Derivative::update, docs::Derivative::reset);

  nb::class_<PoseEstimator>(m, "PoseEstimator", docs::PoseEstimator::PoseEstimator)
      .def(nb::init<double>(), "bandwidth"_a = 3.0)
      .def(
          "update",
          [](PoseEstimator& estimator, double time, const Pose& pose, const Motion& known) {
            return estimator.update(Seconds(time), pose, known);
          },
          "time"_a, "pose"_a, nb::arg("known").sig("...") = Motion{}, docs::PoseEstimator::update)
      .def(
          "predict",
          [](const PoseEstimator& estimator, double time, const Motion& known) {
            return estimator.predict(Seconds(time), known);
          },
          "time"_a, nb::arg("known").sig("...") = Motion{}, docs::PoseEstimator::predict)
      .def_prop_ro(
          "last_time", [](const PoseEstimator& estimator) { return estimator.last_time().count(); },
          docs::PoseEstimator::last_time)
      .def("reset", &PoseEstimator::reset, docs::PoseEstimator::reset);
}

}  // namespace trifinger::bindings
