#include "tests/pipeline/dataset/converted_folder.h"

#include "manifests/documents/commit_record.h"
#include "manifests/files/atomic_file.h"
#include "tests/testing/text_file.h"

namespace eventgan::testing {
namespace {

constexpr char kManifest[] = R"({  // manifests may have comments
  "format": "eventgan-manifest", "version": 1, "name": "demo", "seed": 7,
  "sources": [
    {"dataset": "kitti_object", "root": "kitti", "split": "train",
     "pairs": {"gaps": [2], "side": "before", "choose": "one"}},
    {"dataset": "kitti_object", "root": "more", "split": "val",
     "pairs": {"gaps": [2], "side": "before", "choose": "one"}},
    {"dataset": "kitti_object", "root": "most", "split": "train",
     "pairs": {"gaps": [2], "side": "before", "choose": "one"}}],
  "image": {"preset": "kitti"}, "generator": {"weights": "untrained:2"},
  "output": {"directory": "out", "samples_per_shard": 5},
  "errors": {"policy": "quarantine", "max_count": 3, "max_fraction": 0.5}
})";

/// The example's second sample alone, which has no labels.
ExampleShard last_shard() {
  ExampleShard shard = example_shard();
  shard.samples = {shard.samples[1]};
  shard.volumes = {shard.volumes[1]};
  shard.header.sample_count = 1;
  return shard;
}

PlannedShard planned(const std::string& name, int source, const ExampleShard& example) {
  PlannedShard shard{name, source, example.header.volume.size, {}};
  for (const ShardSample& sample : example.samples) {
    shard.samples.push_back({sample.sample_id, sample.sequence, sample.sample_id, sample.pair, ""});
  }
  return shard;
}

Plan make_demo_plan() {
  Plan plan;
  plan.name = "demo";
  plan.manifest_text = kManifest;
  plan.fingerprint = {
      {"cpu", "x86-64 avx2 fma"}, {"annotations", "0123"}, {"manifest $.seed", "7"}};
  plan.sources.resize(3);
  plan.sources[0].labelled_frames = 6;
  plan.sources[0].unpaired = 1;
  plan.sources[1].notes = {"clip.mp4: 60 of 100 frames"};
  plan.shards = {planned("demo-train-00000-of-00003.h5", 0, example_shard()),
                 planned("demo-val-00000-of-00001.h5", 1, example_shard()),
                 planned("demo-train-00001-of-00003.h5", 2, example_shard()),
                 planned("demo-train-00002-of-00003.h5", 2, last_shard())};
  return plan;
}

}  // namespace

ConvertedFolder::ConvertedFolder(int count) : path_(folder_ / "out") {
  std::filesystem::create_directories(path_);
  frozen_ = freeze_plan(path_, make_demo_plan());
  for (int number = 0; number < count; ++number) add(number);
}

std::filesystem::path ConvertedFolder::commit_record_file(int number) const {
  return path_ / commit_record_name(plan().shards[at(number)].name);
}

void ConvertedFolder::add(int number, void (*change)(ExampleShard&)) {
  const PlannedShard& planned = plan().shards[at(number)];
  ExampleShard example = number == 3 ? last_shard() : example_shard();
  example.header.name = planned.name;
  example.header.split = number == 1 ? "val" : "train";
  example.header.plan_hash = plan_hash();
  if (change) change(example);
  CommitRecord record = write_shard(path_, example);
  record.plan_hash = plan_hash();
  write_commit_record(number, record);
}

void ConvertedFolder::write_commit_record(int number, const CommitRecord& record) const {
  write_file_atomically(commit_record_file(number), to_json(record));
}

CommitRecord ConvertedFolder::record(int number) const {
  return parse_commit_record(read_file(commit_record_file(number)),
                             commit_record_file(number).string());
}

DatasetParts parts_of(const ConvertedFolder& folder) {
  const FrozenOutline frozen = read_frozen_outline(folder.path());
  return read_dataset_parts(
      folder.path(), frozen,
      scan_shards(folder.path(), frozen.plan.shards, frozen.hash, ScanDepth::kRows));
}

}  // namespace eventgan::testing
