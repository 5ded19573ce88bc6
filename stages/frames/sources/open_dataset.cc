#include "stages/frames/sources/open_dataset.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "stages/frames/sources/dataset_kinds.h"
#include "stages/frames/sources/flow_dataset.h"
#include "stages/frames/sources/outlined_dataset.h"

namespace eventgan {

const DatasetReader& dataset_reader(DatasetKind kind) {
  const auto reader = std::ranges::find(kDatasetReaders, kind, &DatasetReader::kind);
  if (reader != kDatasetReaders.end()) return **reader;
  throw std::logic_error("dataset_reader: not a kind of dataset");
}

std::unique_ptr<Dataset> open_dataset(const SourceSpec& spec, const std::filesystem::path& base) {
  std::unique_ptr<Dataset> dataset = dataset_reader(spec.dataset).open(spec, base);
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    for (const std::string* name : {&frame.sample_id, &frame.sequence, &frame.frame.path}) {
      if (name->find('\0') == std::string::npos) continue;
      throw InputError("expected names of frames without NUL, got \"" + escape_controls(*name) +
                       "\", in " + escape_controls(dataset->label_place(frame.label_key)));
    }
  }
  if (spec.outlines) dataset = with_outlines(std::move(dataset), spec, base);
  const bool reads_flow = spec.flow && !spec.pairs.stills && !has_events(spec.dataset);
  return reads_flow ? with_flow(std::move(dataset), spec, base) : std::move(dataset);
}

FrameOrigin frame_origin(DatasetKind dataset, const std::string& sequence) {
  const auto origin = dataset_reader(dataset).origin;
  return origin == nullptr ? FrameOrigin() : origin(sequence);
}

}  // namespace eventgan
