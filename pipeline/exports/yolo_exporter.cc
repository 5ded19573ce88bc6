#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/exporter.h"
#include "stages/exports/detection_labels.h"

namespace eventgan {
namespace {

/// What a line of a label file is: detection and segmentation do not go into one dataset.
enum class Lines { kBoxes, kOutlines };

/// images/SPLIT/NAME.{png,npy}, labels/SPLIT/NAME.txt, SPLIT.txt, data.yaml; beside boxes the same
/// of persons below pose.
template <Lines lines>
class YoloExporter : public Exporter {
 public:
  YoloExporter(const ExportInput& input, const ExportOptions& options)
      : numbers_(input, options, 0),
        keep_ignored_(options.keep_ignored.value_or(false)),
        full_scale_(options.full_scale),
        as_images_(options.as_images) {
    if (const auto entry = numbers_.of(kDontCare); entry.fate == ClassNumbers::Fate::kKept) {
      throw UsageError(fmt::format(
          "--classes: expected no number for {}, whose boxes are all to be ignored, got {} (leave "
          "it out of the file: --ignored keep makes it a class of its own)",
          kDontCare, entry.number));
    }
    int next = 0;
    for (const auto& [number, name] : numbers_.names()) {
      if (number != next++) {
        throw UsageError(fmt::format("--classes: expected the numbers 0 to {} for YOLO, got no {}",
                                     numbers_.names().rbegin()->first, next - 1));
      }
      names_.push_back(name);
    }
    if (keep_ignored_) names_.push_back("ignored");
    for (const ExportShard& shard : input.shards()) {
      const ExportSource& source = input.source_of(shard);
      if (source.has_boxes()) splits_[""].insert(source.split);
      if (has_poses(source)) splits_[pose_folder(input, source)].insert(source.split);
    }
    for (const ExportSource& source : input.sources()) {
      if (!has_poses(source)) continue;
      pose_text_ +=
          fmt::format("{} {}\n", pose_folder(input, source), fmt::join(source.joint_names, ","));
    }
  }

  void check(const ExportInput& input, const std::function<void()>& check_stop) const override {
    if (lines == Lines::kBoxes) return;
    for (const ExportShard& shard : input.shards()) {
      check_stop();
      if (!input.open(shard).tables().boxes.outline.empty()) return;
    }
    throw UsageError(
        "expected boxes with outlines for --to yolo-seg, got none (--to yolo has boxes)");
  }

