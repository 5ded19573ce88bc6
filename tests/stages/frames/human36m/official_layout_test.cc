
#include <limits>
#include <nlohmann/json.hpp>

#include "stages/frames/decoding/pair_reader.h"
#include "stages/frames/human36m/human36m_dataset.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/human36m/human36m_fixture.h"
#include "tests/testing/cdf_file.h"

namespace eventgan {
namespace {

constexpr int kJoints = 32;

const std::string kPositions = "S1/MyPoseFeatures/D2_Positions/";
const std::string kVideos = "h36m/S1/Videos/";

class OfficialLayoutTest : public FolderTest {
 protected:
  static std::string stem(const std::string& action) { return action + ".54138969"; }

  void add_video(const std::string& action, int frames, double frames_per_second = 50) const {
    testing::write_counting_video(at("video.avi"), frames, frames_per_second);
    fs::create_directories(at(kVideos));
    fs::rename(at("video.avi"), at(kVideos + stem(action) + ".mp4"));
  }

  /// In row r, joint j lies at (100 + r, 200 + 2 j) px; in 3-D it is (r, j, 5000) mm.
  void add_poses(const std::string& action, int rows) const {
    write_poses("D2_Positions", action, rows, 2, [](int r, int j) {
      return std::array{100.0f + r, 200.0f + 2 * j};
    });
  }
  void add_poses_3d(const std::string& action, int rows) const {
    write_poses("D3_Positions_mono", action, rows, 3, [](int r, int j) {
      return std::array{1.0f * r, 1.0f * j, 5000.0f};
    });
  }
  /// A video and poses of as many frames.
  void add(const std::string& action, int frames) const {
    add_video(action, frames);
    add_poses(action, frames);
  }
  template <class PlaceOf>
  void write_poses(const std::string& kind, const std::string& action, int rows, int coordinates,
                   PlaceOf place_of) const {
    std::vector<float> values;
    for (int r = 0; r < rows; ++r) {
      for (int j = 0; j < kJoints; ++j) {
        for (const float value : place_of(r, j)) values.push_back(value);
      }
    }
    write("h36m/S1/MyPoseFeatures/" + kind + "/" + stem(action) + ".cdf",
          testing::cdf_bytes({static_cast<std::uint32_t>(rows),
                              static_cast<std::uint32_t>(coordinates * kJoints), values}));
  }

  static SourceSpec spec(const std::string& root, int every) {
    SourceSpec spec;
    spec.dataset = DatasetKind::kHuman36m;
    spec.root = root;
    spec.layout = Human36mLayout::kOfficial;
    spec.every = every;
    return spec;
  }
  std::unique_ptr<Dataset> open(int every = 1) const {
    return open_human36m_dataset(spec("h36m", every), folder_.path());
  }
};

TEST_F(OfficialLayoutTest, GivesEveryFrameOfEveryTakeAsASample) {
  for (const char* action : {"Walking", "Walking 1"}) {
    add(action, 3);
    add_poses_3d(action, 3);
  }
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 6u);
  EXPECT_EQ(text_of(frames[0]),
            "S1/Walking 1/54138969/000001 of S1/Walking 1/54138969: " + kVideos +
                "Walking 1.54138969.mp4 1 by " + kPositions + "Walking 1.54138969.cdf#0");
  EXPECT_EQ(frame_origin(DatasetKind::kHuman36m, frames[0].sequence),
            (FrameOrigin{.subject = "S1", .action = "Walking 1", .camera = "54138969"}));
  EXPECT_EQ(frames[5].sample_id, "S1/Walking/54138969/000003");
  EXPECT_EQ(frames[5].frame, (FrameRef{kVideos + "Walking.54138969.mp4", 3, 2}));
  EXPECT_EQ(frames[5].frame.time_s, 0.04);
  EXPECT_EQ(frames[5].fault, "");
  EXPECT_EQ(frames[5].label_key, kPositions + "Walking.54138969.cdf#2");
  EXPECT_EQ(dataset->label_place(frames[5].label_key), "h36m/" + frames[5].label_key);
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("h36m/S1/MyPoseFeatures/D2_Positions/Walking 1.54138969.cdf",
                          "h36m/S1/MyPoseFeatures/D2_Positions/Walking.54138969.cdf",
                          "h36m/S1/MyPoseFeatures/D3_Positions_mono/Walking 1.54138969.cdf",
                          "h36m/S1/MyPoseFeatures/D3_Positions_mono/Walking.54138969.cdf"));
  const LabelSchema& schema = dataset->label_schema();
  ASSERT_EQ(schema.joint_names.size(), 32u);
  EXPECT_EQ(schema.joint_names[13], "Neck");
  EXPECT_EQ(schema.joint_aliases[1], "right_hip");
  EXPECT_THAT(dataset->notes(), ElementsAre("no intrinsics for 1 cameras of subjects, the first S1 "
                                            "54138969: not in a cameras.pkl in the root"));
}

