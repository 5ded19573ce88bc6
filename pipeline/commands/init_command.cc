#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/words.h"
#include "pipeline/commands/commands.h"
#include "pipeline/planning/draft_manifest.h"
#include "pipeline/runtime/errors.h"
#include "stages/base/files/atomic_file.h"
#include "stages/frames/find_source.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct InitArguments {
  std::vector<std::string> where;  ///< PATH, or DATASET PATH
  std::string out = "manifest.json";
  bool has_out = false;  ///< --out was given
};

/// Of those that find_source knows: a camera's recordings are not looked for.
DatasetKind read_dataset(const std::string& word) {
  std::string words;
  for (const Word<DatasetKind>& known : kDatasetWords) {
    if (known.value == DatasetKind::kRecording || known.value == DatasetKind::kDhp19) {
      if (known.word != word) continue;
      throw UsageError("DATASET: expected labelled frames, got recorded events, " + word +
                       " (manifests/guides/real_events.md has a manifest for them)");
    }
    if (known.word == word) return known.value;
    words.append(words.empty() ? "" : ", ").append(known.word);
  }
  throw UsageError("DATASET: expected one of " + words + ", got " + word);
}

void refuse_to_overwrite(const InitArguments& arguments) {
  const std::string got = "got an existing one, in " + arguments.out;
  if (arguments.has_out) throw UsageError("--out: expected the name of a new file, " + got);
  throw UsageError("expected no manifest yet, " + got + " (--out FILE gives another name)");
}

int run(const InitArguments& arguments) {
  if (arguments.where.size() > 2) {
    throw UsageError("expected PATH or DATASET PATH, got " +
                     std::to_string(arguments.where.size()) + " arguments");
  }
  const fs::path path = arguments.where.back();
  const fs::path out = arguments.out;
  if (path.empty()) throw UsageError("PATH: expected a folder or a video, got nothing");
  if (!out.has_filename()) throw UsageError("--out: expected a file, got " + out.string());
  if (fs::exists(fs::symlink_status(out))) refuse_to_overwrite(arguments);
  const auto dataset = arguments.where.size() == 2
                           ? std::optional(read_dataset(arguments.where.front()))
                           : std::nullopt;
  const FoundSource found = find_source(path, dataset);
  const fs::path folder = fs::absolute(out).lexically_normal().parent_path();
  const ManifestDraft draft = draft_manifest(found, folder, path.is_relative());
  const bool is_new = create_file_atomically(out, [&](const TextSink& sink) { sink(draft.text); });
  if (!is_new) refuse_to_overwrite(arguments);

  for (const std::string& line : draft.findings) std::cout << escape_controls(line) << "\n";
  for (const std::string& note : draft.notes)
    std::cout << "note: " << escape_controls(note) << "\n";
  std::cout << "manifest written to " << out.string() << "\n"
            << (draft.has_pairs ? "next:  " : "no pairs can be made yet; once that is fixed:  ")
            << "eventgan plan " << out.string() << std::endl;
  return kComplete;
}

}  // namespace

void add_init_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("init", "Detect a dataset and write a manifest for it");
  const auto arguments = std::make_shared<InitArguments>();
  command
      ->add_option("PATH", arguments->where,
                   "The folder or video, optionally after the dataset that it should be: "
                   "kitti_object, kitti_tracking, kitti_raw, mpii, mpii_list, human36m or frames")
      ->required()
      ->expected(-1)
      ->option_text("[DATASET] PATH");
  auto* out = command->add_option("--out", arguments->out,
                                  "The manifest to write, a new file; default: manifest.json");
  out->option_text("FILE");
  command->callback([arguments, out, &exit_code] {
    arguments->has_out = out->count() > 0;
    exit_code = run(*arguments);
  });
}

}  // namespace eventgan
