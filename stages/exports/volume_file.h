#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "manifests/values/events.h"

namespace eventgan {

/// Whose trainers read a file of volumes.
enum class VolumeLayout {
  kDavis,  ///< the EventGAN authors': `/davis/events` [rows, H, W, 2 bins], `/davis/valid` [rows]
  kRvt     ///< RVT's: `/data` [rows, 2 bins, H, W]
};

/// Writes an HDF5 file of uint8, float16 or float32 volumes, one row a chunk, shuffled and
/// deflated. A row that is not given is zeros; `/davis/valid`, uint8, is 1 for those that are.
///
/// The file appears under its name on commit() only, whole. The same calls give the same bytes.
/// Throws std::runtime_error naming the file. Thread safety: one writer is for one thread.
class VolumeFile {
 public:
  /// `value_bytes`: 1 for uint8, 2 for float16, 4 for float32.
  VolumeFile(const std::filesystem::path& file, VolumeLayout layout, std::size_t rows,
             const VolumeShape& shape, std::size_t value_bytes);
  ~VolumeFile();

  /// `values`: a row of the file's type in the layout's order, little endian. A row is given once.
  void write_row(std::size_t row, std::span<const std::byte> values);

  void commit();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace eventgan
