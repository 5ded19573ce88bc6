#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace eventgan {

/// A name for a temporary file beside `target` that no other writer uses:
/// ".NAME.HOST.PID.ATTEMPT.tmp".
std::filesystem::path temporary_beside(const std::filesystem::path& target);

/// fsync of a file or a folder. Throws std::runtime_error naming the path.
void sync_to_disk(const std::filesystem::path& path);

/// Renames `temporary` to `target` and fsyncs the folder: afterwards `target` is whole, also after
/// a power cut. Throws std::runtime_error naming both paths.
void publish(const std::filesystem::path& temporary, const std::filesystem::path& target);

/// Writes `text` under a temporary name, fsyncs it and publishes it. On an error the temporary is
/// gone and `target` is what it was. Throws std::runtime_error naming the path.
void write_file_atomically(const std::filesystem::path& target, std::string_view text);

/// The same, but only if `target` does not exist; false (and nothing changed) if it does. Of two
/// processes that race, one wins.
bool create_file_atomically(const std::filesystem::path& target, std::string_view text);

/// Takes a file's text piece by piece; pieces should be large.
using TextSink = std::function<void(std::string_view)>;

/// The same for a text that need not stand in memory: `write` is called with the sink to give it
/// to, unless `target` exists already. What `write` throws is passed on, and nothing has changed.
bool create_file_atomically(const std::filesystem::path& target,
                            const std::function<void(const TextSink&)>& write);

}  // namespace eventgan
