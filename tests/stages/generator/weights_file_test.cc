#include "stages/generator/weights_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>

#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"
#include "stages/generator/safetensors.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

std::string with_header(const std::string& header, const std::string& data) {
  const std::uint64_t length = header.size();
  std::string bytes(8, '\0');
  std::memcpy(bytes.data(), &length, 8);
  return bytes + header + data;
}

TEST(Safetensors, RoundTrips) {
  const SafetensorsFile content{
      {{"b", {{2, 1}, {1.5f, -2}}}, {"a", {{}, {3}}}, {"empty", {{0, 4}, {}}}},
      {{"format", "x"}, {"note", "\"quoted\" ünicode"}}};
  const std::string bytes = serialize_safetensors(content);
  const SafetensorsFile back = parse_safetensors(bytes, "test");
  EXPECT_EQ(back.metadata, content.metadata);
  ASSERT_EQ(back.tensors.size(), 3u);
  EXPECT_EQ(back.tensors.at("b").shape, (std::vector<std::int64_t>{2, 1}));
  EXPECT_EQ(back.tensors.at("b").values, (std::vector<float>{1.5f, -2}));
  EXPECT_EQ(back.tensors.at("a").values, std::vector<float>{3});
  EXPECT_EQ(serialize_safetensors(back), bytes);
}

TEST(Safetensors, HeaderIsAlignedAndTensorsHaveNoHoles) {
  const std::string bytes = serialize_safetensors({{{"t", {{1}, {1}}}}, {}});
  std::uint64_t length = 0;
  std::memcpy(&length, bytes.data(), 8);
  EXPECT_EQ(length % 8, 0u);
  EXPECT_EQ(bytes.size(), 8 + length + 4);
}

TEST(Safetensors, RefusesMalformedFiles) {
  const std::string data(4, '\0');
  const auto tensor = [](const std::string& dtype, const std::string& shape,
                         const std::string& offsets) {
    return R"({"t":{"dtype":")" + dtype + R"(","shape":)" + shape + R"(,"data_offsets":)" +
           offsets + "}}";
  };
  const std::string bad[] = {
      "",
      "1234567",
      std::string(8, '\xff'),
      with_header("{", ""),
      with_header("[]", "") + "x",
      with_header(tensor("F64", "[1]", "[0,4]"), data),
      with_header(tensor("F32", "[2]", "[0,4]"), data),
      with_header(tensor("F32", "[1]", "[4,8]"), data),
      with_header(R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4],"shape":[1]}})", data),
      with_header(tensor("F32", "[1]", "[4,0]"), data),
      with_header(tensor("F32", "[-1]", "[0,4]"), data),
      with_header(tensor("F32", "[1.5]", "[0,4]"), data),
      with_header(tensor("F32", "[true]", "[0,4]"), data),
      with_header(tensor("F32", "[1]", "[0,4,4]"), data),
      with_header(tensor("F32", "[0,9223372036854775808]", "[0,0]"), ""),
      with_header(tensor("F32", "[4611686018427387904,4]", "[0,4]"), data),
      with_header(tensor("F32", "[1]", "[0,4]"), data + "tail"),
      with_header(tensor("F32", "\"x\"", "[0,4]"), data),
  };
  for (const std::string& bytes : bad) {
    EXPECT_THROWS(parse_safetensors(bytes, "test"), std::runtime_error, "expected")
        << bytes.substr(8 < bytes.size() ? 8 : 0);
  }
}

