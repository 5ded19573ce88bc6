#include "stages/frames/find_source.h"

#include <algorithm>
#include <array>
#include <system_error>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/words.h"
#include "stages/frames/kitti/raw_drive.h"
#include "stages/frames/mpii/mpii_frames.h"
#include "stages/frames/mpii/mpii_list_dataset.h"
#include "stages/frames/own_labels/detail/find_labels.h"
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

template <class Fits>
bool any_folder(const fs::path& folder, Fits fits) {
  return std::ranges::any_of(look_into(folder).folders, fits);
}

bool is_kitti_object(const fs::path& root) { return has_folder(root / "label_2"); }

bool is_kitti_tracking(const fs::path& root) { return has_folder(root / "label_02"); }

bool is_kitti_raw(const fs::path& root) { return any_folder(root, is_kitti_date); }

bool is_devkit(const fs::path& folder) { return has_file(folder / "mapping/train_mapping.txt"); }

bool is_mpii(const fs::path& root) { return !find_mpii_annotations(root).empty(); }

bool is_mpii_list(const fs::path& root) try {
  return has_folder(root) && !find_mpii_lists(root).empty();
} catch (const InputError&) {  // cannot be listed
  return false;
}

/// Whether a folder S1, S5, ... of the root holds a folder that fits.
template <class Fits>
bool any_of_a_subject(const fs::path& root, Fits fits) {
  return any_folder(root, [&](const std::string& subject) {
    return subject.size() > 1 && subject[0] == 'S' && is_digit(subject[1]) &&
           any_folder(root / subject,
                      [&](const std::string& name) { return fits(root / subject / name); });
  });
}

bool is_human36m_fetch(const fs::path& root) {
  return any_of_a_subject(root, [](const fs::path& action) {
    return has_file(action / "annot.h5") || has_folder(action / "imageSequence");
  });
}

bool is_human36m_extracted(const fs::path& root) {
  return any_of_a_subject(root, [](const fs::path& sequence) {  // S1_Directions_1.54138969
    const std::string camera = sequence.extension();
    return camera.size() > 1 && std::all_of(camera.begin() + 1, camera.end(), is_digit) &&
           sequence.stem().string().starts_with(sequence.parent_path().filename().string() + "_");
  });
}

bool is_human36m_official(const fs::path& root) {
  return any_of_a_subject(
      root, [](const fs::path& folder) { return folder.filename() == "MyPoseFeatures"; });
}

bool has_images(const fs::path& folder) {
  return !look_into(folder).files.empty() && !list_image_folder(folder).frames.empty();
}

bool is_mot_sequence(const fs::path& folder) {
  return has_file(folder / "gt/gt.txt") && has_images(folder / "img1");
}

bool is_frames(const fs::path& root) {
  if (has_file(root)) return is_video_name(root);
  if (has_folder(root / "image_2")) return false;  // KITTI's test images: no sequence at all
  const ImageFolder top = has_folder(root) ? list_image_folder(root) : ImageFolder();
  return !top.frames.empty() || std::ranges::any_of(top.left_out, is_video_name) ||
         (has_folder(root / "images") && is_frames(root / "images")) ||
         std::ranges::any_of(top.folders,
                             [&](const std::string& name) { return has_images(root / name); }) ||
         std::ranges::any_of(top.folders, [&](const std::string& name) {
           return is_mot_sequence(root / name) ||
                  (has_folder(root / name / "labels") && has_images(root / name / "images"));
         });
}

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
  return found && (found->format != RecordingFormat::kTable || !is_frames(root));
}

void complete_recording(FoundSource& found) {
  const FoundRecording recording = *first_recording(found.root);
  const auto title =
      std::ranges::find(kRecordingTitles, recording.format, &Word<RecordingFormat>::value);
  found.title = title->word;
  found.columns = recording.columns;
}

/// The first that fits of the two folders above `root`, and of the folders in these.
template <class Fits>
std::optional<fs::path> find_beside(const fs::path& root, Fits fits) {
  for (const fs::path& above : {root.parent_path(), root.parent_path().parent_path()}) {
    if (fits(above)) return above;
    for (const std::string& name : look_into(above).folders) {
      if (fits(above / name)) return above / name;
    }
  }
  return std::nullopt;
}

