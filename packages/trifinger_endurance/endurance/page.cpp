// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/page.hpp"

#include <fmt/chrono.h>
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <deque>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace trifinger::apps {
namespace {

constexpr double kWidth = 900.0;
constexpr double kHeight = 230.0;
constexpr double kLeft = 62.0;
constexpr double kRight = 12.0;
constexpr double kTop = 12.0;
constexpr double kBottom = 30.0;

// Paul Tol's colours, which people with any kind of sight can tell apart.
constexpr std::array<std::string_view, 9> kColours{"#332288", "#117733", "#44AA99",
                                                   "#88CCEE", "#DDCC77", "#CC6677",
                                                   "#AA4499", "#882255", "#999933"};

using Value = std::optional<double>;

struct Curve {
  std::string name;
  std::vector<Value> values;  // one per interval
};

struct Chart {
  std::string title;
  std::string unit;
  std::string explanation;
  std::vector<Curve> curves;
  bool is_logarithmic{false};
};

std::string escaped(std::string_view text) {
  std::string result;
  for (const char letter : text) {
    switch (letter) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += letter;
    }
  }
  return result;
}

double hours_of(Nanoseconds time) {
  return std::chrono::duration<double, std::ratio<3600>>(time).count();
}

std::string span_text(Nanoseconds time) {
  const double hours = hours_of(time);
  if (hours < 1.0) return fmt::format("{:.1f} min", 60.0 * hours);
  if (hours < 48.0) return fmt::format("{:.1f} h", hours);
  return fmt::format("{:.1f} days", hours / 24.0);
}

std::string date_text(std::int64_t seconds) {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(seconds));
}

// Groups of three digits, so that large counts can be read.
std::string count_text(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (auto place = static_cast<std::ptrdiff_t>(digits.size()) - 3; place > 0; place -= 3) {
    digits.insert(static_cast<std::size_t>(place), "\u202f");
  }
  return digits;
}

// Round numbers from `low` to `high`, about `wanted` of them.
std::vector<double> ticks(double low, double high, int wanted) {
  const double raw = (high - low) / wanted;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  double step = power;
  for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
    step = factor * power;
    if (step >= raw) break;
  }
  std::vector<double> result;
  // A hair is added, so that the ends count although they are rounded.
  const auto first = static_cast<std::int64_t>(std::ceil(low / step - 1e-9));
  const auto last = static_cast<std::int64_t>(std::floor(high / step + 1e-9));
  for (std::int64_t i = first; i <= last; ++i) result.push_back(static_cast<double>(i) * step);
  return result;
}

struct ValueRange {
  double low;
  double high;

  [[nodiscard]] bool is_empty() const noexcept { return low > high; }
};

// Whether a value can be drawn.
bool is_shown(const Chart& chart, const Value& value) {
  return value && (!chart.is_logarithmic || *value > 0.0);
}

ValueRange values_of(const Chart& chart) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Curve& curve : chart.curves) {
    for (const Value& value : curve.values) {
      if (!is_shown(chart, value)) continue;
      low = std::min(low, *value);
      high = std::max(high, *value);
    }
  }
  return {low, high};
}

// The range of the axis: of powers of ten if it is logarithmic.
ValueRange axis_of(const Chart& chart, ValueRange range) {
  if (chart.is_logarithmic) {
    range.low = std::floor(std::log10(range.low));
    range.high = std::max(range.low + 1.0, std::ceil(std::log10(range.high)));
  } else {
    range.low = std::min(range.low, 0.0);
    if (range.high <= range.low) range.high = range.low + 1.0;
    range.high += 0.05 * (range.high - range.low);
  }
  return range;
}

// Places of hours and values in the drawing.
struct Axes {
  double last_hour;
  ValueRange range;

  [[nodiscard]] double x(double hour) const {
    return kLeft + (kWidth - kLeft - kRight) * (last_hour > 0.0 ? hour / last_hour : 0.0);
  }
  [[nodiscard]] double y(double value) const {
    return kTop + (kHeight - kTop - kBottom) * (range.high - value) / (range.high - range.low);
  }
};

