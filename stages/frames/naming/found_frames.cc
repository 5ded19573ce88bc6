#include "stages/frames/naming/found_frames.h"

#include <algorithm>
#include <utility>

#include "manifests/files/input_file.h"
#include "stages/frames/listing/image_folder.h"

namespace eventgan {
namespace fs = std::filesystem;

bool is_image_folder(const std::string& name) {
  return std::ranges::find(kImageFolders, in_small_letters(name)) != kImageFolders.end();
}

std::vector<fs::path> names_with(const FolderListing& listing, std::string_view extension) {
  std::vector<fs::path> names;
  for (const fs::path name : listing.files) {
    const bool is_hidden = name.string().starts_with('.');
    if (!is_hidden && lower_extension(name) == extension) names.push_back(name);
  }
  return names;
}

const std::vector<fs::path>& WholeFiles::in(const fs::path& folder, std::string_view extension) {
  const auto [entry, is_new] = listed_.try_emplace(folder);
  const FolderListing listing = is_new ? look_into(folder) : FolderListing();
  for (const std::string_view known : {".json", ".csv"}) {
    for (const fs::path& name : names_with(listing, known)) {
      entry->second[known].push_back(folder / name);
    }
  }
  return entry->second[extension];
}

const JsonGlimpse& WholeFiles::json(const fs::path& file) {
  const auto [entry, is_new] = json_.try_emplace(file);
  if (is_new) entry->second = look_at_json(file);
  return entry->second;
}

const std::vector<std::string>& WholeFiles::table_images(
    const fs::path& file, const std::function<std::vector<std::string>()>& read) {
  const auto [entry, is_new] = table_images_.try_emplace(file);
  if (is_new) entry->second = read();
  return entry->second;
}

fs::path WholeFiles::folder(const fs::path& above, std::string_view name) {
  const auto [entry, is_new] = folders_.try_emplace(above);
  if (is_new) {
    for (const std::string& folder : look_into(above).folders) {
      entry->second.emplace(in_small_letters(folder), folder);
      entry->second[folder] = folder;
    }
  }
  const auto exact = entry->second.find(std::string(name));
  const auto found = exact != entry->second.end()
                         ? exact
                         : entry->second.find(in_small_letters(std::string(name)));
  return found == entry->second.end() ? fs::path() : above / found->second;
}

std::string beginning_of(const fs::path& file) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  std::string text(1 << 16, '\0');
  std::string reason;
  const auto opened = InputFile::open(file, reason);
  text.resize(opened ? opened->read_some(0, text) : 0);
  if (text.starts_with(kMark)) text.erase(0, kMark.size());
  return text;
}

bool is_manifest(std::string_view text) {
  const std::size_t key = text.find("\"format\"");
  return key != text.npos &&
         std::ranges::any_of(
             std::array{"manifest", "training", "simulation"}, [&](const char* kind) {
               return text.substr(key, 64).find(std::string("\"eventgan-") + kind + '"') !=
                      text.npos;
             });
}

const std::vector<std::string>& image_names_of(const FoundFrames& frames) {
  if (frames.image_names) return *frames.image_names;
  frames.image_names = std::make_shared<std::vector<std::string>>();
  if (frames.is_video) return *frames.image_names;
  const auto add = [&](const fs::path& below) {
    const ImageFolder listed = list_image_folder(frames.root / below);
    for (const auto& [number, name] : listed.frames.frames()) {
      frames.image_names->push_back((below / name).generic_string());
    }
  };
  if (frames.folders.empty()) add("");
  for (const fs::path folder : frames.folders) {
    add(folder);
    if (has_folder(frames.root / folder / "img1")) add(folder / "img1");
  }
  return *frames.image_names;
}

namespace {

FrameNames& names_of(const FoundFrames& frames) {
  if (frames.names) return *frames.names;
  if (frames.is_video) {
    frames.first_frames = std::make_shared<std::vector<std::string>>();
    for (const std::string& stem : frames.stems) frames.first_frames->push_back(stem + "/0");
  }
  const std::vector<std::string>& names =
      frames.is_video ? *frames.first_frames : image_names_of(frames);
  const std::vector<std::string_view> views(names.begin(), names.end());
  frames.names = std::make_shared<FrameNames>(views, frames.root, frames.is_video);
  return *frames.names;
}

/// Of a video the first frame stands for all: how many there are, only opening it tells.
std::string standing_for(const FoundFrames& frames, const std::string& name) {
  return frames.is_video ? first_frame_name(name) : name;
}

}  // namespace

std::set<std::string> frames_among(const FoundFrames& frames,
                                   const std::vector<std::string>& names) {
  FrameNames& known = names_of(frames);
  std::set<std::string> found;
  for (const std::string& name : names) {
    const std::size_t frame = known.find(standing_for(frames, name)).frame;
    if (frame >= FrameNames::kSeveral) continue;
    found.insert(frames.is_video ? video_frame_name(name) : (*frames.image_names)[frame]);
  }
  return found;
}

std::size_t count_among(const FoundFrames& frames, const std::vector<std::string>& names) {
  FrameNames& known = names_of(frames);
  const auto is_theirs = [&](const FrameNames::Match& match) {
    return match.frame < FrameNames::kSeveral ||
           (match.frame == FrameNames::kSeveral && !frames.is_video);
  };
  std::size_t count = 0;
  for (const std::string& name : names)
    count += is_theirs(known.find_exactly(standing_for(frames, name)));
  constexpr std::size_t kMost = 1000;
  const std::size_t step = std::max<std::size_t>(1, names.size() / kMost);
  for (std::size_t i = 0; count == 0 && i < names.size(); i += step) {
    count += is_theirs(known.find(standing_for(frames, names[i])));
  }
  return count;
}

std::vector<fs::path> folders_around(const FoundFrames& frames) {
  const fs::path above = frames.root.parent_path();
  std::vector<fs::path> folders = {frames.root, above};
  for (const fs::path& folder : {frames.root, above}) {
    if (fs::path found = frames.files->folder(folder, "annotations"); !found.empty()) {
      folders.push_back(std::move(found));
    }
  }
  if (is_image_folder(above.filename().string())) {  // images/train2017
    folders.push_back(above.parent_path());
    if (fs::path found = frames.files->folder(above.parent_path(), "annotations"); !found.empty()) {
      folders.push_back(std::move(found));
    }
  }
  return folders;
}

}  // namespace eventgan
