#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/dataset/finalize.h"
#include "pipeline/exports/export_job.h"
#include "stages/base/archives/hdf5_arrays.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/readers/recording.h"
#include "stages/shards/codec/quantization.h"
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

// What each exporter writes of the split "val" of testing::ConvertedFolder, which is
// testing::example_shard: volumes [4, 6, 8], of images twice their size.

namespace eventgan {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pointwise;
using ::testing::UnorderedElementsAre;

constexpr char kManifest[] = R"({
  "format": "eventgan-manifest", "version": 1, "name": "demo",
  "sources": [{"dataset": "kitti_object", "root": "kitti",
               "pairs": {"gaps": [2], "side": "before", "choose": "one"}}],
  "image": {"preset": "kitti"}, "generator": {"weights": "untrained:2"},
  "output": {"directory": "out", "samples_per_shard": 5}})";
constexpr std::size_t kChannels = 4;
constexpr std::size_t kPixels = 6 * 8;
constexpr int kLevel = 100;
constexpr float kTimes = 8;

std::vector<double> numbers(const TypedArray& array) {
  std::vector<double> values;
  for (std::size_t i = 0; i < array.size(); ++i) values.push_back(array.number(i));
  return values;
}

TypedArray npy(const std::filesystem::path& file) {
  const std::string bytes = testing::read_file(file);
  return parse_npy(std::as_bytes(std::span(bytes)), file.string());
}

/// Columns of a list of records: [column][row].
std::vector<std::vector<double>> records(std::span<const std::byte> bytes,
                                         const std::vector<std::string>& columns) {
  std::vector<std::vector<double>> values;
  const std::vector<NamedArray> fields = parse_npy_fields(bytes, "records");
  for (const std::string& column : columns) {
    const auto field = std::ranges::find(fields, column, &NamedArray::name);
    values.push_back(field == fields.end() ? std::vector<double>() : numbers(field->values));
  }
  return values;
}

std::vector<std::vector<double>> records(const std::filesystem::path& file,
                                         const std::vector<std::string>& columns) {
  const std::string bytes = testing::read_file(file);
  return records(std::as_bytes(std::span(bytes)), columns);
}

/// The content of a file within a tar.
std::string tar_content(const std::filesystem::path& tar, const std::string& name) {
  constexpr std::size_t kBlock = 512, kSizeAt = 124;
  const std::string bytes = testing::read_file(tar);
  for (std::size_t at = 0; at + kBlock <= bytes.size() && bytes[at] != '\0';) {
    const std::size_t size = std::stoul(bytes.substr(at + kSizeAt, 11), nullptr, 8);
    if (name == bytes.c_str() + at) return bytes.substr(at + kBlock, size);
    at += kBlock + (size + kBlock - 1) / kBlock * kBlock;
  }
  return "";
}

