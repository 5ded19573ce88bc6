#include <fmt/core.h>

#include "pipeline/exports/detail/exporter.h"
#include "stages/exports/pose_list.h"

namespace eventgan {
namespace {

/// annot/SET.json, annot/gt_SET.mat, images/SPLIT/NAME.{png,npy}.
class MpiiExporter : public Exporter {
 public:
  MpiiExporter(const ExportInput&, const ExportOptions& options)
      : full_scale_(options.full_scale) {}

  std::string settings() const override { return fmt::format("full scale {}\n", full_scale_); }

  void check(const ExportInput& input, const std::function<void()>& check_stop) const override {
    require_listed_person(input, "mpii", check_stop);
  }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      write_image_pair(sample, "images/" + sample.source.split, full_scale_, step);
    });
  }

  void finish(const ExportWork& work, const std::vector<const ExportShard*>&) const override {
    for (const ExportSet& set : work.input.sets(/*joints_only=*/true, /*by_size=*/false)) {
      write_list(work, set);
    }
  }

  std::optional<FullScale> full_scale() const override { return FullScale{full_scale_}; }

  std::vector<std::string> notes() const override {
    return {"MMPose's MpiiDataset reads numbers as the images' names alone: for MMPose --to coco"};
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    const JointChoice choice = choose_joints(sample.reader.header().label_schema);
    PckhTruth truth(choice.names);
    for (const VolumePerson& person : sample.labels.labels.persons) {
      if (const std::string why = why_not_listed(person, choice); !why.empty()) {
        ++left_out["persons: " + why];
      } else if (!truth.add(listed_person(person, choice))) {
        ++left_out["persons without a head's size, in gt_*.mat with all joints missing"];
      }
    }
  }

 private:
  static void write_list(const ExportWork& work, const ExportSet& set) {
    ExportFolder::Step step(work.folder, "annot-" + set.name, input_hash(set.shards));
    if (step.is_done()) return;
    const JointChoice choice = choose_joints(work.input.open(*set.shards[0]).header().label_schema);
    PckhTruth truth(choice.names);
    std::string list = "[";
    const char* before = "\n";
    work.walk(set.shards, [&](const OutgoingSample& sample) {
      for (const VolumePerson& person : sample.labels.labels.persons) {
        if (!why_not_listed(person, choice).empty()) continue;
        const ListedPerson listed = listed_person(person, choice);
        truth.add(listed);
        list += before + mpii_entry(set.split + "/" + sample.name + ".png", listed);
        before = ",\n";
      }
    });
    step.write("annot/" + set.name + ".json", list + "\n]\n");
    if (!truth.is_empty()) truth.write(step.file("annot/gt_" + set.name + ".mat"));
    step.finish();
  }

  double full_scale_;
};

}  // namespace

ExportFormat mpii_format() {
  return {
      .word = "mpii",
      .title = "the annotation list for Microsoft's pose_resnet, and the ground truth for PCKh",
      .need = LabelNeed::kJoints,
      .options = {"--full-scale"},
      .files = {{"images/SPLIT/NAME.png", "the image of the events' average times"},
                {"images/SPLIT/NAME.npy", "the volume, [H, W, channels] uint8"},
                {"annot/SET.json",
                 "the persons of a set",
                 {{"", "image:Text center:Float* scale:Float joints:Float* joints_vis:Integer*"}}},
                {"annot/gt_SET.mat", "the same for PCKh"}},
      .make = make_exporter<MpiiExporter>};
}

}  // namespace eventgan
