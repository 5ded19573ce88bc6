#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/checkpoint_archive.h"
#include "tests/stages/generator/checkpoint_bytes.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::LegacyFile;
using testing::pickled_dict;
using testing::pickled_global;
using testing::pickled_integer;
using testing::pickled_integers;
using testing::pickled_tensor;
using testing::pickled_text;
using testing::raw_bytes;

/// A dict with one network `gen` of one tensor `w`.
std::string legacy_generator(const std::string& tensor) {
  return pickled_dict(pickled_text("gen") + pickled_dict(pickled_text("w") + tensor));
}

class LegacyCheckpointFile : public ::testing::Test {
 protected:
  StateDict read(const std::string& bytes) {
    testing::write_file(folder_ / "checkpoint.pt", bytes);
    return read_checkpoint(folder_ / "checkpoint.pt", "gen");
  }

  std::string refusal(const std::string& bytes) {
    try {
      read(bytes);
    } catch (const InputError& error) {
      return error_text(error);
    }
    return "not refused";
  }

  testing::TemporaryFolder folder_;
  const std::vector<testing::LegacyStorage> six_ = {{"0", 6, raw_bytes<float>({0, 1, 2, 3, 4, 5})}};
  const LegacyFile plain_{legacy_generator(pickled_tensor({})), six_};
};

TEST_F(LegacyCheckpointFile, ReadsATensor) {
  const StateDict state = read(plain_.bytes());
  EXPECT_EQ(state.at("w").shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_THAT(state.at("w").values, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(LegacyCheckpointFile, FindsStoragesInTheOrderOfTheListWhateverThatOfTheData) {
  testing::PickledTensor two;
  two.key = "7";
  two.type = "DoubleStorage";
  two.count = 2;
  two.shape = {2};
  two.stride = {1};
  const LegacyFile file(
      pickled_dict(pickled_text("gen") + pickled_dict(pickled_text("a") + pickled_tensor({}) +
                                                      pickled_text("b") + pickled_tensor(two))),
      {{"7", 2, raw_bytes<double>({0.5, -8})}, six_[0]});
  const StateDict state = read(file.bytes());
  EXPECT_THAT(state.at("a").values, ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(state.at("b").values, ElementsAre(0.5f, -8));
}

TEST_F(LegacyCheckpointFile, ReadsAPartOfAStorage) {
  testing::PickledTensor part;
  part.view = testing::pickled_tuple(pickled_text("9") + pickled_integer(2) + pickled_integer(3));
  part.offset = 1;
  part.shape = {2};
  part.stride = {1};
  EXPECT_THAT(read(LegacyFile(legacy_generator(pickled_tensor(part)), six_).bytes()).at("w").values,
              ElementsAre(3, 4));
  part.shape = {3};  // ends beyond the part, though inside the storage
  EXPECT_THAT(refusal(LegacyFile(legacy_generator(pickled_tensor(part)), six_).bytes()),
              HasSubstr("inside its storage of 3 values"));
  part.view = testing::pickled_tuple(pickled_text("9") + pickled_integer(4) + pickled_integer(3));
  EXPECT_THAT(refusal(LegacyFile(legacy_generator(pickled_tensor(part)), six_).bytes()),
              HasSubstr("a part of a storage of 6 values"));
}

TEST_F(LegacyCheckpointFile, ReadsTheTextOfPython2) {
  // SHORT_BINSTRING for every text.
  std::string data = legacy_generator(pickled_tensor({}));
  for (const char* word : {"gen", "w", "storage", "0", "cpu"}) {
    const std::string unicode = pickled_text(word);
    const std::string old = std::string("U") + static_cast<char>(std::string(word).size()) + word;
    for (std::size_t at = data.find(unicode); at != std::string::npos; at = data.find(unicode)) {
      data.replace(at, unicode.size(), old);
    }
  }
  EXPECT_EQ(read(LegacyFile(data, six_).bytes()).count("w"), 1u);
}

TEST_F(LegacyCheckpointFile, RefusesOtherHeads) {
  LegacyFile file = plain_;
  file.magic = pickled_integer(5);
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("PyTorch's magic number"));
  file = plain_;
  file.version = pickled_integer(1000);
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("protocol version 1001, got 1000"));
  file = plain_;
  file.machine = pickled_dict(pickled_text("little_endian") + "\x89");
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("got one of a big-endian machine"));
  file.machine = pickled_dict("");
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("little endian, got none"));
}

TEST_F(LegacyCheckpointFile, RefusesStoragesThatDoNotFit) {
  LegacyFile file = plain_;
  file.storages[0].count = 5;
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("expected 6 values of storage 0"));
  file.storages[0].count = -1;
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("expected 6 values of storage 0"));
  file = plain_;
  file.storages.push_back(file.storages[0]);
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("storage 0 twice"));
  file = plain_;
  file.storages[0].key = "1";
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("a storage that the data names, got key 1"));
  file = plain_;
  file.storages.clear();
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("expected storage 0, got none"));
}

TEST_F(LegacyCheckpointFile, RefusesATensorThatClaimsMoreThanTheFileHas) {
  testing::PickledTensor huge;
  huge.count = 2000000000;
  huge.shape = {2000000000};
  huge.stride = {1};
  LegacyFile file(legacy_generator(pickled_tensor(huge)), six_);
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("expected 2000000000 values of storage 0"));
  file.storages[0].count = 2000000000;
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("24 bytes left"));
}

TEST_F(LegacyCheckpointFile, RefusesEveryCutFileAndOtherGlobalsByName) {
  const std::string bytes = plain_.bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_NE(refusal(bytes.substr(0, size)), "not refused") << size;
  }
  const auto with = [&](const std::string& data) { return LegacyFile(data, six_).bytes(); };
  EXPECT_THAT(refusal(with(pickled_global("os", "system"))), HasSubstr("got \"os.system\""));
  EXPECT_THAT(refusal(with("(ios\nsystem\n")), HasSubstr("got INST"));
  LegacyFile file = plain_;
  file.machine = pickled_global("collections", "OrderedDict");
  EXPECT_THAT(refusal(file.bytes()), HasSubstr("no global"));
}

}  // namespace
}  // namespace eventgan
