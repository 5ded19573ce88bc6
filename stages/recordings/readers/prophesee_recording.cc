#include "stages/recordings/readers/detail/prophesee_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <string_view>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_index.h"
#include "stages/recordings/order/packed_bytes.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "stages/recordings/readers/detail/open_files.h"
#include "stages/recordings/readers/detail/prophesee_words.h"
#include "stages/recordings/readers/detail/recording_reader.h"

namespace eventgan {
namespace {

enum class PropheseeEncoding { kDat, kEvt2, kEvt21, kEvt21Legacy, kEvt3 };

// ---- The header

struct PropheseeHeader {
  std::optional<PropheseeEncoding> encoding;  ///< none: it does not tell
  std::string version;                        ///< DAT
  std::optional<int> width;
  std::optional<int> height;
  std::optional<bool> is_legacy;  ///< EVT 2.1: the halves of a word are exchanged
  /// Who made it, by the lines' keys; empty: not told.
  std::string integrator, camera_integrator, plugin_integrator;
  int system_id = 0;  ///< of the camera; 0: not told
  std::int64_t end_byte = 0;
};

/// A value that several lines may tell, if they agree.
template <class T>
void tell(std::optional<T>& known, const T& value, std::string_view key) {
  if (known && *known != value) {
    throw EventFault(fmt::format("expected lines that agree, got another \"{}\"", key));
  }
  known = value;
}

int pixels_of(std::string_view text, std::string_view key) {
  int pixels = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), pixels);
  if (error == std::errc() && stop == text.data() + text.size() && pixels >= 1 &&
      pixels <= kMostSensorSide) {
    return pixels;
  }
  throw EventFault(
      fmt::format("expected pixels 1..{} in \"{}\", got another", kMostSensorSide, key));
}

PropheseeEncoding encoding_of(std::string_view word, std::string_view evt2, std::string_view evt21,
                              std::string_view evt3) {
  if (word == evt2) return PropheseeEncoding::kEvt2;
  if (word == evt21) return PropheseeEncoding::kEvt21;
  if (word == evt3) return PropheseeEncoding::kEvt3;
  throw EventFault(fmt::format("expected {}, {} or {}, got another encoding", evt2, evt21, evt3));
}

void read_endianness(std::string_view value, PropheseeHeader& header) {
  if (value != "little" && value != "legacy") {
    throw EventFault("expected little-endian words, got others");
  }
  header.is_legacy = value == "legacy";
}

/// "EVT3;height=720;width=1280"
void read_format(std::string_view value, PropheseeHeader& header) {
  for (bool is_first = true; !value.empty(); is_first = false) {
    const std::string_view part = value.substr(0, value.find(';'));
    value.remove_prefix(std::min(part.size() + 1, value.size()));
    const std::string_view key = part.substr(0, part.find('='));
    const std::string_view number = part.substr(std::min(key.size() + 1, part.size()));
    if (is_first) tell(header.encoding, encoding_of(part, "EVT2", "EVT21", "EVT3"), "format");
    if (key == "width") tell(header.width, pixels_of(number, key), key);
    if (key == "height") tell(header.height, pixels_of(number, key), key);
    if (key == "endianness") read_endianness(number, header);
  }
}

void read_header_line(std::string_view key, std::string_view value, PropheseeHeader& header) {
  if (key == "Data" && value.starts_with("file containing")) {
    tell(header.encoding, PropheseeEncoding::kDat, key);
  } else if (key == "Version") {
    header.version = value;
  } else if (key == "evt") {
    tell(header.encoding, encoding_of(value, "2.0", "2.1", "3.0"), key);
  } else if (key == "format") {
    read_format(value, header);
  } else if (key == "geometry") {
    const std::string_view width = value.substr(0, value.find('x'));
    tell(header.width, pixels_of(width, key), key);
    tell(header.height, pixels_of(value.substr(std::min(width.size() + 1, value.size())), key),
         key);
  } else if (key == "Width" || key == "width") {
    tell(header.width, pixels_of(value, key), key);
  } else if (key == "Height" || key == "height") {
    tell(header.height, pixels_of(value, key), key);
  } else if (key == "endianness") {
    read_endianness(value, header);
  } else if (key == "integrator_name") {
    header.integrator = value;
  } else if (key == "camera_integrator_name") {
    header.camera_integrator = value;
  } else if (key == "plugin_integrator_name") {
    header.plugin_integrator = value;
  } else if (key == "system_ID") {
    std::from_chars(value.data(), value.data() + value.size(), header.system_id);
  }
}

