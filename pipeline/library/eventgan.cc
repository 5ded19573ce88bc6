#include "pipeline/library/eventgan.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "pipeline/library/call_gate.h"
#include "pipeline/library/pair_engine.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/memory.h"
#include "stages/events/representation.h"
#include "stages/events/volume_statistics.h"
#include "stages/exports/sampled_events.h"
#include "stages/shards/codec/volume_codec.h"

using eventgan::CallGate;
using eventgan::PairEngine;

struct eventgan_generator {
  explicit eventgan_generator(const std::string& manifest) : engine(manifest) {}

  PairEngine engine;
  std::string description;
};

namespace eventgan {
namespace {

/// 4 GiB of float32: what a manifest's volume stays below.
constexpr std::uint64_t kMostVolumeValues = std::uint64_t{1} << 30;

/// Of a thread's last call.
thread_local std::string last_error;
thread_local std::string last_json;

/// Calls `body`, and turns what it throws into a result and eventgan_error().
template <class Body>
int result_of(Body body) noexcept {
  try {
    try {
      body();
      return EVENTGAN_COMPLETE;
    } catch (const std::bad_alloc& error) {
      last_error = std::string("expected enough memory, got none (") + error.what() + ")";
      return EVENTGAN_OUT_OF_MEMORY;
    } catch (const std::exception& error) {
      last_error = error_text(error);
      const int code = exit_code_of(error);
      return code == kUsage || code == kInputMissing ? code : EVENTGAN_FAILED;
    }
  } catch (...) {  // no memory for the text either
    last_error.clear();
    return EVENTGAN_OUT_OF_MEMORY;
  }
}

template <class T>
T* required(T* pointer, const char* what) {
  if (pointer == nullptr) throw UsageError(std::string("expected ") + what + ", got NULL");
  return pointer;
}

std::span<float> volumes_of(float* values, std::uint64_t size, const VolumeShape& shape,
                            std::size_t count) {
  const std::size_t wanted = shape.value_count() * count;
  if (size != wanted) {
    throw UsageError("expected memory for volumes of " + std::to_string(wanted) +
                     " values, got such for " + std::to_string(size));
  }
  if (wanted > 0) required(values, "memory for volumes");
  return {values, wanted};
}

KnownLabels labels_of(const eventgan_labels& given) {
  KnownLabels labels;
  labels.has_boxes = given.box_count >= 0;
  for (std::int64_t i = 0; i < given.box_count; ++i) {
    const double* at = required(given.boxes, "boxes") + 4 * i;
    Box box;
    box.xyxy = {at[0], at[1], at[2], at[3]};
    labels.annotation.boxes.push_back(box);
  }
  labels.has_joints = given.person_count >= 0;
  const double* at = given.joints;
  for (std::int64_t i = 0; i < given.person_count; ++i) {
    Person person;
    for (std::int64_t j = 0; j < given.joint_count; ++j, at += 2) {
      required(at, "joints");
      const bool is_missing = std::isnan(at[0]) || std::isnan(at[1]);
      person.joints.push_back({is_missing ? kMissingPoint : Point{at[0], at[1]}, -1});
    }
    labels.annotation.persons.push_back(std::move(person));
  }
  return labels;
}

/// Writes the labels' places in the volume to where `given` wants them.
void place_labels(const VolumeLabels& labels, const eventgan_labels& given) {
  const auto write = [](const Rectangle& box, double* to) {
    const std::array<double, 4> row{box.left, box.top, box.right, box.bottom};
    std::ranges::copy(row, to);
  };
  if (given.box_count > 0) {
    for (std::size_t i = 0; i < labels.boxes.size(); ++i) {
      if (given.clipped) write(labels.boxes[i].clipped, given.clipped + 4 * i);
      if (given.unclipped) write(labels.boxes[i].unclipped, given.unclipped + 4 * i);
    }
  }
  if (given.person_count <= 0 || given.placed == nullptr) return;
  double* to = given.placed;
  for (const VolumePerson& person : labels.persons) {
    for (const Point& point : person.joints) {
      const bool is_missing = point == kMissingPoint;
      *to++ = is_missing ? std::nan("") : point.x;
      *to++ = is_missing ? std::nan("") : point.y;
    }
  }
}

/// What eventgan_sample tells of a volume.
std::string notes_of(const MadeVolume& made, int tile_px) {
  const VolumeStatistics& found = made.statistics;
  nlohmann::json notes;
  nlohmann::json& statistics = notes["statistics"];
  statistics = {{"nonzero_fraction", found.nonzero_fraction},
                {"max", found.max},
                {"sum_positive", found.sum_positive},
                {"sum_negative", found.sum_negative},
                {"flags", found.flags},
                {"eta98", found.eta98}};
  if (const auto& tiles = made.part.tiles; !tiles.empty()) {
    const int columns = (made.placement.volume.width + tile_px - 1) / tile_px;
    const auto generated = static_cast<double>(std::ranges::count(tiles, 1));
    statistics["generated_fraction"] =
        static_cast<float>(generated / static_cast<double>(tiles.size()));
    nlohmann::json rows = nlohmann::json::array();
    for (auto row = tiles.begin(); row != tiles.end(); row += columns) {
      rows.push_back(std::vector<int>(row, row + columns));
    }
    statistics["tiles"] = std::move(rows);
  }
  if (const auto& threshold = made.part.threshold) notes["threshold"] = threshold->mean;
  return notes.dump();
}

std::string description_of(const PairEngine& engine) {
  const auto gaps = engine.generator().training_gaps();
  nlohmann::json description{{"bins", engine.generator().bins()},
                             {"description", engine.generator().description()},
                             {"weights_hash", engine.loaded().weights_hash},
                             {"warnings", engine.loaded().warnings},
                             {"training_gaps", nullptr},
                             {"draws", engine.draws()}};
  if (gaps) description["training_gaps"] = {gaps->first, gaps->last};
  return description.dump();
}

}  // namespace
}  // namespace eventgan

