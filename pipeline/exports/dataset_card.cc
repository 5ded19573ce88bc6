#include "pipeline/exports/detail/dataset_card.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "manifests/documents/json_text.h"
#include "manifests/values/text.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

// ---- the files

/// A pattern without brackets, with what is in them and without.
std::vector<std::string> without_brackets(const std::string& pattern) {
  const std::size_t begin = pattern.find('[');
  if (begin == pattern.npos) return {pattern};
  const std::size_t end = pattern.find(']', begin);
  const std::string before = pattern.substr(0, begin), after = pattern.substr(end + 1);
  std::vector<std::string> all = without_brackets(before + after);
  for (std::string& one :
       without_brackets(before + pattern.substr(begin + 1, end - begin - 1) + after)) {
    all.push_back(std::move(one));
  }
  return all;
}

/// Those of a kind with one split in their names, or with none.
struct Candidates {
  std::size_t kind = 0;
  std::string split;
  std::string pattern;
  bool is_listed = false;  ///< name by name: `*` would mean others, too
  bool is_found = false;
  std::set<std::string> names;
};

/// The splits of files whose names are those of shards, or begin with the split (SET).
class SplitsOfNames {
 public:
  explicit SplitsOfNames(const ExportInput& input) : input_(input) {
    for (const ExportShard& shard : input.shards()) {
      of_shard_[stem(shard.outline.name)] = input.source_of(shard).split;
    }
  }

  std::string of(const std::string& name) const {
    const auto shard = of_shard_.find(stem(name));
    if (shard != of_shard_.end()) return shard->second;
    std::string longest;
    for (const std::string& split : input_.splits()) {
      if (name.starts_with(split) && split.size() > longest.size()) longest = split;
    }
    return longest;
  }

 private:
  static std::string stem(const std::string& name) { return name.substr(0, name.rfind('.')); }

  const ExportInput& input_;
  std::map<std::string, std::string> of_shard_;
};

std::vector<FilesOfKind> files_of(const ExportWork& work, const ExportFormat& format) {
  std::vector<Candidates> all;
  for (std::size_t kind = 0; kind < format.files.size(); ++kind) {
    const std::string pattern(format.files[kind].name);
    bool has_parts = false;
    spelled(
        pattern, [&](auto) { return has_parts = true, ""; }, [](char) { return ""; });
    const bool is_listed = has_parts && pattern.find('/') == pattern.npos;
    if (pattern.find("SPLIT") == pattern.npos) {
      all.push_back({kind, "", pattern, is_listed, false, {}});
      continue;
    }
    for (const std::string& split : work.input.splits()) {
      all.push_back({kind, split, pattern, false, false, {}});
    }
  }
  work.folder.for_each_file([&](const std::string& name) {
    for (Candidates& candidates : all) {
      if (candidates.is_found && !candidates.is_listed) continue;
      if (!fits(name, candidates.pattern, candidates.split)) continue;
      candidates.is_found = true;
      if (candidates.is_listed) candidates.names.insert(name);
      break;
    }
  });
  const SplitsOfNames splits(work.input);
  std::vector<FilesOfKind> files;
  for (const Candidates& candidates : all) {
    if (!candidates.is_found) continue;
    const ExportFile* const kind = &format.files[candidates.kind];
    if (files.empty() || files.back().kind != kind) files.push_back({kind, {}});
    auto& by_split = files.back().by_split;
    if (candidates.is_listed) {
      std::map<std::string, std::vector<std::string>> listed;
      for (const std::string& name : candidates.names) {
        listed[splits.of(name)].push_back(name);
      }
      for (const std::string& split : work.input.splits()) {
        if (listed.contains(split)) by_split.emplace_back(split, std::move(listed[split]));
      }
    } else {
      std::vector<std::string> names;
      for (const std::string& pattern : without_brackets(candidates.pattern)) {
        names.push_back(spelled(
            pattern,
            [&](std::string_view word) { return word == "SPLIT" ? candidates.split : "*"; },
            [](char c) { return std::string(1, c); }));
      }
      by_split.emplace_back(candidates.split, std::move(names));
    }
  }
  return files;
}

// ---- README.md: YAML between two lines of ---, then Markdown

/// Text that is not ours as it may be in a line of Markdown: nothing of it is taken for markup.
std::string markdown(const std::string& text) {
  std::string escaped;
  for (const char c : escape_controls(text)) {
    if (std::string_view("\\`*_[]<>|~&$").find(c) != std::string_view::npos) {
      escaped += '\\';
    }
    escaped += c;
  }
  return escaped;
}