std::string draw_grid(const Chart& chart, const Axes& axes) {
  std::string svg;
  const auto [low, high] = axes.range;
  for (const double tick :
       ticks(low, high, chart.is_logarithmic ? static_cast<int>(high - low) : 5)) {
    const double shown = chart.is_logarithmic ? std::pow(10.0, tick) : tick;
    svg += fmt::format(
        "<line class=\"grid\" x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/><text "
        "x=\"{:.1f}\" y=\"{:.1f}\" class=\"y\">{:g}</text>",
        kLeft, kWidth - kRight, axes.y(tick), axes.y(tick), kLeft - 6, axes.y(tick) + 4, shown);
  }
  for (const double tick : ticks(0.0, std::max(axes.last_hour, 1e-3), 8)) {
    svg += fmt::format(R"(<text x="{:.1f}" y="{:.1f}" class="x">{:g} h</text>)", axes.x(tick),
                       kHeight - 8, tick);
  }
  return svg;
}

std::string_view colour_of(std::size_t curve) { return kColours[curve % kColours.size()]; }

std::string draw_curve(const Chart& chart, std::size_t index, const std::vector<double>& hours,
                       const Axes& axes) {
  const Curve& curve = chart.curves[index];
  const std::string_view colour = colour_of(index);
  std::string points;
  std::string dots;
  for (std::size_t k = 0; k < curve.values.size(); ++k) {
    const Value& value = curve.values[k];
    if (!is_shown(chart, value)) continue;
    const double at = axes.y(chart.is_logarithmic ? std::log10(*value) : *value);
    points += fmt::format("{:.1f},{:.1f} ", axes.x(hours[k]), at);
    if (hours.size() <= 60) {
      dots += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="2" fill="{}"/>)", axes.x(hours[k]),
                          at, colour);
    }
  }
  return fmt::format(R"(<polyline points="{}" stroke="{}"/>)", points, colour) + dots;
}

// Draws curves over the hours of the middle of each interval.
std::string draw(const Chart& chart, const std::vector<double>& hours, double last_hour) {
  std::string svg = fmt::format(
      "<figure><figcaption><b>{}</b>{}. {}</figcaption>", escaped(chart.title),
      chart.unit.empty() ? "" : fmt::format(" [{}]", chart.unit), escaped(chart.explanation));
  const ValueRange values = values_of(chart);
  if (values.is_empty()) return svg + "<p class=\"none\">Nothing was measured yet.</p></figure>";
  const Axes axes{.last_hour = last_hour, .range = axis_of(chart, values)};
  svg += fmt::format(R"(<svg viewBox="0 0 {} {}" role="img">)", kWidth, kHeight);
  svg += draw_grid(chart, axes);
  for (std::size_t i = 0; i < chart.curves.size(); ++i) svg += draw_curve(chart, i, hours, axes);
  svg += "</svg><p class=\"legend\">";
  for (std::size_t i = 0; i < chart.curves.size(); ++i) {
    svg += fmt::format("<span><i style=\"background:{}\"></i>{}</span> ", colour_of(i),
                       escaped(chart.curves[i].name));
  }
  return svg + "</p></figure>";
}

using OfJoint = std::function<Value(const Tally& tally, const JointTally& joint)>;

