#include "pipeline/conversion/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "pipeline/dataset/verify_folder.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/runtime/memory.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_summary.h"
#include "tests/pipeline/conversion/small_conversion.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/image_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::texts_with;
namespace fs = std::filesystem;

using Convert = testing::SmallConversion;

TEST_F(Convert, WritesShardsCommitRecordsAndPlan) {
  const ConversionReport report = run();
  EXPECT_EQ(report.planned, 11);
  EXPECT_EQ(report.written, 11);
  EXPECT_TRUE(report.quarantined.empty());
  EXPECT_TRUE(report.complete());
  EXPECT_FALSE(report.too_many_faults);
  EXPECT_EQ(report.unpaired, 1);
  EXPECT_GT(report.stored_bytes, 0);
  EXPECT_EQ(report.stage_seconds.size(), 4u);
  EXPECT_THAT(names("out"),
              ::testing::ElementsAre("job-train-00000-of-00003.h5", "job-train-00000-of-00003.json",
                                     "job-train-00001-of-00003.h5", "job-train-00001-of-00003.json",
                                     "job-train-00002-of-00003.h5", "job-train-00002-of-00003.json",
                                     "plan.json", "run.json"));
  const FolderCheck check = verify_folder(folder_ / "out");
  EXPECT_THAT(check.faults, ::testing::IsEmpty());
  EXPECT_EQ(check.valid, 11);
}

TEST_F(Convert, SaysHowManyPairsAreTheSameImageTwice) {
  EXPECT_THAT(run("before").notes, ::testing::IsEmpty());
  for (const int frame : {1, 5, 6}) {
    fs::copy_file(image(frame - 1), image(frame), fs::copy_options::overwrite_existing);
  }
  EXPECT_THAT(run().notes,
              ::testing::ElementsAre("3 pairs of the same image twice: nothing moves there"));
}

TEST_F(Convert, SaysWhatLabelsLostInAllItsShardsWheneverTheyWereMade) {
  std::string rows = "image,class,left,top,right,bottom\n";
  for (int frame = 0; frame < 12; ++frame) {
    rows += image(frame).filename().string() + ",car,40,1,49,9\n";
  }
  testing::write_file(folder_ / "boxes.csv", rows);
  manifest_.sources[0].labels = {LabelFormat::kCsv, "boxes.csv"};
  manifest_.errors = {ErrorPolicy::kQuarantine, 0, 0};
  const std::vector<std::string> notes = run().notes;
  ASSERT_THAT(notes, ::testing::Contains(::testing::StartsWith("11 boxes of labels left out: ")));
  EXPECT_EQ(run().notes, notes);
  fs::remove(out("job-train-00000-of-00003.json"));
  const ConversionReport resumed = run();
  EXPECT_EQ(resumed.shards_done_before, 2);
  EXPECT_EQ(resumed.notes, notes);
}

TEST_F(Convert, GivesTheSameBytesForAnyNumberOfThreadsAndAgain) {
  run("one", 1);
  run("two", 2);
  run("again", 2);
  run("five", 5);
  ASSERT_EQ(shards("one").size(), 3u);
  EXPECT_EQ(shards("one"), shards("two"));
  EXPECT_EQ(shards("two"), shards("again"));
  EXPECT_EQ(shards("one"), shards("five"));
}

/// One thread: of several, two might open an image at the same moment.
TEST_F(Convert, OpensAnImageOnceToPlanAndOnceToDecode) {
  const auto opens = [&](const InputCounter& counter) {
    std::vector<std::uint64_t> of_images;
    for (int frame = 0; frame < 12; ++frame) of_images.push_back(counter.of(image(frame)).opens);
    return of_images;
  };
  // The first is no pair's next image, whose size counts; but its bits are looked at. It and the
  // last are opened once more: a picture of the program's own is no image.
  std::vector<std::uint64_t> expected(12, 2);
  expected.front() = expected.back() = 3;
  {
    const InputCounter counter;
    run("plain", 1);
    EXPECT_EQ(opens(counter), expected);
  }
  // Labels that are measured by their images.
  std::string images, boxes;
  for (int frame = 0; frame < 12; ++frame) {
    const std::string id = std::to_string(frame + 1);
    const std::string comma = frame == 0 ? "" : ", ";
    images += comma + R"({"file_name": ")" + image(frame).filename().string() + R"(", "id": )" +
              id + R"(, "width": 30, "height": 20})";
    boxes += comma + R"({"image_id": )" + id + R"(, "category_id": 1, "bbox": [1, 2, 3, 4]})";
  }
  testing::write_file(folder_ / "instances.json",
                      R"({"images": [)" + images + R"(], "annotations": [)" + boxes +
                          R"(], "categories": [{"id": 1, "name": "car"}]})");
  change(R"("root": "clip",)",
         R"("root": "clip", "labels": {"format": "coco", "path": "instances.json"},)");
  {
    const InputCounter counter;
    EXPECT_EQ(run("coco", 1).written, 11);
    EXPECT_EQ(opens(counter), expected);
    // Once for the labels, once for the plan's fingerprint.
    EXPECT_EQ(counter.of(folder_ / "instances.json").opens, 2u);
  }
  // Stills, each of which is both frames of its pair.
  change(R"("gaps": [1], "side": "before", "choose": "one")",
         R"("from": "stills", "motion": {"translation_px": [0, 2]}, "side": "before")");
  const InputCounter counter;
  EXPECT_EQ(run("stills", 1).written, 12);
  expected.front() = 4;
  EXPECT_EQ(opens(counter), expected);
}

