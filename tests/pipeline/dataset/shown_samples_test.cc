#include "pipeline/dataset/shown_samples.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::ConvertedFolder;
using ::testing::ElementsAre;

/// Shard 0 with other ids: "4", "03", "4x", "-1" and "99" in its slots 0 to 4. Shards 1 and 2 have
/// "000000" to "000004", the last one "000001" alone.
class ShownSamples : public ::testing::Test {
 protected:
  ShownSamples() {
    folder_.add(0, [](testing::ExampleShard& example) {
      int slot = 0;
      for (const char* id : {"4", "03", "4x", "-1", "99"}) {
        example.samples.at(static_cast<std::size_t>(slot++)).sample_id = id;
      }
    });
  }

  /// Shard and slot of each.
  static std::vector<std::pair<std::size_t, int>> find(const std::filesystem::path& where,
                                                       const std::vector<std::string>& names) {
    std::vector<std::pair<std::size_t, int>> places;
    for (const ShownSample& sample : find_samples(find_shown_shards(where), names)) {
      places.emplace_back(sample.shard, sample.slot);
    }
    return places;
  }

  ConvertedFolder folder_;
};

using Place = std::pair<std::size_t, int>;

TEST_F(ShownSamples, ANameIsAnIdFirstAndThenASlotOfAShard) {
  EXPECT_THAT(find(folder_.shard(0), {"4"}), ElementsAre(Place{0, 0})) << "the id, not slot 4";
  EXPECT_THAT(find(folder_.shard(0), {"99"}), ElementsAre(Place{0, 4}));
  EXPECT_THAT(find(folder_.shard(0), {"-1"}), ElementsAre(Place{0, 3}));
  EXPECT_THAT(find(folder_.shard(0), {"3"}), ElementsAre(Place{0, 3})) << "no id, so the slot";
  EXPECT_THAT(find(folder_.shard(0), {"03"}), ElementsAre(Place{0, 1}));
  EXPECT_THAT(find(folder_.shard(1), {"4", "000004", "0"}), ElementsAre(Place{0, 0}, Place{0, 4}))
      << "each once";
  for (const char* name : {"5", "01", "004", "+1", "1 ", "", "1.0", "0x1", "99999999999"}) {
    EXPECT_THROWS(find(folder_.shard(1), {"000001", name}), UsageError, "slot in 0..4",
                  "\"" + std::string(name) + "\"", folder_.shard(1).string())
        << name;
  }
  EXPECT_THAT(find(folder_.path(), {"4"}), ElementsAre(Place{0, 0}));
  EXPECT_THAT(find(folder_.path() / "dataset.h5", {"000001", "4x"}),
              ElementsAre(Place{0, 2}, Place{1, 1}, Place{2, 1}, Place{3, 0}))
      << "every source's sample of that id";
  EXPECT_THROWS(find(folder_.path(), {"3"}), UsageError, "\"3\"", folder_.path().string());
}

}  // namespace
}  // namespace eventgan
