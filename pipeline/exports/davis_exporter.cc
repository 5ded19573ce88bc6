#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <map>
#include <span>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/exporter.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/exports/array_files.h"
#include "stages/exports/pose_list.h"
#include "stages/exports/volume_file.h"
#include "stages/shards/codec/quantization.h"

namespace eventgan {
namespace {

constexpr std::size_t kViews = 5;

/// The columns of the list beside the events, a row for each person.
struct PersonColumns {
  std::vector<std::int64_t> views;
  std::vector<std::string> names;
  std::vector<double> center, scale, part;

  void add(const OutgoingSample& sample, const ListedPerson& person) {
    const FramePair& pair = sample.labels.pair;
    views.insert(views.end(), {pair.previous.index, pair.previous.index, pair.label_index,
                               pair.next.index, pair.next.index});
    names.push_back(sample.labels.sample_id);
    center.insert(center.end(), {person.center.x, person.center.y});
    scale.push_back(person.scale);
    for (const Point joint : person.joints) {
      const bool is_there = joint != kMissingPoint;
      part.insert(part.end(),
                  {is_there ? joint.x : 0.0, is_there ? joint.y : 0.0, is_there ? 1.0 : 0.0});
    }
  }

  std::string npz(const JointChoice& choice) const {
    const std::size_t rows = names.size();
    return npz_file({{"views", npy_file("<i8", {rows, kViews}, views)},
                     {"imgname", npy_texts(names)},
                     {"center", npy_file("<f8", {rows, 2}, center)},
                     {"scale", npy_file("<f8", {rows}, scale)},
                     {"part", npy_file("<f8", {rows, choice.names.size(), 3}, part)},
                     {"joint_names", npy_texts(choice.names)}});
  }
};

/// KITTI's image id, of "000012" or "000012@before2".
std::string kitti_image(const std::string& sample_id) {
  return sample_id.substr(0, sample_id.find('@'));
}

/// The same as a number. `shard`: for messages, as below.
std::size_t kitti_row(const std::string& sample_id, const std::string& shard) {
  const std::string digits = kitti_image(sample_id);
  std::size_t row = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), row);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    throw UsageError("expected a KITTI image id, digits only, got " + sample_id + ", in " + shard);
  }
  return row;
}

/// The samples' ids by their rows, of a source without persons.
using RowIds = std::map<std::size_t, std::string>;

/// The next sample's row.
std::size_t add_row(RowIds& ids, const ExportSource& source, const std::string& id,
                    const std::string& shard) {
  const std::size_t row = source.dataset == "kitti_object" ? kitti_row(id, shard) : ids.size();
  if (const auto [earlier, is_new] = ids.emplace(row, id); !is_new) {
    throw UsageError(fmt::format(
        "expected one sample of each image for --to davis, got {} and {}, in {} (in the "
        "manifest: \"choose\": \"one\")",
        earlier->second, id, shard));
  }
  return row;
}

/// SET.hdf5, and beside it SET.npz for persons, else SET.txt, a line for each sample.
class DavisExporter : public Exporter {
 public:
  DavisExporter(const ExportInput&, const ExportOptions& options) : dtype_(options.dtype) {}

  std::string settings() const override { return fmt::format("dtype {}\n", to_string(dtype_)); }

  bool works_by_shard() const override { return false; }

  void check(const ExportInput& input, const std::function<void()>& check_stop) const override {
    const auto has_joints = [&](const ExportShard& shard) {
      return input.source_of(shard).has_joints();
    };
    if (std::ranges::all_of(input.shards(), has_joints)) {
      require_listed_person(input, "davis", check_stop);
    }
    for (const ExportSet& set : input.sets(/*joints_only=*/false, /*by_size=*/true)) {
      const ExportSource& source = input.source_of(*set.shards[0]);
      if (source.has_joints()) continue;
      RowIds ids;
      for (const ExportShard* shard : set.shards) {
        const ShardReader reader = input.open(*shard);
        for (int slot = 0; slot < reader.header().sample_count; ++slot) {
          check_stop();
          const ShardSample sample = reader.sample(slot);
          if (!sample.valid) continue;
          add_row(ids, source, sample.sample_id, (input.folder() / shard->outline.name).string());
        }
      }
    }
  }

