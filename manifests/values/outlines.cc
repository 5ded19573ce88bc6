#include "manifests/values/outlines.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "manifests/values/text.h"

namespace eventgan {

OutlineCounts& OutlineCounts::operator+=(const OutlineCounts& other) {
  given += other.given;
  cut += other.cut;
  ellipses += other.ellipses;
  return *this;
}

std::string to_text(const OutlineCounts& counts) {
  return std::to_string(counts.given) + " of labels, " + std::to_string(counts.cut) +
         " cut out of their boxes, " + count_text(counts.ellipses, "ellipse");
}

namespace {

using Ring = std::vector<Point>;

/// The first pixel whose centre does not lie left of x (above it, in a column).
int first_pixel(double x, int width) {
  return static_cast<int>(std::clamp(std::ceil(x - 0.5), 0.0, double(width)));
}

/// Where an edge crosses the line through the centres of a row: left of which, and whether it
/// begins (clockwise, upwards) or ends a part.
struct Crossing {
  double x;
  int winding;
};

/// Calls visit(row, crossing) for every row whose centres the edge crosses.
template <class Visit>
void cross_rows(Point from, Point to, int height, const Visit& visit) {
  const int winding = from.y > to.y ? 1 : -1;
  if (winding > 0) std::swap(from, to);  // downwards, so that both ways round give the same places
  const int last = first_pixel(to.y, height);
  for (int row = first_pixel(from.y, height); row < last; ++row) {
    const double share = (row + 0.5 - from.y) / (to.y - from.y);
    visit(row, Crossing{from.x + share * (to.x - from.x), winding});
  }
}

/// Follows the edges of a mask's pixels with these on its right hand.
class EdgeTracer {
 public:
  explicit EdgeTracer(const GreyImage& mask) : mask_(mask), passed_(mask.pixels.size(), 0) {}

  Outline trace() {
    Outline found;
    for (int y = 0; y < mask_.size.height; ++y) {
      for (int x = 0; x < mask_.size.width; ++x) {
        // Every ring has an edge that runs to the right, the upper one of a pixel.
        if (mask_.pixels[index(x, y)] != 0 && !covered(x, y - 1) && !passed_[index(x, y)]) {
          found.rings.push_back(ring_from(x, y));
        }
      }
    }
    return found;
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(mask_.size.width) +
           static_cast<std::size_t>(x);
  }

  bool covered(int x, int y) const {
    return x >= 0 && y >= 0 && x < mask_.size.width && y < mask_.size.height &&
           mask_.pixels[index(x, y)] != 0;
  }

  Ring ring_from(int start_x, int start_y) {
    // Right, down, left, up: one step, and the pixels ahead on the right and on the left hand.
    struct Heading {
      int x, y, right_x, right_y, left_x, left_y;
    };
    static constexpr std::array<Heading, 4> kHeadings{
        {{1, 0, 0, 0, 0, -1}, {0, 1, -1, 0, 0, 0}, {-1, 0, -1, -1, -1, 0}, {0, -1, 0, -1, -1, -1}}};
    Ring ring;
    int x = start_x, y = start_y;
    std::size_t heading = 0;
    do {
      if (heading == 0) passed_[index(x, y)] = 1;
      x += kHeadings[heading].x;
      y += kHeadings[heading].y;
      const Heading& ahead = kHeadings[heading];
      std::size_t turned = heading;
      if (!covered(x + ahead.right_x, y + ahead.right_y)) {
        turned = (heading + 1) % 4;
      } else if (covered(x + ahead.left_x, y + ahead.left_y)) {
        turned = (heading + 3) % 4;
      }
      if (turned != heading) ring.push_back({double(x), double(y)});
      heading = turned;
    } while (x != start_x || y != start_y || heading != 0);
    return ring;
  }

  const GreyImage& mask_;
  std::vector<std::uint8_t> passed_;  ///< pixels whose upper edge lies in a ring
};

constexpr std::size_t kLeastCorners = 3;

}  // namespace

double twice_area(const Ring& ring) {
  double sum = 0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Point& a = ring[i];
    const Point& b = ring[(i + 1) % ring.size()];
    sum += a.x * b.y - b.x * a.y;
  }
  return sum;
}

