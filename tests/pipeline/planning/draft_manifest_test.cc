#include "pipeline/planning/draft_manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <string>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class DraftManifest : public ::testing::Test {
 protected:
  /// A folder of flat images, of which a sequence could be one.
  FoundSource images(const fs::path& name, const std::vector<ImageSize>& sizes) {
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      testing::write_flat_image(folder_.path() / name / (std::to_string(i) + ".png"), sizes[i], 9);
    }
    return found(DatasetKind::kFrames, name);
  }

  /// Frames of 512x256, 32 x 16 tiles, whose `wide` left columns become brighter and darker by
  /// turns; `scattered`: squares of that side, one in every 96x96 pixels.
  FoundSource blinking(const fs::path& name, int frames, int wide, bool scattered = false) {
    for (int i = 0; i < frames; ++i) {
      std::vector<int> pixels(256 * 512);
      for (int at = 0; at < std::ssize(pixels); ++at) {
        pixels[at] = 40 + 8 * ((at % 512 / 8 + at / 512 / 8) % 20);  // a scene to recognise
        const bool changes =
            scattered ? at % 512 % 96 < wide && at / 512 % 96 < wide : at % 512 < wide;
        if (changes) pixels[at] += i % 2 * 9;  // more than the threshold
      }
      testing::write_index_image(folder_.path() / name / (std::to_string(100 + i) + ".png"),
                                 {256, 512}, pixels);
    }
    return found(DatasetKind::kFrames, name);
  }

  /// A recording with ECD's files: events each hundredth of a second, a frame each tenth.
  FoundSource recording(const fs::path& name) {
    const fs::path root = folder_.path() / name;
    std::string frames, events;
    for (int i = 0; i < 3; ++i) {
      testing::write_flat_image(root / ("images/" + std::to_string(i) + ".png"), {16, 24}, 9);
      frames += "0." + std::to_string(i) + " images/" + std::to_string(i) + ".png\n";
    }
    for (int i = 0; i < 20; ++i) events += "0." + std::to_string(10 + i) + " 3 4 1\n";
    testing::write_file(root / "images.txt", frames);
    testing::write_file(root / "events.txt", events);
    return found(DatasetKind::kRecording, name);
  }

  FoundSource found(DatasetKind dataset, const fs::path& name) const {
    FoundSource source;
    source.dataset = dataset;
    source.title = "what was found";
    source.root = folder_.path() / name;
    return source;
  }

  ManifestDraft draft(const std::vector<FoundSource>& sources,
                      const DraftWishes& wishes = {}) const {
    return draft_manifest(sources, {folder_.path(), /*is_relative=*/true, "out/job"}, wishes);
  }
  JobManifest read(const ManifestDraft& draft) const {
    return parse_job_manifest(draft.text, folder_.path(), "the draft");
  }

  testing::TemporaryFolder folder_;
};

constexpr ImageSize kOneSize{24, 32}, kOtherSize{48, 64}, kDavis{260, 346};

TEST_F(DraftManifest, OfASequenceTakesPairsOfNeighboursAsTheyAre) {
  const ManifestDraft made = draft({images("walk", {kOneSize, kOneSize, kOneSize})});
  const JobManifest job = read(made);
  EXPECT_EQ(job.name, "walk-events");
  EXPECT_EQ(job.output.directory, "out/job");
  ASSERT_EQ(job.sources.size(), 1u);
  EXPECT_EQ(job.sources[0].root, "walk");
  EXPECT_FALSE(job.sources[0].pairs.stills);
  EXPECT_THAT(job.sources[0].pairs.gaps, ElementsAre(1));
  EXPECT_THAT(
      made.text,
      HasSubstr(R"(// "generator": { "weights": "shipped:sensor", "sensor": "davis346" },)"));
  EXPECT_EQ(job.generator.weights, "shipped:8");
  const bool has_int8 = job.generator.precision == Precision::kInt8;
  EXPECT_EQ(job.generator.precision, has_int8 ? std::optional(Precision::kInt8) : std::nullopt);
  EXPECT_THAT(made.text, HasSubstr(has_int8 ? "narrow weights in 8 bits as from"
                                            : "narrow weights as from"));  // "auto"
  // Known by its width: what `init` measured and what this reads are one number in a process.
  EXPECT_EQ(has_int8, int8_speedup(read_shipped_weights(8)) >= 1.3);
  EXPECT_FALSE(job.image.size);
  EXPECT_TRUE(made.has_samples);
  const OnednnSupport int8 = onednn_support(Precision::kInt8);
  std::vector<::testing::Matcher<std::string>> findings{
      "what was found: 3 frames of 1 sequence, NO LABELS",
      HasSubstr("by gap: gap 1: 2, gap 2: 1, gap 3: 0"), HasSubstr("set \"frames_per_second\""),
      HasSubstr("\"scope\": \"motion\"")};
  if (int8.able && !int8.native) {
    findings.insert(findings.end() - 1, HasSubstr("has no instructions for int8"));
  }
  EXPECT_THAT(made.findings, ::testing::ElementsAreArray(findings));
}

