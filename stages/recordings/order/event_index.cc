#include "stages/recordings/order/event_index.h"

#include <fmt/core.h>

#include <cstdint>
#include <exception>
#include <system_error>
#include <utility>

#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "stages/recordings/order/packed_bytes.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Of a file; another where the same bytes mean something else.
constexpr std::string_view kFirstLine = "eventgan-event-index 2\n";
constexpr std::size_t kHashDigits = 64;

thread_local EventIndexes* current_indexes = nullptr;

/// Nothing of what is no whole file of them.
std::map<std::string, std::string> read_entries(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  if (!text || !text->starts_with(kFirstLine)) return {};
  std::string_view bytes = std::string_view(*text).substr(kFirstLine.size());
  const std::string_view hash = bytes.substr(0, kHashDigits);
  bytes.remove_prefix(hash.size());
  if (sha256_hex(bytes) != hash) return {};
  std::map<std::string, std::string> entries;
  for (std::string key, entry; unpack(bytes, key) && unpack(bytes, entry);) entries[key] = entry;
  return entries;
}

}  // namespace

EventIndexes::EventIndexes(const fs::path& file) : file_(file), entries_(read_entries(file)) {
  current_indexes = this;
}

EventIndexes::~EventIndexes() { current_indexes = nullptr; }

EventIndexes* EventIndexes::current() { return current_indexes; }

std::optional<std::string> EventIndexes::find(const std::string& key) {
  const auto entry = entries_.find(key);
  if (entry == entries_.end()) return std::nullopt;
  used_.insert(key);
  return entry->second;
}

void EventIndexes::keep(const std::string& key, std::string bytes) {
  entries_[key] = std::move(bytes);
  used_.insert(key);
  is_new_ = true;
}

void EventIndexes::save() const try {
  if (!is_new_) return;
  std::string bytes;
  for (const std::string& key : used_) {
    pack(bytes, key);
    pack(bytes, entries_.at(key));
  }
  write_file_atomically(file_, std::string(kFirstLine) + sha256_hex(bytes) + bytes);
} catch (const std::exception&) {  // what does need the folder will say so
}

std::string event_index_key(const fs::path& file, std::string_view how) {
  if (EventIndexes::current() == nullptr) return "";
  std::error_code error;
  const auto size = fs::file_size(file, error);
  if (error) return "";
  const auto changed = fs::last_write_time(file, error);
  if (error) return "";
  return fmt::format("{} {} {} {}", fs::absolute(file).lexically_normal().string(), size,
                     changed.time_since_epoch().count(), how);
}

}  // namespace eventgan
