#include "pipeline/conversion/retry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/dataset/finalize.h"
#include "pipeline/dataset/verify_folder.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/planning/make_plan.h"
#include "stages/shards/shard_reader.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/image_file.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::texts_with;
namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// 12 frames, so 11 pairs in shards of 4, 4 and 3; pair k is of the frames k and k + 1.
class Retry : public ::testing::Test {
 protected:
  Retry() : manifest_(testing::make_small_job(folder_, 12)) {
    manifest_.errors = {ErrorPolicy::kQuarantine, 100, 1.0};
  }

  fs::path image(int frame) const {
    return folder_ / "clip" / ("f_" + std::to_string(10 + frame) + ".png");
  }
  void spoil(int frame) const { testing::write_file(image(frame), "not an image"); }
  void mend(int frame) const { testing::write_flat_image(image(frame), {20, 30}, 20 * frame); }

  ConversionReport run(const std::string& output = "out") {
    ConversionOptions options;
    options.output = folder_ / output;
    options.threads = 2;
    return convert(manifest_, generator_, "weights", options);
  }
  std::optional<RetryReport> look() {
    return nothing_to_retry(out_, read_frozen_outline(out_), manifest_, options_);
  }
  RetryReport again() { return retry(out_, manifest_, generator_, "weights", options_); }

  std::map<std::string, std::string> shards(const std::string& output) const {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : fs::directory_iterator(folder_ / output)) {
      if (entry.path().extension() == ".h5")
        bytes[entry.path().filename()] = testing::read_file(entry.path());
    }
    return bytes;
  }

  /// Sample ids and volumes are those of a fresh run; plan hashes differ if images had other
  /// sizes.
  void expect_sound() const {
    EXPECT_THAT(verify_folder(out_, {.deep = true, .manifest = {}}).faults, IsEmpty());
  }

  void expect_sound_after_finalize() const {
    EXPECT_TRUE(finalize(out_, {}).written);
    expect_sound();
  }

  testing::TemporaryFolder folder_;
  const fs::path out_ = folder_ / "out";
  JobManifest manifest_;
  testing::FakeGenerator generator_;
  RunOptions options_{.threads = 2, .grace_s = 20, .since_stop_request = {}, .make_progress = {}};
};

TEST_F(Retry, RedoesOnlyWhatWasQuarantined) {
  spoil(5);  // pairs 4 and 5: slots 0 and 1 of the second shard
  ASSERT_EQ(run().quarantined.size(), 2u);
  const auto before = shards("out");
  const int calls = generator_.calls();
  mend(5);
  const RetryReport report = again();
  EXPECT_EQ(report.tried, 2);
  EXPECT_EQ(report.mended, 2);
  EXPECT_THAT(report.failed, IsEmpty());
  EXPECT_EQ(report.quarantined, 0);
  EXPECT_EQ(report.planned, 11);
  EXPECT_EQ(report.shards_rewritten, 1);
  EXPECT_FALSE(report.too_many_faults);
  EXPECT_EQ(generator_.calls(), calls + 2);
  const auto after = shards("out");
  EXPECT_EQ(after.at("job-train-00000-of-00003.h5"), before.at("job-train-00000-of-00003.h5"));
  EXPECT_NE(after.at("job-train-00001-of-00003.h5"), before.at("job-train-00001-of-00003.h5"));
  EXPECT_EQ(after.at("job-train-00002-of-00003.h5"), before.at("job-train-00002-of-00003.h5"));
  expect_sound();

  run("fresh");  // of mended inputs
  for (int slot = 0; slot < 4; ++slot) {
    const ShardReader mended(out_ / "job-train-00001-of-00003.h5");
    const ShardReader fresh(folder_ / "fresh/job-train-00001-of-00003.h5");
    EXPECT_EQ(mended.stored_chunk(slot), fresh.stored_chunk(slot));
    EXPECT_EQ(mended.sample(slot).pair.next.path, fresh.sample(slot).pair.next.path);
  }
}

TEST_F(Retry, AGoodSampleStaysThoughItsFramesAreGone) {
  spoil(5);  // pairs 4 and 5: slots 0 and 1 of the second shard
  run();
  const fs::path shard = out_ / "job-train-00001-of-00003.h5";
  const std::vector<std::byte> before = ShardReader(shard).stored_chunk(2);
  mend(5);
  spoil(7);  // of pairs 6 and 7: slots 2 and 3
  const RetryReport report = again();
  EXPECT_EQ(report.mended, 2);
  EXPECT_EQ(report.quarantined, 0);
  const ShardReader after(shard);
  EXPECT_EQ(after.stored_chunk(2), before);
  for (int slot = 0; slot < 4; ++slot) EXPECT_TRUE(after.sample(slot).valid) << slot;
}

