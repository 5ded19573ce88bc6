#include "pipeline/dataset/dataset_description.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/report.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "pipeline/folder/shard_guard.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

JobManifest frozen_manifest(const fs::path& folder, const PlanOutline& plan) {
  const std::string name = "the manifest in " + (folder / "plan.json").string();
  try {
    return parse_job_manifest(plan.manifest_text, folder, name);
  } catch (const UsageError&) {  // a fault of the plan, not of the command line
    std::throw_with_nested(std::runtime_error("expected a plan with a valid manifest"));
  }
}

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw std::runtime_error(
      "expected a shard that matches its plan and commit record, got another " + what + ", in " +
      file.string() + " (eventgan convert makes it again)");
}

/// The header of a shard whose bytes are its commit record's.
ShardHeader read_shard_header(const fs::path& folder, const ShardState& shard,
                              const std::string& plan_hash) {
  const fs::path file = folder / shard.outline.name;
  ShardHeader header = ShardReader(file).header();
  if (header.name != shard.outline.name) refuse(file, "name");
  if (header.plan_hash != plan_hash) refuse(file, "plan hash");
  if (header.sample_count != shard.outline.samples) refuse(file, "number of samples");
  if (header.volume.size != shard.outline.volume_size && !shard.outline.size_unknown)
    refuse(file, "size of volumes");
  return header;
}

}  // namespace

DatasetParts read_dataset_parts(const fs::path& folder, FrozenOutline frozen,
                                std::vector<ShardState> shards) {
  DatasetParts parts;
  parts.frozen = std::move(frozen);
  parts.manifest = frozen_manifest(folder, parts.frozen.plan);
  parts.amendments = read_amendments(folder, parts.frozen.hash);
  for (ShardState& shard : shards) {
    if (!shard.done()) {
      parts.missing.push_back(std::move(shard));
      continue;
    }
    ShardOutline& outline = shard.outline;
    const bool is_first = !parts.headers.contains(outline.source);
    if (shard.sound() && (is_first || outline.size_unknown)) {
      ShardHeader header = read_shard_header(folder, shard, parts.frozen.hash);
      outline.volume_size = header.volume.size;
      if (is_first) parts.headers[outline.source] = std::move(header);
    } else if (!shard.sound() && outline.size_unknown) {
      outline.volume_size = {};
    }
    parts.done.push_back(std::move(shard));
  }
  return parts;
}

DatasetParts read_dataset_parts(const fs::path& folder) {
  lift_time_limit();  // plan and commit records of a large job take long, and are no HDF5
  FrozenOutline frozen = read_frozen_outline(folder);
  std::vector<ShardState> shards = scan_shards(folder, frozen.plan.shards, frozen.hash);
  renew_time_limit();
  DatasetParts parts = read_dataset_parts(folder, std::move(frozen), std::move(shards));
  lift_time_limit();
  if (parts.done.empty()) {
    throw InputError("expected finished shards, got none, in " + folder.string());
  }
  return parts;
}

namespace {

bool alike(const ShardHeader& a, const ShardHeader& b) {
  return a.dataset == b.dataset && a.volume == b.volume && a.label_schema == b.label_schema;
}

std::string kind_of(const ShardHeader& header) {
  const ImageSize& size = header.volume.size;
  return header.dataset + "-" + std::to_string(size.height) + "x" + std::to_string(size.width);
}

void name_groups(std::vector<DatasetView>& views) {
  if (views.size() < 2) return;
  std::map<std::string, int> seen;
  for (DatasetView& view : views) {
    view.group = kind_of(view.header);
    if (const int number = ++seen[view.group]; number > 1) {
      view.group.append(1, '-').append(std::to_string(number));
    }
  }
}

}  // namespace