// One curve per joint.
std::vector<Curve> joint_curves(const History& history, const OfJoint& value) {
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < history.num_joints(); ++i) {
    Curve curve{.name = history.owner().joints[i], .values = {}};
    for (const Interval& interval : history.intervals()) {
      curve.values.push_back(value(interval.tally, interval.tally.joints[i]));
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

Curve curve_of(const History& history, std::string name,
               const std::function<Value(const Tally& tally)>& value) {
  Curve curve{.name = std::move(name), .values = {}};
  for (const Interval& interval : history.intervals())
    curve.values.push_back(value(interval.tally));
  return curve;
}

double microseconds(Nanoseconds time) { return 1e-3 * static_cast<double>(time.count()); }

Value mean_friction(const JointTally& joint) {
  if (joint.passes == 0) return std::nullopt;
  return joint.friction_sum / static_cast<double>(joint.passes);
}

Value error_rms(const Tally& tally, const JointTally& joint) {
  if (tally.steps == 0) return std::nullopt;
  return std::sqrt(joint.error_squares / static_cast<double>(tally.steps));
}

Value pass_error_rms(const JointTally& joint) {
  if (joint.pass_steps == 0) return std::nullopt;
  return std::sqrt(joint.pass_error_squares / static_cast<double>(joint.pass_steps));
}

std::vector<Chart> joint_charts(const History& history) {
  return {
      {.title = "Friction",
       .unit = "Nm",
       .explanation = "Mean of each interval's slow passes: half the difference of the mean motor "
                      "torques forth and back. A joint that rises wears.",
       .curves = joint_curves(
           history, [](const Tally&, const JointTally& joint) { return mean_friction(joint); })},
      {.title = "Tracking error in slow passes",
       .unit = "rad",
       .explanation = "Root of the mean square. Nothing is in the way there: what grows is weight, "
                      "friction or a loose belt.",
       .curves = joint_curves(
           history, [](const Tally&, const JointTally& joint) { return pass_error_rms(joint); })},
      {.title = "Tracking error of all steps",
       .unit = "rad",
       .explanation = "Root of the mean square, with all collisions.",
       .curves = joint_curves(history, error_rms)},
      {.title = "Thermal margin",
       .unit = "",
       .explanation = "The least of each interval: 1 is a cold motor, and below 0.2 its torque is "
                      "limited.",
       .curves = joint_curves(history,
                              [](const Tally& tally, const JointTally& joint) -> Value {
                                if (tally.steps == 0) return std::nullopt;
                                return joint.thermal_margin;
                              })},
  };
}

std::vector<Chart> session_charts(const History& history) {
  const auto per_hour = [](std::uint64_t count, const Tally& tally) -> Value {
    const double hours = hours_of(tally.time);
    if (hours <= 0.0) return std::nullopt;
    return static_cast<double>(count) / hours;
  };
  const auto lateness = [](double fraction) {
    return [fraction](const Tally& tally) -> Value {
      if (tally.lateness.count() == 0) return std::nullopt;
      return microseconds(tally.lateness.quantile(fraction));
    };
  };
  return {
      {.title = "Lateness of the loop",
       .unit = "µs",
       .explanation = "Of the back-end: from the deadline to the beginning of the step. Simulated "
                      "time is never late.",
       .curves = {curve_of(history, "longest",
                           [](const Tally& tally) -> Value {
                             return microseconds(tally.lateness.longest());
                           }),
                  curve_of(history, "99.9 %", lateness(0.999)),
                  curve_of(history, "99 %", lateness(0.99)),
                  curve_of(history, "half", lateness(0.5))},
       .is_logarithmic = true},
      {.title = "Failures, recoveries and collisions",
       .unit = "1/h",
       .explanation = "Failures are ends of sessions that nobody wanted.",
       .curves = {curve_of(
                      history, "failures",
                      [&](const Tally& tally) { return per_hour(tally.all_failures(), tally); }),
                  curve_of(history, "recoveries",
                           [&](const Tally& tally) { return per_hour(tally.recoveries, tally); }),
                  curve_of(history, "collisions",
                           [&](const Tally& tally) { return per_hour(tally.collisions, tally); })},
       .is_logarithmic = true},
  };
}

std::string row(std::string_view name, const std::string& value) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>", escaped(name), escaped(value));
}

std::string counts_table(const History& history) {
  const Tally& total = history.total();
  const auto time = [](Nanoseconds value) { return duration_text(value); };
  std::string table = "<h2>Counts</h2><table>";
  table += row("steps", count_text(total.steps));
  table += row("time, with pauses and homing", span_text(total.time));
  table += row("starts of this program", count_text(history.starts()));
  table += row("sessions", count_text(total.sessions));
  for (std::size_t i = 0; i < kNumMoves; ++i) {
    table +=
        row(fmt::format("moves: {}", name_of(static_cast<Move>(i))), count_text(total.moves[i]));
  }
  table += row("slow passes that a joint did not follow", count_text(total.passes_failed));
  table += row("collisions", count_text(total.collisions));
  table += row("failures", count_text(total.all_failures()));
  table += row("recoveries", count_text(total.recoveries));
  if (total.recoveries > 0) {
    table += row("time to recover: half, 99 %, longest",
                 fmt::format("{}, {}, {}", time(total.recovery_times.quantile(0.5)),
                             time(total.recovery_times.quantile(0.99)),
                             time(total.recovery_times.longest())));
  }
  table += row("observations lost to us", count_text(total.lost_observations));
  table += row("messages lost by the driver", count_text(total.lost_frames));
  table += row("late steps: this program, scheduler, driver",
               fmt::format("{}, {}, {}", count_text(total.late_steps_of_user),
                           count_text(total.late_steps_of_scheduler),
                           count_text(total.late_steps_of_driver)));
  table += row("skipped ticks", count_text(total.skipped_ticks));
  table += row("actions that came too late", count_text(total.discarded_actions));
  table += row("actions that were not fit", count_text(total.rejected_actions));
  return table + "</table>";
}

std::string failures_table(const History& history) {
  std::string table = "<h2>Failures by kind</h2>";
  if (history.total().all_failures() == 0) return table + "<p class=\"none\">None.</p>";
  table += "<table><tr><th>kind</th><th>count</th><th>the last one</th></tr>";
  for (std::size_t i = 0; i < kNumFailures; ++i) {
    if (history.total().failures[i] == 0) continue;
    table += fmt::format("<tr><th>{}</th><td>{}</td><td class=\"text\">{}</td></tr>",
                         name_of(static_cast<Failure>(i)), count_text(history.total().failures[i]),
                         escaped(history.last_words()[i]));
  }
  return table + "</table>";
}

std::string reasons_table(const History& history) {
  std::string table = "<h2>Limits by reason</h2>";
  std::string rows;
  for (std::size_t i = 0; i < Tally::kNumReasons; ++i) {
    const std::uint64_t count = history.total().reasons[i];
    if (count == 0) continue;
    rows += fmt::format("<tr><th>{}</th><td>{}</td><td class=\"text\">{}</td></tr>",
                        name_of(all_reasons()[i]), count_text(count),
                        escaped(describe(all_reasons()[i])));
  }
  if (rows.empty()) return table + "<p class=\"none\">None.</p>";
  return table + "<table><tr><th>reason</th><th>steps</th><th>meaning</th></tr>" + rows +
         "</table>";
}

std::string joints_table(const History& history) {
  std::string table =
      "<h2>Joints</h2><table><tr><th>joint</th><th>travel [rad]</th><th>travel [revolutions]</th>"
      "<th>collisions</th><th>friction, mean [Nm]</th><th>friction, most [Nm]</th>"
      "<th>error in slow passes [rad]</th><th>error [rad]</th><th>least thermal margin</th></tr>";
  const auto cell = [](const Value& value, const char* format) {
    return value ? fmt::format(fmt::runtime(format), *value) : "-";
  };
  const Tally& total = history.total();
  for (std::size_t i = 0; i < history.num_joints(); ++i) {
    const JointTally& joint = total.joints[i];
    table += fmt::format(
        "<tr><th>{}</th><td>{:.0f}</td><td>{:.0f}</td><td>{}</td><td>{}</td><td>{:.4f}</td>"
        "<td>{}</td><td>{}</td><td>{:.2f}</td></tr>",
        escaped(history.owner().joints[i]), joint.travel, joint.travel / (2 * std::numbers::pi),
        count_text(joint.collisions), cell(mean_friction(joint), "{:.4f}"), joint.friction_most,
        cell(pass_error_rms(joint), "{:.4f}"), cell(error_rms(total, joint), "{:.4f}"),
        joint.thermal_margin);
  }
  return table + "</table>";
}

// The newest checks of whether the robot still is as it was identified.
std::string checks_table(const std::filesystem::path& checks) {
  constexpr std::size_t kMost = 50;
  std::string table = "<h2>Is it as it was identified?</h2>";
  std::deque<std::string> rows;
  std::ifstream file(checks);
  for (std::string line; std::getline(file, line);) {
    const nlohmann::json check = nlohmann::json::parse(line, nullptr, false);
    if (!check.is_object()) continue;
    const auto when = check.find("time");
    const auto changed = check.find("changed");
    if (when == check.end() || !when->is_string()) continue;
    if (changed == check.end() || !changed->is_array()) continue;
    std::string found;
    for (const nlohmann::json& change : *changed)
      if (change.is_string()) found += escaped(change.get<std::string>()) + "<br>";
    rows.push_back(fmt::format("<tr><th>{}</th><td class=\"text\">{}</td></tr>",
                               escaped(when->get<std::string>()),
                               found.empty() ? "nothing" : found));
    if (rows.size() > kMost) rows.pop_front();
  }
  if (rows.empty()) return table + "<p class=\"none\">No check yet.</p>";
  table += "<table><tr><th>when</th><th>what has changed</th></tr>";
  for (const std::string& row : rows) table += row;
  return table + "</table>";
}

constexpr std::string_view kStyle = R"(
body{font:15px/1.45 system-ui,sans-serif;max-width:960px;margin:1.5em auto;padding:0 1em;color:#222;background:#fff}
h1{font-size:1.5em;margin-bottom:.2em}h2{font-size:1.15em;margin-top:1.6em}
.state{padding:.5em .8em;border-left:5px solid #117733;background:#eef6f0}
.hand{border-color:#CC3311;background:#fbeae6}.over{border-color:#888;background:#f2f2f2}
figure{margin:1.4em 0}figcaption{margin-bottom:.3em}svg{width:100%;height:auto;border:1px solid #ddd}
svg text{font-size:11px;fill:#555}svg .y{text-anchor:end}svg .x{text-anchor:middle}
svg .grid{stroke:#e8e8e8}svg polyline{fill:none;stroke-width:1.6}
.legend{margin:.2em 0;font-size:13px}.legend span{margin-right:.9em;white-space:nowrap}
.legend i{display:inline-block;width:.9em;height:.9em;margin-right:.3em;vertical-align:-.1em}
table{border-collapse:collapse;font-size:13.5px}th{text-align:left;font-weight:500}
th,td{padding:.15em .8em .15em 0;border-bottom:1px solid #eee;vertical-align:top}td{text-align:right}
td.text{text-align:left;color:#555}.none{color:#777}
)";

}  // namespace

std::string make_page(const History& history, const PageState& state) {
  std::vector<double> hours;
  Nanoseconds passed{0};
  for (const Interval& interval : history.intervals()) {
    hours.push_back(hours_of(passed + interval.tally.time / 2));
    passed += interval.tally.time;
  }
  const std::string title = "Health of " + escaped(history.owner().robot);
  std::string page = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">";
  // A page that is written no more need not be read again.
  if (!state.is_over) page += R"(<meta http-equiv="refresh" content="60">)";
  page += fmt::format("<title>{}</title><style>{}</style></head><body><h1>{}</h1>", title, kStyle,
                      title);
  page += fmt::format("<p class=\"state {}\">{}</p>",
                      state.needs_operator ? "hand"
                      : state.is_over      ? "over"
                                           : "",
                      escaped(state.state));
  const std::string since =
      history.intervals().empty() ? "now" : date_text(history.intervals().front().begin);
  page += fmt::format(
      "<p>{} steps in {}, since {}; written {}. Each point is an interval of at least {}.</p>",
      count_text(history.total().steps), span_text(history.total().time), since,
      date_text(state.now), span_text(history.length()));
  for (const auto& charts : {joint_charts(history), session_charts(history)}) {
    for (const Chart& chart : charts) page += draw(chart, hours, hours_of(passed));
  }
  page += counts_table(history) + failures_table(history) + reasons_table(history) +
          joints_table(history);
  if (!state.checks.empty()) page += checks_table(state.checks);
  return page + "</body></html>\n";
}

}  // namespace trifinger::apps
