#include "manifests/plan.h"

namespace eventgan {

std::int64_t Plan::sample_count() const {
  std::int64_t count = 0;
  for (const PlannedShard& shard : shards) count += std::ssize(shard.samples);
  return count;
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
