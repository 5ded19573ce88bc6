#include "stages/frames/sources/still_clips.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/recently_used.h"
#include "manifests/values/still_motion.h"
#include "stages/frames/dataset/wrapped_dataset.h"
#include "stages/frames/decoding/cut_out.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/kitti/kitti_label.h"

namespace eventgan {
namespace {

constexpr double kUsualRate_hz = 20;
constexpr double kLeastSeen = 0.05;       // of a box, or it is left out
constexpr std::int64_t kKeptStills = 64;  // read once for all frames of their clips
constexpr int kKeptVideoFrames = 2;

/// Where a still's points lie in a frame of its clip.
class Frame {
 public:
  Frame(ImageSize image, const StillPose& pose)
      : image_(image), pose_(pose), window_(clip_window(image)) {}

  ImageSize size() const { return window_.size; }
  Rectangle area() const { return {0, 0, double(size().width), double(size().height)}; }

  AffineMap image_map() const { return image_in_clip(image_, pose_); }
  AffineMap object_map(std::size_t k, const Box& box) const {
    return object_in_clip(image_, pose_, pose_.objects.at(k).value(), box);
  }
  bool moves_alone(std::size_t k) const {
    return k < pose_.objects.size() && pose_.objects[k].has_value();
  }

  Point point(const AffineMap& map, Point p) const {
    if (p == kMissingPoint) return p;
    p = mapped(map, p);
    return {p.x - window_.x, p.y - window_.y};
  }

  Outline outline(const AffineMap& map, Outline outline) const {
    for (auto& ring : outline.rings) {
      for (Point& corner : ring) corner = edge(map, corner);
    }
    return outline;
  }

  Rectangle box(const AffineMap& map, const Rectangle& box) const {
    const Outline corners{{{{box.left, box.top},
                            {box.right, box.top},
                            {box.right, box.bottom},
                            {box.left, box.bottom}}}};
    return bounds(outline(map, corners));
  }

 private:
  Point edge(const AffineMap& map, Point p) const {
    p = mapped_edge(map, p);
    return {p.x - window_.x, p.y - window_.y};
  }

  ImageSize image_;
  const StillPose& pose_;
  ClipWindow window_;
};

double area_of(const Rectangle& box) {
  return std::max(box.right - box.left, 0.0) * std::max(box.bottom - box.top, 0.0);
}

double scale_of(const AffineMap& map) {
  return std::sqrt(std::abs(map[0] * map[4] - map[1] * map[3]));
}

Rectangle cut(const Rectangle& box, const Rectangle& area) {
  return {std::max(box.left, area.left), std::max(box.top, area.top),
          std::min(box.right, area.right), std::min(box.bottom, area.bottom)};
}

std::size_t count(const GreyImage& mask) {
  return mask.pixels.size() -
         static_cast<std::size_t>(std::ranges::count(mask.pixels, std::uint8_t{0}));
}

/// As many pixels as the outline covers, of those within a frame's size around the frame.
std::size_t covered_pixels(Outline outline, ImageSize size) {
  const double width = size.width, height = size.height;
  const Rectangle around = cut(bounds(outline), {-width, -height, 2 * width, 2 * height});
  const double left = std::floor(around.left), top = std::floor(around.top);
  for (auto& ring : outline.rings) {
    for (Point& corner : ring) corner = {corner.x - left, corner.y - top};
  }
  const auto side = [](double from, double to) {
    return static_cast<int>(std::max(std::ceil(to - from), 0.0));
  };
  return count(mask_of(outline, {side(top, around.bottom), side(left, around.right)}));
}

/// Adds a share outside the image to one that was there before.
float truncated(float before, double outside) {
  const double inside = before > 0 ? 1.0 - before : 1.0;
  return static_cast<float>(1 - inside * (1 - outside));
}

/// KITTI tracking has levels: 1 is cut, however far.
float truncated_level(float before, double outside) {
  return outside > 0 ? std::max(before, 1.0f) : before;
}

/// The still's, raised where others cover the object; so what is not known stays so where none
/// does.
int occluded(int before, double hidden) {
  constexpr double kHardly = 0.05, kHalf = 0.5;
  constexpr int kUnknown = 3;
  if (hidden <= kHardly) return before;
  return std::max(before == kUnknown ? 0 : before, hidden <= kHalf ? 1 : 2);
}

void forget_space(Box& box) {
  const Box unknown;
  box.alpha = unknown.alpha;
  box.box3d = unknown.box3d;
}

/// A still, and what of it moves on its own.
struct Still {
  Annotation annotation;   ///< the labels' own
  std::vector<Box> boxes;  ///< its, with outlines of the objects that were cut out, too
  ImageSize size;
  OutlineCounts outlines;
  std::vector<std::size_t> carriers;  ///< of `boxes`
};

/// The labels of one frame.
class FrameLabels {
 public:
  FrameLabels(const Still& still, const Frame& frame, DatasetKind dataset)
      : dataset_(dataset),
        still_(still.annotation),
        boxes_(still.boxes),
        carriers_(still.carriers),
        image_{0, 0, double(still.size.width), double(still.size.height)},
        frame_(frame),
        owner_(frame.size().pixel_count(), kNobody) {}

