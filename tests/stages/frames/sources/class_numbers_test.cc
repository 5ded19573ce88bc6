#include "stages/frames/sources/class_numbers.h"

#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

/// Sources of one image each, with a table or texts of labels.
class ClassNumbers : public FolderTest {
 protected:
  void add(const std::string& name, LabelFormat format, const std::string& path) {
    images({name + "/images/1.png"});
    SourceSpec& source = sources_.emplace_back();
    source.root = name + "/images";
    source.labels = {format, path};
    datasets_.push_back(open_dataset(source, folder_.path()));
  }
  /// A box of each class.
  void add_table(const std::string& name, const ClassNames& classes) {
    std::string text = "image,class,left,top,right,bottom\n";
    for (const std::string& one : classes) text += "1.png," + one + ",1,1,9,9\n";
    if (classes.empty()) text += "1.png,,,,,\n";
    write(name + "/boxes.csv", text);
    add(name, LabelFormat::kCsv, name + "/boxes.csv");
  }
  /// A box of the last class.
  void add_texts(const std::string& name, const ClassNames& classes) {
    std::string all;
    for (const std::string& one : classes) all += one + "\n";
    write(name + "/classes.txt", all);
    write(name + "/labels/1.txt", std::to_string(classes.size() - 1) + " 0.5 0.5 0.5 0.5\n");
    add(name, LabelFormat::kYolo, name);
  }

  const ClassNames& names(std::size_t i) const { return datasets_[i]->label_schema().class_names; }
  /// What each box of the source is called.
  ClassNames boxes(std::size_t i) const {
    ClassNames found;
    for (const Box& box : annotation_of(*datasets_[i]).boxes) {
      found.push_back(names(i).at(static_cast<std::size_t>(box.class_id)));
    }
    return found;
  }

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

TEST_F(ClassNumbers, OthersThanTheSourceTakesAreLeftOutAndCounted) {
  add_table("train", {"person", "bike", "car", "DontCare"});
  add_table("val", {"person", "car"});
  for (SourceSpec& source : sources_) source.classes = {"person", "car"};
  for (int call = 0; call < 2; ++call) {
    number_classes(sources_, datasets_);
    EXPECT_THAT(names(0), ElementsAre("person", "car", "DontCare"));
    EXPECT_EQ(names(1), names(0));
    EXPECT_THAT(boxes(0), ElementsAre("person", "car", "DontCare"));
    EXPECT_EQ(datasets_[0]->annotation("1.png")->of_other_classes, 1u);
    EXPECT_EQ(datasets_[1]->annotation("1.png")->of_other_classes, 0u);
  }
  sources_[0].classes = {};  // all of its own, with the numbers of both
  number_classes(sources_, datasets_);
  EXPECT_THAT(boxes(0), ElementsAre("person", "bike", "car", "DontCare"));
  sources_[1].classes = {"bike"};
  EXPECT_THROWS(number_classes(sources_, datasets_), InputError,
                StrEq("expected classes of the source (car, person), got bike, in val/images"));
  sources_[1].classes = {"persn"};
  EXPECT_THROWS(number_classes(sources_, datasets_), InputError,
                "got persn, in val/images; did you mean person?");
}

TEST_F(ClassNumbers, OfManyTwentyAreNamed) {
  ClassNames many;
  for (char letter = 'a'; letter <= 'z'; ++letter) many.emplace_back(3, letter);
  add_table("train", many);
  sources_[0].classes = {"zz"};
  EXPECT_THROWS(number_classes(sources_, datasets_), InputError, "(aaa, bbb, ",
                ", ttt, ...), got zz, in train/images; did you mean zzz?");
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
