#include "pipeline/folder/preview_shard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <functional>
#include <stdexcept>
#include <vector>

#include "manifests/documents/marker.h"
#include "manifests/values/faults.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/folder/shard_guard.h"
#include "stages/base/files/sha256.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class ReadGuarded : public ::testing::Test {
 protected:
  ReadGuarded() { testing::write_file(shard_, "bytes"); }

  void write_marker_of(const std::string& bytes) const {
    ShardMarker marker;
    marker.shard = shard_.filename().string();
    marker.plan_hash = std::string(64, 'a');
    marker.sha256 = sha256_hex(bytes);
    marker.size_bytes = static_cast<std::int64_t>(bytes.size());
    testing::write_file(folder_ / "job-00000-of-00001.json", to_json(marker));
  }

  /// Whether `read` runs in this very process.
  bool is_trusted() const {
    bool here = false;
    EXPECT_EQ(read_guarded(shard_, [&] { return here = true, 7; }), 7);
    return here;
  }

  void expect_damaged(const std::function<int()>& read, const std::string& why) const {
    EXPECT_THAT([&] { read_guarded(shard_, read); },
                ThrowsMessage<std::runtime_error>(
                    AllOf(HasSubstr("damaged"), HasSubstr(why), HasSubstr(shard_.string()))));
  }

  testing::TemporaryFolder folder_;
  const std::filesystem::path shard_ = folder_ / "job-00000-of-00001.h5";
};

TEST_F(ReadGuarded, WithItsMarkerBesideItTheBytesAreCompared) {
  write_marker_of("bytes");
  EXPECT_TRUE(is_trusted());
  write_marker_of("bytez");
  expect_damaged([]() -> int { throw std::logic_error("was read"); }, "SHA-256");
  write_marker_of("byte");
  expect_damaged([]() -> int { throw std::logic_error("was read"); }, "size in bytes 4");
}

TEST_F(ReadGuarded, WithoutAMarkerOfItsOwnItIsReadApart) {
  EXPECT_FALSE(is_trusted());
  testing::write_file(folder_ / "job-00000-of-00001.json", "{");
  EXPECT_FALSE(is_trusted());
  EXPECT_EQ(read_guarded(shard_, []() -> int { throw InputError("gone"); }), 66);
}

TEST_F(ReadGuarded, ACrashIsDamage) {
  expect_damaged([] { return ::raise(SIGSEGV); }, "Segmentation fault");
  expect_damaged([] { return ::raise(SIGABRT); }, "Aborted");
}

TEST_F(ReadGuarded, ALoopWithoutEndIsDamage) {
  expect_damaged(
      [] {
        const volatile bool for_ever = true;
        while (for_ever) {
        }
        return 0;
      },
      "10 s");
}

TEST_F(ReadGuarded, MoreMemoryThanThereIsIsDamage) {
  EXPECT_EQ(read_guarded(shard_,
                         [] {
                           const std::vector<char> most(std::size_t{1} << 46);
                           return static_cast<int>(most.back());
                         }),
            1);
}

TEST_F(ReadGuarded, OnlyARegularFileIsOpened) {
  const std::filesystem::path pipe = folder_ / "pipe.h5";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT([&] { read_guarded(pipe, [] { return 0; }); },
              ThrowsMessage<std::runtime_error>(HasSubstr(pipe.string())));
  bool here = false;  // what reads says that there is none
  read_guarded(folder_ / "none.h5", [&] { return here = true, 0; });
  EXPECT_TRUE(here);
}

TEST(ParseSlots, TakesNumbersAndRanges) {
  EXPECT_THAT(parse_slots("0,3-5", 8), ElementsAre(0, 3, 4, 5));
  EXPECT_THAT(parse_slots("5,1,4-5,1", 8), ElementsAre(1, 4, 5));
  EXPECT_THAT(parse_slots("7", 8), ElementsAre(7));
}

TEST(ParseSlots, RefusesWhatIsNoSlot) {
  for (const char* text :
       {"", ",", "1,", "8", "-1", "5-3", "1-", "a", "1 2", "0x1", "99999999999"}) {
    EXPECT_THROW(parse_slots(text, 8), UsageError) << text;
  }
  EXPECT_THROW(parse_slots("0", 0), UsageError);
}

TEST(SpreadSlots, SpreadsEvenlyFromTheFirst) {
  EXPECT_THAT(spread_slots(3, 9), ElementsAre(0, 3, 6));
  EXPECT_THAT(spread_slots(8, 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(spread_slots(8, 0), ElementsAre());
}

class PreviewShard : public ::testing::Test {
 protected:
  PreviewShard() {
    ConversionOptions options;
    options.output = folder_ / "out";
    options.threads = 1;
    convert(testing::make_small_job(folder_, 5), testing::FakeGenerator(), "weights", options);
  }

  std::vector<std::filesystem::path> draw(const std::string& samples, int count = 8) {
    PreviewOptions options;
    options.out = folder_ / "pictures";
    options.samples = samples;
    options.count = count;
    warnings_.clear();
    return preview_shard(folder_ / "out" / "job-train-00000-of-00001.h5", options, warnings_);
  }

  testing::TemporaryFolder folder_;
  std::vector<std::string> warnings_;
};

TEST_F(PreviewShard, WritesAPictureForEachChosenSlot) {
  const auto pictures = draw("1,3");
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(pictures[1].filename(), "job-train-00000-of-00001_0003.png");
  for (const auto& picture : pictures) EXPECT_GT(std::filesystem::file_size(picture), 100u);
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
  EXPECT_EQ(draw("", 2).size(), 2u);
}

TEST_F(PreviewShard, WarnsOfFramesThatAreGone) {
  std::filesystem::remove_all(folder_ / "clip");
  EXPECT_EQ(draw("0").size(), 1u);
  EXPECT_THAT(warnings_, ::testing::Each(::testing::HasSubstr("clip/f_1")));
  EXPECT_EQ(warnings_.size(), 2u);
}

TEST_F(PreviewShard, RefusesASlotThatIsNotThere) { EXPECT_THROW(draw("4"), UsageError); }

}  // namespace
}  // namespace eventgan
