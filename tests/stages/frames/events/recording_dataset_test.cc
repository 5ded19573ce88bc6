#include "stages/frames/events/recording_dataset.h"

#include <fmt/core.h>

#include <atomic>
#include <cstdint>
#include <thread>

#include "manifests/files/input_file.h"
#include "tests/stages/frames/events/recording_dataset_fixture.h"
#include "tests/testing/npy_bytes.h"

namespace eventgan {
namespace {

TEST_F(RecordingDatasetTest, BoxesWithoutAnAreaAreTheFaultOfTheirSample) {
  label("1.25,1,1,2,2,car,\n1.5,0,0,1,1,car,\n1.5,1,0,1,2,car,dont_care\n1.75,2,3,1,4,car,\n");
  const auto dataset = open();
  EXPECT_EQ(fault_of(*dataset, 0), "no fault");
  EXPECT_EQ(fault_of(*dataset, 1),
            "expected boxes of a width and height above 0, got 0 x 2, in drive.csv (1.500000 s)");
  EXPECT_THAT(fault_of(*dataset, 2), HasSubstr("got -1 x 1, in drive.csv (1.750000 s)"));
}

/// The small recording with its frames so many seconds later.
std::map<std::string, testing::Hdf5Dataset> frames_later(double seconds) {
  auto datasets = testing::small_mvsec();
  std::vector<double> times = testing::kSmallTimes;
  for (double& time : times) time += seconds;
  datasets["davis/left/image_raw_ts"].values = times;
  datasets.erase("davis/left/image_raw_event_inds");
  datasets.erase("davis/left/flow_dist");
  return datasets;
}

TEST_F(RecordingDatasetTest, WarnsWhereWindowsLieElsewhereThanTheEvents) {
  EXPECT_THAT(open()->warnings(), IsEmpty());
  EXPECT_THAT(open()->notes(), IsEmpty());
  // Windows of the second and third frame: (1001, 1001.5] and (1001.5, 1002].
  testing::write_hdf5(at("drive.h5"), frames_later(1000));
  constexpr char kBoth[] =
      "expected windows within the times of the events, 0.5 s to 2.5 s, got 2 of 2 outside them, "
      "at 1001.5 s to 1002 s (are events, frames and labels on one clock?), in drive.h5";
  EXPECT_THAT(open()->warnings(), ElementsAre(kBoth));
  EXPECT_THAT(open()->notes(), ElementsAre(kBoth));
  spec_.window.events = 3;  // the last three events of all, whatever the label
  EXPECT_THAT(open()->warnings(), ElementsAre(HasSubstr("got 3 of 3 outside them, at 1001 s")));
  spec_.window.events.reset();
  testing::write_hdf5(at("drive.h5"), frames_later(-1000));
  EXPECT_THAT(open()->warnings(), ElementsAre(HasSubstr("at -998.5 s to -998 s")));
  // (2.25, 2.75] has an event, (2.75, 3.25] is behind the last one: for a note, no more.
  testing::write_hdf5(at("drive.h5"), frames_later(1.25));
  EXPECT_THAT(open()->warnings(), IsEmpty());
  EXPECT_THAT(open()->notes(), ElementsAre(AllOf(HasSubstr("got 1 of 2 outside them, at 3.25 s"),
                                                 Not(HasSubstr("clock")))));
}

TEST_F(RecordingDatasetTest, WarnsOfARecordingWithoutEvents) {
  auto datasets = frames_later(0);
  datasets["davis/left/events"] = {{0, 4}, std::vector<double>{}};
  testing::write_hdf5(at("drive.h5"), datasets);
  EXPECT_THAT(open()->warnings(),
              ElementsAre("1 recording without events (2 empty event volumes): drive.h5"));
}

/// Prophesee's boxes: rows of t in µs, x, y, w, h.
std::string bboxes(const std::vector<std::array<double, 5>>& rows) {
  std::string bytes;
  for (const auto& row : rows) {
    bytes.append(reinterpret_cast<const char*>(row.data()), sizeof(row));
    bytes += '\0';
  }
  return testing::npy_file(
      fmt::format("{{'descr': [('t', '<f8'), ('x', '<f8'), ('y', '<f8'), ('w', '<f8'), ('h', "
                  "'<f8'), ('class_id', '|u1')], 'fortran_order': False, 'shape': ({},), }}",
                  rows.size()),
      bytes);
}

TEST_F(RecordingDatasetTest, PropheseesBoxesOutsideAreLeftOutAndTheirTimesStay) {
  // Of 4x3 pixels: one within, one beyond each side; two without a size; one partly beyond.
  write("drive_bbox.npy", bboxes({{1'250'000, 1, 1, 2, 1},
                                  {1'250'000, 4, 1, 2, 1},
                                  {1'250'000, -2, 1, 2, 1},
                                  {1'250'000, 1, -5, 2, 5},
                                  {1'250'000, 1, 3, 2, 5},
                                  {1'500'000, 1, 1, 0, 1},
                                  {1'500'000, 2, 1, 1, -1},
                                  {1'750'000, -1, 2, 2, 5}}));
  const auto dataset = open();
  EXPECT_THAT(faults_of(*dataset), ElementsAre("", "", ""));
  EXPECT_THAT(annotation_of(*dataset, 0).boxes,
              ElementsAre(Box{.class_id = 0, .xyxy = {1, 1, 3, 2}}));
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, IsEmpty());
  EXPECT_THAT(annotation_of(*dataset, 1).original, HasSubstr("\"h\":-1.0"));
  EXPECT_THAT(annotation_of(*dataset, 2).boxes,
              ElementsAre(Box{.class_id = 0, .xyxy = {-1, 2, 1, 7}}));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 file with boxes beyond the sensor: 1 cut to it, 6 left out since they "
                          "are outside or without a size (their times stay): drive_bbox.npy"));
  EXPECT_EQ(dataset->warnings(), dataset->notes());
}

