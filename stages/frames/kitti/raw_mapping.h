#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// A frame of KITTI raw.
struct RawFrame {
  std::string date;   ///< "2011_09_26"
  std::string drive;  ///< "2011_09_26_drive_0052_sync"
  std::int64_t number = 0;
  bool operator==(const RawFrame&) const = default;
};

/// Where the training pictures of KITTI object come from, as the devkit's two files tell: picture n
/// (from 0) is line rand[n] (from 1) of the mapping, whose lines read "DATE DRIVE FRAME".
class RawMapping {
 public:
  /// Parses mapping/train_rand.txt and mapping/train_mapping.txt; the paths are for messages.
  /// Throws InputError for anything that is not as above.
  RawMapping(std::string_view rand, const std::string& rand_path, std::string_view mapping,
             const std::string& mapping_path);

  /// Nothing for a picture that the devkit does not know.
  std::optional<RawFrame> find(std::int64_t object_number) const;

 private:
  std::vector<RawFrame> frames_;  ///< by object number
};

}  // namespace eventgan
