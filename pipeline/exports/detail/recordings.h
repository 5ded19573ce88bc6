#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/exports/detail/exporter.h"
#include "pipeline/exports/detail/sample_events.h"
#include "pipeline/preview/preview_reader.h"
#include "stages/recordings/writers/event_columns_writer.h"

namespace eventgan {

// Of the rows' tables of files.
inline constexpr char kBboxFile[] =
    "boxes: t, x, y, w, h, class_id, track_id, class_confidence, microseconds";
inline constexpr char kWindowsFile[] = "a sample a line";
inline constexpr char kWindowColumns[] =
    "begin_us:Integer end_us:Integer label_us:Integer events:Integer sample_id:Text";
inline constexpr char kClassesFile[] = "numbers of classes, and their names";

/// A sample as a part of a recording: its events lie between begin_us and end_us. The label's time
/// is that of the labelled frame. Times are on the recording's clock, >= 0.
struct SampleWindow {
  const ExportShard* shard = nullptr;
  int slot = 0;
  std::int64_t begin_us = 0;
  std::int64_t end_us = 0;
  std::int64_t label_us = 0;
  bool is_labelled = false;  ///< as RecordingsExporter::is_labelled says
};

/// What one camera could have seen: samples of one sequence and of one shape in time order, whose
/// windows do not overlap and whose labels are at different times.
struct OutgoingRecording {
  std::string name;  ///< of its files
  const ExportSource* source = nullptr;
  VolumeShape shape;
  bool is_timed = true;               ///< else its clock counts frames
  std::vector<SampleWindow> windows;  ///< at least one

  std::int64_t begin_us() const { return windows.front().begin_us; }
  std::int64_t end_us() const { return windows.back().end_us; }
  bool is_labelled() const { return std::ranges::any_of(windows, &SampleWindow::is_labelled); }
};

/// The recordings that are made together.
struct RecordingGroup {
  std::string step;
  bool is_loose = false;  ///< samples of one shard, each by itself
  std::vector<OutgoingRecording> recordings;
};

/// A box as recordings have it: with a time and an object's number.
struct RecordedBox {
  std::int64_t t_us = 0;
  Rectangle box;  ///< cut to the volume
  int class_number = 0;
  std::int64_t track_id = -1;
};

/// One sample on its way into a recording.
struct RecordedSample {
  std::string sample_id;
  std::vector<StampedEvent> events;  ///< within the window
  std::vector<RecordedBox> boxes;    ///< those that are exported, at label_us
  // Where the exporter keeps them:
  std::string name;           ///< of the sample's own files
  std::vector<float> volume;  ///< [2 bins, H, W]
  SampleFrames frames;
  PixelFlow flow;  ///< empty: there is none
};

/// An exporter of recordings. Samples of a sequence whose frames' times are known share its clock;
/// of those whose frames have but numbers, one frame is the smallest step between the numbers of a
/// pair, and there are ExportOptions::frames_per_second. Where their windows overlap
/// they are spread over as few recordings as need be, NAME, NAME~2 ..., so that no moment has the
/// events of two samples. A sample of no sequence is a recording by itself, from 0 to its gap (1 s
/// if that is not known). The recordings of a sequence are one step of the export, so are the
/// samples of a shard that are alone. label_map_dictionary.json has the classes, {"0": "Car"}, as
/// Prophesee's datasets have them.
class RecordingsExporter : public Exporter {
 public:
  RecordingsExporter(const ExportInput& input, const ExportOptions& options);

  std::string settings() const override;
  void check(const ExportInput& input, const std::function<void()>& check_stop) const override;
  bool works_by_shard() const override { return false; }
  void finish(const ExportWork& work, const std::vector<const ExportShard*>& shards) const override;
  void account(const OutgoingSample& sample, LeftOut& left_out) const override;
  LeftOut whole_samples_left_out() const override;
  std::vector<std::string> notes() const override;

 protected:
  /// Where the samples of a recording come from, one after the other.
  using ForEachSample =
      std::function<void(const std::function<void(const SampleWindow&, RecordedSample&)>&)>;

  /// Writes the files of a recording. Called side by side.
  virtual void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                               ExportFolder::Step& step) const = 0;

  /// Keeps what else the format has of a sample. Called side by side.
  virtual void keep_more(const OutgoingSample&, RecordedSample&) const {}

  /// Whether a sample has a label that the format has a use for.
  virtual bool is_labelled(const OutgoingSample&) const { return true; }

  /// What of a recording is not exported. Called one after the other.
  virtual void account_recording(const OutgoingRecording& recording, LeftOut& left_out) const;

  /// None if no source has boxes.
  const ClassNumbers* numbers() const { return numbers_.get(); }

 private:
  std::vector<RecordingGroup> lay_recordings(const ExportWork& work,
                                             const std::vector<const ExportShard*>& shards) const;
  void write_classes(const ExportWork& work, const std::vector<const ExportShard*>& shards) const;
  RecordedSample recorded(const OutgoingSample& sample, const SampleWindow& window) const;

  ExportOptions options_;
  SampleEvents events_;
  std::unique_ptr<ClassNumbers> numbers_;
  // Of `finish`:
  mutable LeftOut left_out_;          ///< of whole recordings
  mutable std::int64_t untimed_ = 0;  ///< samples whose clock counts frames
};

/// Throws UsageError for volumes of more than `most` pixels a side, which `word`'s files do not
/// hold.
void require_sides(const ExportInput& input, const std::function<void()>& check_stop, int most,
                   std::string_view word);

/// Gives each box without a track a number of its own, beyond those that there are: an object that
/// was seen once. Throws std::runtime_error for a number beyond 2^32 - 1, which RVT's fields do not
/// hold.
void number_tracks(std::vector<RecordedBox>& boxes, const OutgoingRecording& recording);

/// A line for each sample: begin, end and label in microseconds as in the recording's files, which
/// count from `clock_us` on, the number of events, and the sample's id.
std::string window_line(const SampleWindow& window, const RecordedSample& sample,
                        std::int64_t clock_us);

/// Boxes as Prophesee's programs and RVT read them, RECORDING_bbox.npy: BBOX_DTYPE of RVT's
/// utils/evaluation/prophesee, whose rows are padded to 40 bytes; NumPy packs a selection of them.
std::string prophesee_boxes(const std::vector<RecordedBox>& boxes, bool is_padded = true);

/// The name of a recording's files beside that: their readers cut a name at its first "bbox", so in
/// it that is "%62box".
std::string name_before_bbox(const OutgoingRecording& recording);

/// Appends a number's bytes, little endian.
template <class Number>
void put(std::string& bytes, Number number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

}  // namespace eventgan
