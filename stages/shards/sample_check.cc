#include "stages/shards/sample_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>
#include <type_traits>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/placement.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {
namespace {

constexpr double kTolerance_px = 0.01;

// Far away from the image rounding alone is more than the tolerance.
bool near(double a, double b) {  // false for NaN
  return std::abs(a - b) <= kTolerance_px + 1e-12 * std::abs(b);
}

using Row = std::span<const double>;

bool near(Row a, Row b) {
  return std::ranges::equal(a, b, [](double x, double y) { return near(x, y); });
}

/// `/pairs/source_to_volume` as a map of the rows of columns (manifests/values/placement.h has the
/// equations).
class SourceToVolume {
 public:
  explicit SourceToVolume(const std::array<double, 6>& matrix) : m_(matrix) {}

  std::vector<double> operator()(Mapped how, Row row) const {
    std::vector<double> mapped(row.begin(), row.end());
    switch (how) {
      case Mapped::kPoints:
        for (std::size_t i = 0; i < mapped.size(); i += 2) {
          if (Point{mapped[i], mapped[i + 1]} != kMissingPoint) move(mapped[i], mapped[i + 1]);
        }
        break;
      case Mapped::kEdges:
      case Mapped::kEdgesIfAny:
        // An edge lies half a pixel before the centre of the pixel with its number, here and there.
        for (double& edge : mapped) edge -= 0.5;
        for (std::size_t i = 0; i < mapped.size(); i += 2) move(mapped[i], mapped[i + 1]);
        for (double& edge : mapped) edge += 0.5;
        break;
      case Mapped::kScale:  // the geometric mean of both axes' scales: one number for a person
        if (mapped[0] >= 0) mapped[0] *= std::sqrt(m_[0] * m_[4]);
        break;
      case Mapped::kCamera:  // focal lengths scale
        mapped[0] *= m_[0];
        mapped[1] *= m_[4];
        move(mapped[2], mapped[3]);
        break;
      case Mapped::kProjection:  // P' = M P: its rows are combined as points' x, y and 1 are
        for (std::size_t i = 0; i < 4; ++i) {
          mapped[i] = m_[0] * row[i] + m_[1] * row[4 + i] + m_[2] * row[8 + i];
          mapped[4 + i] = m_[3] * row[i] + m_[4] * row[4 + i] + m_[5] * row[8 + i];
        }
        break;
      case Mapped::kNot:
        break;
    }
    return mapped;
  }

 private:
  void move(double& x, double& y) const {
    const Point p{x, y};
    x = m_[0] * p.x + m_[1] * p.y + m_[2];
    y = m_[3] * p.x + m_[4] * p.y + m_[5];
  }

  const std::array<double, 6>& m_;
};

/// A box [left, top, right, bottom] cut to another.
std::array<double, 4> cut(Row box, const std::array<double, 4>& area) {
  return {std::clamp(box[0], area[0], area[2]), std::clamp(box[1], area[1], area[3]),
          std::clamp(box[2], area[0], area[2]), std::clamp(box[3], area[1], area[3])};
}

/// Whether an outline in float32, which lies within `outline`, and a box touch.
bool meet(const Rectangle& outline, const Rectangle& box) {
  const auto before = [](double a, double b) {
    return a <= b + kTolerance_px + std::numeric_limits<float>::epsilon() * std::abs(a);
  };
  return before(outline.left, box.right) && before(box.left, outline.right) &&
         before(outline.top, box.bottom) && before(box.top, outline.bottom);
}

/// The rows of one sample in the columns of floats that a shard has.
class SampleRows {
 public:
  SampleRows(const ShardHeader& header, const ShardTables& tables, int slot) {
    const auto i = static_cast<std::size_t>(slot);
    const auto ragged = [i](const std::vector<std::int64_t>& offsets) {
      return std::pair(static_cast<std::size_t>(offsets[i]),
                       static_cast<std::size_t>(offsets[i + 1]));
    };
    visit_columns(tables, header, [&](const ColumnSpec& spec, const auto& column) {
      using Element = typename std::remove_cvref_t<decltype(column)>::value_type;
      if constexpr (std::is_floating_point_v<Element>) {
        if (column.empty()) return;
        const auto [first, end] = spec.rows == Rows::kBoxes     ? ragged(tables.boxes.offsets)
                                  : spec.rows == Rows::kPersons ? ragged(tables.poses.offsets)
                                                                : std::pair(i, i + 1);
        columns_.push_back(
            {spec,
             {column.data() + first * spec.width(), column.data() + end * spec.width()},
             end - first});
      }
    });
  }

