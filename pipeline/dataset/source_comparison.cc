#include "pipeline/dataset/source_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/half.h"
#include "manifests/values/outlines.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/placement.h"
#include "manifests/values/still_motion.h"
#include "manifests/values/text.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/errors.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/source_flow.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/frames/sources/still_clips.h"
#include "stages/labels/label_mapping.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/shard_rows.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {
namespace {

// Another compiler's last bits: of a place in the volume, whose terms may cancel, and of what is
// far away from the image.
bool same(double a, double b) {
  return std::abs(a - b) <= 1e-9 + 1e-14 * std::abs(b) || (std::isnan(a) && std::isnan(b));
}
bool same(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }
bool same(Half a, Half b) {  // rounded from such a number of 64 bits: the next one, too
  return std::abs(a.bits - b.bits) <= 1 || (is_nan(a) && is_nan(b));
}
// Of bytes, those of outlines: last bits of 64 can lie between two numbers of 32.
bool same(const std::vector<char>& a, const std::vector<char>& b) {
  if (a == b) return true;
  const auto first = read_outline({a.data(), a.size()});
  const auto second = read_outline({b.data(), b.size()});
  const auto same_corner = [](Point p, Point q) {
    const auto near = [](double x, double y) {
      return std::abs(x - y) <= 1e-9 + std::numeric_limits<float>::epsilon() * std::abs(y);
    };
    return near(p.x, q.x) && near(p.y, q.y);
  };
  return first && second &&
         std::ranges::equal(first->rings, second->rings, [&](const auto& ring, const auto& other) {
           return std::ranges::equal(ring, other, same_corner);
         });
}
template <class Element>
bool same(const Element& a, const Element& b) {
  return a == b;
}

std::string value_text(const std::string& text) { return '"' + text + '"'; }
std::string value_text(const std::vector<char>& bytes) {
  return count_text(std::ssize(bytes), "byte");
}
std::string value_text(Half number) { return fmt::format("{}", from_half(number.bits)); }
template <class Number>
std::string value_text(Number number) {
  return fmt::format("{}", +number);  // of 8 bits: a number, no letter
}

/// What an optional column has where a row has no value.
template <class Element>
Element no_value() {
  if constexpr (std::is_floating_point_v<Element>) return std::numeric_limits<Element>::quiet_NaN();
  if constexpr (std::is_same_v<Element, Half>) return kHalfNan;
  if constexpr (std::is_same_v<Element, std::uint8_t>) return 0;
  if constexpr (std::is_integral_v<Element>) return -1;
  return Element();
}

/// The annotation, or what is wrong with it.
Outcome<Annotation> read_annotation(const Dataset& dataset, const std::string& label_key) {
  try {
    return dataset.annotation(label_key);
  } catch (const LimitReached&) {  // which says nothing of the label
    throw;
  } catch (const std::exception& error) {  // a key that the source does not know any more
    return SampleFault{error_line(error)};
  }
}

}  // namespace

SourceComparison::SourceComparison(JobManifest manifest,
                                   const std::vector<std::optional<ClassNames>>& stored)
    : manifest_(std::move(manifest)), reader_(manifest_.directory, manifest_.image, 1) {
  for (const SourceSpec& source : manifest_.sources) {
    try {
      datasets_.push_back(open_dataset(source, manifest_.directory));
    } catch (const std::exception& error) {
      datasets_.push_back(nullptr);
      notes_.push_back("labels of source " + source.root + " not compared: " + error_line(error));
    }
  }
  make_clips(manifest_, datasets_);
  number_classes(manifest_.sources, datasets_, stored);
}

void SourceComparison::renew_samples(Plan& plan) const {
  eventgan::renew_samples(manifest_, datasets_, plan);
}

std::vector<std::string> SourceComparison::faults(const PlannedShard& planned,
                                                  const ShardReader& reader) {
  const auto& dataset = datasets_.at(static_cast<std::size_t>(planned.source));
  if (!dataset) return {};
  std::vector<std::string> faults =
      schema_faults(reader.header().label_schema, dataset->label_schema());
  if (!faults.empty()) return faults;  // numbers of other names are others
  for (int slot = 0; slot < reader.header().sample_count; ++slot) {
    const ShardSample stored = reader.sample(slot);
    for (const std::string& fault : sample_faults(planned, slot, stored, reader)) {
      faults.push_back(fault + " (sample " + std::to_string(slot) + ", " + stored.sample_id + ")");
    }
    compared_ += stored.valid;
  }
  return faults;
}

