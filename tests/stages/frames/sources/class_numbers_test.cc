#include "stages/frames/sources/class_numbers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

/// Sources of one image each, with a table or texts of labels.
class ClassNumbers : public ::testing::Test {
 protected:
  SourceSpec source(const std::string& name) {
    testing::write_flat_image(folder_ / name / "images/1.png", {30, 40}, 9);
    SourceSpec spec;
    spec.root = name + "/images";
    return spec;
  }
  /// A box of each class.
  void add_table(const std::string& name, const ClassNames& classes) {
    std::string text = "image,class,left,top,right,bottom\n";
    for (const std::string& one : classes) text += "1.png," + one + ",1,1,9,9\n";
    if (classes.empty()) text += "1.png,,,,,\n";
    testing::write_file(folder_ / name / "boxes.csv", text);
    sources_.push_back(source(name));
    sources_.back().labels = {LabelFormat::kCsv, name + "/boxes.csv"};
    open();
  }
  /// A box of the last class.
  void add_texts(const std::string& name, const ClassNames& classes) {
    std::string names;
    for (const std::string& one : classes) names += one + "\n";
    testing::write_file(folder_ / name / "classes.txt", names);
    testing::write_file(folder_ / name / "labels/1.txt",
                        std::to_string(classes.size() - 1) + " 0.5 0.5 0.5 0.5\n");
    sources_.push_back(source(name));
    sources_.back().labels = {LabelFormat::kYolo, name};
    open();
  }
  void open() { datasets_.push_back(open_dataset(sources_.back(), folder_.path())); }

  const ClassNames& names(std::size_t i) const { return datasets_[i]->label_schema().class_names; }
  /// What each box of the source is called.
  ClassNames boxes(std::size_t i) const {
    ClassNames found;
    for (const LabelledFrame& frame : datasets_[i]->labelled_frames()) {
      const Annotation annotation = *datasets_[i]->annotation(frame.label_key);
      for (const Box& box : annotation.boxes) {
        found.push_back(names(i).at(static_cast<std::size_t>(box.class_id)));
      }
    }
    return found;
  }

  testing::TemporaryFolder folder_;
  std::vector<SourceSpec> sources_;
  std::vector<std::unique_ptr<Dataset>> datasets_;
};

TEST_F(ClassNumbers, AreThoseOfTheFirstSourceThenTheNext) {
  add_table("train", {"person", "car"});
  add_table("val", {"person", "bike"});
  add_table("test", {});
  datasets_.push_back(nullptr);
  sources_.emplace_back();
  number_classes(sources_, datasets_);
  EXPECT_THAT(names(0), ElementsAre("car", "person", "bike"));
  EXPECT_EQ(names(1), names(0));
  EXPECT_THAT(names(2), IsEmpty());
  EXPECT_THAT(boxes(0), ElementsAre("person", "car"));
  EXPECT_THAT(boxes(1), ElementsAre("person", "bike"));
}

/// Answers each method that has a default with something of its own.
class TellingDataset final : public Dataset {
 public:
  explicit TellingDataset(const std::string& name) { schema_.class_names = {name}; }
  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }
  PairedFrame paired_frame(const LabelledFrame&, int) const override { return {}; }
  Outcome<Annotation> annotation(const std::string&) const override { return Annotation(); }
  Outcome<Annotation> still_annotation(const std::string&) const override {
    Annotation still;
    still.original = "still";
    still.boxes = {Box()};
    return still;
  }
  Outcome<MadePair> made_pair(const std::string&) const override { return SampleFault{"made"}; }
  std::optional<ImageSize> made_size(const std::string&) const override { return ImageSize{3, 4}; }
  ImageSize sensor_size(const std::string&) const override { return {3, 4}; }
  Outcome<EventWindow> events(const std::string&) const override { return EventWindow{{3, 4}, {}}; }
  ImageSizes* image_sizes() const override { return &sizes_; }
  std::string label_place(const std::string& label_key) const override { return label_key; }
  std::vector<std::string> annotation_files() const override { return {"file"}; }
  std::map<std::string, std::string> label_meanings() const override { return {{"a", "b"}}; }
  std::vector<std::string> notes() const override { return {"note"}; }
  std::vector<std::string> warnings() const override { return {"warning"}; }
  Unreadable unreadable() const override { return {{"reason"}, 5}; }

 private:
  LabelSchema schema_;
  std::vector<LabelledFrame> frames_;
  mutable ImageSizes sizes_;
};

