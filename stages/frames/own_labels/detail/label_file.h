#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "stages/frames/naming/found_frames.h"

namespace eventgan {

/// The names of all images and videos of a source, once a file asks for them.
class ImageNames {
 public:
  explicit ImageNames(const std::vector<FoundFrames>& places) : places_(places) {}

  bool is_stem(const std::string& stem) const { return list().stems_.contains(stem); }
  bool are_videos() const { return list().are_videos_; }

  /// Of a folder of images, or of it and more: "M0101_gt_whole".
  bool is_sequence(const std::string& stem) const;

  /// The one that a text names: by its path, with an extension or without. A number alone may be
  /// anything, unless it has zeros before it or many digits; a word alone, too.
  const std::string* find(std::string_view text) const;

 private:
  const ImageNames& list() const;

  const std::vector<FoundFrames>& places_;
  mutable bool is_listed_ = false, are_videos_ = false;
  mutable std::unordered_set<std::string> stems_;
  mutable std::set<std::string> sequences_;
};

/// What is seen of a file that may have labels.
struct LabelFile {
  const std::filesystem::path& path;
  const ImageNames& images;
  WholeFiles& files;
  bool is_of_image;     ///< has the name of an image
  bool is_of_sequence;  ///< has that of a folder of images
  std::string text;     ///< its beginning

  const JsonGlimpse& json() const { return files.json(path); }
  bool has(std::string_view word) const { return text.find(word) != text.npos; }
};

/// What is known of a kind of file that has no reader, or that no reader takes.
struct UnreadFormat {
  std::string_view title, extension;
  bool (*fits)(const LabelFile& file);
  std::string_view reason, advice;
};

/// The first format of those with this extension that the file fits; null if it fits none.
const UnreadFormat* unread_format_of(const LabelFile& file, std::string_view extension);

/// Whether a text is of cameras or of photographs' EXIF data, and has no labels beside.
bool is_of_cameras(const std::string& text);

/// What a file says of the images.
struct Said {
  bool names_images = false;
  bool has_numbers = false;  ///< as boxes, joints or tracks do
  bool has_words = false;    ///< more than names
};

/// Looks for names of images in texts, JSON, XML, MAT (version 5) and NumPy files.
Said said_by(const LabelFile& file, std::string_view extension);

}  // namespace eventgan
