#include "tests/manifests/documents/small_plan.h"

#include <cmath>

namespace eventgan::testing {

Plan small_plan() {
  Plan plan;
  plan.name = "job";
  plan.manifest_text = "{ // a \"job\"\n}";
  plan.fingerprint = {{"weights", "aa"}, {"manifest", "bb"}};
  SourceSummary source;
  source.labelled_frames = 3;
  source.pairs_by_gap = {{1, 1}, {6, 1}};
  source.unpaired = 1;
  source.unpaired_ids = {"b"};
  source.faults = 1;
  source.notes = {"a \"note\""};
  SourceSummary other;
  other.labelled_frames = 1;
  other.pairs_by_gap = {{2, 1}};
  plan.sources = {source, other};
  FrameRef previous{"root/a \xc3\xa9.png", 4, -1, 0.1};
  FrameRef next{"clip.mp4", 5, 17, std::nan("")};
  plan.shards = {
      {"job-train-00000-of-00002.h5",
       0,
       {3, 4},
       {{"s1", "seq", "label#1", {previous, next, 1, 5, 0.5}, ""},
        {"s2", "", "", {next, previous, 6, -1, 1}, "expected a frame, got no file, in x"}}},
      {"job-train-00001-of-00002.h5",
       1,
       {5, 6},
       {{"s3", "", "", {{"a", 5}, {"b", 7}, 2, 7, 1}, ""}}}};
  return plan;
}

}  // namespace eventgan::testing