  /// Calls each(spec, name, k, row) for every row: box k's, person k's, or the sample's. name: "box
  /// of person 1".
  template <class Each>
  void visit(const Each& each) const {
    for (const Column& column : columns_) {
      const ColumnSpec& spec = column.spec;
      for (std::size_t k = 0; k < column.rows; ++k) {
        std::string name(spec.name());
        if (spec.rows == Rows::kBoxes) name += " of box " + std::to_string(k);
        if (spec.rows == Rows::kPersons) name += " of person " + std::to_string(k);
        each(spec, name, k, Row(column.numbers).subspan(k * spec.width(), spec.width()));
      }
    }
  }

  /// Row k of a column; empty if the column is not there.
  Row row(std::string_view group, std::string_view name, std::size_t k) const {
    for (const auto& [spec, numbers, rows] : columns_) {
      if (spec.group() != group || spec.name() != name) continue;
      return Row(numbers).subspan(k * spec.width(), spec.width());
    }
    return {};
  }

 private:
  struct Column {
    ColumnSpec spec;
    std::vector<double> numbers;
    std::size_t rows;
  };
  std::vector<Column> columns_;
};

bool is_nan(double number) { return std::isnan(number); }

/// The first number that the column's rule does not allow.
std::optional<double> wrong_number(const ColumnSpec& spec, Row row) {
  if (spec.numbers == SoundNumbers::kAny || row.empty()) return std::nullopt;
  const bool is_each = spec.numbers == SoundNumbers::kFiniteOrNoneEach;
  const std::size_t size = is_each ? spec.inner.back() : row.size();
  for (; !row.empty(); row = row.subspan(size)) {
    const Row part = row.first(size);
    if (spec.numbers != SoundNumbers::kFinite && std::ranges::all_of(part, is_nan)) continue;
    for (const double number : part) {
      if (!std::isfinite(number)) return number;
    }
  }
  return std::nullopt;
}

/// Whether a row stands for a value: not if it is not there, or is all NaN, or a head box of -1.
bool has_value(const ColumnSpec& spec, Row row) {
  if (spec.mapped.how == Mapped::kEdgesIfAny) {
    return !std::ranges::all_of(row, [](double edge) { return edge == -1; });
  }
  return !std::ranges::all_of(row, is_nan);
}

/// `number`: which of a row's innermost lines of two, in "joints[2] of person 1".
std::string part_name(const ColumnSpec& spec, const std::string& name, std::size_t number) {
  const std::size_t size = spec.name().size();
  return name.substr(0, size) + "[" + std::to_string(number) + "]" + name.substr(size);
}

}  // namespace

Rectangle shown_area(const ShardSample& sample, ImageSize volume) {
  const auto border = sample.pair.motion ? still_border(sample.source_size, sample.pair)
                                         : std::optional<ImageSize>();
  const auto [rows, columns] = border.value_or(ImageSize{});
  const auto [height, width] = sample.source_size;
  const double seen[] = {static_cast<double>(columns), static_cast<double>(rows),
                         static_cast<double>(width - columns), static_cast<double>(height - rows)};
  const std::array<double, 4> shown =
      cut(SourceToVolume(sample.source_to_volume)(Mapped::kEdges, seen),
          {0, 0, static_cast<double>(volume.width), static_cast<double>(volume.height)});
  return {shown[0], shown[1], shown[2], shown[3]};
}

