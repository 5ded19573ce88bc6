#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/exports/export_folder.h"
#include "pipeline/exports/export_input.h"
#include "pipeline/exports/export_job.h"
#include "stages/exports/detection_labels.h"
#include "stages/exports/pose_list.h"
#include "stages/labels/label_mapping.h"

namespace eventgan {

/// A sample on its way out.
struct OutgoingSample {
  const ExportShard& shard;
  const ExportSource& source;
  const ShardReader& reader;
  int slot;
  const ShardSample& labels;
  std::string name;  ///< of its files
};

/// What the exporters work with.
struct ExportWork {
  const ExportInput& input;
  ExportFolder& folder;
  int threads;
  std::function<void()> check_stop;           ///< throws Stopped
  std::function<void(std::int64_t)> advance;  ///< so many samples more are done

  /// Calls `work` for the sample in a slot, if it is valid.
  void with_sample(const ExportShard& shard, const ShardReader& reader, int slot,
                   const std::function<void(const OutgoingSample&)>& work) const;

  /// Calls `work` for each valid sample of a shard, side by side.
  void for_each_sample(const ExportShard& shard, const ShardReader& reader,
                       const std::function<void(const OutgoingSample&)>& work) const;

  /// Calls `work` for each valid sample of the shards, one after the other, in their order.
  void walk(const std::vector<const ExportShard*>& shards,
            const std::function<void(const OutgoingSample&)>& work) const;
};

/// KITTI's class of regions to ignore, no class of objects.
inline constexpr char kDontCare[] = "DontCare";

/// Counts what an export leaves out, by what it is and why.
using LeftOut = std::map<std::string, std::int64_t>;

/// What becomes 255: a value, or a pixel's sum of them over the bins.
struct FullScale {
  double value = 1;
  bool is_of_sums = false;
};

/// One format.
class Exporter {
 public:
  virtual ~Exporter() = default;

  /// Lines for the export's identity: the options that change its bytes.
  virtual std::string settings() const = 0;

  /// Throws UsageError if the samples do not go into the format; before a new export has its
  /// folder.
  virtual void check(const ExportInput&, const std::function<void()>& /*check_stop*/) const {}

  /// Writes the files of a shard's samples.
  virtual void write_shard(const ExportWork&, const ExportShard&, const ShardReader&,
                           ExportFolder::Step&) const {}

  /// Whether write_shard does the work; else `finish` does, and tells how far it is.
  virtual bool works_by_shard() const { return true; }

  /// Writes the files that are of all shards together, those that it takes.
  virtual void finish(const ExportWork&, const std::vector<const ExportShard*>&) const {}

  /// What of a sample's labels is not exported.
  virtual void account(const OutgoingSample&, LeftOut&) const {}

  /// What of whole samples is not exported, as far as `finish` alone can tell.
  virtual LeftOut whole_samples_left_out() const { return {}; }

  /// What larger values are cut to, in images of sums the sums; none where all stay.
  virtual std::optional<FullScale> full_scale() const { return std::nullopt; }