TEST_F(DraftManifest, GeneratesWhatMovesWhereThatSavesATenthOfTheWork) {
  struct Case {
    int wide;  // columns of 32 tiles of 16 that change; 4 more are wanted
    bool motion;
    const char* why;
  };
  const bool can_save = onednn_support(Precision::kFloat32).able;
  int number = 0;
  for (const Case& one :
       {Case{0, true,
             "0 % of the tiles move and take 0 % of the network's work (the image rests in "
             "20 of 20 pairs)"},
        Case{1, true, "3 % of the tiles move and take "},
        Case{256, true, "53 % of the tiles move and take "},
        Case{512, false,
             "100 % of the tiles move and take 100 % of the network's work (the image "
             "rests in 0 of 20 pairs)"}}) {
    const ManifestDraft made = draft({blinking("blink" + std::to_string(number++), 30, one.wide)});
    const JobManifest job = read(made);
    const bool motion = one.motion && (can_save || one.wide == 0);
    EXPECT_EQ(job.generator.scope.scope == Scope::kMotion, motion) << one.wide;
    EXPECT_EQ(job.generator.weights, "shipped:8");
    EXPECT_THAT(made.findings.back(),
                AllOf(HasSubstr(motion ? "\"scope\": \"motion\", since " : "all tiles are "),
                      HasSubstr(can_save ? one.why : "")));
  }
  // Of several sources each counts as often as it has frames.
  const auto both = [&](int resting, int moving) {
    const std::string name = std::to_string(number++);
    return draft({blinking("rests" + name, resting, 0), blinking("moves" + name, moving, 512)});
  };
  const ManifestDraft both_kinds = both(12, 28);
  EXPECT_EQ(read(both_kinds).generator.scope.scope, Scope::kMotion);
  EXPECT_THAT(both_kinds.text,
              HasSubstr(": 70 % of the tiles move and take 70 % of the network's work\n"
                        "  // (the image rests in 11 of 31 pairs) ("));
  EXPECT_EQ(read(both(3, 37)).generator.scope.scope, Scope::kWhole);
  // Some tiles here and there, each with its surroundings on the coarse levels.
  const ManifestDraft scattered = draft({blinking("scattered", 30, 20, /*scattered=*/true)});
  EXPECT_THAT(scattered.findings.back(), HasSubstr("20 of 20 pairs)"));
  if (!can_save) return;
  std::smatch shares;
  ASSERT_TRUE(std::regex_search(scattered.findings.back(), shares,
                                std::regex(" (\\d+) % of the tiles move and take (\\d+) % of")))
      << scattered.findings.back();
  const int tiles = std::stoi(shares[1]), work = std::stoi(shares[2]);
  EXPECT_GE(work, 2 * tiles);  // how much depends on the processor's engine
  EXPECT_EQ(scattered.findings.back().starts_with("all tiles are generated: "), work > 90);
}

