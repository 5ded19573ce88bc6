#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "pipeline/conversion/convert.h"
#include "tests/pipeline/conversion/small_conversion.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::texts_with;

/// 11 pairs in 6 shards; "whole" holds what one worker makes of them.
class ConvertParts : public testing::SmallConversion {
 protected:
  ConvertParts() {
    change(R"("samples_per_shard": 4)", R"("samples_per_shard": 2)");
    run("whole");
  }

  ConversionReport run_part(int index, int count, const std::string& output = "out") const {
    ConversionOptions part = options(output);
    part.part = {index, count, "--shards"};
    return run(part);
  }
};

TEST_F(ConvertParts, OneOfOneIsEverything) {
  EXPECT_TRUE(run_part(0, 1).complete());
  EXPECT_EQ(shards(), shards("whole"));
}

TEST_F(ConvertParts, AnySplitGivesTheSameFolder) {
  for (const int count : {4, 7, 1000}) {
    const std::string output = std::to_string(count);
    std::int64_t written = 0;
    int done = 0;
    for (int index = std::min(count, 8) - 1; index >= 0; --index) {
      const ConversionReport report = run_part(index, count, output);
      EXPECT_TRUE(report.complete());
      EXPECT_EQ(report.shards_done_before, 0);
      written += report.written;
      done += report.shards_done;
    }
    EXPECT_EQ(written, 11) << count;
    EXPECT_EQ(done, 6) << count;
    EXPECT_EQ(shards(output), shards("whole")) << count;
    EXPECT_EQ(testing::read_file(out("plan.json", output)),
              testing::read_file(out("plan.json", "whole")));
  }
}

TEST_F(ConvertParts, OverlappingPartsShareTheWork) {
  run_part(1, 3);  // shards 1 and 4
  const int calls = generator_.calls();
  const ConversionReport report = run_part(0, 2);  // 0, 2 and 4
  EXPECT_EQ(report.shards_planned, 3);
  EXPECT_EQ(report.shards_done_before, 1);
  EXPECT_EQ(generator_.calls(), calls + 4);
}

TEST_F(ConvertParts, WithoutACountTheIndexIsAShard) {
  const ConversionReport report = run_part(5, 0);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.planned, 1);  // the last shard has one pair
  EXPECT_EQ(report.plan_pairs, 11);
  EXPECT_EQ(report.plan_shards, 6);
  EXPECT_EQ(shards().size(), 1u);
}

TEST_F(ConvertParts, APartBeyondThePlanHasNothingToDo) {
  ConversionOptions beyond = options();
  beyond.part = {7, 10, "--shards"};
  std::vector<std::string> notes;
  beyond.note = [&](const std::string& text) { notes.push_back(text); };
  const ConversionReport report = run(beyond);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.planned, 0);
  EXPECT_THAT(notes, ::testing::ElementsAre("part 7 of 10 (--shards): nothing to do, it has none "
                                            "of the plan's 6 shards"));
}

TEST_F(ConvertParts, SaysWhichPartUnlessItIsEverything) {
  std::vector<std::string> notes;
  ConversionOptions noted = options();
  noted.note = [&](const std::string& text) { notes.push_back(text); };
  run(noted);
  EXPECT_THAT(notes, ::testing::IsEmpty());
  noted.part = {1, 4, "--shards"};
  const ConversionReport report = run(noted);
  EXPECT_THAT(notes,
              ::testing::ElementsAre("part 1 of 4 (--shards): 2 of the plan's 6 shards, 3 pairs"));
  EXPECT_THAT(to_text(report),
              ::testing::StartsWith("part 1 of 4 (--shards): 3 of 3 pairs written, 0 quarantined, "
                                    "in 2 of 2 shards (2 done before)"));
}

TEST_F(ConvertParts, WhatIsQuarantinedElsewhereCountsForTheLimits) {
  testing::write_file(image(0), "not an image");  // spoils the first pair
  testing::write_file(image(11), "nor this");     // and the last
  manifest_.errors = {ErrorPolicy::kQuarantine, 1, 1.0};
  EXPECT_FALSE(run_part(0, 6).too_many_faults);
  const ConversionReport report = run_part(5, 6);
  EXPECT_TRUE(report.too_many_faults);
  EXPECT_EQ(report.quarantined.size(), 1u);
  EXPECT_EQ(report.quarantined_in_plan(), 2);
  manifest_.errors.max_count = 2;
  EXPECT_FALSE(run_part(5, 6).too_many_faults);
}