/// Whether words of EVT 2.1 have their halves exchanged. Prophesee's cameras before the EVK2 Saphir
/// wrote them so without a word, which OpenEB knows by these lines (psee_raw_file_header.cpp).
bool has_exchanged_halves(const PropheseeHeader& header) {
  constexpr std::string_view kProphesee = "Prophesee";
  constexpr int kEvk2Saphir = 55;
  if (header.is_legacy) return *header.is_legacy;
  const bool is_told = !header.camera_integrator.empty() || !header.plugin_integrator.empty();
  const bool is_prophesees =
      is_told ? header.camera_integrator == kProphesee && header.plugin_integrator == kProphesee
              : header.integrator.empty() || header.integrator == kProphesee;
  return is_prophesees && header.system_id > 0 && header.system_id < kEvk2Saphir;
}

[[noreturn]] void refuse_at(const std::string& fault, const std::string& name, std::int64_t byte) {
  throw InputError(fmt::format("{}, in {} (byte {})", fault, name, byte));
}

constexpr std::int64_t kMostHeaderBytes = std::int64_t{1} << 14;

/// Lines "% key value", up to a line "% end" or to what is no such line.
PropheseeHeader read_prophesee_header(std::string_view text, const std::string& name) {
  PropheseeHeader header;
  std::size_t at = 0;
  while (text.compare(at, 2, "% ") == 0) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos)
      refuse_at("expected a line of text, got no end of it", name, static_cast<std::int64_t>(at));
    std::string_view line = text.substr(at + 2, end - at - 2);
    if (line.ends_with('\r')) line.remove_suffix(1);
    const std::string_view key = line.substr(0, line.find(' '));
    const std::string_view value = line.substr(std::min(key.size() + 1, line.size()));
    try {
      read_header_line(key, value, header);
    } catch (const EventFault& fault) {
      refuse_at(fault.what(), name, static_cast<std::int64_t>(at));
    }
    at = end + 1;
    if (key == "end") break;
  }
  header.end_byte = static_cast<std::int64_t>(at);
  return header;
}

// ---- The words

/// Takes a new value of a counter of so many bits. A fall of half its range or more is a wrap, as
/// where words were lost around one; a smaller one is a step back, and so is a rise of three
/// quarters or more, of a late word behind a wrap: less may be a time without events. A value
/// between two that follow each other is damaged, and no wrap.
void count_on(WordState& state, std::uint32_t value, int bits) {
  const std::uint64_t half = std::uint64_t{1} << (bits - 1);
  const std::uint64_t before = state.counter.value_or(value);
  const bool falls = before >= value + half, rises = value >= before + half;
  const bool goes_on =
      state.before_jump && value >= *state.before_jump && value - *state.before_jump < half / 32;
  state.before_jump.reset();
  if (goes_on) {
    state.wraps = state.wraps_before_jump;
  } else if (falls || rises) {
    state.before_jump = state.counter;
    state.wraps_before_jump = state.wraps;
    if (falls) ++state.wraps;
    if (state.wraps > 0 && value >= before + half + half / 2) --state.wraps;
  }
  state.counter = value;
}

/// The counter without its wraps.
std::int64_t counted(const WordState& state, int bits) {
  return (state.wraps << bits) + std::int64_t{*state.counter};
}

StoredEvent event_at(WordState& state, std::int64_t time_us, int x, int y, std::uint32_t on) {
  constexpr auto kMostLift_us = static_cast<std::int64_t>(kMostLift_s * 1e6) + 1;
  const bool is_back = time_us <= state.last_us - kMostLift_us;
  if (is_back) ++state.counts.steps_back;
  if (is_back || time_us > state.last_us) state.last_us = time_us;
  return {static_cast<double>(x), static_cast<double>(y),
          static_cast<double>(time_us - state.shift_us) / 1e6, static_cast<double>(on)};
}

