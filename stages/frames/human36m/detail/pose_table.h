#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/labels.h"
#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// An annotation file in memory: one person a row.
class PoseTable {
 public:
  virtual ~PoseTable() = default;

  virtual std::size_t row_count() const = 0;
  virtual std::size_t joint_count() const = 0;

  /// A fault names the file, the field and the row. Thread safe.
  virtual Outcome<Annotation> annotation(std::size_t row) const = 0;

  /// What was left out of the file; one line each.
  virtual std::vector<std::string> notes() const = 0;
};

/// The arrays of an annotation file, some of which are columns: row i belongs to person i. Messages
/// name the file as given.
class TableColumns {
 public:
  TableColumns(std::map<std::string, TypedArray> arrays, std::string file)
      : arrays_(std::move(arrays)), file_(std::move(file)) {}

  const std::string& file() const { return file_; }
  const std::map<std::string, TypedArray>& arrays() const { return arrays_; }

  /// An array that must be there with this shape (none: any size at least 1); numbers unless
  /// `text`. Throws InputError naming file and array.
  const TypedArray& need(const std::string& name,
                         const std::vector<std::optional<std::size_t>>& shape,
                         bool text = false) const;

  /// Element `row` of a column of whole numbers in [0, 10^9); throws InputError otherwise.
  std::int64_t whole_number(const std::string& name, std::size_t row) const;

  /// Row `row` of an array [rows, ...] as numbers.
  std::vector<double> row_of(const std::string& name, std::size_t row) const;

  /// A fault if one of `values`, which are in row `row` of an array, is not finite.
  std::optional<SampleFault> not_finite(const std::vector<double>& values, const std::string& name,
                                        std::size_t row) const;

  /// Row `row` of every array with `row_count` rows, by name. Numbers keep their value exactly; NaN
  /// and infinity become null. Arrays whose name starts with `but_prefix` are left out, if it is
  /// not empty.
  nlohmann::ordered_json fields(std::size_t row, std::size_t row_count,
                                const std::string& but_prefix = "") const;

 private:
  std::map<std::string, TypedArray> arrays_;
  std::string file_;
};

}  // namespace eventgan
