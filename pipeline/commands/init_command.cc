#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"
#include "manifests/values/datasets.h"
#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "pipeline/command_line/given_job.h"
#include "pipeline/commands/commands.h"
#include "pipeline/planning/draft_manifest.h"
#include "pipeline/runtime/errors.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/sources/find_source.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct InitArguments {
  std::vector<std::string> where;  ///< PATH..., or DATASET PATH...
  std::string out = "manifest.json";
  bool has_out = false;  ///< --out was given
  DraftWishes wishes;
};

/// The split that a PATH's last folder is named after; empty if none.
std::string_view split_named(const fs::path& path) {
  const fs::path folder = (path / "").lexically_normal().parent_path();
  return split_of(folder.filename().string());
}

/// Whether they are the splits of one dataset: train and test, as their names say.
bool are_splits(std::span<const std::string> paths) {
  std::set<std::string_view> splits;
  for (const std::string& path : paths) splits.insert(split_named(path));
  return splits.size() > 1 && !splits.contains("");
}

std::vector<FoundSource> find_all(const std::vector<std::string>& where) {
  const std::vector<std::string_view> words = recognised_datasets();
  const DatasetRow* const named = where.size() < 2 ? nullptr : find_dataset(where.front());
  if (named != nullptr && std::ranges::find(words, named->word) == words.end()) {
    throw UsageError(
        fmt::format("DATASET: expected one that init recognises, got {} "
                    "(manifests/examples has a manifest for it)",
                    named->word));
  }
  const auto dataset = named == nullptr ? std::nullopt : std::optional(named->value);
  const bool split_by_names = are_splits(std::span(where).subspan(dataset ? 1 : 0));
  std::vector<FoundSource> found;
  for (std::size_t i = dataset ? 1 : 0; i < where.size(); ++i) {
    if (i == 0 && where.size() > 1 && !fs::exists(where[i])) {  // it may have been meant as a word
      throw UsageError(
          fmt::format("DATASET or PATH: expected a dataset ({}) or a path that exists, got {}",
                      fmt::join(words, ", "), where[i]));
    }
    std::vector<FoundSource> here = find_sources(where[i], dataset);
    const std::string_view split = split_by_names ? split_named(where[i]) : "";
    if (here.size() == 1 && here[0].split.empty() && split != "train") here[0].split = split;
    std::ranges::move(here, std::back_inserter(found));
  }
  return found;
}

void refuse_to_overwrite(const InitArguments& arguments) {
  const std::string got = "got an existing one, in " + arguments.out;
  if (arguments.has_out) throw UsageError("--out: expected the name of a new file, " + got);
  throw UsageError("expected no manifest yet, " + got + " (--out FILE gives another name)");
}

int run(const InitArguments& arguments) {
  const fs::path out = arguments.out;
  if (!out.has_filename()) throw UsageError("--out: expected a file, got " + out.string());
  if (fs::exists(fs::symlink_status(out))) refuse_to_overwrite(arguments);
  std::vector<FoundSource> found = find_all(arguments.where);
  if (arguments.wishes.no_labels) go_without_labels(found);
  const ManifestDraft draft =
      draft_manifest(found,
                     {fs::absolute(out).lexically_normal().parent_path(),
                      std::ranges::none_of(arguments.where,
                                           [](const fs::path& path) { return path.is_absolute(); }),
                      "out/" + draft_name(found)},
                     arguments.wishes);
  const bool is_new = create_file_atomically(out, [&](const TextSink& sink) { sink(draft.text); });
  if (!is_new) refuse_to_overwrite(arguments);

  for (const std::string& line : draft.findings) std::cout << escape_controls(line) << "\n";
  for (const std::string& note : draft.notes)
    std::cout << "note: " << escape_controls(note) << "\n";
  std::cout << "manifest written to " << out.string() << "\n"
            << (draft.has_samples ? "next:  " : "no samples can be made yet; once that is fixed:  ")
            << "eventgan plan " << shell_word(out.string()) << std::endl;
  return kComplete;
}

}  // namespace

void add_init_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("init", "Detect datasets and write one manifest for them");
  const auto arguments = std::make_shared<InitArguments>();
  command
      ->add_option("PATH", arguments->where,
                   fmt::format("Folders, videos and recordings, each a source of the one manifest; "
                               "before them the dataset that they should be, one of {} (a folder "
                               "of such a name is ./frames)",
                               fmt::join(recognised_datasets(), ", ")))
      ->required()
      ->expected(-1)
      ->option_text("[DATASET] PATH...");
  auto* out = command->add_option("--out", arguments->out,
                                  "The manifest to write, a new file; default: manifest.json");
  out->option_text("FILE");
  add_draft_options(*command, arguments->wishes);
  command->callback([arguments, out, &exit_code] {
    arguments->has_out = out->count() > 0;
    exit_code = run(*arguments);
  });
}

}  // namespace eventgan
