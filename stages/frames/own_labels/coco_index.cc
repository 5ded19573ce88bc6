#include "stages/frames/own_labels/detail/coco_index.h"

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/dataset/label_name.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/counted_bytes.h"

namespace eventgan {
namespace {

/// What joins entries, of one entry.
struct EntryFields {
  std::optional<std::int64_t> id, image_id;
  std::array<double, 2> size{};  // width, height
  std::array<double, 4> box{};
  std::size_t box_sides = 0;
  bool is_crowd = false;
  bool is_labelled = true;
  std::optional<std::int64_t> category;
  std::size_t joint_numbers = 0;  // x, y, v of each joint
  bool has_joints = false;        // an annotated one
  std::optional<std::string> file_name, name;
  std::vector<std::string> keypoints;
};

/// Takes what it wants of the parser's events.
class CocoReader : public nlohmann::json_sax<nlohmann::json> {
 public:
  CocoReader(const CountedBytes& bytes, const std::string& written)
      : bytes_(bytes), written_(written) {}

  struct Annotation {
    std::int64_t image_id;
    ByteRange entry;
  };
  struct Box {
    std::int64_t image_id;
    double right, bottom;
  };
  CocoIndex index;
  std::vector<Annotation> annotations;
  std::vector<Box> boxes;          // of the first annotations
  std::set<std::int64_t> classes;  // the categories of annotations
  /// By category and by how many numbers there are: annotations with joints.
  std::map<std::int64_t, std::map<std::size_t, std::size_t>> joints;

  bool null() override { return take_value("null"); }
  bool boolean(bool value) override {
    note_crowd(value);
    if (depth_ == kInEntry && is_image() && key_ == "is_labeled") fields_.is_labelled = value;
    return take_value("true or false");
  }
  bool number_integer(std::int64_t value) override { return take_integer(value); }
  bool number_unsigned(std::uint64_t value) override {
    constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    return value <= kMost ? take_integer(static_cast<std::int64_t>(value))
                          : take_value("a huge number");
  }
  bool number_float(double value, const std::string&) override {
    const auto whole = whole_of(value);
    if (whole && depth_ == kInEntry) return take_integer(*whole);
    take_number(value);
    return take_value("a fraction");
  }
  bool binary(nlohmann::json::binary_t&) override { return false; }  // not in JSON text

  bool string(std::string& value) override {
    if (depth_ == kInEntry && is_image() && key_ == "file_name") {
      return set(fields_.file_name, std::move(value));
    }
    if (depth_ == kInEntry && is_category() && key_ == "name") {
      return set(fields_.name, std::move(value));
    }
    if (depth_ == kInEntry + 1 && in_keypoints_) {
      fields_.keypoints.push_back(std::move(value));
      return true;
    }
    return take_value("text");
  }

  bool key(std::string& value) override {
    if (depth_ == 1) {
      const auto section = std::ranges::find(kSections, value);
      section_ = static_cast<std::size_t>(section - kSections.begin());
      if (section_ < kSections.size() && std::exchange(has_section_[section_], true)) {
        refuse("the key \"" + value + "\" once", "it twice");
      }
    } else if (depth_ == kInEntry) {
      index.has_body_parts |= is_annotation() && (value == "foot_kpts" || value == "face_kpts" ||
                                                  value == "lefthand_kpts");
      key_ = std::move(value);
    }
    return true;
  }

  bool start_object(std::size_t) override {
    if (depth_ == 1 && in_section()) refuse_value("an object");
    check_not_wanted("an object");
    if (depth_ == 2 && in_section()) {
      begin_ = bytes_.taken() - 1;
      fields_ = {};
      key_.clear();
    }
    ++depth_;
    return true;
  }

  bool end_object() override {
    --depth_;
    if (depth_ == 2 && in_section()) take_entry();
    return true;
  }

  bool start_array(std::size_t) override {
    if (depth_ == 0) refuse("an object", "a list");
    if (depth_ == 2 && in_section()) refuse_value("a list");
    in_box_ = depth_ == kInEntry && is_annotation() && key_ == "bbox";
    in_joints_ = depth_ == kInEntry && is_annotation() && key_ == "keypoints";
    in_keypoints_ = depth_ == kInEntry && is_category() && key_ == "keypoints";
    if (in_keypoints_ && !fields_.keypoints.empty()) refuse("the key \"keypoints\" once", "twice");
    check_not_wanted("a list");
    ++depth_;
    return true;
  }

