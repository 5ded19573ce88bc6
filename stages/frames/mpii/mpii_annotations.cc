#include "stages/frames/mpii/mpii_annotations.h"

#include <stdexcept>
#include <utility>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "stages/frames/mpii/mat_file_internal.h"
#include "stages/frames/mpii/mat_json_internal.h"
#include "stages/frames/mpii/mpii_person_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

/// image.name of an element of annolist or annolist_keyframes; empty if it has none.
std::string image_name(const Json& element) {
  static const Json::json_pointer kName("/image/name");
  if (!element.contains(kName) || !element.at(kName).is_string()) return {};
  return element.at(kName).get<std::string>();
}

/// A field of RELEASE, empty if it has none of that name.
MatArray array_of(const MatArray& release, const char* name) {
  return mat_field(release, name).value_or(MatArray{});
}

/// Element `index` of `array`, if it has one. (single_person may be shorter than annolist.)
void copy_element(const MatArray& array, const char* name, std::size_t index, Json& entry) {
  if (index < array.size) entry[name] = mat_element_to_json(array, index);
}

std::string dump(const Json& json) { return dump_json(json); }

/// Turns what mat_to_json refuses into an error that names the file.
template <class Read>
auto reading(const std::filesystem::path& file, Read read) try {
  return read();
} catch (const std::invalid_argument& error) {
  throw InputError(std::string(error.what()) + ", in " + file.string());
}

std::vector<Json> read_keyframe_elements(const std::filesystem::path& file) {
  const MatVariable variable = read_mat_variable(file, "annolist_keyframes");
  return reading(file, [&] {
    std::vector<Json> elements;
    for (std::size_t i = 0; i < variable.array.size; ++i) {
      elements.push_back(mat_element_to_json(variable.array, i));
    }
    return elements;
  });
}

}  // namespace

std::vector<std::string> read_mpii_keyframes(const std::filesystem::path& keyframes) {
  std::vector<std::string> names;
  for (const Json& element : read_keyframe_elements(keyframes))
    names.push_back(image_name(element));
  return names;
}

std::vector<MpiiEntry> read_mpii_annotations(const std::filesystem::path& annotations,
                                             const std::filesystem::path& keyframes) {
  std::vector<Json> keyframe_elements = read_keyframe_elements(keyframes);
  const MatVariable release = read_mat_variable(annotations, "RELEASE");
  const auto field = [&](const char* name) {
    return reading(annotations, [&] { return array_of(release.array, name); });
  };
  const MatArray annolist = field("annolist"), img_train = field("img_train");
  const MatArray single_person = field("single_person"), act = field("act");
  const std::size_t count = annolist.size;
  const auto expect_count = [count](const char* name, std::size_t got,
                                    const std::filesystem::path& file) {
    if (got == count) return;
    throw InputError("expected " + std::to_string(count) + " elements in " + name +
                     ", as many as in annolist, got " + std::to_string(got) + ", in " +
                     file.string());
  };
  if (count == 0) {
    throw InputError("expected images in RELEASE.annolist, got none, in " + annotations.string());
  }
  expect_count("img_train", img_train.size, annotations);
  expect_count("annolist_keyframes", keyframe_elements.size(), keyframes);

  return reading(annotations, [&] {
    std::vector<MpiiEntry> entries;
    entries.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      Json entry = mat_element_to_json(annolist, i);
      MpiiEntry read;
      read.image = image_name(entry);
      if (read.image.empty()) {
        throw std::invalid_argument("expected image.name in annolist[" + std::to_string(i) +
                                    "], got none");
      }
      read.has_persons = has_mpii_persons(entry);
      copy_element(img_train, "img_train", i, entry);
      read.is_train = entry["img_train"] == 1 || entry["img_train"] == true;
      copy_element(single_person, "single_person", i, entry);
      copy_element(act, "act", i, entry);
      read.keyframe = image_name(keyframe_elements[i]);
      entry["annolist_keyframes"] = std::move(keyframe_elements[i]);
      read.json = dump(entry);
      entries.push_back(std::move(read));
    }
    return entries;
  });
}

}  // namespace eventgan
