#include "stages/exports/volume_file.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/base/hdf5/hdf5_output_file.h"

namespace eventgan {
namespace {

constexpr int kDeflateLevel = 1;

/// [1, H, W, 2 bins] or [1, 2 bins, H, W].
Dims row_of(VolumeLayout layout, const VolumeShape& shape) {
  const auto height = static_cast<hsize_t>(shape.size.height);
  const auto width = static_cast<hsize_t>(shape.size.width);
  const auto channels = static_cast<hsize_t>(shape.channels());
  if (layout == VolumeLayout::kRvt) return {1, channels, height, width};
  return {1, height, width, channels};
}

}  // namespace

struct VolumeFile::File {
  Hdf5OutputFile hdf5;
  VolumeLayout layout;
  const char* path;
  Dims row;
  Hdf5Handle type;
  Hdf5Handle volumes;
  std::vector<std::uint8_t> valid;

  File(const std::filesystem::path& target, VolumeLayout whose, std::size_t rows,
       const VolumeShape& shape)
      : hdf5(target),
        layout(whose),
        path(whose == VolumeLayout::kRvt ? "/data" : "/davis/events"),
        row(row_of(whose, shape)),
        valid(rows) {}

  void create(std::size_t value_bytes) {
    if (layout == VolumeLayout::kDavis) create_group(hdf5.id(), "davis").close("davis");
    const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
    set_chunks(creation, row, path);
    set_filters(creation, kDeflateLevel, path);
    Dims dims = row;
    dims[0] = valid.size();
    type = number_type(value_bytes, /*is_float=*/value_bytes > 1, /*is_signed=*/value_bytes > 1);
    // No chunk is made before it is written, and what is not there reads as zeros.
    volumes = create_dataset(hdf5.id(), path, type, space_of(dims, path), creation);
  }
};

VolumeFile::VolumeFile(const std::filesystem::path& file, VolumeLayout layout, std::size_t rows,
                       const VolumeShape& shape, std::size_t value_bytes)
    : file_(std::make_unique<File>(file, layout, rows, shape)) {
  file_->hdf5.write([&] { file_->create(value_bytes); });
}

VolumeFile::~VolumeFile() = default;

void VolumeFile::write_row(std::size_t row, std::span<const std::byte> values) {
  if (std::exchange(file_->valid.at(row), std::uint8_t{1}) != 0) {
    throw std::logic_error("expected each row once, got row " + std::to_string(row) +
                           " again, in " + file_->hdf5.target().string());
  }
  file_->hdf5.write([&] {
    write_block(file_->volumes, file_->path, {row, 0, 0, 0}, file_->row, file_->type,
                values.data());
  });
}

void VolumeFile::commit() {
  file_->hdf5.write([&] {
    file_->volumes.close(file_->path);
    if (file_->layout == VolumeLayout::kDavis) {
      write_dataset(file_->hdf5.id(), "/davis/valid", file_->valid, {file_->valid.size()},
                    kDeflateLevel);
    }
    file_->hdf5.close();
  });
  file_->hdf5.output().publish();
}

}  // namespace eventgan
