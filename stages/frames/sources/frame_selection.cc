#include "stages/frames/sources/frame_selection.h"

#include <algorithm>
#include <set>
#include <string>
#include <string_view>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/sources/open_dataset.h"

namespace eventgan {
namespace {

/// A line each; blank ones, white space around, and a byte order mark are passed over.
std::set<std::string> read_ids(const SourceRoot& base, const std::string& path) {
  const std::string text = base.read_or_throw(path);
  std::set<std::string> ids;
  for (const TextLine& line : split_lines(text)) {
    const std::string_view id = trimmed(line.bytes);
    if (!id.empty()) ids.emplace(id);
  }
  return ids;
}

/// A list of images in place of ids: the sample of "data/obj/a0.jpg" is "data/obj/a0", "obj/a0" or
/// "a0", the first that there is; as Windows writes it, too. Takes images without one off the list,
/// and counts them.
std::size_t name_samples(const std::vector<LabelledFrame>& frames, std::set<std::string>& ids) {
  std::set<std::string> known, named;
  for (const LabelledFrame& frame : frames) known.insert(frame.sample_id);
  std::size_t without = 0;
  for (const std::string& line : ids) {
    std::string path = line;
    std::ranges::replace(path, '\\', '/');
    const std::filesystem::path image = std::filesystem::path(path).lexically_normal();
    if (known.contains(line) ||
        std::ranges::find(kImageExtensions, in_small_letters(image.extension().string())) ==
            kImageExtensions.end()) {
      named.insert(line);
      continue;
    }
    std::string id = (image.parent_path() / image.stem()).generic_string();
    while (!known.contains(id) && id.find('/') != id.npos) id.erase(0, id.find('/') + 1);
    if (known.contains(id)) {
      named.insert(id);
    } else {
      ++without;
    }
  }
  ids = std::move(named);
  return without;
}

/// Keeps the frames whose word is among `named`, which must all occur, or all others.
template <class WordOf>
void keep(std::vector<LabelledFrame>& frames, const std::set<std::string>& named, WordOf word_of,
          const std::string& what, const std::string& where, bool others = false) {
  std::set<std::string> missing = named;
  std::erase_if(frames, [&](const LabelledFrame& frame) {
    const std::string word = word_of(frame);
    missing.erase(word);
    return named.contains(word) == others;
  });
  if (missing.empty()) return;
  throw InputError("expected " + what + " of the source, got " + std::to_string(missing.size()) +
                   " that it does not have (" + some_of({missing.begin(), missing.end()}, 5) +
                   "), in " + where);
}

/// What `fraction` keeps together: a sequence; of Human3.6M all cameras' of one take, which show
/// the same poses.
std::string group_of(DatasetKind dataset, const LabelledFrame& frame) {
  if (frame.sequence.empty()) return frame.sample_id;
  const FrameOrigin origin = frame_origin(dataset, frame.sequence);
  return origin.action.empty() ? frame.sequence : origin.subject + "/" + origin.action;
}

}  // namespace

FrameSelection select_frames(const std::vector<LabelledFrame>& frames, const SourceSpec& spec,
                             const std::filesystem::path& base, std::uint64_t seed) {
  const SelectionSpec& selection = spec.selection;
  FrameSelection result{frames, {}};
  std::vector<LabelledFrame>& selected = result.frames;
  if (selection.ids) {
    std::set<std::string> ids = read_ids(SourceRoot("", base), *selection.ids);
    if (const std::size_t without = name_samples(selected, ids); without > 0) {
      result.notes.push_back(count_text(static_cast<std::int64_t>(without), "image",
                                        " of " + *selection.ids + " not here, or without a label"));
    }
    keep(
        selected, ids, [](const LabelledFrame& frame) { return frame.sample_id; }, "sample ids",
        *selection.ids);
  }
  const auto keep_origin = [&](const std::vector<std::string>& words,
                               std::string FrameOrigin::*part, const char* what,
                               bool others = false) {
    if (words.empty()) return;
    keep(
        selected, {words.begin(), words.end()},
        [&](const LabelledFrame& frame) {
          return frame_origin(spec.dataset, frame.sequence).*part;
        },
        what, spec.root, others);
  };
  keep_origin(selection.subjects, &FrameOrigin::subject, "subjects");
  keep_origin(selection.cameras, &FrameOrigin::camera, "cameras");
  keep_origin(selection.without_actions, &FrameOrigin::action, "actions", /*others=*/true);
  keep_origin(selection.actions, &FrameOrigin::action, "actions");

  const CounterRandom random = CounterRandom(seed).keyed("fraction");
  const auto [first, last] = selection.fraction;
  const auto alone = std::ranges::count_if(
      selected, [](const LabelledFrame& frame) { return frame.sequence.empty(); });
  if (alone > 0 && (first > 0 || last < 1)) {
    result.notes.push_back(count_text(alone, "labelled frame",
                                      " without a sequence, each drawn by itself (fraction)"));
  }
  std::set<std::string> groups;
  std::erase_if(selected, [&, first = first, last = last](const LabelledFrame& frame) {
    const std::string group = group_of(spec.dataset, frame);
    if (groups.size() < 2) groups.insert(group);
    const double place = random.keyed(group).uniform(0);
    return place < first || place >= last;
  });
  if (groups.size() == 1 && (first > 0 || last < 1)) {
    result.notes.push_back("one sequence, " + *groups.begin() +
                           ", which fraction takes whole or not at all");
  }
  if (selected.empty() && !frames.empty()) {
    throw InputError(
        "expected labelled frames that ids, subjects, cameras, actions and fraction "
        "leave, got none of " +
        std::to_string(frames.size()) + ", in " + spec.root +
        (result.notes.empty() ? "" : " (" + result.notes.back() + ")"));
  }
  return result;
}

}  // namespace eventgan
