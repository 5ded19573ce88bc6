#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/human36m/detail/camera_book.h"
#include "stages/frames/human36m/detail/pose_table.h"

namespace eventgan {

/// What the name of an extracted image says:
/// "S1/S1_Directions_1.54138969/S1_Directions_1.54138969_000006.jpg".
struct ExtractedName {
  std::string folder;    ///< "S1/S1_Directions_1.54138969", below the root
  std::string sequence;  ///< "S1_Directions_1.54138969"
  std::string subject;   ///< "S1"
  std::string camera;    ///< "54138969"
  std::int64_t number = 0;
};

/// Takes a path below the root, or a bare file name, for which the folder follows from the name.
/// Throws std::invalid_argument "expected X, got Y".
ExtractedName parse_extracted_name(std::string_view name);

/// An .npz list of labelled images in memory; see human36m_dataset.h for its arrays.
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
