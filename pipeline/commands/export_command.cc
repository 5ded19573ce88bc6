#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/command_line/usage.h"
#include "pipeline/commands/commands.h"
#include "pipeline/exports/export_job.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"

namespace eventgan {
namespace {

const std::map<std::string, bool> kIgnored = {{"keep", true}, {"drop", false}};
const std::map<std::string, bool> kIsFloat32 = {{"float16", false}, {"float32", true}};
const std::map<std::string, bool> kIsPng = {{"npy", false}, {"png", true}};
const std::map<std::string, EventCounts> kCounts = {{"poisson", EventCounts::kPoisson},
                                                    {"rounded", EventCounts::kRounded}};
const std::map<std::string, EventFile> kEventFiles = {{"text", EventFile::kText},
                                                      {"mvsec", EventFile::kMvsec}};

/// The words of the formats that take an option, "yolo, coco, dsec"; the last one after `last`.
std::string formats_with(const std::string& option, const std::string& last) {
  std::vector<std::string_view> words;
  for (const ExportFormat& format : export_formats()) {
    if (std::ranges::find(format.options, option) != format.options.end()) {
      words.push_back(format.word);
    }
  }
  std::string text(words.at(0));
  for (std::size_t i = 1; i < words.size(); ++i) {
    text += (i + 1 < words.size() ? ", " : last) + std::string(words[i]);
  }
  return text;
}

struct ExportArguments {
  std::string folder;
  std::size_t format = 0;  ///< in export_formats()
  std::string out;
  std::string classes, representation;
  bool keep_ignored = false;
  EventCounts counts = EventCounts::kPoisson;
  bool is_float32 = false;
  ExportOptions options;
  ProgressStyle progress = ProgressStyle::kAuto;
};

int run(const CLI::App& command, const ExportArguments& arguments) {
  ExportOptions options = arguments.options;
  options.to = &export_formats().at(arguments.format);
  for (const ExportFormat& format : export_formats()) {
    for (const std::string& option : format.options) {
      const bool has_it =
          std::ranges::find(options.to->options, option) != options.to->options.end();
      if (command.count(option) > 0 && !has_it) {
        throw UsageError(fmt::format("{}: expected --to {}, got --to {}", option,
                                     formats_with(option, " or "), options.to->word));
      }
    }
  }
  options.out = arguments.out;
  if (command.count("--classes") > 0) options.classes = arguments.classes;
  if (command.count("--representation") > 0) options.representation = arguments.representation;
  if (command.count("--counts") > 0) options.counts = arguments.counts;
  if (command.count("--ignored") > 0) options.keep_ignored = arguments.keep_ignored;
  if (arguments.is_float32) options.dtype = StoredType::kFloat32;
  const StopSignal signal(stopping_line("finishing the current samples"));
  options.stop = [&] { return signal.requested(); };
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total, {"samples", /*has_bytes=*/false});
  };
  const ExportReport report = run_export(arguments.folder, options);
  std::cout << (arguments.progress == ProgressStyle::kJson ? to_json(report) : to_text(report))
            << std::flush;
  return kComplete;
}

}  // namespace

void add_export_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "export",
      "Export a finalized folder for other trainers\nRun the same command again to resume.");
  const auto arguments = std::make_shared<ExportArguments>();
  ExportOptions& options = arguments->options;
  command->add_option("DIR", arguments->folder, "Output folder completed by finalize")->required();
  std::map<std::string, std::size_t> formats;
  std::string list = "Formats:\n";
  for (const ExportFormat& format : export_formats()) {
    formats.emplace(format.word, formats.size());
    list += fmt::format("{}: {}\n", format.word, format.title);
  }
  command->footer(list + "\n" + command->get_footer());  // the exit codes
  take_one_of(command->add_option("--to", arguments->format,
                                  "Format of the export (manifests/guides/exports.md)"),
              formats)
      ->required();
  command->add_option("--out", arguments->out, "Folder for the export")
      ->required()
      ->option_text("FOLDER");
  command->add_option("--split", options.splits, "Export only this split; can be repeated")
      ->option_text("NAME")
      ->allow_extra_args(false);
  const auto add = [&](const char* name, auto& value, const std::string& text) {
    return command->add_option(name, value, formats_with(name, ", ") + ": " + text);
  };
  add("--classes", arguments->classes,
      "JSON file that maps each class name to a number, or to null to leave the class out")
      ->option_text("FILE");
  take_one_of(add("--ignored", arguments->keep_ignored,
                  "keep or drop boxes to ignore (DontCare). YOLO keeps them as a class of their "
                  "own (default: drop), COCO as crowds (default: keep)"),
              kIgnored);
  add("--full-scale", options.full_scale,
      "volume value, with --images png a pixel's sum of them, that becomes 255; default: 1")
      ->check(finite_range(1e-6, 1e6))
      ->option_text("VALUE");
  take_one_of(
      add("--images", options.as_images,
          "volumes as .npy (default), or as PNG of three channels, which stock loaders open"),
      kIsPng);
  take_one_of(add("--dtype", arguments->is_float32, "type of the values; default: float16"),
              kIsFloat32);
  take_one_of(add("--counts", arguments->counts,
                  "draw the number of events from a Poisson distribution (default) or round it; of "
                  "recordings the camera's own are taken, unless this is given"),
              kCounts);
  take_one_of(add("--layout", options.event_file,
                  "lines of text, t x y p (default), or HDF5 as MVSEC has it"),
              kEventFiles);
  add("--representation", arguments->representation,
      "rvt: histogram:T (default: histogram:10), its own of 50 ms, or volume, that of each sample; "
      "webdataset: one of eventgan help representations in place of the volume")
      ->option_text("WORD");
  add("--frames-per-second", options.frames_per_second,
      "frames a second of images whose times are not known; default: 1")
      ->check(finite_range(1e-3, 1e6))
      ->option_text("NUMBER");
  add("--frames", options.frames,
      "the manifest's folder, which frame paths are relative to; default: as recorded by convert")
      ->option_text("DIR");
  add("--seed", options.seed, "random seed; default: 0")->option_text("NUMBER");
  add_threads_option(*command, options.threads);
  command->add_flag("--overwrite", options.overwrite, "Replace an earlier export in FOLDER");
  add_progress_option(*command, arguments->progress);
  command->callback([command, arguments, &exit_code] { exit_code = run(*command, *arguments); });
}

}  // namespace eventgan