/// Each takes a word, and gives how many events it is.
std::size_t take_dat(std::uint64_t word, WordState& state, bool /*shifts*/, WordEvents& events) {
  const auto address = static_cast<std::uint32_t>(word >> 32);
  count_on(state, static_cast<std::uint32_t>(word), 32);
  events[0] = event_at(state, counted(state, 32), static_cast<int>(address & 0x3fff),
                       static_cast<int>(address >> 14 & 0x3fff), address >> 28);
  return 1;
}

constexpr int kEvt2TimeBits = 28;

/// The upper part of a time in EVT 2.0 and 2.1, in 64 µs. Metavision's readers begin at the first.
void take_evt2_time(std::uint32_t upper, WordState& state, bool shifts) {
  if (shifts && !state.counter) state.shift_us = std::int64_t{upper} << 6;
  count_on(state, upper, kEvt2TimeBits);
}

std::size_t take_evt2(std::uint32_t word, WordState& state, bool shifts, WordEvents& events) {
  const std::uint32_t type = word >> 28;
  switch (type) {
    case 0x0:
    case 0x1:
      if (!state.counter) {
        ++state.counts.left_out;
        return 0;
      }
      events[0] =
          event_at(state, (counted(state, kEvt2TimeBits) << 6) + (word >> 22 & 0x3f),
                   static_cast<int>(word >> 11 & 0x7ff), static_cast<int>(word & 0x7ff), type);
      return 1;
    case 0x8:
      take_evt2_time(word & 0xfffffff, state, shifts);
      return 0;
    case 0xa:  // trigger
    case 0xe:  // others
    case 0xf:  // continued
      return 0;
    default:
      ++state.counts.reserved;
      return 0;
  }
}

/// As EVT 2.0, with a bit for each of 32 pixels from x on.
std::size_t take_evt21(std::uint64_t word, WordState& state, bool shifts, WordEvents& events) {
  const auto valid = static_cast<std::uint32_t>(word);
  const auto upper = static_cast<std::uint32_t>(word >> 32);
  const std::uint32_t type = upper >> 28;
  if (type > 0x1) return take_evt2(upper, state, shifts, events);
  if (!state.counter) {
    state.counts.left_out += std::popcount(valid);
    return 0;
  }
  const std::int64_t time_us = (counted(state, kEvt2TimeBits) << 6) + (upper >> 22 & 0x3f);
  std::size_t count = 0;
  for (int i = 0; i < 32; ++i) {
    if ((valid >> i & 1) == 0) continue;
    events[count++] = event_at(state, time_us, static_cast<int>(upper >> 11 & 0x7ff) + i,
                               static_cast<int>(upper & 0x7ff), type);
  }
  return count;
}

std::size_t take_evt21_legacy(std::uint64_t word, WordState& state, bool shifts,
                              WordEvents& events) {
  return take_evt21(word << 32 | word >> 32, state, shifts, events);
}

}  // namespace

