#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "manifests/files/atomic_file.h"
#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/preview/preview_reader.h"
#include "pipeline/report/report_page.h"
#include "pipeline/runtime/errors.h"
#include "stages/events/images/image_output.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  fs::path folder;
  std::optional<fs::path> out;
  fs::path frames;
};

int run(const ReportArguments& arguments) {
  constexpr int kImageWidth = 640;
  const fs::path& folder = arguments.folder;
  const fs::path page = arguments.out.value_or(folder / kReportName);
  if (page.extension() != ".html") {
    throw UsageError("--out: expected a path of *.html, got " + page.string());
  }
  require_replaceable(page, OwnFile::kReport);
  const Survey survey = survey_folder(folder);
  std::vector<std::string> warnings;
  PreviewReader reader(!arguments.frames.empty()
                           ? fs::absolute(arguments.frames)
                           : recorded_manifest_folder(folder).value_or(folder),
                       warnings);
  PageContext context;
  context.folder = folder;
  context.file = page;
  context.warning = weights_warning(survey.parts.manifest);
  context.image = [&](const PickedSample& sample) {
    const PreviewContent content = reader.content(folder / sample.shard, sample.slot);
    return jpeg_of(draw_tile(content, kImageWidth), PageContext::kMostImageBytes);
  };
  write_file_atomically(context.file, report_page(survey, context));
  std::cout << context.file.string() << std::endl;
  for (const std::string& warning : warnings) tell_warning(warning);
  return kComplete;
}

}  // namespace

void add_report_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("report",
                         "Write an HTML report about an output folder\nOne self-contained page "
                         "with inputs, counts, distributions, faults and sample images.");
  const auto arguments = std::make_shared<ReportArguments>();
  add_folder_argument(*command, arguments->folder);
  command->add_option("--out", arguments->out, "The page to write; default: DIR/report.html")
      ->option_text("FILE");
  add_frames_option(*command, arguments->frames);
  command->callback([arguments, &exit_code] {
    exit_code = read_apart(arguments->folder, [&] { return run(*arguments); });
  });
}

}  // namespace eventgan