bool has_area(const Ring& ring) {
  for (std::size_t i = 2; i < ring.size(); ++i) {
    const Point a{ring[i - 1].x - ring[0].x, ring[i - 1].y - ring[0].y};
    const Point b{ring[i].x - ring[0].x, ring[i].y - ring[0].y};
    if (a.x * b.y != b.x * a.y) return true;
  }
  return false;
}

namespace {

struct CornerHash {
  std::size_t operator()(const Point& corner) const {
    const std::hash<double> hash;
    return hash(corner.x) * 31 + hash(corner.y);
  }
};

/// What a ring consists of: a loop wherever it comes back to a corner. Lines there and back are
/// none, and nor is what lies between lines from each of three parts or more to the next.
std::vector<Ring> loops_of(const Ring& ring) {
  std::vector<Ring> loops;
  Ring path;
  std::vector<bool> has_loop;  // begins at this corner of the path
  std::unordered_map<Point, std::size_t, CornerHash> places;
  const auto keep = [&](Ring loop) {
    const bool is_kept = has_area(loop);
    if (is_kept) loops.push_back(std::move(loop));
    return is_kept;
  };
  std::size_t count = ring.size();
  while (count > 1 && ring[count - 1] == ring[0]) --count;
  for (std::size_t i = 0; i < count; ++i) {
    const auto [known, is_new] = places.try_emplace(ring[i], path.size());
    if (is_new) {
      path.push_back(ring[i]);
      has_loop.push_back(false);
      continue;
    }
    const std::size_t place = known->second;
    const auto begin = path.begin() + static_cast<std::ptrdiff_t>(place);
    if (keep({begin, path.end()})) has_loop[place] = true;
    for (auto corner = begin + 1; corner != path.end(); ++corner) places.erase(*corner);
    path.resize(place + 1);
    has_loop.resize(place + 1);
  }
  if (std::ranges::find(has_loop, false) != has_loop.end()) keep(std::move(path));
  return loops;
}

/// Whether the loop's first edge, and so all of it if they do not cross, lies within the other.
bool lies_in(const Ring& loop, const Ring& other) {
  const Point at{(loop[0].x + loop[1].x) / 2, (loop[0].y + loop[1].y) / 2};
  bool is_within = false;
  for (std::size_t i = 0; i < other.size(); ++i) {
    const Point& a = other[i];
    const Point& b = other[(i + 1) % other.size()];
    if ((a.y > at.y) == (b.y > at.y)) continue;
    if (a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x) > at.x) is_within = !is_within;
  }
  return is_within;
}

/// Turns loops that lie in no other to run clockwise, and with them what lies within.
void turn_clockwise(std::vector<Ring>& loops) {
  constexpr std::size_t kMost = 300;  // compared with each other: of more, the most area decides
  std::vector<double> areas;
  double sum = 0;
  for (const Ring& loop : loops) sum += areas.emplace_back(twice_area(loop));
  const bool are_alike = std::ranges::all_of(areas, [](double area) { return area >= 0; }) ||
                         std::ranges::all_of(areas, [](double area) { return area <= 0; });
  std::vector<bool> turned(loops.size(), sum < 0);
  for (std::size_t i = 0; !are_alike && loops.size() <= kMost && i < loops.size(); ++i) {
    double widest = areas[i];
    for (std::size_t j = 0; j < loops.size(); ++j) {
      if (std::abs(areas[j]) > std::abs(widest) && lies_in(loops[i], loops[j])) widest = areas[j];
    }
    turned[i] = widest < 0;
  }
  for (std::size_t i = 0; i < loops.size(); ++i) {
    if (turned[i]) std::ranges::reverse(loops[i]);
  }
}

}  // namespace

