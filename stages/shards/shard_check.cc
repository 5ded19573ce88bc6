#include "stages/shards/shard_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <type_traits>
#include <utility>

#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/shards/detail/shard_reader.h"
#include "stages/shards/sample_check.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

std::string text_of(std::int64_t number) { return std::to_string(number); }

/// "Car: 3, Van: 1", or "none".
template <class Key>
std::string text_of(const std::map<Key, std::int64_t>& counts) {
  return counts.empty() ? "none" : counts_text(counts);
}

std::string text_of(const std::vector<std::string>& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

class Comparison {
 public:
  template <class Value>
  void expect(const std::string& what, const Value& record, const Value& shard) {
    if (record == shard) return;
    faults_.push_back("expected " + what + " " + text_of(record) + ", got " + text_of(shard));
  }

  /// Where many slots differ, the first tells enough.
  void expect_rows(const std::string& what, const std::vector<std::int32_t>& record,
                   const std::vector<std::int32_t>& shard) {
    if (record.size() != shard.size()) {
      return expect("number of slots with a count of " + what, std::ssize(record),
                    std::ssize(shard));
    }
    const auto [expected, got] = std::mismatch(record.begin(), record.end(), shard.begin());
    if (expected == record.end()) return;
    expect("number of " + what + " in slot " + std::to_string(expected - record.begin()) + ":",
           std::int64_t{*expected}, std::int64_t{*got});
  }

  std::vector<std::string> take() { return std::move(faults_); }

 private:
  std::vector<std::string> faults_;
};

}  // namespace

std::vector<std::string> contents_faults(const ShardContents& record, const ShardContents& shard) {
  Comparison comparison;
  comparison.expect_rows("boxes", record.boxes, shard.boxes);
  comparison.expect_rows("persons", record.persons, shard.persons);
  comparison.expect("boxes by class", record.classes, shard.classes);
  comparison.expect("samples by gap", record.gaps, shard.gaps);
  comparison.expect("optional columns", record.optional_columns, shard.optional_columns);
  return comparison.take();
}

namespace {

/// Whether the commit record lists just these samples, whose reasons only it has.
bool are_quarantined(const CommitRecord& record, const std::vector<QuarantinedSample>& invalid) {
  std::vector<QuarantinedSample> recorded = record.quarantined;
  for (QuarantinedSample& sample : recorded) sample.reason.clear();
  return std::is_permutation(recorded.begin(), recorded.end(), invalid.begin(), invalid.end());
}

class Check {
 public:
  Check(const std::filesystem::path& path, const CommitRecord& record)
      : path_(path), record_(record) {}

  std::vector<std::string> run() {
    // A file with other bytes is not looked into: HDF5 does not promise to survive that.
    if (!same_bytes()) return faults_;
    const ShardReader reader(path_);
    check_header(reader.header());
    const ShardContents contents = reader.contents();
    check_features(reader.header(), contents);
    std::vector<QuarantinedSample> invalid;
    for (int slot = 0; slot < reader.header().sample_count; ++slot) {
      const ShardSample sample = reader.sample(slot);
      if (!sample.valid) invalid.push_back({slot, sample.sample_id, ""});
      check_sample(reader, slot, sample);
    }
    check_quarantined(invalid);
    for (const std::string& found : contents_faults(record_.contents, contents)) {
      fault(found);
    }
    return faults_;
  }

