#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "manifests/files/input_file.h"
#include "stages/frames/naming/counted_bytes.h"
#include "stages/frames/naming/found_frames.h"

namespace eventgan {
namespace {

/// Takes names and keys of the parser's events, and ends it once it has seen enough.
class GlimpseReader : public nlohmann::json_sax<nlohmann::json> {
 public:
  JsonGlimpse seen;

  bool null() override { return take(); }
  bool boolean(bool) override { return take(); }
  bool number_integer(std::int64_t) override { return take(); }
  bool number_unsigned(std::uint64_t) override { return take(); }
  bool number_float(double, const std::string&) override { return take(); }
  bool binary(nlohmann::json::binary_t&) override { return take(); }
  bool string(std::string& value) override {
    const bool is_name = section_ == "images" && depth_ == 3 && key_ == "file_name";
    if (is_name) seen.file_names.push_back(std::move(value));
    return take();
  }
  bool key(std::string& value) override {
    if (depth_ == (seen.is_list ? 2 : 1)) seen.keys.push_back(value);
    if (depth_ == 1) section_ = value;
    const bool is_of_first = section_ == "annotations" && !has_annotation_;
    if (depth_ == 3 && is_of_first) seen.annotation_keys.push_back(value);
    if (depth_ == 3) key_ = std::move(value);
    return true;
  }
  bool start_object(std::size_t) override {
    if (depth_ == 0) seen.is_object = true;
    ++depth_;
    return true;
  }
  bool end_object() override {
    --depth_;
    if (depth_ == 1 && seen.is_list) return false;  // its first element tells
    const bool is_annotation = depth_ == 2 && section_ == "annotations";
    has_annotation_ |= is_annotation;
    // What the other annotations say shows once the file is opened; its images may come behind.
    return !(is_annotation && has_images_);
  }
  bool start_array(std::size_t) override {
    if (depth_ == 0) seen.is_list = true;
    ++depth_;
    return true;
  }
  bool end_array() override {
    --depth_;
    has_images_ |= depth_ == 1 && section_ == "images";
    return !(has_images_ && has_annotation_);
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  bool take() const { return depth_ > 0; }

  int depth_ = 0;  // of objects and lists that are open
  std::string section_, key_;
  bool has_images_ = false, has_annotation_ = false;
};

bool has_all(const std::vector<std::string>& keys, std::initializer_list<const char*> wanted) {
  return std::ranges::all_of(
      wanted, [&](const char* key) { return std::ranges::find(keys, key) != keys.end(); });
}

}  // namespace

bool JsonGlimpse::has_keys(std::initializer_list<const char*> wanted) const {
  return has_all(keys, wanted);
}

bool JsonGlimpse::is_coco() const {
  if (!is_object || file_names.empty()) return false;
  // Captions and panoptic segments are no boxes.
  const bool has_boxes = annotation_keys.empty() || has_all(annotation_keys, {"bbox"}) ||
                         has_all(annotation_keys, {"segmentation", "category_id"});
  return has_boxes && has_keys({"annotations"});
}

JsonGlimpse look_at_json(const std::filesystem::path& file) {
  std::string reason;
  const auto opened = InputFile::open(file, reason);
  if (!opened) return {};
  CountedBytes bytes(*opened);
  GlimpseReader reader;
  nlohmann::json::sax_parse(CountedIterator(bytes), CountedIterator(), &reader);
  return std::move(reader.seen);
}

}  // namespace eventgan
