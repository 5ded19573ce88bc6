#include "pipeline/command_line/options.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <exception>
#include <iostream>
#include <limits>
#include <map>
#include <string>
#include <system_error>

#include "manifests/values/faults.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/command_line/usage.h"
#include "pipeline/planning/fingerprint.h"

namespace eventgan {
namespace {

const std::map<std::string, ProgressStyle> kProgressStyles = {{"auto", ProgressStyle::kAuto},
                                                              {"bar", ProgressStyle::kBar},
                                                              {"lines", ProgressStyle::kLines},
                                                              {"json", ProgressStyle::kJson},
                                                              {"none", ProgressStyle::kNone}};

}  // namespace

CLI::Validator finite_range(double least, double most) {
  const auto check = [=](const std::string& text) -> std::string {
    double number = 0;
    const bool is_in = CLI::detail::lexical_cast(text, number) && number >= least && number <= most;
    return is_in ? "" : fmt::format("Value {} not in range [{:g} - {:g}]", text, least, most);
  };
  return {check, fmt::format("FLOAT in [{:g} - {:g}]", least, most)};
}

void add_folder_argument(CLI::App& command, std::filesystem::path& folder) {
  command.add_option("DIR", folder, "Output folder of convert")->required();
}

void add_shards_argument(CLI::App& command, std::filesystem::path& where) {
  command.add_option("OUT", where, "Output folder of convert, its dataset.h5, or one shard")
      ->required();
}

void add_frames_option(CLI::App& command, std::filesystem::path& folder) {
  command
      .add_option("--frames", folder,
                  "The manifest's folder, which frame paths are relative to; default: as recorded "
                  "by convert")
      ->option_text("DIR");
}

void add_threads_option(CLI::App& command, int& threads) {
  command.add_option("--threads", threads, "Number of threads; default: all cores")
      ->check(CLI::Range(1, 4096));
}

void add_grace_option(CLI::App& command, double& grace_s) {
  command
      .add_option("--grace", grace_s,
                  "Seconds to finish the current shard after a signal; default: 20")
      ->check(finite_range(0, 1e9))
      ->option_text("SECONDS");
}

void add_limit_option(CLI::App& command, std::optional<std::int64_t>& limit) {
  command
      .add_option("--limit", limit,
                  "Trial run: only N pairs, the first ones of each source, into OUTPUT-trial-N "
                  "beside the manifest's output folder, or into --output")
      ->check(CLI::Range(std::int64_t{1}, std::numeric_limits<std::int64_t>::max()))
      ->option_text("N");
}

void add_json_option(CLI::App& command, bool& json) {
  command.add_flag("--json", json, "Print JSON");
}

void add_progress_option(CLI::App& command, ProgressStyle& style) {
  take_one_of(command.add_option("--progress", style,
                                 "auto (default): a bar on a terminal, lines elsewhere; json: "
                                 "machine-readable lines and report"),
              kProgressStyles);
}

std::unique_ptr<Progress> show_progress(ProgressStyle style, std::int64_t total,
                                        const ProgressUnit& unit) {
  auto progress = std::make_unique<Progress>(std::cerr, style, terminal_columns(), total,
                                             std::chrono::steady_clock::now, unit);
  progress->keep_up();
  return progress;
}

ShowPhase show_phases(ProgressStyle style) {
  return [style](const ProgressUnit& unit, std::int64_t total) {
    return show_progress(style, total, unit);
  };
}

void add_job_options(CLI::App& command, JobOptions& options, const std::string& what,
                     const std::string& what_text, const std::string& overwrite_text) {
  command.add_option(what, options.manifest, what_text)->required();
  command.add_option("--output", options.output, "Output folder; default: the manifest's");
  add_threads_option(command, options.threads);
  command.add_flag("--overwrite", options.overwrite, overwrite_text);
  add_progress_option(command, options.progress);
}

namespace {

namespace fs = std::filesystem;

void refuse_output_folder(const ProfiledCommand& command) {
  std::error_code error;  // of a path that leads nowhere, which TraceFile reports
  const fs::path file = fs::weakly_canonical(fs::absolute(command.file.value(), error), error);
  const fs::path output = fs::weakly_canonical(fs::absolute(command.output, error), error);
  if (error || file.parent_path() != output) return;
  throw UsageError("--profile: expected a file outside the output folder, got " +
                   command.file.value());
}

void finish(TraceRecorder& trace, const ProfiledCommand& command) {
  try {
    trace.finish();
    tell("trace of every stage and thread: " + *command.file +
         " (open it in https://ui.perfetto.dev, chrome://tracing or https://www.speedscope.app)");
  } catch (const std::exception& error) {
    tell_warning(std::string("no trace written: ") + error.what());
  }
}

}  // namespace

void add_profile_option(CLI::App& command, std::optional<std::string>& file) {
  command
      .add_option(
          "--profile", file,
          "Write a trace of all stages and threads, for Perfetto, chrome://tracing or speedscope")
      ->option_text("FILE");
}

int run_profiled(const ProfiledCommand& command, const std::function<int(TraceRecorder*)>& work) {
  if (!command.file) return work(nullptr);
  refuse_output_folder(command);
  TraceRecorder trace(*command.file,
                      {{"program", program_version()}, {"command", "eventgan " + command.name}});
  int exit_code = 0;
  try {
    const TraceWatch watch(trace);
    exit_code = work(&trace);
  } catch (...) {
    finish(trace, command);
    throw;
  }
  finish(trace, command);
  return exit_code;
}

std::string shard_stopping_line(double grace_s) {
  return stopping_line(
      fmt::format("finishing the current shard if it takes at most {:g} s", grace_s));
}

}  // namespace eventgan