std::vector<DatasetView> views_of(const DatasetParts& parts) {
  std::vector<DatasetView> views;
  std::vector<std::vector<ViewShard>> shards;  // of each view
  for (const ShardState& shard : parts.done) {
    // All of a shard's header that a view shows is its source's, but for the size.
    ShardHeader header = parts.headers.at(shard.outline.source);
    header.volume.size = shard.outline.volume_size;
    const auto view = std::ranges::find_if(
        views, [&](const DatasetView& known) { return alike(known.header, header); });
    const auto number = static_cast<std::size_t>(view - views.begin());
    if (view == views.end()) {
      views.push_back({"", std::move(header), {}});
      shards.emplace_back();
    }
    shards[number].push_back({parts.source_of(shard.outline).split, *shard.record});
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].layout = lay_out_view(std::move(shards[i]));
  }
  name_groups(views);
  return views;
}

void add(const CommitRecord& record, DatasetCounts& counts) {
  ++counts.shards;
  counts.samples += record.samples;
  counts.valid += record.valid;
  counts.boxes +=
      std::accumulate(record.contents.boxes.begin(), record.contents.boxes.end(), std::int64_t{0});
  counts.persons += std::accumulate(record.contents.persons.begin(), record.contents.persons.end(),
                                    std::int64_t{0});
  counts.size_bytes += record.size_bytes;
  for (const auto& [name, boxes] : record.contents.classes) counts.classes[name] += boxes;
  for (const auto& [gap, samples] : record.contents.gaps) counts.gaps[gap] += samples;
}

