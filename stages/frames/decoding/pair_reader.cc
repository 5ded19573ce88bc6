#include "stages/frames/decoding/pair_reader.h"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/files/input_file.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

void FilesAhead::expect(const std::filesystem::path& file) {
  {
    const std::lock_guard lock(mutex_);
    if (by_path_.contains(file.native())) return;
  }
  auto opened = [&]() -> std::optional<InputFile> {
    try {
      std::string nobody_asks;
      return InputFile::open(file, nobody_asks);
    } catch (const LimitReached&) {  // it can wait
      return std::nullopt;
    }
  }();
  if (!opened) return;
  opened->load_ahead();
  const std::lock_guard lock(mutex_);
  if (by_path_.contains(file.native())) return;
  files_.emplace_front(file.native(), *std::move(opened));
  by_path_[files_.front().first] = files_.begin();
  if (files_.size() <= most_) return;
  by_path_.erase(files_.back().first);
  files_.pop_back();
}

InputFile FilesAhead::take(const std::filesystem::path& file) {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = by_path_.find(file.native()); found != by_path_.end()) {
      const auto place = found->second;
      by_path_.erase(found);
      InputFile taken = std::move(place->second);
      files_.erase(place);
      return taken;
    }
  }
  return open_image_file(file);
}

namespace {

// Frames kept besides those of the pairs under way.
constexpr int kLongestGap = 6;
constexpr int kMargin = 2;

/// What `prepare` returns or, if it throws a std::runtime_error, why not.
template <class Prepare>
SharedFrame frame_or_fault(Prepare prepare) {
  try {
    return std::make_shared<Outcome<PreparedFrame>>(prepare());
  } catch (const std::runtime_error& error) {
    return std::make_shared<Outcome<PreparedFrame>>(SampleFault{error.what()});
  }
}

/// What images_ call an image.
std::string name_of(const FrameRef& frame, ImageOrientation orientation) {
  return (orientation == ImageOrientation::kUpright ? "upright " : "stored ") + frame.path;
}

SampleFault fault_in(const FrameRef& frame, const std::string& reason) {
  return {reason + ", in " + frame.path};
}

/// Boxes and outlines of an image `factor` times as large.
std::vector<Box> resized(std::vector<Box> boxes, double factor) {
  for (Box& box : boxes) {
    Rectangle& edges = box.xyxy;
    edges = {edges.left * factor, edges.top * factor, edges.right * factor, edges.bottom * factor};
    for (std::vector<Point>& ring : box.outline.rings) {
      for (Point& corner : ring) corner = {corner.x * factor, corner.y * factor};
    }
  }
  return boxes;
}

}  // namespace

PairReader::PairReader(std::filesystem::path base, ImageSpec spec, int pairs_under_way,
                       bool tells_between)
    : base_(std::move(base)),
      spec_(std::move(spec)),
      tells_between_(tells_between),
      images_(std::make_unique<RecentlyUsed<std::string, SharedFrame>>(2 * pairs_under_way +
                                                                       kLongestGap + kMargin)),
      clips_(std::make_unique<RecentlyUsed<std::string, std::shared_ptr<const Clip>>>(1)),
      files_(std::make_unique<FilesAhead>()),
      stills_(base_, pairs_under_way + kMargin),
      videos_(std::make_unique<OpenVideos<SharedFrame>>(
          pairs_under_way + kLongestGap + kMargin, [spec = spec_](const ColourView& view) {
            return frame_or_fault([&] { return prepare_frame(view, spec); });
          })) {}

SharedFrame PairReader::frame(const FrameRef& ref, ImageOrientation orientation) const {
  if (ref.video_frame >= 0) return videos_->frames<1>(base_ / ref.path, {ref.video_frame})[0];
  return images_->get(name_of(ref, orientation), [&] {
    return frame_or_fault([&] {
      const ColourFrame image =
          decode_image(files_->take(base_ / ref.path), orientation, spec_.range);
      return prepare_frame({image.size, image.bgr.data()}, spec_);
    });
  });
}

Outcome<std::array<SharedFrame, 2>> PairReader::frames(const FramePair& pair,
                                                       ImageOrientation orientation) const {
  const FrameRef& previous = pair.previous;
  const FrameRef& next = pair.next;
  std::array<SharedFrame, 2> both;
  const FrameRef* current = &previous;
  try {
    if (previous.video_frame >= 0 && next.video_frame >= 0 && previous.path == next.path) {
      return videos_->frames<2>(base_ / previous.path, {previous.video_frame, next.video_frame},
                                pair.video_stride());
    }
    both[0] = frame(previous, orientation);
    current = &next;
    both[1] = frame(next, orientation);
  } catch (const std::runtime_error& error) {
    return fault_in(*current, error.what());
  }
  return both;
}

Outcome<SharedImage> PairReader::still_image(const FrameRef& still, ImageOrientation orientation,
                                             std::int64_t stride) const {
  if (still.video_frame >= 0) {
    Outcome<ColourFrame> decoded = stills_.decode(still, stride);
    if (is_fault(decoded)) return decoded.fault();
    return std::make_shared<const ColourFrame>(*std::move(decoded));
  }
  return std::make_shared<const ColourFrame>(
      decode_image(files_->take(base_ / still.path), orientation, spec_.range));
}

