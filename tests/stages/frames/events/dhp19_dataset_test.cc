#include "stages/frames/events/dhp19_dataset.h"

#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "stages/frames/sources/frame_selection.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/stages/base/archives/mat_writer.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/npy_bytes.h"

namespace eventgan {
namespace {

namespace mat = testing::mat;
using ::testing::UnorderedElementsAre;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const std::vector<std::string> kNames = {"head",  "shoulderR", "shoulderL", "elbowR", "elbowL",
                                         "hipR",  "hipL",      "handR",     "handL",  "kneeR",
                                         "kneeL", "footR",     "footL"};

/// A recording of 4 poses, 10 ms apart, and a camera with 11 events 3 ms apart from 1,000,000 us
/// on, at 0, 3, .. 30 ms; of camera c event i is at (20 c + i, i). In windows of 3 events these are
/// the rows 0..0, 0..1, 1..2 and the end, row floor(2.4) = 2; what is left makes no window.
class Dhp19Test : public FolderTest {
 protected:
  Dhp19Test() {
    spec_.dataset = DatasetKind::kDhp19;
    spec_.root = "dhp19";
    spec_.window.events = 3;
    spec_.window.label = LabelPlace::kMiddle;
    for (const int number : {1, 2, 3, 4}) {
      // P_n: f = 100 n, centre (173, 130), 1 m in front: w = Z + 1000.
      const double f = 100.0 * number;
      write_file(folder_ / ("dhp19/P_matrices/P" + std::to_string(number) + ".npy"),
                 testing::npy_doubles({3, 4}, {f, 0, 173, 173'000,  //
                                               0, f, 130, 130'000,  //
                                               0, 0, 1, 1000}));
    }
    write_events("S1/session1/mov1.h5", 11);
    write_poses("S1_1_1", 4);
  }

  void write_events(const std::string& name, int count) {
    std::map<std::string, testing::Hdf5Dataset> datasets;
    for (int camera = 0; camera < 4; ++camera) {
      std::vector<std::int64_t> time, x, y, polarity;
      for (int i = 0; i < count; ++i) {
        time.push_back(1'000'000 + 3000 * i);
        x.push_back(20 * camera + i);
        y.push_back(i);
        polarity.push_back(i % 2);
      }
      const std::string group = "cam" + std::to_string(camera) + "/";
      const auto columns = static_cast<std::uint64_t>(count);
      datasets[group + "timeStamp"] = {{1, columns}, time};
      datasets[group + "x"] = {{1, columns}, x};
      datasets[group + "y"] = {{1, columns}, y};
      datasets[group + "polarity"] = {{1, columns}, polarity};
    }
    testing::write_hdf5(at("dhp19/DVS_movies") / name, datasets);
  }

  /// Joint j of row r is at (100 j + 10 r, 200 - 30 j, 50 r) mm.
  static std::array<double, 3> joint_at(int joint, int row) {
    return {100.0 * joint + 10 * row, 200.0 - 30 * joint, 50.0 * row};
  }

  void write_poses(const std::string& name, int rows,
                   const std::vector<std::string>& joints = kNames) {
    mat::Fields fields;
    for (std::size_t joint = 0; joint < joints.size(); ++joint) {
      std::vector<double> columns(3 * static_cast<std::size_t>(rows));
      for (int row = 0; row < rows; ++row) {
        for (int axis = 0; axis < 3; ++axis) {
          columns[static_cast<std::size_t>(axis * rows + row)] =
              lost_(static_cast<int>(joint), row)
                  ? kNan
                  : joint_at(static_cast<int>(joint), row)[static_cast<std::size_t>(axis)];
        }
      }
      fields.emplace_back(joints[joint], mat::array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, columns,
                                                            static_cast<std::size_t>(rows), 3));
    }
    mat::write_mat(at("dhp19/Vicon_data") / (name + ".mat"), "XYZPOS", mat::structure(fields));
  }

  std::unique_ptr<Dataset> open() const { return open_dhp19_dataset(spec_, folder_.path()); }