class Exporters : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    converted_ = std::make_unique<testing::ConvertedFolder>(0);
    for (int shard = 0; shard < 4; ++shard) {
      converted_->add(
          shard, [](testing::ExampleShard& example) { example.header.manifest_text = kManifest; });
    }
    finalize(converted_->path(), {});
  }
  static void TearDownTestSuite() { converted_.reset(); }

  /// Into folder_ / word.
  ExportReport reported(std::string_view word, ExportOptions options = {},
                        const testing::ConvertedFolder& converted = *converted_) {
    options.to = &*std::ranges::find(export_formats(), word, &ExportFormat::word);
    options.out = folder_ / std::string(word);
    options.splits = {"val"};
    if (word != "webdataset" || options.representation) options.counts = EventCounts::kRounded;
    options.threads = 2;
    return run_export(converted.path(), options);
  }

  /// The export's folder.
  std::filesystem::path exported(std::string_view word, const ExportOptions& options = {},
                                 const testing::ConvertedFolder& converted = *converted_) {
    return reported(word, options, converted).folder;
  }

  /// The same of samples of kTimes as many events whose frames are there, kLevel all over, and as
  /// large as the volumes.
  std::filesystem::path exported_with_frames(std::string_view word) {
    // No still, which would be moved again.
    testing::ConvertedFolder converted(0);
    for (int shard = 0; shard < 4; ++shard) {
      converted.add(shard, [](testing::ExampleShard& example) {
        example.header.manifest_text = kManifest;
        for (std::vector<float>& volume : example.volumes) {
          for (float& value : volume) value *= kTimes;
        }
        for (ShardSample& sample : example.samples) {
          sample.source_size = {6, 8};
          sample.pair.previous.video_frame = sample.pair.next.video_frame = FrameRef().video_frame;
          if (!sample.pair.motion) continue;
          sample.pair.motion.reset();
          sample.pair.previous.path = "kitti/prev_2/000004_02.png";
        }
      });
    }
    finalize(converted.path(), {});
    ExportOptions options;
    options.frames = folder_ / "frames";
    for (const char* image :
         {"prev_2/000000_02", "image_2/000000", "prev_2/000001_02", "image_2/000001",
          "prev_2/000003_02", "image_2/000003", "prev_2/000004_02", "image_2/000004"}) {
      testing::write_flat_image(options.frames / "kitti" / (std::string(image) + ".png"), {6, 8},
                                kLevel);
    }
    return exported(word, options, converted);
  }

  /// The volume of a sample, [kChannels * kPixels].
  static const std::vector<float>& volume(std::size_t slot) {
    static const testing::ExampleShard kShard = testing::example_shard();
    return kShard.volumes[slot];
  }

  /// As the shard stores it, in a .npy file.
  static std::string stored_volume(std::size_t slot) {
    std::vector<std::uint16_t> halves(volume(slot).size());
    to_halves(volume(slot), halves.data());
    return npy_file("<f2", {kChannels, 6, 8}, halves);
  }

  /// Its values, channels last.
  static std::vector<double> channels_last(std::size_t slot, auto&& value_of) {
    std::vector<double> values;
    for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        values.push_back(value_of(volume(slot)[channel * kPixels + pixel]));
      }
    }
    return values;
  }

  /// Of a volume whose values are rounded to counts, the positive channels first.
  static std::int64_t event_count(std::size_t slot, float times = 1) {
    std::int64_t count = 0;
    for (const float value : volume(slot)) count += std::lround(times * value);
    return count;
  }

  testing::TemporaryFolder folder_;
  static inline std::unique_ptr<testing::ConvertedFolder> converted_;
};

TEST(ExportReport, SaysWhatIsLeftOutAndThenHowMany) {
  EXPECT_EQ(to_text({"out", 1, 2, {{"samples of a kind", 1}}, {}, {}}),
            "out: 1 sample, 2 quarantined samples left out (listed in export.json)\n"
            "left out: samples of a kind: 1\n");
}

TEST_F(Exporters, YoloHasBoxesAndPosesInSharesOfTheVolume) {
  const std::filesystem::path out = exported("yolo");
  // {1, 1, 4.25, 4.5} and {5, 0, 8, 3} of 8 x 6; DontCare is left out.
  EXPECT_EQ(testing::read_file(out / "labels/val/000000.txt"),
            "0 0.328125000 0.458333333 0.406250000 0.583333333\n");
  EXPECT_EQ(testing::read_file(out / "labels/val/000003.txt"),
            "0 0.812500000 0.250000000 0.375000000 0.500000000\n");
  EXPECT_EQ(testing::read_file(out / "labels/val/000001.txt"), "");
  const TypedArray image = npy(out / "images/val/000003.npy");
  EXPECT_THAT(image.shape, ElementsAre(6u, 8u, kChannels));
  EXPECT_THAT(numbers(image), Pointwise(DoubleNear(1), channels_last(3, [](float value) {
                                          return 255.0 * std::min(value, 1.0f);
                                        })));
  EXPECT_TRUE(std::filesystem::exists(out / "pose/labels/val/000004.txt"));
}

