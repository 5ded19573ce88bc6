#include "stages/generator/checkpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "manifests/faults.h"
#include "pipeline/errors/error_text.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

// Pickle opcodes of protocol 2, as Python's pickletools names them.
std::string text(const std::string& value) {  // BINUNICODE
  std::string op = "X    ";
  const std::uint32_t size = value.size();
  std::memcpy(op.data() + 1, &size, 4);
  return op + value;
}
std::string integer(std::int32_t value) {  // BININT
  std::string op = "J    ";
  std::memcpy(op.data() + 1, &value, 4);
  return op;
}
std::string global(const std::string& module, const std::string& name) {
  return "c" + module + "\n" + name + "\n";
}
std::string tuple(const std::string& items) { return "(" + items + "t"; }
std::string integers(const std::vector<int>& values) {
  std::string items;
  for (const int value : values) items += integer(value);
  return tuple(items);
}
std::string dict(const std::string& entries) { return "}(" + entries + "u"; }
const std::string kStart = "\x80\x02";

struct TensorText {
  std::string storage = "FloatStorage";
  std::string key = "0";
  int offset = 0;
  std::vector<int> shape = {2, 3};
  std::vector<int> stride = {3, 1};
};

std::string tensor(const TensorText& t) {
  const std::string id =
      tuple(text("storage") + global("torch", t.storage) + text(t.key) + text("cpu") + integer(6));
  return global("torch._utils", "_rebuild_tensor_v2") +
         tuple(id + "Q" + integer(t.offset) + integers(t.shape) + integers(t.stride) + "\x89" +
               global("collections", "OrderedDict") + ")R") +
         "R";
}

template <class T>
std::string raw(std::initializer_list<T> values) {
  return {reinterpret_cast<const char*>(values.begin()), values.size() * sizeof(T)};
}

class Checkpoint : public ::testing::Test {
 protected:
  StateDict read(const std::string& pickle, const std::string& storage, bool deflated = false) {
    const auto file = folder_ / "checkpoint.pt";
    testing::write_zip(file, {{"name/data.pkl", kStart + pickle + ".", deflated},
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
  const std::string floats_ = raw<float>({0, 1, 2, 3, 4, 5});
};

TEST_F(Checkpoint, ReadsATensorOfANamedNetwork) {
  const auto state = read(dict(text("gen") + dict(text("w") + tensor({}))), floats_);
  EXPECT_EQ(state.at("w").shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_THAT(state.at("w").values, ::testing::ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(Checkpoint, ReadsABareStateDictAndCompressedMembers) {
  const auto state = read(dict(text("head.conv2d.weight") + tensor({})), floats_, true);
  EXPECT_EQ(state.count("head.conv2d.weight"), 1u);
}

TEST_F(Checkpoint, FollowsStridesAndOffset) {
  TensorText transposed;
  transposed.offset = 1;
  transposed.shape = {2, 2};
  transposed.stride = {1, 3};  // values 1 + i + 3 j
  const auto state = read(dict(text("gen") + dict(text("w") + tensor(transposed))), floats_);
  EXPECT_THAT(state.at("w").values, ::testing::ElementsAre(1, 4, 2, 5));
}

TEST_F(Checkpoint, ConvertsOtherNumbers) {
  TensorText t;
  t.shape = {2};
  t.stride = {1};
  const auto values = [&](const char* storage, const std::string& bytes) {
    t.storage = storage;
    return read(dict(text("gen") + dict(text("w") + tensor(t))), bytes).at("w").values;
  };
  EXPECT_THAT(values("DoubleStorage", raw<double>({0.5, -2})), ::testing::ElementsAre(0.5f, -2));
  EXPECT_THAT(values("HalfStorage", raw<std::uint16_t>({0x3c00, 0xc000})),
              ::testing::ElementsAre(1, -2));
  EXPECT_THAT(values("LongStorage", raw<std::int64_t>({7, -7})), ::testing::ElementsAre(7, -7));
}

TEST_F(Checkpoint, SaysWhichKeysAreThereWhenTheNetworkIsNot) {
  EXPECT_THAT(refusal(dict(text("state_dict") + dict("") + text("epoch") + integer(3)), floats_),
              ::testing::HasSubstr("got the keys state_dict, epoch"));
}

TEST_F(Checkpoint, RefusesTensorsOutsideTheirStorage) {
  const auto refused = [&](TensorText t) {
    return refusal(dict(text("gen") + dict(text("w") + tensor(t))), floats_);
  };
  TensorText t;
  t.offset = 1;
  EXPECT_THAT(refused(t), ::testing::HasSubstr("inside its storage"));
  t = {};
  t.shape = {2000000000, 2000000000};
  EXPECT_THAT(refused(t), ::testing::HasSubstr("inside its storage"));
  t = {};
  t.stride = {3};
  EXPECT_THAT(refused(t), ::testing::HasSubstr("strides"));
  t = {};
  t.stride = {3, 0};
  EXPECT_THAT(refused(t), ::testing::HasSubstr("inside its storage"));
  t = {};
  t.key = "1";
  EXPECT_THAT(refused(t), ::testing::HasSubstr("data/1"));
}

TEST_F(Checkpoint, ExecutesNothing) {
  EXPECT_THAT(refusal(global("os", "system") + tuple(text("true")) + "R", floats_),
              ::testing::HasSubstr("os.system"));
}

TEST_F(Checkpoint, RefusesFilesThatAreNoCheckpoint) {
  testing::write_zip(folder_ / "other.zip", {{"readme.txt", "hello"}});
  EXPECT_THROW(read_checkpoint(folder_ / "other.zip", "gen"), InputError);
  EXPECT_THROW(read_checkpoint(folder_ / "absent.pt", "gen"), InputError);
}

TEST(CheckpointGolden, EqualsTheStateDict) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const StateDict state = read_checkpoint(data / "golden" / "checkpoint_zip.pt", "gen");
  const auto golden = data / "golden" / "golden.h5";
  const auto names = testing::member_names(golden, "generator/state");
  ASSERT_FALSE(names.empty());
  for (const std::string& name : names) {
    if (name.ends_with("num_batches_tracked")) continue;
    const auto expected = testing::read_array(golden, "generator/state/" + name);
    EXPECT_EQ(state.at(name).values, expected.values) << name;
  }
}

}  // namespace
}  // namespace eventgan
