// eventgan._engine: the engine for Python. manifests/python/eventgan/generator.py is what users
// see.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "pipeline/conversion/pair_volume.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/python/detail/array_images.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/memory.h"
#include "stages/base/files/sha256.h"
#include "stages/events/volume_statistics.h"
#include "stages/exports/sampled_events.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/labels/label_mapping.h"

namespace eventgan {
namespace {

// ---- Volumes

/// Memory of freed volumes, kept for the next ones: the page faults of new memory cost as much as
/// a part of the network, also for a caller that frees a whole batch at once. Thread safe.
class SpareMemory {
 public:
  PageBuffer take(std::size_t size_bytes) {
    {
      const std::lock_guard lock(mutex_);
      const auto fitting = std::ranges::find(spare_, size_bytes, &PageBuffer::size_bytes);
      if (fitting != spare_.end()) {
        PageBuffer buffer = std::move(*fitting);
        spare_.erase(fitting);
        return buffer;
      }
      spare_.clear();  // images of another size
    }
    return PageBuffer(size_bytes);
  }

  void give_back(PageBuffer buffer) {
    const std::lock_guard lock(mutex_);
    std::size_t bytes = buffer.size_bytes();
    for (const PageBuffer& spare : spare_) bytes += spare.size_bytes();
    if (bytes <= kMostBytes) spare_.push_back(std::move(buffer));
  }

 private:
  /// 33 volumes of 260x861, but no more than a caller has had at the same time.
  static constexpr std::size_t kMostBytes = std::size_t{1} << 29;

  std::mutex mutex_;
  std::vector<PageBuffer> spare_;
};

/// Volumes, float32 [2 bins, H, W], whose memory goes back when nobody has the array any more.
class VolumeArray {
 public:
  VolumeArray(const std::shared_ptr<SpareMemory>& memory, const VolumeShape& shape,
              std::size_t count = 1)
      : shape_(shape),
        count_(count),
        owner_(new Owner{memory, memory->take(std::max<std::size_t>(
                                     count * shape.value_count() * sizeof(float), 1))}) {}

  std::span<float> values(std::size_t index = 0) const {
    return {reinterpret_cast<float*>(owner_->buffer.data()) + index * shape_.value_count(),
            shape_.value_count()};
  }

  /// [2 bins, H, W], or a batch [count, 2 bins, H, W].
  py::array to_python(bool is_batch = false) && {
    float* first = values().data();
    const py::capsule capsule(owner_.release(), [](void* owner) {
      const std::unique_ptr<Owner> released(static_cast<Owner*>(owner));
      released->memory->give_back(std::move(released->buffer));
    });
    std::vector<py::ssize_t> sides{shape_.channels(), shape_.size.height, shape_.size.width};
    if (is_batch) sides.insert(sides.begin(), static_cast<py::ssize_t>(count_));
    return py::array_t<float>(std::move(sides), first, capsule);
  }

 private:
  struct Owner {
    std::shared_ptr<SpareMemory> memory;
    PageBuffer buffer;
  };

  VolumeShape shape_;
  std::size_t count_;
  std::unique_ptr<Owner> owner_;
};

/// Lays values [channel, y, x] of the pair's content into the whole volume, zeros around them.
void lay_into(std::span<const float> content, const PreparedPair& pair, std::span<float> volume) {
  const ImageSize whole = pair.placement.volume;
  std::ranges::fill(volume, 0.0f);
  const auto width = static_cast<std::size_t>(pair.content.width);
  const std::size_t channels = volume.size() / whole.pixel_count();
  for (std::size_t channel = 0; channel < channels; ++channel) {
    for (int y = 0; y < pair.content.height; ++y) {
      const std::size_t row =
          channel * static_cast<std::size_t>(pair.content.height) + static_cast<std::size_t>(y);
      const std::size_t place = (channel * static_cast<std::size_t>(whole.height) +
                                 static_cast<std::size_t>(pair.content_y + y)) *
                                    static_cast<std::size_t>(whole.width) +
                                static_cast<std::size_t>(pair.content_x);
      std::ranges::copy(content.subspan(row * width, width), volume.data() + place);
    }
  }
}

/// What stands for a sample's id, since arrays have none: the images' content.
std::string content_name(const PreparedFrame& previous, const PreparedFrame& following) {
  Sha256 hash;
  for (const PreparedFrame* frame : {&previous, &following}) {
    hash.update(std::as_bytes(std::span(frame->grey)));
  }
  return hash.hex();
}

/// What a caller knows of the image's labels.
struct Labels {
  Annotation annotation;
  bool has_boxes = false;
  bool has_joints = false;
};

/// A pair's volume but for its values.
struct MadeVolume {
  GeneratedPart part;
  VolumeStatistics statistics;
  Placement placement;
  VolumeLabels labels;
};

/// Throws UsageError for settings that are none, and Python's FileNotFoundError if there is no file
/// of weights.
JobManifest read_settings(const std::string& settings) {
  JobManifest job = parse_pair_manifest(settings, {}, "eventgan.Generator");
  const std::string& weights = job.generator.weights;
  if (weights.starts_with('/') && !std::filesystem::exists(weights)) {
    PyErr_SetObject(PyExc_FileNotFoundError,
                    py::make_tuple(ENOENT, "expected a file of weights, got none", weights).ptr());
    throw py::error_already_set();
  }
  return job;
}

class PairGenerator {
 public:
  explicit PairGenerator(const std::string& settings)
      : job_(read_settings(settings)), loaded_(load_generator(job_)) {}

