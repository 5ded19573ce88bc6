#include "pipeline/exports/export_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "manifests/documents/report.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "pipeline/exports/detail/dataset_card.h"
#include "pipeline/exports/detail/exporter.h"
#include "pipeline/runtime/threads.h"

namespace eventgan {
namespace {

std::string identity_text(const ExportInput& input, const ExportOptions& options,
                          const Exporter& exporter) {
  std::string text =
      fmt::format("eventgan export, version 1\njob {}, sources {:.16}\nto {}\nplan {}\nsplits",
                  input.name(), input.sources_hash(), options.to->word, input.plan_hash());
  for (const std::string& split : input.splits()) text += " " + split;
  return text + "\n" + exporter.settings();
}

/// export.json: what was exported, under which names, and what was not.
class Description {
 public:
  Description(const ExportWork& work, const Exporter& exporter, std::string identity)
      : work_(work), exporter_(exporter), identity_(std::move(identity)) {}

  void write(const std::vector<const ExportShard*>& shards, const std::filesystem::path& path) {
    AtomicFile file(path);
    file.create();
    file.write("{\"format\": \"eventgan-export\", \"version\": 1,\n\"settings\": " +
               dump_json(nlohmann::ordered_json(identity_)) + ",\n\"name\": " +
               dump_json(nlohmann::ordered_json(work_.input.name())) + ",\n\"missing_shards\": " +
               dump_json(nlohmann::ordered_json(work_.input.missing())) + ",\n\"samples\": [");
    std::string lines;
    const char* before = "\n";
    work_.walk(shards, [&](const OutgoingSample& sample) {
      exporter_.account(sample, left_out_);
      account_full_scale(sample);
      lines += std::exchange(before, ",\n") +
               dump_json(nlohmann::ordered_json{{"sample_id", sample.labels.sample_id},
                                                {"name", sample.name},
                                                {"split", sample.source.split},
                                                {"shard", sample.shard.outline.name},
                                                {"slot", sample.slot}});
      constexpr std::size_t kPiece = 1 << 16;
      if (lines.size() >= kPiece) file.write(std::exchange(lines, {}));
    });
    lines += "],\n\"quarantined\": [";
    before = "\n";
    for (const ExportShard* shard : shards) {
      for (const QuarantinedSample& sample : shard->quarantined) {
        lines += std::exchange(before, ",\n") +
                 dump_json(nlohmann::ordered_json{{"sample_id", sample.sample_id},
                                                  {"shard", shard->outline.name},
                                                  {"slot", sample.slot},
                                                  {"reason", sample.reason}});
      }
    }
    for (const auto& [what, count] : exporter_.whole_samples_left_out()) left_out_[what] += count;
    lines += "],\n\"left_out\": " + dump_json(nlohmann::ordered_json(left_out_)) +
             ",\n\"notes\": " + dump_json(nlohmann::ordered_json(notes())) + "}\n";
    file.write(lines);
    file.publish();
  }

  LeftOut& left_out() { return left_out_; }

  /// Those of the exporter, and what was cut; once it is written.
  std::vector<std::string> notes() const {
    std::vector<std::string> notes = exporter_.notes();
    if (cut_ > 0) {
      const FullScale full_scale = exporter_.full_scale().value();
      notes.push_back(fmt::format(
          "{} above the full scale of {} were cut to it in {}; the largest value is {:.3g} "
          "(--full-scale sets another)",
          full_scale.is_of_sums ? "sums of values" : "values", full_scale.value,
          count_text(cut_, "sample"), largest_));
    }
    return notes;
  }

 private:
  void account_full_scale(const OutgoingSample& sample) {
    const std::optional<FullScale> full_scale = exporter_.full_scale();
    if (!full_scale || !is_cut(sample, *full_scale)) return;
    ++cut_;
    largest_ = std::max(largest_, largest_value(sample));
  }