TEST_F(Convert, OpensARecordingToRecogniseItAndReadsItOnce) {
  constexpr int kEvents = 20'000;
  std::string table = "t,x,y,p\n";
  for (int t_us = 0; t_us < kEvents; ++t_us) table += std::to_string(t_us) + ",3,2,1\n";
  testing::write_file(folder_ / "events.csv", table);
  manifest_ = parse_job_manifest(
      R"({"format": "eventgan-manifest", "version": 1, "name": "job", "seed": 1, "sources": [
          {"dataset": "recording", "root": "events.csv", "window_s": 0.001, "columns": {"unit": "us"},
           "sensor": {"width": 4, "height": 3}}], "image": {}, "generator": {"kind": "events"},
          "output": {"directory": "out", "samples_per_shard": 4}})",
      folder_.path(), "manifest.json");
  const LoadedGenerator loaded = load_generator(manifest_);
  const InputCounter counter;
  EXPECT_EQ(convert(manifest_, *loaded.generator, loaded.weights_hash, options()).written, 20);
  const InputCounter::Count count = counter.of(folder_ / "events.csv");
  EXPECT_EQ(count.opens, 2u);
  EXPECT_LE(static_cast<double>(count.bytes), 1.2 * static_cast<double>(table.size()));
}

TEST_F(Convert, SaysWhetherVolumesAreRatesOrEventsDrawnOfThem) {
  generator_.know({0.01, 0.04});
  const auto first_shard = [&](const std::string& folder) {
    run(folder);
    EXPECT_THAT(verify_folder(folder_ / folder).faults, ::testing::IsEmpty());
    return ShardReader(out("job-train-00000-of-00003.h5", folder));
  };
  const auto events_of = [](const ShardReader& shard) {
    return double(shard.sample(1).statistics.sum_positive);
  };
  const ShardReader drawn = first_shard("drawn");
  EXPECT_EQ(drawn.header().unit, VolumeUnit::kDrawn);
  EXPECT_NEAR(events_of(drawn), std::round(events_of(drawn)), 1e-2);
  change(R"("weights": "untrained:1")", R"("weights": "untrained:1", "sample": false)");
  const ShardReader rates = first_shard("rates");
  EXPECT_EQ(rates.header().unit, VolumeUnit::kRates);
  EXPECT_GT(events_of(rates), 0);
  // 20x30 pixels, each within 1 of its rates' sum.
  EXPECT_NEAR(events_of(drawn), events_of(rates), 5 * std::sqrt(600 / 4.0));
}

TEST_F(Convert, InBatchesGivesTheSameBytesForAnyNumberOfThreads) {
  const auto generator =
      make_batched_generator(load_weights(manifest_).weights, Precision::kFloat32, Device::kCpu);
  for (const int threads : {1, 3}) {
    const auto folder = std::to_string(threads);
    EXPECT_EQ(convert(manifest_, *generator, "weights", options(folder, threads)).written, 11);
  }
  EXPECT_EQ(shards("1"), shards("3"));
  EXPECT_THAT(verify_folder(folder_ / "3").faults, ::testing::IsEmpty());
}

TEST_F(Convert, WarnsOnceOfVolumesBeyondTheCalibration) {
  std::vector<std::string> warnings;
  ConversionOptions telling = options();
  telling.warn = [&](const std::string& text) { warnings.push_back(text); };
  generator_.saturate(0.25);
  run(telling);
  EXPECT_THAT(warnings,
              texts_with({"got 11 of 11 volumes with more than 0.05 % of them clipped, the worst "
                          "with 25 % ("}));
}

