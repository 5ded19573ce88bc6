#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "manifests/faults.h"
#include "manifests/labels.h"

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

}  // namespace eventgan