/// The image of a still's one pair, which is settled.
Outcome<StillImage> PairReader::settled_image(FramePair& pair, ImageOrientation orientation,
                                              std::int64_t stride, const Settle& settle) const {
  if (pair.next.video_frame >= 0) {
    Outcome<SharedImage> image = still_image(pair.next, orientation, stride);
    if (is_fault(image)) return image.fault();
    if (settle) pair = settle(pair, (*image)->size);
    return StillImage(*std::move(image));
  }
  const InputFile file = files_->take(base_ / pair.next.path);
  const ImageSize size = image_size(file, orientation);
  if (settle) pair = settle(pair, size);
  const int by = still_reduction(size, spec_, pair);
  auto image =
      std::make_shared<const ColourFrame>(decode_image(file, orientation, spec_.range, by));
  return image->size == size ? StillImage(std::move(image))
                             : StillImage(std::move(image), size, by);
}

struct PairReader::Clip {
  std::vector<Box> boxes;
  StillPose pose;  ///< any one
  MovingStill still;

  /// Another source may make other clips of the image; those are taken apart for each pair.
  bool is_of(const std::vector<Box>& others, const StillPose& other) const {
    const auto moves = [](const std::optional<ImageMotion>& object) { return object.has_value(); };
    return boxes == others && std::ranges::equal(pose.objects, other.objects, {}, moves, moves);
  }
};

Outcome<MovingStill> PairReader::still_of_clip(const FramePair& pair, ImageOrientation orientation,
                                               std::int64_t stride,
                                               const std::vector<Box>& boxes) const {
  const StillPose& pose = pair.poses.at(0);
  const auto take_apart = [&](SharedImage image) {
    return MovingStill(std::move(image), pair, spec_, boxes);
  };
  if (pair.next.video_frame < 0) {
    const auto clip = clips_->get(name_of(pair.next, orientation), [&] {
      SharedImage image = *still_image(pair.next, orientation, stride);
      return std::make_shared<const Clip>(Clip{boxes, pose, take_apart(std::move(image))});
    });
    if (clip->is_of(boxes, pose)) return clip->still;
  }
  Outcome<SharedImage> image = still_image(pair.next, orientation, stride);
  if (is_fault(image)) return image.fault();
  return take_apart(*std::move(image));
}

Outcome<PreparedPair> PairReader::still(const FramePair& planned, ImageOrientation orientation,
                                        std::int64_t stride, const std::vector<Box>& boxes,
                                        const Settle& settle, bool with_flow) const {
  try {
    FramePair pair = planned;
    OutlineCounts outlines;
    const auto moving = [&]() -> Outcome<MovingStill> {
      if (!planned.poses.empty()) return still_of_clip(planned, orientation, stride, boxes);
      Outcome<StillImage> image = settled_image(pair, orientation, stride, settle);
      if (is_fault(image)) return image.fault();
      std::vector<Box> outlined = boxes;
      if (!pair.objects.empty()) {
        outlined = resized(std::move(outlined), 1.0 / image->reduced_by);
        outlines = cut_out_missing({image->pixels->size, image->pixels->bgr.data()}, outlined);
        outlined = resized(std::move(outlined), image->reduced_by);
      }
      return MovingStill(*std::move(image), pair, spec_, outlined);
    }();
    if (is_fault(moving)) return moving.fault();
    FramesBetween frames = moving->frames(pair);
    PreparedPair prepared = prepare_pair({frames.at(0).pixels, moving->placement()},
                                         {frames.at(1).pixels, moving->placement()});
    prepared.outlines = outlines;
    if (with_flow) prepared.flow = moving->flow(pair);
    if (tells_between_) prepared.between = std::move(frames);
    if (settle && planned.poses.empty()) prepared.settled = std::move(pair);
    return prepared;
  } catch (const std::runtime_error& error) {
    return fault_in(planned.next, error.what());
  }
}

void PairReader::expect(const FramePair& pair, ImageOrientation orientation) const {
  for (const FrameRef* frame : {&pair.previous, &pair.next}) {
    if ((pair.motion || !pair.poses.empty()) && frame == &pair.next) break;  // both are one image
    if (frame->video_frame >= 0) continue;
    const std::string name = name_of(*frame, orientation);
    if (pair.poses.empty() ? images_->has(name) : clips_->has(name)) continue;
    files_->expect(base_ / frame->path);
  }
}

Outcome<PreparedPair> PairReader::read(const FramePair& pair, ImageOrientation orientation,
                                       std::int64_t still_stride, const std::vector<Box>& boxes,
                                       const Settle& settle, bool with_flow) const {
  if (pair.motion || !pair.poses.empty()) {
    return still(pair, orientation, still_stride, boxes, settle, with_flow);
  }
  const auto outcome = frames(pair, orientation);
  if (is_fault(outcome)) return outcome.fault();
  const auto& [previous, next] = *outcome;
  for (const auto& [frame, ref] : {std::pair{&previous, &pair.previous}, {&next, &pair.next}}) {
    if (is_fault(**frame)) return fault_in(*ref, (*frame)->fault().reason);
  }
  const auto& before = **previous;
  const auto& after = **next;
  if (before.placement.source != after.placement.source) {
    return SampleFault{"expected two frames of one size, got " +
                       to_string(before.placement.source) + " in " + pair.previous.path + " and " +
                       to_string(after.placement.source) + ", in " + pair.next.path};
  }
  return prepare_pair(before, after);
}

}  // namespace eventgan
