#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stages/frames/human36m/camera_book_internal.h"
#include "stages/frames/human36m/extracted_name_internal.h"
#include "stages/frames/human36m/pose_table_internal.h"
#include "stages/frames/human36m/table_columns_internal.h"

namespace eventgan {

/// An .npz list of labelled pictures in memory; see human36m_dataset.h for its arrays.
class NpzTable final : public PoseTable {
 public:
  /// `shown` names the file in messages. Throws InputError.
  NpzTable(const std::filesystem::path& file, const std::string& shown, CameraBook cameras);

  std::size_t row_count() const override { return names_.size(); }
  std::size_t joint_count() const override { return joint_count_; }
  Outcome<Annotation> annotation(std::size_t row) const override;
  std::vector<std::string> notes() const override { return notes_; }

  /// What `imgname` says.
  const ExtractedName& name(std::size_t row) const { return names_[row]; }

 private:
  const Human36mCamera* camera(std::size_t row) const;
  Person person(std::size_t row) const;

  std::vector<std::string> notes_;
  TableColumns columns_;
  CameraBook cameras_;
  std::vector<ExtractedName> names_;
  std::size_t joint_count_ = 0;
};

/// Why a file is no .npz of 17 joints that NpzTable can read: "expected X, got Y". Empty if it is
/// one, as far as can be told from its arrays' names and shapes.
std::string why_no_human36m_npz(const std::filesystem::path& file);

}  // namespace eventgan