TEST_F(Convert, DoesNotDependOnTheOrderOfTheFileSystem) {
  run("before");
  // The same files under the same names, created in the opposite order.
  std::map<fs::path, std::string> files;
  for (int frame = 0; frame < 12; ++frame) files[image(frame)] = testing::read_file(image(frame));
  fs::remove_all(folder_ / "clip");
  for (auto file = files.rbegin(); file != files.rend(); ++file)
    testing::write_file(file->first, file->second);
  run("after");
  EXPECT_EQ(shards("before"), shards("after"));
}

TEST_F(Convert, AgainDoesOnlyWhatIsMissing) {
  run();
  const auto whole = shards("out");
  const int calls = generator_.calls();
  EXPECT_EQ(run().shards_done_before, 3);
  EXPECT_EQ(generator_.calls(), calls);
  fs::remove(folder_ / "out" / "job-train-00001-of-00003.json");  // not committed: made again
  const ConversionReport report = run();
  EXPECT_EQ(report.shards_done_before, 2);
  EXPECT_EQ(report.written, 11);
  EXPECT_EQ(generator_.calls(), calls + 4);
  EXPECT_EQ(shards("out"), whole);
}

TEST_F(Convert, LeavesAWholeFolderUntouched) {
  run();
  const auto written = [&] {
    std::map<std::string, fs::file_time_type> times;
    for (const std::string& name : names()) times[name] = fs::last_write_time(out(name));
    return times;
  };
  const auto before = written();
  std::vector<std::string> told;
  ConversionOptions listening = options();
  listening.note = listening.warn = [&](const std::string& text) { told.push_back(text); };
  run(listening);
  EXPECT_EQ(written(), before);
  EXPECT_THAT(told, ::testing::IsEmpty());

  testing::write_file(out("run.json"), R"({"manifest_folder": "not absolute"})");
  run(listening);
  EXPECT_THAT(told, texts_with({"run.json: the manifest is now"}));
  EXPECT_EQ(recorded_manifest_folder(folder_ / "out"), manifest_.directory);
}

TEST_F(Convert, RefusesAFolderOfAnotherPlanUnlessToldToOverwrite) {
  run();
  change(R"("samples_per_shard": 4)", R"("samples_per_shard": 11)");
  EXPECT_THROWS(run(), UsageError, "manifest $.output.samples_per_shard: expected 4, got 11");
  EXPECT_EQ(shards("out").size(), 3u);
  run("out", 2, /*overwrite=*/true);
  EXPECT_EQ(shards("out").size(), 1u);
  EXPECT_THAT(verify_folder(folder_ / "out").faults, ::testing::IsEmpty());
}

TEST_F(Convert, NeverOverwritesAnotherJob) {
  run();
  const auto whole = shards("out");
  const auto refused = ::testing::ThrowsMessage<UsageError>(
      ::testing::HasSubstr("choose another output folder, or remove that one yourself"));
  fs::copy(folder_ / "clip", folder_ / "second");
  for (const auto& [was, is] :
       {std::pair{R"("root": "clip")", R"("root": "second")"},
        std::pair{R"("root": "second")", R"("root": "clip", "split": "val")"},
        std::pair{R"("name": "job")", R"("name": "other")"}}) {
    change(was, is);
    for (const bool overwrite : {false, true}) {
      EXPECT_THAT([&] { run("out", 2, overwrite); }, refused) << is;
      EXPECT_EQ(shards("out"), whole) << is;
    }
  }
  ConversionOptions trial = options();
  trial.limit = 2;
  trial.overwrite = true;
  change(R"("name": "other")", R"("name": "job")");
  change(R"(, "split": "val")", "");
  EXPECT_THAT([&] { run(trial); }, refused);
  EXPECT_EQ(shards("out"), whole);
}

TEST_F(Convert, ACommentOrOtherLimitsDoNotMeanStartingOver) {
  run();
  const auto whole = shards("out");
  std::filesystem::remove(folder_ / "out" / "job-train-00001-of-00003.json");
  change("{", R"({ // a comment
    "errors": { "policy": "fail" },)");
  const ConversionReport report = run();
  EXPECT_EQ(report.shards_done_before, 2);
  EXPECT_EQ(shards("out"), whole);
}