  Annotation labels() {
    Annotation moved = still_;
    moved.boxes.clear();
    moved.persons.clear();
    moved.projection.reset();
    std::vector<std::optional<Box>> boxes(still_.boxes.size());
    std::vector<std::size_t> order;  // nearer ones first, since they cover the others
    for (std::size_t k = 0; k < boxes.size(); ++k) order.push_back(k);
    std::ranges::stable_sort(order, {}, [&](std::size_t k) { return still_.boxes[k].xyxy.bottom; });
    std::ranges::reverse(order);
    for (const std::size_t k : order) {
      boxes[k] = frame_.moves_alone(k) ? object(k) : part_of_image(k);
    }
    for (const Person& person : still_.persons) add_person(person, moved);
    std::set<std::int64_t> taken;
    for (const Box& box : still_.boxes) taken.insert(box.track_id);
    std::int64_t unused = 0;
    for (std::size_t k = 0; k < boxes.size(); ++k) {
      std::int64_t track = still_.boxes[k].track_id;
      if (track < 0) {  // it gets a number, the same in all frames, whether it is seen or not
        while (taken.contains(unused)) ++unused;
        track = unused++;
      }
      if (!boxes[k]) continue;
      boxes[k]->track_id = track;
      if (dataset_ == DatasetKind::kKittiObject && !boxes[k]->ignore) {
        boxes[k]->difficulty = kitti_difficulty(*boxes[k]);
      }
      moved.boxes.push_back(std::move(*boxes[k]));
    }
    return moved;
  }

 private:
  static constexpr std::size_t kNobody = SIZE_MAX;

  /// What can be seen of an object; none of one of which hardly anything can.
  std::optional<Box> object(std::size_t k) {
    Box box = still_.boxes[k];
    const AffineMap map = frame_.object_map(k, box);
    const Outline whole = frame_.outline(map, boxes_[k].outline);
    GreyImage mask = mask_of(whole, frame_.size());
    const double pixels = static_cast<double>(covered_pixels(whole, frame_.size()));
    const double inside = static_cast<double>(count(mask));
    const bool is_cut_out = box.outline.empty();
    const Rectangle uncovered = is_cut_out ? bounds(outline_of(mask)) : Rectangle();
    for (std::size_t i = 0; i < mask.pixels.size(); ++i) {
      if (mask.pixels[i] == 0) continue;
      if (owner_[i] == kNobody) {
        owner_[i] = k;
      } else if (carriers_[owner_[i]] != carriers_[k]) {  // else it is as it was in the still
        mask.pixels[i] = 0;
      }
    }
    const double seen = static_cast<double>(count(mask));
    if (seen == 0 || seen < kLeastSeen * pixels) return std::nullopt;
    const Outline visible = outline_of(mask);
    if (is_cut_out) {
      box.xyxy = box_around(bounds(visible), uncovered, k, scale_of(map));
    } else {
      box.outline = visible;
      box.xyxy = bounds(visible);
    }
    truncate(box, 1 - inside / pixels);
    box.occlusion = occluded(box.occlusion, 1 - seen / inside);
    forget_space(box);
    return box;
  }

