#include <string.h>

#include <array>
#include <new>
#include <stdexcept>

#include "stages/scenes/layouts/mat_values_internal.h"

namespace eventgan {
namespace {

MatValue create(matio_classes kind, matio_types stored, std::size_t rows, std::size_t columns,
                const void* data) {
  std::array<std::size_t, 2> sizes{rows, columns};
  // matio copies the data: its parameter is not const, and not written to.
  MatValue value(Mat_VarCreate(nullptr, kind, stored, 2, sizes.data(), const_cast<void*>(data), 0));
  if (value == nullptr) throw std::bad_alloc();
  return value;
}

struct MatFileCloser {
  void operator()(mat_t* file) const { Mat_Close(file); }
};

}  // namespace

MatValue mat_number(double value) { return create(MAT_C_DOUBLE, MAT_T_DOUBLE, 1, 1, &value); }

MatValue mat_byte(std::uint8_t value) { return create(MAT_C_UINT8, MAT_T_UINT8, 1, 1, &value); }

MatValue mat_text(const std::string& text) {
  return create(MAT_C_CHAR, MAT_T_UINT8, 1, text.size(), text.data());
}

MatValue mat_empty() { return create(MAT_C_DOUBLE, MAT_T_DOUBLE, 0, 0, nullptr); }

MatValue mat_row(const std::vector<double>& values) {
  return create(MAT_C_DOUBLE, MAT_T_DOUBLE, 1, values.size(), values.data());
}

MatValue mat_cells(std::vector<MatValue> column) {
  MatValue cells = create(MAT_C_CELL, MAT_T_CELL, column.size(), 1, nullptr);
  for (std::size_t i = 0; i < column.size(); ++i) {
    Mat_VarSetCell(cells.get(), static_cast<int>(i), column[i].release());
  }
  return cells;
}

MatValue mat_struct(std::size_t count, const std::vector<const char*>& fields, bool column) {
  std::array<std::size_t, 2> sizes{column ? count : 1, column ? 1 : count};
  std::vector<const char*> names = fields;
  MatValue structure(Mat_VarCreateStruct(nullptr, 2, sizes.data(), names.data(),
                                         static_cast<unsigned>(names.size())));
  if (structure == nullptr) throw std::bad_alloc();
  for (std::size_t i = 0; i < count; ++i) {
    for (const char* field : fields) set_field(structure, i, field, mat_empty());
  }
  return structure;
}

void set_field(MatValue& structure, std::size_t index, const char* field, MatValue value) {
  MatValue before(Mat_VarSetStructFieldByName(structure.get(), field, index, value.release()));
}

void write_mat_file(const std::filesystem::path& path, const std::string& name, MatValue value) {
  const std::unique_ptr<mat_t, MatFileCloser> file(
      Mat_CreateVer(path.c_str(), "MATLAB 5.0 MAT-file, eventgan demo dataset", MAT_FT_MAT5));
  if (file == nullptr) throw std::runtime_error("cannot write " + path.string());
  value->name = strdup(name.c_str());  // matio frees it with the value
  if (Mat_VarWrite(file.get(), value.get(), MAT_COMPRESSION_NONE) != 0) {
    throw std::runtime_error("cannot write " + path.string());
  }
}

}  // namespace eventgan
