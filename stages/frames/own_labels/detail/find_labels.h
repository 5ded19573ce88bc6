#pragma once

#include <vector>

#include "stages/frames/find_source.h"

namespace eventgan {

/// Looks for labels of one's own of the frames in found.root, or in a folder of images in it: COCO
/// (a JSON file in the root, above it, or in a folder `annotations` there, whose beginning has
/// images of the root), YOLO (texts in the folder `labels` that stands for `images`, or beside the
/// images, and data.yaml or classes.txt), Pascal VOC (XML files in Annotations or beside the
/// images), MOT (gt/gt.txt) and tables (a .csv file with its header and a row of
/// one of the images). Sets root and labels, and remarks on labels and on folders of images that
/// are there and left out. Where train and val or test have a folder each, with labels of its own,
/// each is a source with its split, else it is one. Cannot fail: what cannot be read is not found.
std::vector<FoundSource> find_own_labels(FoundSource found);

}  // namespace eventgan