namespace {

/// None, or that of the first pixel whose flow is not as shard_tables.h has it.
std::optional<std::string> flow_fault(const ShardTables& tables, const ShardSample& sample,
                                      ImageSize size) {
  if (tables.flow.empty() != tables.flow_valid.empty()) {
    return "expected both flow and flow_valid or neither, got one";
  }
  const PixelFlow& flow = sample.flow;
  const double sign = sample.pair.label_position == 0 ? 1 : -1;  // to the other image
  const std::size_t pixels = flow.valid.size();
  for (std::size_t i = 0; i < pixels; ++i) {
    const float dx = flow.px[i], dy = flow.px[pixels + i];
    if (!std::isfinite(dx) || !std::isfinite(dy)) return "expected finite flow, got other numbers";
    if (flow.valid[i] > 1) return "expected flow_valid of 0 or 1, got another number";
    const auto is_inside = [&](std::size_t pixel, float by, int side) {
      const double at = static_cast<double>(pixel) + sign * by;
      const double rounding = 0x1p-11 * std::abs(by) + 0x1p-25;  // of float16
      return at >= -rounding && at <= side - 1 + rounding;
    };
    if (flow.valid[i] != 0 && !(is_inside(i % size.width, dx, size.width) &&
                                is_inside(i / size.width, dy, size.height))) {
      return "expected valid flow to lead to a place in the volume, got one beyond it";
    }
  }
  return std::nullopt;
}

}  // namespace

std::vector<std::string> label_faults(const ShardHeader& header, const ShardTables& tables,
                                      int slot, const ShardSample& sample) {
  std::vector<std::string> faults;
  const SampleRows rows(header, tables, slot);
  // Of a quarantined sample the source's labels of the whole image may be there, as they are.
  const auto is_checked = [&](const ColumnSpec& spec) {
    return sample.valid || spec.rows != Rows::kSamples || spec.group() != "/labels/";
  };
  rows.visit([&](const ColumnSpec& spec, const std::string& name, std::size_t, Row row) {
    const auto wrong = is_checked(spec) ? wrong_number(spec, row) : std::nullopt;
    if (wrong) {
      faults.push_back("expected finite numbers in " + name + ", got " + std::to_string(*wrong));
    }
  });
  if (!faults.empty()) return faults;
  const auto expect = [&](bool holds, const std::string& what) {
    if (!holds) faults.push_back("expected " + what + ", got another place");
  };
  const FramePair& pair = sample.pair;
  if (pair.motion && (pair.previous != pair.next || pair.motion->scale <= 0 ||
                      (pair.label_position != 0 && pair.label_position != 1))) {
    faults.emplace_back(
        "expected a motion of scale > 0, label_position 0 or 1, and one image as prev_path, "
        "prev_index, prev_video_frame and next_path, next_index, next_video_frame, got others");
  }
  if (sample.threshold && !(std::isfinite(*sample.threshold) && *sample.threshold > 0)) {
    faults.push_back("expected a finite threshold > 0, got " + std::to_string(*sample.threshold));
  }
  if (auto fault = flow_fault(tables, sample, header.volume.size)) {
    faults.push_back(std::move(*fault));
  }
  for (std::size_t i = 0; i < sample.annotation.boxes.size(); ++i) {
    const int class_id = sample.annotation.boxes[i].class_id;
    if (class_id < 0 || class_id >= static_cast<int>(header.label_schema.class_names.size())) {
      faults.push_back("expected class_id of box " + std::to_string(i) + " to have a name, got " +
                       std::to_string(class_id));
    }
    const auto row = static_cast<std::size_t>(tables.boxes.offsets[std::size_t(slot)]) + i;
    const bool has_outline = !tables.boxes.outline.empty() && !tables.boxes.outline[row].empty();
    if (!has_outline) continue;
    const std::string name = "outline of box " + std::to_string(i);
    const VolumeBox& box = sample.labels.boxes[i];
    if (box.outline.empty()) {
      faults.push_back("expected " + name + " to be rings of corners as JSON, got another text");
    } else if (!meet(bounds(box.outline), box.unclipped)) {
      faults.push_back("expected " + name + " to lie over xyxy_unclipped, got another place");
    }
  }

  const SourceToVolume map(sample.source_to_volume);
  const std::array<double, 4> volume{0, 0, static_cast<double>(header.volume.size.width),
                                     static_cast<double>(header.volume.size.height)};
  const Rectangle shown = shown_area(sample, header.volume.size);
  const std::array<double, 4> area{shown.left, shown.top, shown.right, shown.bottom};
  rows.visit([&](const ColumnSpec& spec, const std::string& name, std::size_t k, Row row) {
    if (spec.path == std::string_view("/labels/boxes/xyxy")) {
      expect(near(row, cut(rows.row(spec.group(), "xyxy_unclipped", k), area)) &&
                 std::ranges::equal(row, cut(row, volume)),
             name + " to be xyxy_unclipped cut to what the volume shows of the image");
    }
    if (spec.mapped.how == Mapped::kNot || !is_checked(spec)) return;
    const std::string of = spec.mapped.source;
    const Row source = rows.row(spec.group(), of, k);
    expect(has_value(spec, row) == has_value(spec, source), name + " if there is " + of);
    if (!has_value(spec, row) || !has_value(spec, source)) return;
    const std::vector<double> expected = map(spec.mapped.how, source);
    const std::size_t size = spec.mapped.how == Mapped::kPoints ? 2 : row.size();
    for (std::size_t i = 0; i < row.size(); i += size) {
      expect(near(row.subspan(i, size), Row(expected).subspan(i, size)),
             (size < row.size() ? part_name(spec, name, i / size) : name) +
                 " where source_to_volume puts " + of);
    }
  });
  return faults;
}