  /// The reader reports all that is wrong with the structure at once, a line each.
  std::vector<std::string> stopped_by(const std::exception& error) {
    std::istringstream lines(error.what());
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with(path_.string())) {
        faults_.push_back(line);
      } else {
        fault(line);
      }
    }
    return faults_;
  }

 private:
  void fault(const std::string& what) { faults_.push_back(path_.string() + ": " + what); }

  template <class Value>
  void expect(const std::string& what, const Value& expected, const Value& got) {
    if (expected == got) return;
    if constexpr (std::is_arithmetic_v<Value>) {
      fault("expected " + what + " " + std::to_string(expected) + ", got " + std::to_string(got));
    } else {
      fault("expected " + what + " " + expected + ", got " + got);
    }
  }

  bool same_bytes() {
    expect("file name", record_.shard, path_.filename().string());
    std::error_code error;
    const auto size = std::filesystem::file_size(path_, error);
    if (error) {
      fault("cannot read: " + error.message());
    } else if (static_cast<std::int64_t>(size) != record_.size_bytes) {
      expect("size in bytes", record_.size_bytes, static_cast<std::int64_t>(size));
    } else {
      expect("SHA-256", record_.sha256, sha256_of_file(path_));
    }
    return faults_.empty();
  }

  void check_header(const ShardHeader& header) {
    expect("name", record_.shard, header.name);
    expect("plan hash", record_.plan_hash, header.plan_hash);
    expect("number of samples", record_.samples, header.sample_count);
  }

  void check_features(const ShardHeader& header, const ShardContents& contents) {
    std::vector<std::string> known = header.features;
    for (const auto& unknown : unknown_features(known)) std::erase(known, unknown);
    expect("features", text_of(features_of(contents.optional_columns, header.label_schema)),
           text_of(known));
  }

  void check_sample(const ShardReader& reader, int slot, const ShardSample& sample) {
    const std::string where = " (sample " + std::to_string(slot) + ", " + sample.sample_id + ")";
    try {
      const auto found = volume_fault(reader.header(), sample, reader.volume(slot));
      if (found) fault(*found + where);
    } catch (const std::runtime_error& error) {  // checksum
      faults_.push_back(error.what() + where);
    }
    const std::vector<float>& fractions = reader.tables().events.generated_fraction;
    if (!fractions.empty()) {
      const double fraction = sample.valid ? generated_fraction(sample) : 0;
      expect("generated_fraction" + where, static_cast<float>(fraction),
             fractions[static_cast<std::size_t>(slot)]);
    }
    for (const auto& found : label_faults(reader.header(), reader.tables(), slot, sample)) {
      fault(found + where);
    }
  }

  void check_quarantined(const std::vector<QuarantinedSample>& invalid) {
    const int samples = record_.samples;
    expect("number of valid samples", record_.valid, samples - static_cast<int>(invalid.size()));
    if (!are_quarantined(record_, invalid)) {
      fault(
          "expected the samples with valid = 0 to be those that the commit record lists, got "
          "others");
    }
  }

  const std::filesystem::path& path_;
  const CommitRecord& record_;
  std::vector<std::string> faults_;
};

}  // namespace

std::vector<std::string> check_shard(const std::filesystem::path& shard,
                                     const CommitRecord& record) {
  Check check(shard, record);
  try {
    return check.run();
  } catch (const LimitReached&) {  // which says nothing of the shard
    throw;
  } catch (const std::exception& error) {
    return check.stopped_by(error);
  }
}

std::vector<std::string> count_faults(const std::filesystem::path& shard,
                                      const CommitRecord& record) {
  std::vector<std::string> faults;
  ShardTables tables;
  ShardHeader header;
  {
    const Hdf5Lock lock;
    ShardFile file = open_shard(shard, faults, Columns::kCounted);
    tables = std::move(file.tables);
    header = std::move(file.header);
  }
  if (!faults.empty()) throw std::runtime_error(faults.front());
  std::vector<QuarantinedSample> invalid;
  for (std::size_t slot = 0; slot < tables.valid.size(); ++slot) {
    if (tables.valid[slot] != 0) continue;
    invalid.push_back({static_cast<int>(slot), tables.pairs.sample_id[slot], ""});
  }
  if (!are_quarantined(record, invalid)) {
    faults.push_back("expected the " + std::to_string(invalid.size()) +
                     " samples with valid = 0 as quarantined, got others");
  }
  for (std::string& fault : contents_faults(contents_of(tables, header), record.contents)) {
    faults.push_back(std::move(fault));
  }
  return faults;
}

}  // namespace eventgan
