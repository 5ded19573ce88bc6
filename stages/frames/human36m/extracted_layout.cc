#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/faults.h"
#include "stages/frames/folder_listing.h"
#include "stages/frames/human36m/indexed_dataset_internal.h"
#include "stages/frames/human36m/layouts_internal.h"
#include "stages/frames/human36m/npz_table_internal.h"
#include "stages/frames/source_root.h"

namespace eventgan {
namespace {

constexpr char kCameras[] = "cameras.pkl";

/// The annotation file under both its names.
struct Annotations {
  std::string written;
  std::filesystem::path on_disk;
  std::vector<std::string> left_out = {};  ///< others beside it, each with the reason
};

Annotations choose_annotations(const SourceSpec& spec, const std::filesystem::path& base,
                               const SourceRoot& root) {
  if (spec.annotations) return {*spec.annotations, base / *spec.annotations};
  std::string candidates;
  std::vector<std::string> fitting, left_out;
  for (const std::string& name : root.files_in("")) {
    if (!name.ends_with(".npz")) continue;
    const std::string reason = why_no_human36m_npz(root.on_disk(name));
    if (reason.empty()) fitting.push_back(name);
    const std::string shown = reason.empty() ? name : name + " (not usable: " + reason + ")";
    candidates += (candidates.empty() ? "; there is " : ", ") + shown;
    if (!reason.empty()) left_out.push_back(shown);
  }
  if (fitting.size() == 1) {
    return {root.written(fitting[0]), root.on_disk(fitting[0]), std::move(left_out)};
  }
  const std::string message =
      "expected one .npz with imgname, center, scale, part [N, 17, 3] and S [N, 17, 4], got " +
      std::to_string(fitting.size()) + ", in " + root.written("") +
      ": name one under \"annotations\"" + candidates;
  if (fitting.empty()) throw InputError(message);  // absent or damaged
  throw UsageError(message);
}

/// A video by the names of its labelled pictures.
struct Video {
  std::string folder;
  std::vector<std::int64_t> labelled;
};

std::map<std::string, Video> videos_of(const NpzTable& table, const std::string& file) {
  std::map<std::string, Video> videos;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    const ExtractedName& name = table.name(row);
    Video& video = videos.try_emplace(name.sequence, Video{name.folder, {}}).first->second;
    if (video.folder != name.folder) {
      throw InputError("expected the pictures of " + name.sequence + " in one folder, got " +
                       video.folder + " and " + name.folder + ", in " + file);
    }
    video.labelled.push_back(name.number);
  }
  return videos;
}

/// Stored frames by sequence, from one listing of a folder, which may hold several sequences. A
/// picture that is no frame, and the lesser of two of one frame, is noted.
std::map<std::string, NumberedSequence> stored_in(const SourceRoot& root, const std::string& folder,
                                                  IndexedDataset& dataset) {
  std::map<std::string, std::map<std::int64_t, std::string>> names;
  std::vector<std::string> left_out;
  for (const std::string& file : root.files_in(folder)) {
    std::string lower = file;
    std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
    const auto ends_file = [&](std::string_view extension) { return lower.ends_with(extension); };
    if (std::ranges::none_of(kPictureExtensions, ends_file)) continue;
    const bool may_be_frame = file.ends_with(".jpg") || file.ends_with(".png");
    try {
      const ExtractedName name = parse_extracted_name(file);
      // Files come sorted, so a frame that is there as .jpg and .png counts once, as .jpg.
      if (may_be_frame && names[name.sequence].try_emplace(name.number, file).second) continue;
    } catch (const std::invalid_argument&) {  // another picture, a segmentation perhaps
    }
    left_out.push_back(file);
  }
  if (!left_out.empty()) {
    dataset.add_note(counted(left_out, "pictures left out in " + root.written(folder)));
  }
  std::map<std::string, NumberedSequence> sequences;
  for (const auto& [sequence, files] : names) {
    sequences.emplace(sequence, NumberedSequence({files.begin(), files.end()}));
  }
  return sequences;
}

void add_videos(const SourceRoot& root, const std::map<std::string, Video>& videos,
                IndexedDataset& dataset) {
  std::map<std::string, std::vector<std::string>> sequences_by_folder;
  for (const auto& [sequence, video] : videos) {
    sequences_by_folder[video.folder].push_back(sequence);
  }
  for (const auto& [folder, sequences] : sequences_by_folder) {
    auto stored = stored_in(root, folder, dataset);
    for (const std::string& sequence : sequences) {
      dataset.add_video(
          sequence, FrameFolder(root.written(folder), sequence + "_", std::move(stored[sequence]),
                                videos.at(sequence).labelled));
    }
  }
  std::vector<std::string> without_labels;
  for (const std::string& subject : root.folders_in("")) {
    if (!subject.starts_with('S')) continue;
    for (const std::string& sequence : root.folders_in(subject)) {
      const std::string folder = subject + "/" + sequence;
      if (!sequences_by_folder.contains(folder)) without_labels.push_back(root.written(folder));
    }
  }
  if (!without_labels.empty()) {
    dataset.add_note(std::to_string(without_labels.size()) +
                     " folders of pictures without labels, the first " + without_labels.front());
  }
}

}  // namespace

std::unique_ptr<Dataset> open_human36m_extracted(const SourceSpec& spec,
                                                 const std::filesystem::path& base) {
  const SourceRoot root(spec.root, base);
  root.require_folder("");
  const Annotations annotations = choose_annotations(spec, base, root);
  auto dataset = std::make_unique<IndexedDataset>();
  if (!annotations.left_out.empty()) {  // one that is damaged may be the one that was meant
    dataset->add_note(
        counted(annotations.left_out, "annotation files left out beside " + annotations.written));
  }

  CameraBook cameras;
  const auto files = root.files_in("");
  if (std::ranges::binary_search(files, kCameras)) {
    cameras = read_camera_book(root.on_disk(kCameras));
    dataset->add_annotation_file(root.written(kCameras));
  }
  auto table =
      std::make_unique<NpzTable>(annotations.on_disk, annotations.written, std::move(cameras));
  add_videos(root, videos_of(*table, annotations.written), *dataset);

  const std::string key = annotations.on_disk.filename().string();
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const ExtractedName& name = table->name(row);
    dataset->add_labelled(fmt::format("{}_{:06}", name.sequence, name.number), name.sequence,
                          name.number, key, row);
  }
  dataset->add_table(key, annotations.written, std::move(table));
  dataset->finish(root.written(""));
  return dataset;
}

}  // namespace eventgan
