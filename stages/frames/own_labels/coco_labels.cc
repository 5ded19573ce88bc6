#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "stages/frames/own_labels/detail/coco_entry.h"
#include "stages/frames/own_labels/detail/find_labels.h"
#include "stages/frames/own_labels/detail/frame_names.h"
#include "stages/frames/own_labels/detail/image_labels.h"
#include "stages/frames/own_labels/own_labels.h"

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
    find_images(FrameNames(source()));
    note_without_label(written_);
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override try {
    const CocoIndex::Image& image = find(label_key);
    const auto read = [&](const ByteRange& range) {
      return file_.read(range.offset, range.length);
    };
    std::string text = read(image.entry);
    Outcome<ImageSize> size = image_size(label_key, read_coco_image(text, image.id, written_));
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
    return annotation;
  } catch (const std::runtime_error& error) {
    return SampleFault{error.what()};
  }

  std::string label_place(const std::string& label_key) const override {
    return written_ + "#images/" + label_key;
  }

 private:
  void find_images(const FrameNames& names) {
    std::vector<std::string> of_several;
    for (std::size_t i = 0; i < index_.image_count(); ++i) {
      CocoIndex::Image& image = index_.images[i];
      const std::string key = std::to_string(image.id);
      place_of_id_.emplace(image.id, i);
      const FrameNames::Match match = names.find(image.file_name);
      if (match.frame == FrameNames::kSeveral) {
        of_several.push_back(image.file_name);
      } else if (match.frame == FrameNames::kNone) {
        give_absent(match.below_root, key);
      } else {
        give(match.frame, key);
      }
      std::string().swap(image.file_name);
    }
    refuse_bare_names(of_several, written_);
  }

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

/// Whether the beginning of a JSON file is of COCO's labels of these frames, as far as it shows.
bool is_coco_of(const FoundFrames& frames, const std::filesystem::path& file) {
  const std::string text = beginning_of(file);
  if (!text.starts_with('{') || file.stem().string().starts_with("captions")) return false;
  const bool has_lists = text.find("\"images\"") != std::string::npos ||
                         text.find("\"annotations\"") != std::string::npos;
  if (!has_lists) return false;
  // instances_train2017.json is of the folder train2017 alone.
  for (const std::string& folder : frames.folders) {
    if (file.stem().string().ends_with(folder)) return false;
  }
  constexpr std::string_view kKey = "\"file_name\"";
  bool any = false;
  for (std::size_t at = text.find(kKey); at != std::string::npos; at = text.find(kKey, at + 1)) {
    const std::size_t begin = text.find('"', at + kKey.size());
    const std::size_t end = begin == std::string::npos ? begin : text.find('"', begin + 1);
    if (end == std::string::npos) break;
    if (is_among(frames, text.substr(begin + 1, end - begin - 1))) return true;
    any = true;
  }
  // A file that begins with other things than images has to be told by its name.
  return !any && file.stem().string().ends_with(frames.root.filename().string());
}

std::optional<std::filesystem::path> find_coco(const FoundFrames& frames,
                                               std::vector<std::string>& remarks) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::path& folder :
       {frames.root, frames.root.parent_path(), frames.root / "annotations",
        frames.root.parent_path() / "annotations"}) {
    for (const std::filesystem::path& file : frames.files->in(folder, ".json")) {
      if (is_coco_of(frames, file)) files.push_back(file);
    }
  }
  if (files.empty()) return std::nullopt;
  const std::string name = frames.root.filename().string();
  const auto rank = [&](const std::filesystem::path& file) {
    const std::string stem = file.stem().string();
    return std::pair(!stem.ends_with(name), !stem.starts_with("instances"));
  };
  std::ranges::stable_sort(files, {}, rank);
  for (std::size_t i = 1; i < files.size(); ++i) {
    remarks.push_back("other COCO labels left out: " + files[i].string());
  }
  return files.front();
}

}  // namespace

constinit const LabelReader kCocoReader{LabelFormat::kCoco, open_labels<CocoLabels>, find_coco};

}  // namespace eventgan
