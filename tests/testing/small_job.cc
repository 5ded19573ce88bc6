#include "tests/testing/small_job.h"

#include "manifests/documents/job_manifest.h"
#include "tests/testing/image_file.h"

namespace eventgan::testing {

JobManifest make_small_job(const TemporaryFolder& folder, int frames) {
  for (int frame = 0; frame < frames; ++frame) {
    write_flat_image(folder / "clip" / ("f_" + std::to_string(10 + frame) + ".png"), {20, 30},
                     20 * frame);
  }
  return parse_job_manifest(R"({
    "format": "eventgan-manifest", "version": 1, "name": "job",
    "sources": [{ "dataset": "frames", "root": "clip",
                  "pairs": { "gaps": [1], "side": "before", "choose": "one" } }],
    "image": { "preset": "mpii" },
    "generator": { "weights": "untrained:1" },
    "output": { "directory": "out", "samples_per_shard": 4 } })",
                            folder.path(), "manifest.json");
}

}  // namespace eventgan::testing