TEST_F(Retry, AFileOfTheSameSizeGivesTheShardsOfAFreshRun) {
  // An image whose bytes are wrong and whose size is right: the plan is the same, so all is.
  std::string bytes = testing::read_file(image(5));
  const std::string sound = bytes;
  bytes.replace(8, 8, "damaged!");
  testing::write_file(image(5), bytes);
  ASSERT_EQ(run().quarantined.size(), 2u);
  testing::write_file(image(5), sound);
  EXPECT_EQ(again().mended, 2);
  EXPECT_FALSE(fs::exists(out_ / "amendments.json"));
  run("fresh");
  EXPECT_EQ(shards("out"), shards("fresh"));
}

TEST_F(Retry, AMissingFrameThatWasAddedIsMended) {
  fs::remove(image(5));
  const ConversionReport first = run();
  // The labelled frame itself is gone with its image; the pair of the one after it lacks a frame.
  ASSERT_EQ(first.quarantined.size(), 1u);
  mend(5);
  const RetryReport report = again();
  EXPECT_EQ(report.mended, 1);
  EXPECT_EQ(report.quarantined, 0);
  expect_sound();

  // Made again by convert, the shards have the same bytes.
  const auto mended = shards("out");
  for (const auto& [name, bytes] : mended) fs::remove(out_ / name);
  EXPECT_TRUE(run().complete());
  EXPECT_TRUE(shards("out") == mended);
}

TEST_F(Retry, LaterRunsAcceptTheMendedInputs) {
  spoil(5);
  run();
  mend(5);
  EXPECT_THROWS(run(), UsageError, "plan.json was frozen by a run") << "inputs have changed";
  again();
  const auto amendments = read_amendments(out_, read_frozen_plan(out_).hash);
  ASSERT_EQ(amendments.size(), 1u);
  EXPECT_EQ(amendments[0].samples.size(), 2u);
  EXPECT_THAT(amendments[0].fields, ElementsAre(::testing::Key("frames")));
  const auto mended = shards("out");
  const int calls = generator_.calls();
  EXPECT_TRUE(run().complete());
  EXPECT_EQ(generator_.calls(), calls);
  EXPECT_EQ(shards("out"), mended);
}

TEST_F(Retry, WhatStillFailsKeepsItsSlotAndTouchesNothing) {
  spoil(5);
  const ConversionReport first = run();
  const auto before = shards("out");
  const RetryReport report = again();
  EXPECT_EQ(report.tried, 2);
  EXPECT_EQ(report.mended, 0);
  EXPECT_EQ(report.shards_rewritten, 0);
  EXPECT_EQ(report.quarantined, 2);
  ASSERT_EQ(report.failed.size(), 2u);
  EXPECT_EQ(report.failed[0].shard, "job-train-00001-of-00003.h5");
  EXPECT_EQ(report.failed[0].slot, 0);
  EXPECT_EQ(report.failed[0].reason, first.quarantined[0].reason);
  EXPECT_EQ(shards("out"), before);
}

TEST_F(Retry, SomeMendedAndSomeNot) {
  spoil(5);
  spoil(9);  // pairs 8 and 9 of the last shard
  ASSERT_EQ(run().quarantined.size(), 4u);
  mend(9);
  manifest_.errors = {ErrorPolicy::kQuarantine, 1, 1.0};
  RetryReport report = again();
  EXPECT_EQ(report.tried, 4);
  EXPECT_EQ(report.mended, 2);
  EXPECT_EQ(report.quarantined, 2);
  EXPECT_EQ(report.shards_rewritten, 1);
  EXPECT_TRUE(report.too_many_faults) << "two are left, one is allowed";
  expect_sound();
  mend(5);
  report = again();
  EXPECT_EQ(report.tried, 2);
  EXPECT_FALSE(report.too_many_faults);
  EXPECT_EQ(read_amendments(out_, read_frozen_plan(out_).hash).size(), 2u);
  expect_sound();
}

