#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "manifests/values/rows.h"

namespace eventgan {

enum class DatasetKind {
  kKittiObject,
  kKittiTracking,
  kKittiRaw,
  kMpii,
  kHuman36m,
  kMpiiList,
  kRecording,  ///< of an event camera
  kDhp19,
  kFrames  ///< images or videos of one's own
};

/// Where in its window of events a label lies.
enum class LabelPlace { kEnd, kMiddle };

/// Which events around a label's time make its volume: those of one interval between frames, or as
/// many seconds, or as many events.
struct WindowSpec {
  std::optional<double> duration_s = {};    ///< 1e-6..1e3
  std::optional<std::int64_t> events = {};  ///< 1..1e9; of dhp19 always given
  LabelPlace label = LabelPlace::kEnd;
};

/// How labels of one's own are written (manifests/guides/own_data.md).
enum class LabelFormat { kMot, kCoco, kYolo, kVoc, kCsv, kMasks };

/// A format of labels. What finds and reads them is in its own file
/// (stages/frames/own_labels/label_readers.h).
struct LabelFormatRow {
  std::string_view word;  ///< the manifest's
  LabelFormat value;
  std::string_view title;  ///< for a person
};

/// Every format, in the order in which messages list them, and in which `init` looks for them.
inline constexpr std::array kLabelFormats{
    LabelFormatRow{"mot", LabelFormat::kMot, "MOT"},
    LabelFormatRow{"coco", LabelFormat::kCoco, "COCO"},
    LabelFormatRow{"yolo", LabelFormat::kYolo, "YOLO"},
    LabelFormatRow{"voc", LabelFormat::kVoc, "Pascal VOC"},
    LabelFormatRow{"csv", LabelFormat::kCsv, "CSV"},
    LabelFormatRow{"masks", LabelFormat::kMasks, "index masks"}};
static_assert(are_in_order(kLabelFormats));

/// What a manifest may say of a kind of dataset. What finds and reads it is in its own file
/// (stages/frames/sources/dataset_kinds.h).
struct DatasetRow {
  std::string_view word;  ///< the manifest's, and that of shards, plans and reports
  DatasetKind value;
  std::string_view title;  ///< for a person
  /// ImageSpec::preset unless the manifest says: what the published scripts do to these images, or
  /// what their demo does to any others; empty of events, which have no grey values.
  std::string_view preset;
  /// A source's keys that not every kind takes; the rest are empty.
  std::array<std::string_view, 10> keys = {};
  std::string_view required_key = {};  ///< one of `keys`; empty: none
  /// Its samples are windows of real events (GeneratorKind::kEvents), not pairs of frames.
  bool has_events = false;
  WindowSpec window = {};  ///< unless the manifest says; of events
  /// Images and videos of one's own: they are turned upright as their EXIF orientation says, as
  /// tools show those that one labels oneself (labels of published datasets are in pixels as
  /// stored); a folder need not be a sequence, and a sequence need not have a name.
  bool is_own = false;
};

/// Every kind, in the order in which messages list them, and in which `init` looks for them: of two
/// that a folder may be, the first.
inline constexpr std::array kDatasets{
    DatasetRow{.word = "kitti_object",
               .value = DatasetKind::kKittiObject,
               .title = "KITTI object",
               .preset = "kitti",
               .keys = {"raw_root", "devkit"}},
    DatasetRow{.word = "kitti_tracking",
               .value = DatasetKind::kKittiTracking,
               .title = "KITTI tracking",
               .preset = "kitti"},
    DatasetRow{.word = "kitti_raw",
               .value = DatasetKind::kKittiRaw,
               .title = "KITTI raw",
               .preset = "kitti"},
    DatasetRow{.word = "mpii",
               .value = DatasetKind::kMpii,
               .title = "MPII Human Pose",
               .preset = "mpii",
               .keys = {"annotations", "sequences"}},
    DatasetRow{.word = "human36m",
               .value = DatasetKind::kHuman36m,
               .title = "Human3.6M",
               .preset = "mpii",
               .keys = {"annotations", "layout", "every", "subjects", "cameras", "actions"},
               .required_key = "layout"},
    DatasetRow{.word = "mpii_list",
               .value = DatasetKind::kMpiiList,
               .title = "MPII as a list of people",
               .preset = "mpii",
               .keys = {"annotations", "sequences"},
               .required_key = "annotations"},
    DatasetRow{.word = "recording",
               .value = DatasetKind::kRecording,
               .title = "recording of an event camera",
               .preset = "",
               .keys = {"annotations", "camera", "rectify", "sensor", "stream", "time_shift",
                        "columns", "window_s", "window_events", "label_at"},
               .has_events = true},
    // A label of dhp19 is the mean pose of a window of so many events as its authors took.
    DatasetRow{.word = "dhp19",
               .value = DatasetKind::kDhp19,
               .title = "DHP19",
               .preset = "",
               .keys = {"window_events", "subjects", "cameras", "actions", "without_actions"},
               .has_events = true,
               .window = {.events = 7500, .label = LabelPlace::kMiddle}},
    DatasetRow{.word = "frames",
               .value = DatasetKind::kFrames,
               .title = "images or videos",
               .preset = "demo",
               .keys = {"frames_per_second", "labels"},
               .is_own = true}};
static_assert(are_in_order(kDatasets));

/// A value's row. Throws std::invalid_argument for a number that is no value, which only a bad cast
/// can make.
template <class Row, std::size_t N>
constexpr const Row& row_of(const std::array<Row, N>& rows, decltype(Row::value) value) {
  for (const Row& row : rows) {
    if (row.value == value) return row;
  }
  throw std::invalid_argument("expected a value of the enumeration, got another number");
}

constexpr const DatasetRow& dataset_row(DatasetKind kind) { return row_of(kDatasets, kind); }

/// The row of that word; null if there is none.
constexpr const DatasetRow* find_dataset(std::string_view word) {
  const auto row = std::ranges::find(kDatasets, word, &DatasetRow::word);
  return row == kDatasets.end() ? nullptr : &*row;
}

constexpr bool takes(const DatasetRow& row, std::string_view key) {
  return std::ranges::find(row.keys, key) != row.keys.end();
}

constexpr bool has_events(DatasetKind kind) { return dataset_row(kind).has_events; }
constexpr bool is_own(DatasetKind kind) { return dataset_row(kind).is_own; }

}  // namespace eventgan
