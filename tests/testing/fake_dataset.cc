#include "tests/testing/fake_dataset.h"

#include <cstdio>

namespace eventgan::testing {

FakeDataset::FakeDataset(const std::string& folder, int count) : folder_(folder) {
  schema_.class_names = {"thing"};
  for (int number = 0; number < count; ++number) {
    const FrameRef reference = frame(number);
    frames_.push_back({reference.path.substr(folder.size() + 1, 4), "sequence", reference,
                       std::to_string(number)});
    Annotation annotation;
    annotation.original = "label " + std::to_string(number);
    Box box;
    box.xyxy = {1, 1, 3, 2};
    annotation.boxes = {box};
    annotations_[number] = annotation;
  }
}

FrameRef FakeDataset::frame(int number) const {
  char name[16];
  std::snprintf(name, sizeof name, "/%04d.png", number);
  const auto time = times_s_.find(number);
  return {folder_ + name, number, -1, time != times_s_.end() ? time->second : number * 0.1};
}

void FakeDataset::set_time(int number, double time_s) {
  times_s_[number] = time_s;
  frames_[static_cast<std::size_t>(number)].frame = frame(number);
}

PairedFrame FakeDataset::paired_frame(const LabelledFrame& labelled, int steps) const {
  const int number = static_cast<int>(labelled.frame.index) + steps;
  if (number < 0 || number >= static_cast<int>(frames_.size())) return {};
  return {missing_.count(number) ? PairedFrame::State::kMissing : PairedFrame::State::kPresent,
          frame(number)};
}

Outcome<Annotation> FakeDataset::annotation(const std::string& label_key) const {
  const int number = std::stoi(label_key);
  if (broken_.count(number))
    return SampleFault{"expected a label, got rubbish, in label " + label_key};
  return annotations_.at(number);
}

}  // namespace eventgan::testing