TEST_F(DraftManifest, PassesOverImagesThatCannotBeRead) {
  const FoundSource source = blinking("some", 12, 1);
  for (const char* name : {"100.png", "103.png", "104.png", "107.png"}) {
    testing::write_file(folder_ / "some" / name, "no image");
  }
  EXPECT_THAT(draft({source}).findings.back(), HasSubstr("the image rests in 5 of 5 pairs"));
  for (int i = 100; i < 112; ++i) {
    testing::write_file(folder_ / "some" / (std::to_string(i) + ".png"), "no image");
  }
  EXPECT_EQ(read(draft({source})).generator.scope.scope, Scope::kWhole);
}

TEST_F(DraftManifest, OfPhotographsIsForTheCameraThatIsWanted) {
  FoundSource photos = images("photos", {kOneSize, kOtherSize});
  testing::write_file(folder_ / "boxes.csv",
                      "image,class,left,top,right,bottom\n0.png,car,1,1,9,9\n1.png,dog,1,1,9,9\n");
  photos.labels = FoundLabels{LabelFormat::kCsv, folder_ / "boxes.csv"};
  struct Case {
    std::optional<CameraMotion> camera;
    double rests;
    GeneratorKind kind;
  };
  for (const Case& one : {Case{std::nullopt, 0.5, GeneratorKind::kEsim},
                          Case{CameraMotion::kRests, 0.5, GeneratorKind::kEsim},
                          Case{CameraMotion::kMoves, 0, GeneratorKind::kNetwork},
                          Case{CameraMotion::kBoth, 0.25, GeneratorKind::kNetwork}}) {
    const JobManifest job = read(draft({photos}, {one.camera, {"dog"}}));
    EXPECT_EQ(job.sources[0].pairs.stills.value().rests, one.rests);
    EXPECT_EQ(job.generator.kind, one.kind);
    if (one.kind == GeneratorKind::kNetwork) {
      EXPECT_EQ(job.generator.weights, "shipped:16");
      EXPECT_EQ(job.generator.scope.scope, Scope::kWhole) << "all of a still moves";
    }
    EXPECT_THAT(job.sources[0].classes, ElementsAre("dog"));
  }
  EXPECT_THAT(
      [&] {
        draft({photos}, {std::nullopt, {"cat"}});
      },
      ThrowsMessage<InputError>(HasSubstr("(car, dog), got cat")));
  EXPECT_THAT(
      [&] {
        draft({images("walk", {kOneSize, kOneSize})}, {CameraMotion::kMoves, {}});
      },
      ThrowsMessage<UsageError>(HasSubstr("--camera: expected photographs with labels")));
}

TEST_F(DraftManifest, OfOneImageProposesStillsWithTheirDefaultsWrittenOut) {
  const ManifestDraft made = draft({images("one", {kOneSize})});
  const PairSpec pairs = read(made).sources[0].pairs;
  ASSERT_TRUE(pairs.stills);
  const StillsSpec usual;
  EXPECT_EQ(pairs.stills->translation_px, usual.translation_px);
  EXPECT_EQ(pairs.stills->rotation_deg, usual.rotation_deg);
  EXPECT_EQ(pairs.stills->scale, usual.scale);
  EXPECT_EQ(pairs.stills->frames, usual.frames);
  EXPECT_THAT(
      made.text,
      HasSubstr(
          R"("motion": { "translation_px": [2, 8], "rotation_deg": 2, "scale": 0.03, "frames": 1 })"));
  EXPECT_FALSE(read(made).image.size);
  EXPECT_TRUE(made.has_samples);
  EXPECT_THAT(made.findings, Contains("what was found: 1 frame, NO LABELS"));
}

TEST_F(DraftManifest, OfSeveralSizesIsLetterboxedStills) {
  const JobManifest job = read(draft({images("mixed", {kOneSize, kOtherSize, kOneSize})}));
  EXPECT_TRUE(job.sources[0].pairs.stills);
  EXPECT_EQ(job.image.size, kDavis);
  EXPECT_EQ(job.image.fit, ImageFit::kLetterbox);
}

