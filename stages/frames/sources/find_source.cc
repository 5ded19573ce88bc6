#include "stages/frames/sources/find_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <system_error>
#include <utility>

#include "manifests/files/csv_records.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/sources/dataset_kinds.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct Place {
  DatasetKind dataset;
  const DatasetLayout* layout;
  fs::path root;

  std::string_view word() const { return to_string(dataset); }
  std::string_view title() const {
    return layout->title.empty() ? dataset_row(dataset).title : layout->title;
  }
};

/// `own_too`: images of one's own may be anything, so that these are asked last.
std::optional<Place> look_at(const fs::path& root, std::optional<DatasetKind> dataset,
                             bool own_too) {
  for (const DatasetReader* const reader : kDatasetReaders) {
    if (dataset && reader->kind != *dataset) continue;
    if (is_own(reader->kind) && !own_too) continue;
    for (const DatasetLayout& layout : reader->layouts) {
      // Labels of it whose images are of one's own, and may have others.
      const bool has_others = !layout.image_folder.empty() &&
                              !has_folder(root / layout.image_folder) &&
                              has_folder(root / "images");
      if (layout.fits(root) && !has_others) return Place{reader->kind, &layout, root};
    }
  }
  return std::nullopt;
}

/// Whether `simulate` wrote a recording there, as its settings tell: perhaps of frames beside it.
bool is_simulated(const Place& place) {
  constexpr std::string_view kSettings = "\"libraries\":\"OpenCV ";
  if (!has_events(place.dataset)) return false;
  return std::ranges::any_of(look_into(place.root).files, [&](const std::string& name) {
    const std::string text = beginning_of(place.root / name);
    return text.find(kSettings) != text.npos;
  });
}

/// With what lies beside it; of some layouts several.
std::vector<FoundSource> source_of(const Place& place) {
  FoundSource found;
  found.dataset = place.dataset;
  found.layout = place.layout->word;
  found.title = place.title();
  found.root = place.root;
  if (place.layout->complete) return place.layout->complete(std::move(found));
  return {std::move(found)};
}

std::optional<Place> look_around(const fs::path& path, std::optional<DatasetKind> dataset) {
  if (auto found = look_at(path, dataset, /*own_too=*/false)) return found;
  std::vector<std::string> folders = look_into(path).folders;
  std::erase_if(folders, [](const std::string& name) { return name.starts_with('.'); });
  drop_label_folders(path, folders);
  const auto look_below = [&](bool own_too) {
    std::vector<Place> below;
    for (const std::string& name : folders) {
      if (const auto found = look_at(path / name, dataset, own_too)) below.push_back(*found);
    }
    // Where KITTI object takes paired frames from.
    const bool is_part = std::ranges::any_of(below, [](const Place& place) {
      return place.dataset == DatasetKind::kKittiObject && source_of(place).front().raw_root;
    });
    std::erase_if(below, [&](const Place& place) {
      return is_part && place.dataset == DatasetKind::kKittiRaw;
    });
    return below;
  };
  std::vector<Place> below = look_below(/*own_too=*/false);
  if (std::ranges::all_of(below, is_simulated)) {
    if (auto own = look_at(path, dataset, /*own_too=*/true)) return own;
  }
  if (below.size() == 1) return below.front();
  below = look_below(/*own_too=*/true);
  const auto has_videos = [](const Place& place) {
    return std::ranges::any_of(look_into(place.root).files, is_video_name);
  };
  if (below.size() == 1 && has_videos(below.front())) return below.front();
  if (below.size() < 2) return std::nullopt;
  std::string names, frames, events;
  for (const Place& found : below) {
    names += (names.empty() ? "" : ", ") + found.root.filename().string() + " (" +
             std::string(found.word()) + ")";
    (has_events(found.dataset) ? events : frames) += " \"" + found.root.string() + "\"";
  }
  std::string lines;
  for (const std::string& roots : {frames, events}) {
    if (!roots.empty())
      lines += (lines.empty() ? "" : "; of the recordings ") + ("eventgan init" + roots);
  }
  throw InputError("expected one dataset, got " + std::to_string(below.size()) + ": " + names +
                   ", in " + path.string() + " (one manifest of several: " + lines + ")");
}

/// The dataset that a folder is a part of, if the one above it is its root.
std::optional<Place> whole_of(const fs::path& part) {
  const std::string name = part.filename().string();
  const fs::path above = part.parent_path();
  for (const DatasetReader* const reader : kDatasetReaders) {
    for (const DatasetLayout& layout : reader->layouts) {
      const bool may_be = layout.may_be_part != nullptr && layout.may_be_part(name);
      if (may_be && layout.fits(above)) return Place{reader->kind, &layout, above};
    }
  }
  return std::nullopt;
}

