#include "pipeline/simulation/recording_output.h"

#include <cmath>
#include <exception>
#include <utility>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/recordings/writers/aedat4_writer.h"
#include "stages/recordings/writers/evt3_writer.h"
#include "stages/recordings/writers/mvsec_writer.h"

namespace eventgan {
namespace {

constexpr char kSettingsAttribute[] = "simulation";

std::int64_t microseconds(double time_s) { return std::llround(time_s * 1e6); }

std::vector<StampedEvent> stamped(std::span<const Event> events) {
  std::vector<StampedEvent> result;
  result.reserve(events.size());
  for (const Event& event : events) {
    result.push_back({microseconds(event.t_s), static_cast<std::uint16_t>(event.x),
                      static_cast<std::uint16_t>(event.y), event.positive});
  }
  return result;
}

class MvsecOutput final : public RecordingOutput {
 public:
  MvsecOutput(const std::filesystem::path& file, ImageSize size, const std::string& settings)
      : writer_(file, size, settings) {}
  void add_events(std::span<const Event> events) override { writer_.add_events(events); }
  void add_frame(const GreyImage& frame, double time_s, const FlowField* flow) override {
    writer_.add_frame(frame, time_s, flow);
  }
  void commit(const std::function<void()>& before) override { writer_.commit(before); }

 private:
  MvsecWriter writer_;
};

class Aedat4Output final : public RecordingOutput {
 public:
  Aedat4Output(const std::filesystem::path& file, ImageSize size, const std::string& settings)
      : writer_(file, size, settings) {}
  void add_events(std::span<const Event> events) override { writer_.add_events(stamped(events)); }
  void add_frame(const GreyImage& frame, double time_s, const FlowField*) override {
    writer_.add_frame(microseconds(time_s), frame.pixels);
  }
  void commit(const std::function<void()>& before) override { writer_.commit(before); }

 private:
  Aedat4Writer writer_;
};

class RawOutput final : public RecordingOutput {
 public:
  RawOutput(const std::filesystem::path& file, ImageSize size, const std::string& settings)
      : writer_(file, size, settings) {}
  void add_events(std::span<const Event> events) override { writer_.add_events(stamped(events)); }
  void add_frame(const GreyImage&, double time_s, const FlowField*) override {
    end_us_ = microseconds(time_s);
  }
  void commit(const std::function<void()>& before) override { writer_.commit(end_us_, before); }

 private:
  Evt3Writer writer_;
  std::int64_t end_us_ = 0;
};

template <class Output>
std::unique_ptr<RecordingOutput> make(const std::filesystem::path& file, ImageSize size,
                                      const std::string& settings) {
  return std::make_unique<Output>(file, size, settings);
}

std::optional<std::string> mvsec_settings(const std::filesystem::path& file) {
  const Hdf5Lock lock;
  try {
    return read_text_attribute(open_hdf5_file(file), kSettingsAttribute);
  } catch (const Hdf5Error&) {
    return std::nullopt;
  }
}

/// A format, by the extension of its files.
struct OutputFormat {
  std::string_view extension;
  std::unique_ptr<RecordingOutput> (*open)(const std::filesystem::path&, ImageSize,
                                           const std::string&);
  std::optional<std::string> (*settings)(const std::filesystem::path&);
};
constexpr OutputFormat kFormats[] = {{".hdf5", make<MvsecOutput>, mvsec_settings},
                                     {".aedat4", make<Aedat4Output>, aedat4_settings},
                                     {".raw", make<RawOutput>, evt3_settings}};

const OutputFormat& format_of(const std::filesystem::path& file) {
  for (const OutputFormat& format : kFormats) {
    if (file.extension() == format.extension) return format;
  }
  throw std::logic_error("expected .hdf5, .aedat4 or .raw, got " + file.string());
}

}  // namespace

std::unique_ptr<RecordingOutput> open_recording_output(const std::filesystem::path& file,
                                                       ImageSize size,
                                                       const std::string& settings) {
  try {
    return format_of(file).open(file, size, settings);
  } catch (const std::invalid_argument& error) {
    throw UsageError(error.what() + (", in " + file.string()));
  }
}

std::optional<std::string> settings_on_disk(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return std::nullopt;
  require_regular_file(file);
  auto settings = format_of(file).settings(file);
  if (settings) return settings;
  throw InputError(
      "expected no file, or a recording that eventgan simulate has written, got another file, in " +
      file.string() + " (choose another output folder, or remove it yourself)");
}

}  // namespace eventgan