  std::string settings() const override {
    return fmt::format("classes {}\nignored {}\nfull scale {}\n{}{}", numbers_.text(),
                       keep_ignored_ ? "keep" : "drop", full_scale_,
                       as_images_ ? "images png\n" : "", pose_text_);
  }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    const ExportSource& source = work.input.source_of(shard);
    const std::string pose = pose_folder(work.input, source);
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      const std::string below = source.split + "/" + sample.name + ".txt";
      if (source.has_boxes()) {
        write_image(sample, "images/" + source.split, step);
        step.write("labels/" + below, labels_of(sample));
      }
      if (has_poses(source)) {
        write_image(sample, pose + "images/" + source.split, step);
        step.write(pose + "labels/" + below, poses_of(sample));
      }
    });
  }

  void finish(const ExportWork& work,
              const std::vector<const ExportShard*>& shards) const override {
    // By the folder of a data.yaml, those with boxes at the top.
    std::map<std::string, std::vector<const ExportShard*>> of_folder;
    for (const ExportShard* shard : shards) {
      const ExportSource& source = work.input.source_of(*shard);
      if (source.has_boxes()) of_folder[""].push_back(shard);
      if (has_poses(source)) of_folder[pose_folder(work.input, source)].push_back(shard);
    }
    for (const auto& [folder, of_it] : of_folder) write_lists(work, folder, of_it);
  }

  std::optional<FullScale> full_scale() const override {
    return FullScale{full_scale_, /*is_of_sums=*/as_images_};
  }

  /// Ultralytics' trainer stops where one is missing.
  std::vector<std::string> notes() const override {
    std::vector<std::string> notes;
    for (const auto& [folder, splits] : splits_) {
      if (!splits.contains("train")) {
        notes.push_back(folder + "data.yaml has no split train, which Ultralytics needs");
      } else if (!splits.contains("val")) {
        notes.push_back(folder +
                        "data.yaml has val: train.txt, since there is no split val: scores are of "
                        "what is trained on");
      }
    }
    return notes;
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    const ShardHeader& header = sample.reader.header();
    const auto take = [&](const auto&, const VolumeBox& box) {
      if (lines == Lines::kBoxes) return;
      if (box.outline.empty()) {
        ++left_out["outlines of boxes that have none (the box in place of it)"];
      } else if (shown_outline(sample.labels, box, header.volume.size).empty()) {
        ++left_out["boxes of whose outline nothing is left in the volume"];
      }
    };
    for_each_box(sample, numbers_, keep_ignored_, take,
                 [&](const std::string& why) { ++left_out[why]; });
    if (!has_poses(sample.source)) return;
    const JointChoice choice = choose_joints(header.label_schema);
    account_persons(sample.labels, choice, header.volume.size, left_out);
  }

 private:
  static bool has_poses(const ExportSource& source) {
    return lines == Lines::kBoxes && source.has_joints();
  }

  void write_image(const OutgoingSample& sample, const std::string& folder,
                   ExportFolder::Step& step) const {
    if (as_images_) {
      write_polarity_image(sample, folder, full_scale_, step);
    } else {
      write_image_pair(sample, folder, full_scale_, step);
    }
  }

  std::string labels_of(const OutgoingSample& sample) const {
    std::string text;
    const ImageSize size = sample.reader.header().volume.size;
    const auto take = [&](const ClassNumbers::Entry& entry, const VolumeBox& box) {
      const int number = box.ignore ? static_cast<int>(names_.size()) - 1 : entry.number;
      if (lines == Lines::kBoxes) {
        text += yolo_line(number, box.clipped, size) + "\n";
        return;
      }
      const auto& [left, top, right, bottom] = box.clipped;
      const Outline outline =
          box.outline.empty()
              ? Outline{{{{left, top}, {right, top}, {right, bottom}, {left, bottom}}}}
              : shown_outline(sample.labels, box, size);
      if (!outline.empty()) text += yolo_outline_line(number, outline, size) + "\n";
    };
    for_each_box(sample, numbers_, keep_ignored_, take, [](const std::string&) {});
    return text;
  }

  /// Persons are a dataset by themselves, for each list of joints: all lines of one have the same
  /// length. "pose/", "pose-2/" ..., in the order of the sources.
  static std::string pose_folder(const ExportInput& input, const ExportSource& source) {
    std::vector<const std::vector<std::string>*> lists;
    for (const ExportSource& known : input.sources()) {
      const auto is_same = [&](const auto* list) { return *list == known.joint_names; };
      if (known.has_joints() && std::ranges::none_of(lists, is_same)) {
        lists.push_back(&known.joint_names);
      }
      if (known.joint_names == source.joint_names) break;
    }
    return lists.size() > 1 ? fmt::format("pose-{}/", lists.size()) : "pose/";
  }

  std::string poses_of(const OutgoingSample& sample) const {
    const ShardHeader& header = sample.reader.header();
    const JointChoice choice = choose_joints(header.label_schema);
    std::string text;
    for (std::size_t i = 0; i < sample.labels.labels.persons.size(); ++i) {
      const auto box = person_box(sample.labels, i, choice, header.volume.size);
      if (!box) continue;
      text +=
          yolo_pose_line(0, *box, exported_joints(sample.labels, i, choice), header.volume.size) +
          "\n";
    }
    return text;
  }

  /// SPLIT.txt of each split, and data.yaml.
  void write_lists(const ExportWork& work, const std::string& folder,
                   const std::vector<const ExportShard*>& shards) const {
    const std::string name = folder.empty() ? "data.yaml" : folder.substr(0, folder.size() - 1);
    ExportFolder::Step step(work.folder, name, input_hash(shards));
    if (step.is_done()) return;
    std::vector<std::string> splits;
    int channels = 0;
    std::vector<std::string> joint_names;
    for (const std::string& split : work.input.splits()) {
      const auto of_it = of_split(work.input, shards, split);
      if (of_it.empty()) continue;
      splits.push_back(split);
      std::string list;
      work.walk(of_it, [&](const OutgoingSample& sample) {
        list += "./images/" + split + "/" + sample.name + ".png\n";
        const ShardHeader& header = sample.reader.header();
        channels = as_images_ ? 3 : header.volume.channels();
        if (!folder.empty()) joint_names = choose_joints(header.label_schema).names;
      });
      step.write(folder + split + ".txt", list);
    }
    step.write(folder + "data.yaml", folder.empty()
                                         ? yolo_data_yaml(names_, channels, splits)
                                         : yolo_pose_yaml(joint_names, channels, splits));
    step.finish();
  }

  ClassNumbers numbers_;
  bool keep_ignored_;
  double full_scale_;
  bool as_images_;
  std::string pose_text_;  ///< which joints are in which of the folders of persons
  std::vector<std::string> names_;
  std::map<std::string, std::set<std::string>> splits_;  ///< by the folder of a data.yaml
};

}  // namespace