TEST_F(RecordingDatasetTest, TimesTooCloseAreOneSampleAtFault) {
  label("1.25\n1.5\n1.500001,0,0,1,1,car,\n1.75\n");
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("drive/0000000001.250000", "drive/0000000001.500000",
                                            "drive/0000000001.750000"));
  EXPECT_THAT(faults_of(*dataset),
              ElementsAre("",
                          "expected times more than two microseconds apart, got 1.5 s and "
                          "another, in drive.csv (1.500000 s) (drive/0000000001.500000)",
                          ""));
  for (const char* rows : {"1.75\n1.7500015\n1.750003\n", "1.4999991\n1.5000009\n"}) {
    label(rows);
    EXPECT_THAT(faults_of(*open()), ElementsAre(HasSubstr("two microseconds apart"))) << rows;
  }
}

TEST_F(RecordingDatasetTest, CorruptEventsAreTheFaultOfTheirWindow) {
  auto datasets = testing::small_mvsec();
  std::get<std::vector<double>>(datasets["davis/left/events"].values)[4 * 4] = std::nan("");
  testing::write_hdf5(at("bad.h5"), datasets);
  spec_.root = "bad.h5";
  const auto dataset = open();
  EXPECT_THAT(events(*dataset, 0), ElementsAre(all_[2], all_[3]));
  EXPECT_THAT(fault_of(dataset->events(dataset->labelled_frames()[1].label_key)),
              AllOf(HasSubstr("got"), HasSubstr("event 4")));
}

TEST_F(RecordingDatasetTest, AFolderHoldsRecordingsOfAnyLayout) {
  drive("all/b.hdf5");
  write("all/a/images.txt", "1.0 x.pgm\n2.0 x.pgm\n");
  write("all/a/x.pgm", "P5 2 1 255\nab");
  write("all/a/events.txt", "1.25 1 0 1\n1.5 0 0 0\n");
  write("all/b_gt.hdf5", "no recording");
  spec_.root = "all";
  auto dataset = open();
  EXPECT_THAT(ids_of(*dataset),
              ElementsAre("a/0000000002.000000", "b/0000000001.500000", "b/0000000002.000000"));
  EXPECT_THAT(events(*dataset, 0), ElementsAre(Event{1, 0, 1.25, true}, Event{0, 0, 1.5, false}));
  EXPECT_EQ(dataset->sensor_size("a/2"), (ImageSize{1, 2}));
  EXPECT_EQ(dataset->labelled_frames()[0].frame.path, "all/a/events.txt");
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("all/a/images.txt"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 entry left out in all: b_gt.hdf5"));
  // With labels of one of them the others are left out.
  write("labels/b.csv", kLabelHeader + "1.75,0,0,1,1,car,\n"s);
  spec_.annotations = "labels";
  dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("b/0000000001.750000"));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("labels/b.csv"));
  EXPECT_THAT(dataset->notes(), Contains("1 recording without labels left out in all: a"));
}

