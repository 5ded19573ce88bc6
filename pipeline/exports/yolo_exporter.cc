#include <fmt/core.h>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/exporter.h"
#include "stages/exports/detection_labels.h"

namespace eventgan {
namespace {

/// images/SPLIT/NAME.{png,npy}, labels/SPLIT/NAME.txt, SPLIT.txt, data.yaml.
class YoloExporter : public Exporter {
 public:
  YoloExporter(const ExportInput& input, const ExportOptions& options)
      : numbers_(input, options, 0),
        keep_ignored_(options.keep_ignored.value_or(false)),
        full_scale_(options.full_scale) {
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
  }

  std::string settings() const override {
    return fmt::format("classes {}\nignored {}\nfull scale {}\n", numbers_.text(),
                       keep_ignored_ ? "keep" : "drop", full_scale_);
  }

  bool takes(const ExportSource& source) const override { return source.has_boxes(); }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      write_image_pair(sample, "images/" + sample.source.split, full_scale_, step);
      step.write("labels/" + sample.source.split + "/" + sample.name + ".txt", labels_of(sample));
    });
  }

  void finish(const ExportWork& work,
              const std::vector<const ExportShard*>& shards) const override {
    ExportFolder::Step step(work.folder, "data.yaml", input_hash(shards));
    if (step.is_done()) return;
    std::vector<std::string> splits;
    int channels = 0;
    for (const std::string& split : work.input.splits()) {
      const auto of_it = of_split(work.input, shards, split);
      if (of_it.empty()) continue;
      splits.push_back(split);
      std::string list;
      work.walk(of_it, [&](const OutgoingSample& sample) {
        list += "./images/" + split + "/" + sample.name + ".png\n";
        channels = sample.reader.header().volume.channels();
      });
      step.write(split + ".txt", list);
    }
    step.write("data.yaml", yolo_data_yaml(names_, channels, splits));
    step.finish();
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    account_full_scale(sample, full_scale_, left_out);
    for_each_box(
        sample, numbers_, keep_ignored_, [](const auto&, const auto&) {},
        [&](const std::string& why) { ++left_out[why]; });
  }

 private:
  std::string labels_of(const OutgoingSample& sample) const {
    std::string text;
    const ImageSize size = sample.reader.header().volume.size;
    const auto take = [&](const ClassNumbers::Entry& entry, const VolumeBox& box) {
      const int number = box.ignore ? static_cast<int>(names_.size()) - 1 : entry.number;
      text += yolo_line(number, box.clipped, size) + "\n";
    };
    for_each_box(sample, numbers_, keep_ignored_, take, [](const std::string&) {});
    return text;
  }

  ClassNumbers numbers_;
  bool keep_ignored_;
  double full_scale_;
  std::vector<std::string> names_;
};

}  // namespace

std::unique_ptr<Exporter> yolo_exporter(const ExportInput& input, const ExportOptions& options) {
  return std::make_unique<YoloExporter>(input, options);
}

}  // namespace eventgan
