#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/words.h"
#include "stages/frames/dataset_kinds.h"
#include "stages/frames/events/recording_dataset.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "stages/frames/sequences/image_folder.h"
#include "stages/frames/source_folders.h"
#include "stages/recordings/recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr std::array kRecordingTitles{
    Word<RecordingFormat>{"recording of an event camera (MVSEC)", RecordingFormat::kMvsec},
    Word<RecordingFormat>{"recording of an event camera (EventGAN)", RecordingFormat::kEventgan},
    Word<RecordingFormat>{"recording of an event camera (ECD)", RecordingFormat::kEcd},
    Word<RecordingFormat>{"recording of an event camera (AEDAT4)", RecordingFormat::kAedat4},
    Word<RecordingFormat>{"recording of an event camera (DSEC)", RecordingFormat::kDsec},
    Word<RecordingFormat>{"recording of an event camera (M3ED)", RecordingFormat::kM3ed},
    Word<RecordingFormat>{"recording of an event camera (Prophesee)", RecordingFormat::kProphesee},
    Word<RecordingFormat>{"recording of an event camera (table)", RecordingFormat::kTable}};

bool may_be_recording(const fs::path& file) {
  constexpr std::array kExtensions = {".aedat4", ".csv", ".dat", ".h5",
                                      ".hdf5",   ".npy", ".npz", ".raw"};
  return std::ranges::find(kExtensions, lower_extension(file)) != kExtensions.end();
}

struct FoundRecording {
  RecordingFormat format;
  EventFields columns;
};

std::optional<FoundRecording> recording_at(const fs::path& path) {
  // Of other names of the time it would be a guess what they count.
  for (const char* time : {"t", "t_us"}) {
    const EventFields columns{.t = time};
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
  for (const std::string& name : listing.files) {
    if (!may_be_recording(name) || lower_extension(name) == ".npy") continue;  // any numbers [N, 4]
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
  const auto title =
      std::ranges::find(kRecordingTitles, recording.format, &Word<RecordingFormat>::value);
  found.title = title->word;
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
