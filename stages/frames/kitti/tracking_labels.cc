#include "stages/frames/kitti/tracking_labels.h"

#include <span>
#include <string_view>
#include <utility>

#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/kitti/text_table.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMaxFrame = 999'999'999;

}  // namespace

TrackingLabels::TrackingLabels(std::string text, std::string path)
    : text_(std::move(text)), path_(std::move(path)) {
  for (const TextLine& line : split_lines(text_)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    const auto frame = parse_number<std::int64_t>(columns[0]);
    if (frame && *frame >= 0 && *frame <= kMaxFrame) {
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
    if (is_fault(box)) return std::get<SampleFault>(box);
    const auto track = parse_number<std::int64_t>(columns[1]);
    if (!track) {
      return SampleFault{"expected a whole number for track id, got " + in_quotes(columns[1]) +
                         ", in " + where};
    }
    std::get<Box>(box).track_id = *track;
    annotation.boxes.push_back(std::get<Box>(box));
    annotation.original += bytes;
  }
  return annotation;
}

}  // namespace eventgan
