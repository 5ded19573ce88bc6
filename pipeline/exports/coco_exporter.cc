#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "manifests/files/atomic_file.h"
#include "manifests/files/sha256.h"
#include "pipeline/exports/detail/exporter.h"
#include "stages/base/archives/numpy_arrays.h"
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

/// What COCO's labels call an image and its annotations, which are a sample's boxes in their order.
struct OriginalIds {
  std::int64_t image = 0;
  std::vector<std::int64_t> annotations, categories;
  std::vector<std::size_t> persons;  ///< which of the annotations are persons as well
};

/// None if the sample's labels are not COCO's, or some have no ids.
std::optional<OriginalIds> original_ids(const ExportSource& source, const Annotation& annotation) {
  if (!source.has_coco_labels) return std::nullopt;
  const nlohmann::json entry = nlohmann::json::parse(annotation.original, nullptr, false);
  try {
    OriginalIds ids;
    ids.image = entry.at("image").at("id").get<std::int64_t>();
    const auto box_of = [](const nlohmann::json& object) {
      const auto sides = object.at("bbox").get<std::array<double, 4>>();
      return Rectangle{sides[0], sides[1], sides[0] + sides[2], sides[1] + sides[3]};
    };
    const nlohmann::json& objects = entry.at("annotations");
    for (const nlohmann::json& object : objects) {
      const Rectangle box = box_of(object);
      const std::size_t number = ids.annotations.size();
      // One that was left out, being outside its image or of another class, has no box. Which of
      // two that are alike was left out, boxes do not say.
      if (number == annotation.boxes.size() || annotation.boxes[number].xyxy != box) {
        if (std::ranges::find(annotation.boxes, box, &Box::xyxy) != annotation.boxes.end()) {
          return std::nullopt;
        }
        continue;
      }
      ids.annotations.push_back(object.at("id").get<std::int64_t>());
      ids.categories.push_back(object.at("category_id").get<std::int64_t>());
      const nlohmann::json joints = object.value("keypoints", nlohmann::json::array());
      bool has_joints = false;
      for (std::size_t i = 2; i < joints.size(); i += 3) has_joints = has_joints || joints[i] > 0;
      const std::size_t person = ids.persons.size();
      if (has_joints && person < annotation.persons.size() &&
          annotation.persons[person].box == box) {
        ids.persons.push_back(number);
      }
    }
    if (ids.annotations.size() != annotation.boxes.size() ||
        ids.persons.size() != annotation.persons.size()) {
      return std::nullopt;
    }
    return ids;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

/// Where the ids of COCO's labels can be kept. Samples of other labels, in the same split, are
/// numbered after them.
class KeptIds {
 public:
  /// Reads the labels of all sources that have COCO's.
  explicit KeptIds(const ExportInput& input) {
    for (const ExportShard& shard : input.shards()) {
      const ExportSource& source = input.source_of(shard);
      Split& split = splits_[source.split];
      if (!source.has_coco_labels) {
        persons_agree_ = persons_agree_ && !source.has_joints();
        continue;
      }
      const ShardReader reader = input.open(shard);
      for (int slot = 0; slot < reader.header().sample_count; ++slot) {
        const ShardSample sample = reader.sample(slot);
        if (sample.valid) add(source, reader.header().label_schema, sample.annotation, split);
      }
    }
    for (auto& [name, split] : splits_) {
      const Last last{last_of(split.images), last_of(split.annotations)};
      constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max() / 2;
      split.is_kept = split.is_kept && std::max(last.image, last.annotation) <= kLargest;
      if (split.is_kept) split.last = last;
      split.images = split.annotations = {};
    }
    if (!persons_agree_) persons_.clear();
  }

  /// Whether a split's samples and annotations of COCO's labels keep their ids: all have one, each
  /// another.
  bool in(const std::string& split) const { return splits_.at(split).is_kept; }

  /// The largest ids that are kept; 0 if none is.
  struct Last {
    std::int64_t image = 0, annotation = 0;
  };
  Last last(const std::string& split) const { return splits_.at(split).last; }

  /// Categories of persons by their numbers, if the labels of all sources with joints have them.
  struct PersonCategory {
    std::string name;
    std::vector<std::string> joints;
    bool operator==(const PersonCategory&) const = default;
  };
  const std::map<std::int64_t, PersonCategory>& person_categories() const { return persons_; }

  /// The classes' numbers, of those that some annotation is of; empty if two do not agree.
  std::map<std::string, int> categories() const {
    std::set<int> numbers;
    for (const auto& [name, number] : categories_) numbers.insert(number);
    return agree_ && numbers.size() == categories_.size() ? categories_
                                                          : std::map<std::string, int>();
  }

 private:
  struct Split {
    bool is_kept = true;
    std::set<std::int64_t> images, annotations;
    Last last;
  };

  static std::int64_t last_of(const std::set<std::int64_t>& ids) {
    return ids.empty() ? 0 : std::max(*ids.rbegin(), std::int64_t{0});
  }

  void add(const ExportSource& source, const LabelSchema& schema, const Annotation& annotation,
           Split& split) {
    const auto ids = original_ids(source, annotation);
    if (!ids) {
      agree_ = persons_agree_ = split.is_kept = false;
      return;
    }
    for (const std::size_t i : ids->persons) {
      const std::int64_t category = ids->categories[i];
      const auto class_id = static_cast<std::size_t>(annotation.boxes[i].class_id);
      const PersonCategory found{source.class_names.at(class_id), choose_joints(schema).names};
      persons_agree_ = persons_agree_ && category >= 0 &&
                       category <= std::numeric_limits<int>::max() &&
                       persons_.emplace(category, found).first->second == found;
    }
    split.is_kept = split.is_kept && split.images.insert(ids->image).second;
    for (std::size_t i = 0; i < annotation.boxes.size(); ++i) {
      split.is_kept = split.is_kept && split.annotations.insert(ids->annotations[i]).second;
      const std::int64_t category = ids->categories[i];
      if (category < 0 || category > std::numeric_limits<int>::max()) {
        agree_ = false;
        continue;
      }
      const auto number = static_cast<int>(category);
      const std::string& name =
          source.class_names.at(static_cast<std::size_t>(annotation.boxes[i].class_id));
      if (name == kDontCare) split.is_kept = false;  // a box of it is one of each category
      agree_ = agree_ && categories_.emplace(name, number).first->second == number;
    }
  }

  std::map<std::string, Split> splits_;
  std::map<std::string, int> categories_;
  std::map<std::int64_t, PersonCategory> persons_;
  bool agree_ = true;
  bool persons_agree_ = true;
};

/// instances_SPLIT.json, person_keypoints_SPLIT.json, volumes/SPLIT/NAME.npy or
/// images/SPLIT/NAME.png.
class CocoExporter : public Exporter {
 public:
  CocoExporter(const ExportInput& input, const ExportOptions& options)
      : numbers_(input, options, 1),
        keep_ignored_(options.keep_ignored.value_or(true)),
        full_scale_(options.full_scale),
        as_images_(options.as_images) {
    if (!as_images_ && full_scale_ != 1) {
      throw UsageError("--full-scale: expected --images png with --to coco, got none");
    }
    if (options.classes) return;
    kept_ids_.emplace(input);
    numbers_.renumber(kept_ids_->categories(), 1);
  }

  std::string settings() const override {
    return fmt::format("classes {}\nignored {}\n{}", numbers_.text(),
                       keep_ignored_ ? "keep" : "drop",
                       as_images_ ? fmt::format("images png, full scale {}\n", full_scale_) : "");
  }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      if (as_images_) {
        write_polarity_image(sample, "images/" + sample.source.split, full_scale_, step);
        return;
      }
      const VolumeShape& shape = reader.header().volume;
      const std::vector<float> volume = reader.volume(sample.slot);
      std::vector<std::uint16_t> halves(volume.size());
      to_halves(volume, halves.data());
      const std::vector<std::size_t> sides{static_cast<std::size_t>(shape.channels()),
                                           static_cast<std::size_t>(shape.size.height),
                                           static_cast<std::size_t>(shape.size.width)};
      step.write(file_name(sample), npy_file("<f2", sides, halves));
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

  std::optional<FullScale> full_scale() const override {
    if (!as_images_) return std::nullopt;
    return FullScale{full_scale_, /*is_of_sums=*/true};
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    for_each_box(
        sample, numbers_, keep_ignored_, [](const auto&, const auto&) {},
        [&](const std::string& why) { ++left_out[why]; });
    const ShardHeader& header = sample.reader.header();
    const JointChoice choice = choose_joints(header.label_schema);
    account_persons(sample.labels, choice, header.volume.size, left_out);
  }

 private:
  std::string file_name(const OutgoingSample& sample) const {
    return (as_images_ ? "images/" : "volumes/") + sample.source.split + "/" + sample.name +
           (as_images_ ? ".png" : ".npy");
  }

  static bool is_for(const ExportShard& shard, const ExportWork& work, bool persons) {
    const ExportSource& source = work.input.source_of(shard);
    return persons ? source.has_joints() : source.has_boxes();
  }

  /// Of a sample, if its split keeps them.
  std::optional<OriginalIds> ids_of(const OutgoingSample& sample) const {
    if (!kept_ids_ || !kept_ids_->in(sample.source.split)) return std::nullopt;
    return original_ids(sample.source, sample.labels.annotation);
  }

  /// `place`: of the sample in its split.
  std::int64_t image_id(const OutgoingSample& sample, std::int64_t place) const {
    const auto ids = ids_of(sample);
    return ids ? ids->image : place;
  }

  void add_boxes(const OutgoingSample& sample, std::int64_t place, std::int64_t& id,
                 CocoFile& file) const {
    const auto ids = ids_of(sample);
    const std::int64_t image = ids ? ids->image : place;
    const ImageSize volume = sample.reader.header().volume.size;
    const auto take = [&](const ClassNumbers::Entry& entry, const VolumeBox& box) {
      const Outline outline = shown_outline(sample.labels, box, volume);
      const auto add = [&](int category) {
        const auto index = static_cast<std::size_t>(&box - sample.labels.labels.boxes.data());
        const std::int64_t own = ids ? ids->annotations[index] : ++id;
        file.add(coco_box({own, image, category}, box.clipped, box.ignore, outline, volume));
      };
      if (entry.fate == ClassNumbers::Fate::kKept) {
        add(entry.number);
      } else {  // to be ignored and of no class, and COCO ignores by class
        for (const auto& [number, _] : numbers_.names()) add(number);
      }
    };
    for_each_box(sample, numbers_, keep_ignored_, take, [](const std::string&) {});
  }

  using PersonCategories = std::map<std::int64_t, KeptIds::PersonCategory>;

  /// Of all splits, so that a category is the same in all of their files: the labels' own, else one
  /// for each list of joints.
  PersonCategories person_categories(const ExportInput& input) const {
    if (kept_ids_ && !kept_ids_->person_categories().empty()) {
      return kept_ids_->person_categories();
    }
    PersonCategories categories;
    for (const LabelSchema& schema : input.joint_schemas()) {
      std::vector<std::string> names = choose_joints(schema).names;
      const auto is_same = [&](const auto& known) { return known.second.joints == names; };
      if (std::ranges::any_of(categories, is_same)) continue;
      const auto number = static_cast<std::int64_t>(categories.size()) + 1;
      categories[number] = {number == 1 ? "person" : fmt::format("person-{}", number),
                            std::move(names)};
    }
    return categories;
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
    const PersonCategories categories =
        persons ? person_categories(work.input) : PersonCategories();
    CocoFile file(step.file(name));
    const KeptIds::Last last = kept_ids_ ? kept_ids_->last(split) : KeptIds::Last();
    // Unless it keeps its own, an image's number is its place in the split, in both of its files;
    // behind those that are kept.
    std::int64_t place = last.image;
    file.begin_list("images");
    work.walk(shards, [&](const OutgoingSample& sample) {
      ++place;
      if (!is_for(sample.shard, work, persons)) return;
      file.add(coco_image(image_id(sample, place), file_name(sample),
                          sample.reader.header().volume.size, sample.labels.sample_id));
    });
    file.begin_list("annotations");
    place = last.image;
    std::int64_t id = last.annotation;
    work.walk(shards, [&](const OutgoingSample& sample) {
      ++place;
      if (!is_for(sample.shard, work, persons)) return;
      if (persons) {
        add_persons(sample, place, id, categories, file);
      } else {
        add_boxes(sample, place, id, file);
      }
    });
    file.begin_list("categories");
    if (!persons) {
      for (const auto& [number, class_name] : numbers_.names()) {
        file.add(coco_category(number, class_name));
      }
    }
    for (const auto& [number, category] : categories) {
      std::vector<std::pair<int, int>> limbs;
      for (const Limb& limb : limbs_of(category.joints)) limbs.emplace_back(limb.from, limb.to);
      file.add(
          coco_person_category(static_cast<int>(number), category.name, category.joints, limbs));
    }
    file.publish();
    step.finish();
  }

  void add_persons(const OutgoingSample& sample, std::int64_t place, std::int64_t& id,
                   const PersonCategories& categories, CocoFile& file) const {
    const ShardSample& labels = sample.labels;
    const ShardHeader& header = sample.reader.header();
    const JointChoice choice = choose_joints(header.label_schema);
    const auto ids = ids_of(sample);
    const auto originals = original_ids(sample.source, labels.annotation);
    const bool keeps_categories = kept_ids_ && !kept_ids_->person_categories().empty();
    const auto same_joints = std::ranges::find_if(
        categories, [&](const auto& known) { return known.second.joints == choice.names; });
    for (std::size_t p = 0; p < labels.labels.persons.size(); ++p) {
      const auto box = person_box(labels, p, choice, header.volume.size);
      if (!box) continue;
      const std::int64_t own = ids ? ids->annotations[ids->persons[p]] : ++id;
      const std::int64_t category =
          keeps_categories ? originals->categories[originals->persons[p]] : same_joints->first;
      const bool is_crowd = originals && labels.annotation.boxes[originals->persons[p]].ignore;
      file.add(coco_person({own, ids ? ids->image : place, static_cast<int>(category)}, *box,
                           is_crowd, exported_joints(labels, p, choice), header.volume.size));
    }
  }

  ClassNumbers numbers_;
  std::optional<KeptIds> kept_ids_;  ///< none where the user numbers the classes
  bool keep_ignored_;
  double full_scale_;
  bool as_images_;
};

}  // namespace

ExportFormat coco_format() {
  static constexpr char kImages[] = "id:Integer file_name:Text width:Integer height:Integer";
  return {
      .word = "coco",
      .title = "COCO's JSON for boxes and for keypoints of persons, event volumes as .npy",
      .need = LabelNeed::kBoxesOrJoints,
      .options = {"--classes", "--ignored", "--full-scale", "--images"},
      .files = {{"volumes/SPLIT/NAME.npy", "the volume, [channels, H, W] float16"},
                {"images/SPLIT/NAME.png", "the volume as an image of three channels"},
                {"instances_SPLIT.json",
                 "images and their boxes, as COCO's",
                 {{"images", kImages},
                  {"annotations",
                   "id:Integer image_id:Integer category_id:Integer bbox:BoundingBox area:Float "
                   "iscrowd:Integer"}}},
                {"person_keypoints_SPLIT.json",
                 "images and the joints of their persons, as COCO's",
                 {{"images", kImages},
                  {"annotations",
                   "id:Integer image_id:Integer category_id:Integer bbox:BoundingBox area:Float "
                   "iscrowd:Integer num_keypoints:Integer keypoints:Float*"}}}},
      .make = make_exporter<CocoExporter>};
}

}  // namespace eventgan
