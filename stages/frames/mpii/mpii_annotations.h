#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

/// One element of MPII's annolist, with what the other arrays say about it.
struct MpiiEntry {
  std::string image;         ///< "037454012.jpg"
  std::string keyframe;      ///< "037454012/00000053.jpg"; empty if the .mat names none
  bool is_train = false;     ///< img_train
  bool has_persons = false;  ///< anybody in it has a joint or a centre
  /// The whole entry in MPII's own terms and numbers, as JSON: the fields of annolist(i) (image,
  /// annorect, frame_sec, vididx, ..), then img_train, single_person, act and annolist_keyframes as
  /// they are at i.
  std::string json;
};

/// Reads `annotations` (variable RELEASE) and `keyframes` (variable annolist_keyframes), whose
/// element i belongs to annolist(i). Throws InputError if a file is missing or damaged, a variable
/// or an image name is missing, or the arrays differ in length. Thread safe.
std::vector<MpiiEntry> read_mpii_annotations(const std::filesystem::path& annotations,
                                             const std::filesystem::path& keyframes);

/// Only the keyframes' names, in the file's order; as above.
std::vector<std::string> read_mpii_keyframes(const std::filesystem::path& keyframes);

}  // namespace eventgan
