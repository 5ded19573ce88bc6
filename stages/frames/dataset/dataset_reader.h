#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/datasets.h"
#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// Labels of one's own that lie beside images or videos.
struct FoundLabels {
  LabelFormat format = LabelFormat::kCoco;
  std::filesystem::path path;
  std::optional<std::filesystem::path> outlines = {};  ///< index masks beside labels of boxes
  std::vector<std::filesystem::path> more = {};        ///< files with labels of other images there
};

/// A dataset that was found by looking at a folder. Paths are absolute and normal.
struct FoundSource {
  DatasetKind dataset = DatasetKind::kFrames;
  std::string_view layout;  ///< the manifest's word; empty where the dataset has only one
  /// For a person: "KITTI object", "recording of an event camera (AEDAT4)".
  std::string title;
  std::filesystem::path root;
  std::string_view split = {};  ///< frames: "val" or "test" where its folder says so; empty: train
  std::optional<std::filesystem::path> raw_root, devkit, annotations, sequences;
  std::optional<FoundLabels> labels;  ///< frames
  bool has_no_labels = false;         ///< frames: somebody says so (go_without_labels)
  /// Frames: a list of the split's images or sample ids, as SelectionSpec::ids.
  std::optional<std::filesystem::path> ids = {};
  std::string_view more_keys = {};       ///< lines of a manifest's source
  EventFields columns;                   ///< recording: a table's, by what its columns are called
  std::optional<ImageSize> sensor = {};  ///< recording: of its sensor, where somebody tells it
  /// What is not there and what that costs, or is left out; a line each.
  std::vector<std::string> remarks;
  /// Of frames without labels: files that name them and are not read, what they look like, and what
  /// to do; a line each.
  std::vector<std::string> unread;
};

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

}  // namespace eventgan