/// Says so where what was taken as frames is a part of a dataset, whose labels and pairs it does
/// not have alone: KITTI's image_2 holds images of scenes that have nothing to do with each other.
void note_dataset_above(FoundSource& found) {
  constexpr int kLevels = 4;  // S1/Walking-1/imageSequence/54138969
  fs::path part = found.root;
  for (int level = 0; level < kLevels; ++level, part = part.parent_path()) {
    const auto whole = whole_of(part);
    if (!whole) continue;
    std::string remark = "warning: this is only a part of " + std::string(whole->title()) +
                         ", without its labels and pairs: run eventgan init \"" +
                         whole->root.string() + "\"";
    const std::string_view images = whole->layout->image_folder;
    if (!images.empty() && !has_folder(whole->root / images)) {
      remark += " once the images are in " + std::string(images);
    }
    found.remarks.insert(found.remarks.begin(), remark);
    found.unread.clear();  // they are that dataset's, as the remark says
    return;
  }
}

/// What `init` knows, for a person.
std::string known_titles() {
  std::string titles;
  for (const DatasetReader* const reader : kDatasetReaders) {
    if (reader->layouts.empty()) continue;
    titles += (titles.empty() ? "" : ", ") + std::string(dataset_row(reader->kind).title);
  }
  return titles;
}

/// What a file is that somebody gave in place of a dataset, and what to do with it.
struct FileKind {
  std::string_view title, way_out;
};

constexpr std::string_view kGiveFolder =
    "give the folder of its images: labels in or beside it are found";

std::optional<FileKind> kind_of_text(std::string_view text) {
  const auto has = [&](const char* what) { return text.find(what) != text.npos; };
  text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
  const std::string_view line = trimmed(text.substr(0, text.find('\n')));
  if (line.starts_with("<")) return FileKind{"XML, as Pascal VOC's and CVAT's labels", kGiveFolder};
  if (line.starts_with("//") || line.starts_with("/*"))
    return std::nullopt;  // a manifest's comment
  if (line.starts_with("{") || line.starts_with("[")) {
    const bool is_coco = has("\"images\"") && (has("\"annotations\"") || has("\"file_name\""));
    if (is_coco && !has("eventgan-")) return FileKind{"labels as COCO's", kGiveFolder};
    return std::nullopt;
  }
  constexpr std::array kImages{".jpg", ".jpeg", ".png"};
  const fs::path name(line);
  if (is_video_name(name) || std::ranges::find(kImages, lower_extension(name)) != kImages.end()) {
    return FileKind{"a list of files",
                    "give the folder that holds them, or each: eventgan init A B"};
  }
  if (line.find(',') != line.npos) return FileKind{"a table", kGiveFolder};
  return std::nullopt;
}

/// Whether a file that is no recording as it is may be meant as one: HDF5, arrays, or a table with
/// times and places, or of four numbers a line.
bool may_have_events(const fs::path& file, std::string_view text) {
  constexpr std::array kExtensions{".npy", ".npz", ".h5", ".hdf5"};
  const std::string extension = lower_extension(file);
  if (std::ranges::find(kExtensions, extension) != kExtensions.end()) return true;
  const auto first = CsvReader(text).next();
  if (extension != ".csv" || !first) return false;
  bool has_time = false, has_x = false;
  for (const std::string_view field : first->fields) {
    has_time |= field == "t" || field.starts_with("t_") || field.starts_with("ts") ||
                field.starts_with("time");
    has_x |= field == "x";
  }
  const auto is_number = [](std::string_view field) {
    return field.find_first_not_of("+-.eE0123456789") == field.npos;
  };
  return (has_time && has_x) ||
         (first->fields.size() == 4 && std::ranges::all_of(first->fields, is_number));
}

std::optional<FileKind> kind_of_file(std::string_view text) {
  constexpr FileKind kCheckpoint{"a checkpoint of PyTorch",
                                 "eventgan import-weights makes weights of EventGAN's, which a "
                                 "manifest's \"generator\" names"};
  constexpr FileKind kArchive{"an archive", "unpack it and give the folder"};
  if (text.starts_with("\xff\xd8\xff") || text.starts_with("\x89PNG")) {
    return FileKind{"an image", "give its folder"};
  }
  if (text.starts_with("PK")) {
    return text.find("/data.pkl") != text.npos ? kCheckpoint : kArchive;
  }
  if (text.starts_with("\x80\x02")) return kCheckpoint;
  if (text.starts_with("\x1f\x8b")) return kArchive;
  if (text.size() > 8 && text[8] == '{' && text[7] == '\0') {
    return FileKind{"weights (safetensors)",
                    "a manifest names them: \"generator\": {\"weights\": "
                    "...}"};
  }
  return kind_of_text(text);
}