void complete_kitti_object(FoundSource& found) {
  found.devkit = find_beside(found.root, is_devkit);
  if (found.devkit) found.raw_root = find_beside(found.root, is_kitti_raw);
  if (!has_folder(found.root / "prev_2")) {
    found.remarks.push_back("no prev_2: no previous frames from KITTI object itself");
  }
  if (!found.devkit) {
    found.remarks.push_back(
        "no devkit (a folder with mapping/train_mapping.txt): no gaps 4-6 through KITTI raw, no "
        "names of drives");
  } else if (!found.raw_root) {
    found.remarks.push_back("no raw_root (KITTI raw, DATE/DATE_drive_NNNN_sync): no gaps 4-6");
  }
  if (!has_folder(found.root / "calib")) found.remarks.push_back("no calib: no projections");
}

void complete_kitti_tracking(FoundSource& found) {
  if (!has_folder(found.root / "calib")) found.remarks.push_back("no calib: no projections");
}

void complete_kitti_raw(FoundSource& found) {
  const bool has_tracklets = any_folder(found.root, [&](const std::string& date) {
    return any_folder(found.root / date, [&](const std::string& drive) {
      return has_file(found.root / date / drive / "tracklet_labels.xml");
    });
  });
  if (!has_tracklets) found.remarks.push_back("no tracklet_labels.xml: no labels");
}

void complete_mpii(FoundSource& found) {
  const bool has_sequences = any_folder(found.root, [](const std::string& name) {
    return name == "sequences" || name.starts_with(kMpiiBatchPrefix);
  });
  if (!has_sequences) found.remarks.push_back("no sequences (video frames): no pairs");
}

void complete_mpii_list(FoundSource& found) {
  std::vector<fs::path> lists = find_mpii_lists(found.root);
  const auto train = std::ranges::find(lists, "train", [](const fs::path& l) { return l.stem(); });
  const auto chosen = train == lists.end() ? lists.begin() : train;
  found.annotations = *chosen;
  lists.erase(chosen);
  for (const fs::path& other : lists) {
    found.remarks.push_back("another list of people, left out: " +
                            other.lexically_relative(found.root).string());
  }
  for (const fs::path& above : {found.root, found.root.parent_path()}) {
    if (!found.sequences && has_folder(above / "sequences")) found.sequences = above / "sequences";
  }
  if (!found.sequences) {
    found.remarks.push_back(
        "no sequences (MPII's video frames; set \"sequences\" to their folder): no pairs");
  }
}

/// A dataset in one of the ways in which it lies on disk.
struct DatasetLayout {
  DatasetKind dataset;
  std::string_view layout;
  std::string_view title;
  bool (*fits)(const fs::path& root);
  void (*complete)(FoundSource& found) = [](FoundSource&) {};
};

/// Of several that one folder fits, the first counts.
constexpr std::array kLayouts{
    DatasetLayout{DatasetKind::kKittiObject, "", "KITTI object", is_kitti_object,
                  complete_kitti_object},
    DatasetLayout{DatasetKind::kKittiTracking, "", "KITTI tracking", is_kitti_tracking,
                  complete_kitti_tracking},
    DatasetLayout{DatasetKind::kKittiRaw, "", "KITTI raw", is_kitti_raw, complete_kitti_raw},
    DatasetLayout{DatasetKind::kMpii, "", "MPII Human Pose", is_mpii, complete_mpii},
    DatasetLayout{DatasetKind::kHuman36m, "fetch", "Human3.6M as h36m-fetch unpacks it",
                  is_human36m_fetch},
    DatasetLayout{DatasetKind::kHuman36m, "official", "Human3.6M as downloaded",
                  is_human36m_official},
    DatasetLayout{DatasetKind::kHuman36m, "extracted", "Human3.6M as extracted images",
                  is_human36m_extracted},
    DatasetLayout{DatasetKind::kMpiiList, "", "MPII as a list of people", is_mpii_list,
                  complete_mpii_list},
    DatasetLayout{DatasetKind::kRecording, "", "recording of an event camera", is_recording,
                  complete_recording},
    DatasetLayout{DatasetKind::kFrames, "", "images or videos", is_frames}};

