#include <algorithm>
#include <charconv>
#include <utility>

#include "manifests/faults.h"
#include "stages/frames/human36m/human36m_joints.h"
#include "stages/frames/human36m/indexed_dataset_internal.h"

namespace eventgan {

void IndexedDataset::add_table(const std::string& key, const std::string& written,
                               std::unique_ptr<PoseTable> table) {
  if (tables_.empty()) schema_.joint_names = human36m_joint_names(table->joint_count());
  if (table->joint_count() != schema_.joint_names.size()) {
    throw InputError("expected " + std::to_string(schema_.joint_names.size()) +
                     " joints as in the files before, got " + std::to_string(table->joint_count()) +
                     ", in " + written);
  }
  for (std::string& note : table->notes()) notes_.push_back(std::move(note));
  annotation_files_.push_back(written);
  tables_[key] = {written, std::move(table)};
}

void IndexedDataset::add_annotation_file(const std::string& written) {
  annotation_files_.push_back(written);
}

void IndexedDataset::add_video(const std::string& sequence, FrameFolder frames) {
  videos_.emplace(sequence, std::move(frames));
}

void IndexedDataset::add_labelled(std::string sample_id, const std::string& sequence,
                                  std::int64_t number, const std::string& table_key,
                                  std::size_t row) {
  labelled_.push_back({.sample_id = std::move(sample_id),
                       .sequence = sequence,
                       .frame = videos_.at(sequence).frame(number),
                       .label_key = table_key + "#" + std::to_string(row)});
}

void IndexedDataset::finish(const std::string& root) {
  if (labelled_.empty()) throw InputError("expected labelled frames, got none, in " + root);
  std::ranges::stable_sort(labelled_, {}, &LabelledFrame::sample_id);
  const auto twice = std::ranges::adjacent_find(labelled_, {}, &LabelledFrame::sample_id);
  if (twice != labelled_.end()) {
    throw InputError("expected one label for a frame, got " + twice->label_key + " and " +
                     std::next(twice)->label_key + ", in " + root + " (" + twice->sample_id + ")");
  }
  std::ranges::sort(annotation_files_);
  root_ = root;
}

Neighbour IndexedDataset::neighbour(const LabelledFrame& frame, int steps) const {
  const auto video = videos_.find(frame.sequence);
  if (video == videos_.end()) return {};
  return video->second.neighbour(frame.frame.index, steps);
}

const IndexedDataset::Table* IndexedDataset::table_of(const std::string& label_key) const {
  const std::size_t hash = label_key.rfind('#');
  if (hash == std::string::npos) return nullptr;
  const auto table = tables_.find(label_key.substr(0, hash));
  return table == tables_.end() ? nullptr : &table->second;
}

Outcome<Annotation> IndexedDataset::annotation(const std::string& label_key) const {
  if (const Table* table = table_of(label_key)) {
    std::size_t row = 0;
    const char* end = label_key.data() + label_key.size();
    const auto [stop, error] =
        std::from_chars(label_key.data() + label_key.rfind('#') + 1, end, row);
    if (error == std::errc() && stop == end && row < table->rows->row_count()) {
      return table->rows->annotation(row);
    }
  }
  return SampleFault{"expected a row of an annotation file, got \"" + label_key + "\", in " +
                     root_};
}

std::string IndexedDataset::label_place(const std::string& label_key) const {
  const Table* table = table_of(label_key);
  return table == nullptr ? root_ : table->written + label_key.substr(label_key.rfind('#'));
}

}  // namespace eventgan
