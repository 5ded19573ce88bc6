#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "stages/frames/dataset.h"
#include "stages/frames/human36m/frame_folder_internal.h"
#include "stages/frames/human36m/pose_table_internal.h"

namespace eventgan {

/// What both layouts come down to: labelled frames, videos, and annotation files.
class IndexedDataset final : public Dataset {
 public:
  /// Adds an annotation file; `key` is what stands before "#ROW" in its label keys, `written` its
  /// path as FrameRef::path has it. Throws InputError if its number of joints differs from the
  /// others'.
  void add_table(const std::string& key, const std::string& written,
                 std::unique_ptr<PoseTable> table);
  void add_annotation_file(const std::string& written);
  void add_video(const std::string& sequence, FrameFolder frames);
  /// The video must have been added.
  void add_labelled(std::string sample_id, const std::string& sequence, std::int64_t number,
                    const std::string& table_key, std::size_t row);
  void add_note(std::string note) { notes_.push_back(std::move(note)); }

  /// Call once, last. Throws InputError if a frame is labelled twice, or none is; `root` names the
  /// source then.
  void finish(const std::string& root);

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  Neighbour neighbour(const LabelledFrame& frame, int steps) const override;
  Outcome<Annotation> annotation(const std::string& label_key) const override;
  std::string label_place(const std::string& label_key) const override;
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::vector<std::string> notes() const override { return notes_; }

 private:
  struct Table {
    std::string written;
    std::unique_ptr<PoseTable> rows;
  };

  /// The table of "KEY#ROW"; null if there is none.
  const Table* table_of(const std::string& label_key) const;

  std::string root_;
  LabelSchema schema_;
  std::vector<LabelledFrame> labelled_;
  std::unordered_map<std::string, FrameFolder> videos_;
  std::map<std::string, Table> tables_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

}  // namespace eventgan