  bool end_array() override {
    --depth_;
    if (depth_ == kInEntry) in_keypoints_ = in_box_ = in_joints_ = false;
    return true;
  }

  bool parse_error(std::size_t, const std::string&,
                   const nlohmann::detail::exception& error) override {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: syntax error while ..."
    std::string reason = error.what();
    if (const std::size_t at = reason.find("] "); at != std::string::npos) reason.erase(0, at + 2);
    constexpr std::size_t kLongest = 200;  // it quotes what it read last, which may be long
    throw InputError("expected JSON, got a " + escape_controls(reason.substr(0, kLongest)) +
                     ", in " + written_);
  }

  void check_whole() const {
    for (std::size_t i = 0; i < kSections.size(); ++i) {
      if (!has_section_[i]) refuse("a list \"" + std::string(kSections[i]) + "\"", "none");
    }
  }

 private:
  static constexpr std::array<std::string_view, 3> kSections{"images", "annotations", "categories"};
  static constexpr int kInEntry = 3;  // open: the document, the list, the entry

  bool is_image() const { return section_ == 0; }
  bool is_annotation() const { return section_ == 1; }
  bool is_category() const { return section_ == 2; }
  bool in_section() const { return section_ < kSections.size(); }

  [[noreturn]] void refuse(const std::string& expected, const std::string& got) const {
    throw InputError("expected " + expected + ", got " + got + ", in " + written_ + " (byte " +
                     std::to_string(bytes_.taken()) + ")");
  }

  /// Of a value where the list or an entry of it should be.
  [[noreturn]] void refuse_value(const std::string& got) const {
    refuse("a list of objects as \"" + std::string(kSections[section_]) + "\"", got);
  }

  /// Refuses a value of another kind where an entry has what joins it.
  void check_not_wanted(const std::string& got) const {
    if (depth_ == kInEntry + 1 && in_keypoints_) refuse("names as keypoints", got);
    if (depth_ != kInEntry) return;
    const auto wants = [&](std::string_view key, const char* expected) {
      if (key_ == key) refuse(std::string(expected) + " as \"" + key_ + "\"", got);
    };
    if (is_image() || is_category()) wants("id", "a whole number");
    if (is_annotation()) wants("image_id", "a whole number");
    if (is_image()) wants("file_name", "text");
    if (is_category()) wants("name", "text");
    if (is_category() && !in_keypoints_) wants("keypoints", "a list of names");
  }

  bool take_value(const std::string& got) const {
    if (depth_ == 0) refuse("an object", got);
    if (depth_ <= 2 && in_section()) refuse_value(got);
    check_not_wanted(got);
    return true;
  }

  /// Of a box's sides, an image's, and joints.
  void take_number(double value) {
    if (in_joints_) fields_.has_joints |= fields_.joint_numbers++ % 3 == 2 && value > 0;
    if (in_box_ && depth_ == kInEntry + 1 && fields_.box_sides < fields_.box.size()) {
      fields_.box[fields_.box_sides++] = value;
    } else if (depth_ == kInEntry && is_image() && (key_ == "width" || key_ == "height")) {
      fields_.size[key_ == "width" ? 0 : 1] = value;
    }
  }

  void note_crowd(bool value) {
    if (depth_ == kInEntry && is_annotation() && key_ == "iscrowd") fields_.is_crowd = value;
  }

  bool take_integer(std::int64_t value) {
    take_number(static_cast<double>(value));
    note_crowd(value == 1);
    if (depth_ == kInEntry && is_annotation() && key_ == "category_id") {
      if (classes.empty() || value != last_class_) classes.insert(last_class_ = value);
      fields_.category = value;
      return true;
    }
    if (depth_ == kInEntry && (is_image() || is_category()) && key_ == "id") {
      return set(fields_.id, value);
    }
    if (depth_ == kInEntry && is_annotation() && key_ == "image_id") {
      return set(fields_.image_id, value);
    }
    return take_value("a number");
  }