  std::function<bool(int, int)> lost_ = [](int, int) { return false; };
  SourceSpec spec_;
};

TEST_F(Dhp19Test, CutsTheTwoCamerasIntoWindows) {
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset),
              ElementsAre("S1/1_1/2/000000", "S1/1_1/2/000001", "S1/1_1/2/000002",
                          "S1/1_1/3/000000", "S1/1_1/3/000001", "S1/1_1/3/000002"));
  EXPECT_EQ(dataset->label_schema().joint_names, kNames);
  const LabelledFrame& frame = dataset->labelled_frames()[1];
  EXPECT_THAT(paired(*dataset, 1, {-1, 1}),
              ElementsAre("present dhp19/DVS_movies/S1/session1/mov1.h5 3",
                          "present dhp19/DVS_movies/S1/session1/mov1.h5 5"));
  const auto window = *dataset->events(frame.label_key);
  EXPECT_EQ(window.sensor, (ImageSize{260, 346}));
  ASSERT_EQ(window.events.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(window.events[i].x, 43 + i);
    EXPECT_EQ(window.events[i].y, 3 + i);
    EXPECT_NEAR(window.events[i].t_s, 0.003 * (3 + i), 1e-12);
    EXPECT_EQ(window.events[i].positive, i % 2 == 0);
  }
  EXPECT_THAT(
      dataset->annotation_files(),
      ElementsAre("dhp19/P_matrices/P1.npy", "dhp19/P_matrices/P2.npy", "dhp19/P_matrices/P3.npy",
                  "dhp19/P_matrices/P4.npy", "dhp19/Vicon_data/S1_1_1.mat"));
  EXPECT_EQ(frame_origin(DatasetKind::kDhp19, frame.sequence),
            (FrameOrigin{.subject = "S1", .action = "1_1", .camera = "2"}));
}

TEST_F(Dhp19Test, ProjectsTheMeanPoseByTheCamerasMatrix) {
  // Row 2 of joint 1 and all of joint 12 are lost. Of camera 2 the matrix is P3, f = 300; of camera
  // 3 it is P2, f = 200.
  lost_ = [](int joint, int row) { return joint == 12 || (joint == 1 && row == 2); };
  write_poses("S1_1_1", 4);
  const auto dataset = open();
  for (const auto& [key, f] : {std::pair{"S1/1_1/2/000002", 300.0}, {"S1/1_1/3/000002", 200.0}}) {
    // Events 6, 7, 8 at 18, 21, 24 ms: rows 1 and 2.
    const auto annotation = *dataset->annotation(key);
    ASSERT_EQ(annotation.persons.size(), 1u);
    const Person& person = annotation.persons[0];
    ASSERT_EQ(person.joints.size(), 13u);
    for (int joint = 0; joint < 12; ++joint) {
      const double row = joint == 1 ? 1 : 1.5;  // the mean of what is known
      const double x = 100 * joint + 10 * row, y = 200 - 30 * joint, w = 50 * row + 1000;
      const double u = (f * x + 173 * w) / w;
      const double v = 260 - (f * y + 130 * w) / w;
      EXPECT_NEAR(person.joints[joint].at.x, u, 1e-9) << joint;
      EXPECT_NEAR(person.joints[joint].at.y, v, 1e-9) << joint;
      const bool inside = u >= -0.5 && u < 345.5 && v >= -0.5 && v < 259.5;
      EXPECT_EQ(person.joints[joint].visible, inside ? -1 : 0) << joint;
    }
    EXPECT_EQ(person.joints[12], (Joint{kMissingPoint, 0}));
    EXPECT_EQ(person.joints[0].visible, -1);
    EXPECT_EQ(person.joints[11].visible, 0);  // far to the right
    EXPECT_GT(person.scale, 0);
    const auto original = nlohmann::json::parse(annotation.original);
    EXPECT_EQ(original["rows"], (nlohmann::json{1, 2}));
    EXPECT_EQ(original["XYZPOS"]["head"], (nlohmann::json{15.0, 200.0, 75.0}));
    EXPECT_TRUE(original["XYZPOS"]["footL"][0].is_null());
  }
}

// All joints would be missing from every pose, and all windows sound.
TEST_F(Dhp19Test, RefusesMatricesThatProjectNothing) {
  const std::vector<double> zeros(12), equal(12, 7.0), nan(12, kNan), huge(12, 1e308);
  for (const std::vector<double>& matrix : {zeros, equal, nan, huge}) {
    write("dhp19/P_matrices/P3.npy", testing::npy_doubles({3, 4}, matrix));
    EXPECT_THROWS(open(), InputError, "expected a projection of full rank, got [",
                  "in dhp19/P_matrices/P3.npy");
  }
}

TEST_F(Dhp19Test, WindowsThatLastLongerThanThePosesAreLeftOut) {
  write_poses("S1_1_1", 2);  // to 20 ms; the third window ends at 24 ms
  const auto dataset = open();
  EXPECT_THAT(
      ids_of(dataset->labelled_frames()),
      ElementsAre("S1/1_1/2/000000", "S1/1_1/2/000001", "S1/1_1/3/000000", "S1/1_1/3/000001"));
  EXPECT_THAT(dataset->notes(), ElementsAre("2 windows after the last pose left out in "
                                            "dhp19/DVS_movies/S1/session1/mov1.h5"));
  write_poses("S1_1_1", 1);
  EXPECT_EQ(open()->labelled_frames().size(), 2u);
}

