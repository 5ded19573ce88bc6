#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "pipeline/exports/detail/exporter.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/files/atomic_file.h"
#include "stages/base/files/sha256.h"
#include "stages/events/images/skeleton.h"
#include "stages/exports/detection_labels.h"
#include "stages/exports/pose_list.h"
#include "stages/labels/label_mapping.h"
#include "stages/shards/codec/quantization.h"

namespace eventgan {
namespace {

/// One of COCO's files, written as its parts come: a list's entries, a line each.
class CocoFile {
 public:
  explicit CocoFile(const std::filesystem::path& path) : file_(path) { file_.create(); }

  void begin_list(const char* name) {
    text_ += (text_.empty() && is_first_list_ ? "{\"" : "],\n\"") + std::string(name) + "\": [";
    is_first_list_ = false;
    before_ = "\n";
  }

  void add(const std::string& entry) {
    text_ += before_ + entry;
    before_ = ",\n";
    constexpr std::size_t kPiece = 1 << 16;
    if (text_.size() < kPiece) return;
    file_.write(text_);
    text_.clear();
  }

  void publish() {
    file_.write(text_ + "]}\n");
    file_.publish();
  }

 private:
  AtomicFile file_;
  std::string text_;
  std::string before_;
  bool is_first_list_ = true;
};

/// The person's box: as annotated, else around its chosen joints and its head; cut to the volume.
std::optional<Rectangle> box_of(const VolumePerson& person, const JointChoice& choice,
                                ImageSize volume) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Rectangle box{kFar, kFar, -kFar, -kFar};
  const auto include = [&](const Rectangle& part) {
    box = {std::min(box.left, part.left), std::min(box.top, part.top),
           std::max(box.right, part.right), std::max(box.bottom, part.bottom)};
  };
  if (person.box) {
    box = *person.box;
  } else {
    constexpr double kHalf = 0.5;  // a joint is a pixel's centre, a box has edges
    for (const std::size_t i : choice.indices) {
      const Point joint = person.joints.at(i);
      if (joint != kMissingPoint) {
        include({joint.x + kHalf, joint.y + kHalf, joint.x + kHalf, joint.y + kHalf});
      }
    }
    if (person.head_box) include(*person.head_box);
  }
  if (box.left > box.right) return std::nullopt;
  const Rectangle cut = clip(box, volume);
  return is_empty(cut) ? std::nullopt : std::optional(cut);
}

/// instances_SPLIT.json, person_keypoints_SPLIT.json, volumes/SPLIT/NAME.npy.
class CocoExporter : public Exporter {
 public:
  CocoExporter(const ExportInput& input, const ExportOptions& options)
      : numbers_(input, options, 1), keep_ignored_(options.keep_ignored.value_or(true)) {}

  std::string settings() const override {
    return fmt::format("classes {}\nignored {}\n", numbers_.text(),
                       keep_ignored_ ? "keep" : "drop");
  }

