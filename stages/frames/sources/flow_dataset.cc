#include "stages/frames/sources/flow_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/frames/dataset/wrapped_dataset.h"
#include "stages/frames/decoding/source_flow.h"
#include "stages/frames/listing/image_folder.h"
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

  Outcome<SourceFlow> flow(const std::string& label_key) const override try {
    const auto found = flow_of_.find(label_key);
    if (found == flow_of_.end()) return SourceFlow();
    const auto& [files, fault] = found->second;
    if (!fault.empty()) return SampleFault{fault};
    std::vector<SourceFlow> read;
    for (const std::string& file : files) {
      read.push_back(
          read_flow_image(beside_.on_disk(file), beside_.written(file), kKittiFlowSteps));
    }
    SourceFlow& of_all = read.front();
    const SourceFlow& of_seen = read.back();
    if (of_seen.size != of_all.size) {
      return SampleFault{fmt::format("expected flow of {} as in {}, got {}, in {}",
                                     to_string(of_all.size), of_all.place, to_string(of_seen.size),
                                     of_seen.place)};
    }
    std::ranges::transform(of_all.flow.valid, of_seen.flow.valid, of_all.flow.valid.begin(),
                           std::bit_and());
    return std::move(of_all);
  } catch (const std::runtime_error& error) {
    return SampleFault{error.what()};
  }

  std::vector<std::string> annotation_files() const override {
    std::vector<std::string> files = dataset_->annotation_files();
    for (const auto& [label_key, maps] : flow_of_) {
      for (const std::string& file : maps.files) files.push_back(beside_.written(file));
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
  struct Maps {
    std::vector<std::string> files;  ///< below the folder that ROOT is in
    std::string fault;               ///< why they are not an image's; empty: they are
  };

  /// Those of an image, and why they are not to be trusted.
  Maps maps_of(const LabelledFrame& labelled, const std::string& name) const {
    Maps maps;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      const std::string file = fmt::format("{}/{}", kKittiFlow[i], name);
      if (names_[i].contains(name)) {
        maps.files.push_back(file);
      } else if (!names_[i].empty()) {
        maps.fault = fmt::format("expected {}, as there is another one, got none, in {}", file,
                                 beside_.written(""));
      }
    }
    if (maps.files.empty()) return {};
    const PairedFrame next = dataset_->paired_frame(labelled, 1);
    if (next.state == PairedFrame::State::kPresent &&
        next.frame.index != labelled.frame.index + 1) {
      maps.fault = fmt::format("expected the image after {}, whose flow there is, got {}, in {}",
                               labelled.frame.path, next.frame.path, beside_.written(""));
    }
    return maps;
  }

  void find_flow(const SourceRoot& root, bool keeps_others) {
    std::set<std::string> unused;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      for (const std::string& name : beside_.files_in(kKittiFlow[i])) {
        names_[i].insert(name);
        unused.insert(fmt::format("{}/{}", kKittiFlow[i], name));
      }
    }
    std::vector<std::string> without;  // though there is a next image
    for (const LabelledFrame& labelled : dataset_->labelled_frames()) {
      const fs::path image(labelled.frame.path);
      const bool is_in_root = labelled.frame.path == root.written(image.filename().string());
      Maps maps = is_in_root ? maps_of(labelled, image.stem().string() + ".png") : Maps();
      const bool has_flow = !maps.files.empty();
      if (has_flow || keeps_others) labelled_.push_back(labelled);
      if (!has_flow && dataset_->paired_frame(labelled, 1).state == PairedFrame::State::kPresent) {
        without.push_back(labelled.sample_id);
      }
      for (const std::string& file : maps.files) unused.erase(file);
      if (has_flow) flow_of_.emplace(labelled.label_key, std::move(maps));
    }
    if (flow_of_.empty()) {
      throw InputError(
          fmt::format("expected flow_occ/NAME.png or flow_noc/NAME.png of the images, "
                      "got of none of the {}, in {}",
                      std::ssize(dataset_->labelled_frames()), beside_.written("")));
    }
    if (names_[0].empty() || names_[1].empty()) {
      notes_.push_back(fmt::format("no {} in {}: flow_valid is 1 where {} tells flow",
                                   kKittiFlow[names_[0].empty() ? 0 : 1], beside_.written(""),
                                   kKittiFlow[names_[0].empty() ? 1 : 0]));
    }
    if (!without.empty()) {
      notes_.push_back(counted(without, "image",
                               std::string(" without flow, though another one follows, ") +
                                   (keeps_others ? "taken for the labels" : "left out") + " in " +
                                   root.written("")));
    }
    if (!unused.empty()) {
      notes_.push_back(
          counted({unused.begin(), unused.end()}, "file",
                  " of flow without a labelled image left out in " + beside_.written("")));
    }
  }

  SourceRoot beside_;                           ///< the folder that ROOT is in
  std::array<std::set<std::string>, 2> names_;  ///< of the files in each folder of kKittiFlow
  std::vector<LabelledFrame> labelled_;
  std::unordered_map<std::string, Maps> flow_of_;  ///< by label_key
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> with_flow(std::unique_ptr<Dataset> dataset, const SourceSpec& spec,
                                   const fs::path& base) {
  return std::make_unique<FlowDataset>(std::move(dataset), spec, base);
}

}  // namespace eventgan