TEST_F(Exporters, SayInHowManySamplesValuesAreCutToTheFullScale) {
  std::map<bool, std::vector<float>> largest;    // of each sample, by whether of sums over the bins
  for (const std::size_t slot : {0, 1, 3, 4}) {  // 2 is in quarantine
    const std::vector<float> values = volume(slot);
    std::map<std::size_t, float> sums;  // by polarity and pixel
    float& largest_sum = largest[true].emplace_back();
    for (std::size_t at = 0; at < values.size(); ++at) {
      const std::size_t polarity = at / (values.size() / 2);
      float& sum = sums[polarity * kPixels + at % kPixels] += values[at];
      largest_sum = std::max(largest_sum, sum);
    }
    largest[false].push_back(std::ranges::max(values));
  }
  const auto of_full_scale = HasSubstr("full scale");
  for (const auto& [word, as_images] : {std::pair{"yolo", false},
                                        {"yolo", true},
                                        {"yolo-seg", true},
                                        {"coco", true},
                                        {"mpii", false}}) {
    SCOPED_TRACE(std::string(word) + (as_images ? ", images" : ""));
    const std::vector<float>& of_samples = largest[as_images];
    const auto above = std::ranges::count_if(of_samples, [](float value) { return value > 1; });
    ASSERT_GT(above, 1);
    std::ostringstream note;
    note.precision(3);
    note << (as_images ? "sums of values" : "values")
         << " above the full scale of 1 were cut to it in " << above
         << " samples; the largest value is " << std::ranges::max(largest[false])
         << " (--full-scale sets another)";
    ExportOptions options;
    options.as_images = as_images;
    options.overwrite = true;
    for (int turn = 0; turn < 2; ++turn) {  // what is done already says it, too
      const ExportReport report = reported(word, options);
      EXPECT_THAT(report.notes, Contains(note.str()));
      EXPECT_THAT(to_text(report), HasSubstr("\nnote: " + note.str()));
      for (const auto& [what, count] : report.left_out) EXPECT_THAT(what, Not(of_full_scale));
    }
    options.full_scale = 1.001 * std::ranges::max(of_samples);  // sums of floats are rounded
    EXPECT_THAT(reported(word, options).notes, Not(Contains(of_full_scale)));
  }
  ExportOptions as_stored;
  as_stored.overwrite = true;
  EXPECT_THAT(reported("coco", as_stored).notes, Not(Contains(of_full_scale)));
}

TEST_F(Exporters, YoloSegHasTheOutlineWithItsHole) {
  const std::string line = testing::read_file(exported("yolo-seg") / "labels/val/000000.txt");
  std::istringstream words(line);
  int class_number = -1;
  words >> class_number;
  EXPECT_EQ(class_number, 0);
  std::set<std::pair<double, double>> corners;
  for (double x = 0, y = 0; words >> x >> y;)
    corners.insert({8 * x, std::round(6 * y * 1e6) / 1e6});
  for (const auto& corner : std::vector<std::pair<double, double>>{
           {1, 1}, {4.25, 1}, {4.25, 4.5}, {1, 4.5}, {2, 2}, {2, 3}, {3, 3}, {3, 2}}) {
    EXPECT_TRUE(corners.contains(corner)) << corner.first << ", " << corner.second;
  }
}

TEST_F(Exporters, CocoHasBoxesByTheirSidesAndJointsFromTheEdge) {
  const std::filesystem::path out = exported("coco");
  const auto annotations = [&](const std::string& name) -> json {
    return json::parse(testing::read_file(out / name)).at("annotations");
  };
  std::vector<std::vector<double>> boxes, joints;
  for (const json& object : annotations("instances_val.json")) {
    if (object.value("iscrowd", 0) == 0) boxes.push_back(object.at("bbox"));
  }
  EXPECT_THAT(boxes, UnorderedElementsAre(ElementsAre(1, 1, 3.25, 3.5), ElementsAre(5, 0, 3, 3)));
  for (const json& person : annotations("person_keypoints_val.json")) {
    joints.push_back(person.at("keypoints"));
  }
  // The wrists, (2.25, 2.875) hidden and (3.25, 3.25) of unknown visibility, + 0.5.
  EXPECT_THAT(joints, Contains(ElementsAre(2.75, 3.375, 1, 3.75, 3.75, 2)));
  EXPECT_EQ(testing::read_file(out / "volumes/val/000003.npy"), stored_volume(3));
}

TEST_F(Exporters, MpiiListsWhoHasACentreCountedFromOne) {
  const json list = json::parse(testing::read_file(exported("mpii") / "annot/val.json"));
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0]["image"], "val/000000.png");
  EXPECT_EQ(list[0]["center"], (std::vector<double>{3.75, 3.25}));
  EXPECT_EQ(list[0]["scale"], 0.875);
  EXPECT_EQ(list[0]["joints"], (std::vector<std::vector<double>>{{3.25, 3.875}, {4.25, 4.25}}));
  EXPECT_EQ(list[0]["joints_vis"], (std::vector<int>{1, 1}));
}