TEST_F(Dhp19Test, TakesSubjectsBySplitAndLeavesMovementsOut) {
  for (const std::string subject : {"S12", "S13", "S2"}) {
    for (const int movement : {1, 2}) {
      write_events(subject + "/session2/mov" + std::to_string(movement) + ".hdf5", 3);
      write_poses(subject + "_2_" + std::to_string(movement), 1);
    }
  }
  spec_.selection.cameras = {"0"};
  EXPECT_THAT(ids_of(open()->labelled_frames()),
              UnorderedElementsAre("S1/1_1/0/000000", "S1/1_1/0/000001", "S1/1_1/0/000002",
                                   "S2/2_1/0/000000", "S2/2_2/0/000000", "S12/2_1/0/000000",
                                   "S12/2_2/0/000000"));
  spec_.split = "test";
  EXPECT_THAT(ids_of(open()->labelled_frames()),
              UnorderedElementsAre("S13/2_1/0/000000", "S13/2_2/0/000000"));
  spec_.split = "all";
  EXPECT_EQ(open()->labelled_frames().size(), 9u);
  spec_.selection.subjects = {"S13", "S2"};
  spec_.selection.without_actions = {"2_1"};
  const auto selected = select_frames(open()->labelled_frames(), spec_, folder_.path(), 1);
  EXPECT_THAT(ids_of(selected.frames), UnorderedElementsAre("S13/2_2/0/000000", "S2/2_2/0/000000"));
  spec_.selection.without_actions = {"9_1"};
  EXPECT_THROWS(select_frames(open()->labelled_frames(), spec_, folder_.path(), 1), InputError,
                "1 that it does not have (9_1)");
}

TEST_F(Dhp19Test, CorruptEventsAreTheFaultOfTheirWindow) {
  std::map<std::string, testing::Hdf5Dataset> datasets;
  for (int camera = 0; camera < 4; ++camera) {
    const std::string group = "cam" + std::to_string(camera) + "/";
    // [N] and [N, 1] will do; x of event 4 lies outside.
    datasets[group + "timeStamp"] = {{6}, std::vector<double>{0, 1, 2, 3, 4, 5}};
    datasets[group + "x"] = {{6, 1}, std::vector<double>{0, 1, 2, 3, 346, 5}};
    datasets[group + "y"] = {{1, 6}, std::vector<double>{0, 1, 2, 3, 4, 259}};
    datasets[group + "polarity"] = {{6}, std::vector<double>{-1, 1, -1, 1, 1, 1}};
  }
  testing::write_hdf5(at("dhp19/DVS_movies/S1/session1/mov1.h5"), datasets);
  const auto dataset = open();
  EXPECT_EQ(dataset->events("S1/1_1/2/000000")->events.size(), 3u);
  EXPECT_THAT(fault_of(dataset->events("S1/1_1/2/000001")),
              AllOf(HasSubstr("346"), HasSubstr("cam2, event 4")));
}

TEST_F(Dhp19Test, KeysThatItDoesNotKnowAreFaults) {
  const auto dataset = open();
  for (const std::string key : {"", "S1", "S9/1_1/2/000000", "S1/1_1/22/000000"}) {
    EXPECT_TRUE(is_fault(dataset->events(key))) << key;
    EXPECT_TRUE(is_fault(dataset->annotation(key))) << key;
    EXPECT_EQ(dataset->label_place(key), key);
  }
}

TEST_F(Dhp19Test, NamesWhatIsMissingOrOfAnotherShape) {
  const auto refuses = [&](const std::string& part) { EXPECT_THROWS(open(), InputError, part); };
  std::vector<std::string> joints = kNames;
  joints.back() = "toeL";
  write_poses("S1_1_1", 4, joints);
  refuses("expected a field footL, got none");
  mat::write_mat(at("dhp19/Vicon_data/S1_1_1.mat"), "XYZPOS",
                 mat::structure({{"head", mat::number(1)}}));
  refuses("S1_1_1.mat (XYZPOS)");
  fs::remove(at("dhp19/Vicon_data/S1_1_1.mat"));
  refuses("S1_1_1.mat");
  write_poses("S1_1_1", 4);
  const testing::Hdf5Dataset two{{1, 2}, std::vector<double>{0, 1}};
  testing::write_hdf5(at("dhp19/DVS_movies/S1/session1/mov1.h5"),
                      {{"cam0/timeStamp", two},
                       {"cam0/x", {{1, 3}, std::vector<double>{0, 1, 2}}},
                       {"cam0/y", two},
                       {"cam0/polarity", two}});
  refuses("expected as many numbers as timeStamp, 2");
  write("dhp19/P_matrices/P2.npy", testing::npy_doubles({4, 3}, std::vector<double>(12)));
  refuses("expected a matrix [3, 4], got [4, 3], in dhp19/P_matrices/P2.npy");
  fs::remove(at("dhp19/P_matrices/P2.npy"));
  refuses("P2.npy");
  fs::remove_all(at("dhp19/Vicon_data"));
  refuses("Vicon_data");
  spec_.root = "absent";
  refuses("absent");
}

}  // namespace
}  // namespace eventgan
