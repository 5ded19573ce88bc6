#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "manifests/values/datasets.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// Of a file that is neither dataset nor manifest, "expected a manifest, ..., got TITLE, in PATH
/// (what to do with it)", by what is in it: labels, a list of files, weights, an image, an archive,
/// a recording that is not read. Empty if nothing tells.
std::string fault_of_file(const std::filesystem::path& file);

/// Finds out which dataset lies at `path` or, if it is none, in a folder of it; `dataset`, if it is
/// given, must be that one. What belongs to it is looked for beside it, too: KITTI raw and the
/// development kit in the two folders above the root and in their folders. Only names are looked
/// at, the beginnings of lists of people, and what tells the format of a recording: opening the
/// dataset tells whether it is sound.
///
/// Any folder of images or videos is `frames`, so that this is asked last. Of one with labels of
/// one's own the root becomes the folder of images that they are of (FOLDER/images,
/// FOLDER/JPEGImages, FOLDER/train2017), and `labels` is set; those that were found and do not
/// count are remarks. Where train and val or test have folders of images with labels of their own
/// (FOLDER/images/val, FOLDER/valid/images), each is a source, and so is each folder or list that
/// data.yaml, obj.data or autosplit_*.txt gives a split; else there is one. Throws InputError if
/// there is nothing at `path`, no such dataset, or more than one; it names the first folder with
/// images that lies deeper than images are looked for.
std::vector<FoundSource> find_sources(const std::filesystem::path& path,
                                      std::optional<DatasetKind> dataset = std::nullopt);

/// The option by which a command goes on without labels.
inline constexpr char kNoLabelsOption[] = "--no-labels";
inline constexpr char kNoLabelsText[] =
    "Take the images or videos without labels, whatever lies beside them";

/// Takes the labels, and what looks like some, off these sources. Throws UsageError for a dataset
/// that is nothing without its labels.
void go_without_labels(std::vector<FoundSource>& sources);

/// Whether find_sources may find something at `path`: a folder, or a file that is a dataset by its
/// name, such as a video; also a video's name where nothing is.
bool may_be_source(const std::filesystem::path& path);

/// The words of the datasets that find_sources can find, in the order of kDatasets.
std::vector<std::string_view> recognised_datasets();

}  // namespace eventgan