std::size_t take_evt3(std::uint16_t word, WordState& state, bool shifts, WordEvents& events) {
  constexpr int kTimeBits = 12;
  const std::uint32_t type = word >> 12;
  const int place = word & 0x7ff;
  const bool on = (word >> 11 & 1) != 0;
  const auto time_us = [&] { return (counted(state, kTimeBits) << 12) + state.low_us; };
  switch (type) {
    case 0x0:
      if (state.y && state.is_second_camera != on) {
        throw EventFault("expected events of one camera, got those of its slave too");
      }
      state.is_second_camera = on;
      state.y = place;
      return 0;
    case 0x2:
      if (!state.counter || !state.y) {
        ++state.counts.left_out;
        return 0;
      }
      events[0] = event_at(state, time_us(), place, *state.y, on);
      return 1;
    case 0x3:
      state.vector_x = place;
      state.vector_on = on;
      return 0;
    case 0x4:
    case 0x5: {
      const int length = type == 0x4 ? 12 : 8;
      std::size_t count = 0;
      for (int i = 0; i < length; ++i) {
        if ((word >> i & 1) == 0) continue;
        if (!state.counter || !state.y || !state.vector_x) {
          ++state.counts.left_out;
          continue;
        }
        events[count++] =
            event_at(state, time_us(), *state.vector_x + i, *state.y, state.vector_on);
      }
      if (state.vector_x) {  // words without events may follow each other without end
        constexpr int kBeyondAnySensor = 1 << 16;
        *state.vector_x = std::min(*state.vector_x + length, kBeyondAnySensor);
      }
      return count;
    }
    case 0x6:
      // It may step back where it is of a trigger or the like: events alone must not.
      state.low_us = word & 0xfff;
      return 0;
    case 0x8:
      // Metavision's readers begin one before the first.
      if (shifts && !state.counter) {
        state.shift_us = std::max<std::int64_t>((word & 0xfff) - 1, 0) << 12;
      }
      // Said again every 16 µs; only a new one begins at its start.
      if (state.counter != (word & 0xfffu)) state.low_us = 0;
      count_on(state, word & 0xfff, kTimeBits);
      return 0;
    case 0x7:  // continued
    case 0xa:  // trigger
    case 0xe:  // others
    case 0xf:  // continued
      return 0;
    default:
      ++state.counts.reserved;
      return 0;
  }
}

namespace {

/// Where decoding can begin.
struct DecodingStart {
  std::int64_t byte = 0;
  WordState state;
};

class PropheseeEvents final : public EventParts {
 public:
  /// `index_key`: of the file, made before it was opened (event_index_key); empty: none.
  PropheseeEvents(std::unique_ptr<const RecordingFile> file, std::string index_key,
                  PropheseeEncoding encoding, std::int64_t first_byte, ImageSize size, bool shifts)
      : EventParts(file->name(), recent_events(), kMostLift_s),
        file_(std::move(file)),
        encoding_(encoding),
        size_(size),
        shifts_(shifts),
        end_byte_(file_->end_byte() - (file_->end_byte() - first_byte) % word_bytes()) {
    EventIndexes* const indexes = EventIndexes::current();
    std::string key = std::move(index_key);
    if (!key.empty()) {
      constexpr int kVersion = 2;  // of WordState
      key += fmt::format(" {} {} {} {} {}", to_string(size), static_cast<int>(encoding), first_byte,
                         shifts, kVersion);
    }
    if (indexes != nullptr && !key.empty() && restore(indexes->find(key).value_or(""))) return;
    DecodingStart start{first_byte, {}};
    while (start.byte < end_byte_) {
      const DecodingStart begin = start;
      CompactEvents events = decode(start);
      if (events.size() > 0) starts_.push_back(begin);
      add_part(std::move(events));
    }
    counts_ = start.state.counts;
    shift_us_ = start.state.shift_us;
    if (indexes != nullptr && !key.empty()) indexes->keep(key, to_bytes());
  }

  /// The share of what makes no sense among all that was read.
  double nonsense() const {
    const auto odd = static_cast<double>(counts_.left_out + counts_.outside + counts_.reserved +
                                         counts_.steps_back);
    return odd == 0 ? 0 : odd / (odd + static_cast<double>(count()));
  }

  /// What a user should know goes into `parts`, which has its name. Throws InputError where all
  /// events are left out.
  void tell(StoredParts& parts) const {
    if (count() == 0 && counts_.left_out + counts_.outside + counts_.reserved > 0) {
      throw InputError(fmt::format(
          "expected events on the sensor of {}, got none: {} beside it, {} before the first time "
          "and place, words of reserved types: {}, in {}",
          to_string(size_), counts_.outside, counts_.left_out, counts_.reserved, parts.name));
    }
    const auto note = [&](std::int64_t number, std::string_view what) {
      if (number > 0) parts.notes.push_back(fmt::format("{}: {}, in {}", what, number, parts.name));
    };
    if (shift_us_ > 0) {
      parts.notes.push_back(fmt::format(
          "times count from the recording's start, as Metavision gives them: {:.6f} s are taken "
          "off (\"time_shift\": false keeps the camera's), in {}",
          static_cast<double>(shift_us_) / 1e6, parts.name));
    }
    note(counts_.left_out, "events before the first time and place are left out");
    note(counts_.reserved, "words of reserved types are passed over");
    note(file_->end_byte() - end_byte_, "bytes behind the last word are passed over");
    note(counts_.steps_back, "events are before an earlier one, and their windows at fault");
    constexpr double kMuch = 0.01;
    const auto outside = static_cast<double>(counts_.outside);
    const std::string beside = fmt::format("events beside the sensor of {} are left out: {}, in {}",
                                           to_string(size_), counts_.outside, parts.name);
    if (outside > kMuch * (outside + static_cast<double>(count()))) {
      parts.warnings.push_back(beside + " (is \"sensor\" the camera's size?)");
    } else if (outside > 0) {
      parts.notes.push_back(beside);
    }
  }

