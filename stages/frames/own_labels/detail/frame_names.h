#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "stages/frames/own_labels/own_labels.h"

namespace eventgan {

/// Finds the frame that a label file's name of an image means: its path below ROOT, with or without
/// folders that ROOT ends in before it, or a bare name that one folder alone has. Of videos
/// "STEM/NUMBER", with any number of zeros and any extension. Views into the source's frames, which
/// must outlive it.
class FrameNames {
 public:
  explicit FrameNames(const LabelledSource& source);

  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  static constexpr std::size_t kSeveral = kNone - 1;  ///< a bare name in several folders

  struct Match {
    std::size_t frame = kNone;
    std::string below_root;  ///< the name without what ROOT ends in
  };
  Match find(const std::string& name) const;

 private:
  std::size_t look_up(const std::string& below_root) const;

  bool is_video_;
  std::vector<std::string> root_folders_;
  std::unordered_map<std::string_view, std::size_t> by_path_, by_bare_name_;
};

/// "STEM/NUMBER" of "STEM/000NUMBER.EXT"; "NUMBER" of a bare number; empty if there is no number.
std::string video_frame_name(const std::string& name);

}  // namespace eventgan
