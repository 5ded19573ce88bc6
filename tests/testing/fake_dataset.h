#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "stages/frames/dataset/dataset.h"

namespace eventgan::testing {

/// A dataset in memory: one sequence of frames 0..count-1 whose paths are "FOLDER/0007.png"; each
/// is labelled, with the annotation text "label 7" and one box of class 0.
class FakeDataset final : public Dataset {
 public:
  FakeDataset(const std::string& folder, int count);

  void make_missing(int frame) { missing_.insert(frame); }
  void set_time(int frame, double time_s);  ///< else 0.1 s times its number
  void break_annotation(int frame) { broken_.insert(frame); }
  void set_annotation(int frame, Annotation annotation) {
    annotations_[frame] = std::move(annotation);
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }
  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override;
  Outcome<Annotation> annotation(const std::string& label_key) const override;
  std::string label_place(const std::string& label_key) const override {
    return folder_ + "/" + label_key + ".txt";
  }
  std::vector<std::string> annotation_files() const override { return {}; }

 private:
  FrameRef frame(int number) const;

  std::string folder_;
  LabelSchema schema_;
  std::vector<LabelledFrame> frames_;
  std::map<int, double> times_s_;
  std::set<int> missing_;
  std::set<int> broken_;
  std::map<int, Annotation> annotations_;
};

}  // namespace eventgan::testing
