#include "stages/shards/sample_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

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

std::array<double, 2> numbers(const Point& p) { return {p.x, p.y}; }
std::array<double, 4> numbers(const Rectangle& r) { return {r.left, r.top, r.right, r.bottom}; }
std::array<double, 4> numbers(const Intrinsics& camera) {
  return {camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y};
}
std::array<double, 5> numbers(const LensDistortion& lens) {
  return {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2};
}
std::array<double, 4> numbers(const ImageMotion& motion) {
  return {motion.x_px, motion.y_px, motion.angle_deg, motion.scale};
}
std::array<double, 1> numbers(double x) { return {x}; }
template <class Number, std::size_t kCount>
std::array<Number, kCount> numbers(const std::array<Number, kCount>& all) {
  return all;
}

template <class Label>
bool near(const Label& a, const Label& b) {
  return std::ranges::equal(numbers(a), numbers(b), [](double x, double y) { return near(x, y); });
}

/// `/pairs/source_to_volume` as a map of points and of edges (manifests/values/placement.h has the
/// equations).
class SourceToVolume {
 public:
  explicit SourceToVolume(const std::array<double, 6>& matrix) : m_(matrix) {}

  Point operator()(const Point& p) const {
    if (p == kMissingPoint) return p;
    return {m_[0] * p.x + m_[1] * p.y + m_[2], m_[3] * p.x + m_[4] * p.y + m_[5]};
  }

  /// The geometric mean of both axes' scales: one number for a person.
  double scaled(double scale) const { return scale < 0 ? scale : scale * std::sqrt(m_[0] * m_[4]); }

  /// Focal lengths scale.
  Intrinsics operator()(const Intrinsics& camera) const {
    const Point centre = (*this)(Point{camera.centre_x, camera.centre_y});
    return {camera.focal_x * m_[0], camera.focal_y * m_[4], centre.x, centre.y};
  }

  /// P' = M P: its rows are combined as points' x, y and 1 are.
  std::array<double, 12> operator()(const std::array<double, 12>& projection) const {
    std::array<double, 12> mapped = projection;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto row = [&](std::size_t first) {
        return m_[first] * projection[i] + m_[first + 1] * projection[4 + i] +
               m_[first + 2] * projection[8 + i];
      };
      mapped[i] = row(0);
      mapped[4 + i] = row(3);
    }
    return mapped;
  }

  /// An edge lies half a pixel before the centre of the pixel with its number, here and there.
  Rectangle operator()(const Rectangle& r) const {
    const Point first = (*this)(Point{r.left - 0.5, r.top - 0.5});
    const Point last = (*this)(Point{r.right - 0.5, r.bottom - 0.5});
    return {first.x + 0.5, first.y + 0.5, last.x + 0.5, last.y + 0.5};
  }

 private:
  const std::array<double, 6>& m_;
};

Rectangle cut(const Rectangle& box, const Rectangle& area) {
  return {std::clamp(box.left, area.left, area.right), std::clamp(box.top, area.top, area.bottom),
          std::clamp(box.right, area.left, area.right),
          std::clamp(box.bottom, area.top, area.bottom)};
}

/// What boxes are cut to: the volume, or what it shows of a still's image.
Rectangle area_of(const ShardSample& sample, const SourceToVolume& map, const Rectangle& volume) {
  const auto [height, width] = sample.source_size;
  const auto border = sample.pair.motion ? still_border(sample.source_size, sample.pair)
                                         : std::optional<ImageSize>();
  if (!border || *border == ImageSize{}) return volume;
  const auto [rows, columns] = *border;
  return cut(
      map(Rectangle{static_cast<double>(columns), static_cast<double>(rows),
                    static_cast<double>(width - columns), static_cast<double>(height - rows)}),
      volume);
}