  int bins() const { return generator().bins(); }
  std::string description() const { return generator().description(); }
  const std::string& weights_hash() const { return loaded_.weights_hash; }
  const std::vector<std::string>& warnings() const { return loaded_.warnings; }
  std::optional<std::pair<int, int>> training_gaps() const {
    const std::optional<GapRange> gaps = generator().training_gaps();
    return gaps ? std::optional(std::pair(gaps->first, gaps->last)) : std::nullopt;
  }

  py::array call(const py::array& previous, const py::array& following) const {
    const Pair pair(previous, following, false);
    VolumeArray volume(memory_, shape_of(pair.previous.size(), 1));
    {
      const py::gil_scoped_release release;
      make(pair, 0, nullptr, 1, volume.values());
    }
    return std::move(volume).to_python();
  }

  py::array many(const py::array& previous, const py::array& following, int threads) const {
    if (threads < 1 || threads > 1024) {
      throw UsageError("expected 1 to 1024 threads, got " + std::to_string(threads));
    }
    const Pair pairs(previous, following, true);
    const std::size_t count = pairs.previous.count();
    VolumeArray volumes(memory_, shape_of(pairs.previous.size(), count), count);
    {
      const py::gil_scoped_release release;
      make_all(pairs, threads, [&](std::size_t i) { return volumes.values(i); });
    }
    return std::move(volumes).to_python(true);
  }

  py::dict sample(const py::array& previous, const py::array& following,
                  const std::optional<py::array_t<double, py::array::c_style>>& boxes,
                  const std::optional<py::array_t<double, py::array::c_style>>& joints,
                  int gap) const;

  py::array prepare(const py::array& image) const {
    const Images images(image, "image", false);
    const VolumeShape shape = shape_of(images.size(), 1);
    py::array_t<std::uint8_t> whole({shape.size.height, shape.size.width});
    const PreparedFrame frame = prepared(images.at(0), job_.image, images.name());
    const VisiblePart part = visible_part(frame.placement);
    std::fill_n(whole.mutable_data(), whole.size(), std::uint8_t{0});
    for (int y = 0; y < part.size.height; ++y) {
      std::copy_n(frame.grey.data() + static_cast<std::ptrdiff_t>(y) * part.size.width,
                  part.size.width, whole.mutable_data(part.volume_y + y, part.volume_x));
    }
    return whole;
  }

  py::array source_to_volume(int height, int width) const {
    if (height < 1 || width < 1) {
      throw UsageError("expected an image's height and width, got " + std::to_string(height) +
                       " and " + std::to_string(width));
    }
    return matrix(place({height, width}, job_.image));
  }

 private:
  const Generator& generator() const { return *loaded_.generator; }

  /// Throws std::bad_alloc if `volumes` of them, and what makes them, are beyond the memory: asking
  /// for it could end the process.
  VolumeShape shape_of(ImageSize source, std::size_t volumes) const {
    const VolumeShape shape{generator().bins(), place(source, job_.image).volume};
    const double bytes = static_cast<double>(shape.value_count()) * sizeof(float) *
                             (static_cast<double>(volumes) + 1) +
                         static_cast<double>(generator().working_bytes(shape.size));
    if (bytes > static_cast<double>(memory_bytes_)) throw std::bad_alloc();
    return shape;
  }

