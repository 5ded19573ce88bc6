#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
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
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/pipeline/exports/exporters_fixture.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using testing::Exporters;
using ::testing::HasSubstr;
using testing::kChannels;
using testing::kManifest;
using testing::kPixels;
using ::testing::Not;
using testing::npy;
using testing::numbers;
using ::testing::Pointwise;
using ::testing::UnorderedElementsAre;

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

}  // namespace
}  // namespace eventgan
