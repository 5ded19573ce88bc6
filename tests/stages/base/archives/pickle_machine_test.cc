#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <span>
#include <stdexcept>

#include "stages/base/archives/detail/pickle_cursor.h"
#include "stages/base/archives/pickle.h"
#include "tests/testing/texts.h"

// Pickles that no honest writer makes: each is refused with a message, whatever it says.

namespace eventgan {
namespace {

using namespace std::string_literals;

TEST(PickleLiteralsTest, Integers) {
  EXPECT_EQ(parse_pickle_integer("0"), 0);
  EXPECT_EQ(parse_pickle_integer("-9223372036854775808"), INT64_MIN);
  EXPECT_EQ(parse_pickle_integer("12L"), 12);
  for (const char* bad : {"", "L", "-", "1.5", "0x10", " 1", "1 ", "12LL", "9223372036854775808"}) {
    EXPECT_EQ(parse_pickle_integer(bad), std::nullopt) << bad;
  }
}

TEST(PickleLiteralsTest, Floats) {
  EXPECT_EQ(parse_pickle_float("1e-3"), 1e-3);
  EXPECT_EQ(parse_pickle_float("0.1"), 0.1);
  EXPECT_EQ(parse_pickle_float("inf"), INFINITY);
  EXPECT_TRUE(std::isnan(parse_pickle_float("nan").value()));
  for (const char* bad : {"", "1,5", "one", "1.5x"}) {
    EXPECT_EQ(parse_pickle_float(bad), std::nullopt) << bad;
  }
}

TEST(PickleLiteralsTest, ByteStrings) {
  EXPECT_EQ(parse_pickle_string("''"), "");
  EXPECT_EQ(parse_pickle_string("\"it's\""), "it's");
  EXPECT_EQ(parse_pickle_string(R"('a\'b\\c\n\t\x00\xfF')"), "a'b\\c\n\t\x00\xff"s);
  for (const char* bad : {"", "'", "'x", "x'", "'x\"", "'\\'", "'\\x1'", "'\\xg0'", "'\\q'"}) {
    EXPECT_EQ(parse_pickle_string(bad), std::nullopt) << bad;
  }
}

TEST(PickleLiteralsTest, UnicodeStrings) {
  EXPECT_EQ(parse_pickle_unicode(""), "");
  EXPECT_EQ(parse_pickle_unicode("plain \\n stays"), "plain \\n stays");
  EXPECT_EQ(parse_pickle_unicode("\xe9"), "\xc3\xa9");                 // Latin-1 e acute
  EXPECT_EQ(parse_pickle_unicode("\\u20ac!"), "\xe2\x82\xac!");        // euro sign
  EXPECT_EQ(parse_pickle_unicode("\\U0001F600"), "\xf0\x9f\x98\x80");  // grinning face
  for (const char* bad : {"\\u12", "\\u12g4", "\\U0001F60", "\\ud800", "\\U00110000"}) {
    EXPECT_EQ(parse_pickle_unicode(bad), std::nullopt) << bad;
  }
}

PickleDocument run(const std::string& pickle, const std::set<std::string>& allowed = {}) {
  return PickleDocument(std::as_bytes(std::span(pickle)), allowed, "evil.pkl");
}

struct Refusal {
  std::string pickle;
  std::string why;
};

void expect_refused(const Refusal& one, const std::set<std::string>& allowed = {}) {
  EXPECT_THROWS(run(one.pickle, allowed), std::runtime_error, one.why, "in evil.pkl at byte ")
      << ::testing::PrintToString(one.pickle);
}

TEST(PickleMachineTest, RefusesGlobalsByName) {
  const std::set<std::string> allowed = {"collections.OrderedDict"};
  expect_refused({"cos\nsystem\n(S'true'\ntR.", "{collections.OrderedDict}, got \"os.system\""},
                 allowed);
  expect_refused({"\x80\x04\x8c\x02os\x8c\x06system\x93.", "got \"os.system\""}, allowed);
  expect_refused({"c__builtin__\neval\n.", "expected no global, got \"__builtin__.eval\""});
  expect_refused({"c\x1b[2J\n" + std::string(1000, 'x') + "\n.", "\"?[2J.xxx"});
}

TEST(PickleMachineTest, RefusesOpcodesByName) {
  for (const auto& [opcodes, name] : {std::pair("\x82\x01."s, "EXT1"),
                                      {"\x83\x01\x01."s, "EXT2"},
                                      {"\x84\x01\x01\x01\x01."s, "EXT4"},
                                      {"Pid\n."s, "PERSID"},
                                      {"(ios\nsystem\n."s, "INST"},
                                      {"(o."s, "OBJ"},
                                      {"\x8f."s, "EMPTY_SET"},
                                      {"(\x90."s, "ADDITEMS"},
                                      {"(\x91."s, "FROZENSET"},
                                      {")}}\x92."s, "NEWOBJ_EX"},
                                      {"\x96."s, "BYTEARRAY8"},
                                      {"\x97."s, "NEXT_BUFFER"},
                                      {"\x98."s, "READONLY_BUFFER"},
                                      {"\xfe."s, "unknown opcode 254"},
                                      {"\x00."s, "unknown opcode 0"}}) {
    expect_refused({opcodes, "expected an opcode that data needs, got "s + name});
  }
}

TEST(PickleMachineTest, RefusesLengthsBeyondTheInput) {
  for (const std::string& opcodes :
       {"X\xff\xff\xff\xff"s, "T\xff\xff\xff\x7f"s, "B\x10\x00\x00\x00"s, "C\x02x"s, "\x8c\x02x"s,
        "\x8d\xff\xff\xff\xff\xff\xff\xff\xff"s, "\x8e\xff\xff\xff\xff\xff\xff\xff\x7f"s,
        "\x8a\xff"s, "\x8b\xff\xff\xff\xff"s, "M\x01"s, "G\x00"s, "\x80"s}) {
    expect_refused({opcodes, "more bytes, got "});
  }
  expect_refused(
      {"\x80\x04\x95\xff\xff\xff\xff\xff\xff\xff\xffN.", "expected a frame of at most 2 bytes"});
  for (const std::string& opcodes : {"I12"s, "S'x'"s, "cos"s, "cos\nsystem"s, "p1"s}) {
    expect_refused({opcodes, "expected a line of text"});
  }
}

TEST(PickleMachineTest, RefusesUnderflowLeftoversAndMissingMarks) {
  expect_refused({"", "expected STOP"});
  expect_refused({"\x80\x02", "expected STOP"});
  expect_refused({"\x80\x06N.", "expected pickle protocol 0-5, got 6"});
  for (const std::string& opcodes :
       {"."s, "0."s, "2."s, "\x85."s, "K\x01\x86."s, "R."s, ")R."s, "b."s, "a."s, "]a."s, "s."s,
        "}N"
        "s."s,
        "Q."s, "q\x01."s, "\x94."s, "\x93."s}) {
    expect_refused({opcodes, "expected a value on the stack"});
  }
  expect_refused({"N(.", "expected a value on the stack, got a mark"});
  expect_refused({"](a.", "expected a value on the stack, got a mark"});
  expect_refused({"NN.", "expected one value on the stack at STOP, got 2"});
  expect_refused({"(N.", "expected one value on the stack at STOP"});
  for (const std::string& opcodes : {"t."s, "l."s, "d."s, "]e."s, "}u."s, "N1."s}) {
    expect_refused({opcodes, "expected a mark on the stack, got none"});
  }
  expect_refused({"h\x05.", "expected a value in the memo, got none under 5"});
  expect_refused({"j\xff\xff\xff\xff.", "none under 4294967295"});
  expect_refused({"g7\n.", "none under 7"});
  expect_refused({"Np-1\n.", "expected a memo number"});
}

TEST(PickleMachineTest, RefusesOperationsOnTheWrongKindAndMalformedLiterals) {
  const std::set<std::string> allowed = {"m.f"};
  expect_refused({"}Na.", "expected a list to append to, got a dictionary"});
  expect_refused({"]NNs.", "expected a dictionary to set items on, got a list"});
  expect_refused({"}(Nu.", "a key without a value"});
  expect_refused({"]}b.", "expected an object to give a state, got a list"});
  expect_refused({"cm\nf\n)R}b}b.", "a second state"}, allowed);
  expect_refused({"N)R.", "expected a global and a tuple of arguments, got None and a tuple"});
  expect_refused({"cm\nf\nNR.", "got a global and None"}, allowed);
  expect_refused({"K\x01K\x02\x93.", "expected the strings module and name"});
  expect_refused({"I1x\n.", "expected a decimal integer"});
  expect_refused({"L99999999999999999999L\n.", "expected a decimal integer of 64 bits"});
  expect_refused({"Fone\n.", "expected a decimal number"});
  expect_refused({"S'x\n.", "expected a string"});
  expect_refused({"V\\u12\n.", "expected a string"});
  expect_refused({"U\x01k\x8c\x01\xff.", "expected UTF-8"});
}

TEST(PickleMachineTest, DeepNestingNeedsNoRecursion) {
  constexpr int kDepth = 1000000;
  std::string pickle(kDepth, ']');
  pickle.append(kDepth - 1, 'a');
  const PickleDocument document = run(pickle + ".");
  const PickleNode* node = &document.root();
  int depth = 1;
  for (; !node->items.empty(); node = node->items[0]) ++depth;
  EXPECT_EQ(depth, kDepth);
}

TEST(PickleMachineTest, ListMayContainItselfAndTheDocumentMoves) {
  const PickleDocument document =
      run("]q\x01h\x01"
          "a.");
  EXPECT_EQ(document.root().items[0], &document.root());
  PickleDocument first = run("(K\x07t.");
  const PickleDocument second = std::move(first);
  EXPECT_EQ(second.root().items[0]->integer, 7);
}

// Every change of bytes gives another document or a std::runtime_error; anything else (a crash, a
// std::bad_alloc, a std::length_error) fails the test.
TEST(PickleMachineTest, RandomDamageNeverCrashes) {
  const std::string valid =
      "\x80\x02}q\x00(X\x03\x00\x00\x00genq\x01"
      "ccollections\nOrderedDict\nq\x02)Rq\x03(U\x04name"
      "cm\nf\n((U\x07storageX\x01\x00\x00\x00"
      "0K\x10NtQK\x00K\x10\x85K\x01\x85\x89tRq\x04u}(U\x01mK\x02ub"
      "X\x05\x00\x00\x00"
      "epochM\x01\x02X\x02\x00\x00\x00lrG\x3f\xf0\x00\x00\x00\x00\x00\x00"
      "S'old'\n(I1\nL5L\nF1.5\nV\\u00e9\ng1\nlX\x01\x00\x00\x00t\x8a\x02\x10\x20\x8c\x01sC\x02hi"
      "h\x03j\x04\x00\x00\x00u."s;
  const std::set<std::string> allowed = {"collections.OrderedDict", "m.f"};
  ASSERT_NO_THROW(run(valid, allowed));
  std::mt19937 random(20191105);
  const auto below = [&](std::size_t limit) { return random() % limit; };
  int refused = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::string damaged = valid;
    for (std::size_t n = 1 + below(4); n > 0; --n) {
      damaged[below(damaged.size())] = static_cast<char>(below(256));
    }
    if (below(4) == 0) damaged.resize(below(damaged.size()));
    if (below(4) == 0)
      damaged.insert(below(damaged.size() + 1), valid, below(valid.size()), below(9));
    try {
      run(damaged, allowed);
    } catch (const std::runtime_error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 10000) << "most damage must be noticed";
}

}  // namespace
}  // namespace eventgan