TEST_F(DraftManifest, OfLargeStillsHasACamerasSizeAndMovesThemAsFarThere) {
  const JobManifest job = read(draft({images("large", {{3000, 4000}})}));
  const StillsSpec usual;
  EXPECT_EQ(job.image.size, kDavis);
  // 4000 / 346 = 11.6 px of the image to one of the volume, 0.65 of them to one of a usual image
  const StillsSpec& stills = *job.sources[0].pairs.stills;
  EXPECT_THAT(stills.translation_px,
              ElementsAre(8 * usual.translation_px[0], 8 * usual.translation_px[1]));
  EXPECT_EQ(stills.rotation_deg, usual.rotation_deg);
  EXPECT_FALSE(read(draft({images("small", {{960, 1280}})})).image.size);
  const JobManifest mixed =
      read(draft({images("mixed", {{3200, 2000}, {3200, 2000}, {480, 640}})}));
  EXPECT_EQ(mixed.sources[0].pairs.stills->translation_px[1], 8 * 8);  // 0.65 * 3200 / 260
}

TEST_F(DraftManifest, OfStillsInFoldersOfTheirOwnComparesAllSizes) {
  images("all/a", {kOneSize});
  images("all/b", {kOtherSize});
  const JobManifest job = read(draft({found(DatasetKind::kFrames, "all")}));
  EXPECT_TRUE(job.sources[0].pairs.stills);
  EXPECT_EQ(job.image.size, kDavis);
}

TEST_F(DraftManifest, OfSequencesOfOneSizeEachStaysAtTheirs) {
  images("all/a", {kOneSize, kOneSize});
  images("all/b", {kOtherSize, kOtherSize});
  const JobManifest job = read(draft({found(DatasetKind::kFrames, "all")}));
  EXPECT_FALSE(job.sources[0].pairs.stills);
  EXPECT_FALSE(job.image.size);
}

TEST_F(DraftManifest, NamesLabelsOfOnesOwn) {
  FoundSource source = images("walk/images", {kOneSize, kOneSize});
  testing::write_file(folder_ / "walk/boxes.csv",
                      "image,class,left,top,right,bottom\n0.png,car,1,1,5,5\n");
  source.labels = {LabelFormat::kCsv, folder_ / "walk/boxes.csv"};
  // Only what is written: whether such labels can be read is the dataset's affair.
  const ManifestDraft made = draft({source});
  const JobManifest job = read(made);
  ASSERT_TRUE(job.sources[0].labels);
  EXPECT_EQ(job.sources[0].labels->format, LabelFormat::kCsv);
  EXPECT_EQ(job.sources[0].labels->path, "walk/boxes.csv");
  EXPECT_THAT(made.findings, Contains("labels: CSV, in " + (folder_ / "walk/boxes.csv").string()));
}

TEST_F(DraftManifest, NamesMasksThatFitTheBoxes) {
  FoundSource source = images("walk/images", {{4, 5}, {4, 5}});
  source.labels = {LabelFormat::kCsv, folder_ / "walk/boxes.csv", folder_ / "walk/masks"};
  const auto drafted = [&](const std::string& rows, const std::vector<int>& pixels) {
    testing::write_file(folder_ / "walk/boxes.csv",
                        "image,class,left,top,right,bottom\n" + rows + "1.png,,,,,\n");
    testing::write_index_image(folder_ / "walk/masks/0.png", {4, 5}, pixels);
    return draft({source});
  };
  const std::string one = "0.png,car,0,0,2,2\n", two = one + "0.png,car,2,0,5,4\n";
  const std::vector<int> both{1, 1, 0, 2, 2, 1, 1, 2, 2, 2, 0, 0, 2, 2, 2, 0, 0, 2, 2, 0};
  const ManifestDraft made = drafted(two, both);
  EXPECT_EQ(read(made).sources[0].outlines, "walk/masks");
  EXPECT_THAT(made.findings,
              Contains("outlines: index masks, in " + (folder_ / "walk/masks").string()));

  const auto expect_none = [&](const ManifestDraft& without, const std::string& why) {
    EXPECT_FALSE(read(without).sources[0].outlines);
    EXPECT_THAT(without.findings,
                Contains(HasSubstr("masks left out, since they do not fit the boxes: " + why)));
  };
  expect_none(drafted(one, both),
              "expected numbers of the 1 box in walk/boxes.csv#0.png, got 2, in ");
  // A pixel of a box, and a mask of both that has the number of the first.
  std::vector<int> pixels(20);
  pixels[6] = 1;
  expect_none(drafted(one, pixels), "expected pixels all over the boxes, got an overlap of 0.25");
  expect_none(drafted(two, {1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}),
              "expected a number for each box, got one beside 2 boxes");
}

