#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace eventgan {

/// The one of `words` that `word` was most likely meant to be: the first of those that it takes the
/// fewest slips to get from (optimal string alignment distance: letters left out, put in,
/// exchanged, or swapped with their neighbour). Empty if none is near: a third of the word's
/// letters may be slips, one in any case.
std::string nearest_word(const std::string& word, const std::vector<std::string>& words);

/// "; did you mean WORD?" of the nearest word, or nothing.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& words);

/// What the command line has that the program does not know, with the nearest name it does know;
/// else what CLI11 says of it. One line. `error` is what parsing with `app` threw.
std::string usage_text(const CLI::App& app, const CLI::ParseError& error);

/// Makes every option of the commands of `app` refuse an empty text as its value, where an unset
/// variable of a script has been.
void refuse_empty_values(CLI::App& app);

/// Makes the help of `app`, and of the commands that are added to it from then on, break its lines
/// between words at 80 columns. The first line of a command's description stands in the list of
/// commands, all of it in the command's own help.
void wrap_help(CLI::App& app);

/// Adds `help [COMMAND]`.
void add_help_command(CLI::App& app, int& exit_code);

/// Makes an option take one of these words, which help and messages list. (CLI11's own
/// CheckedTransformer takes the values' numbers, too, and lists both.)
template <class Value>
CLI::Option* take_one_of(CLI::Option* option, const std::map<std::string, Value>& values) {
  std::vector<std::string> words;
  for (const auto& [word, value] : values) words.push_back(word);
  const auto replace = [values, words](std::string& word) -> std::string {
    const auto found = values.find(word);
    if (found == values.end()) {
      return "expected one of " + CLI::detail::join(words, ", ") + ", got " + word +
             did_you_mean(word, words);
    }
    word = std::to_string(static_cast<int>(found->second));  // as CLI11 reads an enumeration
    return "";
  };
  return option->transform(CLI::Validator(replace, ""))
      ->option_text("{" + CLI::detail::join(words, ",") + "}");
}

}  // namespace eventgan
