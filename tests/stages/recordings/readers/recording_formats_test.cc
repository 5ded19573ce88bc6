#include "manifests/values/recording_formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "manifests/values/words.h"
#include "stages/recordings/readers/detail/recording_reader.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

std::string page(const char* path) {
  return testing::read_file(std::filesystem::path(EVENTGAN_SOURCE_DIR) / path);
}

/// The lines of the table behind the one whose cells begin with `head`.
std::vector<std::string> table_behind(const std::string& text, const std::string& head) {
  std::vector<std::string> lines;
  std::size_t begin = text.find('\n', text.find("\n| " + head) + 1) + 1;
  begin = text.find('\n', begin) + 1;  // |---|
  while (text.compare(begin, 2, "| ") == 0) {
    const std::size_t end = text.find('\n', begin);
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

TEST(RecordingFormats, EachHasAReader) {
  for (std::size_t i = 0; i < kRecordingFormats.size(); ++i) {
    EXPECT_EQ(kRecordingReaders[i]->format, kRecordingFormats[i].value)
        << kRecordingFormats[i].word;
    EXPECT_NE(kRecordingReaders[i]->fits, nullptr) << kRecordingFormats[i].word;
    EXPECT_NE(kRecordingReaders[i]->open, nullptr) << kRecordingFormats[i].word;
  }
}

TEST(RecordingFormats, HaveWordsOfTheirOwnAndKeysOfASource) {
  std::set<std::string_view> words, titles;
  for (const RecordingFormatRow& row : kRecordingFormats) {
    words.insert(row.word);
    titles.insert(row.title);
    EXPECT_EQ(to_string(row.value), row.word);
    for (const std::string_view key : row.keys) {
      EXPECT_TRUE(key.empty() || takes(dataset_row(DatasetKind::kRecording), key)) << key;
    }
  }
  EXPECT_EQ(words.size(), kRecordingFormats.size());
  EXPECT_EQ(titles.size(), kRecordingFormats.size());
}

TEST(RecordingFormats, ThePageOfRealEventsSaysWhichHaveFrames) {
  const std::vector<std::string> lines =
      table_behind(page("manifests/guides/real_events.md"), "layout |");
  ASSERT_EQ(lines.size(), kRecordingFormats.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const RecordingFormatRow& row = kRecordingFormats[i];
    EXPECT_TRUE(lines[i].substr(0, lines[i].find(" | ")).find(row.title) != std::string::npos)
        << lines[i];
    EXPECT_EQ(lines[i].ends_with("| no |"), !row.has_frames) << lines[i];
    for (const std::string_view ending : row.extensions) {
      if (ending.empty() || ending == ".h5" || ending == ".hdf5") continue;  // "HDF5" says it
      EXPECT_TRUE(lines[i].find('`' + std::string(ending) + '`') != std::string::npos)
          << lines[i] << " lacks " << ending;
    }
    EXPECT_EQ(lines[i].find("\"camera\"") != std::string::npos, takes(row, "camera")) << lines[i];
  }
}

TEST(RecordingFormats, PagesListThoseThatTrain) {
  std::vector<std::string> words, listed;
  std::string alternatives;
  for (const RecordingFormatRow& row : kFrameFormats) {
    words.emplace_back(row.word);
    alternatives += (alternatives.empty() ? "" : "|") + words.back();
  }
  for (const std::string& line : table_behind(page("manifests/guides/training.md"), "`format` |")) {
    listed.push_back(line.substr(3, line.find('`', 3) - 3));
  }
  EXPECT_EQ(listed, words);
  EXPECT_THAT(page("manifests/guides/realism.md"),
              ::testing::HasSubstr("(`--format " + alternatives + "`)"));
}

TEST(RecordingFormats, TheReadmeNamesAll) {
  std::string titles;
  for (const RecordingFormatRow& row : kRecordingFormats) {
    titles += (titles.empty() ? "" : ", ") + std::string(row.title);
  }
  EXPECT_THAT(page("README.md"), ::testing::HasSubstr("| " + titles + " |"));
}

}  // namespace
}  // namespace eventgan
