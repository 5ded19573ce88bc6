#pragma once

#include <matio.h>

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "stages/synthetic/scenes/figure_scene.h"

namespace eventgan {

struct MatValueDeleter {
  void operator()(matvar_t* value) const { Mat_VarFree(value); }
};
/// A MATLAB value; one that is put into another belongs to it.
using MatValue = std::unique_ptr<matvar_t, MatValueDeleter>;

MatValue mat_number(double value);
MatValue mat_byte(std::uint8_t value);
MatValue mat_text(const std::string& text);
MatValue mat_empty();
MatValue mat_row(const std::vector<double>& values);
MatValue mat_cells(std::vector<MatValue> column);

/// A struct array of `count` elements in a row, or in a column, with every field empty.
MatValue mat_struct(std::size_t count, const std::vector<const char*>& fields, bool column = false);

void set_field(MatValue& structure, std::size_t index, const char* field, MatValue value);

/// Writes one variable, compressed, as MATLAB's version 5 files hold it, without the date that
/// would make each file different. Throws std::runtime_error naming the path.
void write_mat_file(const std::filesystem::path& path, const std::string& name, MatValue value);

/// One image of the annotation list.
struct DemoMpiiEntry {
  std::string name;  ///< "000000001": of the image, and of the folder with its sequence
  int video = 0;     ///< counted from 1
  bool train = true;
  std::vector<FigureLabel> people;
};

/// The variable RELEASE of mpii_human_pose_v1_u12_1.mat.
MatValue mpii_release(const std::vector<DemoMpiiEntry>& entries);

/// The variable annolist_keyframes of mpii_human_pose_v1_sequences_keyframes.mat; `key_frame` is
/// the number of the annotated frame in every sequence.
MatValue mpii_keyframes(const std::vector<DemoMpiiEntry>& entries, int key_frame);

}  // namespace eventgan
