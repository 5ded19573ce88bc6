#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "manifests/values/events.h"

namespace eventgan {

/// Writes an HDF5 file in the layout that the EventGAN authors' trainers read: `/davis/events`
/// [rows, H, W, 2 bins] float16 or float32, one row a chunk, shuffled and deflated, and
/// `/davis/valid` [rows] uint8. A row that is not given is zeros, and not valid.
///
/// The file appears under its name on commit() only, whole. The same calls give the same bytes.
/// Throws std::runtime_error naming the file. Thread safety: one writer is for one thread.
class DavisFile {
 public:
  /// `value_bytes`: 2 for float16, 4 for float32.
  DavisFile(const std::filesystem::path& file, std::size_t rows, const VolumeShape& shape,
            std::size_t value_bytes);
  ~DavisFile();

  /// `values`: [H, W, 2 bins] of the file's type, C order, little endian. A row is given once.
  void write_row(std::size_t row, std::span<const std::byte> values);

  void commit();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace eventgan
