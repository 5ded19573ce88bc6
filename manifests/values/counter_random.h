#pragma once

#include <cstdint>
#include <string_view>

namespace eventgan {

/// Random numbers that are a function of a key and a counter, with no state: the same on every
/// machine and in every order of asking. FNV-1a folds text into the key; the finaliser of
/// SplitMix64 (Steele et al. 2014) mixes key and counter.
class CounterRandom {
 public:
  explicit constexpr CounterRandom(std::uint64_t seed) : key_(mix(seed)) {}

  /// A generator of its own for this word, independent of those for other words.
  constexpr CounterRandom keyed(std::string_view word) const {
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (const char c : word) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    CounterRandom result(*this);
    result.key_ = mix(key_ ^ mix(hash + word.size()));
    return result;
  }

  /// 64 uniform bits.
  constexpr std::uint64_t bits(std::uint64_t counter) const {
    return mix(key_ + 0x9e3779b97f4a7c15u * (counter + 1));
  }

  /// Uniform in [0, 1), 53 bits.
  constexpr double uniform(std::uint64_t counter) const {
    return static_cast<double>(bits(counter) >> 11) * 0x1.0p-53;
  }

  /// Uniform in 0..count-1, count ≥ 1 (bias below count / 2^64).
  constexpr std::uint64_t below(std::uint64_t counter, std::uint64_t count) const {
    __extension__ using Wide = unsigned __int128;
    return static_cast<std::uint64_t>((static_cast<Wide>(bits(counter)) * count) >> 64);
  }

 private:
  static constexpr std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  std::uint64_t key_;
};

}  // namespace eventgan
