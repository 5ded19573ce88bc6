#pragma once

#include <matio.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/// MATLAB values for tests. Each function makes a new value; the one it is put into, or write_mat,
/// owns it.
namespace eventgan::testing::mat {

template <class T>
matvar_t* array(matio_classes kind, matio_types type, std::vector<T> values, std::size_t rows,
                std::size_t columns, int flags = 0) {
  std::size_t dims[] = {rows, columns};
  return Mat_VarCreate(nullptr, kind, type, 2, dims, values.data(), flags);
}

inline matvar_t* number(double value) {
  return array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, {value}, 1, 1);
}

inline matvar_t* byte(std::uint8_t value, int flags = 0) {
  return array<std::uint8_t>(MAT_C_UINT8, MAT_T_UINT8, {value}, 1, 1, flags);
}

/// 0x0 double, with which MATLAB fills what is not given.
inline matvar_t* empty() { return array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, {}, 0, 0); }

inline matvar_t* text(const std::string& value) {
  return array<char>(MAT_C_CHAR, MAT_T_UTF8, {value.begin(), value.end()}, value.empty() ? 0 : 1,
                     value.size());
}

inline matvar_t* cells(const std::vector<matvar_t*>& values) {
  std::size_t dims[] = {values.size(), 1};
  matvar_t* cell = Mat_VarCreate(nullptr, MAT_C_CELL, MAT_T_CELL, 2, dims, nullptr, 0);
  for (std::size_t i = 0; i < values.size(); ++i) {
    Mat_VarSetCell(cell, static_cast<int>(i), values[i]);
  }
  return cell;
}

using Fields = std::vector<std::pair<std::string, matvar_t*>>;

/// A 1xN struct array; its fields are those of the first element, which all must have.
inline matvar_t* structs(const std::vector<Fields>& elements) {
  std::vector<const char*> names;
  for (const auto& [name, value] : elements.at(0)) names.push_back(name.c_str());
  std::size_t dims[] = {1, elements.size()};
  matvar_t* made =
      Mat_VarCreateStruct(nullptr, 2, dims, names.data(), static_cast<unsigned>(names.size()));
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].size() != names.size()) throw std::logic_error("elements differ in fields");
    for (const auto& [name, value] : elements[i]) {
      Mat_VarSetStructFieldByName(made, name.c_str(), i, value);
    }
  }
  return made;
}

inline matvar_t* structure(const Fields& fields) { return structs({fields}); }

/// Writes `value` as variable `name` and frees it.
inline void write_mat(const std::filesystem::path& file, const std::string& name, matvar_t* value,
                      matio_compression compression = MAT_COMPRESSION_ZLIB) {
  std::filesystem::create_directories(file.parent_path());
  mat_t* mat = Mat_CreateVer(file.c_str(), nullptr, MAT_FT_MAT5);
  if (mat == nullptr) throw std::runtime_error("cannot write " + file.string());
  value->name = strdup(name.c_str());
  const int error = Mat_VarWrite(mat, value, compression);
  Mat_VarFree(value);
  Mat_Close(mat);
  if (error != 0) throw std::runtime_error("cannot write " + name);
}

}  // namespace eventgan::testing::mat
