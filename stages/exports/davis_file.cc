#include "stages/exports/davis_file.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/base/hdf5/detail/hdf5_output_file.h"

namespace eventgan {
namespace {

constexpr char kEvents[] = "/davis/events";
constexpr int kDeflateLevel = 1;

}  // namespace

struct DavisFile::File {
  Hdf5OutputFile hdf5;
  Dims row;  ///< [1, H, W, 2 bins]
  Hdf5Handle type;
  Hdf5Handle events;
  std::vector<std::uint8_t> valid;

  File(const std::filesystem::path& target, std::size_t rows, const VolumeShape& shape)
      : hdf5(target),
        row{1, static_cast<hsize_t>(shape.size.height), static_cast<hsize_t>(shape.size.width),
            static_cast<hsize_t>(shape.channels())},
        valid(rows) {}

  void create(std::size_t value_bytes) {
    create_group(hdf5.id(), "davis").close("davis");
    const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
    set_chunks(creation, row, kEvents);
    set_filters(creation, kDeflateLevel, kEvents);
    Dims dims = row;
    dims[0] = valid.size();
    type = number_type(value_bytes, /*is_float=*/true, /*is_signed=*/true);
    // No chunk is made before it is written, and what is not there reads as zeros.
    events = create_dataset(hdf5.id(), kEvents, type, space_of(dims, kEvents), creation);
  }
};

DavisFile::DavisFile(const std::filesystem::path& file, std::size_t rows, const VolumeShape& shape,
                     std::size_t value_bytes)
    : file_(std::make_unique<File>(file, rows, shape)) {
  file_->hdf5.write([&] { file_->create(value_bytes); });
}

DavisFile::~DavisFile() = default;

void DavisFile::write_row(std::size_t row, std::span<const std::byte> values) {
  if (std::exchange(file_->valid.at(row), std::uint8_t{1}) != 0) {
    throw std::logic_error("expected each row once, got row " + std::to_string(row) +
                           " again, in " + file_->hdf5.target().string());
  }
  file_->hdf5.write([&] {
    write_block(file_->events, kEvents, {row, 0, 0, 0}, file_->row, file_->type, values.data());
  });
}

void DavisFile::commit() {
  file_->hdf5.write([&] {
    file_->events.close(kEvents);
    write_dataset(file_->hdf5.id(), "/davis/valid", file_->valid, {file_->valid.size()},
                  kDeflateLevel);
    file_->hdf5.close();
  });
  file_->hdf5.output().publish();
}

}  // namespace eventgan