TEST(Safetensors, RefusesHeadersThatWouldGrow) {
  const auto message = [](const std::string& bytes) -> std::string {
    try {
      parse_safetensors(bytes, "test");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "not refused";
  };
  EXPECT_THAT(message(with_header(R"({"a":)" + std::string(1 << 19, '['), "")),
              ::testing::HasSubstr("levels of nesting"));
  EXPECT_THAT(message(with_header(std::string((8 << 20) + 1, '{'), "")),
              ::testing::HasSubstr("at most 8388608 bytes"));
  EXPECT_THAT(message(with_header(" {}", "")), ::testing::HasSubstr("begins with {"));
}

TEST(Safetensors, WritesTensorsThatAreElsewhereAndSaysWhichFileIsMissing) {
  const std::vector<float> values = {1, 2};
  EXPECT_EQ(serialize_safetensors({{"a", {{2}, values}}}, {{"k", "v"}}),
            serialize_safetensors({{{"a", {{2}, values}}}, {{"k", "v"}}}));
  EXPECT_THROWS(read_safetensors("/nowhere/w.safetensors"), std::runtime_error,
                "/nowhere/w.safetensors");
}

TEST(WeightsFile, RoundTripsAndParsesBytes) {
  const testing::TemporaryFolder folder;
  Weights weights = untrained_weights(2, 9, 3);
  weights.metadata["origin_sha256"] = "abc";
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  const Weights back = read_weights(folder / "w.safetensors");
  EXPECT_EQ(back.base_channels, 2);
  EXPECT_EQ(back.bins, 9);
  EXPECT_EQ(back.metadata, weights.metadata);
  EXPECT_EQ(serialize_weights(back), serialize_weights(weights));
  const std::string bytes = serialize_weights(untrained_weights(1, 9, 3));
  EXPECT_EQ(serialize_weights(parse_weights(bytes, "NAME")), bytes);
  EXPECT_THROWS(parse_weights(bytes.substr(1), "NAME"), InputError,
                "expected a header inside the file, got a length of");
}

TEST(WeightsFile, TellsWhatGapsItWasTrainedOn) {
  Weights weights = untrained_weights(1, 9, 3);
  const auto written_and_read = [&] { return parse_weights(serialize_weights(weights), "NAME"); };
  EXPECT_EQ(written_and_read().training_gaps, std::nullopt);
  weights.training_gaps = GapRange{1, 5};
  EXPECT_EQ(written_and_read().training_gaps, (GapRange{1, 5}));
  EXPECT_EQ(parse_safetensors(serialize_weights(weights), "").metadata.at("training_gaps"), "1-5");
  for (const char* wrong : {"", "5", "1-", "-5", "0-5", "3-2", "1-5x", "1..5", "1-99999999999"}) {
    SafetensorsFile content = parse_safetensors(serialize_weights(weights), "");
    content.metadata["training_gaps"] = wrong;
    EXPECT_THROWS(parse_weights(serialize_safetensors(content), "NAME"), InputError,
                  "expected metadata training_gaps FIRST-LAST such as 1-5")
        << wrong;
  }
}

TEST(WeightsFile, TakesTheGapsOfAnEarlierFileFromItsTrainingManifest) {
  Weights weights = untrained_weights(1, 9, 3);
  weights.metadata["training_manifest"] = R"({
    "format": "eventgan-training", "version": 1, "name": "t",
    "recordings": [{ "path": "r.hdf5", "format": "mvsec" }],
    "gaps": [4, 2], "steps": { "flow": 1, "reconstruction": 1, "generator": 1 }, "output": { "directory": "out" } })";
  EXPECT_EQ(parse_weights(serialize_weights(weights), "NAME").training_gaps, (GapRange{2, 4}));
  weights.metadata["training_manifest"] = "gaps: 2, 4";
  EXPECT_EQ(parse_weights(serialize_weights(weights), "NAME").training_gaps, std::nullopt);
}

