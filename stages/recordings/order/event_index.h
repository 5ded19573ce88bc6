#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace eventgan {

/// Its name in an output folder, beside the plan.
inline constexpr char kEventIndexFile[] = "plan.index";

/// What reading whole recordings has told of where the events of which times lie, while it lives:
/// it is taken from a file, so that no other process of a job reads them whole again, and what is
/// new is written there. An entry is of a file of that path, size and time of change; of one that
/// has another all is read again. It decides nothing: without it everything is the same but slower,
/// and a damaged file is as none.
///
/// It serves the recordings that its thread opens; one at a time in a thread.
class EventIndexes {
 public:
  /// Takes what `file` has; there need be none.
  explicit EventIndexes(const std::filesystem::path& file);
  ~EventIndexes();
  EventIndexes(const EventIndexes&) = delete;
  EventIndexes& operator=(const EventIndexes&) = delete;

  /// This thread's; null: none.
  static EventIndexes* current();

  /// What is known under a key.
  std::optional<std::string> find(const std::string& key);
  void keep(const std::string& key, std::string bytes);

  /// Writes the file, whole or not at all, if anything is new; what nobody asked for goes. Where
  /// that is not possible there is no file, and no fault.
  void save() const;

 private:
  std::filesystem::path file_;
  std::map<std::string, std::string> entries_;
  std::set<std::string> used_;
  bool is_new_ = false;
};

/// The key of a file whose events are read so (`how`: where they lie in it, and what else decides
/// the entry); empty if this thread has no EventIndexes or there is no such file. It is to be made
/// before the file is opened, else one that takes its place in between has the other's entry.
std::string event_index_key(const std::filesystem::path& file, std::string_view how);

}  // namespace eventgan
