#include "stages/base/archives/npz_array.h"

#include <algorithm>
#include <stdexcept>

namespace eventgan {

NpzArray::NpzArray(const std::filesystem::path& file, const std::string& name)
    : member_(name + ".npy"), name_(file.string() + " (member " + member_ + ")"), archive_(file) {
  constexpr std::uint64_t kMostHeader = 65536;
  const std::uint64_t size_bytes = archive_.size_bytes(member_);
  layout_ = parse_npy_header(archive_.read_part(member_, 0, std::min(size_bytes, kMostHeader)),
                             name_, data_begin_);
  const std::uint64_t data_bytes = size_bytes - data_begin_;
  require_numpy_size(layout_, data_bytes, name_);
  if (layout_.shape.empty()) refuse_numpy("at least one dimension", "a single value", name_);
  if (layout_.fortran_order && layout_.shape.size() > 1) {
    refuse_numpy("an array in C order", "Fortran's order", name_);
  }
  if (layout_.shape[0] > 0) slice_bytes_ = data_bytes / layout_.shape[0];
}

TypedArray NpzArray::slice(std::size_t index) const {
  const std::size_t count = layout_.shape[0];
  if (index >= count) {
    throw std::out_of_range("expected an index below " + std::to_string(count) + ", got " +
                            std::to_string(index) + ", in " + name_);
  }
  NumpyLayout layout{.descr = layout_.descr,
                     .shape = {layout_.shape.begin() + 1, layout_.shape.end()}};
  std::vector<std::byte> bytes;
  {
    const std::lock_guard lock(mutex_);
    bytes = archive_.read_part(member_, data_begin_ + index * slice_bytes_, slice_bytes_);
  }
  return decode_numpy_elements(layout, bytes, name_);
}

}  // namespace eventgan
