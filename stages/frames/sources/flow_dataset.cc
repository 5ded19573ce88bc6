#include "stages/frames/sources/flow_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/dataset/wrapped_dataset.h"
#include "stages/frames/decoding/source_flow.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace fs = std::filesystem;

namespace {

class FlowDataset final : public WrappedDataset {
 public:
  FlowDataset(std::unique_ptr<Dataset> dataset, const SourceSpec& spec, const fs::path& base)
      : WrappedDataset(std::move(dataset)), beside_(SourceRoot(spec.root, base).above()) {
    const SourceRoot root(spec.root, base);
    if (std::ranges::find(kKittiLeftCamera, root.name()) == kKittiLeftCamera.end()) {
      throw UsageError(fmt::format(
          "expected images of KITTI's left camera ({}), which flow_occ and flow_noc beside them "
          "are of, got \"flow\" of others, in {}",
          fmt::join(kKittiLeftCamera, ", "), root.written("")));
    }
    find_flow(root, spec.labels.has_value());
  }

  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }

  Outcome<SourceFlow> flow(const std::string& label_key) const override {
    const auto found = flow_of_.find(label_key);
    if (found == flow_of_.end()) return SourceFlow();
    std::vector<SourceFlow> read;
    for (const std::string& file : found->second) {
      try {
        read.push_back(read_flow_image(beside_.on_disk(file), kKittiFlowSteps));
      } catch (const std::runtime_error& error) {
        return SampleFault{fmt::format("{}, in {}", error.what(), beside_.written(file))};
      }
      if (read.back().size == read.front().size) continue;
      return SampleFault{fmt::format("expected flow of {} as in {}, got {}, in {}",
                                     to_string(read.front().size), found->second.front(),
                                     to_string(read.back().size), beside_.written(file))};
    }
    if (read.size() == 2) read[0].flow.valid = std::move(read[1].flow.valid);
    return std::move(read[0]);
  }

  std::vector<std::string> annotation_files() const override {
    std::vector<std::string> files = dataset_->annotation_files();
    for (const auto& [label_key, maps] : flow_of_) {
      for (const std::string& file : maps) files.push_back(beside_.written(file));
    }
    std::ranges::sort(files);
    return files;
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = dataset_->notes();
    std::ranges::copy(notes_, std::back_inserter(notes));
    return notes;
  }

 private:
  void find_flow(const SourceRoot& root, bool keeps_others) {
    std::array<std::set<std::string>, 2> maps;  // of all known pixels; of those that both show
    for (std::size_t i = 0; i < maps.size(); ++i) {
      for (const std::string& name : beside_.files_in(kKittiFlow[i])) maps[i].insert(name);
    }
    std::vector<std::string> without;
    for (const LabelledFrame& labelled : dataset_->labelled_frames()) {
      const fs::path image(labelled.frame.path);
      const bool is_in_root = labelled.frame.path == root.written(image.filename().string());
      const std::string name = image.stem().string() + ".png";
      std::vector<std::string> files;
      for (std::size_t i = 0; is_in_root && i < maps.size(); ++i) {
        if (maps[i].contains(name)) files.push_back(std::string(kKittiFlow[i]) + "/" + name);
      }
      if (files.empty()) without.push_back(labelled.sample_id);
      if (!files.empty() || keeps_others) labelled_.push_back(labelled);
      if (!files.empty()) flow_of_.emplace(labelled.label_key, std::move(files));
    }
    const auto count = std::ssize(dataset_->labelled_frames());
    if (flow_of_.empty()) {
      throw InputError(
          fmt::format("expected flow_occ/NAME.png or flow_noc/NAME.png of the images, "
                      "got of none of the {}, in {}",
                      count, beside_.written("")));
    }
    if (maps[0].empty() || maps[1].empty()) {
      notes_.push_back(fmt::format("no {} in {}: flow_valid is 1 where {} tells flow",
                                   kKittiFlow[maps[0].empty() ? 0 : 1], beside_.written(""),
                                   kKittiFlow[maps[0].empty() ? 1 : 0]));
    }
    if (without.empty()) return;
    notes_.push_back(fmt::format(
        "no flow of {} of {}, {}, first of {}", without.size(), count_text(count, "labelled frame"),
        keeps_others ? "which have labels alone" : "which are left out", without.front()));
  }

  SourceRoot beside_;  ///< the folder that ROOT is in
  std::vector<LabelledFrame> labelled_;
  std::unordered_map<std::string, std::vector<std::string>> flow_of_;  ///< below it, by label_key
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> with_flow(std::unique_ptr<Dataset> dataset, const SourceSpec& spec,
                                   const fs::path& base) {
  return std::make_unique<FlowDataset>(std::move(dataset), spec, base);
}

}  // namespace eventgan
