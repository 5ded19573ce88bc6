#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/listing/numbered_sequence.h"

namespace eventgan {

/// KITTI's folders of optical flow: of all pixels whose motion is known, and of those of them that
/// both images show. They lie beside the left camera's folders, of whose images they are.
inline constexpr std::array<std::string_view, 2> kKittiFlow{"flow_occ", "flow_noc"};
inline constexpr std::array<std::string_view, 3> kKittiLeftCamera{"image_2", "image_0",
                                                                  "colored_0"};

/// The extension with its dot, in small letters: ".json" for "a.JSON"; empty if there is none.
std::string lower_extension(const std::filesystem::path& file);

/// Of videos of one name in a folder, that of the earliest counts.
inline constexpr auto kVideoExtensions =
    std::to_array<std::string_view>({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg",
                                     ".mpeg", ".ts", ".mts", ".wmv", ".flv", ".gif"});

/// True for a name with one of these, in small or capital letters.
bool is_video_name(const std::filesystem::path& file);

/// Orders names as people do: runs of digits by their value ("img2" before "img10"), all else by
/// its bytes. Names that differ only in leading zeros ("1", "01") are ordered by their bytes, so
/// the order is total.
bool natural_less(std::string_view a, std::string_view b);

/// What lies in a folder of images with any names.
struct ImageFolder {
  /// If all names are alike but for their number (find_number), each image has it, and a missing
  /// number is a missing frame. Otherwise they are counted from 0 in natural order.
  NumberedSequence frames;
  /// The .json files (also .JSON) beside them: name without extension to name. Of two that differ
  /// only in the extension's letters, the first by name counts.
  std::map<std::string, std::string> sidecars;
  std::vector<std::string> folders;  ///< names of the folders in it, sorted
  /// Other files, images and .json files that give way to another of their name, and what no plan
  /// can name, the program's own output and pictures (FolderListing::passed_over); sorted.
  std::vector<std::string> left_out;
};

/// Lists `folder`, passing over hidden entries. Of two images of one name a PNG gives way, since it
/// may be the other's mask; else the one of the extension that comes first in kImageExtensions
/// counts. Where the first or last PNG is a picture of `preview` or `realism`, all of these are
/// left out. An absent folder is empty. Throws InputError if it cannot be listed.
ImageFolder list_image_folder(const std::filesystem::path& folder);

/// Takes the folders that are called as those of labels (masks, instances, annotations, labels, and
/// those of KITTI's flow and stereo, flow_occ, disp_noc_0; in any letters) from `names`, folders in
/// `root`, where images or videos lie in `root` or, up to two folders deep, in another folder of
/// it. Cannot fail.
void drop_label_folders(const std::filesystem::path& root, std::vector<std::string>& names);

/// Throws UsageError if images or videos lie in `folder` that the program has not drawn: among
/// these, what a command is about to draw could not be told from them.
void require_no_images(const std::filesystem::path& folder);

/// Frames that follow each other, as the names of a folder's images tell.
struct NamedSequence {
  /// What the names say before the number, such as "aachen_000000"; empty of the only sequence, and
  /// of names that are numbers alone.
  std::string name;
  NumberedSequence frames;
  /// By the frames' numbers, in seconds since the first, strictly ascending, where names are times;
  /// such frames are counted from 0. Else empty.
  std::vector<double> times_s;
  std::string before, after;  ///< all that the names say around the number
  bool is_only = true;        ///< in its folder
  bool is_numbered = false;   ///< by its names; else its frames are counted from 0
};

struct NamedSequences {
  std::vector<NamedSequence> sequences;  ///< by name; none in an empty folder
  /// False: names tell of no sequences, since most have no other that differs in its number alone;
  /// all images are one sequence, counted from 0 in natural order.
  bool are_told = true;
};

/// Divides the images of a folder by their names: those that are alike but for their number
/// (find_number) are of one sequence. One step is the smallest difference of two numbers in a
/// sequence; of a sequence of two frames, in the folder.
///
/// No frame is missing between two numbers that are times. Numbers of which a sequence has one
/// twice, and longer ones than 11 digits that are no times, count in their order.
///
/// `images` are those of an ImageFolder.
NamedSequences name_sequences(const NumberedSequence& images);

}  // namespace eventgan
