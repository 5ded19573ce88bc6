#include "stages/frames/events/dhp19_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/recently_used.h"
#include "stages/base/archives/mat_file.h"
#include "stages/base/archives/mat_json.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/frames/dataset/full_rank.h"
#include "stages/frames/human36m/derived_frame.h"
#include "stages/frames/human36m/human36m_dataset.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/recordings/readers/dhp19_events.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// As the dataset's authors order them, and XYZPOS calls them.
constexpr std::array kJoints = {"head",  "shoulderR", "shoulderL", "elbowR", "elbowL",
                                "hipR",  "hipL",      "handR",     "handL",  "kneeR",
                                "kneeL", "footR",     "footL"};
constexpr double kPoses_hz = 100;
constexpr std::array kMatrices = {"P4", "P1", "P3", "P2"};  // by the camera's number in the file

using Position = std::array<double, 3>;
using Projection = std::array<double, 12>;

/// [joint][row] in mm; NaN where unknown. All joints have as many rows.
using Poses = std::array<std::vector<Position>, kJoints.size()>;

std::vector<Position> read_positions(const MatArray& array) {
  if (array.dims.size() != 2 || array.dims[1] != 3) {
    throw std::invalid_argument("expected [T, 3] numbers, got another shape");
  }
  const nlohmann::ordered_json rows = mat_to_json(array);
  std::vector<Position> positions(array.dims[0]);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const nlohmann::ordered_json& row = positions.size() == 1 ? rows : rows.at(i);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& number = row.at(axis);
      positions[i][axis] =
          number.is_null() ? std::numeric_limits<double>::quiet_NaN() : number.get<double>();
    }
  }
  return positions;
}

Poses read_poses(const fs::path& file) try {
  const MatVariable variable = read_mat_variable(file, "XYZPOS");
  Poses poses;
  for (std::size_t joint = 0; joint < kJoints.size(); ++joint) {
    const auto field = mat_field(variable.array, kJoints[joint]);
    if (!field)
      throw std::invalid_argument(fmt::format("expected a field {}, got none", kJoints[joint]));
    poses[joint] = read_positions(*field);
    if (poses[joint].size() != poses[0].size()) {
      throw std::invalid_argument(fmt::format("expected {} rows of {}, as of {}, got {}",
                                              poses[0].size(), kJoints[joint], kJoints[0],
                                              poses[joint].size()));
    }
  }
  return poses;
} catch (const std::invalid_argument& error) {
  throw InputError(std::string(error.what()) + ", in " + file.string() + " (XYZPOS)");
} catch (const nlohmann::json::exception&) {
  throw InputError("expected numbers, got others, in " + file.string() + " (XYZPOS)");
}

std::int64_t row_at(double time_s) {
  return static_cast<std::int64_t>(std::floor(time_s * kPoses_hz));
}

/// The mean of the rows first..last, without NaN; NaN if nothing is left.
Position mean(const std::vector<Position>& positions, std::int64_t first, std::int64_t last) {
  Position sum{};
  int count = 0;
  for (std::int64_t row = first; row <= last; ++row) {
    const Position& at = positions[static_cast<std::size_t>(row)];
    if (!std::ranges::all_of(at, [](double x) { return std::isfinite(x); })) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += at[axis];
    ++count;
  }
  for (double& x : sum) x /= count;  // 0/0 is NaN
  return sum;
}

Joint project(const Projection& p, const Position& at) {
  std::array<double, 3> image{};
  for (std::size_t row = 0; row < 3; ++row) {
    image[row] =
        p[4 * row] * at[0] + p[4 * row + 1] * at[1] + p[4 * row + 2] * at[2] + p[4 * row + 3];
  }
  const Point point{image[0] / image[2], kDhp19Size.height - image[1] / image[2]};
  if (!std::isfinite(point.x) || !std::isfinite(point.y)) return {kMissingPoint, 0};
  const bool inside = point.x >= -0.5 && point.x < kDhp19Size.width - 0.5 && point.y >= -0.5 &&
                      point.y < kDhp19Size.height - 0.5;
  return {point, inside ? -1 : 0};
}