  /// Without labels a scope of labels would give a volume that looks as if nothing had moved.
  void require_labels(const Labels* labels) const {
    const Scope scope = job_.generator.scope.scope;
    if (scope != Scope::kLabels && scope != Scope::kLabelsOnly) return;
    if (labels && (labels->has_boxes || labels->has_joints)) return;
    throw UsageError("expected boxes or joints, which Generator.sample takes, since scope is \"" +
                     std::string(to_string(scope)) + "\", got none");
  }

  MadeVolume make(const Pair& pairs, std::size_t index, const Labels* labels, int gap,
                  std::span<float> volume) const {
    require_labels(labels);
    const PreparedFrame previous =
        prepared(pairs.previous.at(index), job_.image, pairs.previous.name());
    const PreparedFrame following =
        prepared(pairs.following.at(index), job_.image, pairs.following.name());
    const bool draws = job_.generator.noise || job_.generator.threshold || generator().thresholds();
    const std::string name = draws ? content_name(previous, following) : "";
    const PairKey key{job_.seed, to_string(DatasetKind::kFrames), name};
    const PreparedPair pair = prepare_pair(previous, following);
    MadeVolume made;
    made.placement = pair.placement;
    if (labels) {
      Outcome<VolumeLabels> mapped = map_labels(labels->annotation, pair.placement, "the labels");
      if (is_fault(mapped)) throw UsageError(mapped.fault().reason);
      made.labels = std::move(*mapped);
    }
    std::vector<float> content;
    std::span<float> values = volume;
    if (pair.content != pair.placement.volume) {
      content.resize(VolumeShape{bins(), pair.content}.value_count());
      values = content;
    }
    made.part = generate_volume(generator(), job_.generator, key, pair, made.labels, values);
    const bool has_noise =
        add_pair_noise(job_.generator, key, std::numeric_limits<double>::quiet_NaN(),
                       {bins(), pair.content}, values);
    // A fifth of the time of a network of width 8 in bfloat16: only where they are wanted.
    bool is_sound = made.part.notes.sound;
    if (labels || job_.volume.normalize != Normalization::kNone) {
      const auto statistics =
          finish_volume(generator(), made.part.notes, gap, job_.volume.normalize, pair, values);
      is_sound = statistics.has_value();
      made.statistics = statistics.value_or(VolumeStatistics{});
      if (has_noise) made.statistics.flags |= kFlagNoise;
    } else if (!is_sound) {
      is_sound = scan_values(values).sound;
    }
    if (!is_sound) {
      throw std::runtime_error("expected finite values >= 0, got " +
                               std::to_string(values[first_unsound_value(values)]) +
                               " in the generated volume");
    }
    if (values.data() != volume.data()) lay_into(values, pair, volume);
    return made;
  }

  /// Makes every pair's volume on so many threads, this one among them. Without Python's lock.
  template <class VolumeOf>
  void make_all(const Pair& pairs, int threads, VolumeOf volume_of) const {
    const std::size_t count = pairs.previous.count();
    std::atomic<std::size_t> next = 0;
    std::mutex fault_mutex;
    std::exception_ptr fault;
    const auto work = [&](bool is_callers) {
      try {
        for (std::size_t i = next++; i < count; i = next++) {
          make(pairs, i, nullptr, 1, volume_of(i));
          if (is_callers) {
            const py::gil_scoped_acquire acquire;
            if (PyErr_CheckSignals() != 0) throw py::error_already_set();
          }
        }
      } catch (...) {
        const std::lock_guard lock(fault_mutex);
        if (!fault) fault = std::current_exception();
        next = count;
      }
    };
    {
      std::vector<std::jthread> others;
      for (int i = 1; i < threads && static_cast<std::size_t>(i) < count; ++i) {
        others.emplace_back(work, false);
      }
      work(true);
    }
    if (fault) std::rethrow_exception(fault);
  }

  static py::array matrix(const Placement& placement) {
    const std::array<double, 6> map = placement.source_to_volume();
    return py::array_t<double>({2, 3}, map.data());
  }

