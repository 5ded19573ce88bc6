#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/shard.h"
#include "pipeline/dataset/dataset_description.h"

namespace eventgan {

/// Counts of positive values in bins of equal width in the logarithm, `kPerDecade` for each power
/// of ten: the edges are the same for every dataset, so values need not be kept.
struct LogHistogram {
  static constexpr int kPerDecade = 6;
  static constexpr int kFirstDecade = -6, kLastDecade = 6;
  std::vector<std::int64_t> counts =
      std::vector<std::int64_t>((kLastDecade - kFirstDecade) * kPerDecade);
  std::int64_t zeros = 0;  ///< values that are not positive
  /// What lies beyond the edges counts in the outermost bins.
  void add(double value);
  /// Lower edge of a bin.
  static double edge(int bin);
};

/// What the samples of a gap have in common.
struct GapSurvey {
  std::int64_t samples = 0;
  std::int64_t extrapolated = 0;          ///< samples with kFlagExtrapolated
  std::optional<double> least_s, most_s;  ///< none as long as no time is known
};

/// Labels of one name, as far as volumes were read.
struct LabelSurvey {
  std::int64_t looked_at = 0;
  std::int64_t without_events = 0;
};

/// A sample that is worth an image.
struct PickedSample {
  std::string why;  ///< "random", "emptiest", "fullest", "farthest beyond the trained gaps", with
                    ///< commas between them
  std::string shard;
  int slot = 0;
  std::string sample_id;
};

struct SourceSurvey {
  DatasetCounts counts;
  LogHistogram events_per_pixel;     ///< of valid samples: the volume's sum over its pixels' number
  std::vector<PickedSample> picked;  ///< for the first kShownSources sources that have any
};

/// Samples in quarantine for one reason (fault_kind).
struct FaultSurvey {
  std::int64_t samples = 0;
  QuarantinedSlot first;
};

/// All numbers of a report.
struct Survey {
  static constexpr int kShownSources = 8;
  static constexpr int kMostVolumes = 256;
  /// A pixel has events if its values sum to this or more: drawn with a tenth of full brightness.
  static constexpr double kEventSum = 0.1;
  /// A box with a smaller share of such pixels is one without events.
  static constexpr double kBoxShare = 0.01;
  /// A joint without such a pixel this near, in pixels each way, is one without events.
  static constexpr int kJointRadius = 4;

  /// Detectors learn few boxes with a shorter side than two cells of their finest map, 8 pixels.
  static constexpr double kNarrowPx = 16;

  DatasetParts parts;
  ShardHeader header;  ///< of the first shard that is done
  DatasetCounts counts;
  std::vector<SourceSurvey> sources;  ///< of each of the manifest's
  std::map<std::string, DatasetCounts> datasets, splits;
  std::map<int, GapSurvey> gaps;
  std::map<std::string, std::int64_t> flags;  ///< valid samples by flag_names
  LogHistogram box_sides;  ///< sqrt(width x height) in volume pixels, ignored ones left out
  /// Boxes by class whose shorter side is less than kNarrowPx volume pixels, ignored ones left out.
  std::map<std::string, std::int64_t> narrow_boxes;
  std::map<std::string, FaultSurvey> faults;
  std::vector<QuarantinedSlot> quarantined;  ///< the first kMostQuarantined
  static constexpr std::size_t kMostQuarantined = 50;
  std::map<std::string, double> stage_seconds;
  double wall_seconds = 0;
  std::int64_t peak_bytes = 0;  ///< of the worker that took most; 0: not known

  // Of at most kMostVolumes volumes, which the manifest's seed draws from all valid ones.
  int volumes = 0;
  std::vector<double> positive_bins, negative_bins;  ///< mean of a pixel
  std::map<std::string, LabelSurvey> classes, joints;
};

/// Reads a folder that convert has written: plan, commit records, overviews of all shards that are
/// done, and a bounded number of volumes. The same folder gives the same survey. Throws InputError
/// if there is no plan or no shard is done, what ShardReader throws, and as read_dataset_parts.
Survey survey_folder(const std::filesystem::path& folder);

}  // namespace eventgan