std::vector<std::string> SourceComparison::sample_faults(const PlannedShard& shard, int slot,
                                                         const ShardSample& stored,
                                                         const ShardReader& reader) {
  const auto source = static_cast<std::size_t>(shard.source);
  const Dataset& dataset = *datasets_[source];
  const DatasetKind kind = manifest_.sources[source].dataset;
  const PlannedSample& planned = shard.samples.at(static_cast<std::size_t>(slot));
  if (stored.sample_id != planned.sample_id) {
    return {"expected the planned sample " + planned.sample_id + ", got another"};
  }
  // A missing frame that was added since the plan was frozen: its frames were not known then.
  FramePair pair = planned.fault.empty() ? planned.pair : stored.pair;
  if (stored.pair.previous != pair.previous || stored.pair.next != pair.next) {
    return {"expected the frames of the plan, " + pair.previous.path + " and " + pair.next.path +
            ", got " + stored.pair.previous.path + " and " + stored.pair.next.path};
  }
  const std::string place = dataset.label_place(planned.label_key);
  Outcome<Annotation> read = read_annotation(dataset, planned.label_key);
  const std::string of_source = source_key(manifest_.sources, source);
  const PairKey key{manifest_.seed, to_string(kind), planned.sample_id, of_source};
  const FramePair unsettled = pair;
  const auto settle = [&](FramePair settled, const std::vector<Box>& boxes) {
    const bool is_sized = stored.source_size.width > 0;
    settle_motion(manifest_.sources[source].pairs, key, boxes,
                  is_sized ? std::optional(stored.source_size) : std::nullopt, settled);
    return settled;
  };
  std::vector<Box> boxes;
  if (!is_fault(read)) pair = settle(unsettled, boxes = read->boxes);
  // Labels that could not be read when a sample was quarantined decided nothing, or were none.
  const auto is_of_quarantined = [&](const std::optional<ImageMotion>& motion) {
    return motion == unsettled.motion || motion == settle(unsettled, {}).motion;
  };
  if (stored.pair.motion != pair.motion &&
      (stored.valid || !is_of_quarantined(stored.pair.motion))) {
    return {"expected the motion of the plan, got another"};
  }
  if (!stored.valid) {
    // What could not be read then may have been mended meanwhile; what was kept must be right.
    if (is_fault(read) || stored.annotation.original.empty() ||
        read->original == stored.annotation.original) {
      return {};
    }
    return {"expected the annotation as it is in " + place + ", got other bytes"};
  }
  if (is_fault(read)) {
    return {"expected the annotation that the shard holds, got none: " + read.fault().reason};
  }
  ImageSizes& sizes = dataset.image_sizes() ? *dataset.image_sizes() : sizes_;
  const auto made = dataset.made_size(planned.label_key);
  const Outcome<ImageSize> size =
      made ? Outcome<ImageSize>(*made)
      : has_events(kind)
          ? Outcome<ImageSize>(dataset.sensor_size(planned.label_key))
          : sizes.of(resolve(manifest_, stored.pair.next.path), orientation_of(kind));
  if (!is_fault(size) && *size != stored.source_size) {
    return {"expected a source size of " + to_string(*size) + " as in " + stored.pair.next.path +
            ", got " + to_string(stored.source_size)};
  }
  if (stored.source_size.height <= 0 || stored.source_size.width <= 0) {
    return {"expected a source size, got " + to_string(stored.source_size)};
  }
  Placement placement;
  try {
    placement = eventgan::place(stored.source_size, manifest_.image, stored.pair);
  } catch (const std::invalid_argument& error) {  // of a still
    return {error.what()};
  }
  const std::array<double, 6> map = placement.source_to_volume();
  if (placement.volume != reader.header().volume.size ||
      !std::ranges::equal(map, stored.source_to_volume,
                          [](double a, double b) { return same(a, b); })) {
    return {"expected source_to_volume of an image of " + to_string(stored.source_size) +
            ", got another map"};
  }
  auto& annotation = *read;
  Outcome<VolumeLabels> mapped = map_labels(annotation, placement, place);
  if (is_fault(mapped)) {
    return {"expected the annotation that the shard holds, got an invalid one: " +
            mapped.fault().reason};
  }
  ShardSample expected;
  expected.sample_id = planned.sample_id;
  expected.sequence = planned.sequence;
  expected.origin = frame_origin(kind, planned.sequence);
  expected.pair = pair;
  if (has_events(kind) && std::isnan(pair.previous.time_s)) {  // its events tell
    const Outcome<EventWindow> read_window = dataset.events(planned.label_key);
    if (is_fault(read_window)) {
      return {"expected the events that the shard was made from, got none: " +
              read_window.fault().reason};
    }
    read_window->tell_times(expected.pair);
  }
  expected.source_size = placement.source;
  expected.source_to_volume = map;
  if (const auto threshold = pair_threshold(manifest_.generator, key)) {
    expected.threshold = threshold->mean;
  }
  expected.tiles = stored.tiles;
  expected.flow = stored.flow;
  const SourceSpec& spec = manifest_.sources[source];
  if (spec.flow && !spec.pairs.stills) {
    Outcome<PixelFlow> flow = true_flow(dataset, planned.label_key, placement);
    if (is_fault(flow)) return {"expected its flow, got none: " + flow.fault().reason};
    expected.flow = *std::move(flow);
  } else if (spec.flow) {
    Outcome<MadePair> parts = dataset.made_pair(planned.label_key);
    if (is_fault(parts))
      return {"expected the flow of its still, got none: " + parts.fault().reason};
    FramePair still = pair;
    if (!parts->poses.empty()) {
      still.poses = std::move(parts->poses);
      boxes = std::move(parts->boxes);
    }
    Outcome<PreparedPair> prepared =
        reader_.read(still, orientation_of(kind), spec.every, boxes, {}, true);
    if (!is_fault(prepared)) expected.flow = std::move(prepared->flow);
  }
  expected.annotation = std::move(annotation);
  expected.labels = std::move(*mapped);
  ShardHeader header = reader.header();
  header.dataset = to_string(kind);
  return row_differences(header, reader.tables(), slot, expected, place);
}

