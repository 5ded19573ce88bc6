#include "pipeline/command_line/usage.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numeric>
#include <sstream>
#include <system_error>
#include <utility>

#include "manifests/documents/document_schemas.h"
#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"
#include "stages/events/representation.h"

namespace eventgan {
namespace {

std::size_t slips(const std::string& from, const std::string& to) {
  std::vector<std::size_t> before_last;
  std::vector<std::size_t> last(to.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= from.size(); ++i) {
    std::vector<std::size_t> row(to.size() + 1, i);
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const bool is_same = from[i - 1] == to[j - 1];
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + !is_same});
      if (i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1]) {
        row[j] = std::min(row[j], before_last[j - 2] + 1);
      }
    }
    before_last = std::exchange(last, std::move(row));
  }
  return last.back();
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

}  // namespace

std::string nearest_word(const std::string& word, const std::vector<std::string>& words) {
  std::size_t fewest = std::max<std::size_t>(word.size() / 3, 1) + 1;
  std::string nearest;
  for (const std::string& candidate : words) {
    const std::size_t count = slips(word, candidate);
    if (count >= fewest) continue;
    fewest = count;
    nearest = candidate;
  }
  return nearest;
}

std::string did_you_mean(const std::string& word, const std::vector<std::string>& words) {
  const std::string nearest = nearest_word(word, words);
  return nearest.empty() ? "" : "; did you mean " + nearest + "?";
}

std::string usage_text(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  const CLI::App& command = chosen.empty() ? app : *chosen.back();
  const std::string name = chosen.empty() ? "eventgan" : "eventgan " + command.get_name();
  const std::string help = " (" + name + " --help)";
  for (const std::string& unknown : command.remaining()) {
    if (unknown == "--") continue;  // behind which nothing is an option
    if (unknown.starts_with("-")) {
      const std::string option = unknown.substr(0, unknown.find('='));
      return "expected options of " + name + ", got " + option +
             did_you_mean(option, option_names(command)) + help;
    }
    if (chosen.empty()) {
      return "expected a command, got " + unknown + did_you_mean(unknown, command_names(app)) +
             help;
    }
  }
  return error.what() + help;
}

void refuse_empty_values(CLI::App& app) {
  const CLI::Validator is_text(
      [](const std::string& value) {
        return std::string(value.empty() ? "expected a value, got nothing" : "");
      },
      "");
  for (CLI::App* command : app.get_subcommands({})) {
    for (CLI::Option* option : command->get_options({})) option->check(is_text);
  }
}

namespace {

constexpr std::size_t kHelpColumns = 80;

/// `text` with its lines broken between words, the first one beginning at column `indent` and all
/// others indented to it. Its own line ends stay.
std::string wrapped(const std::string& text, std::size_t indent) {
  std::string lines;
  std::istringstream paragraphs(text);
  for (std::string paragraph; std::getline(paragraphs, paragraph);) {
    std::size_t column = kHelpColumns;  // none is left: the first word begins a line
    std::istringstream words(paragraph);
    for (std::string word; words >> word;) {
      const bool fits = column + 1 + word.size() <= kHelpColumns;
      if (!fits && !lines.empty()) lines += "\n" + std::string(indent, ' ');
      if (fits) lines += ' ';
      lines += word;
      column = (fits ? column + 1 : indent) + word.size();
    }
  }
  return lines + "\n";
}

class WrappedHelp : public CLI::Formatter {
 public:
  std::string make_description(const CLI::App* app) const override {
    return wrapped(app->get_description(), 0);
  }

  std::string make_footer(const CLI::App* app) const override {
    return wrapped(app->get_footer(), 0);
  }

  std::string make_subcommand(const CLI::App* command) const override {
    const std::string description = command->get_description();
    return entry(command->get_name(), description.substr(0, description.find('\n')));
  }

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    return entry(make_option_name(option, is_positional) + make_option_opts(option),
                 make_option_desc(option));
  }

 private:
  std::string entry(const std::string& name, const std::string& text) const {
    const std::size_t indent = get_column_width();
    const std::string start = "  " + name;
    const std::string gap = start.size() < indent ? std::string(indent - start.size(), ' ')
                                                  : "\n" + std::string(indent, ' ');
    return start + gap + wrapped(text, indent);
  }
};

}  // namespace

void wrap_help(CLI::App& app) { app.formatter(std::make_shared<WrappedHelp>()); }

