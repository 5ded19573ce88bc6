#include "stages/generator/checkpoints/checkpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"
#include "tests/stages/generator/checkpoint_bytes.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::pickled_dict;
using testing::pickled_global;
using testing::pickled_integer;
using testing::pickled_tensor;
using testing::pickled_text;
using testing::PickledTensor;
using testing::raw_bytes;

std::string generator_of(const std::string& tensor) {
  return pickled_dict(pickled_text("gen") + pickled_dict(pickled_text("w") + tensor));
}

class ZipCheckpointFile : public ::testing::Test {
 protected:
  StateDict read(const std::string& pickle, const std::string& storage, bool deflated = false) {
    const auto file = folder_ / "checkpoint.pt";
    testing::write_zip(file, {{"name/data.pkl", testing::whole_pickle(pickle), deflated},
                              {"name/data/0", storage, deflated}});
    return read_checkpoint(file, "gen");
  }

  std::string refusal(const std::string& pickle, const std::string& storage) {
    try {
      read(pickle, storage);
    } catch (const InputError& error) {
      return error_text(error);
    }
    return "not refused";
  }

  testing::TemporaryFolder folder_;
  const std::string floats_ = raw_bytes<float>({0, 1, 2, 3, 4, 5});
};

TEST_F(ZipCheckpointFile, ReadsANamedNetworkOrABareStateDictOfCompressedMembers) {
  auto state = read(generator_of(pickled_tensor({})), floats_);
  EXPECT_EQ(state.at("w").shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_THAT(state.at("w").values, ElementsAre(0, 1, 2, 3, 4, 5));
  state =
      read(pickled_dict(pickled_text("head.conv2d.weight") + pickled_tensor({})), floats_, true);
  EXPECT_EQ(state.count("head.conv2d.weight"), 1u);
}

TEST_F(ZipCheckpointFile, FollowsStridesAndOffset) {
  PickledTensor transposed;
  transposed.offset = 1;
  transposed.shape = {2, 2};
  transposed.stride = {1, 3};  // values 1 + i + 3 j
  const auto state = read(generator_of(pickled_tensor(transposed)), floats_);
  EXPECT_THAT(state.at("w").values, ElementsAre(1, 4, 2, 5));
}

TEST_F(ZipCheckpointFile, ConvertsOtherNumbers) {
  PickledTensor t;
  t.count = 2;
  t.shape = {2};
  t.stride = {1};
  const auto values = [&](const char* storage, const std::string& bytes) {
    t.type = storage;
    return read(generator_of(pickled_tensor(t)), bytes).at("w").values;
  };
  EXPECT_THAT(values("DoubleStorage", raw_bytes<double>({0.5, -2})), ElementsAre(0.5f, -2));
  EXPECT_THAT(values("HalfStorage", raw_bytes<std::uint16_t>({0x3c00, 0xc000})),
              ElementsAre(1, -2));
  // The smallest and the largest number, and infinity.
  EXPECT_THAT(values("HalfStorage", raw_bytes<std::uint16_t>({0x8001, 0x7bff})),
              ElementsAre(-std::ldexp(1.0f, -24), 65504));
  EXPECT_THAT(values("HalfStorage", raw_bytes<std::uint16_t>({0xfc00, 0x7c00})),
              ElementsAre(-INFINITY, INFINITY));
  EXPECT_THAT(values("BFloat16Storage", raw_bytes<std::uint16_t>({0x3f80, 0xc000})),
              ElementsAre(1, -2));
  EXPECT_THAT(values("LongStorage", raw_bytes<std::int64_t>({7, -7})), ElementsAre(7, -7));
}

TEST_F(ZipCheckpointFile, SaysWhichKeysAreThereWhenTheNetworkIsNot) {
  EXPECT_THAT(refusal(pickled_dict(pickled_text("state_dict") + pickled_dict("") +
                                   pickled_text("epoch") + pickled_integer(3)),
                      floats_),
              HasSubstr("got the keys state_dict, epoch"));
}

TEST_F(ZipCheckpointFile, LeavesOutKnownPartsByNameAndRefusesOthers) {
  const auto with = [](const std::string& key, const std::string& value) {
    return pickled_dict(pickled_text("gen") + pickled_dict(pickled_text("w") + pickled_tensor({})) +
                        pickled_text(key) + value);
  };
  const std::string part = pickled_dict(pickled_text("weight") + pickled_tensor({}));
  for (const char* known : {"dis", "flow", "recons", "optimizer_gen", "optimizer_dis"}) {
    EXPECT_EQ(read(with(known, part), floats_).size(), 1u) << known;
  }
  EXPECT_EQ(read(with("total_step_count", pickled_integer(9)), floats_).size(), 1u);
  EXPECT_THAT(refusal(with("gen_second_half", part), floats_),
              HasSubstr("got key 'gen_second_half'"));
}

TEST_F(ZipCheckpointFile, RefusesTensorsOutsideTheirStorage) {
  const auto refused = [&](PickledTensor t) {
    return refusal(generator_of(pickled_tensor(t)), floats_);
  };
  PickledTensor t;
  t.offset = 1;
  EXPECT_THAT(refused(t), HasSubstr("inside its storage"));
  t = {};
  t.shape = {2000000000, 2000000000};
  EXPECT_THAT(refused(t), HasSubstr("inside its storage"));
  t = {};
  t.stride = {3};
  EXPECT_THAT(refused(t), HasSubstr("strides"));
  t = {};
  t.stride = {3, 0};
  EXPECT_THAT(refused(t), HasSubstr("inside its storage"));
  t = {};
  t.key = "1";
  EXPECT_THAT(refused(t), HasSubstr("data/1"));
}

TEST_F(ZipCheckpointFile, RefusesAStorageShorterThanItsCountButNoStrideAlongASideOf1) {
  PickledTensor t;
  t.shape = {1, 6};
  t.stride = {1000000, 1};
  EXPECT_EQ(read(generator_of(pickled_tensor(t)), floats_).at("w").values.size(), 6u);
  t = PickledTensor();
  t.count = 7;
  EXPECT_THAT(refusal(generator_of(pickled_tensor(t)), floats_),
              HasSubstr("expected a storage of 7 values of 4 bytes, got 24 bytes"));
}

TEST_F(ZipCheckpointFile, RefusesTensorsThatShareTheirValuesToFillTheMemory) {
  // A thousand names for one tensor of a million values: 4 GB out of a file of 1 MB.
  PickledTensor t;
  t.type = "ByteStorage";
  t.count = 1 << 20;
  t.shape = {1 << 20};
  t.stride = {1};
  std::string entries = pickled_text("first") + pickled_tensor(t) + "q\x01";
  for (int i = 0; i < 1000; ++i) entries += pickled_text(std::to_string(i)) + "h\x01";
  EXPECT_THAT(refusal(pickled_dict(pickled_text("gen") + pickled_dict(entries)),
                      std::string(1 << 20, '\1')),
              HasSubstr("at most twice the file's size"));
}

TEST_F(ZipCheckpointFile, RefusesAPickleOfTooManyValues) {
  EXPECT_THAT(refusal(std::string(1 << 19, 'N'), floats_), HasSubstr("bytes of memory, got more"));
}

TEST_F(ZipCheckpointFile, ReadsAParameterButNoneInsideAnother) {
  const auto parameter = [](const std::string& inside) {
    return pickled_global("torch._utils", "_rebuild_parameter") +
           testing::pickled_tuple(inside + "\x88)") + "R";
  };
  const std::string once = parameter(pickled_tensor({}));
  EXPECT_EQ(read(generator_of(once), floats_).at("w").values.size(), 6u);
  EXPECT_THAT(refusal(generator_of(parameter(once)), floats_), HasSubstr("expected a tensor"));
}

TEST_F(ZipCheckpointFile, ListsOnlySomeOfManyKeysAndOnlyPrintableText) {
  std::string entries = pickled_integer(1) + "N" + pickled_text("a\nb") + "N";
  for (int i = 0; i < 100; ++i) entries += pickled_text("key" + std::to_string(i)) + "N";
  EXPECT_THAT(refusal(pickled_dict(entries), floats_),
              ::testing::AllOf(HasSubstr("got the keys an integer, a?b, key0"),
                               HasSubstr("key37 and 62 others")));
  EXPECT_THAT(refusal(pickled_dict(""), floats_), HasSubstr("got no keys"));
}

TEST_F(ZipCheckpointFile, RefusesFilesThatAreNoCheckpointAndExecutesNothing) {
  EXPECT_THAT(
      refusal(pickled_global("os", "system") + testing::pickled_tuple(pickled_text("true")) + "R",
              floats_),
      HasSubstr("os.system"));
  testing::write_zip(folder_ / "other.zip", {{"readme.txt", "hello"}});
  EXPECT_THROWS(read_checkpoint(folder_ / "other.zip", "gen"), InputError,
                "expected a PyTorch checkpoint with data.pkl inside");
  EXPECT_THROWS(read_checkpoint(folder_ / "absent.pt", "gen"), InputError,
                "expected a readable file, got 'No such file or directory'");
  EXPECT_THROWS(read_checkpoint(folder_.path(), "gen"), InputError,
                "expected a readable file, got 'Is a directory'");
  testing::write_file(folder_ / "empty.pt", "");
  EXPECT_THROWS(read_checkpoint(folder_ / "empty.pt", "gen"), InputError,
                "expected a PyTorch checkpoint (a zip file or the format");
}

TEST_F(ZipCheckpointFile, NamesTheTarFormat) {
  std::string tar(1024, '\0');
  tar.replace(0, 8, "sys_info");
  tar.replace(257, 5, "ustar");
  testing::write_file(folder_ / "old.pt", tar);
  try {
    read_checkpoint(folder_ / "old.pt", "gen");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error_text(error), HasSubstr("a tar file, the format before PyTorch 0.1.10"));
  }
}

class CheckpointGolden : public ::testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Formats, CheckpointGolden,
                         ::testing::Values("checkpoint_zip.pt", "checkpoint_legacy.pt"),
                         [](const auto& format) {
                           return std::string(format.param).substr(11, 3);
                         });

TEST_P(CheckpointGolden, EqualsTheStateDictOfBothNetworks) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  StateDict state = read_checkpoint(data / "golden" / GetParam(), "gen");
  const auto golden = data / "golden" / "golden.h5";
  const auto names = testing::member_names(golden, "generator/state");
  ASSERT_FALSE(names.empty());
  for (const std::string& name : names) {
    if (name.ends_with("num_batches_tracked")) continue;
    const auto expected = testing::read_array(golden, "generator/state/" + name);
    EXPECT_EQ(state.at(name).values, expected.values) << name;
  }
  state = read_checkpoint(data / "golden" / GetParam(), "dis");
  EXPECT_EQ(state.at("disc.model.0.weight").shape, (std::vector<std::int64_t>{16, 20, 4, 4}));
}

}  // namespace
}  // namespace eventgan
