#include "manifests/values/outline_counts.h"

#include "manifests/values/text.h"

namespace eventgan {

OutlineCounts& OutlineCounts::operator+=(const OutlineCounts& other) {
  given += other.given;
  cut += other.cut;
  ellipses += other.ellipses;
  return *this;
}

std::string to_text(const OutlineCounts& counts) {
  return std::to_string(counts.given) + " of labels, " + std::to_string(counts.cut) +
         " cut out of their boxes, " + count_text(counts.ellipses, "ellipse");
}

}  // namespace eventgan
