#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "stages/frames/naming/own_labels.h"

namespace eventgan {

/// Finds the frame that a label file's name of an image means: its path below ROOT, with or without
/// folders that ROOT ends in before it, or a bare name that one folder alone has. Of videos
/// "STEM/NUMBER", with any number of zeros and any extension, or as STEM.mp4/NUMBER or
/// STEM_NUMBER.png.
///
/// What fits none of these is looked for as tools write it otherwise (Match::is_near): with other
/// folders in front, as long as they do not name another split, another sequence
/// (is_other_sequence) or an image or video that is there; with Windows' \, with %20, with an
/// extension in other letters or without any, with accents written apart (NFD), as a number alone;
/// of the only video as frame_NUMBER. Views into the names, which must outlive it.
class FrameNames {
 public:
  explicit FrameNames(const LabelledSource& source);
  /// `names` as SourceFrame::name.
  FrameNames(std::vector<std::string_view> names, const std::filesystem::path& root, bool is_video);

  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  static constexpr std::size_t kSeveral = kNone - 1;  ///< a bare name in several folders

  struct Match {
    std::size_t frame = kNone;
    std::string below_root = {};  ///< the name without what ROOT ends in
    bool is_near = false;         ///< by another name than its own
    std::string dropped = {};     ///< folders that the name has in front and the frame has not
    bool is_elsewhere = false;    ///< none, but there is such a file outside ROOT
  };
  Match find(const std::string& name);
  /// Without looking for what is near.
  Match find_exactly(const std::string& name) const;

 private:
  using Places = std::unordered_map<std::string, std::size_t>;

  std::size_t look_up(const std::string& below_root) const;
  /// `is_in_root`: the name begins with what ROOT ends in, and that has been cut off.
  Match find_near(const std::string& name, bool is_in_root);
  Match find_near_in_video(const std::vector<std::string>& parts);
  /// Whether folders dropped from a name are another sequence than ROOT's: numbers and names such
  /// as 000001.png are in all of them. "seqB" and "MOT17-02/img1" are others than the roots "seqA"
  /// and "MOT17-04/img1", and "highway" is than "city"; "images/1" and "highway" may both be what
  /// is in a root "images", and "home/me/images" what is in any.
  bool is_other_sequence(const std::vector<std::string>& parts, std::size_t dropped) const;
  bool is_other_image(const std::vector<std::string>& parts, std::size_t dropped,
                      std::size_t frame);
  bool has_other_video(const std::string& folders, const std::string& stem) const;
  void list_near();
  void list_stems();

  bool is_video_;
  std::filesystem::path root_;
  std::vector<std::string_view> names_;
  std::vector<std::string> root_folders_;
  std::unordered_map<std::string_view, std::size_t> by_path_, by_bare_name_;
  Places near_, stems_;                                 ///< once they are asked for
  std::unordered_map<std::string, bool> other_videos_;  ///< by "FOLDERS/STEM", as asked for
};

/// "STEM/NUMBER" of "STEM/000NUMBER.EXT" and "STEM.mp4/000NUMBER"; "NUMBER" of a bare number; empty
/// if there is no number.
std::string video_frame_name(const std::string& name);

/// Frame 0 of the video that a name is of: "walk/0" of "walk/000012.png", "walk_0" of
/// "walk_000012.png"; empty if there is no number.
std::string first_frame_name(const std::string& name);

/// Whether what stands before a frame's number is no video's name: "frame_" of "frame_000012".
bool names_no_video(std::string before);

}  // namespace eventgan