/// Columns in which a number is not finite.
std::vector<std::string> not_finite(const ShardSample& sample) {
  std::vector<std::string> faults;
  std::string whose;
  const auto expect_finite = [&](const char* column, const auto& value) {
    for (const double number : numbers(value)) {
      if (std::isfinite(number)) continue;
      faults.push_back("expected finite numbers in " + (column + whose) + ", got " +
                       std::to_string(number));
      return;
    }
  };
  const auto expect_finite_if_any = [&](const char* column, const auto& value) {
    if (value) expect_finite(column, *value);
  };
  expect_finite_if_any("motion", sample.pair.motion);
  if (sample.valid) {  // of a quarantined one the source's alone may be there, as it is
    expect_finite_if_any("projection_source", sample.annotation.projection);
    expect_finite_if_any("projection", sample.labels.projection);
  }
  for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
    whose = " of box " + std::to_string(i);
    const Box& source = sample.annotation.boxes[i];
    expect_finite("xyxy_source", source.xyxy);
    expect_finite("xyxy_unclipped", sample.labels.boxes[i].unclipped);
    expect_finite("xyxy", sample.labels.boxes[i].clipped);
    expect_finite("truncation", source.truncation);
    expect_finite("alpha", source.alpha);
    expect_finite("box3d", source.box3d);
  }
  for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
    whose = " of person " + std::to_string(i);
    const Person& source = sample.annotation.persons[i];
    const VolumePerson& person = sample.labels.persons[i];
    for (const Joint& joint : source.joints) expect_finite("joints_source", joint.at);
    for (const Point& joint : person.joints) expect_finite("joints", joint);
    expect_finite("center_source", source.center);
    expect_finite("center", person.center);
    expect_finite("scale", source.scale);
    expect_finite("scale_volume", person.scale);
    expect_finite_if_any("head_box_source", source.head_box);
    expect_finite_if_any("head_box", person.head_box);
    expect_finite_if_any("box_source", source.box);
    expect_finite_if_any("box", person.box);
    for (const auto& joint : source.joints3d_mm) expect_finite_if_any("joints3d_mm", joint);
    expect_finite_if_any("camera_source", source.camera);
    expect_finite_if_any("camera", person.camera);
    expect_finite_if_any("camera_distortion", source.distortion);
  }
  return faults;
}

}  // namespace

std::vector<std::string> label_faults(const ShardHeader& header, const ShardSample& sample) {
  std::vector<std::string> faults = not_finite(sample);
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
  const SourceToVolume map(sample.source_to_volume);
  const auto expect_mapped = [&](const std::string& name, const std::string& of, const auto& mapped,
                                 const auto& source) {
    expect(mapped.has_value() == source.has_value(), name + " if there is " + of);
    if (!mapped || !source) return;
    expect(near(*mapped, map(*source)), name + " where source_to_volume puts " + of);
  };

  const Rectangle volume{0, 0, static_cast<double>(header.volume.size.width),
                         static_cast<double>(header.volume.size.height)};
  const Rectangle area = area_of(sample, map, volume);
  for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
    const VolumeBox& box = sample.labels.boxes[i];
    const std::string name = " of box " + std::to_string(i);
    const int class_id = sample.annotation.boxes[i].class_id;
    if (class_id < 0 || class_id >= static_cast<int>(header.label_schema.class_names.size())) {
      faults.push_back("expected class_id" + name + " to have a name, got " +
                       std::to_string(class_id));
    }
    expect(near(box.unclipped, map(sample.annotation.boxes[i].xyxy)),
           "xyxy_unclipped" + name + " where source_to_volume puts xyxy_source");
    expect(near(box.clipped, cut(box.unclipped, area)) && box.clipped == cut(box.clipped, volume),
           "xyxy" + name + " to be xyxy_unclipped cut to the volume");
  }
  for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
    const Person& source = sample.annotation.persons[i];
    const VolumePerson& person = sample.labels.persons[i];
    const std::string name = " of person " + std::to_string(i);
    for (std::size_t j = 0; j < person.joints.size(); ++j) {
      expect(near(person.joints[j], map(source.joints[j].at)),
             "joint " + std::to_string(j) + name + " where source_to_volume puts joints_source");
    }
    expect(near(person.center, map(source.center)),
           "center" + name + " where source_to_volume puts center_source");
    expect(near(person.scale, map.scaled(source.scale)),
           "scale_volume" + name + " as source_to_volume makes it of scale");
    expect_mapped("head_box" + name, "head_box_source", person.head_box, source.head_box);
    expect_mapped("box" + name, "box_source", person.box, source.box);
    expect_mapped("camera" + name, "camera_source", person.camera, source.camera);
  }
  if (sample.valid) {
    expect_mapped("projection", "projection_source", sample.labels.projection,
                  sample.annotation.projection);
  }
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

}  // namespace

std::optional<std::string> volume_fault(const ShardHeader& header, const ShardSample& sample,
                                        std::span<const float> volume) {
  const Found found = look_at(volume);
  if (!found.sound) return "expected finite values >= 0 in the volume, got others";
  if (!sample.valid) {
    if (found.nonzero == 0) return std::nullopt;
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