 private:
  static constexpr std::int64_t kBytesPerPart = 1 << 17;

  /// What is known of the file once it was read.
  std::string to_bytes() const {
    std::string bytes;
    pack(bytes, starts_);
    pack(bytes, counts_);
    pack(bytes, shift_us_);
    pack_parts(bytes);
    return bytes;
  }

  /// False if these are no such bytes; then nothing is known.
  bool restore(std::string_view bytes) {
    std::vector<DecodingStart> starts;
    if (!unpack(bytes, starts) || !unpack(bytes, counts_) || !unpack(bytes, shift_us_))
      return false;
    const auto is_within = [&](const DecodingStart& start) {
      return start.byte >= 0 && start.byte < end_byte_;
    };
    if (!std::ranges::all_of(starts, is_within) || !unpack_parts(bytes, starts.size()))
      return false;
    starts_ = std::move(starts);
    return true;
  }

  CompactEvents read_part(std::size_t part) const override {
    DecodingStart start = starts_[part];
    return decode(start);
  }

  std::int64_t word_bytes() const {
    switch (encoding_) {
      case PropheseeEncoding::kEvt2:
        return 4;
      case PropheseeEncoding::kEvt3:
        return 2;
      default:
        return 8;
    }
  }

  /// Decodes a part from `start` on, which goes to where decoding goes on behind it.
  CompactEvents decode(DecodingStart& start) const {
    switch (encoding_) {
      case PropheseeEncoding::kDat:
        return decode_words<std::uint64_t>(start, take_dat);
      case PropheseeEncoding::kEvt2:
        return decode_words<std::uint32_t>(start, take_evt2);
      case PropheseeEncoding::kEvt21:
        return decode_words<std::uint64_t>(start, take_evt21);
      case PropheseeEncoding::kEvt21Legacy:
        return decode_words<std::uint64_t>(start, take_evt21_legacy);
      case PropheseeEncoding::kEvt3:
        break;
    }
    return decode_words<std::uint16_t>(start, take_evt3);
  }

  template <class Word, class TakeWord>
  CompactEvents decode_words(DecodingStart& start, TakeWord take_word) const {
    const std::string bytes =
        file_->read_between(start.byte, std::min(start.byte + kBytesPerPart, end_byte_));
    CompactEvents result;
    WordEvents events;
    for (std::size_t i = 0; i < bytes.size(); i += sizeof(Word)) {
      Word word;
      std::memcpy(&word, bytes.data() + i, sizeof(word));
      std::size_t count = 0;
      try {
        count = take_word(word, start.state, shifts_, events);
      } catch (const EventFault& fault) {
        refuse_at(fault.what(), file_->name(), start.byte);
      }
      start.byte += sizeof(Word);
      for (std::size_t k = 0; k < count; ++k) {
        if (events[k].x < size_.width && events[k].y < size_.height) {
          result.push_back(events[k]);
        } else {
          ++start.state.counts.outside;
        }
      }
    }
    return result;
  }

