#include "pipeline/exports/export_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/faults.h"
#include "pipeline/exports/detail/exporter.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/files/atomic_file.h"
#include "stages/base/files/input_file.h"
#include "stages/base/files/sha256.h"
#include "stages/events/images/preview_image.h"
#include "stages/exports/export_name.h"

namespace eventgan {

void ExportWork::with_sample(const ExportShard& shard, const ShardReader& reader, int slot,
                             const std::function<void(const OutgoingSample&)>& work) const {
  check_stop();
  const ExportSource& source = input.source_of(shard);
  const ShardSample labels = reader.sample(slot);
  if (!labels.valid) return;
  work({shard, source, reader, slot, labels, source.name_prefix + export_name(labels.sample_id)});
}

void ExportWork::for_each_sample(const ExportShard& shard, const ShardReader& reader,
                                 const std::function<void(const OutgoingSample&)>& work) const {
  const auto count = static_cast<std::size_t>(reader.header().sample_count);
  for_each_index(count, threads,
                 [&](std::size_t i) { with_sample(shard, reader, static_cast<int>(i), work); });
}

void ExportWork::walk(const std::vector<const ExportShard*>& shards,
                      const std::function<void(const OutgoingSample&)>& work) const {
  for (const ExportShard* shard : shards) {
    const ShardReader reader = input.open(*shard);
    for (int slot = 0; slot < reader.header().sample_count; ++slot) {
      with_sample(*shard, reader, slot, work);
    }
  }
}

std::string input_hash(const std::vector<const ExportShard*>& shards) {
  Sha256 hash;
  for (const ExportShard* shard : shards) hash.update(shard->sha256);
  return hash.hex();
}

std::vector<const ExportShard*> of_split(const ExportInput& input,
                                         const std::vector<const ExportShard*>& shards,
                                         const std::string& split) {
  std::vector<const ExportShard*> chosen;
  for (const ExportShard* shard : shards) {
    if (input.source_of(*shard).split == split) chosen.push_back(shard);
  }
  return chosen;
}

void write_image_pair(const OutgoingSample& sample, const std::string& folder, double full_scale,
                      ExportFolder::Step& step) {
  const VolumeShape& shape = sample.reader.header().volume;
  const std::vector<float> volume = sample.reader.volume(sample.slot);
  std::vector<std::uint8_t> codes(volume.size());
  std::ranges::transform(volume, codes.begin(), [&](float value) {
    return static_cast<std::uint8_t>(std::lround(255 * std::min(value / full_scale, 1.0)));
  });
  const std::vector<std::size_t> sides{static_cast<std::size_t>(shape.size.height),
                                       static_cast<std::size_t>(shape.size.width),
                                       static_cast<std::size_t>(shape.channels())};
  step.write(folder + "/" + sample.name + ".png", time_image_png(volume, shape));
  step.write(folder + "/" + sample.name + ".npy",
             npy_file("|u1", sides, channels_last(codes, sides[2])));
}

void account_full_scale(const OutgoingSample& sample, double full_scale, LeftOut& left_out) {
  // Normalised values end at 1; the statistics are of the values before that.
  const bool is_normalized = sample.reader.header().normalization == Normalization::kEta98;
  const double largest = is_normalized ? 1.0 : sample.labels.statistics.max;
  if (largest > full_scale) ++left_out["samples' values above the full scale (cut to it)"];
}

std::optional<Rectangle> person_box(const VolumePerson& person, const JointChoice& choice,
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

std::vector<ExportedJoint> exported_joints(const ShardSample& sample, std::size_t person,
                                           const JointChoice& choice) {
  std::vector<ExportedJoint> joints;
  for (const std::size_t i : choice.indices) {
    joints.push_back({sample.labels.persons.at(person).joints.at(i),
                      sample.annotation.persons.at(person).joints.at(i).visible});
  }
  return joints;
}

ClassNumbers::ClassNumbers(const ExportInput& input, const ExportOptions& options, int first) {
  std::vector<std::string> known;
  for (const ExportSource& source : input.sources()) {
    if (std::ranges::find(input.splits(), source.split) == input.splits().end()) continue;
    for (const std::string& name : source.class_names) {
      if (std::ranges::find(known, name) == known.end()) known.push_back(name);
    }
  }
  if (!options.classes) {
    for (const std::string& name : known) {
      if (name == kDontCare) continue;
      entries_[name] = {Fate::kKept, first};
      names_[first++] = name;
    }
    return;
  }
  const std::string file = options.classes->string();
  std::string reason;
  const auto text = try_read_file(file, reason);
  if (!text) throw InputError("cannot read " + file + ": " + reason);
  FaultList faults(file);
  const auto json = parse_json_text(*text, faults);
  if (!json) throw UsageError(faults.text());
  if (!json->is_object())
    faults.add("$", "class names, each with a number or null", "another value");
  for (const auto& [name, value] : json->items()) {
    if (std::ranges::find(known, name) == known.end()) {
      faults.add(json_path("$", name), fmt::format("one of the classes {}", fmt::join(known, ", ")),
                 "another name");
    } else if (value.is_null()) {
      entries_[name] = {Fate::kLeftOut, 0};
    } else if (!value.is_number_integer() || value < first || value > 100000) {
      faults.add(json_path("$", name), fmt::format("null or a whole number of at least {}", first),
                 dump_json(value));
    } else {
      entries_[name] = {Fate::kKept, value};
    }
  }
  if (!faults.empty()) throw UsageError(faults.text());
  for (const std::string& name : known) {
    if (const Entry entry = of(name); entry.fate == Fate::kKept) {
      std::string& joined = names_[entry.number];
      joined += (joined.empty() ? "" : "/") + name;
    }
  }
  if (names_.empty())
    throw UsageError(file + ": expected a number for at least one class, got none");
}

void ClassNumbers::renumber(const std::map<std::string, int>& given, int first) {
  std::map<int, std::string> names;
  for (const auto& [name, number] : given) {
    if (entries_.contains(name)) names[number] = name;
  }
  for (const auto& [old, name] : names_) {  // in their order
    if (given.contains(name)) continue;
    while (names.contains(first)) ++first;
    names[first] = name;
  }
  names_ = std::move(names);
  for (const auto& [number, name] : names_) entries_[name] = {Fate::kKept, number};
}

ClassNumbers::Entry ClassNumbers::of(const std::string& name) const {
  const auto entry = entries_.find(name);
  return entry == entries_.end() ? Entry{} : entry->second;
}

std::string ClassNumbers::text() const {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, entry] : entries_) {
    json[name] = entry.fate == Fate::kKept ? nlohmann::json(entry.number) : nlohmann::json();
  }
  return dump_json(json);
}