TEST_F(ClassNumbers, ChangeNothingElseThatADatasetSays) {
  for (const char* name : {"car", "person"}) {
    sources_.emplace_back();
    datasets_.push_back(std::make_unique<TellingDataset>(name));
  }
  number_classes(sources_, datasets_);
  for (int i : {0, 1}) {
    const Annotation still = *datasets_[static_cast<std::size_t>(i)]->still_annotation("");
    EXPECT_EQ(still.original, "still");
    EXPECT_EQ(still.boxes.at(0).class_id, i);
  }
  for (const auto& dataset : datasets_) {
    EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("car", "person"));
    EXPECT_TRUE(is_fault(dataset->made_pair("")));
    EXPECT_EQ(dataset->made_size(""), (ImageSize{3, 4}));
    EXPECT_EQ(dataset->sensor_size(""), (ImageSize{3, 4}));
    EXPECT_EQ(dataset->events("")->sensor, (ImageSize{3, 4}));
    EXPECT_NE(dataset->image_sizes(), nullptr);
    EXPECT_THAT(dataset->annotation_files(), ElementsAre("file"));
    EXPECT_THAT(dataset->label_meanings(), ElementsAre(Pair("a", "b")));
    EXPECT_THAT(dataset->notes(), ElementsAre("note"));
    EXPECT_THAT(dataset->warnings(), ElementsAre("warning"));
    EXPECT_THAT(dataset->unreadable().reasons, ElementsAre("reason"));
    EXPECT_EQ(dataset->unreadable().of, 5);
  }
}

TEST_F(ClassNumbers, EachKindOfDatasetHasItsOwn) {
  add_table("train", {"car"});
  add_table("val", {"person"});
  sources_[1].dataset = DatasetKind::kKittiObject;
  number_classes(sources_, datasets_);
  EXPECT_THAT(names(0), ElementsAre("car"));
  EXPECT_THAT(names(1), ElementsAre("person"));
}

TEST_F(ClassNumbers, WhatIsStoredKeepsItsNumbers) {
  add_table("train", {"person", "bike"});
  add_table("val", {"ant"});
  number_classes(sources_, datasets_);
  number_classes(sources_, datasets_, {ClassNames{"car", "person"}, std::nullopt});
  EXPECT_THAT(names(0), ElementsAre("car", "person", "bike", "ant"));
  EXPECT_EQ(names(1), names(0));
  EXPECT_THAT(boxes(0), ElementsAre("person", "bike"));
  // Shards of which each source had its own list.
  number_classes(sources_, datasets_, {ClassNames{"person"}, ClassNames{"ant"}});
  EXPECT_THAT(names(0), ElementsAre("person", "ant", "bike"));
  EXPECT_THAT(names(1), ElementsAre("ant", "person", "bike"));
  EXPECT_THAT(boxes(1), ElementsAre("ant"));
}

TEST_F(ClassNumbers, OfLabelsByNumberNewOnesComeLast) {
  add_texts("train", {"car", "person", "bike"});
  number_classes(sources_, datasets_, {ClassNames{"car", "person"}});
  EXPECT_THAT(names(0), ElementsAre("car", "person", "bike"));
  EXPECT_THAT(boxes(0), ElementsAre("bike"));
}

TEST_F(ClassNumbers, WhatLabelsMeanStaysThatOfTheSource) {
  add_texts("train", {"car", "person"});
  add_texts("val", {"person"});
  number_classes(sources_, datasets_);
  EXPECT_THAT(datasets_[0]->label_meanings(),
              ElementsAre(Pair("class 0", "car"), Pair("class 1", "person")));
  EXPECT_THAT(names(1), ElementsAre("car", "person"));
  EXPECT_THAT(datasets_[1]->label_meanings(), ElementsAre(Pair("class 0", "person")));
  add_table("test", {"bike"});
  EXPECT_THAT(datasets_[2]->label_meanings(), IsEmpty());  // rows have names
}

}  // namespace
}  // namespace eventgan
