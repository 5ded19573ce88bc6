#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/commands/commands.h"
#include "pipeline/commands/detail/usage.h"
#include "pipeline/commands/options.h"
#include "pipeline/commands/standard_streams.h"
#include "pipeline/exports/export_job.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"

namespace eventgan {
namespace {

const std::map<std::string, ExportFormat> kFormats = {
    {"yolo", ExportFormat::kYolo},     {"coco", ExportFormat::kCoco},
    {"mpii", ExportFormat::kMpii},     {"davis", ExportFormat::kDavis},
    {"events", ExportFormat::kEvents}, {"webdataset", ExportFormat::kWebdataset},
    {"dsec", ExportFormat::kDsec},     {"rvt", ExportFormat::kRvt}};
const std::map<std::string, bool> kIgnored = {{"keep", true}, {"drop", false}};
const std::map<std::string, bool> kIsFloat32 = {{"float16", false}, {"float32", true}};
const std::map<std::string, EventCounts> kCounts = {{"poisson", EventCounts::kPoisson},
                                                    {"rounded", EventCounts::kRounded}};
const std::map<std::string, EventFile> kEventFiles = {{"text", EventFile::kText},
                                                      {"mvsec", EventFile::kMvsec}};

/// An option that only some formats have.
struct OwnOption {
  const char* name;
  const char* formats;
  std::vector<ExportFormat> of;
};
const std::vector<ExportFormat> kOfDrawnEvents = {ExportFormat::kEvents, ExportFormat::kDsec,
                                                  ExportFormat::kRvt};
const std::vector<OwnOption> kOwnOptions = {
    {"--classes",
     "yolo, coco, dsec or rvt",
     {ExportFormat::kYolo, ExportFormat::kCoco, ExportFormat::kDsec, ExportFormat::kRvt}},
    {"--ignored", "yolo or coco", {ExportFormat::kYolo, ExportFormat::kCoco}},
    {"--full-scale", "yolo or mpii", {ExportFormat::kYolo, ExportFormat::kMpii}},
    {"--dtype", "davis", {ExportFormat::kDavis}},
    {"--counts", "events, dsec or rvt", kOfDrawnEvents},
    {"--layout", "events", {ExportFormat::kEvents}},
    {"--seed", "events, dsec or rvt", kOfDrawnEvents}};

struct ExportArguments {
  std::string folder;
  std::string out;
  std::string classes;
  bool keep_ignored = false;
  bool is_float32 = false;
  ExportOptions options;
  ProgressStyle progress = ProgressStyle::kAuto;
};

int run(const CLI::App& command, const ExportArguments& arguments) {
  ExportOptions options = arguments.options;
  for (const OwnOption& option : kOwnOptions) {
    const bool has_it = std::ranges::find(option.of, options.to) != option.of.end();
    if (command.count(option.name) > 0 && !has_it) {
      throw UsageError(
          fmt::format("{}: expected --to {}, got another format", option.name, option.formats));
    }
  }
  if (arguments.out.empty()) throw UsageError("--out: expected a folder, got nothing");
  options.out = arguments.out;
  if (command.count("--classes") > 0) options.classes = arguments.classes;
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
  take_one_of(
      command->add_option("--to", options.to, "Format of the export (manifests/guides/exports.md)"),
      kFormats)
      ->required();
  command->add_option("--out", arguments->out, "Folder for the export")
      ->required()
      ->option_text("FOLDER");
  command->add_option("--split", options.splits, "Export only this split; can be repeated")
      ->option_text("NAME")
      ->allow_extra_args(false);
  command
      ->add_option("--classes", arguments->classes,
                   "yolo, coco, dsec, rvt: JSON file that maps each class name to a number, or to "
                   "null to leave the class out")
      ->option_text("FILE");
  take_one_of(
      command->add_option("--ignored", arguments->keep_ignored,
                          "yolo, coco: keep or drop boxes to ignore (DontCare). yolo keeps them as "
                          "a class of their own (default: drop), coco as crowds (default: keep)"),
      kIgnored);
  command
      ->add_option("--full-scale", options.full_scale,
                   "yolo, mpii: volume value that becomes 255; default: 1")
      ->check(CLI::Range(1e-6, 1e6))
      ->option_text("VALUE");
  take_one_of(command->add_option("--dtype", arguments->is_float32,
                                  "davis: type of the values; default: float16"),
              kIsFloat32);
  take_one_of(
      command->add_option(
          "--counts", options.counts,
          "events, dsec, rvt: draw the number of events from a Poisson distribution (default) or "
          "round it"),
      kCounts);
  take_one_of(
      command->add_option("--layout", options.event_file,
                          "events: lines of text, t x y p (default), or HDF5 as MVSEC has it"),
      kEventFiles);
  command->add_option("--seed", options.seed, "events, dsec, rvt: random seed; default: 0")
      ->option_text("NUMBER");
  command->add_option("--threads", options.threads, "Number of threads; default: all cores")
      ->check(CLI::Range(1, 4096));
  command->add_flag("--overwrite", options.overwrite, "Replace an earlier export in FOLDER");
  add_progress_option(*command, arguments->progress);
  command->callback([command, arguments, &exit_code] { exit_code = run(*command, *arguments); });
}

}  // namespace eventgan