Projection read_matrix(const SourceRoot& root, const std::string& name) try {
  const std::string bytes = root.read_or_throw(name);
  const TypedArray array = parse_npy(std::as_bytes(std::span(bytes)), root.written(name));
  if (array.shape != std::vector<std::size_t>{3, 4} || array.is_text()) {
    throw InputError("expected a matrix [3, 4], got " + array.shape_text() + ", in " +
                     root.written(name));
  }
  Projection matrix;
  for (std::size_t i = 0; i < matrix.size(); ++i) matrix[i] = array.number(i);
  if (!has_full_rank(matrix)) {
    throw InputError(fmt::format("expected a projection of full rank, got [{:g}], in {}",
                                 fmt::join(matrix, " "), root.written(name)));
  }
  return matrix;
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

/// The files of a recording.
struct Dhp19Files {
  std::string events;  ///< relative to the root
  std::string poses;
};

/// "S12", "session1", "mov3": the number; none for another name.
std::optional<int> number_after(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) return std::nullopt;
  name.remove_prefix(prefix.size());
  int number = 0;
  const auto [stop, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  const bool is_number = error == std::errc() && stop == name.data() + name.size();
  return is_number && number > 0 ? std::optional(number) : std::nullopt;
}

class Dhp19Dataset final : public Dataset {
 public:
  Dhp19Dataset(const SourceSpec& spec, const fs::path& base)
      : root_(spec.root, base), events_per_window_(spec.window.events.value()) {
    schema_.joint_names.assign(kJoints.begin(), kJoints.end());
    root_.require_folder(kMovies);
    root_.require_folder(kVicon);
    for (std::size_t camera = 0; camera < kMatrices.size(); ++camera) {
      const std::string name = fmt::format("P_matrices/{}.npy", kMatrices[camera]);
      matrices_[camera] = read_matrix(root_, name);
      annotation_files_.push_back(root_.written(name));
    }
    for (const std::string& subject : root_.folders_in(kMovies)) {
      if (is_wanted(subject, spec)) find_recordings(subject);
    }
    for (const auto& [name, recorded] : recordings_) list_windows(name, spec.selection.cameras);
    if (labelled_.empty()) {
      throw InputError(
          "expected recordings DVS_movies/S1/session1/mov1.h5 with poses, got none, "
          "in " +
          root_.written(""));
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::vector<std::string> notes() const override { return notes_; }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    if (steps == 0) return {PairedFrame::State::kPresent, labelled.frame};
    if (steps != 1 && steps != -1) return {};
    FrameRef edge = labelled.frame;
    edge.index *= events_per_window_;
    if (steps > 0) edge.index += events_per_window_ - 1;
    return {PairedFrame::State::kPresent, std::move(edge)};
  }

  ImageSize sensor_size(const std::string&) const override { return kDhp19Size; }

  Outcome<EventWindow> events(const std::string& label_key) const override try {
    const Window window = find(label_key);
    return EventWindow{
        kDhp19Size,
        open(window.recording)->events.events(window.camera, window.first(), events_per_window_)};
  } catch (const InputError& error) {
    return SampleFault{error.what()};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override try {
    const Window window = find(label_key);
    const auto opened = open(window.recording);
    const std::int64_t first = row_at(opened->events.time_s(window.camera, window.first()));
    const std::int64_t last = row_at(opened->events.time_s(window.camera, window.last()));
    if (first < 0 || last < first || last >= std::ssize(opened->poses[0])) {
      return SampleFault{fmt::format("expected a window within {} poses, got rows {}..{}, in {}",
                                     opened->poses[0].size(), first, last, label_place(label_key))};
    }
    Annotation annotation;
    Person person;
    nlohmann::ordered_json original = {{"rows", {first, last}}, {"XYZPOS", {}}};
    for (std::size_t joint = 0; joint < kJoints.size(); ++joint) {
      const Position at = mean(opened->poses[joint], first, last);
      person.joints.push_back(project(matrices_[static_cast<std::size_t>(window.camera)], at));
      original["XYZPOS"][kJoints[joint]] = at;  // NaN becomes null
    }
    derive_frame(person);
    annotation.original = dump_json(original);
    annotation.persons.push_back(std::move(person));
    return annotation;
  } catch (const InputError& error) {
    return SampleFault{error.what()};
  }

  std::string label_place(const std::string& label_key) const override try {
    return fmt::format("{} ({})", root_.written(recordings_.at(find(label_key).recording).poses),
                       label_key);
  } catch (const InputError&) {  // a key that the source does not know any more
    return label_key;
  }

 private:
  static constexpr char kMovies[] = "DVS_movies";
  static constexpr char kVicon[] = "Vicon_data";

  /// What is open of a recording.
  struct Opened {
    Dhp19Events events;
    Poses poses;
  };

  struct Window {
    std::string recording;
    int camera = 0;
    std::int64_t number = 0;
    std::int64_t events = 0;

    std::int64_t first() const { return number * events; }
    std::int64_t last() const { return first() + events - 1; }
  };

  /// S1/1_1/2/000012. Throws InputError for another key.
  Window find(const std::string& label_key) const {
    const std::size_t last = label_key.rfind('/');
    const std::size_t before = last == std::string::npos ? last : label_key.rfind('/', last - 1);
    if (before == std::string::npos || last != before + 2 ||
        !recordings_.contains(label_key.substr(0, before))) {
      throw InputError("expected a window of the source, got " + label_key);
    }
    Window window{label_key.substr(0, before), label_key[before + 1] - '0', 0, events_per_window_};
    std::from_chars(label_key.data() + last + 1, label_key.data() + label_key.size(),
                    window.number);
    return window;
  }

  bool is_wanted(const std::string& subject, const SourceSpec& spec) {
    const std::optional<int> number = number_after(subject, "S");
    if (!number) return false;
    const std::vector<std::string>& named = spec.selection.subjects;
    if (!named.empty()) return std::ranges::find(named, subject) != named.end();
    constexpr int kLastToTrain = 12;
    if (spec.split == "train") return *number <= kLastToTrain;
    if (spec.split == "test") return *number > kLastToTrain;
    return true;
  }

  void find_recordings(const std::string& subject) {
    const std::string folder = std::string(kMovies) + "/" + subject;
    for (const std::string& session : root_.folders_in(folder)) {
      const auto session_number = number_after(session, "session");
      if (!session_number) continue;
      for (const fs::path file : root_.files_in(folder + "/" + session)) {
        const auto movement = number_after(file.stem().string(), "mov");
        if (!movement || (file.extension() != ".h5" && file.extension() != ".hdf5")) continue;
        const std::string action = fmt::format("{}_{}", *session_number, *movement);
        const Dhp19Files recorded{folder + "/" + session + "/" + file.string(),
                                  fmt::format("{}/{}_{}.mat", kVicon, subject, action)};
        if (!recordings_.try_emplace(subject + "/" + action, recorded).second) {
          throw InputError("expected one file of a recording, got .h5 and .hdf5, in " +
                           root_.written(recorded.events));
        }
        annotation_files_.push_back(root_.written(recorded.poses));
      }
    }
  }

  void list_windows(const std::string& name, const std::vector<std::string>& cameras) {
    const auto opened = open(name);
    const std::int64_t rows = std::ssize(opened->poses[0]);
    std::int64_t beyond = 0;
    for (int camera = 0; camera < kDhp19Cameras; ++camera) {
      const std::string number = std::to_string(camera);
      const bool is_wanted =
          cameras.empty() ? camera >= 2 : std::ranges::find(cameras, number) != cameras.end();
      if (!is_wanted) continue;
      const std::int64_t all = opened->events.count(camera) / events_per_window_;
      std::int64_t count = all;
      while (count > 0 &&
             row_at(opened->events.time_s(camera, count * events_per_window_ - 1)) >= rows) {
        --count;
      }
      beyond += all - count;
      for (std::int64_t i = 0; i < count; ++i) {
        LabelledFrame frame;
        frame.sequence = name + "/" + number;
        frame.sample_id = fmt::format("{}/{:06}", frame.sequence, i);
        frame.label_key = frame.sample_id;
        frame.frame = {root_.written(recordings_.at(name).events), i};
        labelled_.push_back(std::move(frame));
      }
    }
    if (beyond > 0) {
      notes_.push_back(fmt::format("{} windows after the last pose left out in {}", beyond,
                                   root_.written(recordings_.at(name).events)));
    }
  }

  /// A recording's file and poses; those used last stay open.
  std::shared_ptr<const Opened> open(const std::string& name) const {
    return opened_.get(name, [&] {
      const Dhp19Files& recorded = recordings_.at(name);
      return std::make_shared<const Opened>(Opened{Dhp19Events(root_.on_disk(recorded.events)),
                                                   read_poses(root_.on_disk(recorded.poses))});
    });
  }

  SourceRoot root_;
  std::int64_t events_per_window_;
  LabelSchema schema_;
  std::array<Projection, kMatrices.size()> matrices_{};
  std::map<std::string, Dhp19Files> recordings_;  ///< by subject and action: "S1/1_1"
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> annotation_files_;  ///< as FrameRef::path is written
  std::vector<std::string> notes_;
  mutable RecentlyUsed<std::string, std::shared_ptr<const Opened>> opened_{4};
};

}  // namespace

std::unique_ptr<Dataset> open_dhp19_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<Dhp19Dataset>(spec, base);
}

constinit const DatasetReader kDhp19Reader{
    .kind = DatasetKind::kDhp19, .open = open_dhp19_dataset, .origin = human36m_origin};

}  // namespace eventgan
