#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace eventgan {

/// What says that an export is complete.
inline constexpr char kExportDescription[] = "export.json";

/// The folder that an export is written to, and what of it is done: .export/export.txt says which
/// export it is, .export/STEP.json is a receipt, written after all files of a step and listing them
/// with their sizes. A step is done if its receipt is of the same input and each of its files has
/// its size; else it is done again, and export.json, a step of its own, goes before anything else
/// is written. .export/STEP.begun, a journal, names each file of a step under way before it is
/// written, so that a killed run's can be found.
///
/// A name that a receipt or a journal has is believed if it is export.json or some format writes
/// files of this name (ExportFormat::files), and no part of it is hidden. Any other is a
/// std::runtime_error that names it and its record; so is a symbolic link on the way to a file, as
/// require_no_link says. Both come before anything is removed. Thread safe.
class ExportFolder {
 public:
  /// Whether the folder is that of the export already.
  static bool is_of(const std::filesystem::path& folder, const std::string& identity);

  /// Begins or resumes the export that `identity` describes, a line for each of its settings.
  /// Throws UsageError if the folder holds another one or other files. With `overwrite` another
  /// export of the same job (its "job" line) is removed first, also that of a run that was killed;
  /// nothing is, if there are other files beside it.
  ExportFolder(std::filesystem::path folder, const std::string& identity, bool overwrite);

  /// Files that are made together, and their receipt.
  class Step {
   public:
    /// `input`: hash of everything the files are made from.
    Step(ExportFolder& folder, std::string name, std::string input);

    bool is_done() const;

    /// Where to write the file `relative`, whose folder is there afterwards. The file counts as
    /// this step's, and must be under its name at `finish`. Throws std::runtime_error for a name
    /// that would not be believed, and InputError for one that differs from an earlier one by the
    /// case of letters alone: on Windows and macOS the folder would hold one of both. Thread safe,
    /// as is `write`.
    std::filesystem::path file(const std::string& relative);
    void write(const std::string& relative, std::string_view bytes);

    /// The same of a file that people fill in: what they have made of an earlier run's stays, and
    /// this is false.
    bool write_unless_edited(const std::string& relative, std::string_view bytes);

    /// Writes the receipt; files of earlier runs that were not made again go.
    void finish();

   private:
    void add_to_journal(std::set<std::string> names);

    ExportFolder& folder_;
    std::string name_;
    std::string input_;
    std::mutex mutex_;
    std::set<std::string> files_;
    std::map<std::string, std::string> sha256_;  ///< as written, of files that people fill in
  };

  const std::filesystem::path& path() const { return folder_; }

  /// Removes what earlier runs made in steps that this one has not had, such as those of shards
  /// that are gone, and folders that are empty then.
  void remove_other_steps();

  /// Calls take(name) for each file of the steps that are done, in the order of the steps' names.
  void for_each_file(const std::function<void(const std::string&)>& take) const;

 private:
  std::filesystem::path receipt(const std::string& step) const;
  std::filesystem::path journal(const std::string& step) const;
  void make_folder(const std::filesystem::path& folder);
  void require_nothing_else() const;
  void begin(const std::string& step);
  void require_own_name(const std::string& relative);

  std::filesystem::path folder_;
  std::mutex mutex_;
  std::set<std::filesystem::path> made_;
  std::set<std::string> steps_;  ///< of this run
  /// The first half of a SHA-256.
  using NameHash = std::array<std::uint64_t, 2>;
  static NameHash hash_of(const std::string& name);
  /// Hashes, since there may be millions: of each name in small letters, of the name as it is.
  std::map<NameHash, NameHash> names_;
  bool has_begun_ = false;
};

}  // namespace eventgan
