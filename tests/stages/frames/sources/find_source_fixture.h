#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stages/frames/sources/find_source.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {

/// A csv table's header.
inline constexpr char kBoxHeader[] = "image,class,left,top,right,bottom\n";

/// Folders in which datasets and labels are looked for.
class FindSource : public FolderTest {
 protected:
  using enum DatasetKind;
  using enum LabelFormat;

  FoundSource find(const fs::path& name, std::optional<DatasetKind> dataset = {}) const {
    return find_sources(at(name), dataset).front();
  }
  fs::path below(const fs::path& path, const fs::path& name) const {
    return path.lexically_relative(at(name));
  }
  /// Writes "FILE, FILE=TEXT, ..." below a folder: empty, or with the text of that name.
  void lay(const std::string& folder, const std::string& files,
           const std::map<std::string, std::string>& texts = {}) const {
    for (std::size_t begin = 0, end; begin < files.size(); begin = end + 2) {
      end = std::min(files.find(", ", begin), files.size());
      const std::string file = files.substr(begin, end - begin);
      const std::size_t sign = file.find('=');
      write(fs::path(folder) / file.substr(0, sign),
            sign == file.npos ? "" : texts.at(file.substr(sign + 1)));
    }
  }
  /// A folder with these files, and the labels that are found in it.
  struct Labels {
    LabelFormat format;
    std::string root, path, files, split = "";
  };
  void expect_labels(const std::vector<Labels>& cases,
                     const std::map<std::string, std::string>& texts) const {
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const auto& [format, root, path, files, split] = cases[i];
      SCOPED_TRACE(files);
      const std::string name = "own" + std::to_string(i);
      lay(name, files, texts);
      const FoundSource found = find(name);
      EXPECT_EQ(found.dataset, kFrames);
      EXPECT_EQ(found.root, (at(name) / root / "").parent_path());
      ASSERT_TRUE(found.labels) << ::testing::PrintToString(found.unread);
      EXPECT_EQ(found.labels->format, format);
      EXPECT_EQ(found.labels->path / "", at(name) / path / "");
      EXPECT_EQ(find(name + "/" + root).labels->path, found.labels->path);
      EXPECT_EQ(found.split, split);
      EXPECT_THAT(found.unread, IsEmpty());
    }
  }
};

}  // namespace eventgan