/// A box of DSEC-Det's at 1 s, and its events.
class TracksTest : public RecordingDatasetTest {
 protected:
  TracksTest() {
    using Numbers = std::vector<std::int64_t>;
    for (const char* name : {"events.h5", "events_2x.h5"}) {
      testing::write_hdf5(at("train/seq/events/left/"s + name),
                          {{"events/x", {{2}, Numbers{0, 1}}},
                           {"events/y", {{2}, Numbers{0, 1}}},
                           {"events/t", {{2}, Numbers{0, 1'000'000}}},
                           {"events/p", {{2}, Numbers{0, 1}}}});
    }
    write(kTracks, testing::npy_file(
                       "{'descr': [('t', '<f8'), ('x', '<f8'), ('y', '<f8'), ('h', '<f8'), ('w', "
                       "'<f8'), ('class_id', '<f8'), ('track_id', '<f8')], 'fortran_order': False, "
                       "'shape': (1,), }",
                       numbers({1e6, 0, 1, 2, 3, 4, 7})));
    spec_.recording.sensor = ImageSize{3, 4};
    spec_.window.duration_s = 0.5;
  }

  static std::string numbers(const std::vector<double>& values) {
    return {reinterpret_cast<const char*>(values.data()), 8 * values.size()};
  }

  static constexpr char kTracks[] = "train/seq/object_detections/left/tracks.npy";
};

TEST_F(TracksTest, OfDsecDetAreFoundInTheirPlace) {
  for (const char* root : {"train", "train/seq", "train/seq/events/left/events.h5"}) {
    SCOPED_TRACE(root);
    spec_.root = root;
    const auto dataset = open();
    EXPECT_THAT(annotation_of(*dataset).boxes,
                ElementsAre(Box{.class_id = 0, .xyxy = {0, 1, 3, 3}, .track_id = 7}));
    EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("class 4"));
    EXPECT_THAT(dataset->annotation_files(), Contains(kTracks));
  }
  fs::create_directories(at("det/seq"));
  fs::rename(at("train/seq/object_detections"), at("det/seq/object_detections"));
  spec_.root = "train";
  EXPECT_THAT(open()->annotation_files(), IsEmpty());
  spec_.annotations = "det";
  EXPECT_THAT(open()->annotation_files(), Contains("det/seq/object_detections/left/tracks.npy"));
}

TEST_F(TracksTest, HaveTheNamesOfTheExportThatTheyLieIn) {
  write("label_map_dictionary.json", R"({"4": "car"})");  // of another dataset, perhaps
  spec_.root = "train";
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("class 4"));
  write("export.json", "{}");
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("car"));
  EXPECT_THAT(open()->annotation_files(), Contains("label_map_dictionary.json"));
}

TEST_F(TracksTest, AreOfThePixelsOfTheEventsAsRecorded) {
  spec_.root = "train/seq/events/left/events_2x.h5";
  EXPECT_THAT(open()->annotation_files(), IsEmpty());
  EXPECT_THAT(open()->notes(),
              ElementsAre(HasSubstr("no labels, since they are of the pixels of")));
}

TEST_F(RecordingDatasetTest, RefusesWhatDoesNotFit) {
  label("1.5\n");
  write("drive.json", R"({"format": "eventgan-labels", "version": 1, "samples": []})");
  refused("labels in one file, got two");
  spec_.annotations = "drive.json";
  refused("got none, in drive.h5");
  spec_.annotations = "absent.csv";
  refused("absent.csv");
  spec_.annotations.reset();
  fs::remove(at("drive.json"));
  label("1.75,a,2,3,4,car,\n");
  refused("drive.csv (line 2)");
  write("drive.json", R"({"format": "eventgan-manifest"})");
  label("1.75\n");
  const auto dataset = open();  // a job beside it
  EXPECT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_THROWS(dataset->sensor_size("drive/x"), InputError, "expected");
  EXPECT_TRUE(is_fault(dataset->events("other/1.75")));
  EXPECT_TRUE(is_fault(dataset->annotation("drive/1.5")));
  EXPECT_TRUE(is_fault(dataset->annotation("other/1.75")));
  EXPECT_EQ(dataset->label_place("other/1.75"), "other/1.75");
  spec_.recording.camera = "right";
  refused("expected a recording of an event camera, got HDF5 of another layout");
  spec_.root = "absent";
  refused("absent");
  drive("all/a.h5");
  drive("all/a.hdf5");
  spec_.root = "all";
  spec_.recording.camera = "left";
  refused("got a twice");
}