namespace {

using Json = nlohmann::json;

Json counts_json(const DatasetCounts& counts) {
  Json gaps = Json::object();
  for (const auto& [gap, samples] : counts.gaps) gaps[std::to_string(gap)] = samples;
  return {{"shards", counts.shards},        {"samples", counts.samples},
          {"valid", counts.valid},          {"quarantined", counts.quarantined()},
          {"boxes", counts.boxes},          {"boxes_by_class", counts.classes},
          {"persons", counts.persons},      {"samples_by_gap", gaps},
          {"size_bytes", counts.size_bytes}};
}

Json counts_json(const DatasetParts& parts) {
  DatasetCounts total;
  std::map<std::string, DatasetCounts> splits;
  std::map<std::string, DatasetCounts> datasets;
  for (const ShardState& shard : parts.done) {
    const SourceSpec& source = parts.source_of(shard.outline);
    for (DatasetCounts* counts :
         {&total, &splits[source.split], &datasets[std::string(to_string(source.dataset))]}) {
      add(*shard.record, *counts);
    }
  }
  Json by_split = Json::object();
  for (const auto& [name, counts] : splits) by_split[name] = counts_json(counts);
  Json by_dataset = Json::object();
  for (const auto& [name, counts] : datasets) by_dataset[name] = counts_json(counts);
  return {{"total", counts_json(total)}, {"by_split", by_split}, {"by_dataset", by_dataset}};
}

Json shard_entry(const DatasetParts& parts, const ShardState& shard) {
  const SourceSpec& source = parts.source_of(shard.outline);
  DatasetCounts counts;
  add(*shard.record, counts);
  return {{"name", shard.outline.name},
          {"split", source.split},
          {"dataset", to_string(source.dataset)},
          {"samples", counts.samples},
          {"valid", counts.valid},
          {"boxes", counts.boxes},
          {"persons", counts.persons},
          {"size_bytes", counts.size_bytes},
          {"sha256", shard.record->sha256}};
}

/// Those of planning, and those that the source's shards tell of.
std::vector<std::string> source_notes(const DatasetParts& parts, std::size_t index) {
  InputCounts inputs;
  for (const ShardState& shard : parts.done) {
    if (std::cmp_equal(shard.outline.source, index)) inputs += shard.record->inputs;
  }
  std::vector<std::string> notes = parts.frozen.plan.sources.at(index).notes;
  std::ranges::copy(inputs.notes(), std::back_inserter(notes));
  return notes;
}

Json source_entry(const DatasetParts& parts, std::size_t index) {
  const SourceSpec& spec = parts.manifest.sources[index];
  const SourceSummary& summary = parts.frozen.plan.sources.at(index);
  Json source = {{"dataset", to_string(spec.dataset)},
                 {"split", spec.split},
                 {"labelled_frames", summary.labelled_frames},
                 {"unpaired", summary.unpaired},
                 {"unpaired_frames", summary.unpaired_ids.size()},
                 {"notes", source_notes(parts, index)},
                 {"class_names", nullptr},
                 {"joint_names", nullptr}};
  // Names are in the shards; a source of which no shard is done yet keeps them to itself.
  if (const auto header = parts.headers.find(static_cast<int>(index));
      header != parts.headers.end()) {
    source["class_names"] = header->second.label_schema.class_names;
    source["joint_names"] = header->second.label_schema.joint_names;
  }
  return source;
}

std::vector<QuarantinedSlot> quarantined_in(const DatasetParts& parts) {
  std::vector<QuarantinedSlot> slots;
  for (const ShardState& shard : parts.done) {
    for (const QuarantinedSample& sample : shard.record->quarantined) {
      slots.push_back({shard.outline.name, sample.slot, sample.sample_id, sample.reason});
    }
  }
  return slots;
}

Json view_entry(const DatasetView& view) {
  const VolumeShape& volume = view.header.volume;
  return {{"group", view.group.empty() ? "/" : view.group},
          {"dataset", view.header.dataset},
          {"dtype", to_string(view.header.dtype)},
          {"volume_shape", {volume.channels(), volume.size.height, volume.size.width}},
          {"samples", view.layout.sample_count()},
          {"splits", json_list(view.layout.splits, [](const SplitRange& split) -> Json {
             return {{"name", split.name},
                     {"first", split.samples.first},
                     {"rows", split.samples.count}};
           })}};
}

/// What the settings do not say of what decided the bytes: inputs, versions, the processor. The
/// manifest's own fields are under "settings".
std::map<std::string, std::string> circumstances(const DatasetParts& parts) {
  auto fields = amended(parts.frozen.plan.fingerprint, parts.amendments);
  std::erase_if(fields, [](const auto& field) { return field.first.starts_with("manifest "); });
  return fields;
}

/// The manifest, which may have comments; it was parsed strictly before.
Json settings(const std::string& manifest_text) {
  return Json::parse(manifest_text, nullptr, /*allow_exceptions=*/true, /*ignore_comments=*/true);
}

/// Those of any of the shards.
std::set<std::string> features(const DatasetParts& parts) {
  std::set<std::string> features;
  for (const ShardState& shard : parts.done) {
    const auto header = parts.headers.find(shard.outline.source);
    const bool is_known = header != parts.headers.end();
    const auto names = features_of(shard.record->contents.optional_columns,
                                   is_known ? header->second.label_schema : LabelSchema());
    features.insert(names.begin(), names.end());
  }
  return features;
}

/// dataset.json but for its view.
Json description(const DatasetParts& parts) {
  const ShardHeader& header = parts.headers.begin()->second;
  Json json = {{"format", kDatasetFormat},
               {"version", to_string(kDatasetVersion)},
               {"features", features(parts)},
               {"name", parts.frozen.plan.name},
               {"complete", parts.missing.empty()},
               {"plan_hash", parts.frozen.hash},
               {"fingerprint", circumstances(parts)},
               {"program_version", header.program_version},
               {"weights_hash", header.weights_hash},
               {"generator", header.generator},
               {"settings", settings(parts.frozen.plan.manifest_text)},
               {"counts", counts_json(parts)}};
  json["missing"] =
      json_list(parts.missing, [](const ShardState& shard) { return shard.outline.name; });
  json["sources"] = Json::array();
  for (std::size_t i = 0; i < parts.manifest.sources.size(); ++i) {
    json["sources"].push_back(source_entry(parts, i));
  }
  json["shards"] =
      json_list(parts.done, [&](const ShardState& shard) { return shard_entry(parts, shard); });
  json["quarantined"] = quarantined_in(parts);
  if (parts.amendments.empty()) return json;
  json["amendments"] = json_list(parts.amendments, [](const Amendment& amendment) -> Json {
    return {{"fields", amendment.fields}, {"samples", amendment.samples}};
  });
  return json;
}

/// A reason may quote a path, and paths need not be UTF-8, but JSON must be.
std::string text_of(const Json& json) { return dump_json(json, JsonLayout::kIndented) + "\n"; }

}  // namespace

