#include "stages/frames/naming/file_per_image.h"

#include <algorithm>
#include <utility>

#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/naming/frame_names.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

std::string joined(const std::string& folder, const std::string& name) {
  return folder.empty() || name.empty() ? folder + name : folder + "/" + name;
}

fs::path normal(const fs::path& path) { return fs::absolute(path).lexically_normal(); }

/// A folder of labels, "labels" or "annotations/xmls", in another one, in whatever letters.
template <class Find>
fs::path label_folder_in(const fs::path& above, std::string_view name, Find find) {
  fs::path folder = above;
  for (const fs::path& part : fs::path(name)) {
    folder = find(folder, part.string());
    if (folder.empty()) return {};
  }
  return folder;
}

/// A name as "frame_000012" or "000012".
bool is_of_any_video(const NumberInName& name) {
  return !name.digits.empty() && name.after.empty() && names_no_video(name.before);
}

}  // namespace

fs::path label_folder_of(const fs::path& images, const LabelFiles& names) {
  std::vector<fs::path> parts(images.begin(), images.end());
  std::erase(parts, "");  // "images/"
  const auto last = std::find_if(parts.rbegin(), parts.rend(), [&](const fs::path& part) {
    const std::string name = in_small_letters(part.string());
    return std::ranges::find(names.image_folders, name) != names.image_folders.end();
  });
  if (last == parts.rend()) return {};
  fs::path above, below;
  for (auto part = parts.begin(); part != last.base() - 1; ++part) above /= *part;
  for (auto part = last.base(); part != parts.end(); ++part) below /= *part;
  for (const std::string_view label_folder : names.label_folders) {
    const fs::path folder = label_folder_in(above, label_folder, folder_named);
    if (folder.empty()) continue;
    fs::path path = below.empty() ? folder : folder / below;
    if (has_folder(path)) return path;
  }
  return {};
}

fs::path find_label_files(const FoundFrames& frames, const LabelFiles& names) {
  const auto files_in = [&](const fs::path& folder) {
    std::vector<fs::path> files = names_with(look_into(folder), names.extension);
    std::erase_if(files, [&](const fs::path& file) { return names.is_other(file.string()); });
    return files;
  };
  const auto is_of_frame = [&](const fs::path& name) {
    const std::string stem = name.stem().string();
    if (!frames.is_video) return frames.stems.contains(stem);
    return frames.stems.contains(stem.substr(0, stem.rfind('_'))) ||
           (frames.stems.size() == 1 && is_of_any_video(find_number(stem)));
  };
  const auto has_files = [&](const fs::path& folder) { return !files_in(folder).empty(); };
  std::vector<fs::path> folders = {label_folder_of(frames.root, names)};
  if (names.may_lie_beside) folders.push_back(frames.root);
  for (const fs::path& above : {frames.root, frames.root.parent_path()}) {
    for (const std::string_view name : names.label_folders) {
      folders.push_back(label_folder_in(above, name, [&](const fs::path& in, std::string_view of) {
        return frames.files->folder(in, of);
      }));
    }
  }
  for (const fs::path& folder : folders) {
    if (folder.empty()) continue;
    const auto has_folder_of = [&](const std::string& name) { return has_files(folder / name); };
    const bool are_there =
        frames.stems.empty()
            ? std::ranges::any_of(frames.folders, has_folder_of)
            : std::ranges::any_of(files_in(folder), is_of_frame) ||
                  (frames.is_video && std::ranges::any_of(frames.stems, has_folder_of));
    if (are_there) return folder;
  }
  return {};
}

FilePerImage::FilePerImage(const LabelSpec& spec, const fs::path& base, LabelledSource labelled,
                           LabelFiles names)
    : OwnLabels(std::move(labelled)), root_(spec.path, base), names_(std::move(names)) {
  root_.require_folder("");
  if (source().is_video) {
    find_of_videos();
  } else {
    find_of_images();
  }
  std::ranges::sort(annotation_files_);
  note_without_label(root_.written(""));
}

/// Names of the labels in a folder below `path`. train.txt is one of train.jpg, if `images` have
/// it.
std::vector<std::string> FilePerImage::files_in(const std::string& folder,
                                                const Stems& images) const {
  std::vector<std::string> names = root_.files_in(folder);
  std::erase_if(names, [&](const std::string& name) {
    const bool is_other = names_.is_other(name) && !images.contains(fs::path(name).stem().string());
    return lower_extension(name) != names_.extension || is_other || name.starts_with('.');
  });
  return names;
}

/// Where the labels of a folder of images lie, below `path`.
std::string FilePerImage::folder_of(const std::string& images) const {
  const fs::path standing = label_folder_of(normal(source().root.on_disk(images)), names_);
  if (!standing.empty()) {
    fs::path path = normal(root_.on_disk(""));
    if (!path.has_filename()) path = path.parent_path();  // "data/"
    const std::string below = standing.lexically_relative(path).generic_string();
    const bool is_below = !below.empty() && below != ".." && !below.starts_with("../");
    if (is_below) return below == "." ? "" : below;
  }
  return in_label_folder(images);
}

/// A folder of images below the first of the folders of labels that has it; as it is if none has.
std::string FilePerImage::in_label_folder(const std::string& images) const {
  const fs::path root = root_.on_disk("");
  for (const std::string_view name : names_.label_folders) {
    const fs::path folder = label_folder_in(root, name, folder_named);
    if (folder.empty()) continue;
    std::string below = joined(folder.lexically_relative(root).generic_string(), images);
    if (has_folder(root / below)) return below;
  }
  return images;
}