TEST(WeightsFile, TellsWhatThresholdsItKnows) {
  Weights weights = testing::untrained_sensor_weights(2, 3, 1);
  for (const ThresholdRange range : {ThresholdRange{0.1, 0.4},
                                     {0.2, 0.2},
                                     {0.0675, 0.88},
                                     {1e-7, 1.0 / 3},
                                     {0.1 * 0.7, 1234.5}}) {
    weights.thresholds = range;
    const std::string bytes = serialize_weights(weights);
    const Weights back = parse_weights(bytes, "NAME");
    EXPECT_EQ(back.thresholds, range);
    EXPECT_EQ(back.convolutions.front().in_channels, 3);
    EXPECT_EQ(back.metadata, weights.metadata);
    EXPECT_EQ(serialize_weights(back), bytes);
  }
  weights.thresholds = ThresholdRange{0.1, 0.4};
  EXPECT_EQ(parse_safetensors(serialize_weights(weights), "").metadata.at("thresholds"), "0.1-0.4");
  EXPECT_EQ(parse_weights(serialize_weights(untrained_weights(1, 9, 3)), "NAME").thresholds,
            std::nullopt);
}

TEST(WeightsFile, RefusesThresholdsThatAreNoneOrOfANetworkOfOtherInputs) {
  SafetensorsFile content =
      parse_safetensors(serialize_weights(testing::untrained_sensor_weights(1, 3, 1)), "");
  for (const char* wrong : {"", "some", "0.1", "0.1-", "-0.4", "0.4-0.1", "0-0.4", "-0.1-0.4",
                            "0.1--0.4", "nan-0.4", "0.1-nan", "0.1-inf", "inf-inf", "0.1-0.4x",
                            " 0.1-0.4", "0.1..0.4", "0.1-1e400", "0.1-1e6"}) {
    content.metadata["thresholds"] = wrong;
    EXPECT_THROWS(parse_weights(serialize_safetensors(content), "NAME"), InputError,
                  "expected metadata thresholds LOWEST-HIGHEST such as")
        << wrong;
  }
  content.metadata.erase("thresholds");
  EXPECT_THROWS(parse_weights(serialize_safetensors(content), "NAME"), InputError,
                "expected another shape of tensor head.weight");
  content = parse_safetensors(serialize_weights(untrained_weights(1, 3, 1)), "");
  content.metadata["thresholds"] = "0.1-0.4";
  EXPECT_THROWS(parse_weights(serialize_safetensors(content), "NAME"), InputError,
                "expected another shape of tensor head.weight");
}

TEST(WeightsFile, SaysOfAPyTorchCheckpointHowItIsImported) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path file = folder / "EventGAN.pt";
  const std::string advice = "run `eventgan import-weights \"" + file.string() + "\" \"" +
                             (folder / "EventGAN.safetensors").string() + "\"`";
  // The beginnings of torch.save's files: since version 1.6, before that, and of a plain pickle.
  for (const std::string& start : {std::string("PK\3\4\0\0\10\10\0\0", 10),
                                   std::string("\200\2\212\12l\374\234F\371 j\250P\31.", 15),
                                   std::string("\200\2}q\0X\3\0\0\0gen", 13)}) {
    testing::write_file(file, start);
    try {
      read_weights(file);
      FAIL() << "expected an error";
    } catch (const InputError& error) {
      EXPECT_THAT(error_text(error), ::testing::HasSubstr(advice));
    }
  }
  // 640 bytes of header, which begins as a pickle does: no checkpoint.
  testing::write_file(file, std::string("\200\2\0\0\0\0\0\0{", 9));
  try {
    read_weights(file);
    FAIL() << "expected an error";
  } catch (const InputError& error) {
    EXPECT_THAT(error_text(error), ::testing::Not(::testing::HasSubstr("PyTorch")));
  }
}

