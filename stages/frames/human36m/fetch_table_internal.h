#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stages/frames/human36m/pose_table_internal.h"
#include "stages/frames/human36m/table_columns_internal.h"

namespace eventgan {

/// An annot.h5 of h36m-fetch in memory; see human36m_dataset.h for its datasets.
class FetchTable final : public PoseTable {
 public:
  /// `shown` names the file in messages. Throws InputError. Uses HDF5, here only.
  FetchTable(const std::filesystem::path& file, const std::string& shown);

  std::size_t row_count() const override { return row_count_; }
  std::size_t joint_count() const override { return joint_count_; }
  Outcome<Annotation> annotation(std::size_t row) const override;
  std::vector<std::string> notes() const override { return notes_; }

  /// The camera's serial number and the frame's number in its video.
  std::int64_t camera(std::size_t row) const { return columns_.whole_number("camera", row); }
  std::int64_t frame(std::size_t row) const { return columns_.whole_number("frame", row); }

 private:
  std::optional<Intrinsics> intrinsics(std::size_t row) const;
  Person person(std::size_t row) const;

  std::vector<std::string> notes_;
  TableColumns columns_;
  // Joints in 3-D and the group of cameras that goes with them.
  std::string pose_3d_;
  std::string cameras_;
  std::size_t row_count_ = 0;
  std::size_t joint_count_ = 0;
};

}  // namespace eventgan