TEST_F(Exporters, HpeHasAnEntryForEachPersonWithAJoint) {
  const std::filesystem::path out = exported("hpe") / "hpe/val";
  const json poses = json::parse(testing::read_file(out / "poses.json"));
  ASSERT_EQ(poses.size(), 3u);  // of 000000 two
  EXPECT_EQ(poses[2]["img_name"], "000004.png");
  // Of 8x6 pixels the wrists, left (2.25, 2.875) hidden and right (3.25, 3.25) of unknown
  // visibility.
  const json left{2.25 / 8, 2.875 / 6}, right{3.25 / 8, 3.25 / 6};
  const json& both = poses[1];
  EXPECT_EQ(both["img_name"], "000000.png");
  ASSERT_EQ(both["keypoints"].size(), 39u);
  for (std::size_t i = 0; i < 13; ++i) {
    const json& at = i == 5 ? left : i == 6 ? right : json{0.0, 0.0};
    const double visible = i == 5 ? 1 : i == 6 ? 2 : 0;
    EXPECT_EQ(json({both["keypoints"][3 * i], both["keypoints"][3 * i + 1],
                    both["keypoints"][3 * i + 2]}),
              json({at[0], at[1], visible}))
        << i;
  }
  EXPECT_EQ(both["center"], json({2.75 / 8, 6.125 / 2 / 6}));
  // The other person has the left wrist alone.
  EXPECT_EQ(both["other_centers"], json::array({left}));
  EXPECT_EQ(both["other_keypoints"][5], json::array({left}));
  EXPECT_EQ(both["other_keypoints"][6], json::array());
  EXPECT_EQ(image_file_size(out / "eros/000000.png"), (ImageSize{6, 8}));
  EXPECT_TRUE(std::filesystem::exists(out / "eros/000004.png"));
  EXPECT_FALSE(std::filesystem::exists(out / "eros/000003.png"));  // no person
}

TEST_F(Exporters, DavisHasARowForEachPerson) {
  const std::filesystem::path out = exported("davis");
  const Hdf5Arrays file = read_hdf5_arrays(out / "val.hdf5");
  const TypedArray& events = file.arrays.at("davis/events");
  EXPECT_THAT(events.shape, ElementsAre(1u, 6u, 8u, kChannels));
  EXPECT_THAT(numbers(events), Pointwise(DoubleNear(1e-3), channels_last(0, [](float value) {
                                           return static_cast<double>(value);
                                         })));
  const ZipArchive list(out / "val.npz");
  const auto column = [&](const std::string& name) {
    return parse_npy(list.read(name + ".npy"), name);
  };
  EXPECT_THAT(numbers(column("center")), ElementsAre(2.75, 2.25));
  EXPECT_THAT(numbers(column("part")), ElementsAre(2.25, 2.875, 1, 3.25, 3.25, 1));
  EXPECT_THAT(numbers(column("views")), ElementsAre(10, 10, 12, 12, 12));
  EXPECT_EQ(column("imgname").text(0), "000000");
}

TEST_F(Exporters, ListsOfPersonsNeedOneWithCentreAndScale) {
  const auto refused = [&](void (*change)(ShardSample&), const std::string& why) {
    static void (*change_sample)(ShardSample&);
    change_sample = change;
    testing::ConvertedFolder converted(0);
    for (int shard = 0; shard < 4; ++shard) {
      converted.add(shard, [](testing::ExampleShard& example) {
        example.header.manifest_text = kManifest;
        for (ShardSample& sample : example.samples) change_sample(sample);
      });
    }
    finalize(converted.path(), {});
    for (const std::string_view word : {"mpii", "davis"}) {
      EXPECT_THAT([&] { exported(word, {}, converted); },
                  ::testing::ThrowsMessage<UsageError>(
                      "expected samples that --to " + std::string(word) +
                      " can use, got none, in " + converted.path().string() + " (" + why + ")"));
      EXPECT_FALSE(std::filesystem::exists(folder_ / word));
    }
  };
  // The split has three persons: two of 000000, of whom one has both, and 000004's without.
  refused(
      [](ShardSample& sample) {
        for (Person& person : sample.annotation.persons) {
          person.center = kMissingPoint;
          person.scale = -1;
        }
        for (VolumePerson& person : sample.labels.persons) {
          person.center = kMissingPoint;
          person.scale = -1;
        }
      },
      "persons: no centre or no scale: 3; --to coco keeps their joints");
  refused(
      [](ShardSample& sample) {
        sample.annotation.persons.clear();
        sample.labels.persons.clear();
      },
      "no persons");
  for (const std::string_view word : {"mpii", "davis"}) {
    EXPECT_EQ(reported(word).left_out.at("persons: no centre or no scale"), 2) << word;
  }
}