namespace {

constexpr char kImage[] =
    "the image of the events: of average times, or with --images png the volume";
constexpr char kVolume[] = "the volume, [H, W, channels] uint8";
constexpr char kList[] = "the images of the split";
constexpr char kData[] = "lists of images, channels and names for Ultralytics";
constexpr char kBox[] = "class:Integer x_center:Float y_center:Float width:Float height:Float";

}  // namespace

ExportFormat yolo_format() {
  return {
      .word = "yolo",
      .title = "YOLO's text files for boxes and poses, images, volumes as .npy",
      .need = LabelNeed::kBoxesOrJoints,
      .options = {"--classes", "--ignored", "--full-scale", "--images"},
      .files = {{"images/SPLIT/NAME.png", kImage},
                {"images/SPLIT/NAME.npy", kVolume},
                {"labels/SPLIT/NAME.txt", "a box a line, in shares of the volume", {{"", kBox}}},
                {"SPLIT.txt", kList, {{"", "image:Text"}}},
                {"data.yaml", kData},
                {"pose[-N]/images/SPLIT/NAME.png", kImage},
                {"pose[-N]/images/SPLIT/NAME.npy", kVolume},
                {"pose[-N]/labels/SPLIT/NAME.txt",
                 "a person a line: box and joints, in shares of the volume",
                 {{"",
                   "class:Integer x_center:Float y_center:Float width:Float height:Float "
                   "joints:Text"}}},
                {"pose[-N]/SPLIT.txt", kList, {{"", "image:Text"}}},
                {"pose[-N]/data.yaml", kData}},
      .make = make_exporter<YoloExporter<Lines::kBoxes>>};
}

ExportFormat yolo_seg_format() {
  return {.word = "yolo-seg",
          .title = "YOLO's text files for segmentation, images, volumes as .npy",
          .need = LabelNeed::kBoxes,
          .tasks = {"image-segmentation"},
          .options = {"--classes", "--ignored", "--full-scale", "--images"},
          .files = {{"images/SPLIT/NAME.png", kImage},
                    {"images/SPLIT/NAME.npy", kVolume},
                    {"labels/SPLIT/NAME.txt",
                     "an outline a line, in shares of the volume",
                     {{"", "class:Integer outline:Text"}}},
                    {"SPLIT.txt", kList, {{"", "image:Text"}}},
                    {"data.yaml", kData}},
          .make = make_exporter<YoloExporter<Lines::kOutlines>>};
}

}  // namespace eventgan