TEST_F(Convert, RefusesAPlanThatSomeoneAltered) {
  run();
  std::string text = testing::read_file(folder_ / "out" / "plan.json");
  text.replace(text.find("f_10.png"), 8, "f_11.png");
  testing::write_file(folder_ / "out" / "plan.json", text);
  EXPECT_THROWS(run(), UsageError, "altered");
  testing::write_file(folder_ / "out" / "plan.json", text.substr(0, 60));
  EXPECT_THROWS(run(), std::runtime_error, "expected a whole plan, got a damaged one");
  EXPECT_EQ(run("out", 2, /*overwrite=*/true).written, 11);
}

TEST_F(Convert, QuarantinesWithinTheLimits) {
  // Spoils pairs (4, 5) and (5, 6): slots 4 and 5. The size, which the plan's hash tells, stays.
  const std::string sound = testing::read_file(image(5));
  testing::write_file(image(5), std::string(sound.size(), 'x'));
  manifest_.errors = {ErrorPolicy::kQuarantine, 2, 0.5};
  const ConversionReport report = run();
  EXPECT_FALSE(report.too_many_faults);
  EXPECT_EQ(report.written, 9);
  ASSERT_EQ(report.quarantined.size(), 2u);
  EXPECT_EQ(report.quarantined[0].slot, 0);  // of the second shard
  EXPECT_EQ(report.quarantined[1].slot, 1);
  EXPECT_THAT(report.quarantined[0].reason, ::testing::HasSubstr("clip/f_15.png"));
  EXPECT_THAT(verify_folder(folder_ / "out").faults, ::testing::IsEmpty());
  // The other shards are what they are without the fault.
  const auto damaged = shards("out");
  testing::write_file(image(5), sound);
  EXPECT_EQ(run("whole").written, 11);
  const auto whole = shards("whole");
  ASSERT_EQ(damaged.size(), 3u);
  ASSERT_EQ(whole.size(), 3u);
  for (const auto& [name, bytes] : whole) {
    EXPECT_EQ(damaged.at(name) == bytes, name != "job-train-00001-of-00003.h5") << name;
  }
}

TEST_F(Convert, BeyondTheLimitsFinishesTheShardAndStops) {
  testing::write_file(image(1), "");
  manifest_.errors = {ErrorPolicy::kQuarantine, 1, 1.0};
  const ConversionReport report = run();
  EXPECT_TRUE(report.too_many_faults);
  EXPECT_FALSE(report.complete());
  EXPECT_EQ(report.shards_done, 1);
  EXPECT_EQ(report.quarantined.size(), 2u);
  EXPECT_EQ(shards("out").size(), 1u);
  EXPECT_EQ(report.volume_bytes, 4 * 18 * 20 * 30 * 2);  // of the shard that was made
  const int calls = generator_.calls();
  EXPECT_TRUE(run().too_many_faults);  // and again, without doing more
  EXPECT_EQ(generator_.calls(), calls);
}

TEST_F(Convert, TheFractionIsOfTheWholePlan) {
  testing::write_file(image(1), "");  // of two pairs
  manifest_.errors = {ErrorPolicy::kQuarantine, 100, 2.0 / 11};
  EXPECT_FALSE(run("a").too_many_faults);
  manifest_.errors.max_fraction = 0.05;
  EXPECT_TRUE(run("b").too_many_faults);
}

TEST_F(Convert, PolicyFailEndsAtTheFirstFaultAndLeavesNoPartOfAShard) {
  testing::write_file(image(6), "");
  manifest_.errors.policy = ErrorPolicy::kFail;
  EXPECT_THROWS(run(), TooManyFaults, "clip/f_16.png");
  EXPECT_THAT(names("out"),
              ::testing::ElementsAre("job-train-00000-of-00003.h5", "job-train-00000-of-00003.json",
                                     "plan.json", "run.json"));
}

TEST_F(Convert, AVolumeThatIsNotFiniteIsQuarantined) {
  generator_.fail_on((20 * 3 / 255.0f - 0.5f) * 2);
  manifest_.errors.max_fraction = 1;
  const ConversionReport report = run();
  ASSERT_EQ(report.quarantined.size(), 1u);
  EXPECT_THAT(report.quarantined[0].reason, ::testing::HasSubstr("nan"));
}

TEST_F(Convert, AFolderThatCannotBeWrittenIsAnErrorThatNamesIt) {
  testing::write_file(folder_ / "file", "");
  EXPECT_THROWS(run("file/out"), std::runtime_error, (folder_ / "file/out").string());
}