  /// What a user should know of what `finish` has made, a line each.
  virtual std::vector<std::string> notes() const { return {}; }
};

/// For ExportFormat::make.
template <class Format>
std::unique_ptr<Exporter> make_exporter(const ExportInput& input, const ExportOptions& options) {
  return std::make_unique<Format>(input, options);
}

// What several of them share.

/// What a sample's files are called, without folder and extension: its sample id, in which '/' is
/// '+' and any byte but A-Z a-z 0-9 _ - @ is %XX (a dot too: some readers cut names at the first
/// one); of what would be longer than 75 bytes the first 58, '~' and 16 hex digits of the id's
/// SHA-256. Different ids have different names. Thread safe.
std::string export_name(std::string_view sample_id);

/// SHA-256 over the shards' hashes: what a file made from all of them is made from.
std::string input_hash(const std::vector<const ExportShard*>& shards);

/// Those of a split.
std::vector<const ExportShard*> of_split(const ExportInput& input,
                                         const std::vector<const ExportShard*>& shards,
                                         const std::string& split);

/// Writes FOLDER/NAME.png, the image of average times, and NAME.npy beside it, uint8 [H, W, 2
/// bins]: round(255 min(value / full_scale, 1)).
void write_image_pair(const OutgoingSample& sample, const std::string& folder, double full_scale,
                      ExportFolder::Step& step);

/// Writes FOLDER/NAME.png, the volume as an image (polarity_image_png).
void write_polarity_image(const OutgoingSample& sample, const std::string& folder,
                          double full_scale, ExportFolder::Step& step);

/// The largest value of a sample's volume.
float largest_value(const OutgoingSample& sample);

/// Whether some of its values, or sums, are cut. The volume is read where the largest value leaves
/// that open.
bool is_cut(const OutgoingSample& sample, const FullScale& full_scale);

/// Throws UsageError if no person can be listed (why_not_listed), saying why; for Exporter::check.
void require_listed_person(const ExportInput& input, std::string_view format,
                           const std::function<void()>& check_stop);

/// What of a box's outline lies within what the volume shows of the image; empty without one.
Outline shown_outline(const ShardSample& sample, const VolumeBox& box, ImageSize volume);

/// A person's box: as annotated, else around its chosen joints and its head; cut to what the volume
/// shows of the image. None if nothing is left.
std::optional<Rectangle> person_box(const ShardSample& sample, std::size_t person,
                                    const JointChoice& choice, ImageSize volume);

/// The chosen joints of a person of a sample.
std::vector<ExportedJoint> exported_joints(const ShardSample& sample, std::size_t person,
                                           const JointChoice& choice);

/// Counts the persons without a person_box, and of the others the joints outside the volume.
void account_persons(const ShardSample& sample, const JointChoice& choice, ImageSize volume,
                     LeftOut& left_out);

/// values [channel, pixel] as [pixel, channel].
template <class Value>
std::vector<Value> channels_last(const std::vector<Value>& values, std::size_t channels) {
  const std::size_t pixels = values.size() / channels;
  std::vector<Value> turned(values.size());
  for (std::size_t channel = 0; channel < channels; ++channel) {
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
      turned[pixel * channels + channel] = values[channel * pixels + pixel];
    }
  }
  return turned;
}

/// Which number each class has.
class ClassNumbers {
 public:
  /// Of the sources with boxes; without a map the names in the order of the sources, from `first`
  /// on, KITTI's DontCare left out. Throws UsageError for a map that is none, a name that no source
  /// has, or a number below `first`.
  ClassNumbers(const ExportInput& input, const ExportOptions& options, int first);

  /// Gives the names in `given`, those that are there, these numbers, all distinct, and the others
  /// the least numbers from `first` on that are free.
  void renumber(const std::map<std::string, int>& given, int first);

  enum class Fate { kKept, kLeftOut, kUnmapped };
  struct Entry {
    Fate fate = Fate::kUnmapped;
    int number = 0;  ///< if kept
  };
  Entry of(const std::string& name) const;

  /// By number; names that share one are joined by "/".
  const std::map<int, std::string>& names() const { return names_; }

  /// {"Car": 0, "Tram": null} as a line.
  std::string text() const;

 private:
  std::map<std::string, Entry> entries_;
  std::map<int, std::string> names_;
};

/// Calls take(ClassNumbers::Entry, VolumeBox) for each box of a sample that is exported, or
/// leave(why). The class of a box that is taken is kept, or unmapped if the box is to be ignored.
template <class Take, class Leave>
void for_each_box(const OutgoingSample& sample, const ClassNumbers& numbers, bool keep_ignored,
                  const Take& take, const Leave& leave) {
  using Fate = ClassNumbers::Fate;
  const std::vector<Box>& boxes = sample.labels.annotation.boxes;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const VolumeBox& box = sample.labels.labels.boxes[i];
    const std::string& name =
        sample.source.class_names.at(static_cast<std::size_t>(boxes[i].class_id));
    const ClassNumbers::Entry entry = numbers.of(name);
    if (is_empty(box.clipped)) {
      leave("boxes of which nothing is left in the volume");
    } else if (entry.fate == Fate::kLeftOut || (entry.fate == Fate::kUnmapped && !box.ignore)) {
      leave("boxes of class " + name);
    } else if (box.ignore && !keep_ignored) {
      leave("boxes to ignore");
    } else {
      take(entry, box);
    }
  }
}

}  // namespace eventgan