  template <class T>
  bool set(std::optional<T>& field, T value) const {
    if (field) refuse("the key \"" + key_ + "\" once", "it twice");
    field = std::move(value);
    return true;
  }

  void take_entry() {
    const std::uint64_t length = bytes_.taken() - begin_;
    if (length > std::numeric_limits<std::uint32_t>::max()) {
      refuse("an entry of less than 4 GiB", std::to_string(length) + " bytes");
    }
    const ByteRange range{begin_, static_cast<std::uint32_t>(length)};
    const auto need = [&](const auto& field, const char* name) {
      if (!field) {
        refuse("an entry of \"" + std::string(kSections[section_]) + "\" with " + name, "none");
      }
    };
    if (is_annotation()) {
      need(fields_.image_id, "image_id");
      annotations.push_back({*fields_.image_id, range});
      index.crowds += fields_.is_crowd;
      if (fields_.has_joints && fields_.category) {
        ++joints[*fields_.category][fields_.joint_numbers];
      }
      constexpr std::size_t kMostBoxes = 1000;
      const auto& [left, top, width, height] = fields_.box;
      if (fields_.box_sides == fields_.box.size() && boxes.size() < kMostBoxes) {
        boxes.push_back({*fields_.image_id, left + width, top + height});
      }
      return;
    }
    need(fields_.id, "id");
    if (is_image()) {
      need(fields_.file_name, "file_name");
      constexpr double kLargest = 1e6;
      const auto side = [&](double given) {
        return given >= 1 && given <= kLargest ? static_cast<int>(given) : 0;
      };
      index.images.push_back({*fields_.id, range, *std::move(fields_.file_name),
                              ImageSize{side(fields_.size[1]), side(fields_.size[0])},
                              fields_.is_labelled});
    } else {
      need(fields_.name, "name");
      index.categories.push_back(
          {*fields_.id, *std::move(fields_.name), std::move(fields_.keypoints)});
    }
  }