TEST_F(Convert, ShowsProgressOfEveryPair) {
  std::ostringstream shown;
  ConversionOptions shows = options();
  shows.make_progress = [&](std::int64_t total) {
    EXPECT_EQ(total, 11);
    return std::make_unique<Progress>(shown, ProgressStyle::kLines, nullptr, total);
  };
  run(shows);
  EXPECT_THAT(shown.str(), ::testing::HasSubstr("11/11 pairs"));
}

TEST_F(Convert, TheSameManifestGoesWithEveryKindOfGenerator) {
  // Frames are 20 grey levels apart, so the difference has events; a flat image has none however
  // it moves.
  std::map<std::string, std::string> first_shards;
  for (const std::string kind : {"network", "esim", "difference"}) {
    const std::string settings =
        kind == "network" ? R"({ "weights": "untrained:1" })" : R"({ "kind": ")" + kind + R"(" })";
    std::string text = manifest_.text;
    const std::string before = R"({ "weights": "untrained:1" })";
    text.replace(text.find(before), before.size(), settings);
    const JobManifest manifest = parse_job_manifest(text, folder_.path(), "manifest.json");
    const LoadedGenerator loaded = load_generator(manifest);
    const ConversionReport report =
        convert(manifest, *loaded.generator, loaded.weights_hash, options(kind));
    EXPECT_EQ(report.written, 11) << kind;
    EXPECT_EQ(verify_folder(folder_ / kind).faults.size(), 0u) << kind;

    const ShardReader reader(folder_ / kind / "job-train-00000-of-00003.h5");
    const bool is_network = kind == "network";
    EXPECT_EQ(reader.header().unit, is_network ? VolumeUnit::kLearned : VolumeUnit::kEvents);
    EXPECT_EQ(reader.header().weights_hash, loaded.weights_hash);
    const double events = reader.sample(1).statistics.sum_positive;
    if (kind == "esim") {
      EXPECT_EQ(events, 0);
    }
    if (kind == "difference") {
      EXPECT_GT(events, 20 * 30);
    }
    first_shards[kind] = testing::read_file(folder_ / kind / "job-train-00000-of-00003.h5");
  }
  EXPECT_NE(first_shards["esim"], first_shards["difference"]);

  // A folder of one kind is not resumed by another.
  change(R"({ "weights": "untrained:1" })", R"({ "kind": "esim" })");
  EXPECT_THROWS(run("network"), UsageError, "plan.json was frozen by a run");
}

/// Six labelled KITTI images, each with three frames before it.
void write_kitti(const fs::path& root) {
  for (int i = 0; i < 6; ++i) {
    const std::string id = "00000" + std::to_string(i);
    testing::write_flat_image(root / "image_2" / (id + ".png"), {24, 36}, 10 + i);
    for (const char* before : {"_01", "_02", "_03"}) {
      testing::write_flat_image(root / "prev_2" / (id + before + ".png"), {24, 36}, 90 + 9 * i);
    }
    testing::write_file(root / "label_2" / (id + ".txt"),
                        "Car 0.00 0 -1.58 " + std::to_string(3 + i) +
                            ".5 4 21 17 1.65 1.67 3.64 -0.65 1.71 46.70 -1.59\n");
  }
}

/// All that a shard says of a sample besides its volume and what is counted in it.
std::string beside_the_volume(const ShardReader& reader, int slot) {
  nlohmann::json json = nlohmann::json::parse(sample_json(reader, slot));
  EXPECT_EQ(json.erase("statistics"), 1u);
  return json.dump(2) + reader.sample(slot).annotation.original;
}