using namespace eventgan;  // NOLINT: the functions below are C's

const char* eventgan_version() { return EVENTGAN_VERSION; }

const char* eventgan_error() { return last_error.c_str(); }

int eventgan_load(const char* manifest, eventgan_generator** generator) {
  return result_of([&] {
    const CallGate::Pass pass;
    required(generator, "a place for the generator");
    auto made = std::make_unique<eventgan_generator>(required(manifest, "a manifest"));
    made->description = description_of(made->engine);
    *generator = made.release();
  });
}

void eventgan_free(eventgan_generator* generator) {
  const CallGate::Pass pass;
  delete generator;
}

const char* eventgan_describe(const eventgan_generator* generator) {
  return generator == nullptr ? "{}" : generator->description.c_str();
}

int eventgan_shape(const eventgan_generator* generator, int64_t height, int64_t width,
                   int64_t count, int32_t threads, int32_t shape[3], double source_to_volume[6]) {
  return result_of([&] {
    constexpr auto kMost = static_cast<std::int64_t>(kMaxImagePixels);
    if (height < 1 || width < 1 || height > kMost || width > kMost || height * width > kMost) {
      throw UsageError("expected images of 1 to " + std::to_string(kMaxImagePixels) +
                       " pixels, got shape (" + std::to_string(height) + ", " +
                       std::to_string(width) + ")");
    }
    if (count < 0 || threads < 1) {
      throw UsageError("expected some volumes and threads, got " + std::to_string(count) + " and " +
                       std::to_string(threads));
    }
    const PairEngine& engine = required(generator, "a generator")->engine;
    const ImageSize source{static_cast<int>(height), static_cast<int>(width)};
    const VolumeShape made = engine.shape(source, static_cast<std::size_t>(count), threads);
    if (shape) {
      const std::array<int, 3> sides{made.channels(), made.size.height, made.size.width};
      std::ranges::copy(sides, shape);
    }
    if (source_to_volume) {
      std::ranges::copy(engine.placement(source).source_to_volume(), source_to_volume);
    }
  });
}