TEST_F(DraftManifest, OfARecordingTakesItsEvents) {
  const ManifestDraft made = draft({recording("drive")});
  const JobManifest job = read(made);
  EXPECT_EQ(job.generator.kind, GeneratorKind::kEvents);
  EXPECT_EQ(job.sources[0].dataset, DatasetKind::kRecording);
  EXPECT_FALSE(job.sources[0].window.duration_s) << "it has frames, which make the windows";
  EXPECT_THAT(made.text, HasSubstr(R"(// "window_s": 0.05)"));
  EXPECT_THAT(made.text, Not(HasSubstr(R"("sensor")")));
  EXPECT_FALSE(job.image.size);
  EXPECT_TRUE(made.has_samples);
  EXPECT_THAT(made.findings,
              ElementsAre(AllOf(HasSubstr("of 1 recording"), Not(HasSubstr("gap")))));
}

TEST_F(DraftManifest, OfTablesWithTextsEachIsAWindow) {
  for (const char* name : {"a", "b"}) {
    const std::string file = std::string("windows/") + name;
    testing::write_file(folder_ / (file + ".csv"), "t,x,y,p\n0.1,5,2,1\n0.17,3,3,0\n");
    testing::write_file(folder_ / (file + ".txt"), "0 0.5 0.5 0.25 0.25\n");
  }
  const auto window_s = [&] {
    return read(draft({found(DatasetKind::kRecording, "windows")})).sources[0].window.duration_s;
  };
  EXPECT_EQ(window_s(), std::nullopt);
  std::filesystem::remove(folder_ / "windows/a.txt");
  EXPECT_EQ(window_s(), std::nullopt) << "one without a text is left out";
  std::filesystem::remove(folder_ / "windows/b.txt");
  EXPECT_EQ(window_s(), 0.05);
}

TEST_F(DraftManifest, GuessesASensorFromEventsAlone) {
  const auto drafted = [&](const std::string& x) {
    testing::write_file(folder_ / "camera.csv",
                        "t,x,y,p\n0.1," + x + ",200,1\n0.11," + x + ",3,0\n");
    return draft({found(DatasetKind::kRecording, "camera.csv")});
  };
  const ManifestDraft seen = drafted("300");
  EXPECT_THAT(seen.findings, Contains("no size of the sensor in the files: set \"sensor\" (the "
                                      "events reach x = 300, y = 200, as those of a camera of "
                                      "304x240)"));
  EXPECT_THAT(seen.text, HasSubstr(R"(// "sensor": { "width": 304, "height": 240 },)"));
  const ManifestDraft unseen = drafted("9000");  // beyond any sensor: its window is a fault
  EXPECT_THAT(unseen.findings, Contains("no size of the sensor in the files: set \"sensor\""));
  EXPECT_THAT(unseen.text, HasSubstr(R"(// "sensor": {)"));
  EXPECT_FALSE(unseen.has_samples);
}

TEST_F(DraftManifest, OfSeveralHasOneSizeAndAPresetWhereTheirsDiffer) {
  fs::create_directories(folder_ / "kitti/label_2");
  for (const char* name : {"kitti/image_2/000000.png", "kitti/prev_2/000000_01.png"}) {
    testing::write_flat_image(folder_ / name, kOneSize, 9);
  }
  testing::write_file(folder_ / "kitti/label_2/000000.txt", "");
  const FoundSource cars = found(DatasetKind::kKittiObject, "kitti");
  const FoundSource walk = images("walk", {kOneSize, kOneSize});
  const FoundSource run = images("run", {kOtherSize, kOtherSize});

  const JobManifest both = read(draft({walk, cars}));
  EXPECT_EQ(both.image.size, kDavis);
  EXPECT_EQ(both.image.fit, ImageFit::kLetterbox);
  EXPECT_EQ(both.image.preset, "demo") << "the first one's";
  EXPECT_THAT(both.sources[0].pairs.gaps, ElementsAre(1));
  EXPECT_THAT(both.sources[1].pairs.gaps, ElementsAre(1)) << "of 1 and 2 the one that has frames";
  EXPECT_EQ(read(draft({cars, walk})).image.preset, "kitti");
  EXPECT_EQ(read(draft({cars})).image.fit, ImageFit::kStretch);

  const ManifestDraft alike = draft({walk, run});
  EXPECT_FALSE(read(alike).image.size);
  EXPECT_THAT(alike.text, Not(HasSubstr("preset")));
  EXPECT_EQ(read(draft({walk, images("still", {kOneSize, kOtherSize})})).image.size, kDavis);
}

