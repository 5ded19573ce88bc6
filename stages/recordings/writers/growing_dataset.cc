#include "stages/recordings/writers/detail/growing_dataset.h"

#include <algorithm>
#include <cstdint>

namespace eventgan {
namespace {

std::size_t values_per_row(const Dims& dims) {
  return element_count({dims.begin() + 1, dims.end()});
}

Dims with_rows(hsize_t rows, const Dims& inner) {
  Dims dims{rows};
  dims.insert(dims.end(), inner.begin(), inner.end());
  return dims;
}

Hdf5Handle create(hid_t file, const std::string& path, hid_t type, const Dims& dims,
                  const Dims& chunk) {
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  set_chunks(creation, chunk, path);
  set_filters(creation, kRecordingDeflateLevel, path);
  Dims limits = dims;
  limits[0] = H5S_UNLIMITED;
  return create_dataset(file, path, type, space_of(dims, path, limits), creation);
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
  write_block(dataset_, path_, start, count, element_type<Number>(), pending_.data());
  pending_.clear();
}

template <class Number>
void GrowingDataset<Number>::close() {
  if (!pending_.empty()) write_pending();
  dataset_.close(path_);
}

template class GrowingDataset<std::uint8_t>;
template class GrowingDataset<std::uint16_t>;
template class GrowingDataset<std::uint32_t>;
template class GrowingDataset<std::uint64_t>;
template class GrowingDataset<std::int64_t>;
template class GrowingDataset<float>;
template class GrowingDataset<double>;

}  // namespace eventgan