struct Place {
  const DatasetLayout* layout;
  fs::path root;
};

std::optional<Place> look_at(const fs::path& root, std::optional<DatasetKind> dataset,
                             bool frames_too) {
  for (const DatasetLayout& layout : kLayouts) {
    if (dataset && layout.dataset != *dataset) continue;
    if (layout.dataset == DatasetKind::kFrames && !frames_too) continue;
    if (layout.fits(root)) return Place{&layout, root};
  }
  return std::nullopt;
}

std::optional<Place> look_around(const fs::path& path, std::optional<DatasetKind> dataset) {
  if (auto found = look_at(path, dataset, /*frames_too=*/false)) return found;
  std::vector<Place> below;
  for (const std::string& name : look_into(path).folders) {
    const auto found = look_at(path / name, dataset, /*frames_too=*/false);
    if (found) below.push_back(*found);
  }
  if (below.empty()) return look_at(path, dataset, /*frames_too=*/true);
  if (below.size() == 1) return below.front();
  std::string names;
  for (const Place& found : below) {
    names += (names.empty() ? "" : ", ") + found.root.filename().string() + " (" +
             std::string(to_string(found.layout->dataset)) + ")";
  }
  throw InputError("expected one dataset, got " + std::to_string(below.size()) + ": " + names +
                   ", in " + path.string());
}

/// Says so where what was taken as frames is a part of a dataset, whose labels and pairs it does
/// not have alone: KITTI's image_2 holds images of scenes that have nothing to do with each other.
void note_dataset_above(FoundSource& found) {
  constexpr int kLevels = 4;  // S1/Walking-1/imageSequence/54138969
  fs::path part = found.root;
  for (int level = 0; level < kLevels; ++level, part = part.parent_path()) {
    const std::string name = part.filename().string();
    const bool may_be_part = name.starts_with("image") || name.starts_with("prev_") ||
                             name == "sequences" || is_kitti_date(name) ||
                             (name.size() > 1 && name[0] == 'S' && is_digit(name[1]));
    if (!may_be_part) continue;
    const fs::path above = part.parent_path();
    const auto whole = look_at(above, std::nullopt, /*frames_too=*/false);
    if (!whole) continue;
    std::string remark = "warning: this is only a part of " + std::string(whole->layout->title) +
                         ", without its labels and pairs: run eventgan init \"" + above.string() +
                         "\"";
    if (whole->layout->dataset == DatasetKind::kKittiObject && !has_folder(above / "image_2")) {
      remark += " once the images are in image_2";
    }
    found.remarks.insert(found.remarks.begin(), remark);
    return;
  }
}

}  // namespace

std::vector<FoundSource> find_sources(const fs::path& path, std::optional<DatasetKind> dataset) {
  fs::path root = fs::absolute(path).lexically_normal();
  if (!root.has_filename()) root = root.parent_path();  // "kitti/"
  std::error_code error;
  const auto status = fs::status(root, error);
  if (!fs::exists(status)) {
    throw InputError("expected a folder or a video, got '" + (error ? error.message() : "nothing") +
                     "', in " + path.string());
  }
  const std::optional<Place> place = look_around(root, dataset);
  if (!place) {
    const auto other = dataset ? look_around(root, std::nullopt) : std::nullopt;
    const std::string expected = dataset ? std::string(to_string(*dataset))
                                         : "KITTI object, tracking or raw, MPII, Human3.6M, "
                                           "recordings of an event camera, images "
                                           "or videos";
    throw InputError("expected " + expected + ", got " +
                     (other ? std::string(to_string(other->layout->dataset)) : "none of these") +
                     ", in " + path.string());
  }
  FoundSource found;
  found.dataset = place->layout->dataset;
  found.layout = place->layout->layout;
  found.title = place->layout->title;
  found.root = place->root;
  place->layout->complete(found);
  if (found.dataset != DatasetKind::kFrames) return {std::move(found)};
  std::vector<FoundSource> sources = find_own_labels(std::move(found));
  note_dataset_above(sources.front());
  return sources;
}

bool may_be_source(const fs::path& path) {
  return has_folder(path) || is_video_name(path) || may_be_recording(path);
}

}  // namespace eventgan
