#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// A dataset as another one has it, but for what a class derived from it says. still_annotation is
/// not passed on, but is the derived class's annotation: one that wraps a dataset of clips must say
/// it, too.
class WrappedDataset : public Dataset {
 public:
  const LabelSchema& label_schema() const override { return dataset_->label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override {
    return dataset_->labelled_frames();
  }
  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    return dataset_->paired_frame(frame, steps);
  }
  Outcome<Annotation> annotation(const std::string& label_key) const override {
    return dataset_->annotation(label_key);
  }
  Outcome<MadePair> made_pair(const std::string& label_key) const override {
    return dataset_->made_pair(label_key);
  }
  Outcome<SourceFlow> flow(const std::string& label_key) const override {
    return dataset_->flow(label_key);
  }
  std::optional<ImageSize> made_size(const std::string& label_key) const override {
    return dataset_->made_size(label_key);
  }
  ImageSize sensor_size(const std::string& label_key) const override {
    return dataset_->sensor_size(label_key);
  }
  Outcome<EventWindow> events(const std::string& label_key) const override {
    return dataset_->events(label_key);
  }
  ImageSizes* image_sizes() const override { return dataset_->image_sizes(); }
  std::string label_place(const std::string& label_key) const override {
    return dataset_->label_place(label_key);
  }
  std::vector<std::string> annotation_files() const override {
    return dataset_->annotation_files();
  }
  std::map<std::string, std::string> label_meanings() const override {
    return dataset_->label_meanings();
  }
  std::vector<std::string> notes() const override { return dataset_->notes(); }
  std::vector<std::string> warnings() const override { return dataset_->warnings(); }
  Unreadable unreadable() const override { return dataset_->unreadable(); }

 protected:
  explicit WrappedDataset(std::unique_ptr<Dataset> dataset) : dataset_(std::move(dataset)) {}

  std::unique_ptr<Dataset> dataset_;
};

}  // namespace eventgan
