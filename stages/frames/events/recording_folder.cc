#include "stages/frames/events/recording_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/frames/events/recording_flow.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/yolo_text.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Prophesee's NAME_bbox.npy is that of NAME_td.dat, NAME_td.dat.h5 and NAME.raw.
std::string bbox_name(std::string name) {
  for (const std::string_view events : {std::string_view("_td.dat"), std::string_view("_td")}) {
    if (!name.ends_with(events)) continue;
    name.resize(name.size() - events.size());
    break;
  }
  return name + "_bbox.npy";
}

bool is_label_file(const fs::path& file) {
  return file.extension() == ".csv" || file.extension() == ".json" ||
         file.filename().string().ends_with("_bbox.npy");
}

class FolderSearch {
 public:
  FolderSearch(const SourceSpec& spec, const fs::path& base) : options_(spec.recording) {
    find_recordings(spec, base);
    if (spec.flow) {
      pass_labels_over(spec, base);
    } else {
      find_labels(spec, base);
    }
  }

  RecordingFolder take() { return std::move(found_); }

 private:
  void add(const std::string& name, const std::string& path, RecordingFormat format) {
    const auto [recorded, is_new] = found_.recordings.try_emplace(name);
    const auto is_csv = [](const fs::path& file) { return file.extension() == ".csv"; };
    if (!is_new && is_csv(path) != is_csv(recorded->second.path)) {  // tools write one beside it
      found_.notes.push_back("left out, since the recording is there in another file: " +
                             (is_csv(path) ? path : recorded->second.path));
      if (is_csv(path)) return;
    } else if (!is_new) {
      throw InputError("expected recordings of different names, got " + name + " twice, in " +
                       path);
    }
    recorded->second.path = path;
    recorded->second.format = format;
  }

  void find_recordings(const SourceSpec& spec, const fs::path& base) {
    const fs::path root = base / spec.root;
    /// `written`: as FrameRef::path is.
    const auto spelled = [&](const fs::path& written) {
      const fs::path file = event_file(base / written, options_);
      return (written / file.lexically_relative(base / written)).generic_string();
    };
    if (const auto format = find_recording_format(root, options_)) {
      fs::path named = fs::absolute(root).lexically_normal();
      if (!named.has_filename()) named = named.parent_path();
      const bool is_folder = fs::is_directory(root);
      add((is_folder ? named.filename() : named.stem()).string(),
          is_folder ? spelled(spec.root) : spec.root, *format);
      default_labels_ = named.parent_path();
      return;
    }
    if (fs::is_regular_file(root)) throw InputError(recording_fault(root, options_).reason);
    const SourceRoot folder(spec.root, base);
    folder.require_folder("");
    std::vector<std::string> left_out;
    std::string reason;  // of the last
    for (const std::string& name : folder.folders_in("")) {
      if (const auto format = find_recording_format(folder.on_disk(name), options_)) {
        add(name, spelled(folder.written(name)), *format);
      } else {
        left_out.push_back(name);
      }
    }
    for (const fs::path name : folder.files_in("")) {
      if (const auto format = find_recording_format(folder.on_disk(name.string()), options_)) {
        add(name.stem().string(), folder.written(name.string()), *format);
        continue;
      }
      const RecordingFault fault = recording_fault(folder.on_disk(name.string()), options_);
      if (fault.is_recording) {
        found_.unreadable.push_back(fault.reason);
        found_.unopened.emplace(name.stem().string(), fault.reason);
      } else if (!is_label_file(name)) {
        left_out.push_back(name.string());
        reason = fault.reason;
      }
    }
    if (found_.recordings.empty()) {
      std::vector<std::string_view> titles;
      for (const RecordingFormatRow& row : kRecordingFormats) titles.push_back(row.title);
      if (!found_.unreadable.empty()) reason = found_.unreadable[0];
      throw InputError(fmt::format(
          "expected a recording of an event camera ({}), or a folder of them, got none, in {}{}",
          fmt::join(titles, ", "), root.string(), reason.empty() ? "" : " (" + reason + ")"));
    }
    std::erase(left_out, yolo_names_file(root));
    for (const auto& [name, file] : found_.recordings) {
      if (spec.flow) std::erase(left_out, mvsec_flow_name(file.path));
    }
    std::erase_if(left_out, [&](const fs::path& name) {  // labels, or told of as no such
      const auto recorded = found_.recordings.find(name.stem().string());
      return is_window_label_file(name) && recorded != found_.recordings.end() &&
             recorded->second.format == RecordingFormat::kTable;
    });
    if (!left_out.empty()) {
      found_.notes.push_back(counted(left_out, "entry", " left out in " + folder.written("")));
    }
    default_labels_ = root;
  }