TEST_F(RecordingDatasetTest, ARecordingThatDoesNotOpenAnyMoreSaysWhy) {
  drive("all/a.h5");
  drive("all/b.h5");
  spec_.root = "all";
  const std::string key = open()->labelled_frames().at(2).label_key;
  fs::resize_file(at("all/b.h5"), fs::file_size(at("all/b.h5")) / 2);
  EXPECT_THAT(fault_of(open()->events(key)), AllOf(HasSubstr("b.h5"), HasSubstr("truncated")));
}

// HDF5 that is cut, RAW of a kind that is not read, AEDAT of another version.
TEST_F(RecordingDatasetTest, TellsOfRecordingsThatCannotBeRead) {
  drive("all/a.h5");
  drive("all/b.h5");
  fs::resize_file(at("all/b.h5"), fs::file_size(at("all/b.h5")) / 2);
  write("all/c.raw", "% evt 4.0\n% end\n");
  write("all/d.aedat", "#!AER-DAT3.1\r\n");
  write("all/e.raw", "% evt 3.0\n% end\n");  // of no known size
  write("all/notes.txt", "no recording");
  spec_.root = "all";
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("a/0000000001.500000", "a/0000000002.000000"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 entry left out in all: notes.txt"));
  const Dataset::Unreadable unreadable = dataset->unreadable();
  EXPECT_EQ(unreadable.of, 5);
  EXPECT_THAT(unreadable.reasons,
              ElementsAre(AllOf(HasSubstr("b.h5"), HasSubstr("truncated")),
                          AllOf(HasSubstr("c.raw"), HasSubstr("2.0, 2.1 or 3.0")),
                          AllOf(HasSubstr("d.aedat"), HasSubstr("the sensor's size")),
                          AllOf(HasSubstr("e.raw"), HasSubstr("the sensor's size"))));
  for (const auto& [root, reason] : {std::pair("all/b.h5", "truncated"),
                                     {"all/c.raw", "2.0, 2.1 or 3.0"},
                                     {"all/e.raw", "the sensor's size"},
                                     {"all/notes.txt", "a file of another kind"}}) {
    spec_.root = root;
    EXPECT_THROWS(open(), InputError, reason, root);
  }
}

TEST_F(RecordingDatasetTest, ATableBesideARecordingIsNoLabels) {
  write("drive.csv", "0,0,1,1250000\n");
  const auto dataset = open();
  EXPECT_EQ(ids_of(*dataset).size(), 2u);
  EXPECT_THAT(dataset->notes(), ElementsAre(HasSubstr("drive.csv")));
  drive("all/drive.h5");
  write("all/drive.csv", "0,0,1,1250000\n");
  spec_.root = "all";
  EXPECT_EQ(ids_of(*open()), ids_of(*dataset));
  EXPECT_THAT(open()->notes(), Contains(HasSubstr("left out, since the recording is there in "
                                                  "another file: all/drive.csv")));
}

/// Windows of 50,000 events, one each microsecond, that several threads ask for.
TEST_F(RecordingDatasetTest, AFileOfEventsIsOpenedTwiceAndReadOnce) {
  constexpr std::uint32_t kEvents = 50'000;
  std::string table = "t,x,y,p\n";
  std::string dat = "% Data file containing CD events.\n% Version 2\n\x0c\x08";
  for (std::uint32_t t_us = 0; t_us < kEvents; ++t_us) {
    table += std::to_string(t_us) + ",3,2,1\n";
    for (const std::uint32_t word : {t_us, std::uint32_t{1} << 28 | 2 << 14 | 3}) {
      dat.append(reinterpret_cast<const char*>(&word), sizeof(word));
    }
  }
  write("table.csv", table);
  write("camera.dat", dat);
  spec_.recording.sensor = ImageSize{3, 4};
  spec_.recording.columns.tick_s = 1e-6;
  spec_.window.duration_s = 500e-6;
  for (const char* name : {"table.csv", "camera.dat"}) {
    spec_.root = name;
    const InputCounter counter;
    const auto dataset = open();
    const auto& windows = dataset->labelled_frames();
    EXPECT_EQ(windows.size(), 100u);
    std::atomic<std::size_t> next = 0, found = 0;
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        for (std::size_t k = next++; k < windows.size(); k = next++) {
          found += dataset->events(windows[k].label_key)->events.size();
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(found, kEvents);
    const InputCounter::Count count = counter.of(at(name));
    EXPECT_EQ(count.opens, 2u) << name;  // to recognise it, and to read it
    EXPECT_LE(static_cast<double>(count.bytes), 1.2 * static_cast<double>(fs::file_size(at(name))))
        << name;
  }
}

}  // namespace
}  // namespace eventgan