namespace {

struct Found {
  bool sound = true;
  double max = 0;
  double sum_positive = 0;
  double sum_negative = 0;
  std::size_t nonzero = 0;
};

Found look_at(std::span<const float> volume) {
  Found found;
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const float value = volume[i];
    if (!std::isfinite(value) || value < 0) found.sound = false;
    found.max = std::max(found.max, static_cast<double>(value));
    (2 * i < volume.size() ? found.sum_positive : found.sum_negative) += value;
    found.nonzero += value != 0;
  }
  return found;
}

/// Whether a value lies in a tile that the sample says was not generated.
bool has_values_outside_tiles(const ShardHeader& header, const ShardSample& sample,
                              std::span<const float> volume) {
  const int columns = tile_grid(header).width;
  const auto [height, width] = header.volume.size;
  const float* row = volume.data();
  for (int y = 0; y < header.volume.channels() * height; ++y, row += width) {
    const std::uint8_t* tiles =
        &sample.tiles[static_cast<std::size_t>(y % height / header.tile_px) * columns];
    for (int x = 0; x < width; ++x) {
      if (row[x] != 0 && tiles[x / header.tile_px] == 0) return true;
    }
  }
  return false;
}

/// How far a stored value can lie from the generated one: relative (and as much again for the
/// statistics' own rounding) and absolute.
struct Error {
  double relative;
  double absolute;
};

Error storage_error(StoredType type, float scale) {
  constexpr double kFloatStatistics = 1e-6;
  switch (type) {
    case StoredType::kFloat32:
      return {kFloatStatistics, 0};
    case StoredType::kFloat16:  // 11 bits of mantissa; below 2^-14 steps of 2^-24
      return {0x1p-11 + kFloatStatistics, 0x1p-25};
    case StoredType::kUint8:
      return {kFloatStatistics, 0.5 * scale};
  }
  return {0, 0};
}

