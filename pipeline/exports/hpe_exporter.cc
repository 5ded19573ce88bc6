#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/documents/json_text.h"
#include "pipeline/exports/detail/recordings.h"
#include "stages/base/images/image_file.h"
#include "stages/events/representation.h"

namespace eventgan {
namespace {

constexpr int kKernel = 8, kBlur = 7;  // px, of hpe-core's datasets/*/export_eros.py

/// hpe-core's 13 joints, in the order of its MoveNet: what our sources call each, the best first.
constexpr std::array<std::array<std::string_view, 4>, 13> kJoints{{
    {"head", "head_top", "nose"},
    {"left_shoulder", "l_shoulder", "shoulderL"},
    {"right_shoulder", "r_shoulder", "shoulderR"},
    {"left_elbow", "l_elbow", "elbowL"},
    {"right_elbow", "r_elbow", "elbowR"},
    {"left_wrist", "l_wrist", "handL"},
    {"right_wrist", "r_wrist", "handR"},
    {"left_hip", "l_hip", "hipL"},
    {"right_hip", "r_hip", "hipR"},
    {"left_knee", "l_knee", "kneeL"},
    {"right_knee", "r_knee", "kneeR"},
    {"left_ankle", "l_ankle", "footL", "left_foot"},
    {"right_ankle", "r_ankle", "footR", "right_foot"},
}};

/// A person's 13 joints in shares of the image; not visible (0) where not annotated or outside.
struct Skeleton {
  std::array<std::array<double, 2>, kJoints.size()> at{};
  std::array<int, kJoints.size()> visible{};
  std::array<double, 2> center{};  ///< mean of the joints
  int count = 0;
};

Skeleton skeleton_of(const std::vector<ExportedJoint>& joints,
                     const std::vector<std::string>& names, ImageSize size) {
  Skeleton skeleton;
  for (std::size_t i = 0; i < kJoints.size(); ++i) {
    for (const std::string_view known : kJoints[i]) {
      const auto name = std::ranges::find(names, known);
      if (name == names.end()) continue;
      const ExportedJoint& joint = joints.at(static_cast<std::size_t>(name - names.begin()));
      if (!is_within(joint, size)) continue;
      skeleton.at[i] = {joint.at.x / size.width, joint.at.y / size.height};
      skeleton.visible[i] = joint.visible == 0 ? 1 : 2;
      ++skeleton.count;
      break;
    }
  }
  for (std::size_t axis = 0; axis < 2 && skeleton.count > 0; ++axis) {
    for (const auto& at : skeleton.at) skeleton.center[axis] += at[axis];
    skeleton.center[axis] /= skeleton.count;
  }
  return skeleton;
}

/// hpe/SPLIT/eros/NAME.png and hpe/SPLIT/poses.json for github.com/event-driven-robotics/hpe-core:
/// the surface of a recording's events up to each sample's label, blurred as its datasets' own, and
/// an entry for each person. Only samples with a joint.
class HpeExporter : public RecordingsExporter {
 public:
  using RecordingsExporter::RecordingsExporter;

  void finish(const ExportWork& work,
              const std::vector<const ExportShard*>& shards) const override {
    RecordingsExporter::finish(work, shards);
    for (const std::string& split : work.input.splits()) {
      const std::vector<const ExportShard*> of_it = of_split(work.input, shards, split);
      ExportFolder::Step step(work.folder, "poses-" + split, input_hash(of_it));
      if (step.is_done()) continue;
      nlohmann::ordered_json poses = nlohmann::ordered_json::array();
      work.walk(of_it, [&](const OutgoingSample& sample) {
        for (nlohmann::ordered_json& entry : entries(sample)) poses.push_back(std::move(entry));
      });
      if (!poses.empty()) step.write("hpe/" + split + "/poses.json", dump_json(poses) + "\n");
      step.finish();
    }
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    if (skeletons(sample).empty()) ++left_out["samples without one of hpe-core's 13 joints"];
  }

 private:
  /// Of the persons who have a joint.
  static std::vector<Skeleton> skeletons(const OutgoingSample& sample) {
    const JointChoice choice = choose_joints(sample.reader.header().label_schema);
    std::vector<Skeleton> skeletons;
    for (std::size_t i = 0; i < sample.labels.labels.persons.size(); ++i) {
      const Skeleton skeleton = skeleton_of(exported_joints(sample.labels, i, choice), choice.names,
                                            sample.reader.header().volume.size);
      if (skeleton.count > 0) skeletons.push_back(skeleton);
    }
    return skeletons;
  }

  static std::vector<nlohmann::ordered_json> entries(const OutgoingSample& sample) {
    const std::vector<Skeleton> persons = skeletons(sample);
    std::vector<nlohmann::ordered_json> entries;
    for (const Skeleton& person : persons) {
      std::vector<double> keypoints;
      std::vector<std::array<double, 2>> centers;
      std::vector<std::vector<std::array<double, 2>>> others(kJoints.size());
      for (std::size_t i = 0; i < kJoints.size(); ++i) {
        keypoints.insert(keypoints.end(), {person.at[i][0], person.at[i][1],
                                           static_cast<double>(person.visible[i])});
        for (const Skeleton& other : persons) {
          if (&other != &person && other.visible[i] != 0) others[i].push_back(other.at[i]);
        }
      }
      for (const Skeleton& other : persons) {
        if (&other != &person) centers.push_back(other.center);
      }
      entries.push_back({{"img_name", sample.name + ".png"},
                         {"keypoints", keypoints},
                         {"center", person.center},
                         {"other_centers", centers},
                         {"other_keypoints", others},
                         {"original_sample", sample.labels.sequence}});
    }
    return entries;
  }

  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    if (!skeletons(sample).empty()) recorded.name = sample.name;
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string folder = "hpe/" + recording.source->split + "/eros/";
    const ImageSize size = recording.shape.size;
    ErosSurface surface(size, kKernel);
    cv::Mat image(size.height, size.width, CV_8UC1), blurred;
    std::vector<std::uint8_t> bgr(3 * size.pixel_count());
    std::vector<Event> events;
    for_each([&](const SampleWindow& window, const RecordedSample& sample) {
      auto next = sample.events.begin();
      const auto add_until = [&](std::int64_t end_us) {
        events.clear();
        for (; next != sample.events.end() && next->t_us <= end_us; ++next) {
          events.push_back({next->x, next->y, 0, next->positive});
        }
        surface.add(events);
      };
      add_until(window.label_us);
      if (!sample.name.empty()) {
        surface.write({image.data, image.total()});
        cv::GaussianBlur(image, blurred, {kBlur, kBlur}, 0);
        for (std::size_t i = 0; i < bgr.size(); ++i) bgr[i] = blurred.data[i / 3];
        step.write(folder + sample.name + ".png", encode_png({size, bgr.data()}));
      }
      add_until(window.end_us);
    });
  }
};

}  // namespace

ExportFormat hpe_format() {
  return {.word = "hpe",
          .title = "EROS images of events with 13 joints, for hpe-core's MoveNet",
          .need = LabelNeed::kJoints,
          .options = {"--counts", "--frames-per-second", "--seed"},
          .files = {{"hpe/SPLIT/eros/NAME.png", "the EROS image of the events"},
                    {"hpe/SPLIT/poses.json",
                     "an entry for each person of an image",
                     {{"", "img_name:Text keypoints:Float* center:Float*"}}}},
          .make = make_exporter<HpeExporter>};
}

}  // namespace eventgan
