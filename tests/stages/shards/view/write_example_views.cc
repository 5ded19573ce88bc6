// write_example_views FOLDER: writes datasets for the tests that look at them from Python, each a
// folder with shards, their commit records and dataset.h5:
//
//   FOLDER/TYPE   the three shards of example_view.h in every stored type, as one view at the root
//   FOLDER/two    the same in float16, in group "demo", and a shard without labels in group "other"

#include <filesystem>
#include <string>

#include "tests/stages/shards/view/example_view.h"

namespace eventgan::testing {
namespace {

void write_all(const std::filesystem::path& folder) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    const std::filesystem::path one = folder / to_string(type);
    std::filesystem::create_directories(one);
    write_dataset_view(one / "dataset.h5", {write_example_view_shards(one, type)});
  }
  const std::filesystem::path two = folder / "two";
  std::filesystem::create_directories(two);
  write_dataset_view(two / "dataset.h5",
                     {write_example_view_shards(two, StoredType::kFloat16, "demo"),
                      write_unlabelled_view_shard(two, "other")});
}

}  // namespace
}  // namespace eventgan::testing

int main(int, char** arguments) { eventgan::testing::write_all(arguments[1]); }