  /// The box of what is seen of an object that was cut out of its box: of the still's box around
  /// it as much is left on each side where nothing covers it. So it is that box where nothing
  /// moves.
  Rectangle box_around(const Rectangle& seen, const Rectangle& whole, std::size_t k,
                       double scale) const {
    constexpr double kRounding_px = 1;
    const Rectangle box = cut(still_.boxes[k].xyxy, image_), inner = bounds(boxes_[k].outline);
    const auto margin = [&](double of_seen, double of_whole, double width) {
      return std::abs(of_seen - of_whole) <= kRounding_px ? std::max(width, 0.0) * scale : 0;
    };
    return cut({seen.left - margin(seen.left, whole.left, inner.left - box.left),
                seen.top - margin(seen.top, whole.top, inner.top - box.top),
                seen.right + margin(seen.right, whole.right, box.right - inner.right),
                seen.bottom + margin(seen.bottom, whole.bottom, box.bottom - inner.bottom)},
               frame_.area());
  }

  void truncate(Box& box, double outside) const {
    const bool has_levels = dataset_ == DatasetKind::kKittiTracking;
    box.truncation = (has_levels ? truncated_level : truncated)(box.truncation, outside);
  }

  std::optional<Box> part_of_image(std::size_t k) const {
    Box box = still_.boxes[k];
    const Rectangle whole = frame_.box(frame_.image_map(), box.xyxy);
    const Rectangle seen = cut(whole, frame_.area());
    const double share = area_of(whole) > 0 ? area_of(seen) / area_of(whole) : 0;
    if (share < kLeastSeen) return std::nullopt;
    box.outline = frame_.outline(frame_.image_map(), std::move(box.outline));
    box.xyxy = seen;
    if (!box.ignore) truncate(box, 1 - share);
    forget_space(box);
    return box;
  }

  void add_person(Person person, Annotation& moved) const {
    AffineMap map = frame_.image_map();
    std::size_t object = kNobody;
    for (std::size_t k = 0; k < still_.boxes.size() && person.box; ++k) {
      if (!frame_.moves_alone(k) || still_.boxes[k].xyxy != *person.box) continue;
      map = frame_.object_map(k, still_.boxes[k]);
      object = k;
      break;
    }
    bool any_inside = person.joints.empty();
    for (Joint& joint : person.joints) {
      if (joint.at == kMissingPoint) continue;
      joint.at = frame_.point(map, joint.at);
      const double x = joint.at.x + 0.5, y = joint.at.y + 0.5;
      const Rectangle area = frame_.area();
      if (x < 0 || y < 0 || x >= area.right || y >= area.bottom) continue;
      any_inside = true;
      const std::size_t owner =
          owner_[static_cast<std::size_t>(y) * frame_.size().width + static_cast<std::size_t>(x)];
      const bool is_covered =
          owner != kNobody && !goes_with(object, owner) && is_nearer(owner, person);
      if (is_covered && joint.visible == 1) joint.visible = 0;
    }
    if (!any_inside) return;
    person.center = frame_.point(map, person.center);
    if (person.scale >= 0) person.scale *= scale_of(map);
    if (person.head_box) person.head_box = frame_.box(map, *person.head_box);
    if (person.box) person.box = frame_.box(map, *person.box);
    person.joints3d_mm.clear();
    person.camera.reset();
    person.distortion.reset();
    moved.persons.push_back(std::move(person));
  }