TEST_F(DraftManifest, OfSingleImagesWithBoxesTheImageRestsUnlessItsCameraDrives) {
  testing::write_flat_image(folder_ / "kitti/image_2/000000.png", kOneSize, 9);
  testing::write_file(folder_ / "kitti/label_2/000000.txt", "");
  const auto streets = read(draft({found(DatasetKind::kKittiObject, "kitti")})).sources[0].pairs;
  ASSERT_TRUE(streets.stills && streets.stills->objects);
  EXPECT_EQ(streets.stills->rests, 0);

  FoundSource photos = images("photos", {kOneSize});
  testing::write_file(folder_ / "photos.csv",
                      "image,class,left,top,right,bottom\n0.png,a,1,2,9,9\n");
  photos.labels = {LabelFormat::kCsv, folder_ / "photos.csv"};
  const JobManifest layers = read(draft({photos}));
  const PairSpec& others = layers.sources[0].pairs;
  ASSERT_TRUE(others.stills && others.stills->objects);
  EXPECT_EQ(others.stills->rests, 0.5);
  EXPECT_EQ(layers.generator.kind, GeneratorKind::kEsim) << "it follows what was drawn";
  const auto with_a_sequence = read(draft({photos, images("walk", {kOneSize, kOneSize})}));
  EXPECT_EQ(with_a_sequence.generator.kind, GeneratorKind::kNetwork);
}

TEST_F(DraftManifest, DrivingScenesAreForACameraThatMoves) {
  constexpr const char* kSets[][2] = {{"BDD100K", "bdd100k/images/100k/train"},
                                      {"Cityscapes", "x/leftImg8bit/train/ulm"},
                                      {"Cityscapes", "Cityscapes_small/train/some"},
                                      {"nuImages", "nuimages/samples/CAM_BACK"},
                                      {"nuImages", "some/samples/CAM_FRONT"},
                                      {"CamVid", "CamVid/701_StillsRaw_full"},
                                      {"KITTI", "kitti_mini/images"},
                                      {"", "photos"},
                                      {"", "bdd100k/one/two/three/four/five/photos"},
                                      {"", "people/at_kit"},
                                      {"", "kitties/images"},
                                      {"", "webcamvideos/images"},
                                      {"KITTI", "my-KITTI2/images"}};
  for (const auto& [title, path] : kSets) {
    SCOPED_TRACE(path);
    FoundSource photos = images(path, {kOneSize});
    const auto table = folder_.path() / "table.csv";
    testing::write_file(table, "image,class,left,top,right,bottom\n0.png,a,1,2,9,9\n");
    photos.labels = {LabelFormat::kCsv, table};
    const bool drives = *title != 0;
    const ManifestDraft made = draft({photos});
    const JobManifest job = read(made);
    EXPECT_EQ(job.sources[0].pairs.stills->rests, drives ? 0 : 0.5);
    EXPECT_EQ(job.generator.kind, drives ? GeneratorKind::kNetwork : GeneratorKind::kEsim);
    EXPECT_THAT(
        made.findings,
        Contains(HasSubstr(drives ? "cameras of driving scenes (" + std::string(title) + ") move"
                                  : "\"rests\": 0.5, for a camera that stays still")));
    const ManifestDraft wished = draft({photos}, {CameraMotion::kRests, {}});
    EXPECT_EQ(read(wished).sources[0].pairs.stills->rests, 0.5);
    EXPECT_EQ(read(wished).generator.kind, GeneratorKind::kEsim);
    EXPECT_THAT(wished.text, Not(HasSubstr("driving")));
  }
}