TEST_F(Exporters, NameTheShardAndTheSampleThatTheyCannotExport) {
  const auto refused = [&](std::string_view word, void (*change)(testing::ExampleShard&),
                           const std::string& what) {
    testing::ConvertedFolder converted(0);
    for (int shard = 0; shard < 4; ++shard) converted.add(shard, change);
    finalize(converted.path(), {});
    EXPECT_THAT([&] { exported(word, {}, converted); },
                ThrowsMessage<UsageError>(
                    AllOf(HasSubstr(what), HasSubstr(", in " + converted.shard(1).string()))));
  };
  static constexpr auto kWithoutPersons = [](testing::ExampleShard& example) {
    example.header.manifest_text = kManifest;
    example.header.label_schema.joint_names = example.header.label_schema.joint_aliases = {};
    for (ShardSample& sample : example.samples) {
      sample.annotation.persons.clear();
      sample.labels.persons.clear();
    }
  };
  refused(
      "davis",
      [](testing::ExampleShard& example) {
        kWithoutPersons(example);
        example.samples[0].sample_id = "first";
      },
      "digits only, got first, in ");
  refused(
      "davis",
      [](testing::ExampleShard& example) {
        kWithoutPersons(example);
        example.samples[0].sample_id = "000001@before1";
      },
      "got 000001@before1 and 000001, in ");
  refused(
      "events",
      [](testing::ExampleShard& example) {
        example.header.manifest_text = kManifest;
        example.header.dtype = StoredType::kFloat32;
        for (float& value : example.volumes[0]) value *= 1e9f;
      },
      "expected values of at most 1e+09 events altogether");
}

TEST_F(Exporters, WebdatasetHasTheVolumeAsItIsStored) {
  const std::filesystem::path tar = exported("webdataset") / "demo-val-00000-of-00001.tar";
  testing::write_file(folder_ / "a.npz", tar_content(tar, "000003.npz"));
  const ZipArchive arrays(folder_ / "a.npz");
  const std::vector<std::byte> stored = arrays.read("volume.npy");
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(stored.data()), stored.size()),
            stored_volume(3));
  EXPECT_EQ(parse_npy(arrays.read("scale.npy"), "scale").number(0), 1);
  EXPECT_EQ(tar_content(tar, "000002.json"), "") << "in quarantine";
}

TEST_F(Exporters, WebdatasetHasWhatTheEventsOfTheVolumeBecome) {
  ExportOptions options;
  options.representation = "count";
  const std::filesystem::path tar = exported("webdataset", options) / "demo-val-00000-of-00001.tar";
  testing::write_file(folder_ / "a.npz", tar_content(tar, "000004.npz"));
  const ZipArchive arrays(folder_ / "a.npz");
  const auto counts = parse_npy(arrays.read("representation.npy"), "counts");
  EXPECT_THAT(counts.shape, ElementsAre(2u, 6u, 8u));
  double sum = 0;
  for (std::size_t i = 0; i < 2 * kPixels; ++i) sum += counts.number(i);
  EXPECT_EQ(sum, static_cast<double>(event_count(4)));
  EXPECT_FALSE(arrays.contains("volume.npy"));
  EXPECT_TRUE(arrays.contains("flow.npy"));
}

TEST_F(Exporters, WebdatasetDrawsNoEventsOfVolumesAsStored) {
  ExportOptions options;
  options.seed = 5;
  EXPECT_THAT([&] { exported("webdataset", options); },
              ThrowsMessage<UsageError>(HasSubstr("expected --representation WORD beside them")));
}

TEST_F(Exporters, WebdatasetKnowsTheWordsOfRepresentations) {
  ExportOptions options;
  options.representation = "histogram:65";
  EXPECT_THAT([&] { exported("webdataset", options); },
              ThrowsMessage<UsageError>(HasSubstr("\"histogram:65\"")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "webdataset"));
}

/// A place in a sample's JSON, and what is there.
struct WebdatasetCase {
  const char* sample;
  const char* place;
  const char* expected;
};

