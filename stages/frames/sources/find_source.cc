#include "stages/frames/sources/find_source.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/sources/dataset_kinds.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct Place {
  DatasetKind dataset;
  const DatasetLayout* layout;
  fs::path root;

  std::string_view word() const { return to_string(dataset); }
  std::string_view title() const {
    return layout->title.empty() ? dataset_row(dataset).title : layout->title;
  }
};

/// `own_too`: images of one's own may be anything, so that these are asked last.
std::optional<Place> look_at(const fs::path& root, std::optional<DatasetKind> dataset,
                             bool own_too) {
  for (const DatasetReader* const reader : kDatasetReaders) {
    if (dataset && reader->kind != *dataset) continue;
    if (is_own(reader->kind) && !own_too) continue;
    for (const DatasetLayout& layout : reader->layouts) {
      // Labels of it whose images are of one's own, and may have others.
      const bool has_others = !layout.image_folder.empty() &&
                              !has_folder(root / layout.image_folder) &&
                              has_folder(root / "images");
      if (layout.fits(root) && !has_others) return Place{reader->kind, &layout, root};
    }
  }
  return std::nullopt;
}

std::optional<Place> look_around(const fs::path& path, std::optional<DatasetKind> dataset) {
  if (auto found = look_at(path, dataset, /*own_too=*/false)) return found;
  std::vector<Place> below;
  for (const std::string& name : look_into(path).folders) {
    const auto found = look_at(path / name, dataset, /*own_too=*/false);
    if (found) below.push_back(*found);
  }
  if (below.empty()) return look_at(path, dataset, /*own_too=*/true);
  if (below.size() == 1) return below.front();
  std::string names;
  for (const Place& found : below) {
    names += (names.empty() ? "" : ", ") + found.root.filename().string() + " (" +
             std::string(found.word()) + ")";
  }
  throw InputError("expected one dataset, got " + std::to_string(below.size()) + ": " + names +
                   ", in " + path.string());
}

/// The dataset that a folder is a part of, if the one above it is its root.
std::optional<Place> whole_of(const fs::path& part) {
  const std::string name = part.filename().string();
  const fs::path above = part.parent_path();
  for (const DatasetReader* const reader : kDatasetReaders) {
    for (const DatasetLayout& layout : reader->layouts) {
      const bool may_be = layout.may_be_part != nullptr && layout.may_be_part(name);
      if (may_be && layout.fits(above)) return Place{reader->kind, &layout, above};
    }
  }
  return std::nullopt;
}

/// Says so where what was taken as frames is a part of a dataset, whose labels and pairs it does
/// not have alone: KITTI's image_2 holds images of scenes that have nothing to do with each other.
void note_dataset_above(FoundSource& found) {
  constexpr int kLevels = 4;  // S1/Walking-1/imageSequence/54138969
  fs::path part = found.root;
  for (int level = 0; level < kLevels; ++level, part = part.parent_path()) {
    const auto whole = whole_of(part);
    if (!whole) continue;
    std::string remark = "warning: this is only a part of " + std::string(whole->title()) +
                         ", without its labels and pairs: run eventgan init \"" +
                         whole->root.string() + "\"";
    const std::string_view images = whole->layout->image_folder;
    if (!images.empty() && !has_folder(whole->root / images)) {
      remark += " once the images are in " + std::string(images);
    }
    found.remarks.insert(found.remarks.begin(), remark);
    found.unread.clear();  // they are that dataset's, as the remark says
    return;
  }
}

/// What `init` knows, for a person.
std::string known_titles() {
  std::string titles;
  for (const DatasetReader* const reader : kDatasetReaders) {
    if (reader->layouts.empty()) continue;
    titles += (titles.empty() ? "" : ", ") + std::string(dataset_row(reader->kind).title);
  }
  return titles;
}

/// Of images that lie deeper than they are looked for: where the first are, and the folder to give.
std::string deeper_images(const fs::path& root) {
  constexpr std::size_t kMostFolders = 10'000;
  std::vector<fs::path> folders = {root};  // breadth first, as names are ordered
  for (std::size_t i = 0; i < folders.size() && i < kMostFolders; ++i) {
    const FolderListing listing = look_into(folders[i]);
    const bool has_images = std::ranges::any_of(listing.files, [](const fs::path& name) {
      return std::ranges::find(kImageExtensions, lower_extension(name)) != kImageExtensions.end();
    });
    if (!has_images) {
      for (const std::string& name : listing.folders) {
        if (!name.starts_with('.')) folders.push_back(folders[i] / name);
      }
      continue;
    }
    fs::path give = root;
    const fs::path below = folders[i].lexically_relative(root);
    for (auto part = below.begin(); part != below.end() && !look_at(give, {}, true); ++part) {
      give /= *part;
    }
    if (give == root) return "";
    fs::path part = root;  // what is a part of a dataset is little without it
    for (int level = 0; level < 4; ++level, part = part.parent_path()) {
      if (const auto whole = whole_of(part)) {
        return "; this is only a part of " + std::string(whole->title()) +
               ": run eventgan convert \"" + whole->root.string() + "\"";
      }
    }
    return "; images lie in " + below.generic_string() + ": run eventgan convert \"" +
           give.string() + "\"";
  }
  return "";
}

}  // namespace

std::vector<FoundSource> find_sources(const fs::path& path, std::optional<DatasetKind> dataset) {
  fs::path root = fs::absolute(path).lexically_normal();
  if (!root.has_filename()) root = root.parent_path();  // "kitti/"
  std::error_code error;
  const auto status = fs::status(root, error);
  if (!fs::exists(status)) {
    throw InputError("expected a folder or a video, got '" + (error ? error.message() : "nothing") +
                     "', in " + path.string());
  }
  const std::optional<Place> place = look_around(root, dataset);
  if (!place) {
    const auto other = dataset ? look_around(root, std::nullopt) : std::nullopt;
    throw InputError("expected " + (dataset ? std::string(to_string(*dataset)) : known_titles()) +
                     ", got " + std::string(other ? other->word() : "none of these") + ", in " +
                     path.string() + (other || dataset ? "" : deeper_images(root)));
  }
  FoundSource found;
  found.dataset = place->dataset;
  found.layout = place->layout->word;
  found.title = place->title();
  found.root = place->root;
  std::vector<FoundSource> sources;
  if (place->layout->complete) {
    sources = place->layout->complete(std::move(found));
  } else {
    sources.push_back(std::move(found));
  }
  if (is_own(place->dataset)) note_dataset_above(sources.front());
  return sources;
}

void go_without_labels(std::vector<FoundSource>& sources) {
  for (FoundSource& source : sources) {
    if (!is_own(source.dataset)) {
      throw UsageError(std::string(kNoLabelsOption) +
                       ": expected images or videos of your own, got " +
                       std::string(to_string(source.dataset)) + ", in " + source.root.string());
    }
    source.labels.reset();
    source.unread.clear();
    source.has_no_labels = true;
  }
}

bool may_be_source(const fs::path& path) {
  return has_folder(path) || std::ranges::any_of(kDatasetReaders, [&](const auto* reader) {
           return reader->may_be_file != nullptr && reader->may_be_file(path);
         });
}

std::vector<std::string_view> recognised_datasets() {
  std::vector<std::string_view> words;
  for (const DatasetReader* const reader : kDatasetReaders) {
    if (!reader->layouts.empty()) words.push_back(to_string(reader->kind));
  }
  return words;
}

}  // namespace eventgan
