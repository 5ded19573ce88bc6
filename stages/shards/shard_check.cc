#include "stages/shards/shard_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <type_traits>
#include <utility>

#include "manifests/values/text.h"
#include "stages/base/files/sha256.h"
#include "stages/shards/sample_check.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_reader_internal.h"

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
  void expect(const std::string& what, const Value& marker, const Value& shard) {
    if (marker == shard) return;
    faults_.push_back("expected " + what + " " + text_of(marker) + ", got " + text_of(shard));
  }

  /// Where many slots differ, the first tells enough.
  void expect_rows(const std::string& what, const std::vector<std::int32_t>& marker,
                   const std::vector<std::int32_t>& shard) {
    if (marker.size() != shard.size()) {
      return expect("number of slots with a count of " + what, std::ssize(marker),
                    std::ssize(shard));
    }
    const auto [expected, got] = std::mismatch(marker.begin(), marker.end(), shard.begin());
    if (expected == marker.end()) return;
    expect("number of " + what + " in slot " + std::to_string(expected - marker.begin()) + ":",
           std::int64_t{*expected}, std::int64_t{*got});
  }

  std::vector<std::string> take() { return std::move(faults_); }

 private:
  std::vector<std::string> faults_;
};

}  // namespace

std::vector<std::string> contents_faults(const ShardContents& marker, const ShardContents& shard) {
  Comparison comparison;
  comparison.expect_rows("boxes", marker.boxes, shard.boxes);
  comparison.expect_rows("persons", marker.persons, shard.persons);
  comparison.expect("boxes by class", marker.classes, shard.classes);
  comparison.expect("samples by gap", marker.gaps, shard.gaps);
  comparison.expect("optional columns", marker.optional_columns, shard.optional_columns);
  return comparison.take();
}

namespace {

/// Whether the marker lists just these samples, whose reasons only it has.
bool are_quarantined(const ShardMarker& marker, const std::vector<QuarantinedSample>& invalid) {
  std::vector<QuarantinedSample> recorded = marker.quarantined;
  for (QuarantinedSample& sample : recorded) sample.reason.clear();
  return std::is_permutation(recorded.begin(), recorded.end(), invalid.begin(), invalid.end());
}

class Check {
 public:
  Check(const std::filesystem::path& path, const ShardMarker& marker)
      : path_(path), marker_(marker) {}

  std::vector<std::string> run() {
    // A file with other bytes is not looked into: HDF5 does not promise to survive that.
    if (!same_bytes()) return faults_;
    const ShardReader reader(path_);
    check_header(reader.header());
    std::vector<QuarantinedSample> invalid;
    for (int slot = 0; slot < reader.header().sample_count; ++slot) {
      const ShardSample sample = reader.sample(slot);
      if (!sample.valid) invalid.push_back({slot, sample.sample_id, ""});
      check_sample(reader, slot, sample);
    }
    check_quarantined(invalid);
    for (const std::string& found : contents_faults(marker_.contents, reader.contents())) {
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
    expect("file name", marker_.shard, path_.filename().string());
    std::error_code error;
    const auto size = std::filesystem::file_size(path_, error);
    if (error) {
      fault("cannot read: " + error.message());
    } else if (static_cast<std::int64_t>(size) != marker_.size_bytes) {
      expect("size in bytes", marker_.size_bytes, static_cast<std::int64_t>(size));
    } else {
      expect("SHA-256", marker_.sha256, sha256_of_file(path_));
    }
    return faults_.empty();
  }

  void check_header(const ShardHeader& header) {
    expect("name", marker_.shard, header.name);
    expect("plan hash", marker_.plan_hash, header.plan_hash);
    expect("number of samples", marker_.samples, header.sample_count);
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
    for (const std::string& found : label_faults(reader.header(), sample)) fault(found + where);
  }

  void check_quarantined(const std::vector<QuarantinedSample>& invalid) {
    const int samples = marker_.samples;
    expect("number of valid samples", marker_.valid, samples - static_cast<int>(invalid.size()));
    if (!are_quarantined(marker_, invalid)) {
      fault(
          "expected the samples with valid = 0 to be those that the commit record lists, got "
          "others");
    }
  }

  const std::filesystem::path& path_;
  const ShardMarker& marker_;
  std::vector<std::string> faults_;
};

}  // namespace

std::vector<std::string> check_shard(const std::filesystem::path& shard,
                                     const ShardMarker& marker) {
  Check check(shard, marker);
  try {
    return check.run();
  } catch (const std::exception& error) {
    return check.stopped_by(error);
  }
}

std::vector<std::string> count_faults(const std::filesystem::path& shard,
                                      const ShardMarker& marker) {
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
  if (!are_quarantined(marker, invalid)) {
    faults.push_back("expected the " + std::to_string(invalid.size()) +
                     " samples with valid = 0 as quarantined, got others");
  }
  for (std::string& fault : contents_faults(contents_of(tables, header), marker.contents)) {
    faults.push_back(std::move(fault));
  }
  return faults;
}

}  // namespace eventgan
