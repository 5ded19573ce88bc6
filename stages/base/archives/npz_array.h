#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "stages/base/archives/numpy_layout.h"
#include "stages/base/archives/typed_array.h"
#include "stages/base/archives/zip_archive.h"

namespace eventgan {

/// An array of an .npz file that may be larger than memory, as MVSEC's optical flow [N, H, W] is:
/// its entries along the first axis are read one at a time. Versions and dtypes as parse_npy, with
/// a header of at most 64 KiB; at least one dimension; C order. As in parse_npy, the data must have
/// the size that the header tells.
///
/// Throws std::runtime_error "expected X, got Y, in FILE (member NAME.npy)"; LimitReached as
/// InputFile does. Thread safe: one thread reads at a time.
class NpzArray {
 public:
  /// Opens the array `name`, the member NAME.npy, and reads its header alone.
  NpzArray(const std::filesystem::path& file, const std::string& name);

  const std::vector<std::size_t>& shape() const { return layout_.shape; }

  /// Entry `index` along the first axis: of [N, H, W] an array [H, W], of [N] a single value. Holds
  /// its bytes twice while it reads. What np.savez wrote is read from there on; np.savez_compressed
  /// takes time in proportion to `index`, since all before it is inflated, too. The checksum is not
  /// compared, see ZipArchive::read_part. Throws std::out_of_range beyond the end.
  TypedArray slice(std::size_t index) const;

 private:
  std::string member_;
  std::string name_;          // for messages
  mutable std::mutex mutex_;  // of archive_
  ZipArchive archive_;
  NumpyLayout layout_;
  std::size_t data_begin_ = 0;
  std::uint64_t slice_bytes_ = 0;
};

}  // namespace eventgan
