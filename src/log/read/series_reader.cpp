// SPDX-License-Identifier: BSD-3-Clause
#include "log/read/series_reader.hpp"

#include <algorithm>
#include <cstring>
#include <memory>
#include <mutex>
#include <utility>

#include "base/moved.hpp"
#include "base/suggestion.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::log {

using namespace detail;

namespace detail {
namespace {

// Returns which part of a message holds the element of `series`.
std::size_t part_of(const StreamMessage& found, Series series) {
  if (found.stream.is_companion) return 1;
  switch (series) {
    case Series::kDesiredAction:
      return StepPart::kDesiredAction;
    case Series::kAppliedAction:
      return StepPart::kAppliedAction;
    case Series::kStatus:
      return StepPart::kStatus;
    default:
      return StepPart::kObservation;
  }
}

}  // namespace

const ElementDescription& element_of(const Stream& stream, Series series) {
  static const ElementDescription nothing;
  if (series == Series::kHolding || series == Series::kStopping ||
      (stream.is_companion && series != Series::kObservation)) {
    throw InvalidArgument("a log has no series '" + std::string(name_of(series)) + "' of " +
                          (stream.is_companion ? "companion '" : "robot '") + stream.name + "'");
  }
  if (stream.channel == nullptr) return nothing;
  switch (series) {
    case Series::kDesiredAction:
      return stream.channel->types.action;
    case Series::kAppliedAction:
      return stream.channel->types.applied_action;
    case Series::kStatus:
      return stream.channel->status;
    default:
      return stream.channel->types.observation;
  }
}

ColumnReader::ColumnReader(const Stream& stream, const Column& column) : series_(column.series) {
  const ElementDescription& whole = element_of(stream, column.series);
  element_ = column.fields.empty() ? whole : select(whole, column.fields);
  if (element_ == whole) return;
  scratch_.resize(whole.size());
  for (const FieldDescription& field : element_.fields()) {
    const std::size_t size = field.count() * size_of(field.type);
    copies_.push_back({whole.find(field.name)->offset, field.offset, size});
  }
}

void ColumnReader::read(const StreamMessage& found, std::byte* element) {
  const std::size_t part = part_of(found, series_);
  const MessageLayout& layout = *found.channel.layout;
  if (scratch_.empty()) {
    layout.decode(found.message.data, part, element);
    return;
  }
  layout.decode(found.message.data, part, scratch_.data());
  for (const Copy& copy : copies_) {
    std::memcpy(element + copy.to, scratch_.data() + copy.from, copy.size);
  }
}

std::string list_of(const std::vector<std::string_view>& names) {
  return names.empty() ? "none" : quoted_list(names, "and");
}

}  // namespace detail

ElementDescription select(const ElementDescription& element,
                          const std::vector<std::string>& fields) {
  const auto is_meant = [](const FieldDescription& field, const std::string& name) {
    return field.name == name || field.name.starts_with(name + ".");
  };
  for (const std::string& name : fields) {
    if (std::ranges::any_of(element.fields(),
                            [&](const FieldDescription& field) { return is_meant(field, name); })) {
      continue;
    }
    std::vector<std::string_view> names;
    for (const FieldDescription& field : element.fields()) names.push_back(field.name);
    throw InvalidArgument("there is no field '" + name + "'; there are " + list_of(names));
  }
  std::vector<FieldDescription> selected;
  std::size_t offset = 0;
  for (const FieldDescription& field : element.fields()) {
    if (std::ranges::none_of(fields,
                             [&](const std::string& name) { return is_meant(field, name); })) {
      continue;
    }
    selected.push_back(field);
    selected.back().offset = offset;
    offset += field.count() * size_of(field.type);
  }
  return ElementDescription(std::move(selected));
}

class SeriesReader::Implementation {
 public:
  Implementation(std::shared_ptr<LogData> data, const Stream& stream,
                 const std::vector<Column>& columns, TimeIndex first, TimeIndex last)
      : data_(std::move(data)), stream_(&stream) {
    const std::scoped_lock lock(data_->mutex);
    for (const Column& column : columns) columns_.emplace_back(stream, column);
    const auto [begin, end] = data_->range(stream);
    next_ = std::max(first, begin);
    last_ = std::min(last, end);
    if (next_ >= last_) return;
    chunk_ = data_->find_chunk(stream, [this](const Run& run) { return run.last >= next_; });
    auto rows = static_cast<std::uint64_t>(last_ - next_);
    for (const Gap& gap : stream.gaps) {
      const TimeIndex missing = std::min(gap.last + 1, last_) - std::max(gap.first, next_);
      rows -= std::min(rows, static_cast<std::uint64_t>(std::max<TimeIndex>(missing, 0)));
    }
    max_rows_ = std::min<std::size_t>(rows, data_->max_messages(stream));
  }

  [[nodiscard]] const ElementDescription& element(std::size_t i) const {
    return columns_.at(i).element();
  }
  [[nodiscard]] std::size_t max_rows() const noexcept { return max_rows_; }

  std::size_t read(std::size_t count, const Rows& rows) {
    const std::scoped_lock lock(data_->mutex);
    if (rows.columns.size() > columns_.size()) {
      throw InvalidArgument("there are " + std::to_string(columns_.size()) + " columns");
    }
    std::size_t done = 0;
    bool is_full = count == 0;
    const auto take = [&](const StreamMessage& found) {
      if (&found.stream != stream_ || found.is_end() || found.index < next_) return true;
      is_full = done == count || found.index >= last_;
      if (is_full) return false;
      if (rows.indices != nullptr) rows.indices[done] = found.index;
      if (rows.times != nullptr) rows.times[done] = found.time();
      for (std::size_t i = 0; i < rows.columns.size(); ++i) {
        auto* const elements = static_cast<std::byte*>(rows.columns[i]);
        if (elements != nullptr) {
          columns_[i].read(found, elements + done * columns_[i].element().size());
        }
      }
      next_ = found.index + 1;
      ++done;
      return true;
    };
    while (!is_full && next_ < last_ && chunk_ < data_->num_chunks()) {
      const auto is_of_use = [this](const Run& run) {
        return run.stream == stream_ && !run.is_end && run.last >= next_;
      };
      if (std::ranges::any_of(data_->runs(chunk_), is_of_use)) {
        data_->visit(chunk_, take);
        if (is_full) break;
      } else if (data_->is_behind(*stream_, chunk_)) {
        next_ = last_;
      }
      ++chunk_;
    }
    return done;
  }

 private:
  std::shared_ptr<LogData> data_;
  const Stream* stream_;
  std::vector<ColumnReader> columns_;
  TimeIndex next_{0};  // first index not yet read
  TimeIndex last_{0};
  std::size_t chunk_{0};
  std::size_t max_rows_{0};
};

SeriesReader::SeriesReader(std::shared_ptr<LogData> log, const Stream& stream,
                           const std::vector<Column>& columns, TimeIndex first, TimeIndex last)
    : implementation_(
          std::make_unique<Implementation>(std::move(log), stream, columns, first, last)) {}
SeriesReader::SeriesReader(SeriesReader&&) noexcept = default;
SeriesReader& SeriesReader::operator=(SeriesReader&&) noexcept = default;
SeriesReader::~SeriesReader() = default;

const ElementDescription& SeriesReader::element(std::size_t i) const {
  return checked(implementation_)->element(i);
}
std::size_t SeriesReader::max_rows() const noexcept { return checked(implementation_)->max_rows(); }
std::size_t SeriesReader::read(std::size_t count, const Rows& rows) {
  return checked(implementation_)->read(count, rows);
}

}  // namespace trifinger::log
