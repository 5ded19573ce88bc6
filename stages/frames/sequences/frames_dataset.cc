#include "stages/frames/sequences/frames_dataset.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/own_labels/find_labels.h"

namespace eventgan {

std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const std::filesystem::path root = base / spec.root;
  std::error_code error;
  const auto status = std::filesystem::status(root, error);
  if (std::filesystem::is_directory(status)) {
    ImageFolder top = list_image_folder(root);
    const bool has_videos = std::ranges::any_of(top.left_out, is_video_name);
    return top.frames.empty() && has_videos ? open_videos_dataset(spec, base)
                                            : open_images_dataset(spec, base, std::move(top));
  }
  if (std::filesystem::is_regular_file(status) && is_video_name(root)) {
    return open_videos_dataset(spec, base);
  }
  std::string videos;
  for (const std::string_view extension : kVideoExtensions) {
    videos += (videos.empty() ? "" : ", ") + std::string(extension.substr(1));
  }
  throw InputError("expected a video (" + videos +
                   "), a folder of images, of such folders, or of videos, got " +
                   std::string(std::filesystem::exists(status) ? "something else" : "nothing") +
                   ", in " + root.string());
}

namespace {

bool has_images(const std::filesystem::path& folder) {
  return !look_into(folder).files.empty() && !list_image_folder(folder).frames.empty();
}

bool is_mot_sequence(const std::filesystem::path& folder) {
  return has_file(folder / "gt/gt.txt") && has_images(folder / "img1");
}

/// A folder of sequences, of which none is a dataset's folder of images.
bool has_sequences(const std::filesystem::path& folder) {
  std::vector<std::string> names = look_into(folder).folders;
  drop_label_folders(folder, names);
  return std::ranges::any_of(names, [&](const std::string& name) {
    return name != "images" && name != "JPEGImages" && has_images(folder / name);
  });
}

std::vector<FoundSource> find_labels_and_flow(FoundSource found) {
  std::vector<FoundSource> sources = find_own_labels(std::move(found));
  for (FoundSource& source : sources) {
    const std::string name = source.root.filename().string();
    const bool is_left = std::ranges::find(kKittiLeftCamera, name) != kKittiLeftCamera.end();
    const bool has_flow = std::ranges::any_of(kKittiFlow, [&](std::string_view folder) {
      return has_folder(source.root.parent_path() / folder);
    });
    if (!is_left || !has_flow) continue;
    source.remarks.push_back(
        "KITTI's flow lies beside the images: \"flow\": true and \"pairs\": { \"gaps\": [1], "
        "\"side\": \"after\" } read it");
  }
  return sources;
}

constexpr std::array kFramesLayouts{
    DatasetLayout{.fits = is_frames_root, .complete = find_labels_and_flow}};

}  // namespace

bool is_frames_root(const std::filesystem::path& root) {
  if (has_file(root)) return is_video_name(root);
  if (has_folder(root / "image_2")) return false;  // KITTI's test images: no sequence at all
  const ImageFolder top = has_folder(root) ? list_image_folder(root) : ImageFolder();
  return !top.frames.empty() || std::ranges::any_of(top.left_out, is_video_name) ||
         (has_folder(root / "images") && is_frames_root(root / "images")) ||
         std::ranges::any_of(top.folders,
                             [&](const std::string& name) { return has_images(root / name); }) ||
         std::ranges::any_of(top.folders, [&](const std::string& name) {
           return is_mot_sequence(root / name) || has_sequences(root / name) ||
                  ((has_folder(root / name / "labels") || !split_of(name).empty()) &&
                   has_images(root / name / "images"));
         });
}

constinit const DatasetReader kFramesReader{
    .kind = DatasetKind::kFrames,
    .open = open_frames_dataset,
    .may_be_file = is_video_name,
    .layouts = kFramesLayouts,
    .habits = {.gaps = {1},
               .size_comment = "No width and height: volumes are as large as the images.",
               .size = ""}};

}  // namespace eventgan