Outline outline_of_parts(const std::vector<std::vector<Point>>& parts, std::size_t* without_area) {
  Outline outline;
  if (without_area) *without_area = 0;
  for (const Ring& part : parts) {
    std::vector<Ring> loops = loops_of(part);
    if (without_area) *without_area += loops.empty();
    turn_clockwise(loops);
    std::ranges::move(loops, std::back_inserter(outline.rings));
  }
  return outline;
}

std::size_t corner_count(const Outline& outline) {
  std::size_t count = 0;
  for (const Ring& ring : outline.rings) count += ring.size();
  return count;
}

template <class Pixel>
std::size_t corner_count(const std::vector<Pixel>& pixels, ImageSize size) {
  const auto at = [&](int y, int x) {
    return y < 0 || x < 0 || y == size.height || x == size.width
               ? Pixel{0}
               : pixels[std::size_t(y) * std::size_t(size.width) + std::size_t(x)];
  };
  std::size_t count = 0;
  for (int y = 0; y <= size.height; ++y) {
    std::array<Pixel, 4> around{};  // the pixels around a place where four meet, row by row
    for (int x = 0; x <= size.width; ++x) {
      around = {around[1], at(y - 1, x), around[3], at(y, x)};
      for (std::size_t i = 0; i < 4; ++i) {
        // A pixel has a corner there if its two neighbours are alike: both its own, and not the
        // one across, or both not.
        const Pixel own = around[i];
        const bool left = around[i ^ 1] == own, up = around[i ^ 2] == own;
        if (own != 0 && left == up && (!left || around[i ^ 3] != own)) ++count;
      }
    }
  }
  return count;
}
template std::size_t corner_count(const std::vector<std::uint8_t>& pixels, ImageSize size);
template std::size_t corner_count(const std::vector<std::uint16_t>& pixels, ImageSize size);

Outline outline_of(const GreyImage& mask) { return EdgeTracer(mask).trace(); }

GreyImage mask_of(const Outline& outline, ImageSize size, FillRule rule) {
  GreyImage mask{size, std::vector<std::uint8_t>(size.pixel_count())};
  std::vector<std::vector<Crossing>> rows(static_cast<std::size_t>(size.height));
  for (const Ring& ring : outline.rings) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      cross_rows(ring[i], ring[(i + 1) % ring.size()], size.height,
                 [&](int row, Crossing crossing) { rows[std::size_t(row)].push_back(crossing); });
    }
  }
  for (std::size_t y = 0; y < rows.size(); ++y) {
    std::sort(rows[y].begin(), rows[y].end(),
              [](const Crossing& a, const Crossing& b) { return a.x < b.x; });
    const auto row = mask.pixels.begin() + static_cast<std::ptrdiff_t>(y) * size.width;
    int winding = 0;
    for (std::size_t i = 0; i + 1 < rows[y].size(); ++i) {
      winding += rows[y][i].winding;
      if (winding == 0 || (rule == FillRule::kByTurns && winding % 2 == 0)) continue;
      const int begin = first_pixel(rows[y][i].x, size.width);
      std::fill(row + begin, row + std::max(begin, first_pixel(rows[y][i + 1].x, size.width)),
                std::uint8_t{1});
    }
  }
  return mask;
}

Rectangle bounds(const Outline& outline) {
  if (outline.empty()) return {};
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Rectangle around{kFar, kFar, -kFar, -kFar};
  for (const Ring& ring : outline.rings) {
    for (const Point& corner : ring) {
      around = {std::min(around.left, corner.x), std::min(around.top, corner.y),
                std::max(around.right, corner.x), std::max(around.bottom, corner.y)};
    }
  }
  return around;
}

std::vector<std::uint32_t> run_lengths(const GreyImage& mask) {
  std::vector<std::uint32_t> runs{0};
  bool covered = false;
  const auto width = static_cast<std::size_t>(mask.size.width);
  for (std::size_t x = 0; x < width; ++x) {
    for (std::size_t i = x; i < mask.pixels.size(); i += width) {
      if ((mask.pixels[i] != 0) != covered) {
        covered = !covered;
        runs.push_back(0);
      }
      ++runs.back();
    }
  }
  return runs;
}

