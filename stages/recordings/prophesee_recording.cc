#include "stages/recordings/detail/prophesee_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <string_view>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"
#include "stages/recordings/detail/event_parts.h"
#include "stages/recordings/detail/recording_reader.h"

namespace eventgan {
namespace {

enum class PropheseeEncoding { kDat, kEvt2, kEvt3 };

// ---- The header

struct PropheseeHeader {
  std::optional<PropheseeEncoding> encoding;  ///< none: it does not tell
  std::string version;                        ///< DAT
  std::optional<int> width;
  std::optional<int> height;
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

/// "EVT3;height=720;width=1280"
void read_format(std::string_view value, PropheseeHeader& header) {
  for (bool is_first = true; !value.empty(); is_first = false) {
    const std::string_view part = value.substr(0, value.find(';'));
    value.remove_prefix(std::min(part.size() + 1, value.size()));
    const std::string_view key = part.substr(0, part.find('='));
    const std::string_view number = part.substr(std::min(key.size() + 1, part.size()));
    if (is_first && part != "EVT2" && part != "EVT3") {
      throw EventFault("expected a format EVT2 or EVT3, got another");
    }
    if (is_first) {
      tell(header.encoding, part == "EVT2" ? PropheseeEncoding::kEvt2 : PropheseeEncoding::kEvt3,
           "format");
    }
    if (key == "width") tell(header.width, pixels_of(number, key), key);
    if (key == "height") tell(header.height, pixels_of(number, key), key);
    if (key == "endianness" && number != "little") {
      throw EventFault("expected little-endian words, got others");
    }
  }
}

void read_header_line(std::string_view key, std::string_view value, PropheseeHeader& header) {
  if (key == "Data" && value.starts_with("file containing")) {
    tell(header.encoding, PropheseeEncoding::kDat, key);
  } else if (key == "Version") {
    header.version = value;
  } else if (key == "evt") {
    if (value != "2.0" && value != "3.0") throw EventFault("expected evt 2.0 or 3.0, got another");
    tell(header.encoding, value == "2.0" ? PropheseeEncoding::kEvt2 : PropheseeEncoding::kEvt3,
         key);
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
  } else if (key == "endianness" && value != "little") {
    throw EventFault("expected little-endian words, got others");
  }
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

/// What a word's meaning depends on: all that the words before it have said.
struct WordState {
  std::optional<std::uint32_t> counter;  ///< the upper part of the time as stored, or all of it
  std::int64_t wraps = 0;                ///< of the counter
  std::uint32_t low_us = 0;              ///< EVT 3.0: the lower part
  std::optional<int> y;                  ///< EVT 3.0
  std::optional<int> vector_x;           ///< EVT 3.0: of the next vector's first pixel
  bool vector_on = false;
  bool is_second_camera = false;
  std::int64_t last_us = 0;   ///< of the last event
  std::int64_t left_out = 0;  ///< events before their time and place were told
};

constexpr std::size_t kMostEventsPerWord = 12;
using WordEvents = std::array<StoredEvent, kMostEventsPerWord>;

/// Takes a new value of a counter of so many bits. A fall is a wrap from its last sixteenth to its
/// first, and nothing else.
void count_on(WordState& state, std::uint32_t value, int bits) {
  const std::uint64_t sixteenth = std::uint64_t{1} << (bits - 4);
  if (state.counter && value < *state.counter) {
    if (*state.counter < 15 * sixteenth || value >= sixteenth) {
      throw EventFault(fmt::format("expected a time that goes on or wraps, got {} after {} of {}",
                                   value, *state.counter, 16 * sixteenth));
    }
    ++state.wraps;
  }
  state.counter = value;
}

/// The counter without its wraps.
std::int64_t counted(const WordState& state, int bits) {
  return (state.wraps << bits) + std::int64_t{*state.counter};
}

StoredEvent event_at(WordState& state, std::int64_t time_us, int x, int y, std::uint32_t on) {
  if (time_us < state.last_us) {
    throw EventFault(fmt::format("expected times that never decrease, got {} µs after {} µs",
                                 time_us, state.last_us));
  }
  state.last_us = time_us;
  return {static_cast<double>(x), static_cast<double>(y), static_cast<double>(time_us) / 1e6,
          static_cast<double>(on)};
}

[[noreturn]] void refuse_word(std::uint32_t type, const char* encoding) {
  throw EventFault(fmt::format("expected a word of {}, got one of type {}", encoding, type));
}

/// Each takes a word, and gives how many events it is.
std::size_t take_dat(std::uint64_t word, WordState& state, WordEvents& events) {
  const auto address = static_cast<std::uint32_t>(word >> 32);
  count_on(state, static_cast<std::uint32_t>(word), 32);
  events[0] = event_at(state, counted(state, 32), static_cast<int>(address & 0x3fff),
                       static_cast<int>(address >> 14 & 0x3fff), address >> 28);
  return 1;
}

std::size_t take_evt2(std::uint32_t word, WordState& state, WordEvents& events) {
  constexpr int kTimeBits = 28;
  const std::uint32_t type = word >> 28;
  switch (type) {
    case 0x0:
    case 0x1:
      if (!state.counter) {
        ++state.left_out;
        return 0;
      }
      events[0] =
          event_at(state, (counted(state, kTimeBits) << 6) + (word >> 22 & 0x3f),
                   static_cast<int>(word >> 11 & 0x7ff), static_cast<int>(word & 0x7ff), type);
      return 1;
    case 0x8:
      count_on(state, word & 0xfffffff, kTimeBits);
      return 0;
    case 0xa:  // trigger
    case 0xe:  // others
    case 0xf:  // continued
      return 0;
    default:
      refuse_word(type, "EVT 2.0");
  }
}

std::size_t take_evt3(std::uint16_t word, WordState& state, WordEvents& events) {
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
        ++state.left_out;
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
          ++state.left_out;
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
      refuse_word(type, "EVT 3.0");
  }
}

/// Where decoding can begin.
struct DecodingStart {
  std::int64_t byte = 0;
  WordState state;
};

class PropheseeEvents final : public EventParts {
 public:
  PropheseeEvents(InputFile file, PropheseeEncoding encoding, std::int64_t first_byte)
      : EventParts(file.name()), file_(std::move(file)), encoding_(encoding) {
    if (const std::int64_t rest = (file_.end_byte() - first_byte) % word_bytes(); rest != 0) {
      refuse_at(fmt::format("expected whole words of {} bytes, got {} more", word_bytes(), rest),
                file_.name(), file_.end_byte() - rest);
    }
    for (DecodingStart start{first_byte, {}}; start.byte < file_.end_byte();) {
      const DecodingStart begin = start;
      CompactEvents events = decode(start);
      if (events.size() > 0) starts_.push_back(begin);
      add_part(std::move(events));
      left_out_ = start.state.left_out;
    }
  }