  const ExportWork& work_;
  const Exporter& exporter_;
  std::string identity_;
  LeftOut left_out_;
  std::int64_t cut_ = 0;  ///< samples that the full scale cuts
  float largest_ = 0;     ///< value of them
};

bool has_use_for(LabelNeed need, const ExportSource& source) {
  return need == LabelNeed::kNone || (source.has_boxes() && need != LabelNeed::kJoints) ||
         (source.has_joints() && need != LabelNeed::kBoxes);
}

/// What an earlier run has counted and noted. False if that is damaged.
bool read_description(const std::filesystem::path& description, ExportReport& report) {
  try {
    const auto json = nlohmann::json::parse(read_text_file(description));
    report.left_out = json.at("left_out").get<LeftOut>();
    report.notes = json.at("notes").get<std::vector<std::string>>();
    return true;
  } catch (const nlohmann::json::exception&) {
    return false;
  }
}

}  // namespace

ExportReport run_export(const std::filesystem::path& folder, const ExportOptions& options) {
  const ExportInput input(folder, options.splits);
  const std::unique_ptr<Exporter> exporter = options.to->make(input, options);
  std::vector<const ExportShard*> shards;
  LeftOut sources_left_out;
  ExportReport report{options.out.string(), 0, 0, {}, {}, input.missing()};
  for (const ExportShard& shard : input.shards()) {
    const ExportSource& source = input.source_of(shard);
    if (!has_use_for(options.to->need, source)) {
      sources_left_out[fmt::format("samples of {} in split {}: {} has no use for them",
                                   source.dataset, source.split, options.to->word)] += shard.valid;
      continue;
    }
    shards.push_back(&shard);
    report.samples += shard.valid;
    report.quarantined += static_cast<std::int64_t>(shard.quarantined.size());
  }
  if (shards.empty()) {
    throw UsageError(fmt::format("expected samples that --to {} can use, got none, in {}",
                                 options.to->word, folder.string()));
  }
  const std::string identity = identity_text(input, options, *exporter);
  const auto check_stop = [&] {
    if (options.stop && options.stop())
      throw Stopped("stopped; run the same command again to resume");
  };
  if (!ExportFolder::is_of(options.out, identity)) exporter->check(input, check_stop);
  ExportFolder out(options.out, identity, options.overwrite);
  std::unique_ptr<Progress> progress =
      options.make_progress ? options.make_progress(report.samples) : nullptr;
  const ExportWork work{input, out, thread_count(options.threads), check_stop,
                        [&](std::int64_t count) {
                          for (; progress && count > 0; --count) progress->advance(false, 0);
                        }};
  for (const ExportShard* shard : shards) {
    if (!exporter->works_by_shard()) break;
    ExportFolder::Step step(out, shard->outline.name, shard->sha256);
    if (!step.is_done()) {
      work.check_stop();
      exporter->write_shard(work, *shard, input.open(*shard), step);
      step.finish();
    }
    work.advance(shard->valid);
  }
  exporter->finish(work, shards);
  const std::vector<std::string> edited = write_dataset_card(work, *options.to, shards);

  // Of those left out too, since it counts their samples.
  std::vector<const ExportShard*> all;
  for (const ExportShard& shard : input.shards()) all.push_back(&shard);
  ExportFolder::Step step(out, kExportDescription, input_hash(all));
  out.remove_other_steps();
  if (!step.is_done() || !read_description(out.path() / kExportDescription, report)) {
    Description description(work, *exporter, identity);
    description.left_out() = sources_left_out;
    description.write(shards, step.file(kExportDescription));
    step.finish();
    report.left_out = description.left_out();
    report.notes = description.notes();
  }
  report.notes.insert(report.notes.end(), edited.begin(), edited.end());
  if (progress) progress->finish();
  return report;
}

namespace {

Report table_of(const ExportReport& report) {
  return {{"event", "report"},
          {"folder", report.folder},
          {"samples", report.samples},
          {"quarantined", report.quarantined},
          fmt::format("{}: {}, {} left out (listed in export.json)", report.folder,
                      count_text(report.samples, "sample"),
                      count_text(report.quarantined, "quarantined sample")),
          {"left_out", report.left_out,
           joined(report.left_out, "",
                  [](const auto& what) {
                    return fmt::format("left out: {}: {}\n", what.first, what.second);
                  })},
          {"notes", report.notes, listed(report.notes, "note: {}")},
          {"missing_shards", report.missing,
           "PARTIAL: without " + count_text(std::ssize(report.missing), "shard") +
               ", missing when the folder was finalized"}};
}

}  // namespace

std::string to_text(const ExportReport& report) { return text_of(table_of(report)); }
std::string to_json(const ExportReport& report) { return json_text_of(table_of(report)); }

}  // namespace eventgan