TEST_F(Retry, NothingToDoIsSaid) {
  run();
  const auto nothing = look();
  ASSERT_TRUE(nothing);
  EXPECT_THAT(nothing->changed_inputs, IsEmpty());
  EXPECT_EQ(nothing->planned, 11);
  EXPECT_EQ(nothing->quarantined, 0);
  const RetryReport report = again();
  EXPECT_EQ(report.tried, 0);
  EXPECT_FALSE(fs::exists(out_ / "amendments.json"));
}

TEST_F(Retry, ChangedInputsAreRecordedWhereNothingIsQuarantined) {
  manifest_.errors = {ErrorPolicy::kFail, 0, 0};
  spoil(5);
  EXPECT_THROWS(run(), TooManyFaults, "errors.policy is \"fail\": expected an image (JPEG, PNG");
  mend(5);
  EXPECT_THROWS(run(), UsageError, "plan.json was frozen by a run") << "inputs have changed";
  const auto nothing = look();
  ASSERT_TRUE(nothing);
  EXPECT_THAT(nothing->changed_inputs, ElementsAre("frames"));
  EXPECT_EQ(nothing->tried, 0);
  EXPECT_TRUE(run().complete());
  expect_sound();
  EXPECT_THAT(look()->changed_inputs, IsEmpty()) << "once";
}

TEST_F(Retry, ChangedInputsOfAPlanThatWasOnlyFrozenAreRecorded) {
  fs::create_directories(out_);
  freeze_plan(out_, make_plan(manifest_, "weights", generator_.description()).plan);
  record_manifest_folder(out_, manifest_);
  spoil(5);
  EXPECT_THROWS(run(), UsageError, "plan.json was frozen by a run");
  ASSERT_TRUE(look());
  EXPECT_EQ(run().quarantined.size(), 2u);
  EXPECT_FALSE(look()) << "samples to redo";
}

TEST_F(Retry, AMissingFrameThatWasAddedBeforeItsShardWasMadeIsConverted) {
  manifest_.errors = {ErrorPolicy::kFail, 0, 0};
  fs::remove(image(5));
  EXPECT_THROWS(run(), TooManyFaults, "errors.policy is \"fail\": expected a frame, got no file");
  mend(5);
  EXPECT_THROWS(run(), UsageError, "plan.json was frozen by a run") << "inputs have changed";
  ASSERT_TRUE(look());
  const ConversionReport report = run();
  EXPECT_TRUE(report.complete());
  EXPECT_THAT(report.quarantined, IsEmpty());
  expect_sound();
}

TEST_F(Retry, NothingIsRecordedForAnotherJob) {
  run();
  spoil(5);
  manifest_.text.replace(manifest_.text.find("untrained:1"), 11, "untrained:2");
  EXPECT_THROWS(look(), UsageError, "expected the job of");
  EXPECT_FALSE(fs::exists(out_ / "amendments.json"));
}

TEST_F(Retry, MendsASourceOfWhichNoSizeWasKnown) {
  for (int frame = 0; frame < 12; ++frame) spoil(frame);
  const ConversionReport first = run();
  EXPECT_EQ(first.quarantined.size(), 11u);
  EXPECT_THAT(first.notes, texts_with({"11 samples without a readable image"}));
  finalize(out_, {});
  for (int frame = 0; frame < 6; ++frame) mend(frame);
  for (int frame = 6; frame < 12; ++frame) {
    testing::write_flat_image(image(frame), {40, 50}, 20 * frame);
  }
  RetryReport report = again();
  // The pair of the frames 5 and 6 is of two sizes, and never a pair.
  EXPECT_EQ(report.mended, 10);
  EXPECT_EQ(report.quarantined, 1);
  expect_sound_after_finalize();
  const FrozenOutline frozen = read_frozen_outline(out_);
  const DatasetParts parts = read_dataset_parts(
      out_, frozen, scan_shards(out_, frozen.plan.shards, frozen.hash, ScanDepth::kRows));
  std::map<int, int> heights;
  for (const ShardState& shard : parts.done) {
    heights[shard.outline.volume_size.height] += shard.record->valid;
  }
  EXPECT_EQ(heights, (std::map<int, int>{{20, 5}, {40, 5}}));

  // Made again by convert, a shard has the same bytes.
  fs::remove(out_ / "dataset.h5");
  const auto mended = shards("out");
  for (const auto& [name, bytes] : mended) fs::remove(out_ / name);
  EXPECT_TRUE(run().complete());
  EXPECT_TRUE(shards("out") == mended);
}

