#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <sstream>
#include <string>

#include "manifests/files/input_file.h"
#include "pipeline/exports/export_job.h"

namespace eventgan {
namespace {

const ExportFormat& format(std::string_view word) {
  for (const ExportFormat& known : export_formats()) {
    if (known.word == word) return known;
  }
  throw std::out_of_range(std::string(word));
}

/// The page's text from a heading to the next one of its level.
std::string section(const std::string& page, std::string_view heading) {
  const std::size_t begin = page.find("\n## " + std::string(heading) + "\n");
  if (begin == page.npos) return "";
  return page.substr(begin, page.find("\n## ", begin + 1) - begin);
}

/// The first word of each line of a section's list of files.
std::vector<std::string> listed_files(const std::string& section) {
  std::vector<std::string> files;
  std::istringstream lines(section.substr(section.find("\n    ") + 1));
  for (std::string line; std::getline(lines, line) && line.starts_with("    ");) {
    if (line.starts_with("     ")) continue;  // what is in the folder of the line before
    std::string file;
    std::istringstream(line) >> file;
    if (file.ends_with(',')) file.pop_back();
    if (!file.ends_with('/') && !file.ends_with("/...")) files.push_back(file);
  }
  return files;
}

TEST(ExportFormats, ThePageHasTheRowsAndTheirFiles) {
  const std::string page = read_text_file(std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" /
                                          "guides" / "exports.md");
  std::size_t rows = 0;
  const auto next_line = [&](std::size_t at) { return page.find('\n', at + 1); };
  for (std::size_t at = next_line(page.find("\n|---")); page.compare(at, 4, "\n| `") == 0;
       at = next_line(at)) {
    ++rows;
  }
  EXPECT_EQ(rows, export_formats().size());
  for (const ExportFormat& known : export_formats()) {
    SCOPED_TRACE(known.word);
    const std::string row =
        "| `" + std::string(known.word) + "` | " + std::string(known.title) + " |\n";
    EXPECT_NE(page.find(row), page.npos) << row;
    const std::string text = section(page, known.word);
    for (const ExportFile& file : known.files) {
      const std::string_view name = file.name.substr(file.name.rfind('/') + 1);
      EXPECT_NE(text.find(name), text.npos) << name;
    }
    const std::vector<std::string> files = listed_files(text);
    EXPECT_FALSE(files.empty());
    for (const std::string& file : files) EXPECT_TRUE(writes(known, file)) << file;
  }
}

TEST(ExportFormats, EachFileIsDescribedAndItsColumnsHaveTypes) {
  const std::set<std::string> types{"Text", "Integer", "Float", "BoundingBox"};
  for (const ExportFormat& known : export_formats()) {
    for (const ExportFile& file : known.files) {
      SCOPED_TRACE(std::string(known.word) + ": " + std::string(file.name));
      EXPECT_FALSE(file.what.empty());
      for (const ExportRecords& records : file.records) {
        std::istringstream columns{std::string(records.columns)};
        for (std::string column; columns >> column;) {
          std::string type = column.substr(column.find(':') + 1);
          if (type.ends_with('*')) type.pop_back();
          EXPECT_TRUE(types.contains(type)) << column;
        }
      }
    }
  }
}

TEST(ExportFormats, EachWordIsOnce) {
  std::set<std::string_view> words;
  for (const ExportFormat& known : export_formats()) words.insert(known.word);
  EXPECT_EQ(words.size(), export_formats().size());
}

TEST(ExportFormats, AFileIsOneOfThoseThatTheRowSays) {
  for (const char* name : {"images/train/a.png", "labels/train/a.b.txt", "train.txt", "data.yaml",
                           "pose/data.yaml", "pose-2/images/train/a.npy"}) {
    EXPECT_TRUE(writes(format("yolo"), name)) << name;
  }
  for (const char* name :
       {"", "images", "images/", "images/train/", "images/a.png", "images//a.png",
        "/images/t/a.png", "images/train/below/a.png", "images/train/a.txt", "images/train/a.pngs",
        "images-2/t/a.png", "pose-/data.yaml", "pose-2data.yaml", "poses/data.yaml", "a/data.yaml",
        ".txt"}) {
    EXPECT_FALSE(writes(format("yolo"), name)) << name;
  }
  EXPECT_TRUE(writes(format("mpii"), "annot/gt_train.mat"));
  EXPECT_FALSE(writes(format("mpii"), "annot/train.mat"));
  for (const char* name : {"README.md", "croissant.json"}) {
    EXPECT_TRUE(writes(format("yolo"), name)) << name;
  }
  EXPECT_FALSE(writes(format("webdataset"), "notes.md"));
  EXPECT_TRUE(writes(format("dsec"), "dsec/val/a/flow/backward/000000.png"));
  EXPECT_FALSE(writes(format("dsec"), "dsec/val/a/flow/000000.png"));
  EXPECT_TRUE(writes(format("rvt"), "raw/val/a_td_td.h5"));
  EXPECT_TRUE(writes(format("rvt"),
                     "preprocessed/val/a/event_representations_v2/eventgan_nbins=18/"
                     "timestamps_us.npy"));
  EXPECT_FALSE(writes(format("rvt"),
                      "preprocessed/val/a/event_representations_v2/"
                      "timestamps_us.npy"));
}

TEST(ExportFormats, ASplitIsItsNameAlsoWhereThatIsAWord) {
  EXPECT_TRUE(fits("images/N/1.png", "images/SPLIT/NAME.png", "N"));
  EXPECT_FALSE(fits("images/D/1.png", "images/SPLIT/NAME.png", "N"));
  EXPECT_TRUE(fits("images/D/1.png", "images/SPLIT/NAME.png"));
}

}  // namespace
}  // namespace eventgan
