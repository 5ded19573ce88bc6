#include "stages/frames/mpii/mpii_places.h"

#include "manifests/faults.h"
#include "stages/frames/mpii/mpii_frames.h"
#include "stages/frames/source_root.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAnnotations = "mpii_human_pose_v1_u12_1.mat";
constexpr const char* kKeyframes = "mpii_human_pose_v1_sequences_keyframes.mat";

std::string find_file(const std::vector<std::string>& folders, const char* name,
                      const fs::path& base) {
  for (const std::string& folder : folders) {
    const SourceRoot root(folder, base);
    if (root.has_file(name)) return root.written(name);
  }
  return {};
}

[[noreturn]] void refuse_missing(const char* name, const std::vector<std::string>& folders,
                                 const fs::path& base) {
  std::string places;
  for (const std::string& folder : folders) {
    places += (places.empty() ? "" : " or ") + (base / folder).string();
  }
  throw InputError(std::string("expected ") + name + ", got none, in " + places);
}

}  // namespace

std::string find_mpii_keyframes(const std::vector<std::string>& folders, const fs::path& base) {
  return find_file(folders, kKeyframes, base);
}

MpiiPlaces find_mpii_places(const SourceSpec& spec, const fs::path& base) {
  const SourceRoot root(spec.root, base);
  root.require_folder("");
  MpiiPlaces places;
  places.image_folders = {root.written("images")};

  const SourceRoot annotations(spec.annotations.value_or(spec.root), base);
  if (annotations.has_file("")) {
    places.annotations = annotations.written("");
  } else {
    const std::vector<std::string> folders = {annotations.written(""),
                                              annotations.written("mpii_human_pose_v1_u12_2")};
    places.annotations = find_file(folders, kAnnotations, base);
    if (places.annotations.empty()) refuse_missing(kAnnotations, folders, base);
  }
  const std::vector<std::string> beside = {
      fs::path(places.annotations).parent_path().generic_string(), spec.root};
  places.keyframes = find_mpii_keyframes(beside, base);
  if (places.keyframes.empty()) refuse_missing(kKeyframes, beside, base);

  if (spec.sequences) {
    SourceRoot(*spec.sequences, base).require_folder("");
    places.sequence_folders = {*spec.sequences};
    return places;
  }
  places.sequence_folders = {root.written("sequences")};
  for (const std::string& name : root.folders_in("")) {
    if (name.starts_with(kMpiiBatchPrefix)) places.sequence_folders.push_back(root.written(name));
  }
  return places;
}

}  // namespace eventgan