TEST_F(OfficialLayoutTest, ReadsThePersonOfAFrame) {
  add("Walking", 8);
  add_poses_3d("Walking", 8);
  const std::string key = kPositions + "Walking.54138969.cdf#";
  for (const int every : {1, 3}) {
    const Annotation annotation = annotation_of(*open(every), key + "6");
    const Person& person = annotation.persons.at(0);
    ASSERT_EQ(person.joints.size(), 32u);
    EXPECT_EQ(person.joints[31], (Joint{{106, 262}, -1}));
    EXPECT_EQ(person.joints3d_mm.at(31), (std::array{6.0, 31.0, 5000.0}));
    EXPECT_EQ(person.box, (Rectangle{106, 200, 107, 263}));
    EXPECT_EQ(person.center, (Point{106, 231}));
    EXPECT_DOUBLE_EQ(person.scale, 1.2 * 62 / 200);
    EXPECT_FALSE(person.camera);
    const auto original = nlohmann::json::parse(annotation.original);
    EXPECT_EQ(original.size(), 2u);
    EXPECT_EQ(original["D2_Positions"][31], nlohmann::json::parse("[106.0, 262.0]"));
    EXPECT_EQ(original["D3_Positions_mono"][31], nlohmann::json::parse("[6.0, 31.0, 5000.0]"));
  }
  for (const char* row : {"5", "8", "", "x"}) {  // not taken, or not there
    EXPECT_THAT(fault_of(open(3)->annotation(key + row)), HasSubstr("expected")) << row;
  }
}

TEST_F(OfficialLayoutTest, TakesTheCameraThatProjectsTheJoints) {
  // f = (11, 12) and c = (5, 6) px: at a depth of 132 mm a pixel is 12 mm wide and 11 mm high.
  write("h36m/cameras.pkl",
        camera_pickle(pickled_field("f", "\x0b\x0c") + pickled_field("c", "\x05\x06"), "54138969"));
  add("Walking", 2);
  write_poses("D3_Positions_mono", "Walking", 2, 3, [](int r, int j) {
    const float off = r == 1 && j == 31 ? 12 * 25 : 0;  // 25 px
    return std::array{12.0f * (95 + r) + off, 11.0f * (194 + 2 * j), 132.0f};
  });
  const auto dataset = open();
  EXPECT_EQ(annotation_of(*dataset, 0).persons.at(0).camera, (Intrinsics{11, 12, 5, 6}));
  EXPECT_FALSE(annotation_of(*dataset, 1).persons.at(0).camera);
  EXPECT_THAT(dataset->notes(),
              ElementsAre("no camera for 1 of 2 rows: by cameras.pkl and D3_Positions_mono a joint "
                          "lies up to 25 px from where it is annotated (expected at most 20), in "
                          "h36m/S1/MyPoseFeatures/D2_Positions/Walking.54138969.cdf"));
  EXPECT_THAT(dataset->annotation_files(), Contains("h36m/cameras.pkl"));
}