  JobManifest job_;
  LoadedGenerator loaded_;
  std::size_t memory_bytes_ = memory_limit_bytes();
  std::shared_ptr<SpareMemory> memory_ = std::make_shared<SpareMemory>();
};

// ---- Labels and statistics

using Doubles = py::array_t<double, py::array::c_style>;

Labels labels_of(const std::optional<Doubles>& boxes, const std::optional<Doubles>& joints) {
  Labels labels;
  if (boxes) {
    labels.has_boxes = true;
    if (boxes->ndim() != 2 || boxes->shape(1) != 4) {
      throw UsageError("expected boxes [n, 4], got shape " + shape_text(*boxes));
    }
    for (py::ssize_t i = 0; i < boxes->shape(0); ++i) {
      Box box;
      box.xyxy = {boxes->at(i, 0), boxes->at(i, 1), boxes->at(i, 2), boxes->at(i, 3)};
      labels.annotation.boxes.push_back(box);
    }
  }
  if (joints) {
    labels.has_joints = true;
    if (joints->ndim() != 3 || joints->shape(2) != 2) {
      throw UsageError("expected joints [P, J, 2], got shape " + shape_text(*joints));
    }
    for (py::ssize_t i = 0; i < joints->shape(0); ++i) {
      Person person;
      for (py::ssize_t j = 0; j < joints->shape(1); ++j) {
        const Point at{joints->at(i, j, 0), joints->at(i, j, 1)};
        person.joints.push_back({std::isnan(at.x) || std::isnan(at.y) ? kMissingPoint : at, -1});
      }
      labels.annotation.persons.push_back(std::move(person));
    }
  }
  return labels;
}

py::array rectangles(const std::vector<VolumeBox>& boxes, Rectangle VolumeBox::*which) {
  py::array_t<double> rows({static_cast<py::ssize_t>(boxes.size()), py::ssize_t{4}});
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const Rectangle& box = boxes[i].*which;
    const std::array<double, 4> row{box.left, box.top, box.right, box.bottom};
    std::ranges::copy(row, rows.mutable_data(static_cast<py::ssize_t>(i), 0));
  }
  return rows;
}

py::dict PairGenerator::sample(const py::array& previous, const py::array& following,
                               const std::optional<Doubles>& boxes,
                               const std::optional<Doubles>& joints, int gap) const {
  const Pair pair(previous, following, false);
  const Labels labels = labels_of(boxes, joints);
  const VolumeShape shape = shape_of(pair.previous.size(), 1);
  VolumeArray volume(memory_, shape);
  MadeVolume made;
  {
    const py::gil_scoped_release release;
    made = make(pair, 0, &labels, gap, volume.values());
  }
  py::dict statistics;
  const VolumeStatistics& found = made.statistics;
  statistics["nonzero_fraction"] = found.nonzero_fraction;
  statistics["max"] = found.max;
  statistics["sum_positive"] = found.sum_positive;
  statistics["sum_negative"] = found.sum_negative;
  statistics["flags"] = found.flags;
  statistics["eta98"] = found.eta98;
  if (!made.part.tiles.empty()) {
    const int side = job_.generator.scope.tile_px;
    const py::ssize_t columns = (shape.size.width + side - 1) / side;
    const auto tiles = static_cast<py::ssize_t>(made.part.tiles.size());
    const auto generated = static_cast<double>(std::ranges::count(made.part.tiles, 1));
    statistics["generated_fraction"] =
        static_cast<float>(generated / static_cast<double>(made.part.tiles.size()));
    statistics["tiles"] =
        py::array_t<std::uint8_t>({tiles / columns, columns}, made.part.tiles.data());
  }
  py::dict sample;
  sample["volume"] = std::move(volume).to_python();
  sample["statistics"] = statistics;
  sample["source_to_volume"] = matrix(made.placement);
  if (const auto& threshold = made.part.threshold) sample["threshold"] = threshold->mean;
  if (labels.has_boxes) {
    py::dict rows;
    rows["xyxy"] = rectangles(made.labels.boxes, &VolumeBox::clipped);
    rows["xyxy_unclipped"] = rectangles(made.labels.boxes, &VolumeBox::unclipped);
    sample["boxes"] = rows;
  }
  if (labels.has_joints) {
    py::array_t<double> points({joints->shape(0), joints->shape(1), py::ssize_t{2}});
    double* to = points.mutable_data();
    for (const VolumePerson& person : made.labels.persons) {
      for (const Point& point : person.joints) {
        const bool is_missing = point == kMissingPoint;
        *to++ = is_missing ? std::nan("") : point.x;
        *to++ = is_missing ? std::nan("") : point.y;
      }
    }
    sample["joints"] = points;
  }
  return sample;
}

// ---- Events

struct EventRow {
  double t;
  std::int32_t x;
  std::int32_t y;
  std::int8_t p;
};

py::array events_of(const py::array_t<float, py::array::c_style>& volume, double duration_s,
                    std::uint64_t seed, EventCounts counts) {
  if (volume.ndim() != 3 || volume.shape(0) < 2 || volume.shape(0) % 2 != 0) {
    throw UsageError("expected a volume [2B, H, W], got shape " + shape_text(volume));
  }
  if (!(duration_s > 0) || !std::isfinite(duration_s)) {
    throw UsageError("expected a duration above 0 s, got " + std::to_string(duration_s));
  }
  const std::span<const float> values(volume.data(), static_cast<std::size_t>(volume.size()));
  const VolumeShape shape{static_cast<int>(volume.shape(0) / 2),
                          {static_cast<int>(volume.shape(1)), static_cast<int>(volume.shape(2))}};
  std::vector<Event> events;
  {
    const py::gil_scoped_release release;
    const std::size_t unsound = first_unsound_value(values);
    if (unsound < values.size()) {
      throw UsageError("expected finite values >= 0, got " + std::to_string(values[unsound]));
    }
    events = sample_events(values, shape, duration_s, counts, CounterRandom(seed));
  }
  py::array_t<EventRow> rows(static_cast<py::ssize_t>(events.size()));
  std::ranges::transform(events, rows.mutable_data(), [](const Event& event) {
    return EventRow{event.t_s, event.x, event.y, static_cast<std::int8_t>(event.positive)};
  });
  return rows;
}

}  // namespace