  const CountedBytes& bytes_;
  std::string written_;
  int depth_ = 0;  // of objects and lists that are open
  std::size_t section_ = kSections.size();
  std::array<bool, kSections.size()> has_section_{};
  std::string key_;  // the entry's last
  bool in_keypoints_ = false, in_box_ = false, in_joints_ = false;
  std::int64_t last_class_ = 0;
  std::uint64_t begin_ = 0;
  EntryFields fields_;
};

void refuse_any(const std::vector<std::string>& names, const std::string& expected,
                const std::string& got, const std::string& written) {
  if (names.empty()) return;
  throw InputError("expected " + expected + ", got " + std::to_string(names.size()) + " " + got +
                   ": " + some_of(names, 20) + ", in " + written);
}

/// `used`: the ids that annotations have. Some tools write a root of all categories, or a copy of
/// each, that no annotation has and that has another's name; where no annotation tells them apart,
/// the last of a name is the one that others have.
void check_categories(CocoIndex& index, const std::set<std::int64_t>& used,
                      const std::string& written) {
  auto& categories = index.categories;
  std::ranges::stable_sort(categories, {}, &CocoIndex::Category::id);
  std::set<std::string, std::less<>> kept;
  for (const CocoIndex::Category& category : categories) {
    if (used.contains(category.id)) kept.insert(category.name);
  }
  std::ranges::reverse(categories);
  std::erase_if(categories, [&](const CocoIndex::Category& category) {
    return !used.contains(category.id) && !kept.insert(category.name).second;
  });
  std::ranges::reverse(categories);
  std::vector<std::string> ids, names;
  std::set<std::string> known;
  for (std::size_t i = 0; i < categories.size(); ++i) {
    if (i > 0 && categories[i].id == categories[i - 1].id) {
      ids.push_back(std::to_string(categories[i].id));
    }
    const bool is_sound =
        is_label_name(categories[i].name) && known.insert(categories[i].name).second;
    if (!is_sound) names.push_back("\"" + escape_controls(categories[i].name) + "\"");
  }
  refuse_any(ids, "each category's id once", "more often", written);
  refuse_any(names, "each category with a name of its own, without control characters", "others",
             written);
  for (const CocoIndex::Category& category : categories) {
    std::set<std::string> joints;
    for (const std::string& joint : category.keypoints) {
      if (is_label_name(joint) && joints.insert(joint).second) continue;
      refuse_any({escape_controls(joint)}, "each keypoint with a name of its own", "another",
                 written);
    }
  }
}

/// Numbers the joints of categories that have no names of them, or counts what is left out.
void number_joints(CocoIndex& index, const decltype(CocoReader::joints)& joints) {
  constexpr std::size_t kMostJoints = 1000;
  std::vector<CocoIndex::Category*> without;
  std::size_t named = 0;  // numbers of those that have names
  std::set<std::size_t> lengths;
  for (CocoIndex::Category& category : index.categories) {
    named = std::max(named, 3 * category.keypoints.size());
    const auto found = joints.find(category.id);
    if (!category.keypoints.empty() || found == joints.end()) continue;
    without.push_back(&category);
    for (const auto& [length, count] : found->second) lengths.insert(length);
  }
  const std::size_t only = lengths.size() == 1 ? *lengths.begin() : 0;
  const bool can_number = named == 0 && only % 3 == 0 && only <= 3 * kMostJoints;
  for (CocoIndex::Category* const category : without) {
    for (std::size_t i = 0; can_number && i < only / 3; ++i) {
      category->keypoints.push_back(std::to_string(i));
    }
    for (const auto& [length, count] : joints.at(category->id)) {
      if (category->keypoints.empty() && length != named) index.joints_left_out += count;
    }
  }
}

/// Sorts the annotations by image, in linear time, and compares some boxes with their images.
void join(const std::vector<CocoReader::Annotation>& annotations,
          const std::vector<CocoReader::Box>& boxes, CocoIndex& index, const std::string& written) {
  std::unordered_map<std::int64_t, std::size_t> image_of_id;
  image_of_id.reserve(index.images.size());
  std::vector<std::string> twice;
  for (std::size_t i = 0; i < index.images.size(); ++i) {
    if (!image_of_id.emplace(index.images[i].id, i).second) {
      twice.push_back(std::to_string(index.images[i].id));
    }
  }
  refuse_any(twice, "each image's id once", "more often", written);

  constexpr double kRounding_px = 1;
  for (const CocoReader::Box& box : boxes) {
    const auto image = image_of_id.find(box.image_id);
    const ImageSize size =
        image == image_of_id.end() ? ImageSize{} : index.images[image->second].size;
    if (size.width == 0 || size.height == 0) continue;
    ++index.compared_boxes;
    index.boxes_beyond +=
        box.right > size.width + kRounding_px || box.bottom > size.height + kRounding_px;
  }

  index.images.emplace_back();
  std::vector<std::uint32_t> images;
  images.reserve(annotations.size());
  std::vector<std::string> of_none;
  for (const CocoReader::Annotation& annotation : annotations) {
    const auto image = image_of_id.find(annotation.image_id);
    if (image == image_of_id.end()) {
      of_none.push_back(std::to_string(annotation.image_id));
      continue;
    }
    images.push_back(static_cast<std::uint32_t>(image->second));
    ++index.images[image->second + 1].first_annotation;
  }
  refuse_any(of_none, "annotations of the file's images", "of other image_ids", written);
  for (std::size_t i = 1; i < index.images.size(); ++i) {
    index.images[i].first_annotation += index.images[i - 1].first_annotation;
  }
  std::vector<std::size_t> next;
  next.reserve(index.images.size());
  for (const CocoIndex::Image& image : index.images) next.push_back(image.first_annotation);
  index.annotations.resize(annotations.size());
  for (std::size_t i = 0; i < annotations.size(); ++i) {
    index.annotations[next[images[i]]++] = annotations[i].entry;
  }
}

}  // namespace

CocoIndex index_coco(const InputFile& file, const std::string& written) {
  CountedBytes bytes(file);
  CocoReader reader(bytes, written);
  nlohmann::json::sax_parse(CountedIterator(bytes), CountedIterator(), &reader);
  // The parser takes a NUL for the end.
  if (!bytes.at_end()) throw InputError("expected JSON, got a NUL, in " + written);
  reader.check_whole();
  CocoIndex index = std::move(reader.index);
  check_categories(index, reader.classes, written);
  number_joints(index, reader.joints);
  join(reader.annotations, reader.boxes, index, written);
  return index;
}

}  // namespace eventgan
