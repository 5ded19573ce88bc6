#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/find_source.h"
#include "stages/frames/own_labels/detail/frame_names.h"
#include "stages/frames/source_folders.h"

namespace eventgan {

/// What tells a JSON file's format: read as far as that shows, so that keys may be in any order.
struct JsonGlimpse {
  bool is_object = false, is_list = false;   ///< neither: no JSON
  std::vector<std::string> keys;             ///< the object's, or those of a list's first element
  std::vector<std::string> annotation_keys;  ///< of the first of "annotations"
  std::vector<std::string> file_names;       ///< of "images"

  bool has_keys(std::initializer_list<const char*> wanted) const;
  bool is_coco() const;  ///< with boxes
};

/// Cannot fail: what cannot be read is neither object nor list.
JsonGlimpse look_at_json(const std::filesystem::path& file);

/// JSON files and tables, which may label all images below a folder. Each folder is listed once,
/// and each file looked at once: one is above many places.
class WholeFiles {
 public:
  const std::vector<std::filesystem::path>& in(const std::filesystem::path& folder,
                                               std::string_view extension);
  const JsonGlimpse& json(const std::filesystem::path& file);
  /// As the function folder_named.
  std::filesystem::path folder(const std::filesystem::path& above, std::string_view name);

 private:
  std::map<std::filesystem::path, std::map<std::string, std::string>> folders_;
  std::map<std::filesystem::path, std::map<std::string_view, std::vector<std::filesystem::path>>>
      listed_;  ///< by extension
  std::map<std::filesystem::path, JsonGlimpse> json_;
};

/// Images and folders of images, or videos, as a source has them.
struct FoundFrames {
  std::filesystem::path root;
  std::vector<std::string> folders = {};  ///< with images, or with img1 where MOT's labels are
  std::set<std::string> stems = {};       ///< of the images and videos right in the root
  bool is_video = false;                  ///< the stems are videos'
  WholeFiles* files;
  /// Names of all images below the root, once they are asked for.
  mutable std::shared_ptr<std::vector<std::string>> image_names = {};
  mutable std::shared_ptr<FrameNames> names = {};
};

/// The first bytes of a file, where a format shows; a byte order mark left out.
std::string beginning_of(const std::filesystem::path& file);

/// Names of all images below the root, listed once; none of videos.
const std::vector<std::string>& image_names_of(const FoundFrames& frames);

/// How many of the names that a label file has for images are these frames'; of many that are
/// theirs by no exact name (FrameNames) only some are looked up.
std::size_t count_among(const FoundFrames& frames, const std::vector<std::string>& names);

/// The folders in which a file with labels of all frames may lie: the root and the one above,
/// `annotations` in them, and above a folder of images of a split.
std::vector<std::filesystem::path> folders_around(const FoundFrames& frames);

/// Whether a text is of YOLO's boxes, by its first line that says anything: a class, and shares of
/// the image. None if no line does.
std::optional<bool> is_yolo_text(std::string_view text);

/// Names of a folder's files with that extension, in small letters; no hidden ones.
std::vector<std::filesystem::path> names_with(const FolderListing& listing,
                                              std::string_view extension);

/// The split that a folder's name states, in letters of any case: "val" of "valid" and of
/// "VAL2017"; empty if none.
std::string_view split_of(std::string name);

/// A folder of images, or a text that lists some, and the split that it is.
struct SplitPart {
  std::string_view split;  ///< of split_of
  std::filesystem::path place;
};

/// What the data.yaml or obj.data in a folder says of splits, else the lists autosplit_SPLIT.txt in
/// it; train first. What is not there is left out. `file`: which one says so.
std::vector<SplitPart> split_parts(const std::filesystem::path& folder, std::string& file);

/// The lines of a list that say anything, sorted, each once.
std::vector<std::string> images_of_list(const std::filesystem::path& list);

/// Looks for labels of one's own of the frames in found.root, or in a folder of images in it
/// (LabelReader::find). Sets root and labels, and remarks on labels and on folders of images that
/// are there and left out. Where train and val or test have a folder each, with labels of its own,
/// each is a source with its split, as is each of split_parts, else it is one. Where there are no
/// labels, `unread` tells of files that may be some; else a remark does. Cannot fail: what cannot
/// be read is not found.
std::vector<FoundSource> find_own_labels(FoundSource found);

/// Files that name these images, or that are called as one of them or as a sequence, and that
/// nothing reads.
struct UnreadLabels {
  /// "FILE looks like FORMAT labels of these images and is not read: REASON; do ...", a line a kind
  /// of file: of those that may have boxes, joints or tracks.
  std::vector<std::string> lines;
  /// Those that name the images and have no numbers, such as captions; beside labels, all.
  std::vector<std::string> others;
  std::string limit;  ///< what was not looked at, if anything
};

/// Looks into `given` and the folders below it, as deep as images may lie, and into folders of
/// labels beside it. `sources`: with labels, if any were found, which their files are.
UnreadLabels unread_labels(const std::vector<FoundFrames>& places,
                           const std::filesystem::path& given,
                           const std::vector<FoundSource>& sources);

}  // namespace eventgan