PYBIND11_MODULE(_engine, module) {
#if PYBIND11_VERSION_HEX < 0x020C0000
  // It would take other fields of NumPy 2's dtypes for those of NumPy 1.
  const auto numpy = py::module_::import("numpy").attr("__version__").cast<std::string>();
  if (!numpy.starts_with("1.")) {
    throw std::runtime_error("expected NumPy 1, as pybind11 before 2.12 does, got " + numpy);
  }
#endif
  PYBIND11_NUMPY_DTYPE(EventRow, t, x, y, p);
  // NOLINTNEXTLINE(performance-unnecessary-value-param): pybind11 wants it so
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const UsageError& error) {
      PyErr_SetString(PyExc_ValueError, error_text(error).c_str());
    } catch (const InputError& error) {
      PyErr_SetString(PyExc_ValueError, error_text(error).c_str());
    } catch (const std::runtime_error& error) {
      PyErr_SetString(PyExc_RuntimeError, error_text(error).c_str());
    }
  });
  using py::arg;
  py::class_<PairGenerator>(module, "Generator")
      .def(py::init<const std::string&>(), arg("settings"))
      .def_property_readonly("bins", &PairGenerator::bins)
      .def_property_readonly("description", &PairGenerator::description)
      .def_property_readonly("weights_hash", &PairGenerator::weights_hash)
      .def_property_readonly("warnings",
                             [](const PairGenerator& generator) {
                               py::list texts;
                               for (const std::string& text : generator.warnings()) {
                                 texts.append(text);
                               }
                               return texts;
                             })
      .def_property_readonly("training_gaps",
                             [](const PairGenerator& generator) -> py::object {
                               const auto gaps = generator.training_gaps();
                               if (!gaps) return py::none();
                               return py::make_tuple(gaps->first, gaps->second);
                             })
      .def("call", &PairGenerator::call, arg("previous"), arg("following"))
      .def("many", &PairGenerator::many, arg("previous"), arg("following"), arg("threads"))
      .def(
          "sample",
          [](const PairGenerator& generator, const py::array& previous, const py::array& following,
             const py::object& boxes, const py::object& joints, int gap) {
            const auto doubles = [](const py::object& given) {
              return given.is_none() ? std::nullopt : std::optional(given.cast<Doubles>());
            };
            return generator.sample(previous, following, doubles(boxes), doubles(joints), gap);
          },
          arg("previous"), arg("following"), arg("boxes"), arg("joints"), arg("gap"))
      .def("prepare", &PairGenerator::prepare, arg("image"))
      .def("source_to_volume", &PairGenerator::source_to_volume, arg("height"), arg("width"));
  module.def(
      "sample_events",
      [](const py::array_t<float, py::array::c_style>& volume, double duration_s,
         std::uint64_t seed, bool rounded) {
        return events_of(volume, duration_s, seed,
                         rounded ? EventCounts::kRounded : EventCounts::kPoisson);
      },
      arg("volume"), arg("duration_s"), arg("seed"), arg("rounded"));
}

}  // namespace eventgan