TEST_F(OfficialLayoutTest, AStepIsAFrameOfThoseTaken) {
  add_video("Walking", 12);
  add_poses("Walking", 11);
  const auto dataset = open(5);
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[1].sample_id, "S1/Walking/54138969/000006");
  EXPECT_EQ(frames[1].label_key, kPositions + "Walking.54138969.cdf#5");
  const std::string video = "present " + kVideos + "Walking.54138969.mp4 ";
  EXPECT_THAT(paired(*dataset, 1, {-2, -1, 0, 1, 2}),
              ElementsAre("beyond", video + "1", video + "6", video + "11", "beyond"));
  const FrameRef before = dataset->paired_frame(frames[1], -1).frame;
  const FrameRef after = dataset->paired_frame(frames[1], 1).frame;
  EXPECT_EQ(before.video_frame, 0);
  EXPECT_EQ(after.video_frame, 10);
  EXPECT_NEAR(after.time_s - before.time_s, 0.2, 1e-12);
  // A frame without a pose is a paired frame like any other.
  EXPECT_THAT(paired(*open(1), 10, {1}), ElementsAre(video + "12"));
}

TEST_F(OfficialLayoutTest, PosesBeyondTheVideosEndAreTold) {
  add_video("Walking", 10);
  add_poses("Walking", 12);
  add_video("Walking 1", 10);
  add_poses("Walking 1", 11);
  EXPECT_EQ(open(1)->labelled_frames().size(), 20u);
  EXPECT_THAT(open(1)->notes()[0],
              "2 videos with labelled frames beyond the end, left out: 1 of "
              "h36m/S1/Videos/Walking 1.54138969.mp4 (11 poses, 10 frames), 2 of "
              "h36m/S1/Videos/Walking.54138969.mp4 (12 poses, 10 frames)");
  const auto thinned = open(5);  // frames 1 and 6 of both, and 11
  EXPECT_EQ(thinned->labelled_frames().size(), 4u);
  EXPECT_THAT(open(7)->notes(), Each(Not(HasSubstr("beyond"))));
}

TEST_F(OfficialLayoutTest, FilesWithoutTheirCounterpartsAreTold) {
  add("Walking", 2);
  add_video("Eating", 2);
  add_poses("Posing", 2);
  add("_ALL 1", 2);  // calibration, no activity
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames().size(), 2u);
  EXPECT_THAT(dataset->notes(),
              ElementsAre("2 videos without poses left out: h36m/S1/Videos/Eating.54138969.mp4, "
                          "h36m/S1/Videos/_ALL 1.54138969.mp4",
                          "1 file of poses without a video left out: "
                          "h36m/S1/MyPoseFeatures/D2_Positions/Posing.54138969.cdf",
                          "1 video without joints in 3-D: h36m/S1/Videos/Walking.54138969.mp4",
                          HasSubstr("no intrinsics")));
  EXPECT_THAT(annotation_of(*dataset).persons[0].joints3d_mm, IsEmpty());
}

TEST_F(OfficialLayoutTest, AVideoThatCannotBeReadIsAFaultOfItsFrames) {
  add_poses("Directions", 3);
  write(kVideos + "Directions.54138969.mp4", "no video");
  add_poses("Eating", 3);
  add_video("Eating", 3, 25);
  const auto dataset = open(2);
  const Texts faults = faults_of(*dataset);
  ASSERT_EQ(faults.size(), 4u);
  EXPECT_THAT(faults[0], AllOf(HasSubstr("expected a video, got "),
                               EndsWith("S1/Videos/Directions.54138969.mp4")));
  EXPECT_THAT(paired(*dataset, 0, {1}), ElementsAre(StartsWith("present")))
      << "the fault is the frame's";
  EXPECT_EQ(faults[2],
            "expected a video of 50 frames a second, as its poses are, got 25, in "
            "h36m/S1/Videos/Eating.54138969.mp4");
  EXPECT_EQ(dataset->notes()[0],
            "2 videos whose samples will be quarantined: " + faults[0] + ", " + faults[2]);
}

