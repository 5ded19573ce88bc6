#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/datasets.h"
#include "manifests/values/rows.h"
#include "stages/frames/dataset.h"
#include "stages/frames/find_source.h"

namespace eventgan {

/// One of the ways in which a dataset lies on disk, by which `init` knows it.
struct DatasetLayout {
  std::string_view word = {};   ///< SourceSpec::layout; empty where there is only one
  std::string_view title = {};  ///< empty: DatasetRow::title
  /// Whether a folder or file is the root of such a dataset, as far as names tell.
  bool (*fits)(const std::filesystem::path& root);
  /// Finds what belongs to it and what is not there; several sources where the root has more than
  /// one. Null: the root is all.
  std::vector<FoundSource> (*complete)(FoundSource found) = nullptr;
  /// Whether a folder of that name may be a part of it, whose images alone are `frames`. Null:
  /// none.
  bool (*may_be_part)(std::string_view folder) = nullptr;
  std::string_view image_folder = {};  ///< where its images must lie, below the root
};

/// What a manifest that `init` writes says of a kind of dataset, as manifests/examples do, and why.
struct DraftHabits {
  PairSide side = PairSide::kBefore;
  std::array<int, 2> gaps = {1, 2};  ///< those of them that have paired frames; 0: none
  std::string_view size_comment;
  std::string_view size;  ///< keys of `image`
};

inline constexpr std::string_view kDavisSize = R"("width": 346, "height": 260, "fit": "letterbox")";

/// What finds and reads a kind of dataset. Each kind has its own file, which defines its reader.
struct DatasetReader {
  DatasetKind kind;
  /// As the function open_dataset, which looks at what all kinds must give.
  std::unique_ptr<Dataset> (*open)(const SourceSpec& spec, const std::filesystem::path& base);
  /// As the function frame_origin. Null: the name of a sequence tells nothing.
  FrameOrigin (*origin)(const std::string& sequence) = nullptr;
  /// Whether a file of that name may be the root. Null: it is a folder.
  bool (*may_be_file)(const std::filesystem::path& file) = nullptr;
  /// Of several that fit, the first counts. None: `init` does not know the kind.
  std::span<const DatasetLayout> layouts = {};
  DraftHabits habits = {};
};

extern const DatasetReader kKittiObjectReader, kKittiTrackingReader, kKittiRawReader, kMpiiReader,
    kHuman36mReader, kMpiiListReader, kRecordingReader, kDhp19Reader, kFramesReader;

/// Every kind's, in the order of kDatasets.
inline constexpr auto kDatasetReaders =
    parts_of<DatasetReader>(kDatasets, {{DatasetKind::kKittiObject, &kKittiObjectReader},
                                        {DatasetKind::kKittiTracking, &kKittiTrackingReader},
                                        {DatasetKind::kKittiRaw, &kKittiRawReader},
                                        {DatasetKind::kMpii, &kMpiiReader},
                                        {DatasetKind::kHuman36m, &kHuman36mReader},
                                        {DatasetKind::kMpiiList, &kMpiiListReader},
                                        {DatasetKind::kRecording, &kRecordingReader},
                                        {DatasetKind::kDhp19, &kDhp19Reader},
                                        {DatasetKind::kFrames, &kFramesReader}});

const DatasetReader& dataset_reader(DatasetKind kind);

}  // namespace eventgan
