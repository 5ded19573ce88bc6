#include "manifests/documents/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "manifests/documents/detail/plan_lines.h"
#include "manifests/documents/json_text.h"

namespace eventgan {

std::int64_t Plan::sample_count() const {
  std::int64_t count = 0;
  for (const PlannedShard& shard : shards) count += std::ssize(shard.samples);
  return count;
}

std::vector<std::string> notes_of(const std::vector<SourceSummary>& sources,
                                  const std::set<std::string>& unknown) {
  std::vector<std::string> notes;
  for (const SourceSummary& source : sources) {
    notes.insert(notes.end(), source.notes.begin(), source.notes.end());
  }
  if (!unknown.empty()) {
    notes.push_back(
        fmt::format("the folder is of a later version, and has what this program does not know: {}",
                    fmt::join(unknown, ", ")));
  }
  return notes;
}

std::string notes_text(const std::vector<std::string>& all) {
  if (all.empty()) return "";
  std::vector<std::string> notes = all;
  const auto after_losses = std::stable_partition(
      notes.begin(), notes.end(),
      [](const std::string& note) { return note.find("left out") != note.npos; });
  const auto losses = static_cast<std::size_t>(after_losses - notes.begin());
  const std::size_t listed = std::clamp<std::size_t>(losses, 5, 50);
  std::string text =
      std::to_string(notes.size()) + (notes.size() == 1 ? " note" : " notes") + " on the inputs:\n";
  for (std::size_t i = 0; i < std::min(notes.size(), listed); ++i) {
    text += "  note: " + escape_controls(notes[i]) + "\n";
  }
  if (notes.size() > listed) {
    text += "  ... and " + std::to_string(notes.size() - listed) + " more (in plan.json)\n";
  }
  return text;
}

std::vector<std::string> fingerprint_differences(const std::map<std::string, std::string>& frozen,
                                                 const std::map<std::string, std::string>& now) {
  const auto value = [](const std::map<std::string, std::string>& fields, const std::string& key) {
    const auto found = fields.find(key);
    return found == fields.end() ? std::string("nothing") : found->second;
  };
  std::map<std::string, std::string> all = frozen;
  all.insert(now.begin(), now.end());
  std::vector<std::string> lines;
  for (const auto& [field, ignored] : all) {
    const std::string expected = value(frozen, field);
    const std::string got = value(now, field);
    if (expected != got) lines.push_back(field + ": expected " + expected + ", got " + got);
  }
  return lines;
}

std::int64_t PlanOutline::sample_count() const {
  std::int64_t count = 0;
  for (const ShardOutline& shard : shards) count += shard.samples;
  return count;
}

ShardOutline outline_of(const PlannedShard& shard) {
  return {shard.name, shard.source, shard.volume_size, static_cast<int>(shard.samples.size()),
          shard.size_unknown};
}

std::vector<ShardOutline> outlines_of(const std::vector<const PlannedShard*>& shards) {
  std::vector<ShardOutline> outlines;
  for (const PlannedShard* shard : shards) outlines.push_back(outline_of(*shard));
  return outlines;
}

PlanOutline outline_of(const Plan& plan) {
  PlanOutline outline{plan.name, plan.manifest_text, plan.fingerprint, plan.sources,
                      {},        plan.unknown};
  outline.shards.reserve(plan.shards.size());
  for (const PlannedShard& shard : plan.shards) outline.shards.push_back(outline_of(shard));
  return outline;
}

PlanOutline read_plan_outline(std::istream& stream, const std::string& name) {
  return read_plan_lines(stream, name, {});
}

namespace {

using nlohmann::json;

std::string dump(const json& value) {
  // A path need not be UTF-8, but JSON must be; the plan would not find such a file again.
  try {
    return value.dump();
  } catch (const json::type_error&) {
    throw std::runtime_error("expected names in UTF-8, got other bytes, in " + dump_json(value));
  }
}

/// Gathers small pieces into large ones: a piece may cost its taker a call of the system.
class Pieces {
 public:
  explicit Pieces(const std::function<void(std::string_view)>& sink) : sink_(sink) {}

  Pieces& operator<<(std::string_view text) {
    gathered_ += text;
    if (gathered_.size() >= kPieceBytes) flush();
    return *this;
  }

  void flush() {
    sink_(gathered_);
    gathered_.clear();
  }

 private:
  static constexpr std::size_t kPieceBytes = std::size_t{64} << 10;

  const std::function<void(std::string_view)>& sink_;
  std::string gathered_;
};

void write_shard(const PlannedShard& shard, Pieces& pieces) {
  pieces << "{\"height\":" << std::to_string(shard.volume_size.height)
         << ",\"name\":" << dump(shard.name) << ",\"samples\":[";
  const char* between = "\n";
  for (const PlannedSample& sample : shard.samples) {
    pieces << between << dump(to_json_value(sample));
    between = ",\n";
  }
  pieces << "\n]," << (shard.size_unknown ? "\"size_unknown\":true," : "")
         << "\"source\":" << std::to_string(shard.source)
         << ",\"width\":" << std::to_string(shard.volume_size.width) << "}";
}

}  // namespace

void write_plan(const Plan& plan, const std::function<void(std::string_view)>& sink) {
  Pieces pieces(sink);
  pieces << "{\"format\":" << dump(kPlanFormat) << ",\"version\":" << dump(to_string(kPlanVersion))
         << ",\n\"fingerprint\":" << dump(plan.fingerprint)
         << ",\n\"manifest\":" << dump(plan.manifest_text) << ",\n\"name\":" << dump(plan.name)
         << ",\n\"shards\":[";
  const char* between = "\n";
  for (const PlannedShard& shard : plan.shards) {
    pieces << between;
    write_shard(shard, pieces);
    between = ",\n";
  }
  json sources = json::array();
  for (const SourceSummary& source : plan.sources) sources.push_back(to_json_value(source));
  pieces << "\n],\n\"sources\":" << dump(sources) << "}\n";
  pieces.flush();
}

std::string to_json(const Plan& plan) {
  std::string text;
  write_plan(plan, [&](std::string_view piece) { text += piece; });
  return text;
}

Plan read_plan(std::istream& stream, const std::string& name) {
  std::vector<std::vector<PlannedSample>> samples;  // by shard
  PlanOutline outline =
      read_plan_lines(stream, name, [&](std::size_t shard, const StrictValue& sample) {
        samples.resize(shard + 1);
        samples.back().push_back(read_planned_sample(sample));
      });
  Plan plan{std::move(outline.name),
            std::move(outline.manifest_text),
            std::move(outline.fingerprint),
            std::move(outline.sources),
            {},
            std::move(outline.unknown)};
  for (std::size_t i = 0; i < outline.shards.size(); ++i) {
    ShardOutline& shard = outline.shards[i];
    plan.shards.push_back({std::move(shard.name), shard.source, shard.volume_size,
                           std::move(samples[i]), shard.size_unknown});
  }
  return plan;
}

Plan parse_plan(std::string_view text, const std::string& name) {
  std::istringstream stream{std::string(text)};
  return read_plan(stream, name);
}

}  // namespace eventgan