TEST(ConvertKinds, GivePairsAndLabelsAlike) {
  const testing::TemporaryFolder folder;
  write_kitti(folder / "kitti");
  std::vector<std::string> rows;  // of the first kind
  for (const std::string generator : {R"({ "weights": "untrained:1" })", R"({ "kind": "esim" })",
                                      R"({ "kind": "difference" })"}) {
    const JobManifest manifest = parse_job_manifest(R"({
      "format": "eventgan-manifest", "version": 1, "name": "job", "seed": 3,
      "sources": [{ "dataset": "kitti_object", "root": "kitti",
                    "pairs": { "gaps": [1, 2, 3], "side": "before", "choose": "one" } }],
      "image": { "width": 18, "height": 16, "fit": "stretch", "preset": "kitti" },
      "generator": )" + generator + R"(,
      "output": { "directory": "out", "dtype": "float32" } })",
                                                    folder.path(), "manifest.json");
    const LoadedGenerator loaded = load_generator(manifest);
    ConversionOptions options;
    options.overwrite = true;
    ASSERT_EQ(convert(manifest, *loaded.generator, loaded.weights_hash, options).written, 6);
    const ShardReader reader(folder / "out/job-train-00000-of-00001.h5");
    ASSERT_EQ(reader.header().sample_count, 6);
    for (int slot = 0; slot < 6; ++slot) {
      const ShardSample sample = reader.sample(slot);
      EXPECT_THAT(sample.annotation.original, ::testing::StartsWith("Car"));
      EXPECT_EQ(sample.annotation.boxes.size(), 1u);
      const std::string row = beside_the_volume(reader, slot);
      if (rows.size() < 6) {
        rows.push_back(row);
      } else {
        EXPECT_EQ(row, rows[static_cast<std::size_t>(slot)]) << generator;
      }
    }
  }
  EXPECT_EQ(std::set<std::string>(rows.begin(), rows.end()).size(), 6u);  // they say something
}

/// A job of 81 flat frames of 4x3 pixels, or of a recording of as many with an event in each
/// interval: 80 samples in 4 shards, whose volumes are 160x120, so 1.4 MB each.
class ConvertMemory : public ::testing::TestWithParam<GeneratorKind> {
 protected:
  static constexpr int kFrames = 81;

  std::string write_source() const {
    if (GetParam() != GeneratorKind::kEvents) {
      for (int frame = 0; frame < kFrames; ++frame) {
        testing::write_flat_image(folder_ / "clip" / (std::to_string(1000 + frame) + ".png"),
                                  {3, 4}, 100 + 40 * (frame % 2));
      }
      return R"("dataset": "frames", "root": "clip", "pairs": { "gaps": [1], "side": "before" })";
    }
    std::vector<double> rows, times;
    for (int frame = 0; frame < kFrames; ++frame) {
      rows.insert(rows.end(), {1, 1, frame - 0.5, 1});
      times.push_back(frame);
    }
    testing::write_hdf5(
        folder_ / "clip.h5",
        {{"davis/left/events", {{kFrames, 4}, rows}},
         {"davis/left/image_raw", {{kFrames, 3, 4}, std::vector<std::uint8_t>(kFrames * 12)}},
         {"davis/left/image_raw_ts", {{kFrames}, times}}});
    return R"("dataset": "recording", "root": "clip.h5")";
  }

  std::string generator() const {
    if (GetParam() == GeneratorKind::kNetwork) return R"("weights": "untrained:1")";
    return "\"kind\": \"" + std::string(to_string(GetParam())) + "\"";
  }

  testing::TemporaryFolder folder_;
};

TEST_P(ConvertMemory, DoesNotGrowWithTheSamples) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizers keep what is freed";
#endif
  const JobManifest manifest = parse_job_manifest(
      R"({ "format": "eventgan-manifest", "version": 1, "name": "job",
           "sources": [{ )" +
          write_source() + R"( }],
           "image": { "width": 160, "height": 120 },
           "generator": { )" +
          generator() + R"( },
           "output": { "directory": "out", "samples_per_shard": 20 } })",
      folder_.path(), "manifest.json");
  const LoadedGenerator loaded = load_generator(manifest);
  ConversionOptions options;
  options.output = folder_ / "out";
  options.threads = 2;
  if (!restart_peak_memory()) GTEST_SKIP() << "the kernel keeps the peak";
  ASSERT_EQ(convert(manifest, *loaded.generator, loaded.weights_hash, options).written, 80);
  const auto peak = [&](int shard) {
    const std::string name = "job-train-0000" + std::to_string(shard) + "-of-00004.json";
    return parse_commit_record(testing::read_file(folder_ / "out" / name), name).peak_bytes;
  };
  constexpr std::int64_t kVolume = 18 * 160 * 120 * sizeof(float);
  ASSERT_GT(peak(0), 0);
  // 60 samples more. A few more may have been under way at once.
  EXPECT_LT(peak(3) - peak(0), 20 * kVolume);
}

INSTANTIATE_TEST_SUITE_P(OfEachKind, ConvertMemory,
                         ::testing::Values(GeneratorKind::kNetwork, GeneratorKind::kDifference,
                                           GeneratorKind::kEsim, GeneratorKind::kEvents),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

}  // namespace
}  // namespace eventgan
