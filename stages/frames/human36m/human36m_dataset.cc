#include "stages/frames/human36m/human36m_dataset.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/frames/human36m/detail/human36m_dataset.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

std::vector<std::string> human36m_joint_names(std::size_t count) {
  if (count == 32) {
    return {"Hips",
            "RightUpLeg",
            "RightLeg",
            "RightFoot",
            "RightToeBase",
            "RightToeBase_Site",
            "LeftUpLeg",
            "LeftLeg",
            "LeftFoot",
            "LeftToeBase",
            "LeftToeBase_Site",
            "Spine",
            "Spine1",
            "Neck",
            "Head",
            "Head_Site",
            "LeftShoulder",
            "LeftArm",
            "LeftForeArm",
            "LeftHand",
            "LeftHandThumb",
            "LeftHandThumb_Site",
            "L_Wrist_End",
            "L_Wrist_End_Site",
            "RightShoulder",
            "RightArm",
            "RightForeArm",
            "RightHand",
            "RightHandThumb",
            "RightHandThumb_Site",
            "R_Wrist_End",
            "R_Wrist_End_Site"};
  }
  if (count == 17) {
    // Lists such as h36m_coco.json have the legs the other way round, which is an old mistake.
    return {"root (pelvis)", "right_hip",     "right_knee", "right_foot", "left_hip",
            "left_knee",     "left_foot",     "spine",      "thorax",     "neck_base",
            "head",          "left_shoulder", "left_elbow", "left_wrist", "right_shoulder",
            "right_elbow",   "right_wrist"};
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back("joint_" + std::to_string(i));
  return names;
}

std::vector<std::string> human36m_joint_aliases(std::size_t count) {
  if (count != 32) return {};
  constexpr std::size_t kPlaces[] = {0, 1, 2, 3, 6, 7, 8, 12, 13, 14, 15, 17, 18, 19, 25, 26, 27};
  std::vector<std::string> aliases(count);
  const std::vector<std::string> names = human36m_joint_names(std::size(kPlaces));
  for (std::size_t i = 0; i < names.size(); ++i) aliases[kPlaces[i]] = names[i];
  return aliases;
}

double human36m_time_s(std::int64_t number) {
  return static_cast<double>(number - 1) / kHuman36mFramesPerSecond;
}

FrameFolder::FrameFolder(std::string folder, std::string prefix, NumberedSequence stored,
                         const std::vector<std::int64_t>& labelled)
    : folder_(std::move(folder)),
      prefix_(std::move(prefix)),
      stored_(std::move(stored)),
      numbers_(labelled) {
  for (const auto& [number, name] : stored_.frames()) numbers_.push_back(number);
  std::ranges::sort(numbers_);
  numbers_.erase(std::unique(numbers_.begin(), numbers_.end()), numbers_.end());
}

FrameRef FrameFolder::frame(std::int64_t number) const {
  std::string name = stored_.at(number, 0).name;
  if (name.empty()) name = fmt::format("{}{:06}.jpg", prefix_, number);
  return {.path = folder_ + "/" + name,
          .index = number,
          .video_frame = -1,
          .time_s = human36m_time_s(number)};
}

PairedFrame FrameFolder::paired_frame(std::int64_t number, int steps) const {
  const auto here = std::ranges::lower_bound(numbers_, number);
  const bool is_known = here != numbers_.end() && *here == number;
  if (steps == 0 && !is_known) return {PairedFrame::State::kMissing, frame(number)};
  const std::ptrdiff_t place =
      here - numbers_.begin() + (steps > 0 && !is_known ? steps - 1 : steps);
  if (place < 0 || place >= std::ssize(numbers_)) return {};
  const std::int64_t target = numbers_[static_cast<std::size_t>(place)];
  return {stored_.contains(target) ? PairedFrame::State::kPresent : PairedFrame::State::kMissing,
          frame(target)};
}

void IndexedDataset::add_table(const std::string& key, const std::string& written,
                               std::unique_ptr<PoseTable> table) {
  if (tables_.empty()) {
    schema_.joint_names = human36m_joint_names(table->joint_count());
    schema_.joint_aliases = human36m_joint_aliases(table->joint_count());
  }
  if (table->joint_count() != schema_.joint_names.size()) {
    throw InputError("expected " + std::to_string(schema_.joint_names.size()) +
                     " joints as in the files before, got " + std::to_string(table->joint_count()) +
                     ", in " + written);
  }
  for (std::string& note : table->notes()) notes_.push_back(std::move(note));
  annotation_files_.push_back(written);
  tables_[key] = {written, std::move(table)};
}

void IndexedDataset::add_annotation_file(const std::string& written) {
  annotation_files_.push_back(written);
}

CameraBook IndexedDataset::add_cameras(const SourceRoot& root) {
  constexpr char kFile[] = "cameras.pkl";
  if (!std::ranges::binary_search(root.files_in(""), kFile)) return {};
  add_annotation_file(root.written(kFile));
  return read_camera_book(root.on_disk(kFile));
}

void IndexedDataset::add_take(const std::string& sequence, std::unique_ptr<TakenFrames> frames) {
  takes_.emplace(sequence, std::move(frames));
}

void IndexedDataset::add_labelled(std::string sample_id, const std::string& sequence,
                                  std::int64_t number, const std::string& table_key,
                                  std::size_t row, std::string fault) {
  labelled_.push_back({.sample_id = std::move(sample_id),
                       .sequence = sequence,
                       .frame = takes_.at(sequence)->frame(number),
                       .label_key = table_key + "#" + std::to_string(row),
                       .fault = std::move(fault)});
}

void IndexedDataset::finish(const std::string& root) {
  if (labelled_.empty()) throw InputError("expected labelled frames, got none, in " + root);
  std::ranges::stable_sort(labelled_, {}, &LabelledFrame::sample_id);
  const auto twice = std::ranges::adjacent_find(labelled_, {}, &LabelledFrame::sample_id);
  if (twice != labelled_.end()) {
    throw InputError("expected one label for a frame, got " + twice->label_key + " and " +
                     std::next(twice)->label_key + ", in " + root + " (" + twice->sample_id + ")");
  }
  std::ranges::sort(annotation_files_);
  root_ = root;
}

PairedFrame IndexedDataset::paired_frame(const LabelledFrame& frame, int steps) const {
  const auto take = takes_.find(frame.sequence);
  if (take == takes_.end()) return {};
  return take->second->paired_frame(frame.frame.index, steps);
}

const IndexedDataset::Table* IndexedDataset::table_of(const std::string& label_key) const {
  const std::size_t hash = label_key.rfind('#');
  if (hash == std::string::npos) return nullptr;
  const auto table = tables_.find(label_key.substr(0, hash));
  return table == tables_.end() ? nullptr : &table->second;
}

Outcome<Annotation> IndexedDataset::annotation(const std::string& label_key) const {
  if (const Table* table = table_of(label_key)) {
    std::size_t row = 0;
    const char* end = label_key.data() + label_key.size();
    const auto [stop, error] =
        std::from_chars(label_key.data() + label_key.rfind('#') + 1, end, row);
    if (error == std::errc() && stop == end && row < table->rows->row_count()) {
      return table->rows->annotation(row);
    }
  }
  return SampleFault{"expected a row of an annotation file, got \"" + label_key + "\", in " +
                     root_};
}

std::string IndexedDataset::label_place(const std::string& label_key) const {
  const Table* table = table_of(label_key);
  return table == nullptr ? root_ : table->written + label_key.substr(label_key.rfind('#'));
}

std::unique_ptr<Dataset> open_human36m_dataset(const SourceSpec& spec,
                                               const std::filesystem::path& base) {
  if (!spec.layout) {
    throw UsageError(
        "expected a layout (fetch, extracted or official) for human36m, got none, in the source " +
        spec.root);
  }
  switch (*spec.layout) {
    case Human36mLayout::kFetch:
      return open_human36m_fetch(spec, base);
    case Human36mLayout::kExtracted:
      return open_human36m_extracted(spec, base);
    case Human36mLayout::kOfficial:
      return open_human36m_official(spec, base);
  }
  throw std::logic_error("open_human36m_dataset: not a layout");
}

namespace {

bool is_subject(std::string_view name) {
  return name.size() > 1 && name[0] == 'S' && is_digit(name[1]);
}

/// Whether a folder S1, S5, ... of the root holds a folder that fits.
template <class Fits>
bool any_of_a_subject(const std::filesystem::path& root, Fits fits) {
  return any_folder(root, [&](const std::string& subject) {
    return is_subject(subject) && any_folder(root / subject, [&](const std::string& name) {
             return fits(root / subject / name);
           });
  });
}

bool is_human36m_fetch(const std::filesystem::path& root) {
  return any_of_a_subject(root, [](const std::filesystem::path& action) {
    return has_file(action / "annot.h5") || has_folder(action / "imageSequence");
  });
}

bool is_human36m_extracted(const std::filesystem::path& root) {
  return any_of_a_subject(
      root, [](const std::filesystem::path& sequence) {  // S1_Directions_1.54138969
        const std::string camera = sequence.extension();
        return camera.size() > 1 && std::all_of(camera.begin() + 1, camera.end(), is_digit) &&
               sequence.stem().string().starts_with(sequence.parent_path().filename().string() +
                                                    "_");
      });
}

bool is_human36m_official(const std::filesystem::path& root) {
  return any_of_a_subject(root, [](const std::filesystem::path& folder) {
    return folder.filename() == "MyPoseFeatures";
  });
}

std::vector<FoundSource> complete_official(FoundSource found) {
  found.more_keys =
      "      \"every\": 5,  // of 50 frames a second: a gap of 1 is a tenth of a second\n";
  return {std::move(found)};
}

bool may_be_of_human36m(std::string_view name) {
  return is_subject(name) || name.starts_with("image");
}

constexpr std::array kHuman36mLayouts{DatasetLayout{.word = "fetch",
                                                    .title = "Human3.6M as h36m-fetch unpacks it",
                                                    .fits = is_human36m_fetch,
                                                    .may_be_part = may_be_of_human36m},
                                      DatasetLayout{.word = "official",
                                                    .title = "Human3.6M as downloaded",
                                                    .fits = is_human36m_official,
                                                    .complete = complete_official,
                                                    .may_be_part = may_be_of_human36m},
                                      DatasetLayout{.word = "extracted",
                                                    .title = "Human3.6M as extracted images",
                                                    .fits = is_human36m_extracted,
                                                    .may_be_part = may_be_of_human36m}};

}  // namespace

FrameOrigin human36m_origin(const std::string& sequence) {
  const bool fetched = sequence.find('/') != std::string::npos;
  const std::size_t first = sequence.find(fetched ? '/' : '_');
  const std::size_t last = sequence.rfind(fetched ? '/' : '.');
  if (first == std::string::npos || last == std::string::npos || first >= last) return {};
  return {.subject = sequence.substr(0, first),
          .action = sequence.substr(first + 1, last - first - 1),
          .camera = sequence.substr(last + 1)};
}

constinit const DatasetReader kHuman36mReader{
    .kind = DatasetKind::kHuman36m,
    .open = open_human36m_dataset,
    .origin = human36m_origin,
    .layouts = kHuman36mLayouts,
    .habits = {
        .side = PairSide::kAfter,
        .size_comment =
            "The size of a DAVIS346 camera; letterboxing keeps the images' shape and adds borders.",
        .size = kDavisSize}};

}  // namespace eventgan
