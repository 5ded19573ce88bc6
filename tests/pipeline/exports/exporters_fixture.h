#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/dataset/finalize.h"
#include "pipeline/exports/export_job.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/shards/codec/quantization.h"
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan::testing {

// What the tests of exporters export: the split "val" of ConvertedFolder, which is example_shard:
// volumes [4, 6, 8], of images twice their size.

inline constexpr char kManifest[] = R"({
  "format": "eventgan-manifest", "version": 1, "name": "demo",
  "sources": [{"dataset": "kitti_object", "root": "kitti",
               "pairs": {"gaps": [2], "side": "before", "choose": "one"}}],
  "image": {"preset": "kitti"}, "generator": {"weights": "untrained:2"},
  "output": {"directory": "out", "samples_per_shard": 5}})";
inline constexpr std::size_t kChannels = 4;
inline constexpr std::size_t kPixels = 6 * 8;
inline constexpr int kLevel = 100;
inline constexpr float kTimes = 8;

inline std::vector<double> numbers(const TypedArray& array) {
  std::vector<double> values;
  for (std::size_t i = 0; i < array.size(); ++i) values.push_back(array.number(i));
  return values;
}

inline TypedArray npy(const std::filesystem::path& file) {
  const std::string bytes = read_file(file);
  return parse_npy(std::as_bytes(std::span(bytes)), file.string());
}

/// Columns of a list of records: [column][row].
inline std::vector<std::vector<double>> records(std::span<const std::byte> bytes,
                                                const std::vector<std::string>& columns) {
  std::vector<std::vector<double>> values;
  const std::vector<NamedArray> fields = parse_npy_fields(bytes, "records");
  for (const std::string& column : columns) {
    const auto field = std::ranges::find(fields, column, &NamedArray::name);
    values.push_back(field == fields.end() ? std::vector<double>() : numbers(field->values));
  }
  return values;
}

inline std::vector<std::vector<double>> records(const std::filesystem::path& file,
                                                const std::vector<std::string>& columns) {
  const std::string bytes = read_file(file);
  return records(std::as_bytes(std::span(bytes)), columns);
}

/// The content of a file within a tar.
inline std::string tar_content(const std::filesystem::path& tar, const std::string& name) {
  constexpr std::size_t kBlock = 512, kSizeAt = 124;
  const std::string bytes = read_file(tar);
  for (std::size_t at = 0; at + kBlock <= bytes.size() && bytes[at] != '\0';) {
    const std::size_t size = std::stoul(bytes.substr(at + kSizeAt, 11), nullptr, 8);
    if (name == bytes.c_str() + at) return bytes.substr(at + kBlock, size);
    at += kBlock + (size + kBlock - 1) / kBlock * kBlock;
  }
  return "";
}

class Exporters : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    converted_ = std::make_unique<ConvertedFolder>(0);
    for (int shard = 0; shard < 4; ++shard) {
      converted_->add(shard,
                      [](ExampleShard& example) { example.header.manifest_text = kManifest; });
    }
    finalize(converted_->path(), {});
  }
  static void TearDownTestSuite() { converted_.reset(); }

  /// Into folder_ / word.
  ExportReport reported(std::string_view word, ExportOptions options = {},
                        const ConvertedFolder& converted = *converted_) {
    options.to = &*std::ranges::find(export_formats(), word, &ExportFormat::word);
    options.out = folder_ / std::string(word);
    options.splits = {"val"};
    if (word != "webdataset" || options.representation) options.counts = EventCounts::kRounded;
    options.threads = 2;
    return run_export(converted.path(), options);
  }

  /// The export's folder.
  std::filesystem::path exported(std::string_view word, const ExportOptions& options = {},
                                 const ConvertedFolder& converted = *converted_) {
    return reported(word, options, converted).folder;
  }

  /// The same of samples of kTimes as many events whose frames are there, kLevel all over, and as
  /// large as the volumes.
  std::filesystem::path exported_with_frames(std::string_view word) {
    // No still, which would be moved again.
    ConvertedFolder converted(0);
    for (int shard = 0; shard < 4; ++shard) {
      converted.add(shard, [](ExampleShard& example) {
        example.header.manifest_text = kManifest;
        for (std::vector<float>& volume : example.volumes) {
          for (float& value : volume) value *= kTimes;
        }
        for (ShardSample& sample : example.samples) {
          sample.source_size = {6, 8};
          sample.pair.previous.video_frame = sample.pair.next.video_frame = FrameRef().video_frame;
          if (!sample.pair.motion) continue;
          sample.pair.motion.reset();
          sample.pair.previous.path = "kitti/prev_2/000004_02.png";
        }
      });
    }
    finalize(converted.path(), {});
    ExportOptions options;
    options.frames = folder_ / "frames";
    for (const char* image :
         {"prev_2/000000_02", "image_2/000000", "prev_2/000001_02", "image_2/000001",
          "prev_2/000003_02", "image_2/000003", "prev_2/000004_02", "image_2/000004"}) {
      write_flat_image(options.frames / "kitti" / (std::string(image) + ".png"), {6, 8}, kLevel);
    }
    return exported(word, options, converted);
  }

  /// The volume of a sample, [kChannels * kPixels].
  static const std::vector<float>& volume(std::size_t slot) {
    static const ExampleShard kShard = example_shard();
    return kShard.volumes[slot];
  }

  /// As the shard stores it, in a .npy file.
  static std::string stored_volume(std::size_t slot) {
    std::vector<std::uint16_t> halves(volume(slot).size());
    to_halves(volume(slot), halves.data());
    return npy_file("<f2", {kChannels, 6, 8}, halves);
  }

  /// Its values, channels last.
  static std::vector<double> channels_last(std::size_t slot, auto&& value_of) {
    std::vector<double> values;
    for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
      for (std::size_t channel = 0; channel < kChannels; ++channel) {
        values.push_back(value_of(volume(slot)[channel * kPixels + pixel]));
      }
    }
    return values;
  }

  /// Of a volume whose values are rounded to counts, the positive channels first.
  static std::int64_t event_count(std::size_t slot, float times = 1) {
    std::int64_t count = 0;
    for (const float value : volume(slot)) count += std::lround(times * value);
    return count;
  }

  TemporaryFolder folder_;
  static inline std::unique_ptr<ConvertedFolder> converted_;
};

}  // namespace eventgan::testing
