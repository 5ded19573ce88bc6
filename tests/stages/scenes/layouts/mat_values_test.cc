#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <utility>

#include "stages/scenes/layouts/mat_values_internal.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using testing::read_file;
using testing::TemporaryFolder;

MatValue example() {
  MatValue inner = mat_struct(2, {"number", "text"});
  set_field(inner, 0, "number", mat_number(2.5));
  set_field(inner, 1, "text", mat_text("word"));
  MatValue outer = mat_struct(1, {"inner", "cells", "row"});
  set_field(outer, 0, "inner", std::move(inner));
  std::vector<MatValue> cells;
  cells.push_back(mat_byte(7));
  cells.push_back(mat_empty());
  set_field(outer, 0, "cells", mat_cells(std::move(cells)));
  set_field(outer, 0, "row", mat_row({1, 2, 3}));
  return outer;
}

TEST(MatValues, ReadBack) {
  const TemporaryFolder folder;
  write_mat_file(folder / "m.mat", "OUTER", example());
  mat_t* file = Mat_Open((folder / "m.mat").c_str(), MAT_ACC_RDONLY);
  ASSERT_NE(file, nullptr);
  const MatValue read(Mat_VarRead(file, "OUTER"));
  Mat_Close(file);
  ASSERT_NE(read, nullptr);

  matvar_t* inner = Mat_VarGetStructFieldByName(read.get(), "inner", 0);
  EXPECT_EQ(inner->dims[1], 2u);
  const matvar_t* number = Mat_VarGetStructFieldByName(inner, "number", 0);
  EXPECT_EQ(*static_cast<const double*>(number->data), 2.5);
  const matvar_t* text = Mat_VarGetStructFieldByName(inner, "text", 1);
  EXPECT_EQ(text->class_type, MAT_C_CHAR);
  EXPECT_EQ(std::string(static_cast<const char*>(text->data), text->nbytes), "word");
  const matvar_t* unset = Mat_VarGetStructFieldByName(inner, "number", 1);
  EXPECT_EQ(unset->nbytes, 0u) << "fields not set are empty";

  matvar_t* cells = Mat_VarGetStructFieldByName(read.get(), "cells", 0);
  EXPECT_EQ(cells->dims[0], 2u);
  EXPECT_EQ(*static_cast<const std::uint8_t*>(Mat_VarGetCell(cells, 0)->data), 7);
  const matvar_t* row = Mat_VarGetStructFieldByName(read.get(), "row", 0);
  EXPECT_EQ(row->dims[1], 3u);
  EXPECT_EQ(static_cast<const double*>(row->data)[2], 3);
}

TEST(MatValues, TheFileBearsNoDate) {
  const TemporaryFolder folder;
  write_mat_file(folder / "a.mat", "OUTER", example());
  write_mat_file(folder / "b.mat", "OUTER", example());
  const std::string bytes = read_file(folder / "a.mat");
  EXPECT_EQ(bytes, read_file(folder / "b.mat"));
  EXPECT_EQ(bytes.substr(0, 116).find("Created on"), std::string::npos);
}

TEST(MatValues, FailuresNameThePath) {
  const TemporaryFolder folder;
  EXPECT_THAT([&] { write_mat_file(folder / "none/m.mat", "X", mat_number(1)); },
              ::testing::ThrowsMessage<std::runtime_error>(
                  ::testing::HasSubstr((folder / "none/m.mat").string())));
}

}  // namespace
}  // namespace eventgan
