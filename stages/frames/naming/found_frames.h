#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/frame_names.h"

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
  /// All that a table calls its images, by whoever reads it the first time.
  const std::vector<std::string>& table_images(
      const std::filesystem::path& file, const std::function<std::vector<std::string>()>& read);
  /// As the function folder_named.
  std::filesystem::path folder(const std::filesystem::path& above, std::string_view name);

 private:
  std::map<std::filesystem::path, std::map<std::string, std::string>> folders_;
  std::map<std::filesystem::path, std::map<std::string_view, std::vector<std::filesystem::path>>>
      listed_;  ///< by extension
  std::map<std::filesystem::path, JsonGlimpse> json_;
  std::map<std::filesystem::path, std::vector<std::string>> table_images_;
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
  mutable std::shared_ptr<std::vector<std::string>> first_frames = {};  ///< of videos, as well
  mutable std::shared_ptr<FrameNames> names = {};                       ///< of either
};

/// The first bytes of a file, where a format shows; a byte order mark left out.
std::string beginning_of(const std::filesystem::path& file);

/// Whether a JSON file with this beginning is a manifest of a job, a training or a simulation,
/// which may lie beside images, videos or recordings and name them.
bool is_manifest(std::string_view beginning);

/// Names of all images below the root, listed once; none of videos.
const std::vector<std::string>& image_names_of(const FoundFrames& frames);

/// What folders of images are called where their labels lie beside them, in small letters.
inline constexpr std::array<std::string_view, 4> kImageFolders = {"images", "jpegimages", "img1",
                                                                  "imgs"};
bool is_image_folder(const std::string& name);

/// How many of the names that a label file has for images are these frames'; of many that are
/// theirs by no exact name (FrameNames) only some are looked up.
std::size_t count_among(const FoundFrames& frames, const std::vector<std::string>& names);

/// Which of these frames they are: the images' names, of videos "STEM/NUMBER" as far as there is
/// such a video.
std::set<std::string> frames_among(const FoundFrames& frames,
                                   const std::vector<std::string>& names);

/// The folders in which a file with labels of all frames may lie: the root and the one above,
/// `annotations` in them, and above a folder of images of a split.
std::vector<std::filesystem::path> folders_around(const FoundFrames& frames);

/// Names of a folder's files with that extension, in small letters; no hidden ones.
std::vector<std::filesystem::path> names_with(const FolderListing& listing,
                                              std::string_view extension);

}  // namespace eventgan