  std::int64_t left_out() const { return left_out_; }

 private:
  static constexpr std::int64_t kBytesPerPart = 1 << 17;

  CompactEvents read_part(std::size_t part) const override {
    DecodingStart start = starts_[part];
    return decode(start);
  }

  std::int64_t word_bytes() const {
    return encoding_ == PropheseeEncoding::kDat ? 8 : encoding_ == PropheseeEncoding::kEvt2 ? 4 : 2;
  }

  /// Decodes a part from `start` on, which goes to where decoding goes on behind it.
  CompactEvents decode(DecodingStart& start) const {
    switch (encoding_) {
      case PropheseeEncoding::kDat:
        return decode_words<std::uint64_t>(start, take_dat);
      case PropheseeEncoding::kEvt2:
        return decode_words<std::uint32_t>(start, take_evt2);
      case PropheseeEncoding::kEvt3:
        break;
    }
    return decode_words<std::uint16_t>(start, take_evt3);
  }

  template <class Word, class TakeWord>
  CompactEvents decode_words(DecodingStart& start, TakeWord take_word) const {
    const std::string bytes =
        file_.read_between(start.byte, std::min(start.byte + kBytesPerPart, file_.end_byte()));
    CompactEvents result;
    WordEvents events;
    for (std::size_t i = 0; i < bytes.size(); i += sizeof(Word)) {
      Word word;
      std::memcpy(&word, bytes.data() + i, sizeof(word));
      std::size_t count = 0;
      try {
        count = take_word(word, start.state, events);
      } catch (const EventFault& fault) {
        refuse_at(fault.what(), file_.name(), start.byte);
      }
      start.byte += sizeof(Word);
      for (std::size_t k = 0; k < count; ++k) result.push_back(events[k]);
    }
    return result;
  }

