#pragma once

#include <exception>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

namespace eventgan {

/// Why one sample cannot be used: text of the form "expected X, got Y, in PATH (SAMPLE)".
/// A fault is a value: it travels through the pipeline in the sample's place, keeps its slot in the
/// shard and ends in the shard's commit record. It never leaves a stage as an exception.
struct SampleFault {
  std::string reason;
  bool operator==(const SampleFault&) const = default;
};

/// A stage's result for one sample: the value, or why there is none. Asking for what it is not is
/// std::bad_variant_access.
template <class T>
struct Outcome : std::variant<T, SampleFault> {
  using std::variant<T, SampleFault>::variant;

  const T& operator*() const& { return std::get<0>(*this); }
  T& operator*() & { return std::get<0>(*this); }
  T&& operator*() && { return std::get<0>(std::move(*this)); }
  const T* operator->() const { return &std::get<0>(*this); }
  T* operator->() { return &std::get<0>(*this); }
  const SampleFault& fault() const { return std::get<1>(*this); }
};

template <class T>
bool is_fault(const Outcome<T>& outcome) {
  return outcome.index() == 1;
}

/// The user asked for something that cannot be: bad command line or bad manifest. Exit code 64.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A whole input (a source's folder, an annotation file, the weights) is missing or cannot be read.
/// Exit code 66.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// More samples were quarantined than the manifest allows (or any, with policy "fail"). Exit
/// code 65.
class TooManyFaults : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Asked to stop before anything was begun. Exit code 75.
class Stopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The process has come to a limit of its own, of open files or of memory, where a sample was read.
/// That is no fault of the sample, and another run may have more: so it is no std::runtime_error,
/// which is what readers make faults of, and ends the run. Exit code 1.
class LimitReached : public std::exception {
 public:
  explicit LimitReached(std::string what) : what_(std::move(what)) {}
  const char* what() const noexcept override { return what_.c_str(); }

 private:
  std::string what_;
};

}  // namespace eventgan