namespace {

const char* word_of(ExportFormat format) {
  switch (format) {
    case ExportFormat::kYolo:
      return "yolo";
    case ExportFormat::kCoco:
      return "coco";
    case ExportFormat::kMpii:
      return "mpii";
    case ExportFormat::kDavis:
      return "davis";
    case ExportFormat::kWebdataset:
      return "webdataset";
    case ExportFormat::kDsec:
      return "dsec";
    case ExportFormat::kRvt:
      return "rvt";
    case ExportFormat::kEvents:
      break;
  }
  return "events";
}

std::unique_ptr<Exporter> make_exporter(const ExportInput& input, const ExportOptions& options) {
  switch (options.to) {
    case ExportFormat::kYolo:
      return yolo_exporter(input, options);
    case ExportFormat::kCoco:
      return coco_exporter(input, options);
    case ExportFormat::kMpii:
      return mpii_exporter(options);
    case ExportFormat::kDavis:
      return davis_exporter(options);
    case ExportFormat::kWebdataset:
      return webdataset_exporter();
    case ExportFormat::kDsec:
      return dsec_exporter(input, options);
    case ExportFormat::kRvt:
      return rvt_exporter(input, options);
    case ExportFormat::kEvents:
      break;
  }
  return events_exporter(options);
}

std::string identity_text(const ExportInput& input, const ExportOptions& options,
                          const Exporter& exporter) {
  std::string text =
      fmt::format("eventgan export, version 1\njob {}, sources {:.16}\nto {}\nplan {}\nsplits",
                  input.name(), input.sources_hash(), word_of(options.to), input.plan_hash());
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
    lines += "],\n\"left_out\": " + dump_json(nlohmann::ordered_json(left_out_)) + "}\n";
    file.write(lines);
    file.publish();
  }

  LeftOut& left_out() { return left_out_; }

 private:
  const ExportWork& work_;
  const Exporter& exporter_;
  std::string identity_;
  LeftOut left_out_;
};

/// What an earlier run has counted.
LeftOut read_left_out(const std::filesystem::path& description) {
  const auto json = nlohmann::json::parse(read_text_file(description));
  return json.at("left_out").get<LeftOut>();
}

}  // namespace

ExportReport run_export(const std::filesystem::path& folder, const ExportOptions& options) {
  const ExportInput input(folder, options.splits);
  const std::unique_ptr<Exporter> exporter = make_exporter(input, options);
  std::vector<const ExportShard*> shards;
  LeftOut sources_left_out;
  ExportReport report{options.out.string(), 0, 0, {}, input.missing()};
  for (const ExportShard& shard : input.shards()) {
    const ExportSource& source = input.source_of(shard);
    if (!exporter->takes(source)) {
      sources_left_out[fmt::format("samples of {} in split {}: {} has no use for them",
                                   source.dataset, source.split, word_of(options.to))] +=
          shard.valid;
      continue;
    }
    shards.push_back(&shard);
    report.samples += shard.valid;
    report.quarantined += static_cast<std::int64_t>(shard.quarantined.size());
  }
  if (shards.empty()) {
    throw UsageError(fmt::format("expected samples that --to {} can use, got none, in {}",
                                 word_of(options.to), folder.string()));
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

  // Of those left out too, since it counts their samples.
  std::vector<const ExportShard*> all;
  for (const ExportShard& shard : input.shards()) all.push_back(&shard);
  ExportFolder::Step step(out, kExportDescription, input_hash(all));
  if (step.is_done()) {
    report.left_out = read_left_out(out.path() / kExportDescription);
  } else {
    Description description(work, *exporter, identity);
    description.left_out() = sources_left_out;
    description.write(shards, step.file(kExportDescription));
    step.finish();
    report.left_out = description.left_out();
  }
  if (progress) progress->finish();
  return report;
}

std::string to_text(const ExportReport& report) {
  std::string text =
      fmt::format("{}: {} samples, {} quarantined samples left out (listed in export.json)\n",
                  report.folder, report.samples, report.quarantined);
  for (const auto& [what, count] : report.left_out) {
    text += fmt::format("left out: {} {}\n", count, what);
  }
  if (!report.missing.empty()) {
    text += fmt::format("PARTIAL: {} shards were missing when the folder was finalized\n",
                        report.missing.size());
  }
  return text;
}

std::string to_json(const ExportReport& report) {
  return dump_json(nlohmann::json{{"event", "report"},
                                  {"folder", report.folder},
                                  {"samples", report.samples},
                                  {"quarantined", report.quarantined},
                                  {"left_out", report.left_out},
                                  {"missing_shards", report.missing}}) +
         "\n";
}

}  // namespace eventgan