TEST(WeightsFile, RefusesOtherSafetensorsAndMissingFiles) {
  const testing::TemporaryFolder folder;
  SafetensorsFile content =
      parse_safetensors(serialize_weights(untrained_weights(1, 9, 3)), "test");
  const std::pair<void (*)(SafetensorsFile&), const char*> cases[] = {
      {[](SafetensorsFile& one) { one.metadata["format"] = "other"; },
       "expected metadata format eventgan-generator version 1, got \"other\""},
      {[](SafetensorsFile& one) { one.metadata["base_channels"] = "2"; },
       "expected another shape of tensor head.weight"},
      {[](SafetensorsFile& one) { one.metadata["base_channels"] = "-1"; },
       "expected metadata base_channels in 1..1024, got \"-1\""},
      {[](SafetensorsFile& one) { one.tensors.erase("pred.bias"); },
       "expected tensor pred.bias, got none"},
      {[](SafetensorsFile& one) {
         one.tensors["extra"] = {{1}, {0}};
       },
       "expected no other tensors, got extra"},
      {[](SafetensorsFile& one) { one.tensors["pred.bias"].values[0] = 1.0f / 0.0f; },
       "expected finite numbers, got NaN or infinity in pred"},
      {[](SafetensorsFile& one) { one.tensors["pred.bias"].values[0] = std::nanf(""); },
       "expected finite numbers, got NaN or infinity in pred"}};
  for (const auto& [change, words] : cases) {
    auto changed = content;
    change(changed);
    testing::write_file(folder / "w.safetensors", serialize_safetensors(changed));
    EXPECT_THROWS(read_weights(folder / "w.safetensors"), InputError, words);
  }
  EXPECT_THROWS(read_weights(folder / "none.safetensors"), InputError,
                "expected a readable file, got 'No such file or directory'");
}

Weights calibrated_weights() {
  Weights weights = untrained_weights(2, 9, 3);
  weights.calibration = std::make_shared<const Calibration>(testing::sample_calibration(2, 1));
  return weights;
}

TEST(CalibrationFields, RoundTrip) {
  const Weights weights = calibrated_weights();
  const std::string bytes = serialize_weights(weights);
  const Weights back = parse_weights(bytes, "NAME");
  ASSERT_NE(back.calibration, nullptr);
  EXPECT_EQ(back.metadata, weights.metadata);
  EXPECT_EQ(back.calibration->pairs, weights.calibration->pairs);
  EXPECT_EQ(back.calibration->origin, weights.calibration->origin);
  ASSERT_EQ(back.calibration->tensors.size(), weights.calibration->tensors.size());
  for (std::size_t i = 0; i < back.calibration->tensors.size(); ++i) {
    const TensorStatistics& got = back.calibration->tensors[i];
    const TensorStatistics& wanted = weights.calibration->tensors[i];
    EXPECT_EQ(got.name, wanted.name);
    EXPECT_EQ(got.highest, wanted.highest);
    EXPECT_EQ(got.mean, wanted.mean);
    EXPECT_EQ(got.offset, wanted.offset);
    EXPECT_EQ(got.mixing, wanted.mixing);
  }
  EXPECT_EQ(serialize_weights(back), bytes);
}

TEST(CalibrationFields, AreAbsentWithoutACalibration) {
  const std::string bytes = serialize_weights(untrained_weights(2, 9, 3));
  EXPECT_EQ(bytes.find("calibration"), std::string::npos);
  EXPECT_EQ(parse_weights(bytes, "NAME").calibration, nullptr);
}