TEST_F(Retry, AnImageOfUnknownSizeMendedWithinItsBytesIsTaken) {
  const std::string sound = testing::read_file(image(5));
  const std::string next = testing::read_file(image(6));
  testing::write_file(image(5), std::string(sound.size(), '?'));
  testing::write_file(image(6), std::string(next.size(), '?'));
  ASSERT_EQ(run().quarantined.size(), 3u);  // pairs 4, 5 and 6
  testing::write_file(image(5), sound);
  testing::write_file(image(6), next);
  EXPECT_THROWS(run(), UsageError, "`eventgan retry` accepts them");
  EXPECT_EQ(again().mended, 3);
  EXPECT_TRUE(run().complete());
  expect_sound_after_finalize();
}

TEST_F(Retry, IsRefusedForAnotherJobWithoutTouchingAnything) {
  spoil(5);
  run();
  mend(5);
  const auto before = shards("out");
  EXPECT_THROWS(retry(out_, manifest_, generator_, "other weights", options_), UsageError,
                "weights: expected weights, got other weights");
  EXPECT_FALSE(fs::exists(out_ / "amendments.json"));
  EXPECT_EQ(shards("out"), before);
}

TEST_F(Retry, NeedsAPlan) {
  EXPECT_THROWS(again(), InputError, "expected a folder that eventgan convert has written, got no");
}

TEST_F(Retry, LeavesDamagedAndMissingShardsToConvert) {
  spoil(1);  // pairs 0 and 1 of the first shard
  spoil(5);
  run();
  mend(1);
  mend(5);
  std::string bytes = testing::read_file(out_ / "job-train-00001-of-00003.h5");
  bytes[bytes.size() / 2] ^= 1;
  testing::write_file(out_ / "job-train-00001-of-00003.h5", bytes);
  fs::remove(out_ / "job-train-00002-of-00003.h5");
  fs::remove(out_ / "job-train-00002-of-00003.json");
  const RetryReport report = again();
  EXPECT_EQ(report.tried, 2);
  EXPECT_EQ(report.mended, 2);
  EXPECT_EQ(report.quarantined, 0);
  EXPECT_EQ(report.shards_missing, 1);
  EXPECT_THAT(report.damaged_shards, texts_with({"job-train-00001-of-00003.h5"}));
  EXPECT_EQ(testing::read_file(out_ / "job-train-00001-of-00003.h5"), bytes);
  EXPECT_TRUE(run().complete());
  expect_sound();
}

TEST_F(Retry, KilledBetweenShardAndCommitRecordCostsConvertNothing) {
  spoil(5);
  run();
  mend(5);
  const std::string name = "job-train-00001-of-00003";
  const auto before = shards("out");
  const std::string record = testing::read_file(out_ / (name + ".json"));
  again();
  // The shard is the new one, the commit record the old one, the old shard left under a dead one's
  // name.
  const pid_t dead = ::fork();
  if (dead == 0) ::_exit(0);
  ::waitpid(dead, nullptr, 0);
  testing::write_file(out_ / (name + ".json"), record);
  testing::write_file(out_ / to_string(TemporaryName{name + ".h5", host_name(), dead, 0}),
                      before.at(name + ".h5"));
  const ConversionReport report = run();
  EXPECT_EQ(report.shards_done_before, 3);
  EXPECT_EQ(report.quarantined.size(), 2u);
  EXPECT_EQ(shards("out"), before);
  EXPECT_EQ(again().mended, 2);
  expect_sound();
}

TEST_F(Retry, ARequestToStopStartsNoShard) {
  spoil(5);
  run();
  mend(5);
  const auto before = shards("out");
  std::atomic<bool> asked = false;
  options_.since_stop_request = [&] { return asked ? std::optional(1.0) : std::nullopt; };
  options_.make_progress = [&](std::int64_t) {
    asked = true;
    return nullptr;
  };
  const RetryReport report = again();
  EXPECT_TRUE(report.stopped);
  EXPECT_EQ(report.tried, 0);
  EXPECT_EQ(report.quarantined, 2);
  EXPECT_EQ(shards("out"), before);
  EXPECT_THROWS(
      again(), Stopped,
      "stopped while planning; nothing was written: run again");  // asked before it has planned
  EXPECT_EQ(shards("out"), before);
  options_ = {.threads = 2, .grace_s = 20, .since_stop_request = {}, .make_progress = {}};
  EXPECT_EQ(again().mended, 2);
}

