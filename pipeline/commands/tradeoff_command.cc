#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "manifests/values/words.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "pipeline/tradeoff/tradeoff.h"
#include "pipeline/tradeoff/tradeoff_report.h"

namespace eventgan {
namespace {

struct TradeoffArguments {
  std::string manifest;
  std::vector<std::string> widths, precisions, scopes, methods, dtypes;
  std::vector<double> sizes;
  std::string reference;
  std::vector<std::string> real;
  TradeoffOptions options;
  TradeoffDemand demand;
  std::optional<std::string> out;
  ProgressStyle progress = ProgressStyle::kAuto;
};

/// A whole number is a shipped width; anything else a name as the manifest writes it.
std::string weights_name(const std::string& text) {
  const bool is_width = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
  return is_width ? "shipped:" + text : text;
}

template <class T, std::size_t N>
T value_of(const std::array<Word<T>, N>& words, const std::string& text, const char* option) {
  if (const auto value = value_of_word(words, text)) return *value;
  throw UsageError(fmt::format("{}: expected one of {}, got \"{}\"", option,
                               joined(words, ", ", &Word<T>::word), text));
}

/// Replaces an axis by what the user names, if that is anything.
template <class Text, class Read>
void read_axis(const char* option, const std::vector<Text>& texts, auto& axis, Read read) {
  if (texts.empty()) return;
  axis.clear();
  for (const Text& text : texts) {
    const auto value = read(text);
    if (std::ranges::find(axis, value) != axis.end()) {
      throw UsageError(std::string(option) + ": expected different values, got one twice");
    }
    axis.push_back(value);
  }
}

TradeoffAxes axes_of(const TradeoffArguments& arguments, const JobManifest& manifest) {
  TradeoffAxes axes = default_axes(manifest);
  const auto words = [](const auto& known, const char* option) {
    return [&known, option](const std::string& text) { return value_of(known, text, option); };
  };
  read_axis("--widths", arguments.widths, axes.weights, weights_name);
  read_axis("--precisions", arguments.precisions, axes.precisions,
            words(kPrecisionWords, "--precisions"));
  read_axis("--scopes", arguments.scopes, axes.scopes, words(kScopeWords, "--scopes"));
  read_axis("--methods", arguments.methods, axes.methods, words(kGeneratorWords, "--methods"));
  read_axis("--dtypes", arguments.dtypes, axes.dtypes, words(kStoredTypeWords, "--dtypes"));
  read_axis("--sizes", arguments.sizes, axes.sizes, [](double size) { return size; });
  return axes;
}

/// WEIGHTS[,PRECISION[,SIZE]]
Computation reference_of(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char letter : text) {
    if (letter == ',') {
      parts.emplace_back();
    } else {
      parts.back() += letter;
    }
  }
  Computation reference;
  reference.weights = weights_name(parts[0]);
  if (parts.size() > 1) {
    reference.precision = value_of(kPrecisionWords, parts[1], "--reference");
  }
  if (parts.size() > 2) {
    const std::string& size = parts[2];
    const char* const end = size.data() + size.size();
    const auto [stop, error] = std::from_chars(size.data(), end, reference.size);
    if (error != std::errc() || stop != end || !(reference.size >= 0.05 && reference.size <= 4) ||
        parts.size() > 3) {
      throw UsageError(
          "--reference: expected WEIGHTS,PRECISION,SIZE with a size in 0.05..4, got \"" + text +
          "\"");
    }
  }
  return reference;
}

int run(TradeoffArguments& arguments) {
  const StopSignal signal(stopping_line("finishing the current pair"));
  const JobManifest manifest = read_job_manifest(arguments.manifest);
  if (!needs_frames(manifest.generator.kind)) {
    throw UsageError(
        "$.generator.kind: expected a generator that makes events from frames, got \"events\", "
        "which has only one configuration");
  }
  TradeoffOptions& options = arguments.options;
  options.axes = axes_of(arguments, manifest);
  options.only_native = arguments.precisions.empty();
  if (!arguments.reference.empty()) options.reference = reference_of(arguments.reference);
  const std::filesystem::path out = arguments.out
                                        ? std::filesystem::path(*arguments.out)
                                        : manifest.directory / (manifest.name + "-tradeoff");
  if (std::filesystem::exists(out / "plan.json")) {
    throw UsageError("--out: expected a folder of its own, got that of shards, " + out.string());
  }
  require_replaceable(out / "tradeoff.json", OwnFile::kTradeoffReport);
  require_replaceable(out / "tradeoff.md", OwnFile::kTradeoffTable);
  require_replaceable(out / "tradeoff.svg", OwnFile::kChart);
  std::filesystem::create_directories(out);  // before minutes of measuring
  for (const std::string& real : arguments.real) {
    options.real.push_back(open_recording(real));
    if (options.real.back()->frame_count() == 0) {
      throw InputError("expected a recording with frames, got one without, in " + real);
    }
  }
  options.stop_requested = [&] { return signal.requested(); };
  if (arguments.progress != ProgressStyle::kNone) options.tell = tell_note;
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total, {"pairs", /*has_bytes=*/false});
  };
  const TradeoffReport report = measure_tradeoff(manifest, options);
  const std::string json = to_json(report, arguments.demand);
  write_file_atomically(out / "tradeoff.json", json);
  write_file_atomically(out / "tradeoff.md", to_markdown(report, arguments.demand));
  write_file_atomically(out / "tradeoff.svg", tradeoff_chart(report));
  if (arguments.progress == ProgressStyle::kJson) {
    std::cout << json << std::flush;
  } else {
    std::cout << to_text(report, arguments.demand) << "\nAll measurements: tradeoff.md, "
              << "tradeoff.json and tradeoff.svg in " << out.string() << std::endl;
  }
  return kComplete;
}

