#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/naming/found_frames.h"

namespace eventgan {

/// A folder of images, or a text that lists some, and the split that it is.
struct SplitPart {
  std::string_view split;  ///< of split_of
  std::filesystem::path place;
};

/// What the data.yaml or obj.data in a folder says of splits, else the lists autosplit_SPLIT.txt in
/// it; train first. What is not there is left out, and its lists are `absent`. `file`: which one
/// says so.
std::vector<SplitPart> split_parts(const std::filesystem::path& folder, std::string& file,
                                   std::vector<std::string>& absent);

/// The lines of a list that say anything, sorted, each once.
std::vector<std::string> images_of_list(const std::filesystem::path& list);

/// Looks for labels of one's own of the frames in found.root, or in a folder of images in it
/// (LabelReader::find). Sets root and labels, and remarks on labels and on folders of images that
/// are there and left out. Where train and val or test have a folder each, with labels of its own,
/// each is a source with its split, as is each of split_parts, else it is one. Where there are no
/// labels, `unread` tells of files that may be some; else a remark does. Cannot fail: what cannot
/// be read is not found.
std::vector<FoundSource> find_own_labels(FoundSource found);

/// Files that name these images, or that are called as one of them or as a sequence, and that
/// nothing reads.
struct UnreadLabels {
  /// "FILE looks like FORMAT labels of these images and is not read: REASON; do ...", a line a kind
  /// of file: of those that may have boxes, joints or tracks.
  std::vector<std::string> lines;
  /// Those that name the images and have no numbers, such as captions; beside labels, all.
  std::vector<std::string> others;
  bool are_more = false;  ///< `others` are the first of many in a folder
  std::string limit;      ///< what was not looked at, if anything
};

/// Looks into `given` and the folders below it, as deep as images may lie, and into folders of
/// labels beside it. `sources`: with labels, if any were found, which their files are.
UnreadLabels unread_labels(const std::vector<FoundFrames>& places,
                           const std::filesystem::path& given,
                           const std::vector<FoundSource>& sources);

}  // namespace eventgan