  /// Whether a text in the folder has YOLO's boxes: beside it an empty one has none, else that may
  /// be anything's.
  bool has_texts(const fs::path& folder) {
    if (has_texts_) return *has_texts_;
    std::error_code ignored;
    has_texts_ =
        std::ranges::any_of(fs::directory_iterator(folder, ignored), [](const auto& entry) {
          std::error_code unknown;
          return is_window_label_file(entry.path()) && entry.is_regular_file(unknown) &&
                 is_window_label_text(entry.path()).value_or(false);
        });
    return *has_texts_;
  }

  void find_labels(const SourceSpec& spec, const fs::path& base) {
    const fs::path named = base / spec.annotations.value_or("");
    if (spec.annotations && !fs::is_directory(named)) {
      if (found_.recordings.size() > 1) {
        throw UsageError(
            "annotations: expected a folder of NAME.csv, NAME.json, NAME_bbox.npy or NAME.txt "
            "for " +
            std::to_string(found_.recordings.size()) + " recordings, got a file, in " + spec.root);
      }
      FoundFile& recorded = found_.recordings.begin()->second;
      if (is_window_label_file(named) && recorded.format != RecordingFormat::kTable) {
        throw UsageError(
            "annotations: expected NAME.csv, NAME.json or NAME_bbox.npy, since only a table (.npy, "
            ".npz, .csv) can be one window, got " +
            *spec.annotations + ", in " + spec.root);
      }
      recorded.set_labels(*spec.annotations, named);
      note_names_of_windows();
      return;
    }
    const fs::path folder = spec.annotations ? named : default_labels_;
    for (auto& [name, recorded] : found_.recordings) {
      std::vector<fs::path> files = {folder / (name + ".csv"), folder / (name + ".json"),
                                     folder / bbox_name(name)};
      if (recorded.format == RecordingFormat::kTable) files.push_back(folder / (name + ".txt"));
      // A table of events is a .csv, too.
      const fs::path own = fs::absolute(base / recorded.path).lexically_normal();
      std::erase_if(files, [&](const fs::path& file) {
        return !fs::exists(file) ||
               (file.extension() == ".json" && is_manifest(beginning_of(file))) ||
               (is_window_label_file(file) && !fs::is_regular_file(file)) ||
               fs::absolute(file).lexically_normal() == own;
      });
      std::erase_if(files, [&](const fs::path& file) {
        const bool is_text = is_window_label_file(file);
        const bool is_other =
            is_text ? !is_window_label_text(file).value_or(files.size() == 1 && has_texts(folder))
                    : file.extension() == ".csv" && !is_label_table(file);
        if (is_other) {
          found_.notes.push_back(
              (is_text ? "no labels, since its first line is not YOLO's (class x y w h): "
                       : "no labels, since its first line has none of their columns: ") +
              file.string());
        }
        return is_other;
      });
      if (files.empty() && recorded.format == RecordingFormat::kDsec) {
        if (const fs::path tracks = find_tracks(name, own, spec, folder); !tracks.empty()) {
          files.push_back(tracks);
        }
      }
      if (files.size() > 1) {
        throw InputError("expected labels in one file, got two, in " + files[0].string() + " and " +
                         files[1].string());
      }
      if (!files.empty()) recorded.set_labels(written(files[0], spec, base), files[0]);
    }
    const auto is_labelled = [](const auto& entry) { return !entry.second.label_file.empty(); };
    if (std::ranges::none_of(found_.recordings, is_labelled)) {
      if (!spec.annotations) return;
      throw InputError(
          "expected NAME.csv, NAME.json, NAME_bbox.npy or NAME.txt of a recording, got none, in " +
          folder.string());
    }
    std::vector<std::string> without;
    std::erase_if(found_.recordings, [&](const auto& entry) {
      if (is_labelled(entry)) return false;
      without.push_back(entry.first);
      return true;
    });
    if (!without.empty()) {
      found_.notes.push_back(
          counted(without, "recording", " without labels left out in " + spec.root));
    }
    note_names_of_windows();
  }

