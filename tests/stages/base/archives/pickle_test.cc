#include "stages/base/archives/pickle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <span>

#include "stages/base/archives/zip_archive.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::ElementsAre;

using Kind = PickleNode::Kind;

PickleDocument unpickled(const std::string& pickle, const std::set<std::string>& allowed = {},
                         std::size_t* used = nullptr) {
  return PickleDocument(std::as_bytes(std::span(pickle)), allowed, "test.pkl", used);
}

std::vector<std::string> text_keys(const std::vector<const PickleNode*>& pairs) {
  std::vector<std::string> keys;
  for (std::size_t i = 0; i < pairs.size(); i += 2) keys.push_back(pairs[i]->text);
  return keys;
}

struct NumberCase {
  std::string opcodes;
  std::int64_t value;
};

TEST(PickleTest, ReadsEveryFormOfInteger) {
  const NumberCase cases[] = {
      {"K\xff"s, 255},
      {"M\x01\x02"s, 0x0201},
      {"J\xff\xff\xff\xff"s, -1},
      {"J\x00\x00\x00\x80"s, std::numeric_limits<std::int32_t>::min()},
      {"I-17\n"s, -17},
      {"L123456789012L\n"s, 123456789012},
      {"\x8a\x00"s, 0},
      {"\x8a\x01\xff"s, -1},
      {"\x8a\x02\xff\x00"s, 255},
      {"\x8a\x08\x00\x00\x00\x00\x00\x00\x00\x80"s, std::numeric_limits<std::int64_t>::min()},
      {"\x8b\x03\x00\x00\x00\x00\x00\x01"s, 0x10000},
  };
  for (const NumberCase& one : cases) {
    const PickleDocument document = unpickled(one.opcodes + ".");
    EXPECT_EQ(document.root().kind, Kind::kInt) << one.value;
    EXPECT_EQ(document.root().integer, one.value);
  }
}

TEST(PickleTest, KeepsTheBytesOfAnIntegerBeyond64Bits) {
  // The magic number of PyTorch's old checkpoints, 0x1950a86a20f9469cfc6c: ten bytes.
  const std::string number = "\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19"s;
  const PickleDocument document = unpickled("\x80\x02\x8a\x0a" + number + ".");
  EXPECT_EQ(document.root().kind, Kind::kLong);
  EXPECT_EQ(document.root().text, number);
}

TEST(PickleTest, ReadsNoneBoolAndFloat) {
  EXPECT_EQ(unpickled("N.").root().kind, Kind::kNone);
  for (const auto& [opcodes, value] :
       {std::pair("\x88."s, 1), {"\x89."s, 0}, {"I01\n."s, 1}, {"I00\n."s, 0}}) {
    const PickleDocument document = unpickled(opcodes);
    EXPECT_EQ(document.root().kind, Kind::kBool);
    EXPECT_EQ(document.root().integer, value);
  }
  // 0x3ff8000000000000 is 1.5: exponent 1023, first bit of the fraction set.
  EXPECT_EQ(unpickled("G\x3f\xf8\x00\x00\x00\x00\x00\x00."s).root().real, 1.5);
  EXPECT_EQ(unpickled("F-0.1\n.").root().real, -0.1);
  EXPECT_TRUE(std::isnan(unpickled("Fnan\n.").root().real));
  EXPECT_EQ(unpickled("F-inf\n.").root().real, -std::numeric_limits<double>::infinity());
}

TEST(PickleTest, ReadsStringsAndBytes) {
  const std::string word = "gr\xc3\xbc\xc3\x9f";  // "grüß", 6 bytes
  for (const std::string& opcodes :
       {"X\x06\x00\x00\x00"s + word, "\x8c\x06"s + word,
        "\x8d\x06\x00\x00\x00\x00\x00\x00\x00"s + word, "Vgr\xfc\\u00df\n"s}) {
    const PickleDocument document = unpickled(opcodes + ".");
    EXPECT_EQ(document.root().kind, Kind::kString);
    EXPECT_EQ(document.root().text, word);
  }
  const std::string raw = "\xff\x00\n"s;
  for (const std::string& opcodes :
       {"B\x03\x00\x00\x00"s + raw, "C\x03"s + raw, "\x8e\x03\x00\x00\x00\x00\x00\x00\x00"s + raw,
        "T\x03\x00\x00\x00"s + raw, "U\x03"s + raw, "S'\\xff\\x00\\n'\n"s}) {
    const PickleDocument document = unpickled(opcodes + ".");
    EXPECT_EQ(document.root().kind, Kind::kBytes);
    EXPECT_EQ(document.root().text, raw);
  }
}

