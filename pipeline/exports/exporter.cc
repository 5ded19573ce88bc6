#include "pipeline/exports/detail/exporter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/events/images/preview_image.h"
#include "stages/labels/label_mapping.h"
#include "stages/shards/sample_check.h"

namespace eventgan {
namespace {

// With a prefix and an extension within the 100 bytes of a tar's names.
constexpr std::size_t kLongest = 75;
constexpr std::size_t kHashDigits = 16;

bool is_plain(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '-' || c == '@';
}

}  // namespace

std::string export_name(std::string_view sample_id) {
  std::string name;
  for (const char c : sample_id) {
    if (is_plain(c)) {
      name += c;
    } else if (c == '/') {
      name += '+';
    } else {
      name += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  if (name.size() <= kLongest) return name;
  return name.substr(0, kLongest - 1 - kHashDigits) + "~" +
         sha256_hex(sample_id).substr(0, kHashDigits);
}

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

void write_polarity_image(const OutgoingSample& sample, const std::string& folder,
                          double full_scale, ExportFolder::Step& step) {
  step.write(folder + "/" + sample.name + ".png",
             polarity_image_png(sample.reader.volume(sample.slot), sample.reader.header().volume,
                                full_scale));
}

float largest_value(const OutgoingSample& sample) {
  // Normalised values end at 1; the statistics are of the values before that.
  const bool is_normalized = sample.reader.header().normalization == Normalization::kEta98;
  return is_normalized ? 1.0f : sample.labels.statistics.max;
}

bool is_cut(const OutgoingSample& sample, const FullScale& full_scale) {
  const double largest = largest_value(sample);
  if (largest > full_scale.value || !full_scale.is_of_sums) return largest > full_scale.value;
  const VolumeShape& shape = sample.reader.header().volume;
  return shape.bins * largest > full_scale.value &&
         largest_polarity_sum(sample.reader.volume(sample.slot), shape) > full_scale.value;
}

void require_listed_person(const ExportInput& input, std::string_view format,
                           const std::function<void()>& check_stop) {
  LeftOut reasons;
  for (const ExportShard& shard : input.shards()) {
    if (!input.source_of(shard).has_joints()) continue;
    const ShardReader reader = input.open(shard);
    const JointChoice choice = choose_joints(reader.header().label_schema);
    for (int slot = 0; slot < reader.header().sample_count; ++slot) {
      check_stop();
      const ShardSample sample = reader.sample(slot);
      if (!sample.valid) continue;
      for (const VolumePerson& person : sample.labels.persons) {
        const std::string why = why_not_listed(person, choice);
        if (why.empty()) return;
        ++reasons[why];
      }
    }
  }
  std::string text;
  bool have_joints = false;
  for (const auto& [why, count] : reasons) {
    text += fmt::format("{}persons: {}: {}", text.empty() ? "" : "; ", why, count);
    have_joints |= why == kNoCentre;
  }
  throw UsageError(fmt::format("expected samples that --to {} can use, got none, in {} ({})",
                               format, input.folder().string(),
                               reasons.empty()
                                   ? "no persons"
                                   : text + (have_joints ? "; --to coco keeps their joints" : "")));
}

Outline shown_outline(const ShardSample& sample, const VolumeBox& box, ImageSize volume) {
  return clip(box.outline, shown_area(sample, volume));
}

std::optional<Rectangle> person_box(const ShardSample& sample, std::size_t index,
                                    const JointChoice& choice, ImageSize volume) {
  const VolumePerson& person = sample.labels.persons.at(index);
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
  const Rectangle cut = clip(box, shown_area(sample, volume));
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

void account_persons(const ShardSample& sample, const JointChoice& choice, ImageSize volume,
                     LeftOut& left_out) {
  for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
    if (!person_box(sample, i, choice, volume)) {
      ++left_out["persons of whom nothing is left in the volume"];
      continue;
    }
    for (const ExportedJoint& joint : exported_joints(sample, i, choice)) {
      if (joint.at != kMissingPoint && !is_within(joint, volume)) {
        ++left_out["joints outside the volume (as not annotated)"];
      }
    }
  }
}

ClassNumbers::ClassNumbers(const ExportInput& input, const ExportOptions& options, int first) {
  std::vector<std::string> known;
  for (const ExportSource& source : input.sources()) {
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
    throw UsageError("expected a number for at least one class, got none, in " + file);
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

}  // namespace eventgan
