#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

using ClassNames = std::vector<std::string>;

/// Leaves out boxes of other classes than SourceSpec::classes, counted as
/// Annotation::of_other_classes; the others stay part of the background (in a clip of one
/// photograph they move on their own, too), and KITTI's DontCare stays. Throws InputError for a
/// class that the source does not have.
///
/// Gives all sources of one kind of dataset one list of classes, so that a class has one number in
/// all their shards, be they of train or of val: the names of the first source in its own order
/// (that of `classes`), then those that the next one has beside them, and so on. Sources without
/// classes keep none.
///
/// `stored`: of each source, the names that its shards have already; none: it has no shard yet.
/// What is stored keeps its numbers: stored names come first, and stay although no label has them
/// any more; new ones follow. A second call replaces what the first has given.
///
/// `sources` and `datasets` are one each, a null one is passed over. That the labels' own numbers
/// mean what they did when shards were made is looked at elsewhere (Dataset::label_meanings).
void number_classes(const std::vector<SourceSpec>& sources,
                    std::vector<std::unique_ptr<Dataset>>& datasets,
                    const std::vector<std::optional<ClassNames>>& stored = {});

}  // namespace eventgan