TEST(PickleTest, ReadsContainers) {
  EXPECT_TRUE(unpickled(").").root().items.empty());
  EXPECT_EQ(unpickled("K\x01\x85.").root().items.size(), 1u);
  EXPECT_EQ(unpickled("K\x01K\x02\x86.").root().items.size(), 2u);
  const PickleDocument triple = unpickled("K\x01K\x02K\x03\x87.");
  EXPECT_EQ(triple.root().kind, Kind::kTuple);
  ASSERT_EQ(triple.root().items.size(), 3u);
  EXPECT_EQ(triple.root().items[0]->integer, 1);
  EXPECT_EQ(triple.root().items[2]->integer, 3);
  EXPECT_EQ(unpickled("(K\x01K\x02t.").root().items[1]->integer, 2);

  const PickleDocument list = unpickled(
      "](K\x01K\x02"
      "eK\x03"
      "a.");
  EXPECT_EQ(list.root().kind, Kind::kList);
  ASSERT_EQ(list.root().items.size(), 3u);
  EXPECT_EQ(list.root().items[2]->integer, 3);
  EXPECT_EQ(unpickled("(K\x01l.").root().items.size(), 1u);

  const PickleDocument dict = unpickled(
      "}(U\x01"
      "aK\x01U\x01"
      "bK\x02uU\x01"
      "aK\x03s.");
  EXPECT_EQ(dict.root().kind, Kind::kDict);
  EXPECT_EQ(dict.root().find("a")->integer, 3) << "a later value replaces an earlier one";
  EXPECT_EQ(dict.root().find("b")->integer, 2);
  EXPECT_EQ(dict.root().find("c"), nullptr);
  EXPECT_EQ(unpickled("(S'k'\nI5\nd.").root().find("k")->integer, 5);
}

TEST(PickleTest, SharesWhatTheMemoRecalls) {
  const PickleDocument binary = unpickled("]q\x07h\x07\x86.");
  EXPECT_EQ(binary.root().items[0], binary.root().items[1]);
  const PickleDocument wide = unpickled("]r\x00\x01\x00\x00j\x00\x01\x00\x00\x86."s);
  EXPECT_EQ(wide.root().items[0], wide.root().items[1]);
  const PickleDocument text = unpickled("(lp300\ng300\n\x86.");
  EXPECT_EQ(text.root().items[0], text.root().items[1]);
  const PickleDocument memoized = unpickled("\x80\x04]\x94h\x00\x86."s);
  EXPECT_EQ(memoized.root().items[0], memoized.root().items[1]);
  const PickleDocument doubled = unpickled("]2\x86.");
  EXPECT_EQ(doubled.root().items[0], doubled.root().items[1]);
}

TEST(PickleTest, KeepsCallsAsData) {
  const std::set<std::string> allowed = {"collections.OrderedDict", "torch._utils.f"};
  // OrderedDict() with a["k"] = 1 and a state.
  for (const std::string& global : {"ccollections\nOrderedDict\n"s,
                                    "\x8c\x0b"
                                    "collections\x8c\x0bOrderedDict\x93"s}) {
    for (const char* call : {"R", "\x81"}) {
      const PickleDocument document = unpickled(global + ")" + call + "(U\x01kK\x01u}b.", allowed);
      const PickleNode& root = document.root();
      ASSERT_EQ(root.kind, Kind::kCall);
      EXPECT_EQ(root.items[0]->kind, Kind::kGlobal);
      EXPECT_EQ(root.items[0]->text, "collections.OrderedDict");
      EXPECT_EQ(root.items[1]->kind, Kind::kTuple);
      EXPECT_EQ(root.find("k")->integer, 1);
      ASSERT_NE(root.state, nullptr);
      EXPECT_EQ(root.state->kind, Kind::kDict);
    }
  }
  const PickleDocument storage = unpickled(
      "(U\x07storageU\x01"
      "0tQ.");
  EXPECT_EQ(storage.root().kind, Kind::kPersistent);
  EXPECT_EQ(storage.root().items[0]->items[1]->text, "0");
}

TEST(PickleTest, TellsHowManyBytesItUsedAndListsEveryValue) {
  std::size_t used = 0;
  unpickled("\x80\x02N.and more", {}, &used);
  EXPECT_EQ(used, 4u);
  const PickleDocument document = unpickled("N0K\x07.");
  ASSERT_EQ(document.nodes().size(), 2u);
  EXPECT_EQ(document.nodes()[0].kind, Kind::kNone);
  EXPECT_EQ(&document.nodes()[1], &document.root());
}