TEST_F(DraftManifest, HasSamplesOnlyIfEachSourceHas) {
  const FoundSource walk = images("walk", {kOneSize, kOneSize});
  fs::create_directories(folder_ / "kitti/label_2");
  fs::create_directories(folder_ / "kitti/image_2");
  const FoundSource nothing = found(DatasetKind::kKittiObject, "kitti");
  EXPECT_TRUE(draft({walk}).has_samples);
  EXPECT_FALSE(draft({nothing}).has_samples);
  EXPECT_FALSE(draft({walk, nothing}).has_samples);
}

TEST_F(DraftManifest, RefusesWhatIsNoOneJob) {
  const FoundSource walk = images("walk", {kOneSize, kOneSize}), drive = recording("drive");
  EXPECT_THROWS(draft({walk, drive}), UsageError, "got ", "walk (frames) and ",
                "drive (recording)");
  EXPECT_THROWS(draft({walk, walk}), UsageError, "once, got it twice: ");
  fs::create_directory_symlink(folder_ / "walk", folder_ / "link");
  EXPECT_THROWS(draft({walk, found(DatasetKind::kFrames, "link")}), UsageError,
                "once, got it twice: ");
  const FoundSource latin = images("l\xe4tin", {kOneSize, kOneSize});
  EXPECT_THROWS(draft({latin}), UsageError, "in UTF-8");
}

TEST_F(DraftManifest, SplitsOfOneFolderHaveAListEach) {
  FoundSource train = images("walk", {kOneSize, kOneSize, kOneSize}), val = train;
  train.ids = folder_ / "train.txt";
  testing::write_file(*train.ids, "walk/0.png\nwalk/1.png\n");
  val.ids = folder_ / "val.txt";
  val.split = "val";
  testing::write_file(*val.ids, "walk/2.png\n");
  const ManifestDraft made = draft({train, val});
  const JobManifest job = read(made);
  EXPECT_EQ(job.sources[0].selection.ids, "train.txt");
  EXPECT_EQ(job.sources[1].selection.ids, "val.txt");
  EXPECT_THAT(made.findings, Contains(HasSubstr("may be of another split")));
  EXPECT_THAT([&] { draft({val, val}); }, ThrowsMessage<UsageError>(HasSubstr("got it twice")));
  std::vector<FoundSource> without = {images("run", {kOneSize, kOneSize})};
  without[0].labels = {LabelFormat::kCsv, folder_ / "boxes.csv"};
  without[0].unread = {"boxes.json looks like labels"};
  go_without_labels(without);
  EXPECT_THAT(draft(without).text, HasSubstr("\"labels\": \"none\""));
  EXPECT_FALSE(read(draft(without)).sources[0].labels);
  without = {found(DatasetKind::kKittiObject, "kitti")};
  EXPECT_THAT([&] { go_without_labels(without); },
              ThrowsMessage<UsageError>(HasSubstr("--no-labels: expected images or videos")));
}

TEST_F(DraftManifest, IsNamedAfterWhatWasShown) {
  const auto name = [&](const std::vector<fs::path>& names) {
    std::vector<FoundSource> sources;
    for (const fs::path& path : names) {
      sources.push_back(found(DatasetKind::kFrames, path));
      fs::create_directories(sources.back().root);
    }
    return draft_name(sources);
  };
  EXPECT_EQ(name({"run"}), "run-events");
  EXPECT_EQ(name({"run/images"}), "run-events");
  EXPECT_EQ(name({"both/a", "both/b"}), "both-events");
  EXPECT_EQ(name({"both/a", "other/b"}), "a-events");
  EXPECT_EQ(name({"\xd0\xb2"}), "frames-events");
  EXPECT_EQ(name({"\xd0\xb2/a", "\xd0\xb2/b"}), "a-events") << "the folder's name does not serve";
  EXPECT_EQ(name({std::string(80, 'x')}), std::string(50, 'x') + "-events");
}

}  // namespace
}  // namespace eventgan
