#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "manifests/values/labels.h"

namespace eventgan {

inline constexpr std::size_t kMpiiJointCount = 16;

/// MPII's joints by their id in the .mat file, which is also their place in the JSON lists and
/// tables: right ankle, knee, hip, left hip, knee, ankle, pelvis, thorax, upper neck, head top,
/// right wrist, elbow, shoulder, left shoulder, elbow, wrist ("r_ankle" ..). Left and right are the
/// person's. No classes.
const LabelSchema& mpii_label_schema();

/// Throws std::invalid_argument("expected EXPECTED, got GOT at WHERE"), `got` cut to a readable
/// length.
[[noreturn]] void refuse_json(const std::string& where, const std::string& expected,
                              const nlohmann::ordered_json& got);

/// True if anybody in `entry` (an element of annolist as mat_to_json gives it) has a joint or a
/// centre.
bool has_mpii_persons(const nlohmann::ordered_json& entry);

/// The persons of `entry`, one for each element of its annorect, in that order.
///
/// MPII counts pixels from 1: one is taken from every joint, centre and head box corner here, once,
/// and nowhere else. A head box's corners, so shifted, are taken for its edges. What is absent or
/// empty stays absent: joints kMissingPoint with visible 0, centre kMissingPoint, scale -1, no head
/// box. A joint at (0, 0), which is no pixel where they count from 1, is
/// how some fill in what is not annotated: absent. is_visible may be a number, a character, a
/// logical (0 or 1), or empty or absent: -1. Throws std::invalid_argument("expected .., got .. at
/// annorect[1].annopoints.point[3].x") for a joint id outside 0..15 or given twice, a number that
/// is not finite, a field of another type, half a point or half a head box.
std::vector<Person> parse_mpii_persons(const nlohmann::ordered_json& entry);

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
/// element i belongs to annolist(i); an empty path is none. Throws InputError if a file is missing
/// or damaged, a variable or an image name is missing, or the arrays differ in length. Thread safe.
std::vector<MpiiEntry> read_mpii_annotations(const std::filesystem::path& annotations,
                                             const std::filesystem::path& keyframes);

/// Only the keyframes' names, in the file's order; as above.
std::vector<std::string> read_mpii_keyframes(const std::filesystem::path& keyframes);

}  // namespace eventgan