std::string describe_dataset(const DatasetParts& parts, const std::vector<DatasetView>& views,
                             const ViewReceipt& receipt) {
  Json json = description(parts);
  json["view"] = {{"name", kViewName},
                  {"sha256", receipt.sha256},
                  {"size_bytes", receipt.size_bytes},
                  {"views", json_list(views, view_entry)}};
  return text_of(json);
}

std::string describe_present_view(const fs::path& folder, const DatasetParts& parts) {
  const fs::path view = folder / kViewName;
  return describe_dataset(parts, views_of(parts),
                          {sha256_of_file(view), static_cast<std::int64_t>(fs::file_size(view))});
}

std::string describe_dataset(const DatasetParts& parts) { return text_of(description(parts)); }

std::string contents_text(const DatasetCounts& counts) {
  return fmt::format("{}, {} of them quarantined, {}, {} with joints",
                     count_text(counts.samples, "sample"), counts.quarantined(),
                     count_text(counts.boxes, "box"), count_text(counts.persons, "person"));
}

std::string dataset_text(const DatasetParts& parts) {
  constexpr std::size_t kListed = 20;
  DatasetCounts total;
  std::map<int, DatasetCounts> sources;
  std::set<std::string> sizes;
  for (const ShardState& shard : parts.done) {
    add(*shard.record, total);
    add(*shard.record, sources[shard.outline.source]);
    sizes.insert(to_string(shard.outline.volume_size));
  }
  const ShardHeader& header = parts.headers.begin()->second;
  const std::vector<std::string> few(sizes.begin(), sizes.end());
  const std::size_t shown = std::min(few.size(), kListed);

  std::string text = parts.frozen.plan.name + "\n";
  const auto line = [&](std::string_view name, const std::string& value) {
    text += fmt::format("  {:14} {}\n", name, escape_controls(value));
  };
  line("shards", fmt::format("{} of {} done", total.shards, std::ssize(parts.frozen.plan.shards)));
  line("contents", contents_text(total));
  for (const auto& [source, counts] : sources) {
    const SourceSpec& spec = parts.manifest.sources.at(static_cast<std::size_t>(source));
    line("source", fmt::format("{} {}, split {}: {}", to_string(spec.dataset), spec.root,
                               spec.split, contents_text(counts)));
  }
  line("volumes",
       fmt::format("2 polarities x {} bins, {}{} pixels, {}, normalization {}", header.volume.bins,
                   fmt::join(few.begin(), few.begin() + std::ptrdiff_t(shown), ", "),
                   shown < few.size() ? fmt::format(" and {} more", few.size() - shown) : "",
                   to_string(header.dtype), to_string(header.normalization)));
  line("gaps", counts_text(total.gaps) + " (frames: samples)");
  if (total.boxes > 0) line("boxes", counts_text(total.classes));
  line("generator", header.generator);
  line("weights",
       header.weights.empty() ? header.weights_hash : header.weights + ", " + header.weights_hash);
  line("plan", parts.frozen.hash);
  for (std::size_t i = 0; i < std::min(parts.done.size(), kListed); ++i) {
    const CommitRecord& record = *parts.done[i].record;
    line(i == 0 ? "done" : "",
         fmt::format("{}, {}, {} of them quarantined", record.shard,
                     count_text(record.samples, "sample"), record.samples - record.valid));
  }
  if (parts.done.size() > kListed) {
    line("", fmt::format("... and {} more (--json lists them)", parts.done.size() - kListed));
  }
  return text;
}

}  // namespace eventgan
