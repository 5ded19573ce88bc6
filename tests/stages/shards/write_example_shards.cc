// write_example_shards FOLDER: writes shards for the tests that look at them from Python, and what
// was in them as JSON.
//
//   FOLDER/TYPE-LEVEL/demo-train-00000-of-00001.h5   the example shard, in every stored type, with
//   deflate 0, 1 and 9 FOLDER/unlabelled/demo-train-00000-of-00001.h5   the shard of a source
//   without labels ….json beside each                               its commit record
//   FOLDER/volumes.json the volumes as they were before they were stored; [] = none

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "manifests/documents/commit_record.h"
#include "manifests/files/atomic_file.h"
#include "tests/stages/shards/example_shard.h"

namespace eventgan::testing {
namespace {

void write_with_commit_record(const std::filesystem::path& folder, const ExampleShard& example) {
  std::filesystem::create_directories(folder);
  const CommitRecord record = write_shard(folder, example);
  write_file_atomically(folder / commit_record_name(record.shard), to_json(record));
}

void write_all(const std::filesystem::path& folder) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    for (const int level : {0, 1, 9}) {
      const std::string name = std::string(to_string(type)) + "-" + std::to_string(level);
      write_with_commit_record(folder / name, example_shard(type, level));
    }
  }
  write_with_commit_record(folder / "unlabelled", unlabelled_shard());
  write_file_atomically(folder / "volumes.json", nlohmann::json(example_shard().volumes).dump());
}

}  // namespace
}  // namespace eventgan::testing

int main(int, char** arguments) { eventgan::testing::write_all(arguments[1]); }