std::optional<GreyImage> mask_of(const std::vector<std::uint32_t>& runs, ImageSize size) {
  if (std::accumulate(runs.begin(), runs.end(), std::uint64_t{0}) != size.pixel_count()) {
    return std::nullopt;
  }
  GreyImage mask{size, std::vector<std::uint8_t>(size.pixel_count())};
  const auto width = std::size_t(size.width), height = std::size_t(size.height);
  std::size_t done = 0;
  for (std::size_t i = 0; i < runs.size(); done += runs[i], ++i) {
    if (i % 2 == 0 || runs[i] == 0) continue;
    std::size_t x = done / height, y = done % height;
    for (std::uint32_t left = runs[i]; left > 0; --left) {
      mask.pixels[y * width + x] = 1;
      if (++y < height) continue;
      y = 0;
      ++x;
    }
  }
  return mask;
}

std::string compressed(const std::vector<std::uint32_t>& runs) {
  std::string text;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    std::int64_t number = runs[i];
    if (i > 2) number -= runs[i - 2];
    for (bool more = true; more;) {
      const auto bits = number & 31;
      number >>= 5;
      more = number != ((bits & 16) != 0 ? -1 : 0);
      text.push_back(static_cast<char>(bits + (more ? 32 : 0) + 48));
    }
  }
  return text;
}

std::optional<std::vector<std::uint32_t>> run_lengths(std::string_view compressed) {
  std::vector<std::uint32_t> runs;
  for (std::size_t at = 0; at < compressed.size();) {
    std::int64_t number = 0;
    for (int shift = 0;; shift += 5) {
      if (at == compressed.size() || shift > 35) return std::nullopt;
      const int bits = static_cast<unsigned char>(compressed[at++]) - 48;
      if (bits < 0 || bits > 63) return std::nullopt;
      number |= std::int64_t{bits & 31} << shift;
      if ((bits & 32) != 0) continue;
      if ((bits & 16) != 0) number -= std::int64_t{32} << shift;
      break;
    }
    if (runs.size() > 2) number += runs[runs.size() - 2];
    if (number < 0 || number > std::numeric_limits<std::uint32_t>::max()) return std::nullopt;
    runs.push_back(static_cast<std::uint32_t>(number));
  }
  return runs;
}

std::string outline_text(const Outline& outline) {
  if (outline.empty()) return "";
  std::string text = "[";
  const auto append = [&](double coordinate, char behind) {
    std::array<char, 32> digits{};
    char* const end = std::to_chars(digits.data(), digits.data() + digits.size(),
                                    static_cast<float>(coordinate), std::chars_format::fixed)
                          .ptr;
    text.append(digits.data(), end).push_back(behind);
  };
  for (const Ring& ring : outline.rings) {
    text.push_back('[');
    for (const Point& corner : ring) {
      append(corner.x, ',');
      append(corner.y, ',');
    }
    text.back() = ']';
    text.push_back(',');
  }
  text.back() = ']';
  return text;
}

std::optional<Outline> read_outline(std::string_view text) {
  Outline outline;
  if (text.empty()) return outline;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto take = [&](char expected) { return at != end && *at == expected && (++at, true); };
  if (!take('[')) return std::nullopt;
  do {
    if (!take('[')) return std::nullopt;
    Ring& ring = outline.rings.emplace_back();
    do {
      std::array<float, 2> corner{};
      for (float& coordinate : corner) {
        if (&coordinate != corner.data() && !take(',')) return std::nullopt;
        const auto read = std::from_chars(at, end, coordinate);
        if (read.ec != std::errc() || !std::isfinite(coordinate)) return std::nullopt;
        at = read.ptr;
      }
      ring.push_back({corner[0], corner[1]});
    } while (take(','));
    if (!take(']') || ring.size() < kLeastCorners) return std::nullopt;
  } while (take(','));
  return take(']') && at == end ? std::optional(std::move(outline)) : std::nullopt;
}

}  // namespace eventgan
