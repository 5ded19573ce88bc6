#pragma once

#include <matio.h>

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

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

}  // namespace eventgan