namespace {

/// Where the scripts for clusters are, of this program as it is installed or built.
std::string cluster_page() {
  namespace fs = std::filesystem;
  std::error_code unknown;
  const fs::path folder = fs::read_symlink("/proc/self/exe", unknown).parent_path();
  for (const char* const from_program : {"../share/eventgan/docker", "../../docker"}) {
    const fs::path docker = (folder / from_program).lexically_normal();
    if (!fs::exists(docker / "slurm/submit.sh", unknown)) continue;
    return "Slurm: freezes the plan, then an array with a task for each shard, then finalize:\n  " +
           (docker / "slurm/submit.sh").string() + " MANIFEST OUTPUT --partition=NAME\n" +
           "Kubernetes: edit, then kubectl apply -f each:\n  " + (docker / "kubernetes").string() +
           "\nAnywhere else a worker takes a part: eventgan convert MANIFEST --shards 0/4; then " +
           "eventgan finalize OUTPUT\nAll about it: " + (docker / "running.md").string() + "\n";
  }
  throw InputError("expected the scripts for clusters beside the program, got none, in " +
                   (folder.parent_path() / "share/eventgan/docker").string());
}

std::string representations_page() {
  std::string page =
      "How events become arrays, by their word and number, such as histogram:10.\n"
      "t1 and tN: the interval's ends; p: polarity; H, W: height and width in pixels.\n";
  for (const RepresentationRow& row : representations()) {
    page += fmt::format("\n{}{}{}  {} {}\n    {}\n    for {}\n", row.word,
                        row.number.empty() ? "" : ":", row.number, row.dtype, row.shape,
                        row.equation, row.readers);
  }
  return page;
}

/// Of the page of all keys the rows of those whose path, without the marks of lists, begins with
/// `start` at one of its names.
std::string keys_page_of(std::string start) {
  const auto remove_marks = [](std::string& path) {
    for (std::size_t at = 0; (at = path.find("[]")) != path.npos;) path.erase(at, 2);
  };
  remove_marks(start);
  constexpr std::string_view kRow = "| `";
  std::string page, head;
  std::vector<std::string> names;
  std::istringstream lines(keys_page());
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("## ")) head = (page.empty() ? "" : "\n") + line + "\n\n";
    if (!line.starts_with('|')) continue;
    if (!line.starts_with(kRow)) {
      head += line + "\n";
      continue;
    }
    std::string key = line.substr(kRow.size(), line.find('`', kRow.size()) - kRow.size());
    remove_marks(key);
    bool is_wanted = false;
    for (bool is_last = false; !is_last; key.erase(0, key.find('.') + 1)) {
      is_last = key.find('.') == key.npos;
      names.push_back(key);
      is_wanted = is_wanted || key.starts_with(start);
    }
    if (is_wanted) page += std::exchange(head, "") + line + "\n";
  }
  if (!page.empty()) return page;
  throw UsageError("expected the beginning of a key, such as pairs.motion, got " + start +
                   did_you_mean(start, names) + " (eventgan help keys)");
}

}  // namespace

void add_help_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "help",
      "Show the help of the program or of a command\n`help keys` lists every key of the "
      "manifests, with its values and its default, `help keys pairs.motion` those that "
      "begin so, `help representations` how events become arrays, `help cluster` says where the "
      "scripts for Slurm and Kubernetes are.");
  const auto name = std::make_shared<std::string>();
  const auto start = std::make_shared<std::string>();
  command->add_option("COMMAND", *name,
                      "The command, keys, representations, or cluster; default: list all commands");
  command->add_option("KEY", *start, "With keys: what the keys begin with; default: list all");
  command->callback([&app, name, start, &exit_code] {
    if (!start->empty() && *name != "keys") {
      throw UsageError("expected one command, got " + *name + " and " + *start +
                       " (eventgan help --help)");
    }
    const auto known =
        app.get_subcommands([&](const CLI::App* one) { return one->get_name() == *name; });
    if (name->empty()) {
      // App::help() would be that of the command that was given: this one's.
      std::cout << app.get_formatter()->make_help(&app, app.get_name(), CLI::AppFormatMode::Normal);
    } else if (*name == "keys") {
      std::cout << (start->empty() ? keys_page() : keys_page_of(*start));
    } else if (*name == "representations") {
      std::cout << representations_page();
    } else if (*name == "cluster") {
      std::cout << cluster_page();
    } else if (!known.empty()) {
      std::cout << known.front()->help(app.get_name());
    } else {
      throw UsageError("expected a command, got " + *name +
                       did_you_mean(*name, command_names(app)) + " (eventgan --help)");
    }
    std::cout << std::flush;
    exit_code = kComplete;
  });
}

}  // namespace eventgan