void add_axes(CLI::App& command, TradeoffArguments& arguments) {
  command
      .add_option("--widths", arguments.widths,
                  "Weights to compare: base widths of shipped weights, or names as in the "
                  "manifest; default: all shipped weights and the manifest's")
      ->delimiter(',')
      ->option_text("WEIGHTS,...");
  command
      .add_option("--precisions", arguments.precisions,
                  "Precisions to compare: float32,bfloat16,int8; default: float32, the manifest's, "
                  "and those that this processor has instructions for")
      ->delimiter(',')
      ->option_text("PRECISION,...");
  command
      .add_option("--sizes", arguments.sizes,
                  "Scale factors of the volume's sides, 0.05..4, 1 as in the manifest; default: 1")
      ->delimiter(',')
      ->check(finite_range(0.05, 4))
      ->option_text("SIZE,...");
  command
      .add_option("--scopes", arguments.scopes,
                  "Scopes to compare: whole,motion,labels,labels_only; default: the manifest's")
      ->delimiter(',')
      ->option_text("SCOPE,...");
  command
      .add_option(
          "--methods", arguments.methods,
          "Methods to compare: network,difference,esim; default: network and the manifest's")
      ->delimiter(',')
      ->option_text("METHOD,...");
  command
      .add_option("--dtypes", arguments.dtypes,
                  "Stored types to compare: float32,float16,uint8; default: the manifest's")
      ->delimiter(',')
      ->option_text("TYPE,...");
  command
      .add_option("--reference", arguments.reference,
                  "Configuration that the others are compared with, WEIGHTS[,PRECISION[,SIZE]]; "
                  "default: the widest weights, float32, 1")
      ->option_text("CONFIGURATION");
}

}  // namespace

void add_tradeoff_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "tradeoff",
      "Measure the speed and accuracy of configurations\nMeasures on pairs of a job how fast each "
      "combination of weights, precision, size, scope, method and stored type is and how much it "
      "loses against a reference, and recommends configurations with their manifest lines "
      "(manifests/guides/tradeoff.md). Compares at most ten configurations by default.");
  const auto arguments = std::make_shared<TradeoffArguments>();
  command->add_option("MANIFEST", arguments->manifest, "The manifest of the job")->required();
  add_axes(*command, *arguments);
  command
      ->add_option("--real", arguments->real,
                   "A recording of events and frames to score the configurations against, as "
                   "realism does; can be repeated")
      ->option_text("RECORDING")
      ->allow_extra_args(false);
  command
      ->add_option("--pairs", arguments->options.pairs,
                   "Number of pairs, evenly spread over the job; default: 32")
      ->check(CLI::Range(1, 100000));
  command
      ->add_option("--rounds", arguments->options.rounds,
                   "Rounds of timing, in which all configurations take turns; default: 5")
      ->check(CLI::Range(1, 1000));
  command
      ->add_option("--at-most-error", arguments->demand.at_most_error,
                   "Also print the manifest lines of the fastest configuration with at most this "
                   "error (relative L2)")
      ->check(finite_range(0, 1e9))
      ->option_text("ERROR");
  command
      ->add_option("--at-least-speed", arguments->demand.at_least_speed,
                   "Also print the manifest lines of the most accurate configuration with at least "
                   "this many pairs per second")
      ->check(finite_range(0, 1e9))
      ->option_text("SPEED");
  command
      ->add_option(
          "--out", arguments->out,
          "Folder for the tables and the chart; default: NAME-tradeoff beside the manifest")
      ->option_text("FOLDER");
  add_threads_option(*command, arguments->options.threads);
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan
