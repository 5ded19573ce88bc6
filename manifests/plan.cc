#include "manifests/plan.h"

#include <algorithm>

namespace eventgan {

std::int64_t Plan::sample_count() const {
  std::int64_t count = 0;
  for (const PlannedShard& shard : shards) count += std::ssize(shard.samples);
  return count;
}

std::vector<std::string> notes_of(const std::vector<SourceSummary>& sources) {
  std::vector<std::string> notes;
  for (const SourceSummary& source : sources) {
    notes.insert(notes.end(), source.notes.begin(), source.notes.end());
  }
  return notes;
}

std::string notes_text(const std::vector<std::string>& notes) {
  constexpr std::size_t kListed = 5;
  if (notes.empty()) return "";
  std::string text =
      std::to_string(notes.size()) + (notes.size() == 1 ? " note" : " notes") + " on the inputs:\n";
  for (std::size_t i = 0; i < std::min(notes.size(), kListed); ++i) {
    text += "  note: " + notes[i] + "\n";
  }
  if (notes.size() > kListed) {
    text += "  ... and " + std::to_string(notes.size() - kListed) + " more (in plan.json)\n";
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

}  // namespace eventgan