  bool takes(const ExportSource& source) const override {
    return source.has_boxes() || source.has_joints();
  }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      const VolumeShape& shape = reader.header().volume;
      const std::vector<float> volume = reader.volume(sample.slot);
      std::vector<std::uint16_t> halves(volume.size());
      to_halves(volume, halves.data());
      const std::vector<std::size_t> sides{static_cast<std::size_t>(shape.channels()),
                                           static_cast<std::size_t>(shape.size.height),
                                           static_cast<std::size_t>(shape.size.width)};
      step.write(volume_name(sample), npy_file("<f2", sides, halves));
    });
  }

  void finish(const ExportWork& work,
              const std::vector<const ExportShard*>& shards) const override {
    for (const std::string& split : work.input.splits()) {
      const auto of_it = of_split(work.input, shards, split);
      for (const bool persons : {false, true}) {
        const bool has_any = std::ranges::any_of(
            of_it, [&](const ExportShard* shard) { return is_for(*shard, work, persons); });
        if (has_any) write_file(work, of_it, split, persons);
      }
    }
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    for_each_box(
        sample, numbers_, keep_ignored_, [](const auto&, const auto&) {},
        [&](const std::string& why) { ++left_out[why]; });
    const ShardHeader& header = sample.reader.header();
    const JointChoice choice = choose_joints(header.label_schema);
    for (const VolumePerson& person : sample.labels.labels.persons) {
      if (!box_of(person, choice, header.volume.size)) {
        ++left_out["persons of whom nothing is left in the volume"];
      }
    }
  }

 private:
  static std::string volume_name(const OutgoingSample& sample) {
    return "volumes/" + sample.source.split + "/" + sample.name + ".npy";
  }

  static bool is_for(const ExportShard& shard, const ExportWork& work, bool persons) {
    const ExportSource& source = work.input.source_of(shard);
    return persons ? source.has_joints() : source.has_boxes();
  }

  void add_boxes(const OutgoingSample& sample, std::int64_t image_id, std::int64_t& id,
                 CocoFile& file) const {
    const auto take = [&](const ClassNumbers::Entry& entry, const VolumeBox& box) {
      const auto add = [&](int category) {
        file.add(coco_box({++id, image_id, category}, box.clipped, box.ignore));
      };
      if (entry.fate == ClassNumbers::Fate::kKept) {
        add(entry.number);
      } else {  // to be ignored and of no class, and COCO ignores by class
        for (const auto& [number, _] : numbers_.names()) add(number);
      }
    };
    for_each_box(sample, numbers_, keep_ignored_, take, [](const std::string&) {});
  }

  /// The joints' names of each category of persons.
  using Skeletons = std::vector<std::vector<std::string>>;

  /// Of all splits, so that a category is the same in all of their files.
  static Skeletons skeletons_of(const ExportInput& input) {
    Skeletons skeletons;
    for (const LabelSchema& schema : input.joint_schemas()) {
      std::vector<std::string> names = choose_joints(schema).names;
      if (std::ranges::find(skeletons, names) == skeletons.end()) {
        skeletons.push_back(std::move(names));
      }
    }
    return skeletons;
  }

  void write_file(const ExportWork& work, const std::vector<const ExportShard*>& shards,
                  const std::string& split, bool persons) const {
    const std::string name = (persons ? "person_keypoints_" : "instances_") + split + ".json";
    Sha256 hash;
    hash.update(input_hash(shards));
    for (const ExportSource& source : work.input.sources()) {
      for (const std::string& joint : source.joint_names) hash.update(joint + "\n");
    }
    ExportFolder::Step step(work.folder, name, persons ? hash.hex() : input_hash(shards));
    if (step.is_done()) return;
    const Skeletons skeletons = persons ? skeletons_of(work.input) : Skeletons();
    CocoFile file(step.file(name));
    // An image's number is its place in the split, in both of the split's files.
    std::int64_t image_id = 0;
    file.begin_list("images");
    work.walk(shards, [&](const OutgoingSample& sample) {
      ++image_id;
      if (!is_for(sample.shard, work, persons)) return;
      file.add(coco_image(image_id, volume_name(sample), sample.reader.header().volume.size,
                          sample.labels.sample_id));
    });
    file.begin_list("annotations");
    image_id = 0;
    std::int64_t id = 0;
    work.walk(shards, [&](const OutgoingSample& sample) {
      ++image_id;
      if (!is_for(sample.shard, work, persons)) return;
      if (persons) {
        add_persons(sample, image_id, id, skeletons, file);
      } else {
        add_boxes(sample, image_id, id, file);
      }
    });
    file.begin_list("categories");
    if (!persons) {
      for (const auto& [number, class_name] : numbers_.names()) {
        file.add(coco_category(number, class_name));
      }
    }
    for (std::size_t i = 0; i < skeletons.size(); ++i) {
      std::vector<std::pair<int, int>> limbs;
      for (const Limb& limb : limbs_of(skeletons[i])) limbs.emplace_back(limb.from, limb.to);
      const int number = static_cast<int>(i) + 1;
      file.add(coco_person_category(number,
                                    number == 1 ? "person" : "person-" + std::to_string(number),
                                    skeletons[i], limbs));
    }
    file.publish();
    step.finish();
  }

  static void add_persons(const OutgoingSample& sample, std::int64_t image_id, std::int64_t& id,
                          const Skeletons& skeletons, CocoFile& file) {
    const ShardHeader& header = sample.reader.header();
    const JointChoice choice = choose_joints(header.label_schema);
    const auto known = std::ranges::find(skeletons, choice.names) - skeletons.begin();
    const ShardSample& labels = sample.labels;
    for (std::size_t p = 0; p < labels.labels.persons.size(); ++p) {
      const VolumePerson& person = labels.labels.persons[p];
      const auto box = box_of(person, choice, header.volume.size);
      if (!box) continue;
      std::vector<ExportedJoint> joints;
      for (const std::size_t i : choice.indices) {
        joints.push_back({person.joints.at(i), labels.annotation.persons[p].joints.at(i).visible});
      }
      file.add(coco_person({++id, image_id, static_cast<int>(known) + 1}, *box, joints));
    }
  }

  ClassNumbers numbers_;
  bool keep_ignored_;
};

}  // namespace

std::unique_ptr<Exporter> coco_exporter(const ExportInput& input, const ExportOptions& options) {
  return std::make_unique<CocoExporter>(input, options);
}

}  // namespace eventgan
