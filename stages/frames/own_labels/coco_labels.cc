#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "manifests/values/text.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/detail/coco_entry.h"
#include "stages/frames/own_labels/detail/image_labels.h"
#include "stages/frames/own_labels/label_readers.h"

namespace eventgan {
namespace {

class CocoLabels : public OwnLabels {
 public:
  CocoLabels(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource labelled)
      : OwnLabels(std::move(labelled)),
        file_(base / spec.path, spec.path),
        written_(spec.path),
        index_(index_coco(file_, written_)) {
    annotation_files_.push_back(written_);
    schema_ = coco_schema(index_, written_);
    for (const CocoIndex::Category& category : index_.categories) {
      meanings_["class " + std::to_string(category.id)] = category.name;
    }
    find_images();
    note_without_label(written_);
    note_joints();
    warn_of_corners();
    warn_of_crowds();
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override try {
    const CocoIndex::Image& image = find(label_key);
    std::string text = read(image.entry);
    const CocoImage entry = read_coco_image(text, image.id, written_);
    Outcome<ImageSize> size = image_size(label_key, entry.size);
    if (is_fault(size)) return size.fault();
    Annotation annotation;
    annotation.original = "{\"image\": " + text + ", \"annotations\": [";
    const CocoIndex::Image* const next = &image + 1;
    for (std::size_t i = image.first_annotation; i < next->first_annotation; ++i) {
      text = read(index_.annotations[i]);
      annotation.original += (i > image.first_annotation ? ", " : "") + text;
      add_coco_annotation(text, image.id, *size, index_, schema_, written_, annotation);
    }
    annotation.original += "]}";
    if (!index_.categories.empty()) {
      add_ignored_regions(entry, *size, index_, label_place(label_key), annotation);
    }
    forget_shared_tracks(label_place(label_key), annotation);
    return annotation;
  } catch (const std::runtime_error& error) {
    return SampleFault{error.what()};
  }

  std::string label_place(const std::string& label_key) const override {
    return written_ + "#images/" + label_key;
  }

 private:
  void find_images() {
    std::vector<NamedLabel> named;
    named.reserve(index_.image_count());
    for (std::size_t i = 0; i < index_.image_count(); ++i) {
      CocoIndex::Image& image = index_.images[i];
      place_of_id_.emplace(image.id, i);
      const bool has_none = image.first_annotation == index_.images[i + 1].first_annotation;
      if (!image.is_labelled && has_none) continue;  // nobody looked for objects
      named.push_back({std::exchange(image.file_name, {}), std::to_string(image.id)});
    }
    give_named(named, written_);
  }

  void note_joints() {
    if (index_.joints_left_out == 0) return;
    notes_.push_back(fmt::format(
        "keypoints of {} left out, since their category names none and they differ in number, in "
        "{}",
        count_text(static_cast<std::int64_t>(index_.joints_left_out), "annotation"), written_));
  }

  /// Some tools write corners where COCO has a width and a height.
  void warn_of_corners() {
    constexpr std::size_t kFewest = 3;
    if (index_.compared_boxes < kFewest || 2 * index_.boxes_beyond <= index_.compared_boxes) return;
    warnings_.push_back(fmt::format(
        "{} of {} compared boxes reach beyond their image: \"bbox\" may have the right and bottom "
        "edges in place of width and height, in {}",
        index_.boxes_beyond, index_.compared_boxes, written_));
  }

  /// CVAT and Datumaro write every mask as one.
  void warn_of_crowds() {
    constexpr std::size_t kFewest = 3;
    const std::size_t all = index_.annotations.size();
    if (index_.crowds < kFewest || 2 * index_.crowds <= all) return;
    warnings_.push_back(fmt::format(
        "{} of {} annotations have \"iscrowd\" 1, and so are regions to ignore: where these are "
        "single objects, as CVAT's masks are, make it 0, in {}",
        index_.crowds, all, written_));
  }

  std::string read(const ByteRange& range) const { return file_.read(range.offset, range.length); }

  const CocoIndex::Image& find(const std::string& label_key) const {
    std::int64_t id = 0;
    const char* const end = label_key.data() + label_key.size();
    const auto [stop, error] = std::from_chars(label_key.data(), end, id);
    const auto place = place_of_id_.find(id);
    if (error != std::errc() || stop != end || place == place_of_id_.end()) {
      throw std::runtime_error("expected an image of the file, got none, in " +
                               label_place(label_key));
    }
    return index_.images[place->second];
  }

  InputFile file_;
  std::string written_;
  CocoIndex index_;
  std::unordered_map<std::int64_t, std::size_t> place_of_id_;
};

/// What ends a file's name: "val2017" of instances_val2017.json.
std::string last_word(const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  return stem.substr(stem.find_last_of("_-. ") + 1);
}

bool is_coco_of(const FoundFrames& frames, const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  if (stem.starts_with("captions") || frames.stems.contains(stem)) return false;
  // instances_train2017.json is of the folder train2017 alone.
  const std::string word = last_word(file);
  const std::string_view split = split_of(word);
  const std::string_view own = split_of(frames.root.filename().string());
  if (!split.empty() && !own.empty() && split != own) return false;
  for (const std::string& folder : frames.folders) {
    if (stem == folder || word == folder || (!split.empty() && split_of(folder) == split))
      return false;
  }
  const JsonGlimpse& seen = frames.files->json(file);
  if (seen.file_names.empty()) {  // of no image, and so told by its name
    return seen.has_keys({"images", "annotations"}) &&
           stem.ends_with(frames.root.filename().string());
  }
  return seen.is_coco() && count_among(frames, seen.file_names) > 0;
}

LabelSearch find_coco(const FoundFrames& frames) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::path& folder : folders_around(frames)) {
    for (const std::filesystem::path& file : frames.files->in(folder, ".json")) {
      const bool is_new = std::ranges::find(files, file) == files.end();
      if (is_new && is_coco_of(frames, file)) files.push_back(file);
    }
  }
  if (files.empty()) return {};
  const std::string name = frames.root.filename().string();
  const auto rank = [&](const std::filesystem::path& file) {
    const std::string stem = file.stem().string();
    return std::pair(!stem.ends_with(name), !stem.starts_with("instances"));
  };
  std::ranges::stable_sort(files, {}, rank);
  // COCO's own files label an image several times: instances_ has all objects.
  const auto is_of_instances = [](const std::filesystem::path& file) {
    return file.stem().string().starts_with("instances");
  };
  const bool is_of_coco = is_of_instances(files.front());
  std::vector<ManyLabels> with_images;
  for (const std::filesystem::path& file : files) {
    if (is_of_coco && !is_of_instances(file)) continue;
    with_images.push_back({file, frames.files->json(file).file_names});
  }
  LabelSearch search = take_files(frames, with_images);
  if (!is_of_coco) return search;
  search.unread.clear();
  for (const std::filesystem::path& file : files) {
    if (std::ranges::find(search.paths, file) != search.paths.end()) continue;
    search.remarks.push_back("other COCO labels left out: " + file.string());
  }
  return search;
}

}  // namespace

constinit const LabelReader kCocoReader{LabelFormat::kCoco, open_labels<CocoLabels>, find_coco};

}  // namespace eventgan