TEST(PickleTest, TakesNoMoreMemoryThanAllowed) {
  const std::string pickle = "](NX\x0b\0\0\0"s + std::string(11, 'a') + "e.";
  const auto run = [&](std::uint64_t most) {
    return PickleDocument(std::as_bytes(std::span(pickle)), {}, "test.pkl", nullptr, most);
  };
  const std::uint64_t needed = unpickled(pickle).memory_bytes();
  EXPECT_GT(needed, 3 * sizeof(PickleNode) + 11);
  EXPECT_EQ(run(needed).root().items.size(), 2u);
  EXPECT_THROWS(run(needed - 1), std::runtime_error,
                "expected values of at most 970 bytes of memory, got more");
  EXPECT_THROWS(run(0), std::runtime_error,
                "expected values of at most 0 bytes of memory, got more");
}

TEST(PickleTest, PopTakesOffAValueOrAMark) {
  EXPECT_EQ(unpickled("K\x01K\x02"
                      "0.")
                .root()
                .integer,
            1);
  EXPECT_EQ(unpickled("K\x01(0.").root().integer, 1);
  EXPECT_EQ(unpickled("K\x01(K\x02K\x03"
                      "1.")
                .root()
                .integer,
            1);
}

TEST(PickleTest, ReadsPyTorchCheckpoint) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const ZipArchive archive(data / "golden" / "checkpoint_zip.pt");
  const auto bytes = archive.read("checkpoint_zip/data.pkl");
  const PickleDocument document(bytes,
                                {"collections.OrderedDict", "torch._utils._rebuild_tensor_v2",
                                 "torch.FloatStorage", "torch.LongStorage"},
                                "data.pkl");
  EXPECT_THAT(text_keys(document.root().items),
              ElementsAre("gen", "dis", "optimizer_gen", "epoch", "batch_idx", "batch_size",
                          "dataset_perm", "total_step_count"));
  EXPECT_EQ(document.root().find("dataset_perm")->kind, Kind::kNone);
  const PickleNode* generator = document.root().find("gen");
  ASSERT_NE(generator, nullptr);
  ASSERT_EQ(generator->kind, Kind::kCall);
  ASSERT_NE(generator->state, nullptr) << "state dictionaries carry _metadata";
  EXPECT_NE(generator->state->find("_metadata"), nullptr);

  const PickleNode* mean = generator->find("encoders.0.norm_layer.running_mean");
  ASSERT_NE(mean, nullptr);
  ASSERT_EQ(mean->kind, Kind::kCall);
  EXPECT_EQ(mean->items[0]->text, "torch._utils._rebuild_tensor_v2");
  // (storage, offset, size, stride, requires_grad, hooks); the golden base width is 8, the first
  // encoder has twice as many channels.
  const auto& arguments = mean->items[1]->items;
  ASSERT_EQ(arguments.size(), 6u);
  ASSERT_EQ(arguments[0]->kind, Kind::kPersistent);
  EXPECT_EQ(arguments[0]->items[0]->items[1]->text, "torch.FloatStorage");
  EXPECT_EQ(arguments[2]->items.at(0)->integer, 16);
}

TEST(PickleTest, ReadsDictionaryOfNumpyArrays) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const std::string pickle = testing::read_file(data / "human36m_lists" / "cameras.pkl");
  const PickleDocument document =
      unpickled(pickle, {"numpy.core.multiarray._reconstruct", "numpy.ndarray", "numpy.dtype"});
  // 11 subjects with 4 cameras each.
  ASSERT_EQ(document.root().items.size(), 2 * 44u);
  const PickleNode& key = *document.root().items[0];
  EXPECT_EQ(key.items[0]->text, "S1");
  EXPECT_EQ(key.items[1]->text, "54138969");
  const PickleNode& camera = *document.root().items[1];
  EXPECT_EQ(camera.find("w")->integer, 1000);
  EXPECT_EQ(camera.find("h")->integer, 1002);
  const PickleNode* focal = camera.find("f");
  ASSERT_NE(focal, nullptr);
  ASSERT_NE(focal->state, nullptr);
  EXPECT_EQ(focal->state->items.back()->text.size(), 16u) << "two doubles";
}

}  // namespace
}  // namespace eventgan
