#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/naming/own_labels.h"

namespace eventgan {

struct FoundFrames;  // found_frames.h

/// How the files of a format are called, and their folders: all in small letters, on disk in any.
struct LabelFiles {
  std::string_view extension;                   ///< ".txt", in small letters
  std::vector<std::string_view> image_folders;  ///< in an image's path the last of these ...
  std::vector<std::string_view> label_folders;  ///< ... is one of these in its label's
  /// No label, though it has the extension.
  bool (*is_other)(std::string_view file) = [](std::string_view) { return false; };
  bool may_lie_beside = true;  ///< in the folder of images itself; false: images may look alike
};

/// The folder of labels that stands for a folder of images, at its own path; empty if there is
/// none.
std::filesystem::path label_folder_of(const std::filesystem::path& images, const LabelFiles& names);

/// Where labels of these frames lie that have a file each: in the folder that stands for the root,
/// or beside the images, or in a folder of labels beside or above them; empty if there are none.
std::filesystem::path find_label_files(const FoundFrames& frames, const LabelFiles& names);

/// Labels of which each image has a file, NAME.EXTENSION of NAME.png. It is at the image's own path
/// with the folder of images replaced by that of labels, if that is below `path`; else at the
/// image's path below ROOT, below `path`/LABELS or `path`. Of frame 12 of clip.mp4 it is
/// clip_000012 or clip/000012 there, or frame_000012 or 000012 of the only video, with any number
/// of zeros. The label_key is the file's path below `path`.
class FilePerImage : public OwnLabels {
 public:
  std::string label_place(const std::string& label_key) const override {
    return root_.written(label_key);
  }

 protected:
  /// Finds the files and gives the frames their labels. Throws InputError if there is no folder
  /// `path`.
  FilePerImage(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource source,
               LabelFiles names);

  const SourceRoot& root() const { return root_; }

 private:
  using Stems = std::map<std::string, std::size_t>;  ///< of images, with their frames

  std::vector<std::string> files_in(const std::string& folder, const Stems& images = {}) const;
  std::string folder_of(const std::string& images) const;
  std::string in_label_folder(const std::string& images) const;
  void find_of_images();
  void find_of_videos();
  void note_unused(const std::string& folder, const std::set<std::string>& used);
  void note_others(const std::map<std::string, Stems>& images, const std::set<std::string>& used);

  SourceRoot root_;
  LabelFiles names_;
};

}  // namespace eventgan