  std::unique_ptr<const RecordingFile> file_;
  PropheseeEncoding encoding_;
  ImageSize size_;
  bool shifts_;
  std::int64_t end_byte_;              ///< of the last whole word
  std::vector<DecodingStart> starts_;  ///< of the parts, which have events
  WordCounts counts_;
  std::int64_t shift_us_ = 0;
};

/// Whether the file begins with the header of a recording of Prophesee's.
bool is_prophesee(const RecordingInput& input, const RecordingOptions&) try {
  return read_prophesee_header(input.beginning(), input.path().string()).encoding.has_value();
} catch (const InputError&) {
  return false;
}

/// A header of Prophesee's that tells what is not read.
std::optional<RecordingFault> prophesee_fault(const RecordingInput& input,
                                              const RecordingOptions&) try {
  read_prophesee_header(input.beginning(), input.path().string());
  return std::nullopt;
} catch (const InputError& error) {
  return RecordingFault{error.what(), /*is_recording=*/true};
}

}  // namespace

StoredParts open_prophesee(const std::filesystem::path& path, const RecordingOptions& options) {
  std::string index_key = event_index_key(path, "events");
  auto file = std::make_unique<const RecordingFile>(path);
  PropheseeHeader header = read_prophesee_header(
      file->read_between(0, std::min(kMostHeaderBytes, file->end_byte())), file->name());
  if (!header.encoding) {
    throw InputError(
        "expected a header \"% Data file containing ...\", \"% evt 2.0\", 2.1 or 3.0, got none, "
        "in " +
        file->name());
  }
  if (header.encoding == PropheseeEncoding::kDat) {
    const std::int64_t end = header.end_byte + 2;
    const std::string kind = file->read_between(header.end_byte, std::min(end, file->end_byte()));
    constexpr char kEvent2d = 0x00;
    constexpr char kEventCd = 0x0c;
    if (kind.size() < 2 || (kind[0] != kEvent2d && kind[0] != kEventCd) || kind[1] != 8) {
      refuse_at("expected events of type 0 or 12 of 8 bytes, got others", file->name(),
                header.end_byte);
    }
    if (header.version != "2") {
      refuse_at("expected a header \"% Version 2\", got another version or none", file->name(), 0);
    }
    header.end_byte = end;
  }
  if (header.encoding == PropheseeEncoding::kEvt21) {
    if (has_exchanged_halves(header)) header.encoding = PropheseeEncoding::kEvt21Legacy;
  } else if (header.is_legacy.value_or(false)) {
    refuse_at("expected little-endian words, got others", file->name(), 0);
  }
  StoredParts parts{file->name(), {}, nullptr};
  const bool is_told = header.width && header.height;
  parts.size =
      sensor_size(is_told ? std::optional(ImageSize{*header.height, *header.width}) : std::nullopt,
                  options.sensor, parts);
  const auto read = [&](std::unique_ptr<const RecordingFile> opened, PropheseeEncoding encoding) {
    return std::make_unique<PropheseeEvents>(std::move(opened), index_key, encoding,
                                             header.end_byte, parts.size, options.time_shift);
  };
  auto events = read(std::move(file), *header.encoding);
  const bool is_legacy = header.encoding == PropheseeEncoding::kEvt21Legacy;
  constexpr double kGarbage = 0.2, kSense = 0.01;
  if ((is_legacy || header.encoding == PropheseeEncoding::kEvt21) &&
      events->nonsense() > kGarbage) {
    auto exchanged = read(std::make_unique<const RecordingFile>(path),
                          is_legacy ? PropheseeEncoding::kEvt21 : PropheseeEncoding::kEvt21Legacy);
    if (exchanged->count() > 0 && exchanged->nonsense() < kSense) {
      parts.warnings.push_back(fmt::format(
          "words of EVT 2.1 are read as \"endianness={}\": the header has them in the other order, "
          "in which {:.0f} % of what is read makes no sense, in {}",
          is_legacy ? "little" : "legacy", 100 * events->nonsense(), parts.name));
      events = std::move(exchanged);
    }
  }
  events->tell(parts);
  parts.events = std::move(events);
  return parts;
}

constinit const RecordingReader kPropheseeReader{
    .format = RecordingFormat::kProphesee,
    .fits = is_prophesee,
    .open =
        [](const std::filesystem::path& path, const RecordingOptions& options) {
          return make_stored_recording(open_prophesee(path, options));
        },
    .fault = prophesee_fault};

}  // namespace eventgan