constexpr WebdatasetCase kWebdatasetCases[] = {
    {"000000", "/split", R"("val")"},
    {"000000", "/action", "null"},  // which others have
    {"000003", "/action", R"("Walking-1")"},
    {"000000", "/prev_video_frame", "null"},
    {"000003", "/prev_video_frame", "10"},
    {"000000", "/prev_time_s", "1.0"},
    {"000001", "/next_time_s", "null"},
    {"000001", "/gap_s", "null"},
    {"000000", "/source_size", "[12, 16]"},
    {"000000", "/source_to_volume", "[[0.5, 0.0, -0.25], [0.0, 0.5, -0.25]]"},
    {"000000", "/motion", "null"},
    {"000004", "/motion", "[-1.5, 0.25, 0.75, 1.0078125]"},
    {"000004", "/threshold", "0.3125"},
    {"000003", "/threshold", "null"},
    {"000000", "/projection",
     "[[350.0, 0.0, 3.75, 19.0], [0.0, 350.0, 2.75, 0.0], [0.0, 0.0, 1.0, 4.0]]"},
    {"000003", "/projection_source", "null"},
    {"000001", "/boxes", "[]"},
    {"000000", "/boxes/0/class", R"("Car")"},
    {"000000", "/boxes/0/xyxy", "[1.0, 1.0, 4.25, 4.5]"},
    {"000000", "/boxes/0/outline",
     "[[1, 1, 4.25, 1, 4.25, 4.5, 1, 4.5], [2, 2, 2, 3, 3, 3, 3, 2]]"},
    {"000000", "/boxes/0/occlusion", "0"},
    {"000000", "/boxes/0/track_id", "7"},
    {"000000", "/boxes/0/difficulty", "1"},
    {"000000", "/boxes/0/ignore", "false"},
    {"000000", "/boxes/0/motion", "null"},
    {"000000", "/boxes/1/ignore_source", "true"},
    {"000000", "/boxes/1/truncation", "null"},
    {"000000", "/boxes/1/occlusion", "null"},
    {"000000", "/boxes/1/alpha", "null"},
    {"000000", "/boxes/1/box3d", "null"},
    {"000000", "/boxes/1/track_id", "null"},
    {"000000", "/boxes/1/difficulty", "null"},
    {"000000", "/boxes/1/outline", "null"},
    {"000003", "/boxes/0/motion", "[0.5, -2.25, 1.5, 0.984375]"},
    {"000000", "/joint_names", R"(["nose", "left hand", "right hand"])"},
    {"000000", "/joint_aliases", R"(["", "left_wrist", "right_wrist"])"},
    {"000000", "/persons/0/joints", "[[1.5, 1.75], [2.25, 2.875], null]"},
    {"000000", "/persons/0/visible", "[1, 0, 0]"},
    {"000000", "/persons/0/center", "null"},
    {"000000", "/persons/0/scale", "null"},
    {"000000", "/persons/0/scale_volume", "null"},
    {"000000", "/persons/0/head_box_source", "null"},
    {"000000", "/persons/0/box", "null"},
    {"000000", "/persons/0/joints3d_mm", "null"},
    {"000000", "/persons/0/camera", "null"},
    {"000000", "/persons/1/visible", "[1, 0, null]"},
    {"000000", "/persons/1/joints_source", "[[3.5, 4.0], [5.0, 6.25], [7.0, 7.0]]"},
    {"000000", "/persons/1/scale_volume", "0.875"},
    {"000000", "/persons/1/head_box", "[0.5, 1.0, 2.5, 3.25]"},
    {"000000", "/persons/1/joints3d_mm", "[null, [4.0, 5.0, 3001.0], [7.0, 8.0, 3002.0]]"},
    {"000000", "/persons/1/camera_distortion", "[-0.2071, 0.2478, -0.0031, -0.0014, -0.001]"}};

TEST_F(Exporters, WebdatasetHasEveryColumnWithNullForWhatIsUnknown) {
  const std::filesystem::path tar = exported("webdataset") / "demo-val-00000-of-00001.tar";
  for (const auto& [sample, place, expected] : kWebdatasetCases) {
    SCOPED_TRACE(std::string(sample) + place);
    const json labels = json::parse(tar_content(tar, std::string(sample) + ".json"));
    const json::json_pointer pointer(place);
    ASSERT_TRUE(labels.contains(pointer));
    EXPECT_EQ(labels[pointer], json::parse(expected));
  }
}