/// Of images or recordings that lie deeper than they are looked for: where the first are, and the
/// folder to give.
std::string deeper_data(const fs::path& root) {
  constexpr std::size_t kMostFolders = 10'000;
  std::vector<fs::path> folders = {root};  // breadth first, as names are ordered
  for (std::size_t i = 0; i < folders.size() && i < kMostFolders; ++i) {
    const FolderListing listing = look_into(folders[i]);
    const bool has_images = std::ranges::any_of(listing.files, [](const fs::path& name) {
      return std::ranges::find(kImageExtensions, lower_extension(name)) != kImageExtensions.end();
    });
    const auto may_be_recording = dataset_reader(DatasetKind::kRecording).may_be_file;
    const bool has_recordings = std::ranges::any_of(listing.files, may_be_recording) &&
                                look_at(folders[i], DatasetKind::kRecording, /*own_too=*/false);
    if (!has_images && !has_recordings) {
      for (const std::string& name : listing.folders) {
        const bool is_flow = std::ranges::find(kKittiFlow, name) != kKittiFlow.end();
        if (!name.starts_with('.') && !is_flow) folders.push_back(folders[i] / name);
      }
      continue;
    }
    fs::path give = root;
    const fs::path below = folders[i].lexically_relative(root);
    for (auto part = below.begin(); part != below.end() && !look_at(give, {}, true); ++part) {
      give /= *part;
    }
    if (give == root) return "";
    fs::path part = root;  // what is a part of a dataset is little without it
    for (int level = 0; level < 4; ++level, part = part.parent_path()) {
      if (const auto whole = whole_of(part)) {
        return "; this is only a part of " + std::string(whole->title()) +
               ": run eventgan convert \"" + whole->root.string() + "\"";
      }
    }
    return (has_images ? "; images lie in " : "; recordings lie in ") + below.generic_string() +
           ": run eventgan convert \"" + give.string() + "\"";
  }
  return "";
}

}  // namespace

std::string fault_of_file(const fs::path& file) {
  constexpr std::size_t kLooked = 1 << 16;
  std::string reason;
  const auto input = InputFile::open(file, reason);
  if (!input) return {};
  std::string text(kLooked, '\0');
  text.resize(input->read_some(0, text));
  const RecordingFault recording = recording_fault(file, {});
  if (recording.is_recording || may_have_events(file, text)) return recording.reason;
  const auto kind = kind_of_file(text);
  if (!kind) return {};
  return "expected a manifest, folder, video or recording, got " + std::string(kind->title) +
         ", in " + file.string() + " (" + std::string(kind->way_out) + ")";
}

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
    if (const std::string fault = fault_of_file(root); !fault.empty()) throw InputError(fault);
    const auto other = dataset ? look_around(root, std::nullopt) : std::nullopt;
    if (!dataset) {
      throw InputError("expected " + known_titles() + ", got none of these, in " + path.string() +
                       deeper_data(root));
    }
    throw InputError(fmt::format(
        "expected {} ({}), got {}, in {} (manifests/guides/datasets.md shows what such a "
        "folder holds{})",
        dataset_row(*dataset).title, to_string(*dataset),
        other ? fmt::format("{} ({})", other->title(), other->word()) : "none", path.string(),
        other ? fmt::format("; eventgan init \"{}\" takes what is there", root.string()) : ""));
  }
  std::vector<FoundSource> sources = source_of(*place);
  if (is_own(place->dataset)) note_dataset_above(sources.front());
  return sources;
}

void go_without_labels(std::vector<FoundSource>& sources) {
  for (FoundSource& source : sources) {
    if (!is_own(source.dataset)) {
      throw UsageError(std::string(kNoLabelsOption) +
                       ": expected images or videos of your own, got " +
                       std::string(to_string(source.dataset)) + ", in " + source.root.string());
    }
    source.labels.reset();
    source.unread.clear();
    source.has_no_labels = true;
  }
}

bool may_be_source(const fs::path& path) {
  return has_folder(path) || std::ranges::any_of(kDatasetReaders, [&](const auto* reader) {
           return reader->may_be_file != nullptr && reader->may_be_file(path);
         });
}

std::vector<std::string_view> recognised_datasets() {
  std::vector<std::string_view> words;
  for (const DatasetReader* const reader : kDatasetReaders) {
    if (!reader->layouts.empty()) words.push_back(to_string(reader->kind));
  }
  return words;
}

}  // namespace eventgan
