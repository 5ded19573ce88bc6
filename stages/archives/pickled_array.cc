#include "stages/archives/pickled_array.h"

#include <span>
#include <stdexcept>

#include "stages/archives/numpy_elements_internal.h"

namespace eventgan {
namespace {

using Kind = PickleNode::Kind;

[[noreturn]] void fail(const std::string& expected, const std::string& got,
                       const std::string& name) {
  throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name);
}

bool is_text(const PickleNode& node) {
  return node.kind == Kind::kString || node.kind == Kind::kBytes;
}

// The state that numpy's classes pickle: a tuple of at least `count` items.
const std::vector<const PickleNode*>& state_of(const PickleNode& node, std::size_t count,
                                               const char* what, const std::string& name) {
  if (node.state == nullptr || node.state->kind != Kind::kTuple ||
      node.state->items.size() < count) {
    fail(std::string("the state of a ") + what,
         node.state == nullptr ? "none" : describe(node.state->kind), name);
  }
  return node.state->items;
}

bool is_call_of(const PickleNode& node, const std::set<std::string>& names) {
  return node.kind == Kind::kCall && names.contains(node.items[0]->text);
}

// dtype("f8", align, copy) with the state (version, byte order, ...).
std::string descr_of(const PickleNode& dtype, const std::string& name) {
  if (!is_call_of(dtype, {"numpy.dtype"}) || dtype.items[1]->items.empty() ||
      !is_text(*dtype.items[1]->items[0])) {
    fail("a numpy dtype", describe(dtype.kind), name);
  }
  const PickleNode& order = *state_of(dtype, 2, "numpy dtype", name)[1];
  if (!is_text(order)) fail("a byte order", describe(order.kind), name);
  return order.text + dtype.items[1]->items[0]->text;
}

// Python 3 writes bytes for Python 2 as a call: _codecs.encode(text, "latin1").
std::string latin1_bytes(const std::string& utf8, const std::string& name) {
  std::string bytes;
  for (std::size_t i = 0; i < utf8.size(); ++i) {
    const auto lead = static_cast<unsigned char>(utf8[i]);
    if (lead < 0x80) {
      bytes += utf8[i];
    } else if (lead <=
               0xc3) {  // two bytes of UTF-8 reach U+00FF; the pickle reader checked the form
      bytes +=
          static_cast<char>((lead & 0x03) << 6 | (static_cast<unsigned char>(utf8[++i]) & 0x3f));
    } else {
      fail("Latin-1 text", "other characters", name);
    }
  }
  return bytes;
}

std::string bytes_of(const PickleNode& node, const std::string& name) {
  if (node.kind == Kind::kBytes) return node.text;
  if (is_call_of(node, {"_codecs.encode"})) {
    const auto& arguments = node.items[1]->items;
    if (arguments.size() == 2 && arguments[0]->kind == Kind::kString && is_text(*arguments[1]) &&
        arguments[1]->text == "latin1") {
      return latin1_bytes(arguments[0]->text, name);
    }
  }
  fail("the bytes of an array", describe(node.kind), name);
}

}  // namespace

const std::set<std::string>& numpy_globals() {
  static const std::set<std::string> kNames = {
      "_codecs.encode", "numpy._core.multiarray._reconstruct", "numpy.core.multiarray._reconstruct",
      "numpy.dtype", "numpy.ndarray"};
  return kNames;
}

bool is_pickled_array(const PickleNode& node) {
  return is_call_of(node,
                    {"numpy._core.multiarray._reconstruct", "numpy.core.multiarray._reconstruct"});
}

TypedArray parse_pickled_array(const PickleNode& node, const std::string& name) {
  if (!is_pickled_array(node)) fail("a numpy array", describe(node.kind), name);
  // (version, shape, dtype, is Fortran order, bytes)
  const auto& state = state_of(node, 5, "numpy array", name);
  const PickleNode& shape = *state[1];
  if (shape.kind != Kind::kTuple) fail("a shape", describe(shape.kind), name);
  NumpyLayout layout;
  for (const PickleNode* size : shape.items) {
    if (size->kind != Kind::kInt || size->integer < 0) {
      fail("dimensions of at least 0", describe(size->kind), name);
    }
    layout.shape.push_back(static_cast<std::size_t>(size->integer));
  }
  layout.descr = descr_of(*state[2], name);
  if (state[3]->kind != Kind::kBool) fail("an order flag", describe(state[3]->kind), name);
  layout.fortran_order = state[3]->integer != 0;
  const std::string bytes = bytes_of(*state[4], name);
  return decode_numpy_elements(layout, std::as_bytes(std::span(bytes)), name);
}

}  // namespace eventgan
