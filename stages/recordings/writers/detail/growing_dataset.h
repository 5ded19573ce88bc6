#pragma once

#include <span>
#include <string>
#include <vector>

#include "stages/base/hdf5/hdf5.h"

namespace eventgan {

/// A middling level: higher ones gain little on events and cost several times as much.
inline constexpr int kRecordingDeflateLevel = 4;
inline constexpr hsize_t kEventsPerChunk = 32768;

/// A new dataset whose number of rows grows: [rows, inner...] of `Number`, chunked and filtered,
/// without time stamps. Rows are kept until `rows_per_write` have come, so that every chunk is
/// compressed once and the bytes do not depend on how the rows were portioned. Throws Hdf5Error.
template <class Number>
class GrowingDataset {
 public:
  /// `chunk` has the rank of the dataset; its rows divide `rows_per_write`.
  GrowingDataset(hid_t file, const std::string& path, const Dims& inner, const Dims& chunk,
                 std::size_t rows_per_write);

  /// Whole rows, in C order.
  void append(std::span<const Number> values);

  /// Writes what is left and closes.
  void close();

 private:
  void write_pending();

  std::string path_;
  Dims dims_;
  std::size_t values_per_write_;
  Hdf5Handle dataset_;
  std::vector<Number> pending_;
};

}  // namespace eventgan