std::string text(const char* name, double recorded, double stored) {
  return fmt::format("expected {} {:g} as recorded, got {:g}", name, recorded, stored);
}

/// What is wrong with the scale of a volume whose largest value is `largest`. Of floats nothing
/// else depends on it here, but other readers multiply by it; and a slightly other one of uint8
/// gives values that come near enough to the statistics.
std::optional<std::string> scale_fault(StoredType type, float scale, double largest) {
  constexpr float kRounding = 1e-6f;
  const float expected = std::isfinite(largest)
                             ? quantization(type, static_cast<float>(std::max(largest, 0.0))).scale
                             : 1;
  if (std::abs(scale - expected) <= kRounding * expected) return std::nullopt;
  return fmt::format("expected scale {} for the recorded largest value, got {}", expected, scale);
}

}  // namespace

std::optional<std::string> volume_fault(const ShardHeader& header, const ShardSample& sample,
                                        std::span<const float> volume) {
  const Found found = look_at(volume);
  if (!found.sound) return "expected finite values >= 0 in the volume, got others";
  if (!sample.valid) {
    if (found.nonzero == 0) return scale_fault(header.dtype, sample.scale, 0);
    return "expected zeros for a quarantined sample, got other values";
  }

  // A sensor's noise is everywhere, whatever was generated.
  const bool is_noisy = (sample.statistics.flags & kFlagNoise) != 0;
  if (header.tile_px > 0 && !is_noisy && has_values_outside_tiles(header, sample, volume)) {
    return "expected zeros outside the tiles that were generated, got other values";
  }

  const VolumeStatistics& recorded = sample.statistics;
  const Error error = storage_error(header.dtype, sample.scale);
  const auto near = [&](double expected, double got, double values) {
    return std::abs(expected - got) <=
           error.relative * std::abs(expected) + error.absolute * values;
  };

  // The statistics are of the volume as generated; normalised by eta98 and clipped, its largest
  // value is 1.
  const bool as_generated = header.normalization == Normalization::kNone;
  const bool saturated = (recorded.flags & kFlagSaturated) != 0;
  double max = recorded.max;
  if (!as_generated) max = recorded.max > 0 ? 1 : 0;
  if (saturated) max = std::min<double>(max, kLargestHalf);
  if (!near(max, found.max, 1)) return text("largest value", max, found.max);
  if (auto fault = scale_fault(header.dtype, sample.scale, max)) return fault;

  const bool vanished = found.nonzero == 0 && recorded.max > 0;
  if (((recorded.flags & kFlagVanished) != 0) != vanished) {
    return std::string(
               "expected the flag \"vanished\" exactly where a volume was stored as zeros alone "
               "but not generated so, got it ") +
           (vanished ? "not set" : "set");
  }

  const auto size = static_cast<double>(volume.size());
  const double nonzero_fraction = static_cast<double>(found.nonzero) / size;
  const double recorded_fraction = recorded.nonzero_fraction;
  // Rounding to coarser numbers can make values zero, never the other way round.
  const bool exact = header.dtype == StoredType::kFloat32 && as_generated;
  if (nonzero_fraction > recorded_fraction + 1e-6 ||
      (exact && nonzero_fraction < recorded_fraction - 1e-6)) {
    return text("non-zero fraction", recorded_fraction, nonzero_fraction);
  }
  if (!as_generated || saturated) return std::nullopt;
  if (!near(recorded.sum_positive, found.sum_positive, size / 2)) {
    return text("sum of positive polarity", recorded.sum_positive, found.sum_positive);
  }
  if (!near(recorded.sum_negative, found.sum_negative, size / 2)) {
    return text("sum of negative polarity", recorded.sum_negative, found.sum_negative);
  }
  return std::nullopt;
}

}  // namespace eventgan