  /// Whether they move as one, so that one hides of the other what it did in the still.
  bool goes_with(std::size_t object, std::size_t owner) const {
    return object != kNobody && carriers_[object] == carriers_[owner];
  }

  bool is_nearer(std::size_t k, const Person& person) const {
    return person.box && still_.boxes[k].xyxy.bottom > person.box->bottom;
  }

  DatasetKind dataset_;
  const Annotation& still_;
  const std::vector<Box>& boxes_;  ///< with the outlines of what was cut out: Still::boxes
  const std::vector<std::size_t>& carriers_;
  Rectangle image_;
  const Frame& frame_;
  std::vector<std::size_t> owner_;  ///< of the frame's pixels: the nearest object there
};

using SharedStill = std::shared_ptr<const Outcome<Still>>;

class StillClips final : public WrappedDataset {
 public:
  StillClips(std::unique_ptr<Dataset> dataset, const JobManifest& manifest, std::size_t source)
      : WrappedDataset(std::move(dataset)),
        spec_(manifest.sources[source]),
        seed_(manifest.seed),
        key_(source_key(manifest.sources, source)),
        base_(manifest.directory),
        range_(manifest.image.range),
        decoder_(manifest.directory, kKeptVideoFrames) {
    const int last = spec_.pairs.clip_frames.value();
    const int first = first_frame();
    for (const LabelledFrame& still : dataset_->labelled_frames()) {
      stills_[still.label_key] = &still;
      for (int i = first; i < first + last; ++i) {
        frames_.push_back({fmt::format("{}/{:04}", still.sample_id, i), still.sample_id,
                           frame_ref(still, i), fmt::format("{}#{}", still.label_key, i),
                           still.fault});
      }
    }
    std::ranges::sort(frames_, {}, &LabelledFrame::sample_id);
  }

  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }

  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    const Scene scene = scene_of(frame.label_key);
    const int i = scene.frame + steps;
    if (i < 0 || i > spec_.pairs.clip_frames.value()) return {};
    return {dataset_->paired_frame(*scene.still, 0).state, frame_ref(*scene.still, i)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    const Scene scene = scene_of(label_key);
    const SharedStill still = still_of(*scene.still);
    if (is_fault(*still)) return still->fault();
    const StillPose pose = poses(*scene.still, **still, scene.frame).back();
    const Frame frame((*still)->size, pose);
    Annotation labels = FrameLabels(**still, frame, spec_.dataset).labels();
    labels.is_repeat = scene.frame != first_frame();
    if (labels.is_repeat) {  // what the still's labels lost is told once
      labels.left_out.clear();
      labels.left_out_at.clear();
      labels.outlines_mended.clear();
      labels.tracks_left_out.clear();
    }
    return labels;
  }

  Outcome<Annotation> still_annotation(const std::string& label_key) const override {
    return dataset_->annotation(scene_of(label_key).still->label_key);
  }

  Outcome<MadePair> made_pair(const std::string& label_key) const override {
    const Scene scene = scene_of(label_key);
    const SharedStill still = still_of(*scene.still);
    if (is_fault(*still)) return still->fault();
    const int next = spec_.pairs.side == PairSide::kBefore ? scene.frame : scene.frame + 1;
    const std::vector<StillPose> all = poses(*scene.still, **still, next);
    const OutlineCounts counts = next == 1 ? (*still)->outlines : OutlineCounts();
    return MadePair{(*still)->boxes, {all.end() - 2, all.end()}, counts};
  }

  std::optional<ImageSize> made_size(const std::string& label_key) const override {
    const Outcome<ImageSize> size = size_of(*scene_of(label_key).still);
    return is_fault(size) ? ImageSize() : clip_window(*size).size;
  }

  std::string label_place(const std::string& label_key) const override {
    return dataset_->label_place(scene_of(label_key).still->label_key);
  }