/// Text between lines that it does not have.
std::string fenced(const std::string& text) {
  std::string fence = "```";
  while (text.find(fence) != text.npos) fence += '`';
  return fence + "\n" + text + (text.ends_with('\n') ? "" : "\n") + fence + "\n";
}

/// The Hub's classes of sizes.
const char* size_category(std::int64_t samples) {
  constexpr std::pair<std::int64_t, const char*> kCategories[] = {
      {1'000, "n<1K"},          {10'000, "1K<n<10K"},     {100'000, "10K<n<100K"},
      {1'000'000, "100K<n<1M"}, {10'000'000, "1M<n<10M"}, {100'000'000, "10M<n<100M"}};
  for (const auto& [limit, category] : kCategories) {
    if (samples < limit) return category;
  }
  return "100M<n<1B";
}

/// What a card counts, by split.
struct CardCounts {
  std::int64_t samples = 0;
  std::map<std::string, std::int64_t> boxes;  ///< by class
  std::int64_t boxes_to_ignore = 0;
  std::int64_t persons = 0;
};

std::map<std::string, CardCounts> counts_of(const ExportWork& work,
                                            const std::vector<const ExportShard*>& shards) {
  std::map<std::string, CardCounts> counts;
  work.walk(shards, [&](const OutgoingSample& sample) {
    CardCounts& count = counts[sample.source.split];
    ++count.samples;
    const ShardSample& labels = sample.labels;
    for (std::size_t i = 0; i < labels.annotation.boxes.size(); ++i) {
      const auto class_id = static_cast<std::size_t>(labels.annotation.boxes[i].class_id);
      if (labels.labels.boxes.at(i).ignore) {
        ++count.boxes_to_ignore;
      } else {
        ++count.boxes[sample.source.class_names.at(class_id)];
      }
    }
    count.persons += std::ssize(labels.annotation.persons);
  });
  return counts;
}

/// The licence that a dataset's authors publish it under, as the Hub calls it; empty: it is not
/// known, or has no name there.
std::string_view licence_of(std::string_view dataset) {
  return dataset.starts_with("kitti_") ? "cc-by-nc-sa-3.0" : "";
}

/// That of all sources; empty: unknown, or several.
std::string licence_of(const ExportInput& input, const std::vector<const ExportShard*>& shards) {
  std::set<std::string_view> licences;
  for (const ExportShard* shard : shards) {
    licences.insert(licence_of(input.source_of(*shard).dataset));
  }
  return licences.size() == 1 ? std::string(*licences.begin()) : "";
}

/// The tasks of the format that the sources have labels for.
std::vector<std::string_view> tasks_of(const ExportFormat& format, const ExportInput& input,
                                       const std::vector<const ExportShard*>& shards) {
  constexpr std::string_view kOfBoxes = "object-detection", kOfJoints = "keypoint-detection";
  std::vector<std::string_view> tasks = format.tasks;
  if (tasks.empty() && format.need != LabelNeed::kNone) {
    if (format.need != LabelNeed::kJoints) tasks.push_back(kOfBoxes);
    if (format.need != LabelNeed::kBoxes) tasks.push_back(kOfJoints);
  }
  std::erase_if(tasks, [&](std::string_view task) {
    return std::ranges::none_of(shards, [&](const ExportShard* shard) {
      const ExportSource& source = input.source_of(*shard);
      return task == kOfJoints ? source.has_joints() : source.has_boxes();
    });
  });
  return tasks;
}

/// What the Hub reads.
std::string front_matter(const ExportWork& work, const ExportFormat& format,
                         const std::vector<const ExportShard*>& shards,
                         const std::vector<FilesOfKind>& files, const std::string& licence) {
  const auto quoted = [](const std::string& text) {
    return dump_json(nlohmann::ordered_json(text));
  };
  std::int64_t samples = 0;
  for (const ExportShard* shard : shards) samples += shard->valid;
  std::string text = fmt::format("license: {}\npretty_name: {}\n",
                                 licence.empty() ? "unknown" : licence, quoted(work.input.name()));
  const auto tasks = tasks_of(format, work.input, shards);
  if (!tasks.empty()) text += "task_categories:\n";
  for (const std::string_view task : tasks) text += fmt::format("- {}\n", task);
  text += fmt::format("size_categories:\n- {}\ntags:\n- event-camera\n- {}\n- eventgan\n",
                      size_category(samples), format.word);
  if (files.empty() || files[0].by_split[0].first.empty()) return text;
  text += "configs:\n- config_name: default\n  data_files:\n";
  for (const auto& [split, names] : files[0].by_split) {
    // The Hub's names of splits have no hyphens.
    std::string name = split;
    std::ranges::replace(name, '-', '_');
    text += "  - split: " + quoted(name) + "\n    path:\n";
    for (const std::string& file : names) text += "    - " + quoted(file) + "\n";
  }
  return text;
}

std::string card_text(const ExportWork& work, const ExportFormat& format,
                      const std::vector<const ExportShard*>& shards,
                      const std::vector<FilesOfKind>& files, const std::string& licence) {
  const ExportInput& input = work.input;
  std::string text = "---\n" + front_matter(work, format, shards, files, licence) + "---\n\n# " +
                     markdown(input.name()) +
                     "\n\nData for event cameras, made by eventgan: " + std::string(format.title) +
                     ".\n\n## Files\n\n| files | what |\n|---|---|\n";
  for (const FilesOfKind& of_kind : files) {
    text += fmt::format("| `{}` | {} |\n", of_kind.kind->name, of_kind.kind->what);
  }
  text +=
      licence.empty()
          ? "\n## Licence\n\n**To be filled in**, as `license` above and in croissant.json. The "
            "labels, and the events that were made from the images, are subject to the licences of "
            "the sources below."
          : "\n## Licence\n\nThat of the sources below, as their authors publish them: **another "
            "one if these are not their images**, as `license` above and in croissant.json.";
  text +=
      " croissant.json lacks `url`, `creator` and `datePublished`, too.\n\n"
      "## Sources\n\n| source | split | samples | quarantined samples, left out |\n"
      "|---|---|---|---|\n";
  std::map<int, std::pair<std::int64_t, std::int64_t>> of_source;  // valid, quarantined
  for (const ExportShard* shard : shards) {
    auto& [valid, quarantined] = of_source[shard->outline.source];
    valid += shard->valid;
    quarantined += std::ssize(shard->quarantined);
  }
  for (const auto& [index, count] : of_source) {
    const ExportSource& source = input.sources().at(static_cast<std::size_t>(index));
    text += fmt::format("| {} | {} | {} | {} |\n", markdown(source.dataset), markdown(source.split),
                        count.first, count.second);
  }
  text += "\n## Counts\n\n| split | what | count |\n|---|---|---|\n";
  for (const auto& [split, count] : counts_of(work, shards)) {
    const auto row = [&, name = markdown(split)](const std::string& what, std::int64_t number) {
      text += fmt::format("| {} | {} | {} |\n", name, what, number);
    };
    row("samples", count.samples);
    for (const auto& [name, boxes] : count.boxes) row("boxes of class " + markdown(name), boxes);
    if (count.boxes_to_ignore > 0) row("boxes to ignore", count.boxes_to_ignore);
    if (count.persons > 0) row("persons with joints", count.persons);
  }
  if (!input.missing().empty()) {
    text +=
        "\n**Not complete**: without " + count_text(std::ssize(input.missing()), "shard") + ".\n";
  }
  const ShardHeader header = input.open(*shards.front()).header();
  const VolumeShape& shape = header.volume;
  text += fmt::format(
      "\n## How it was made\n\n| | |\n|---|---|\n| program | {} |\n| weights | {} |\n"
      "| SHA-256 of the weights, or of a simulator's settings | {} |\n| generator | {} |\n"
      "| volume, of the first shard | {} channels, {} x {} pixels |\n"
      "| SHA-256 of the plan | {} |\n\n"
      "The manifest (look through its paths before you share them):\n\n",
      markdown(header.program_version),
      header.weights.empty() ? "not named" : markdown(header.weights), header.weights_hash,
      markdown(header.generator), shape.channels(), shape.size.width, shape.size.height,
      header.plan_hash);
  return text + fenced(header.manifest_text);
}

}  // namespace

std::vector<std::string> write_dataset_card(const ExportWork& work, const ExportFormat& format,
                                            const std::vector<const ExportShard*>& shards) {
  const std::string input = fmt::format("{} {}", input_hash(shards), work.input.missing().size());
  ExportFolder::Step step(work.folder, "card", input);
  std::vector<std::string> notes;
  if (step.is_done()) return notes;
  const std::vector<FilesOfKind> files = files_of(work, format);
  const std::string licence = licence_of(work.input, shards);
  for (const auto& [name, text] :
       {std::pair(kCardName, card_text(work, format, shards, files, licence)),
        std::pair(kCroissantName, croissant_text(work, format, files, licence))}) {
    if (step.write_unless_edited(std::string(name), text)) continue;
    notes.push_back(fmt::format("{} stays as you edited it: delete it to have it made anew", name));
  }
  step.finish();
  return notes;
}

}  // namespace eventgan