std::vector<std::string> schema_faults(const LabelSchema& stored, const LabelSchema& source) {
  using Names = std::vector<std::string>;
  std::vector<std::string> faults;
  const auto expect = [&](const char* what, const Names& expected, const Names& got) {
    if (expected == got) return;
    faults.push_back(fmt::format("expected the {} of the source, {}, got {}", what,
                                 fmt::join(expected, ", "), fmt::join(got, ", ")));
  };
  Names classes = source.class_names;
  classes.resize(std::min(classes.size(), stored.class_names.size()));
  expect("class_names", classes, stored.class_names);
  expect("joint_names", source.joint_names, stored.joint_names);
  expect("joint_aliases", source.joint_aliases, stored.joint_aliases);
  return faults;
}

std::vector<std::string> row_differences(const ShardHeader& header, const ShardTables& stored,
                                         int slot, const ShardSample& expected,
                                         const std::string& place) {
  const auto row = static_cast<std::size_t>(slot);
  if (!std::ranges::equal(stored.original[row], expected.annotation.original)) {
    return {"expected the annotation as it is in " + place + ", got other bytes"};
  }
  ShardTables wanted;
  append_row(header, expected, wanted);
  std::vector<std::string> differences;
  const auto rows_of = [&](const std::vector<std::int64_t>& offsets) {
    return static_cast<std::size_t>(offsets[row + 1] - offsets[row]);
  };
  const auto expect_rows = [&](const char* what, std::size_t count, std::size_t got) {
    if (count == got) return;
    differences.push_back(fmt::format("expected {}, as in {}, got {}",
                                      count_text(std::int64_t(count), what), place, got));
  };
  const std::size_t boxes = expected.labels.boxes.size();
  const std::size_t persons = expected.labels.persons.size();
  expect_rows("box", boxes, rows_of(stored.boxes.offsets));
  expect_rows("person", persons, rows_of(stored.poses.offsets));
  if (!differences.empty()) return differences;

  std::vector<const void*> columns;  // of `wanted`; the walk below takes them in the same order
  visit_columns(wanted, header,
                [&](const ColumnSpec&, const auto& column) { columns.push_back(&column); });
  auto next = columns.begin();
  visit_columns(stored, header, [&](const ColumnSpec& spec, const auto& column) {
    using Column = std::remove_cvref_t<decltype(column)>;
    const auto& expected_column = *static_cast<const Column*>(*next++);
    const std::string_view path = spec.path;
    const bool is_generated = path.starts_with("/events/");
    const bool is_of_pair = path.starts_with("/pairs/");
    const bool is_absent = column.empty() && expected_column.empty();
    if (is_generated || is_absent || spec.rows == Rows::kOffsets) return;
    std::size_t first = row;
    std::size_t count = 1;
    const char* kind = nullptr;
    if (spec.rows == Rows::kBoxes) {
      first = static_cast<std::size_t>(stored.boxes.offsets[row]);
      count = boxes;
      kind = "box";
    } else if (spec.rows == Rows::kPersons) {
      first = static_cast<std::size_t>(stored.poses.offsets[row]);
      count = persons;
      kind = "person";
    }
    const std::size_t width =
        std::accumulate(spec.inner.begin(), spec.inner.end(), std::size_t{1}, std::multiplies());
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t i = 0; i < width; ++i) {
        using Element = typename Column::value_type;
        const Element got = column.empty() ? no_value<Element>() : column[(first + k) * width + i];
        const Element want =
            expected_column.empty() ? no_value<Element>() : expected_column[k * width + i];
        if (same(want, got)) continue;
        differences.push_back(fmt::format("expected {} in {}{} according to {}, got {}",
                                          value_text(want), spec.path,
                                          kind == nullptr ? "" : fmt::format(" of {} {}", kind, k),
                                          is_of_pair ? "the plan" : place, value_text(got)));
        break;  // one number of a row tells enough
      }
    }
  });
  return differences;
}

}  // namespace eventgan
