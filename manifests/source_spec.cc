#include <algorithm>
#include <initializer_list>

#include "manifests/job_words_internal.h"
#include "manifests/manifest_text_internal.h"
#include "manifests/source_spec_internal.h"

namespace eventgan {
namespace {

/// Reads the keys that only some datasets have.
class SpecialKeys {
 public:
  /// `dataset`: none if the manifest's is faulty; then no key is out of place.
  SpecialKeys(StrictObject& object, std::optional<DatasetKind> dataset)
      : object_(object), dataset_(dataset) {}

  /// The key's value if it is there. It is a fault where the dataset is not one of `owners`.
  std::optional<StrictValue> find(std::string_view key, std::initializer_list<DatasetKind> owners) {
    std::optional<StrictValue> value = object_.find(key);
    if (!value || !dataset_) return value;
    if (std::find(owners.begin(), owners.end(), *dataset_) != owners.end()) return value;
    std::string expected =
        "no such key for dataset \"" + std::string(to_string(*dataset_)) + "\" (of ";
    std::string_view separator;
    for (const DatasetKind owner : owners) {
      expected.append(separator).append(to_string(owner));
      separator = ", ";
    }
    value->fault(expected + " only)");
    return std::nullopt;
  }

  std::optional<std::string> find_path(std::string_view key,
                                       std::initializer_list<DatasetKind> owners) {
    const std::optional<StrictValue> value = find(key, owners);
    return value ? std::optional(read_path(*value)) : std::nullopt;
  }

 private:
  StrictObject& object_;
  std::optional<DatasetKind> dataset_;
};

}  // namespace

SourceSpec read_source(const StrictValue& value) {
  using enum DatasetKind;
  SourceSpec spec;
  StrictObject object = value.object();
  const auto dataset = object.at("dataset").sound_choice(kDatasetWords);
  spec.dataset = dataset.value_or(spec.dataset);
  spec.root = read_path(object.at("root"));
  if (const auto split = object.find("split")) spec.split = read_name(*split);

  SpecialKeys keys(object, dataset);
  spec.raw_root = keys.find_path("raw_root", {kKittiObject});
  spec.devkit = keys.find_path("devkit", {kKittiObject});
  // Neither is of use without the other: the devkit's mapping says which raw frame a picture is.
  if (spec.raw_root && !spec.devkit) object.at("devkit").fault("a path, since raw_root is given");
  if (spec.devkit && !spec.raw_root) object.at("raw_root").fault("a path, since devkit is given");
  spec.annotations = keys.find_path("annotations", {kMpii, kMpiiList, kHuman36m});
  if (dataset == kMpiiList && !spec.annotations)
    spec.annotations = read_path(object.at("annotations"));
  spec.sequences = keys.find_path("sequences", {kMpii, kMpiiList});
  const auto layout = keys.find("layout", {kHuman36m});
  if (layout || dataset == kHuman36m) spec.layout = object.at("layout").choice(kLayoutWords);
  if (const auto rate = keys.find("frames_per_second", {kFrames})) {
    spec.frames_per_second = rate->number(1e-6, 1e6);
  }

  spec.pairs = read_pairs(object.at("pairs"));
  object.finish();
  return spec;
}

}  // namespace eventgan