TEST(CalibrationFields, RefuseHalfACalibration) {
  const SafetensorsFile whole = parse_safetensors(serialize_weights(calibrated_weights()), "test");
  const auto refused = [](const SafetensorsFile& changed, const std::string& words) {
    EXPECT_THROWS(parse_weights(serialize_safetensors(changed), "NAME"), InputError, words);
  };
  for (const auto& [key, words] :
       {std::pair("calibration.pairs", "expected no other tensors, got calibration.decoders"),
        {"calibration.origin", "expected metadata calibration.origin, got none"}}) {
    SafetensorsFile changed = whole;
    changed.metadata.erase(key);
    refused(changed, words);
  }
  for (const std::string pairs : {"0", "-3", "", "many", "1.5", "99999999999"}) {
    SafetensorsFile changed = whole;
    changed.metadata["calibration.pairs"] = pairs;
    refused(changed, "expected metadata calibration.pairs in 1..2147483647, got \"" + pairs + '"');
  }
  for (const std::string tensor :
       {"calibration.head.mixing", "calibration.resblocks.0.mean", "calibration.decoders.2.highest",
        "calibration.encoders.3.offset"}) {
    SafetensorsFile changed = whole;
    changed.tensors.erase(tensor);
    refused(changed, "expected tensor " + tensor + ", got none");
    changed.tensors[tensor] = {{1}, {0}};
    refused(changed, "expected another shape of tensor " + tensor);
    changed = whole;
    changed.tensors[tensor].values[0] = std::nanf("");
    refused(changed, "expected finite numbers for ");
  }
  SafetensorsFile changed = whole;
  changed.tensors["calibration.resblocks.0.mixing"] = {{1}, {0}};
  refused(changed, "expected no other tensors, got calibration.resblocks.0.mixing");
  changed = whole;
  changed.tensors["calibration.head.highest"].values[1] = -1;
  refused(changed, "expected a highest value and a mean of at least 0 for head, got a negative");
}

std::filesystem::path repository_file(int width) {
  const std::string name = width == kSensorWeights ? "sensor" : std::to_string(width);
  return std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "weights" /
         ("eventgan-" + name + ".safetensors");
}

std::vector<int> widths_and_sensor() {
  std::vector<int> widths = shipped_widths();
  if (std::filesystem::exists(repository_file(kSensorWeights))) widths.push_back(kSensorWeights);
  return widths;
}

TEST(ShippedWeights, AreTheRepositorysFilesOfTheirWidth) {
  for (const int width : widths_and_sensor()) {
    const auto bytes = shipped_weights_bytes(width);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_TRUE(text == testing::read_file(repository_file(width))) << width;
  }
  for (const int width : shipped_widths()) {
    const Weights weights = read_shipped_weights(width);
    EXPECT_EQ(weights.base_channels, width);
    EXPECT_EQ(weights.bins, 9);
    EXPECT_EQ(weights.training_gaps, (GapRange{1, 6}));  // manifests/weights/train-8.json
  }
  EXPECT_THROWS(shipped_weights_bytes(7777), InputError,
                "expected a base width of the shipped weights (8, 16)");
  EXPECT_THROWS(read_shipped_weights(-8), InputError,
                "expected a base width of the shipped weights (8, 16)");
}

TEST(ShippedWeights, AreAllThatTheRepositoryHas) {
  std::size_t files = 0;
  const std::filesystem::path folder = repository_file(1).parent_path();
  if (std::filesystem::is_directory(folder)) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() == ".safetensors") ++files;
    }
  }
  EXPECT_EQ(widths_and_sensor().size(), files);
  EXPECT_TRUE(std::ranges::is_sorted(shipped_widths()));
}

TEST(ShippedWeights, HaveASetThatKnowsItsSensor) {
  if (widths_and_sensor() == shipped_widths()) GTEST_SKIP() << "not shipped";
  const Weights weights = read_shipped_weights(kSensorWeights);
  ASSERT_TRUE(weights.thresholds.has_value());
  // What manifests/weights/README.md and the examples tell it.
  EXPECT_TRUE(weights.thresholds->contains(0.15) && weights.thresholds->contains(0.6));
  EXPECT_NE(weights.calibration, nullptr);
}

TEST(ShippedWeights, TheDefaultIsTheLargestOfAtMost16) {
  int expected = 0;
  for (const int width : shipped_widths()) {
    if (width <= 16) expected = std::max(expected, width);
  }
  if (expected == 0) {
    EXPECT_THROWS(default_shipped_width(), InputError, "expected shipped weights of a base width");
  } else {
    EXPECT_EQ(default_shipped_width(), expected);
  }
}

}  // namespace
}  // namespace eventgan