  void finish(const ExportWork& work, const std::vector<const ExportShard*>&) const override {
    for (const ExportSet& set : work.input.sets(/*joints_only=*/false, /*by_size=*/true)) {
      ExportFolder::Step step(work.folder, set.name + ".hdf5", input_hash(set.shards));
      if (!step.is_done()) {
        write_set(work, set, step);
        step.finish();
      }
      for (const ExportShard* shard : set.shards) work.advance(shard->valid);
    }
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    if (!sample.source.has_joints()) return;
    const JointChoice choice = choose_joints(sample.reader.header().label_schema);
    for (const VolumePerson& person : sample.labels.labels.persons) {
      if (const std::string why = why_not_listed(person, choice); !why.empty()) {
        ++left_out["persons: " + why];
      }
    }
  }

 private:
  /// The rows of each sample, by shard and slot; and the list beside them.
  struct Layout {
    std::map<std::pair<std::string, int>, std::vector<std::size_t>> rows_of;
    std::size_t row_count = 0;
    std::string list_name;
    std::string list;
  };

  static Layout lay_out(const ExportWork& work, const ExportSet& set) {
    const ExportSource& source = work.input.source_of(*set.shards[0]);
    Layout layout;
    if (source.has_joints()) {
      const JointChoice choice =
          choose_joints(work.input.open(*set.shards[0]).header().label_schema);
      PersonColumns columns;
      work.walk(set.shards, [&](const OutgoingSample& sample) {
        for (const VolumePerson& person : sample.labels.labels.persons) {
          if (!why_not_listed(person, choice).empty()) continue;
          layout.rows_of[{sample.shard.outline.name, sample.slot}].push_back(layout.row_count++);
          columns.add(sample, listed_person(person, choice));
        }
      });
      layout.list_name = set.name + ".npz";
      layout.list = columns.npz(choice);
      return layout;
    }
    RowIds ids;
    work.walk(set.shards, [&](const OutgoingSample& sample) {
      const std::size_t row = add_row(ids, source, sample.labels.sample_id,
                                      (work.input.folder() / sample.shard.outline.name).string());
      layout.rows_of[{sample.shard.outline.name, sample.slot}] = {row};
      layout.row_count = std::max(layout.row_count, row + 1);
    });
    layout.list_name = set.name + ".txt";
    // Of KITTI object it is the detector's list of ids: the row is the line as a number, and a row
    // without a sample must have none.
    const bool has_images = source.dataset == "kitti_object";
    for (const auto& [row, id] : ids) layout.list += (has_images ? kitti_image(id) : id) + "\n";
    return layout;
  }

  void write_set(const ExportWork& work, const ExportSet& set, ExportFolder::Step& step) const {
    const Layout layout = lay_out(work, set);
    const VolumeShape shape = work.input.open(*set.shards[0]).header().volume;
    VolumeFile file(step.file(set.name + ".hdf5"), VolumeLayout::kDavis, layout.row_count, shape,
                    stored_size(dtype_));
    work.walk(set.shards, [&](const OutgoingSample& sample) {
      const auto rows = layout.rows_of.find({sample.shard.outline.name, sample.slot});
      if (rows == layout.rows_of.end()) return;
      const std::vector<float> volume = channels_last(sample.reader.volume(sample.slot),
                                                      static_cast<std::size_t>(shape.channels()));
      std::vector<std::uint16_t> halves;
      if (dtype_ == StoredType::kFloat16) {
        halves.resize(volume.size());
        to_halves(volume, halves.data());
      }
      const auto bytes =
          halves.empty() ? std::as_bytes(std::span(volume)) : std::as_bytes(std::span(halves));
      for (const std::size_t row : rows->second) file.write_row(row, bytes);
    });
    file.commit();
    step.write(layout.list_name, layout.list);
  }

  StoredType dtype_;
};

}  // namespace

ExportFormat davis_format() {
  return {.word = "davis",
          .title = "the layout of the EventGAN authors' trainers, one HDF5 file",
          .need = LabelNeed::kNone,
          .tasks = {"keypoint-detection"},
          .options = {"--dtype"},
          .files = {{"SET.hdf5", "the volumes, [N, H, W, channels]"},
                    {"SET.npz", "persons: the row of their volume, centre, scale and joints"},
                    {"SET.txt", "samples in the order of their rows", {{"", "sample_id:Text"}}}},
          .make = make_exporter<DavisExporter>};
}

}  // namespace eventgan
