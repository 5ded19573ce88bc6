#include "manifests/values/input_counts.h"

#include <cstddef>
#include <functional>
#include <iterator>

#include "manifests/values/text.h"

namespace eventgan {
namespace {

/// `first`: of `count`, all or the first few.
void add_reasons(std::int64_t count, const std::vector<std::string>& first,
                 LabelLosses::Reasons& reasons) {
  constexpr std::size_t kListed = 3;
  reasons.count += count;
  for (const std::string& reason : first) {
    if (reasons.first.size() < kListed) reasons.first.push_back(reason);
  }
}

}  // namespace

LabelLosses losses_of(const Annotation& annotation) {
  LabelLosses losses;
  const auto add = [](const std::vector<std::string>& lost, LabelLosses::Reasons& reasons) {
    add_reasons(std::ssize(lost), lost, reasons);
  };
  add(annotation.left_out, losses.boxes);
  add(annotation.outlines_mended, losses.outlines);
  add(annotation.tracks_left_out, losses.tracks);
  losses.of_other_classes += static_cast<std::int64_t>(annotation.of_other_classes);
  return losses;
}

InputCounts& InputCounts::operator+=(const InputCounts& other) {
  const LabelLosses& more = other.losses;
  add_reasons(more.boxes.count, more.boxes.first, losses.boxes);
  add_reasons(more.outlines.count, more.outlines.first, losses.outlines);
  add_reasons(more.tracks.count, more.tracks.first, losses.tracks);
  losses.of_other_classes += more.of_other_classes;
  same_images += other.same_images;
  empty_volumes += other.empty_volumes;
  outlines += other.outlines;
  return *this;
}

std::vector<std::string> InputCounts::notes() const {
  std::vector<std::string> notes;
  const auto tell = [&](const LabelLosses::Reasons& reasons, const char* what, const char* lost) {
    if (reasons.count == 0) return;
    const char* const more = reasons.count > std::ssize(reasons.first) ? "; ..." : "";
    notes.push_back(count_text(reasons.count, what, lost) +
                    joined(reasons.first, "; ", std::identity()) + more);
  };
  tell(losses.boxes, "box", " of labels left out: ");
  if (losses.of_other_classes > 0) {
    notes.push_back(
        count_text(losses.of_other_classes, "box", " of other classes left out (\"classes\")"));
  }
  tell(losses.outlines, "outline",
       losses.outlines.count == 1 ? " of labels taken without some of its parts: "
                                  : " of labels taken without some of their parts: ");
  tell(losses.tracks, "track", " of labels left out: ");
  if (same_images > 0) {
    notes.push_back(
        count_text(same_images, "pair", " of the same image twice: nothing moves there"));
  }
  if (empty_volumes > 0) {
    notes.push_back(count_text(empty_volumes, "volume", " without any event"));
  }
  if (outlines != OutlineCounts()) {
    notes.push_back("outlines of objects that move on their own: " + to_text(outlines));
  }
  return notes;
}

}  // namespace eventgan
