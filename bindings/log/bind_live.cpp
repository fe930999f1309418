// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <string>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "log.hpp"
#include "log/live_messages.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {

void bind_live(nb::module_& m) {
  using log::LiveBatch;
  using log::LiveChannel;
  using log::LiveMessage;
  using log::LiveMessages;
  nb::class_<LiveChannel>(m, "LiveChannel", docs::LiveChannel::LiveChannel)
      .def_ro("topic", &LiveChannel::topic, docs::LiveChannel::topic)
      .def_ro("type", &LiveChannel::type, docs::LiveChannel::type)
      .def_ro("definition", &LiveChannel::definition, docs::LiveChannel::definition)
      .def_ro("is_latched", &LiveChannel::is_latched, docs::LiveChannel::is_latched)
      .def_ro("is_image", &LiveChannel::is_image, docs::LiveChannel::is_image);
  nb::class_<LiveMessage>(m, "LiveMessage", docs::LiveMessage::LiveMessage)
      .def_ro("channel", &LiveMessage::channel, docs::LiveMessage::channel)
      .def_ro("log_time", &LiveMessage::log_time, docs::LiveMessage::log_time)
      .def_ro("part", &LiveMessage::part, docs::LiveMessage::part)
      .def_prop_ro(
          "data",
          [](const LiveMessage& message) {
            return nb::bytes(message.data.data(), message.data.size());
          },
          "The message in CDR, little endian, with its header of four bytes.");
  nb::class_<LiveBatch>(m, "LiveBatch", docs::LiveBatch::LiveBatch)
      .def_ro("messages", &LiveBatch::messages, docs::LiveBatch::messages)
      .def_prop_ro(
          "events",
          [](const LiveBatch& batch) {
            nb::typed<nb::list, Shown<"trifinger.log.types.Event">> events;
            for (const log::Event& event : batch.events) events.append(to_python(event));
            return events;
          },
          docs::LiveBatch::events)
      .def_ro("lost", &LiveBatch::lost, docs::LiveBatch::lost);
  nb::class_<LiveMessages>(m, "LiveMessages", docs::LiveMessages::LiveMessages)
      .def(
          "__init__",
          [](LiveMessages* place, const std::string& name, double rate, double viewer_rate,
             int jpeg_quality) {
            new (place) LiveMessages(
                name, {.rate = rate, .viewer_rate = viewer_rate, .jpeg_quality = jpeg_quality});
          },
          "name"_a, nb::kw_only(), "rate"_a = log::LiveOptions().rate,
          "viewer_rate"_a = log::LiveOptions().viewer_rate,
          "jpeg_quality"_a = log::LiveOptions().jpeg_quality,
          R"(Begins to look for the robot `name`, which need not run yet.

`rate` is the number of steps, and of elements of each companion, per second of the robot's time
(0: all), `viewer_rate` that of the poses of links for 3D viewers (0: none), `jpeg_quality` that of
images, 1 to 100. Raises InvalidArgument if `name` is a companion's or a number is out of range.)")
      .def(
          "take",
          [](LiveMessages& live) {
            const GilRelease release;
            return live.take();
          },
          docs::LiveMessages::take)
      .def_prop_ro(
          "channels", [](const LiveMessages& live) { return live.channels(); },
          docs::LiveMessages::channels)
      .def("want_images", &LiveMessages::want_images, "wanted"_a, docs::LiveMessages::want_images)
      .def_prop_ro("is_running", &LiveMessages::is_running, docs::LiveMessages::is_running);
}

}  // namespace trifinger::bindings