int eventgan_generate(const eventgan_generator* generator, const eventgan_images* previous,
                      const eventgan_images* following, uint64_t draw, float* volumes,
                      uint64_t size, int64_t* next, int64_t most) {
  return result_of([&] {
    const PairEngine& engine = required(generator, "a generator")->engine;
    const ImagePairs pairs(*required(previous, "images"), *required(following, "images"));
    const std::size_t count = pairs.previous.count();
    const VolumeShape shape = engine.shape(pairs.previous.size(), count, 1);
    const std::span<float> values = volumes_of(volumes, size, shape, count);
    const auto end = static_cast<std::int64_t>(count);
    std::int64_t first = 0;
    const std::atomic_ref<std::int64_t> shared(next ? *next : first);
    if (next == nullptr) most = end;
    try {
      for (std::int64_t made = 0; made < most; ++made) {
        const CallGate::Pass pass;
        const std::int64_t i = shared.fetch_add(1);
        if (i < 0 || i >= end) return;
        const auto index = static_cast<std::size_t>(i);
        engine.make(pairs, index, nullptr, 1, draw,
                    values.subspan(index * shape.value_count(), shape.value_count()));
      }
    } catch (...) {
      shared = end;
      throw;
    }
  });
}

int eventgan_sample(const eventgan_generator* generator, const eventgan_images* previous,
                    const eventgan_images* following, const eventgan_labels* labels, int32_t gap,
                    uint64_t draw, float* volume, uint64_t size, const char** json) {
  return result_of([&] {
    const CallGate::Pass pass;
    if (gap < 1) throw UsageError("expected a gap of at least 1, got " + std::to_string(gap));
    const PairEngine& engine = required(generator, "a generator")->engine;
    const ImagePairs pair(*required(previous, "images"), *required(following, "images"));
    if (pair.previous.count() != 1) {
      throw UsageError("expected one pair, got " + std::to_string(pair.previous.count()));
    }
    const KnownLabels known = labels_of(*required(labels, "labels"));
    const VolumeShape shape = engine.shape(pair.previous.size(), 1, 1);
    const MadeVolume made =
        engine.make(pair, 0, &known, gap, draw, volumes_of(volume, size, shape, 1));
    place_labels(made.labels, *labels);
    last_json = notes_of(made, engine.job().generator.scope.tile_px);
    if (json) *json = last_json.c_str();
  });
}

int eventgan_prepare(const eventgan_generator* generator, const eventgan_images* image,
                     uint8_t* grey, uint64_t size) {
  return result_of([&] {
    const CallGate::Pass pass;
    const PairEngine& engine = required(generator, "a generator")->engine;
    const Images images(*required(image, "an image"), "image");
    if (images.count() != 1) {
      throw UsageError("expected one image, got " + std::to_string(images.count()));
    }
    const ImageSize whole = engine.shape(images.size(), 1, 1).size;
    if (size != whole.pixel_count()) {
      throw UsageError("expected memory for an image of " + std::to_string(whole.pixel_count()) +
                       " bytes, got " + std::to_string(size));
    }
    const PreparedFrame frame = images.prepared(0, engine.job().image);
    const VisiblePart part = visible_part(frame.placement);
    std::fill_n(required(grey, "memory for an image"), size, std::uint8_t{0});
    for (int y = 0; y < part.size.height; ++y) {
      std::copy_n(
          frame.grey.data() + static_cast<std::ptrdiff_t>(y) * part.size.width, part.size.width,
          grey + static_cast<std::ptrdiff_t>(part.volume_y + y) * whole.width + part.volume_x);
    }
  });
}

