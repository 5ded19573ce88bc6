#include "stages/frames/sources/class_numbers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/strict_json.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/dataset/wrapped_dataset.h"

namespace eventgan {
namespace {

/// A dataset with other numbers for its classes.
class RenumberedDataset final : public WrappedDataset {
 public:
  /// `names` has all that are taken.
  RenumberedDataset(std::unique_ptr<Dataset> dataset, const ClassNames& taken, ClassNames names)
      : WrappedDataset(std::move(dataset)), schema_(dataset_->label_schema()) {
    for (const std::string& name : schema_.class_names) {
      const bool is_taken = std::ranges::find(taken, name) != taken.end();
      numbers_.push_back(is_taken ? static_cast<int>(std::ranges::find(names, name) - names.begin())
                                  : kLeftOut);
    }
    schema_.class_names = std::move(names);
  }

  std::unique_ptr<Dataset> take() { return std::move(dataset_); }

  const LabelSchema& label_schema() const override { return schema_; }
  Outcome<Annotation> annotation(const std::string& label_key) const override {
    return renumbered(dataset_->annotation(label_key));
  }
  Outcome<Annotation> still_annotation(const std::string& label_key) const override {
    return renumbered(dataset_->still_annotation(label_key));
  }

 private:
  Outcome<Annotation> renumbered(Outcome<Annotation> read) const {
    if (is_fault(read)) return read;
    for (Box& box : read->boxes) box.class_id = numbers_.at(static_cast<std::size_t>(box.class_id));
    const std::size_t erased =
        std::erase_if(read->boxes, [](const Box& box) { return box.class_id == kLeftOut; });
    if (!read->is_repeat) read->of_other_classes += erased;
    return read;
  }

  static constexpr int kLeftOut = -1;
  LabelSchema schema_;
  std::vector<int> numbers_;  ///< by the dataset's own
};

void add_names(const ClassNames& more, ClassNames& names) {
  if (names.empty()) {
    names = more;
    return;
  }
  std::set<std::string_view> known(names.begin(), names.end());
  ClassNames added;
  for (const std::string& name : more) {
    if (known.insert(name).second) added.push_back(name);
  }
  std::ranges::move(added, std::back_inserter(names));
}

/// The names of the classes that are taken.
ClassNames taken_of(const Dataset& dataset, const SourceSpec& source) {
  const ClassNames& all = dataset.label_schema().class_names;
  if (source.classes.empty()) return all;
  ClassNames taken;
  for (const std::string& name : source.classes) {
    if (std::ranges::find(all, name) == all.end()) {
      constexpr std::size_t kMostNamed = 20;
      const std::vector<std::string_view> known(all.begin(), all.end());
      const std::string_view meant = near_word(name, known);
      throw InputError(fmt::format("expected classes of the source ({}), got {}, in {}{}",
                                   some_of(all, kMostNamed), name, source.root,
                                   meant.empty() ? "" : fmt::format("; did you mean {}?", meant)));
    }
    if (std::ranges::find(taken, name) == taken.end()) taken.push_back(name);
  }
  for (const std::string& name : all) {  // regions to ignore, of whatever class
    if (name == "DontCare" && std::ranges::find(taken, name) == taken.end()) taken.push_back(name);
  }
  return taken;
}

bool begins_with(const ClassNames& names, const ClassNames& first) {
  return names.size() >= first.size() && std::equal(first.begin(), first.end(), names.begin());
}

}  // namespace

void number_classes(const std::vector<SourceSpec>& sources,
                    std::vector<std::unique_ptr<Dataset>>& datasets,
                    const std::vector<std::optional<ClassNames>>& stored) {
  std::map<DatasetKind, ClassNames> of_kind;
  for (std::size_t i = 0; i < stored.size(); ++i) {
    if (stored[i]) add_names(*stored[i], of_kind[sources[i].dataset]);
  }
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    if (auto* earlier = dynamic_cast<RenumberedDataset*>(datasets[i].get())) {
      datasets[i] = earlier->take();
    }
    if (!datasets[i]) continue;
    add_names(taken_of(*datasets[i], sources[i]), of_kind[sources[i].dataset]);
  }
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    if (!datasets[i]) continue;
    const ClassNames& today = datasets[i]->label_schema().class_names;
    ClassNames names = of_kind[sources[i].dataset];
    if (i < stored.size() && stored[i] && !stored[i]->empty()) {
      if (!begins_with(names, *stored[i])) {  // each source had its own list
        names = *stored[i];
        add_names(of_kind[sources[i].dataset], names);
      }
    } else if (today.empty()) {
      continue;
    }
    const ClassNames taken = taken_of(*datasets[i], sources[i]);
    if (names == today && taken == today) continue;
    datasets[i] =
        std::make_unique<RenumberedDataset>(std::move(datasets[i]), taken, std::move(names));
  }
}

}  // namespace eventgan
