#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>

#include "stages/recordings/growing_dataset_internal.h"

namespace eventgan {
namespace {

std::size_t values_per_row(const Dims& dims) {
  return std::accumulate(dims.begin() + 1, dims.end(), std::size_t{1}, std::multiplies<>());
}

Dims with_rows(hsize_t rows, const Dims& inner) {
  Dims dims{rows};
  dims.insert(dims.end(), inner.begin(), inner.end());
  return dims;
}

Hdf5Handle create(hid_t file, const std::string& path, hid_t type, const Dims& dims,
                  const Dims& chunk) {
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  const int rank = static_cast<int>(chunk.size());
  checked(H5Pset_chunk(creation, rank, chunk.data()), "chunk", path);
  set_filters(creation, kRecordingDeflateLevel, path);
  Dims limit = dims;
  limit[0] = H5S_UNLIMITED;
  const Hdf5Handle space(H5Screate_simple(rank, dims.data(), limit.data()), H5Sclose, "create",
                         path);
  return {H5Dcreate2(file, path.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose,
          "create", path};
}

}  // namespace

template <class Number>
GrowingDataset<Number>::GrowingDataset(hid_t file, const std::string& path, const Dims& inner,
                                       const Dims& chunk, std::size_t rows_per_write)
    : path_(path),
      dims_(with_rows(0, inner)),
      values_per_write_(rows_per_write * values_per_row(dims_)),
      dataset_(create(file, path, element_type<Number>(), dims_, chunk)) {}

template <class Number>
void GrowingDataset<Number>::append(std::span<const Number> values) {
  while (!values.empty()) {
    const std::size_t taken = std::min(values.size(), values_per_write_ - pending_.size());
    pending_.insert(pending_.end(), values.begin(),
                    values.begin() + static_cast<std::ptrdiff_t>(taken));
    values = values.subspan(taken);
    if (pending_.size() == values_per_write_) write_pending();
  }
}

template <class Number>
void GrowingDataset<Number>::write_pending() {
  Dims start(dims_.size(), 0);
  Dims count = dims_;
  start[0] = dims_[0];
  count[0] = pending_.size() / values_per_row(dims_);
  dims_[0] += count[0];
  checked(H5Dset_extent(dataset_, dims_.data()), "extend", path_);
  const Hdf5Handle to(H5Dget_space(dataset_), H5Sclose, "write", path_);
  checked(H5Sselect_hyperslab(to, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
          "select in", path_);
  const Hdf5Handle from(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr),
                        H5Sclose, "write", path_);
  checked(H5Dwrite(dataset_, element_type<Number>(), from, to, H5P_DEFAULT, pending_.data()),
          "write", path_);
  pending_.clear();
}

template <class Number>
void GrowingDataset<Number>::close() {
  if (!pending_.empty()) write_pending();
  dataset_.close(path_);
}

template class GrowingDataset<std::uint8_t>;
template class GrowingDataset<float>;
template class GrowingDataset<double>;

}  // namespace eventgan