TEST_F(Retry, ARequestToStopAmongNewNamesOfClassesIsNoEnd) {
  const auto write_table = [&](const std::string& last) {
    std::string rows = "image,class,left,top,right,bottom\n";
    for (int i = 0; i < 12; ++i) {
      rows += "f_" + std::to_string(10 + i) + ".png," + (i == 11 ? last : "car") + ",1,1,9,9\n";
    }
    testing::write_file(folder_ / "boxes.csv", rows);
  };
  const auto names_in = [&](int shard) {
    const auto name = "job-train-0000" + std::to_string(shard) + "-of-00003.h5";
    return ShardReader(out_ / name).header().label_schema.class_names;
  };
  write_table("car");
  manifest_.sources[0].labels = {LabelFormat::kCsv, "boxes.csv"};
  ASSERT_TRUE(run().complete());
  write_table("bike");
  const std::string first_named = "job-train-00002-of-00003.h5";
  const std::string before = shards("out").at(first_named);
  options_.since_stop_request = [&] {
    const bool is_named = testing::read_file(out_ / first_named) != before;
    return is_named ? std::optional(1.0) : std::nullopt;
  };
  RetryReport report = again();
  EXPECT_TRUE(report.stopped);
  EXPECT_EQ(report.shards_renamed, 1);
  EXPECT_THAT(to_text(report), HasSubstr("run again"));

  // One that is damaged keeps its names, which is told.
  std::string bytes = testing::read_file(out_ / "job-train-00001-of-00003.h5");
  bytes[bytes.size() / 2] ^= 1;
  testing::write_file(out_ / "job-train-00001-of-00003.h5", bytes);
  options_.since_stop_request = {};
  report = again();
  EXPECT_FALSE(report.stopped);
  EXPECT_EQ(report.shards_renamed, 1);
  EXPECT_THAT(report.damaged_shards, texts_with({"job-train-00001-of-00003.h5"}));
  EXPECT_TRUE(run().complete());
  for (const int shard : {0, 1, 2}) EXPECT_THAT(names_in(shard), ElementsAre("car", "bike"));
}

TEST_F(Retry, OfTwoAtOnceTheSecondIsRefused) {
  spoil(5);
  run();
  mend(5);
  const RunOptions others = options_;
  options_.make_progress = [&](std::int64_t) {
    EXPECT_THROWS(retry(out_, manifest_, generator_, "weights", others), std::runtime_error,
                  "without another retry", out_.string());
    return nullptr;
  };
  EXPECT_EQ(again().mended, 2);
  expect_sound();
}

/// Where the file system knows no locks, another retry may get between the first look and the work.
TEST_F(Retry, WhatAnotherHasMendedMeanwhileStays) {
  spoil(1);  // pairs 0 and 1, of the first shard
  spoil(5);  // of the second
  run();
  mend(1);
  mend(5);
  fs::copy(out_, folder_ / "other", fs::copy_options::recursive);
  EXPECT_EQ(retry(folder_ / "other", manifest_, generator_, "weights", options_).mended, 4);
  std::atomic<bool> is_first = true;
  options_.since_stop_request = [&]() -> std::optional<double> {
    if (is_first.exchange(false)) {
      for (const char* name : {"job-train-00000-of-00003.h5", "job-train-00000-of-00003.json"}) {
        fs::copy(folder_ / "other" / name, out_ / name, fs::copy_options::overwrite_existing);
      }
    }
    return std::nullopt;
  };
  const RetryReport report = again();
  EXPECT_EQ(report.mended, 2);
  EXPECT_EQ(report.quarantined, 0);
  EXPECT_EQ(report.shards_rewritten, 1);
  EXPECT_EQ(shards("out"), shards("other"));
  expect_sound();
}

TEST_F(Retry, ShowsProgress) {
  spoil(5);
  run();
  std::ostringstream shown;
  options_.make_progress = [&](std::int64_t total) {
    EXPECT_EQ(total, 2);
    return std::make_unique<Progress>(shown, ProgressStyle::kLines, nullptr, total);
  };
  again();
  EXPECT_THAT(shown.str(), HasSubstr("2/2 pairs"));
}

}  // namespace
}  // namespace eventgan
