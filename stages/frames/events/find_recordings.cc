#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/datasets.h"
#include "manifests/values/recording_formats.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/events/recording_dataset.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

bool may_be_recording(const fs::path& file) {
  const std::string extension = lower_extension(file);
  return std::ranges::any_of(kRecordingFormats, [&](const RecordingFormatRow& row) {
    return !extension.empty() &&
           std::ranges::find(row.extensions, extension) != row.extensions.end();
  });
}

struct FoundRecording {
  RecordingFormat format;
  EventFields columns;
};

std::optional<FoundRecording> recording_at(const fs::path& path) {
  // PEDRo's, and those of TimeLens and of iniVation's DV.
  static const std::array<EventFields, 3> kColumns{
      {{}, {.t = "t_us"}, {.t = "timestamp", .p = "polarity"}}};
  for (const EventFields& columns : kColumns) {
    if (const auto format = find_recording_format(path, {.columns = columns})) {
      return FoundRecording{*format, columns};
    }
  }
  return std::nullopt;
}

/// The recording, or the first one in a folder of them.
std::optional<FoundRecording> first_recording(const fs::path& root) {
  if (has_folder(root) || may_be_recording(root)) {
    if (const auto found = recording_at(root)) return found;
  }
  const FolderListing listing = look_into(root);
  for (const std::string& name : listing.folders) {
    if (const auto found = recording_at(root / name)) return found;
  }
  // Any numbers [N, 4] may be in an array's file: those of a window have its labels beside them,
  // and these are not those of YOLO's images.
  const bool are_of_images =
      root.filename() == "labels" && has_folder(root.parent_path() / "images");
  const auto has_labels = [&](const fs::path& file) {
    const std::string text = fs::path(file).replace_extension(".txt").string();
    return !are_of_images && std::ranges::binary_search(listing.files, text) &&
           is_window_label_text(root / text).value_or(false);
  };
  for (const std::string& name : listing.files) {
    if (!may_be_recording(name) || (lower_extension(name) == ".npy" && !has_labels(name))) continue;
    if (const auto found = recording_at(root / name)) return found;
  }
  return std::nullopt;
}

/// Tables of numbers lie beside images, too.
bool is_recording(const fs::path& root) {
  const auto found = first_recording(root);
  return found && (found->format != RecordingFormat::kTable || !is_frames_root(root));
}

std::vector<FoundSource> complete_recording(FoundSource found) {
  const FoundRecording recording = *first_recording(found.root);
  found.title = fmt::format("{} ({})", dataset_row(DatasetKind::kRecording).title,
                            recording_format_row(recording.format).title);
  found.columns = recording.columns;
  return {std::move(found)};
}

constexpr std::array kRecordingLayouts{DatasetLayout{
    .fits = is_recording, .complete = complete_recording, .may_be_part = [](std::string_view name) {
      return name.starts_with("image");
    }}};

}  // namespace

constinit const DatasetReader kRecordingReader{
    .kind = DatasetKind::kRecording,
    .open = open_recording_dataset,
    .may_be_file = may_be_recording,
    .layouts = kRecordingLayouts,
    .habits = {.gaps = {},
               .size_comment = "No width and height: volumes are as large as the sensor.",
               .size = ""}};

}  // namespace eventgan