TEST_F(Exporters, FlowIsAnArrayInWebdatasetAndImagesInDsec) {
  const std::filesystem::path tar = exported("webdataset") / "demo-val-00000-of-00001.tar";
  testing::write_file(folder_ / "a.npz", tar_content(tar, "000004.npz"));
  const ZipArchive arrays(folder_ / "a.npz");
  const PixelFlow flow = testing::example_shard().samples[4].flow;
  std::vector<std::uint16_t> halves;
  for (const float px : flow.px) {
    halves.push_back(static_cast<std::uint16_t>(to_half(std::abs(px)) | (px < 0 ? 0x8000 : 0)));
  }
  const auto text = [](const auto& bytes) {
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  EXPECT_EQ(text(arrays.read("flow.npy")), npy_file("<f2", {2, 6, 8}, halves));
  EXPECT_EQ(text(arrays.read("flow_valid.npy")), npy_file("|u1", {6, 8}, flow.valid));
  EXPECT_FALSE(json::parse(tar_content(tar, "000004.json")).contains("flow"));
  // Labelled is the next image: DSEC's backward flow, from there to the previous one.
  const std::filesystem::path recording = exported("dsec") / "dsec/val/000004";
  EXPECT_EQ(testing::read_file(recording / "flow/backward_timestamps.txt"),
            "# from_timestamp_us, to_timestamp_us\n1000000, 0\n");
  EXPECT_TRUE(std::filesystem::exists(recording / "flow/backward/000000.png"));
  EXPECT_FALSE(std::filesystem::exists(recording / "flow/forward_timestamps.txt"));
  EXPECT_FALSE(moves_events(recording / "events/left/rectify_map.h5", {6, 8}));
  EXPECT_FALSE(std::filesystem::exists(recording / "../000000/events/left/rectify_map.h5"));
}

TEST_F(Exporters, EventsHaveTheCountsOfTheVolume) {
  const std::filesystem::path out = exported("events") / "events/val";
  for (const std::size_t slot : {0, 1, 3, 4}) {
    const std::string text = testing::read_file(out / ("00000" + std::to_string(slot) + ".txt"));
    EXPECT_EQ(std::ranges::count(text, '\n'), event_count(slot)) << slot;
  }
}

TEST_F(Exporters, EventsInMvsecsLayoutAreTheSame) {
  ExportOptions options;
  options.event_file = EventFile::kMvsec;
  const Hdf5Arrays file = read_hdf5_arrays(exported("events", options) / "events/val/000000.hdf5");
  const TypedArray& events = file.arrays.at("davis/left/events");
  EXPECT_THAT(events.shape, ElementsAre(static_cast<std::size_t>(event_count(0)), 4u));
}

/// A recording's format: where the boxes and the events of the sequence drive_0 are.
struct RecordingCase {
  const char* word;
  const char* boxes;
  double t_us;  ///< of the label, on the clock of the format
  const char* events;
};

void PrintTo(const RecordingCase& format, std::ostream* out) { *out << format.word; }

class RecordingExporters : public Exporters, public ::testing::WithParamInterface<RecordingCase> {};

TEST_P(RecordingExporters, HaveTheBoxOfTheSequenceAndItsEvents) {
  const RecordingCase& format = GetParam();
  const std::filesystem::path out = exported_with_frames(format.word);
  // The pair lies between 1.0 s and 1.2 s, where its label is.
  EXPECT_THAT(records(out / format.boxes, {"t", "x", "y", "w", "h", "class_id", "track_id"}),
              ElementsAre(ElementsAre(format.t_us), ElementsAre(1), ElementsAre(1),
                          ElementsAre(3.25), ElementsAre(3.5), ElementsAre(0), ElementsAre(7)));
  const std::filesystem::path events = out / format.events;
  if (events.extension() == ".h5") {
    EXPECT_EQ(read_hdf5_arrays(events).arrays.at("events/x").size(),
              static_cast<std::size_t>(event_count(0, kTimes)));
  } else {
    const auto recording = open_recording(events);
    const std::vector<Event> all = recording->events_in(-1, 10);
    EXPECT_EQ(std::ssize(all), event_count(0, kTimes));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, RecordingExporters,
    ::testing::Values(
        RecordingCase{"dsec", "dsec/val/drive_0/object_detections/left/tracks.npy", 1'200'000,
                      "dsec/val/drive_0/events/left/events.h5"},
        RecordingCase{"raw", "raw/val/drive_0_bbox.npy", 200'000, "raw/val/drive_0.raw"},
        RecordingCase{"aedat4", "aedat4/val/drive_0_bbox.npy", 1'200'000,
                      "aedat4/val/drive_0.aedat4"},
        RecordingCase{"rvt", "raw/val/drive_0_bbox.npy", 200'000, "raw/val/drive_0_td.h5"}),
    [](const auto& format) { return format.param.word; });

TEST_F(Exporters, RvtTakesHistogramsAndVolumesAlone) {
  for (const auto& [word, message] :
       {std::pair{"voxel:5", "--representation: expected histogram:T or volume, got voxel:5"},
        {"histogram", "expected histogram:T, T from 1 to 64, got \"histogram\""},
        {"volume:9", "--representation: expected histogram:T or volume, got volume:9"}}) {
    ExportOptions options;
    options.representation = word;
    EXPECT_THAT([&] { exported("rvt", options); },
                ::testing::ThrowsMessage<UsageError>(::testing::HasSubstr(message)));
  }
  // A box of 3 pixels is smaller than RVT takes.
  EXPECT_FALSE(std::filesystem::exists(exported("rvt") / "preprocessed"));
}

TEST_F(Exporters, DsecHasAnImageForEachTimeAndTheEventsAtHalfTheSize) {
  const std::filesystem::path drive = exported_with_frames("dsec") / "dsec/val/drive_0";
  EXPECT_EQ(testing::read_file(drive / "images/timestamps.txt"), "1000000\n1200000\n");
  for (const char* name : {"000000.png", "000001.png"}) {
    const ColourFrame image = decode_image_file(drive / "images/left/distorted" / name);
    EXPECT_EQ(image.size, (ImageSize{6, 8}));
    EXPECT_THAT(image.bgr, Each(kLevel));
  }
  EXPECT_FALSE(std::filesystem::exists(drive / "images/left/distorted/000002.png"));

  const Hdf5Arrays all = read_hdf5_arrays(drive / "events/left/events.h5");
  const Hdf5Arrays half = read_hdf5_arrays(drive / "events/left/events_2x.h5");
  const auto column = [](const Hdf5Arrays& file, const std::string& name) {
    return numbers(file.arrays.at(name));
  };
  // Where the sum of polarities of 2 x 2 pixels is 4 more, or less, than at the last such event.
  std::map<std::pair<double, double>, int> sums;
  std::vector<std::vector<double>> expected(4);
  for (std::size_t i = 0; i < column(all, "events/t").size(); ++i) {
    const auto at = [&](const char* name) { return column(all, name)[i]; };
    const std::pair place(std::floor(at("events/x") / 2), std::floor(at("events/y") / 2));
    sums[place] += at("events/p") == 1 ? 1 : -1;
    if (sums[place] % 4 != 0 || sums[place] == 0) continue;
    sums[place] = 0;
    const double row[] = {place.first, place.second, at("events/t"), at("events/p")};
    for (std::size_t k = 0; k < 4; ++k) expected[k].push_back(row[k]);
  }
  EXPECT_FALSE(expected[0].empty());
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(column(half, std::string("events/") + "xytp"[k]), expected[k]);
  }
  EXPECT_EQ(column(half, "t_offset"), column(all, "t_offset"));
  EXPECT_EQ(column(half, "ms_to_idx").size(), column(all, "ms_to_idx").size());
  EXPECT_EQ(column(half, "ms_to_idx").back(), static_cast<double>(expected[0].size()));
}

TEST_F(Exporters, DsecGoesWithoutFramesThatAreGoneAndSaysSo) {
  ExportOptions options;
  options.to = &*std::ranges::find(export_formats(), "dsec", &ExportFormat::word);
  options.out = folder_ / "out";
  options.splits = {"val"};
  for (int turn = 0; turn < 2; ++turn) {  // what is done already says it, too
    EXPECT_THAT(run_export(converted_->path(), options).notes,
                Contains(AllOf(HasSubstr("no images of kitti_object in split val: "),
                               HasSubstr("prev_2/000000_02.png"), HasSubstr("--frames names"))));
  }
  const std::filesystem::path images = folder_ / "out/dsec/val/drive_0/images";
  EXPECT_FALSE(std::filesystem::exists(images / "left"));
  EXPECT_EQ(testing::read_file(images / "timestamps.txt"), "1000000\n1200000\n");
}

TEST_F(Exporters, RvtHasTheVolumeWithTheNegativePolarityFirst) {
  ExportOptions options;
  options.representation = "volume";
  const std::filesystem::path drive = exported("rvt", options) / "preprocessed/val/drive_0";
  const std::filesystem::path volumes = drive / "event_representations_v2/eventgan_nbins=2";
  const Hdf5Arrays file = read_hdf5_arrays(volumes / "event_representations.h5");
  const TypedArray& data = file.arrays.at("data");
  EXPECT_THAT(data.shape, ElementsAre(1u, kChannels, 6u, 8u));
  std::vector<float> expected = volume(0);
  std::rotate(expected.begin(), expected.begin() + expected.size() / 2, expected.end());
  EXPECT_THAT(numbers(data), Pointwise(DoubleNear(1e-3), expected));
  EXPECT_THAT(numbers(npy(volumes / "timestamps_us.npy")), ElementsAre(200'000));
  EXPECT_THAT(numbers(npy(volumes / "objframe_idx_2_repr_idx.npy")), ElementsAre(0));
  const ZipArchive labels(drive / "labels_v2/labels.npz");
  EXPECT_THAT(records(labels.read("labels.npy"), {"t", "x"}),
              ElementsAre(ElementsAre(200'000), ElementsAre(1)));
}

}  // namespace
}  // namespace eventgan
