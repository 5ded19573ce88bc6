#include "pipeline/output/recorded_manifest.h"

#include "manifests/faults.h"
#include "pipeline/output/output_folder.h"

namespace eventgan {

JobManifest recorded_manifest(const std::filesystem::path& folder, const PlanOutline& plan,
                              const std::optional<std::filesystem::path>& file) {
  if (file) return read_job_manifest(*file);
  const auto inputs = recorded_manifest_folder(folder);
  if (!inputs) {
    throw UsageError("expected the manifest's folder, got none, in " +
                     (folder / "run.json").string() + " (--manifest FILE says where it is)");
  }
  return parse_job_manifest(plan.manifest_text, *inputs, (folder / "plan.json").string());
}

}  // namespace eventgan