  /// Windows of flow have their own times, and no other labels, not even damaged ones.
  void pass_labels_over(const SourceSpec& spec, const fs::path& base) {
    RecordingFolder all = found_;
    bool has_labels = false;
    try {
      find_labels(spec, base);
      has_labels = std::ranges::any_of(
          found_.recordings, [](const auto& entry) { return !entry.second.label_file.empty(); });
    } catch (const InputError&) {
      has_labels = true;
    }
    found_ = std::move(all);
    if (!has_labels) return;
    found_.notes.push_back("labels are not read, since flow has times of its own, in " + spec.root);
  }

  /// DSEC-Det's boxes, in a folder of its sequences or with the events; empty if there are none, or
  /// they are of other pixels.
  fs::path find_tracks(const std::string& name, const fs::path& events_file, const SourceSpec& spec,
                       const fs::path& folder) {
    const fs::path events = events_file.parent_path().parent_path();  // of SEQUENCE/events/left
    if (!spec.annotations && events.filename() != "events") return {};
    const fs::path sequence = spec.annotations ? folder / name : events.parent_path();
    fs::path tracks = sequence / "object_detections" / options_.camera / "tracks.npy";
    if (!fs::is_regular_file(tracks)) return {};
    const bool has_pixels = events_file.filename() == "events.h5" && !options_.rectify;
    if (spec.annotations || has_pixels) return tracks;
    found_.notes.push_back(
        "no labels, since they are of the pixels of events.h5, not rectified (\"annotations\" "
        "takes them): " +
        tracks.string());
    return {};
  }

  /// Of windows' texts, which have numbers for classes.
  void note_names_of_windows() {
    const auto window = std::ranges::find_if(found_.recordings, [](const auto& entry) {
      return is_window_label_file(entry.second.label_file_on_disk);
    });
    if (window == found_.recordings.end()) return;
    if (!WindowLabels().companions(window->second.label_file_on_disk).empty()) return;
    const fs::path folder = fs::path(window->second.label_file).parent_path();
    found_.notes.push_back(
        "classes are named by their numbers, since no data.yaml or classes.txt with names is in " +
        (folder.empty() ? "." : folder.string()) + " or the folder above it");
  }

  /// Relative to the manifest where the root is.
  static std::string written(const fs::path& file, const SourceSpec& spec, const fs::path& base) {
    if (spec.annotations) {
      return (fs::path(*spec.annotations) / file.lexically_relative(base / *spec.annotations))
          .generic_string();
    }
    if (fs::path(spec.root).is_absolute()) return file.generic_string();
    return file.lexically_normal()
        .lexically_relative(fs::absolute(base).lexically_normal())
        .generic_string();
  }

  RecordingOptions options_;
  RecordingFolder found_;
  std::optional<bool> has_texts_;
  fs::path default_labels_;  ///< where labels lie unless the manifest says
};

}  // namespace

RecordingFolder look_into_recordings(const SourceSpec& spec, const fs::path& base) {
  return FolderSearch(spec, base).take();
}

std::string written_beside(const fs::path& beside, const fs::path& file,
                           const std::string& written_file) {
  const auto normal = [](const fs::path& path) { return fs::absolute(path).lexically_normal(); };
  const fs::path from_file = normal(beside).lexically_relative(normal(file).parent_path());
  fs::path written = fs::path(written_file).parent_path() / from_file;
  if (from_file.has_parent_path()) written = written.lexically_normal();  // left/../../images
  return written.generic_string();
}

}  // namespace eventgan
