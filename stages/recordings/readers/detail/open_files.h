#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/recently_used.h"
#include "stages/recordings/order/event_check.h"

namespace eventgan {

/// As many files as this process keeps open (files_to_keep_open), by their OpenedAtUse.
using OpenFiles = RecentlyUsed<const void*, std::shared_ptr<const void>>;
OpenFiles& open_files();

/// A file, or what is read of an open one, that is open while it is used: those used last stay open
/// (open_files), the others are opened again. A folder may have more recordings than a process may
/// have open files. Thread safe; of HDF5 everything under its lock.
template <class Opened>
class OpenedAtUse {
 public:
  /// `open` gives the same each time or throws InputError.
  explicit OpenedAtUse(std::function<Opened()> open) : open_(std::move(open)) {}
  ~OpenedAtUse() { open_files().forget(this, this); }
  OpenedAtUse(const OpenedAtUse&) = delete;
  OpenedAtUse& operator=(const OpenedAtUse&) = delete;

  std::shared_ptr<const Opened> get() const {
    return std::static_pointer_cast<const Opened>(
        open_files().get(this, [&] { return std::make_shared<const Opened>(open_()); }));
  }

 private:
  std::function<Opened()> open_;
};

/// A file of which bytes are read.
class RecordingFile {
 public:
  /// Throws as InputFile.
  explicit RecordingFile(const std::filesystem::path& path);

  const std::string& name() const { return name_; }
  /// As it was opened first; one that has another since is told of as InputError.
  std::int64_t end_byte() const { return end_byte_; }
  /// As InputFile::read_between.
  std::string read_between(std::int64_t begin, std::int64_t end) const {
    return file_.get()->read_between(begin, end);
  }

  /// Runs `read`; an EventFault in it is of what lies at `byte`.
  template <class Read>
  auto at(std::int64_t byte, Read read) const {
    try {
      return read();
    } catch (const EventFault& fault) {
      refuse(fault.what(), byte);
    }
  }
  /// Throws InputError "FAULT, in PATH (byte 4567)".
  [[noreturn]] void refuse(const std::string& fault, std::int64_t byte) const;

 private:
  std::string name_;
  std::int64_t end_byte_ = -1;  ///< -1: it was not opened yet
  OpenedAtUse<InputFile> file_;
};

}  // namespace eventgan