  InputFile file_;
  PropheseeEncoding encoding_;
  std::vector<DecodingStart> starts_;  ///< of the parts, which have events
  std::int64_t left_out_ = 0;
};

ImageSize sensor_size(const PropheseeHeader& header, const std::optional<ImageSize>& sensor,
                      const std::string& name) {
  if (header.width && header.height) {
    const ImageSize size{*header.height, *header.width};
    if (!sensor || *sensor == size) return size;
    throw InputError(
        fmt::format("expected the manifest's \"sensor\" to be {}, as the header says, "
                    "got {}, in {}",
                    to_string(size), to_string(*sensor), name));
  }
  if (sensor) return *sensor;
  throw InputError(
      "expected the sensor's size in the header, got none: write it into the manifest, \"sensor\": "
      "{\"width\": ..., \"height\": ...}, in " +
      name);
}

/// Whether the file begins with the header of a recording of Prophesee's.
bool is_prophesee(const RecordingInput& input, const RecordingOptions&) try {
  return read_prophesee_header(input.beginning(), input.path().string()).encoding.has_value();
} catch (const InputError&) {
  return false;
}

}  // namespace

StoredParts open_prophesee(const std::filesystem::path& path,
                           const std::optional<ImageSize>& sensor) {
  InputFile file(path);
  PropheseeHeader header = read_prophesee_header(
      file.read_between(0, std::min(kMostHeaderBytes, file.end_byte())), file.name());
  if (!header.encoding) {
    throw InputError(
        "expected a header \"% Data file containing ...\", \"% evt 2.0\" or \"% evt 3.0\", got "
        "none, in " +
        file.name());
  }
  if (header.encoding == PropheseeEncoding::kDat) {
    const std::int64_t end = header.end_byte + 2;
    const std::string kind = file.read_between(header.end_byte, std::min(end, file.end_byte()));
    constexpr char kEvent2d = 0x00;
    constexpr char kEventCd = 0x0c;
    if (kind.size() < 2 || (kind[0] != kEvent2d && kind[0] != kEventCd) || kind[1] != 8) {
      refuse_at("expected events of type 0 or 12 of 8 bytes, got others", file.name(),
                header.end_byte);
    }
    if (header.version != "2") {
      refuse_at("expected a header \"% Version 2\", got another version or none", file.name(), 0);
    }
    header.end_byte = end;
  }
  StoredParts parts{file.name(), sensor_size(header, sensor, file.name()), nullptr};
  auto events =
      std::make_unique<PropheseeEvents>(std::move(file), *header.encoding, header.end_byte);
  if (events->left_out() > 0) {
    parts.notes.push_back(
        fmt::format("events before the first time and place are left out: {}, in {}",
                    events->left_out(), parts.name));
  }
  parts.events = std::move(events);
  return parts;
}

constinit const RecordingReader kPropheseeReader{
    .format = RecordingFormat::kProphesee,
    .fits = is_prophesee,
    .open = [](const std::filesystem::path& path, const RecordingOptions& options) {
      return make_stored_recording(open_prophesee(path, options.sensor));
    }};

}  // namespace eventgan