TEST_F(ConvertParts, OverwritingIsNotForAPart) {
  run_part(0, 6);
  ConversionOptions overwriting = options();
  overwriting.overwrite = true;
  overwriting.part = {1, 6, "SLURM_ARRAY_TASK_ID"};
  EXPECT_THROWS(run(overwriting), UsageError, "SLURM_ARRAY_TASK_ID");
  EXPECT_EQ(shards().size(), 1u);
}

TEST_F(ConvertParts, WhatAnotherWorkerFinishesMeanwhileIsTaken) {
  ConversionOptions shared = options();
  std::ostringstream shown;
  shared.make_progress = [&](std::int64_t total) {
    for (const char* file : {"job-train-00002-of-00006.h5", "job-train-00002-of-00006.json"}) {
      std::filesystem::copy_file(out(file, "whole"), out(file));
    }
    return std::make_unique<Progress>(shown, ProgressStyle::kLines, nullptr, total);
  };
  const int calls = generator_.calls();
  const ConversionReport report = run(shared);
  EXPECT_EQ(generator_.calls(), calls + 9);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.shards_done_by_others, 1);
  EXPECT_EQ(report.written, 11);
  EXPECT_THAT(shown.str(), ::testing::HasSubstr("9/9 pairs"));
  EXPECT_THAT(to_text(report), ::testing::HasSubstr("(1 done by others)"));
}

TEST_F(ConvertParts, WhatAnotherWorkerFinishesWhileItIsMadeHereTooIsTaken) {
  const std::string shard = "job-train-00000-of-00006";
  ConversionOptions shared = options("out", /*threads=*/1);  // so that it is asked between writes
  // Asked before each sample is written. Takes the unfinished shard and its claim away, as a worker
  // does that takes this one for dead, and makes the shard in its place.
  std::mutex asked;  // by several threads
  bool is_taken = false;
  shared.since_stop_request = [&]() -> std::optional<double> {
    const std::lock_guard lock(asked);
    if (is_taken || !std::filesystem::exists(out(""))) return std::nullopt;
    std::vector<UnfinishedFile> files = unfinished_files(out(""));
    std::erase_if(files, [&](const auto& file) { return file.name.target != shard + ".h5"; });
    if (files.size() < 2) return std::nullopt;
    is_taken = true;
    for (const char* extension : {".h5", ".json"}) {
      std::filesystem::copy_file(out(shard + extension, "whole"), out(shard + extension));
    }
    for (const UnfinishedFile& file : files) std::filesystem::remove(file.path);
    return std::nullopt;
  };
  const ConversionReport report = run(shared);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.shards_done_by_others, 1);
  EXPECT_EQ(report.written, 11);
  EXPECT_EQ(shards(), shards("whole"));
}

/// Deletes a file whenever it is asked for a volume, as a person might who tidies up.
class Deleting final : public Generator {
 public:
  Deleting(const Generator& generator, std::filesystem::path file)
      : generator_(generator), file_(std::move(file)) {}

  int bins() const override { return generator_.bins(); }
  std::string description() const override { return generator_.description(); }
  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    std::filesystem::remove(file_);
    return generator_.generate(pair, volume);
  }

 private:
  const Generator& generator_;
  std::filesystem::path file_;
};

TEST_F(ConvertParts, IsNotCompleteIfAShardWentMissingMeanwhile) {
  run_part(0, 2);
  const std::filesystem::path first = out(shards().begin()->first);
  ConversionOptions rest = options();
  std::vector<std::string> warnings;
  rest.warn = [&](const std::string& text) { warnings.push_back(text); };
  const ConversionReport report = convert(manifest_, Deleting(generator_, first), "weights", rest);
  EXPECT_FALSE(report.complete());
  EXPECT_FALSE(report.stopped);
  EXPECT_THAT(report.lost, texts_with({first.string()}));
  EXPECT_THAT(warnings, texts_with({"run again"}));
  EXPECT_TRUE(run().complete());
  EXPECT_EQ(shards(), shards("whole"));
}

}  // namespace
}  // namespace eventgan
