#include "stages/frames/kitti/kitti_tracking_dataset.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/kitti/detail/calibration_file.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/kitti/raw_drive.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {}  // namespace

TrackingLabels::TrackingLabels(std::string text, std::string path)
    : text_(std::move(text)), path_(std::move(path)) {
  for (const TextLine& line : split_lines(text_)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    const auto frame = parse_whole(columns[0]);
    if (frame && *frame >= 0 && *frame <= kMaxFrameNumber) {
      lines_[*frame].push_back({static_cast<std::size_t>(line.bytes.data() - text_.data()),
                                line.bytes.size(), line.number});
    } else if (!fault_) {
      fault_ = SampleFault{"expected a frame number, got " + in_quotes(columns[0]) + ", in " +
                           place_in_file(path_, line.number)};
    }
  }
}

std::vector<std::int64_t> TrackingLabels::frames() const {
  std::vector<std::int64_t> frames;
  frames.reserve(lines_.size());
  for (const auto& [frame, lines] : lines_) frames.push_back(frame);
  return frames;
}

Outcome<Annotation> TrackingLabels::annotation(std::int64_t frame) const {
  if (fault_) return *fault_;
  Annotation annotation;
  const auto found = lines_.find(frame);
  if (found == lines_.end()) return annotation;
  for (const Line& line : found->second) {
    const std::string_view bytes = std::string_view(text_).substr(line.offset, line.length);
    const auto columns = split_columns(bytes);
    const std::string where = place_in_file(path_, line.number);
    auto box = parse_kitti_object(columns, KittiColumns::kTracking, where);
    if (is_fault(box)) return box.fault();
    const auto track = parse_whole(columns[1]);
    if (!track) {
      return SampleFault{"expected a whole number for track id, got " + in_quotes(columns[1]) +
                         ", in " + where};
    }
    box->track_id = *track;
    annotation.boxes.push_back(*box);
    annotation.original += bytes;
  }
  return annotation;
}

namespace {

struct Sequence {
  NumberedSequence images;
  TrackingLabels labels;
  std::optional<std::array<double, 12>> projection;  ///< P2 of calib/SEQ.txt, if it is there
};

class KittiTrackingDataset : public Dataset {
 public:
  KittiTrackingDataset(const SourceSpec& spec, const std::filesystem::path& base)
      : root_(spec.root, base) {
    root_.require_folder("label_02");
    root_.require_folder("image_02");
    std::vector<std::string> left_out;
    // A folder in a label file's place is one that cannot be read, not one that is not there.
    for (const auto& names : {root_.files_in("label_02"), root_.folders_in("label_02")}) {
      for (const std::string& name : names) {
        if (name.ends_with(".txt")) {
          add_sequence(name.substr(0, name.size() - 4));
        } else if (!name.starts_with('.')) {
          left_out.push_back(name);
        }
      }
    }
    note_left_out(left_out, "label_02");
    std::ranges::sort(frames_, {}, &LabelledFrame::sample_id);
    const auto images = root_.folders_in("image_02");
    const auto unlabelled = std::ranges::count_if(
        images, [&](const std::string& name) { return !sequences_.contains(name); });
    if (unlabelled > 0) {
      notes_.push_back(
          count_text(unlabelled, "sequence", " without labels in " + root_.written("image_02")));
    }
  }

