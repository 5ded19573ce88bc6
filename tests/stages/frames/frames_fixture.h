#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/frames/dataset/dataset.h"
#include "tests/testing/image_file.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

/// What the tests of all kinds of datasets share: a folder of small files, and a dataset's answers
/// as texts, so that one comparison holds all of an answer.
namespace eventgan {

namespace fs = std::filesystem;
using namespace std::string_literals;
using ::testing::_;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Optional;
using ::testing::Pair;
using testing::read_file;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::StrEq;
using testing::TemporaryFolder;
using testing::Words;
using testing::write_file;
using testing::write_flat_image;

using State = PairedFrame::State;
using Texts = std::vector<std::string>;

/// Why there is no result; "no fault" if there is one.
template <class T>
std::string fault_of(const Outcome<T>& outcome) {
  return is_fault(outcome) ? outcome.fault().reason : "no fault";
}

/// "PATH INDEX".
inline std::string text_of(const FrameRef& frame) {
  return frame.path + " " + std::to_string(frame.index);
}

/// "present PATH INDEX", "missing PATH INDEX" or "beyond".
inline std::string text_of(const PairedFrame& frame) {
  if (frame.state == State::kBeyond) return "beyond";
  return (frame.state == State::kPresent ? "present " : "missing ") + text_of(frame.frame);
}

/// The frames so many steps after a labelled one.
inline Texts paired(const Dataset& dataset, std::size_t frame, std::initializer_list<int> steps) {
  Texts texts;
  for (const int step : steps) {
    texts.push_back(text_of(dataset.paired_frame(dataset.labelled_frames().at(frame), step)));
  }
  return texts;
}

inline Texts ids_of(const std::vector<LabelledFrame>& frames) {
  Texts ids;
  for (const LabelledFrame& frame : frames) ids.push_back(frame.sample_id);
  return ids;
}
inline Texts ids_of(const Dataset& dataset) { return ids_of(dataset.labelled_frames()); }

/// Why no pair of a frame can be trusted, of each.
inline Texts faults_of(const Dataset& dataset) {
  Texts faults;
  for (const LabelledFrame& frame : dataset.labelled_frames()) faults.push_back(frame.fault);
  return faults;
}

/// "SAMPLE_ID of SEQUENCE: PATH INDEX by LABEL_KEY".
inline std::string text_of(const LabelledFrame& frame) {
  return frame.sample_id + " of " + frame.sequence + ": " + text_of(frame.frame) + " by " +
         frame.label_key;
}

inline std::string fault_of(const Dataset& dataset, std::size_t frame = 0) {
  return fault_of(dataset.annotation(dataset.labelled_frames().at(frame).label_key));
}

/// A label that has to be sound.
inline Annotation annotation_of(const Dataset& dataset, const std::string& label_key) {
  const auto read = dataset.annotation(label_key);
  EXPECT_EQ(fault_of(read), "no fault") << label_key;
  return is_fault(read) ? Annotation() : *read;
}
inline Annotation annotation_of(const Dataset& dataset, std::size_t frame = 0) {
  return annotation_of(dataset, dataset.labelled_frames().at(frame).label_key);
}

inline std::vector<Rectangle> rectangles(const Annotation& annotation) {
  std::vector<Rectangle> all;
  for (const Box& box : annotation.boxes) all.push_back(box.xyxy);
  return all;
}

/// A test with a folder of its own.
class FolderTest : public ::testing::Test {
 protected:
  fs::path at(const fs::path& name) const { return folder_.path() / name; }
  void write(const fs::path& name, std::string_view text = "") const { write_file(at(name), text); }
  /// Empty files.
  void touch(const Texts& names) const {
    for (const std::string& name : names) write(name);
  }
  void images(const Texts& names, ImageSize size = {30, 40}, int value = 9) const {
    for (const std::string& name : names) write_flat_image(at(name), size, value);
  }

  const TemporaryFolder folder_;
};

}  // namespace eventgan