int eventgan_sample_events(const float* volume, int32_t bins, int32_t height, int32_t width,
                           double duration_s, uint64_t seed, int32_t rounded,
                           eventgan_event** events, uint64_t* count) {
  return result_of([&] {
    const CallGate::Pass pass;
    if (bins < 1 || height < 0 || width < 0) {
      throw UsageError("expected a volume's bins, height and width, got " + std::to_string(bins) +
                       ", " + std::to_string(height) + " and " + std::to_string(width));
    }
    if (!(duration_s > 0) || !std::isfinite(duration_s)) {
      throw UsageError("expected a duration above 0 s, got " + fmt::format("{}", duration_s));
    }
    required(events, "a place for the events");
    required(count, "a place for their number");
    if (2.0 * bins * height * width > static_cast<double>(kMostVolumeValues)) {
      throw UsageError(
          fmt::format("expected a volume of at most {} values, got one of 2 x {} bins and {} x {}",
                      kMostVolumeValues, bins, height, width));
    }
    const VolumeShape shape{bins, {height, width}};
    const std::span<const float> values(volume, shape.value_count());
    if (!values.empty()) required(volume, "a volume");
    const std::size_t unsound = first_unsound_value(values);
    if (unsound < values.size()) {
      throw UsageError("expected finite values >= 0, got " + fmt::format("{}", values[unsound]));
    }
    // They are gathered, sorted with as much room beside them, and copied for the caller.
    const double count_about = std::accumulate(values.begin(), values.end(), 0.0);
    if (count_about <= kMostSampledEvents &&
        4 * sizeof(Event) * count_about > static_cast<double>(memory_limit_bytes())) {
      throw std::bad_alloc();
    }
    const std::vector<Event> drawn =
        sample_events(values, shape, duration_s,
                      rounded ? EventCounts::kRounded : EventCounts::kPoisson, CounterRandom(seed));
    auto rows = std::make_unique<eventgan_event[]>(drawn.size());
    std::ranges::transform(drawn, rows.get(), [](const Event& event) {
      return eventgan_event{event.t_s, event.x, event.y, static_cast<std::int8_t>(event.positive)};
    });
    *count = drawn.size();
    *events = rows.release();
  });
}

void eventgan_free_events(eventgan_event* events) { delete[] events; }

const char* eventgan_representations(void) {
  static const std::string kText = [] {
    std::string text;
    for (const RepresentationRow& row : representations()) {
      text += fmt::format("{}\t{}\t{}\t{}\t{}\t{}\n", row.word, row.number, row.shape, row.dtype,
                          row.equation, row.readers);
    }
    return text;
  }();
  return kText.c_str();
}

int eventgan_represent(const eventgan_event* events, uint64_t count, const char* representation,
                       int32_t height, int32_t width, const double* times, int32_t* channels,
                       int32_t* number, void* values, uint64_t size) {
  return result_of([&] {
    const CallGate::Pass pass;
    const Representation how = parse_representation(required(representation, "a representation"));
    *required(channels, "a place for the channels") = channels_of(how);
    *required(number, "a place for the type") =
        number_bytes(how) == 1 ? EVENTGAN_UINT8 : EVENTGAN_FLOAT32;
    if (height < 1 || width < 1 ||
        1.0 * std::max(channels_of(how), 1) * height * width > kMostVolumeValues) {
      throw UsageError(
          fmt::format("expected a size of 1 x 1 or more, and at most {} values, got {} "
                      "channels of {} x {}",
                      kMostVolumeValues, channels_of(how), height, width));
    }
    if (values == nullptr) return;
    if (count > 0) required(events, "events");
    std::vector<Event> given(count);
    std::transform(events, events + count, given.begin(), [](const eventgan_event& event) {
      return Event{event.x, event.y, event.t, event.p > 0};
    });
    std::optional<std::array<double, 2>> times_s;
    if (times != nullptr) times_s = {times[0], times[1]};
    try {
      represent(given, how, {height, width}, times_s, {static_cast<std::byte*>(values), size});
    } catch (const std::invalid_argument& error) {
      throw UsageError(error.what());
    }
  });
}

int eventgan_decode(const void* chunk, uint64_t chunk_size, int32_t number_size,
                    int32_t is_deflated, float scale, float* volume, uint64_t size) {
  return result_of([&] {
    const CallGate::Pass pass;
    constexpr std::array kTypes{StoredType::kUint8, StoredType::kFloat16, StoredType::kFloat32};
    const auto type = std::ranges::find(kTypes, static_cast<std::size_t>(number_size), stored_size);
    if (number_size < 0 || type == kTypes.end()) {
      throw UsageError("expected numbers of 1, 2 or 4 bytes, got " + std::to_string(number_size));
    }
    if (size > kMostVolumeValues) {
      throw UsageError(fmt::format("expected a volume of at most {} values, got one of {}",
                                   kMostVolumeValues, size));
    }
    const auto* const bytes = static_cast<const std::byte*>(required(chunk, "a chunk"));
    if (!decode_volume({bytes, chunk_size}, *type, is_deflated ? 1 : 0, scale,
                       {required(volume, "memory for a volume"), size})) {
      throw InputError("expected an intact volume of " + std::to_string(size) +
                       " values, got a damaged one");
    }
  });
}

void eventgan_end() { CallGate::instance().end(); }
