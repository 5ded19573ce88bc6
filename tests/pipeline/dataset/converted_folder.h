#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/shard.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/folder/output_folder.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan::testing {

/// An output folder as convert leaves it, of a job "demo" with three sources of one dataset kind:
/// splits train, val and train; limits: three quarantined samples, half of all. The plan has four
/// shards:
///   0  demo-train-00000-of-00003.h5   source 0, the example's five samples, 8x6, one in quarantine
///   1  demo-val-00000-of-00001.h5     source 1, likewise
///   2  demo-train-00001-of-00003.h5   source 2, likewise
///   3  demo-train-00002-of-00003.h5   source 2, one sample without labels
/// of which `count` are in place.
class ConvertedFolder {
 public:
  explicit ConvertedFolder(int count = 4);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path shard(int number) const { return path_ / plan().shards[at(number)].name; }
  std::filesystem::path commit_record_file(int number) const;
  const Plan& plan() const { return frozen_.plan; }
  const std::string& plan_hash() const { return frozen_.hash; }

  /// Writes shard `number` of the plan, and its commit record after `change`.
  void add(int number, void (*change)(ExampleShard&) = nullptr);
  void write_commit_record(int number, const CommitRecord& record) const;
  CommitRecord record(int number) const;

 private:
  static std::size_t at(int number) { return static_cast<std::size_t>(number); }

  TemporaryFolder folder_;
  std::filesystem::path path_;
  FrozenPlan frozen_;
};

/// Its shards as `finalize` finds them.
DatasetParts parts_of(const ConvertedFolder& folder);

}  // namespace eventgan::testing
