#pragma once

#include <string>
#include <vector>

#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/naming/found_frames.h"

namespace eventgan {

/// Looks for labels of one's own of the frames in found.root, or in a folder of images in it
/// (LabelReader::find). Sets root and labels, and remarks on labels and on folders of images that
/// are there and left out. Where train and val or test have a folder each, with labels of its own,
/// each is a source with its split, else it is one. Where there are no labels, `unread` tells of
/// files that look like some. Cannot fail: what cannot be read is not found.
std::vector<FoundSource> find_own_labels(FoundSource found);

/// "FILE looks like FORMAT labels of these images and is not read: REASON; do ...", a line a kind
/// of file, of what lies in these folders and beside these frames.
std::vector<std::string> unread_labels(const std::vector<FoundFrames>& places);

}  // namespace eventgan