  const LabelSchema& label_schema() const override { return kitti_label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::vector<std::string> notes() const override { return notes_; }

  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    const auto place = sequences_.at(frame.sequence).images.at(frame.frame.index, steps);
    if (place.number < 0) return {};
    return {place.state, frame_ref(frame.sequence, place)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    // "label_02/SEQ.txt#FRAME"
    const std::size_t mark = std::min(label_key.rfind('#'), label_key.size());
    const std::string name = std::filesystem::path(label_key.substr(0, mark)).stem().string();
    const auto sequence = sequences_.find(name);
    const auto frame = parse_number<std::int64_t>(
        std::string_view(label_key).substr(std::min(mark + 1, label_key.size())));
    if (!frame || sequence == sequences_.end()) {
      return SampleFault{"expected label_02/SEQUENCE.txt#FRAME, got " + in_quotes(label_key) +
                         ", in " + root_.written("")};
    }
    auto annotation = sequence->second.labels.annotation(*frame);
    if (!is_fault(annotation)) annotation->projection = sequence->second.projection;
    return annotation;
  }

  std::string label_place(const std::string& label_key) const override {
    return root_.written(label_key);
  }

 private:
  TrackingLabels read_labels(const std::string& label) const {
    auto text = root_.read(label);
    if (is_fault(text)) return TrackingLabels(text.fault());
    return {*std::move(text), root_.written(label)};
  }

  std::optional<std::array<double, 12>> read_projection(const std::string& file) {
    if (!root_.has_file(file)) return std::nullopt;
    annotation_files_.push_back(root_.written(file));
    return CalibrationFile(root_, file).read<12>("P2");
  }

  void add_sequence(const std::string& name) {
    const std::string label = "label_02/" + name + ".txt";
    annotation_files_.push_back(root_.written(label));
    const auto [place, is_new] = sequences_.emplace(
        name, Sequence{NumberedSequence::list(root_.on_disk("image_02/" + name)),
                       read_labels(label), read_projection("calib/" + name + ".txt")});
    const Sequence& sequence = place->second;
    note_left_out(sequence.images.left_out(), "image_02/" + name);

    std::set<std::int64_t> numbers;
    for (const std::int64_t number : sequence.labels.frames()) numbers.insert(number);
    for (const auto& [number, file] : sequence.images.frames()) numbers.insert(number);
    for (const std::int64_t number : numbers) {
      LabelledFrame frame;
      frame.sample_id = fmt::format("{}/{:06}", name, number);
      frame.sequence = name;
      frame.frame = frame_ref(name, sequence.images.at(number, 0));
      frame.label_key = label + "#" + std::to_string(number);
      frames_.push_back(std::move(frame));
    }
  }

  void note_left_out(const std::vector<std::string>& names, const std::string& folder) {
    if (names.empty()) return;
    notes_.push_back(counted(names, "file", " left out in " + root_.written(folder)));
  }

  FrameRef frame_ref(const std::string& sequence, const NumberedSequence::Place& place) const {
    const std::string name =
        place.name.empty() ? fmt::format("{:06}.png", place.number) : place.name;
    return {root_.written("image_02/" + sequence + "/" + name), place.number, -1,
            static_cast<double>(place.number) * kKittiFrameSeconds};
  }

  SourceRoot root_;
  std::map<std::string, Sequence> sequences_;
  std::vector<LabelledFrame> frames_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_kitti_tracking_dataset(const SourceSpec& spec,
                                                     const std::filesystem::path& base) {
  return std::make_unique<KittiTrackingDataset>(spec, base);
}

namespace {

bool is_kitti_tracking(const std::filesystem::path& root) { return has_folder(root / "label_02"); }

std::vector<FoundSource> complete_kitti_tracking(FoundSource found) {
  if (!has_folder(found.root / "calib")) found.remarks.push_back("no calib: no projections");
  return {std::move(found)};
}

constexpr std::array kKittiTrackingLayouts{
    DatasetLayout{.fits = is_kitti_tracking,
                  .complete = complete_kitti_tracking,
                  .may_be_part = [](std::string_view name) { return name.starts_with("image"); }}};

}  // namespace

constinit const DatasetReader kKittiTrackingReader{.kind = DatasetKind::kKittiTracking,
                                                   .open = open_kitti_tracking_dataset,
                                                   .origin = kitti_origin,
                                                   .layouts = kKittiTrackingLayouts,
                                                   .habits = kKittiHabits};

}  // namespace eventgan
