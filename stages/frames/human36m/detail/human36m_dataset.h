#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/human36m/detail/camera_book.h"
#include "stages/frames/human36m/detail/pose_table.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

/// Names of Human3.6M's joints in the order in which annotations of that many joints hold them: 32
/// as the dataset itself names them (its end sites told apart by their parents), 17 as pose
/// trainers do, else "joint_0", "joint_1", ...
std::vector<std::string> human36m_joint_names(std::size_t count);

/// The names that the 17 joints in common use have, for those of the 32 that are among them; "" for
/// the others. Empty for any other count.
std::vector<std::string> human36m_joint_aliases(std::size_t count);

/// Human3.6M's videos run at this rate, and its frame numbers count all of their frames from 1.
inline constexpr double kHuman36mFramesPerSecond = 50;

/// When a frame was taken, in seconds since frame 1.
double human36m_time_s(std::int64_t number);

/// The frames of one camera's take, by their numbers.
class TakenFrames {
 public:
  virtual ~TakenFrames() = default;

  virtual FrameRef frame(std::int64_t number) const = 0;

  /// The frame `steps` frames after `number`.
  virtual PairedFrame paired_frame(std::int64_t number, int steps) const = 0;
};

/// Frames stored as images: where they lie, and which numbers ought to be there.
class FrameFolder final : public TakenFrames {
 public:
  /// `folder` as FrameRef::path writes it. `labelled` are the numbers that have a label, in any
  /// order; an image may be absent. `prefix` is before the six digits of a name.
  FrameFolder(std::string folder, std::string prefix, NumberedSequence stored,
              const std::vector<std::int64_t>& labelled);

  FrameRef frame(std::int64_t number) const override;

  /// Of those that are stored or labelled, however far apart their numbers: h36m-fetch keeps a
  /// frame when the person has moved. One that is labelled but not stored is a missing frame.
  PairedFrame paired_frame(std::int64_t number, int steps) const override;

 private:
  std::string folder_;
  std::string prefix_;
  NumberedSequence stored_;
  std::vector<std::int64_t> numbers_;  ///< stored or labelled; ascending, each once
};

/// What all layouts come down to: labelled frames, takes, and annotation files.
class IndexedDataset final : public Dataset {
 public:
  /// Adds an annotation file; `key` is what is before "#ROW" in its label keys, `written` its
  /// path as FrameRef::path has it. Throws InputError if its number of joints differs from the
  /// others'.
  void add_table(const std::string& key, const std::string& written,
                 std::unique_ptr<PoseTable> table);
  void add_annotation_file(const std::string& written);
  /// The cameras of cameras.pkl in the root; none if it is not there. Throws InputError.
  CameraBook add_cameras(const SourceRoot& root);
  void add_take(const std::string& sequence, std::unique_ptr<TakenFrames> frames);
  /// The take must have been added. `fault`: see LabelledFrame.
  void add_labelled(std::string sample_id, const std::string& sequence, std::int64_t number,
                    const std::string& table_key, std::size_t row, std::string fault = {});
  void add_note(std::string note) { notes_.push_back(std::move(note)); }

  /// Call once, last. Throws InputError if a frame is labelled twice, or none is; `root` names the
  /// source then.
  void finish(const std::string& root);

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override;
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
  std::unordered_map<std::string, std::unique_ptr<TakenFrames>> takes_;
  std::map<std::string, Table> tables_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

/// open_human36m_dataset for one layout each.
std::unique_ptr<Dataset> open_human36m_fetch(const SourceSpec& spec,
                                             const std::filesystem::path& base);
std::unique_ptr<Dataset> open_human36m_extracted(const SourceSpec& spec,
                                                 const std::filesystem::path& base);
std::unique_ptr<Dataset> open_human36m_official(const SourceSpec& spec,
                                                const std::filesystem::path& base);

}  // namespace eventgan