void FilePerImage::find_of_images() {
  std::map<std::string, Stems> folders;  // of images
  for (std::size_t i = 0; i < source().frames.size(); ++i) {
    const fs::path name(source().frames[i].name);
    folders[name.parent_path().generic_string()].emplace(name.stem().string(), i);
  }
  std::set<std::string> used;
  for (const auto& [images, stems] : folders) {
    const std::string folder = folder_of(images);
    used.insert(folder);
    // What an absent image is called nobody says: most likely as the others.
    const fs::path extension = fs::path(source().frames[stems.begin()->second].name).extension();
    for (const std::string& name : files_in(folder, stems)) {
      const std::string key = joined(folder, name);
      const std::string stem = fs::path(name).stem().string();
      annotation_files_.push_back(root_.written(key));
      const auto frame = stems.find(stem);
      if (frame != stems.end()) {
        give(frame->second, key);
      } else {
        give_absent(joined(images, stem + extension.string()), key);
      }
    }
  }
  note_unused(folder_of(""), used);
  note_others(folders, used);
}

/// Tells of folders with labels beside those that have images.
void FilePerImage::note_unused(const std::string& folder, const std::set<std::string>& used) {
  std::vector<std::string> unused;
  for (const std::string& name : root_.folders_in(folder)) {
    const std::string below = joined(folder, name);
    if (!used.contains(below) && !files_in(below).empty()) unused.push_back(name);
  }
  if (unused.empty()) return;
  notes_.push_back(
      counted(unused, "folder", " of labels without images left out in " + root_.written(folder)));
}

/// Tells of folders with a second label of the same images: labels_old beside labels, xml beside
/// Annotations, labels_old/train beside labels/train.
void FilePerImage::note_others(const std::map<std::string, Stems>& images,
                               const std::set<std::string>& used) {
  constexpr std::size_t kMostFolders = 3;  // of images: the others lie as these do
  const auto has_images = [](const FolderListing& listing) {
    return std::ranges::any_of(listing.folders, is_image_folder) ||
           std::ranges::any_of(listing.files, [](const fs::path& file) {
             const std::string extension = lower_extension(file);
             return std::ranges::find(kImageExtensions, extension) != kImageExtensions.end();
           });
  };
  const fs::path root = normal(root_.on_disk(""));
  std::set<fs::path> known, others;
  for (const std::string& folder : used) known.insert(normal(root / folder / "").parent_path());
  for (const auto& [folder, stems] : images) {
    known.insert(normal(source().root.on_disk(folder) / "").parent_path());
  }
  for (auto entry = images.begin(); entry != images.end(); ++entry) {
    if (std::distance(images.begin(), entry) == kMostFolders) break;
    const auto is_label = [&](const fs::path& name) {
      return lower_extension(name) == names_.extension && !names_.is_other(name.string()) &&
             entry->second.contains(name.stem().string());
    };
    fs::path labels_at = normal(root_.on_disk(folder_of(entry->first)) / "").parent_path();
    fs::path images_at = normal(source().root.on_disk(entry->first) / "").parent_path();
    const auto shared = std::ranges::mismatch(labels_at, images_at).in1;
    fs::path dataset;  // the deepest folder with both
    for (auto part = labels_at.begin(); part != shared; ++part) dataset /= *part;
    fs::path labels_below, images_below;
    for (int level = 0; level < 2 && labels_at != dataset; ++level) {
      const fs::path above = labels_at.parent_path(), images_above = images_at.parent_path();
      for (const std::string& name : look_into(above).folders) {
        const fs::path folder = level == 0 ? above / name : above / name / labels_below;
        const fs::path theirs =
            level == 0 ? images_above / name : images_above / name / images_below;
        const bool is_of_others = theirs != folder && has_folder(theirs);  // of another split
        if (!known.insert(folder).second || is_of_others || name.starts_with("calib") ||
            has_images(look_into(above / name))) {
          continue;
        }
        const FolderListing listing = look_into(folder);
        if (has_images(listing)) continue;
        if (std::ranges::any_of(listing.files, is_label)) others.insert(folder);
      }
      labels_below = labels_at.filename();
      images_below = images_at.filename();
      labels_at = above;
      images_at = images_above;
    }
  }
  if (others.empty()) return;
  std::vector<std::string> written;
  for (const fs::path& folder : others) {
    const fs::path way = root_.written(folder.lexically_relative(root).string());
    written.push_back(way.lexically_normal().generic_string());
  }
  notes_.push_back(
      counted(written, "folder",
              " with more " + std::string(names_.extension) + " files of these images left out"));
}

void FilePerImage::find_of_videos() {
  FrameNames names(source());
  const std::string folder = in_label_folder("");
  const auto take = [&](const std::string& key, const std::string& frame_name) {
    annotation_files_.push_back(root_.written(key));
    const std::size_t frame = names.find(frame_name).frame;
    if (frame < source().frames.size()) {
      give(frame, key);
    } else {
      give_absent(frame_name, key);
    }
  };
  const std::vector<SourceFrame>& frames = source().frames;
  const bool is_only = !frames.empty() && frames.front().sequence == frames.back().sequence;
  for (const std::string& name : files_in(folder)) {
    std::string stem = fs::path(name).stem().string();
    const NumberInName number = find_number(stem);
    if (is_only && is_of_any_video(number)) {
      stem = frames.front().sequence + "/" + number.digits;
    } else if (const std::size_t mark = stem.rfind('_'); mark != std::string::npos) {
      stem[mark] = '/';
    }
    take(joined(folder, name), stem);
  }
  for (const std::string& clip : root_.folders_in(folder)) {
    for (const std::string& name : files_in(joined(folder, clip))) {
      take(joined(joined(folder, clip), name), clip + "/" + fs::path(name).stem().string());
    }
  }
  warn_of_counts_from_1(absent(), names, root_.written(""));
}

}  // namespace eventgan