TEST_F(OfficialLayoutTest, PosesThatCannotBeReadAreAnErrorOfTheSource) {
  add("Walking", 2);
  add_poses_3d("Walking", 3);
  EXPECT_THROWS(open(), InputError,
                StrEq("expected numbers [2, 96], got numbers [3, 96], in "
                      "h36m/S1/MyPoseFeatures/D3_Positions_mono/Walking.54138969.cdf (Pose)"));
  add_poses_3d("Walking", 2);
  write("h36m/" + kPositions + "Walking.54138969.cdf", "no CDF");
  EXPECT_THROWS(open(), InputError,
                AllOf(HasSubstr("expected a CDF file of version 3"),
                      EndsWith("Walking.54138969.cdf (Pose)")));
  write_poses("D2_Positions", "Walking", 2, 3, [](int, int) { return std::array{0.f, 0.f, 0.f}; });
  EXPECT_THROWS(open(), InputError, "expected numbers [at least 1, 64], got");
}

TEST_F(OfficialLayoutTest, ValuesThatAreNotFiniteAreAFaultOfTheirFrame) {
  add("Walking", 3);
  write_poses("D3_Positions_mono", "Walking", 3, 3, [](int r, int j) {
    return std::array{0.f, 0.f, r == 2 && j == 7 ? std::numeric_limits<float>::quiet_NaN() : 1.f};
  });
  EXPECT_EQ(fault_of(*open(2), 0), "no fault");
  EXPECT_EQ(fault_of(*open(2), 1),
            "expected finite numbers, got nan, in "
            "h36m/S1/MyPoseFeatures/D3_Positions_mono/Walking.54138969.cdf (Pose, row 2)");
}

TEST_F(OfficialLayoutTest, WithoutAnyTakeItIsAnError) {
  EXPECT_THROWS(open(), InputError, "in h36m");
  add_poses("Walking", 3);
  EXPECT_THROWS(
      open(), InputError,
      AllOf(HasSubstr("expected SUBJECT/Videos/ACTION.CAMERA.mp4"), EndsWith("got none, in h36m")));
}

TEST_F(OfficialLayoutTest, PairsOfAThinnedVideoAreItsFrames) {
  add("Walking", 61);
  const auto dataset = open(5);
  const LabelledFrame& last = dataset->labelled_frames().back();  // frame 61
  const FramePair pair{dataset->paired_frame(last, -6).frame, dataset->paired_frame(last, 0).frame,
                       6, last.frame.index, 1};
  EXPECT_NEAR(pair.gap_s(), 0.6, 1e-12);
  const auto outcome = PairReader(folder_.path(), {}).read(pair);
  ASSERT_EQ(fault_of(outcome), "no fault");
  // Frame i, counted from 0, is grey of value 2 i.
  EXPECT_NEAR((outcome->input.front() / 2 + 0.5) * 255, 2 * 30, 1);
  EXPECT_NEAR((outcome->input.back() / 2 + 0.5) * 255, 2 * 60, 1);
}

TEST_F(OfficialLayoutTest, ReadsSharedData) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto dataset = open_human36m_dataset(spec("human36m_official", 5), data);
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 16u);  // 1, 6, ..., 36 of two cameras
  EXPECT_EQ(frames[0].sample_id, "S1/Directions 1/54138969/000001");
  EXPECT_EQ(frames[15].sample_id, "S1/Directions 1/55011271/000036");
  const Person person = annotation_of(*dataset).persons[0];
  // As numpy prints expected.npz: 309.5788, 437.9982; 480.4014, 308.1903, 482.39233.
  EXPECT_NEAR(person.joints[0].at.x, 309.5788, 1e-4);
  EXPECT_NEAR(person.joints[0].at.y, 437.9982, 1e-4);
  EXPECT_NEAR(person.joints3d_mm[0].value()[2], 482.39233, 1e-4);
}

}  // namespace
}  // namespace eventgan