 private:
  /// The labelled one.
  int first_frame() const { return spec_.pairs.side == PairSide::kBefore ? 1 : 0; }

  struct Scene {
    const LabelledFrame* still;
    int frame;
  };

  Scene scene_of(const std::string& label_key) const {
    const std::size_t end = label_key.rfind('#');
    const auto still =
        end == std::string::npos ? stills_.end() : stills_.find(label_key.substr(0, end));
    int frame = -1;
    if (still != stills_.end()) {
      std::from_chars(label_key.data() + end + 1, label_key.data() + label_key.size(), frame);
    }
    if (frame < 0 || frame > spec_.pairs.clip_frames.value()) {
      throw std::runtime_error("expected the key of a clip's frame, got " + label_key);
    }
    return {still->second, frame};
  }

  FrameRef frame_ref(const LabelledFrame& still, int i) const {
    return {still.frame.path, i, still.frame.video_frame,
            i / spec_.frames_per_second.value_or(kUsualRate_hz)};
  }

  Outcome<ImageSize> size_of(const LabelledFrame& still) const {
    ImageSizes& sizes = dataset_->image_sizes() ? *dataset_->image_sizes() : sizes_;
    return sizes.of(base_ / still.frame.path, orientation_of(spec_.dataset));
  }

  SharedStill still_of(const LabelledFrame& frame) const {
    return shared_.get(frame.label_key, [&] {
      try {
        return std::make_shared<const Outcome<Still>>(read_still(frame));
      } catch (const std::runtime_error& error) {
        return std::make_shared<const Outcome<Still>>(
            SampleFault{fmt::format("{}, in {}", error.what(), frame.frame.path)});
      }
    });
  }

  Outcome<Still> read_still(const LabelledFrame& frame) const {
    Outcome<Annotation> annotation = dataset_->annotation(frame.label_key);
    if (is_fault(annotation)) return annotation.fault();
    const Outcome<ImageSize> size = size_of(frame);
    if (is_fault(size)) return size.fault();
    Still still{std::move(*annotation), {}, *size, {}, {}};
    still.boxes = still.annotation.boxes;
    if (!spec_.pairs.stills.value().objects) return still;
    const auto has_no_outline = [](const Box& box) { return !box.ignore && box.outline.empty(); };
    ColourFrame image;  // needed for nothing else
    if (std::ranges::any_of(still.boxes, has_no_outline)) {
      Outcome<ColourFrame> decoded =
          decoder_.decode(frame.frame, spec_.every, orientation_of(spec_.dataset), range_);
      if (is_fault(decoded)) return decoded.fault();
      image = std::move(*decoded);
    }
    still.outlines = cut_out_missing({image.size, image.bgr.data()}, still.boxes);
    still.carriers = carriers(still.boxes);
    return still;
  }

  std::vector<StillPose> poses(const LabelledFrame& frame, const Still& still, int last) const {
    const PairKey key{seed_, to_string(spec_.dataset), frame.sample_id, key_};
    return clip_poses(spec_.pairs.stills.value(), key.pair(), still.boxes, still.carriers,
                      still.size, last);
  }

  SourceSpec spec_;
  std::uint64_t seed_;
  std::string key_;
  std::filesystem::path base_;
  std::optional<ValueRange> range_;
  std::vector<LabelledFrame> frames_;
  std::unordered_map<std::string, const LabelledFrame*> stills_;  ///< by their labels' keys
  FrameDecoder decoder_;
  mutable ImageSizes sizes_;
  mutable RecentlyUsed<std::string, SharedStill> shared_{kKeptStills};
};

}  // namespace

void make_clips(const JobManifest& manifest, std::vector<std::unique_ptr<Dataset>>& datasets) {
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    if (!datasets[i] || !manifest.sources[i].pairs.clip_frames) continue;
    datasets[i] = std::make_unique<StillClips>(std::move(datasets[i]), manifest, i);
  }
}

}  // namespace eventgan
