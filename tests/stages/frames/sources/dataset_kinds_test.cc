
#include "stages/frames/sources/dataset_kinds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "manifests/values/words.h"
#include "stages/frames/own_labels/label_readers.h"
#include "stages/frames/sources/find_source.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

std::string page(const char* path) {
  return testing::read_file(std::filesystem::path(EVENTGAN_SOURCE_DIR) / path);
}

/// What the first group of `pattern` is, at each place where it fits.
std::vector<std::string> found_in(const std::string& text, const std::string& pattern) {
  const std::regex expression(pattern, std::regex::multiline);
  std::vector<std::string> found;
  for (std::sregex_iterator match(text.begin(), text.end(), expression), end; match != end; ++match)
    found.push_back((*match)[1]);
  return found;
}

TEST(DatasetKinds, EachHasAReader) {
  for (std::size_t i = 0; i < kDatasets.size(); ++i) {
    EXPECT_EQ(kDatasetReaders[i]->kind, kDatasets[i].value) << kDatasets[i].word;
    EXPECT_NE(kDatasetReaders[i]->open, nullptr) << kDatasets[i].word;
  }
}

TEST(DatasetKinds, HaveWordsOfTheirOwnAndSoundRows) {
  std::set<std::string_view> words, titles;
  for (const DatasetRow& row : kDatasets) {
    words.insert(row.word);
    titles.insert(row.title);
    EXPECT_EQ(find_dataset(row.word), &row);
    EXPECT_EQ(row.preset.empty(), row.has_events) << row.word;
    EXPECT_TRUE(row.required_key.empty() || takes(row, row.required_key)) << row.word;
  }
  EXPECT_EQ(words.size(), kDatasets.size());
  EXPECT_EQ(titles.size(), kDatasets.size());
  EXPECT_EQ(find_dataset("kitti"), nullptr);
}

TEST(DatasetKinds, LayoutsOfHuman36mHaveTheManifestsWords) {
  std::set<std::string_view> layouts, words;
  for (const DatasetLayout& layout : kHuman36mReader.layouts) layouts.insert(layout.word);
  for (const auto& known : kLayoutWords) words.insert(known.word);
  EXPECT_EQ(layouts, words);
}

TEST(DatasetKinds, ThePageHasASectionForEach) {
  std::vector<std::string> words;
  for (const DatasetRow& row : kDatasets) words.emplace_back(row.word);
  EXPECT_THAT(found_in(page("manifests/guides/datasets.md"), "^## `(\\w+)`$"),
              ::testing::UnorderedElementsAreArray(words));
}

TEST(DatasetKinds, PagesAndThePackageListThoseThatInitKnows) {
  const std::vector<std::string_view> known = recognised_datasets();
  const std::vector<std::string> words(known.begin(), known.end());
  EXPECT_EQ(
      found_in(page("manifests/guides/datasets.md"), "^\\[`(\\w+)`\\]\\(#\\w+\\), .*known by"),
      words);
  const std::string package = page("manifests/python/eventgan/program.py");
  const std::size_t begin = package.find("def init("), end = package.find("out : str", begin);
  EXPECT_EQ(found_in(package.substr(begin, end - begin), "\"(\\w+)\""), words);
}

TEST(LabelFormats, EachHasAReader) {
  std::set<std::string_view> words, titles;
  for (std::size_t i = 0; i < kLabelFormats.size(); ++i) {
    EXPECT_EQ(kLabelReaders[i]->format, kLabelFormats[i].value) << kLabelFormats[i].word;
    words.insert(kLabelFormats[i].word);
    titles.insert(kLabelFormats[i].title);
  }
  EXPECT_EQ(words.size(), kLabelFormats.size());
  EXPECT_EQ(titles.size(), kLabelFormats.size());
}

TEST(LabelFormats, PagesListThem) {
  std::vector<std::string> titles, words;
  for (const LabelFormatRow& row : kLabelFormats) {
    titles.emplace_back(row.title);
    words.emplace_back(row.word);
  }
  using ::testing::UnorderedElementsAreArray;
  for (const char* path : {"README.md", "manifests/guides/datasets.md"}) {
    const std::string list = found_in(page(path), "labels as ([\\w ,]+ or \\w+)").at(0);
    EXPECT_THAT(found_in(list, "(\\w[\\w ]*?)(?:,| or |$)"), UnorderedElementsAreArray(titles))
        << path;
  }
  const std::string own = page("manifests/guides/own_data.md");
  EXPECT_THAT(found_in(own, "\"labels\": \\{ \"format\": \"(\\w+)\""),
              UnorderedElementsAreArray(words));
  for (std::string title : titles) {
    title[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(title[0])));
    EXPECT_THAT(own, ::testing::HasSubstr("### " + title));
  }
}

}  // namespace
}  // namespace eventgan
