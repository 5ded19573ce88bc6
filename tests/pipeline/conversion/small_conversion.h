#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "pipeline/conversion/convert.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan::testing {

/// A job of 12 frames: 11 pairs in 3 shards, done by the fake generator.
class SmallConversion : public ::testing::Test {
 protected:
  SmallConversion() : manifest_(make_small_job(folder_, 12)) {}

  std::filesystem::path image(int frame) const {
    return folder_ / "clip" / ("f_" + std::to_string(10 + frame) + ".png");
  }

  std::filesystem::path out(const std::string& file, const std::string& output = "out") const {
    return folder_ / output / file;
  }

  /// Options for FOLDER/output.
  ConversionOptions options(const std::string& output = "out", int threads = 2) const {
    ConversionOptions result;
    result.output = folder_ / output;
    result.threads = threads;
    return result;
  }

  ConversionReport run(const ConversionOptions& options) const {
    return convert(manifest_, generator_, "weights", options);
  }
  ConversionReport run(const std::string& output = "out", int threads = 2,
                       bool overwrite = false) const {
    ConversionOptions result = options(output, threads);
    result.overwrite = overwrite;
    return run(result);
  }

  /// Changes the manifest as a user would.
  void change(const std::string& from, const std::string& to) {
    std::string text = manifest_.text;
    text.replace(text.find(from), from.size(), to);
    manifest_ = parse_job_manifest(text, folder_.path(), "manifest.json");
  }

  std::map<std::string, std::string> shards(const std::string& output = "out") const {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / output)) {
      if (entry.path().extension() == ".h5")
        bytes[entry.path().filename()] = read_file(entry.path());
    }
    return bytes;
  }

  /// Everything in the output folder, hidden files too.
  std::vector<std::string> names(const std::string& output = "out") const {
    return names_in(folder_ / output);
  }

  TemporaryFolder folder_;
  JobManifest manifest_;
  FakeGenerator generator_;
};

}  // namespace eventgan::testing
