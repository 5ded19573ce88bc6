#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <utility>

#include "manifests/faults.h"
#include "stages/frames/folder_listing.h"
#include "stages/frames/human36m/fetch_table_internal.h"
#include "stages/frames/human36m/indexed_dataset_internal.h"
#include "stages/frames/human36m/layouts_internal.h"
#include "stages/frames/source_root.h"

namespace eventgan {
namespace {

constexpr char kPrefix[] = "img_";

/// One ACTION-N folder, `action` below the root. Gives the folders of pictures that have no label.
std::vector<std::string> add_action(const SourceRoot& root, const std::string& action,
                                    IndexedDataset& dataset) {
  const std::string pictures = action + "/imageSequence";
  std::vector<std::string> cameras = root.folders_in(pictures);
  const auto files = root.files_in(action);
  const bool labelled = std::ranges::binary_search(files, "annot.h5");

  std::map<std::string, std::vector<std::int64_t>> numbers;  // by camera
  const std::string key = action + "/annot.h5";
  std::unique_ptr<FetchTable> table;
  if (labelled) {
    table = std::make_unique<FetchTable>(root.on_disk(key), root.written(key));
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      numbers[std::to_string(table->camera(row))].push_back(table->frame(row));
    }
  }
  for (const auto& [camera, labelled_numbers] : numbers) {
    const std::string folder = pictures + "/" + camera;
    auto stored = NumberedSequence::list(root.on_disk(folder), kPrefix);
    if (const auto& others = stored.left_out(); !others.empty()) {
      dataset.add_note(counted(others, "files left out in " + root.written(folder)));
    }
    dataset.add_video(action + "/" + camera, FrameFolder(root.written(folder), kPrefix,
                                                         std::move(stored), labelled_numbers));
  }
  for (std::size_t row = 0; labelled && row < table->row_count(); ++row) {
    const std::string sequence = action + "/" + std::to_string(table->camera(row));
    const std::int64_t number = table->frame(row);
    dataset.add_labelled(fmt::format("{}/{:06}", sequence, number), sequence, number, key, row);
  }
  if (labelled) dataset.add_table(key, root.written(key), std::move(table));

  std::erase_if(cameras, [&](const std::string& camera) { return numbers.contains(camera); });
  for (std::string& camera : cameras) camera = root.written(pictures + "/" + camera);
  return cameras;
}

}  // namespace

std::unique_ptr<Dataset> open_human36m_fetch(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const SourceRoot root(spec.root, base);
  root.require_folder("");
  auto dataset = std::make_unique<IndexedDataset>();
  std::vector<std::string> without_labels;
  for (const std::string& subject : root.folders_in("")) {
    if (!subject.starts_with('S')) continue;
    for (const std::string& action : root.folders_in(subject)) {
      const auto found = add_action(root, subject + "/" + action, *dataset);
      without_labels.insert(without_labels.end(), found.begin(), found.end());
    }
  }
  if (!without_labels.empty()) {
    dataset->add_note(std::to_string(without_labels.size()) +
                      " folders of pictures without labels, the first " + without_labels.front());
  }
  if (dataset->annotation_files().empty()) {
    throw InputError("expected SUBJECT/ACTION/annot.h5 files, got none, in " + root.written(""));
  }
  dataset->finish(root.written(""));
  return dataset;
}

}  // namespace eventgan
