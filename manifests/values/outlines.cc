#include "manifests/values/outlines.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace eventgan {
namespace {

using Ring = std::vector<Point>;

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
  const double first = std::max(std::ceil(from.y - 0.5), 0.0);
  const double last = std::min(std::ceil(to.y - 0.5), double(height));
  for (int row = static_cast<int>(first); row < last; ++row) {
    const double share = (row + 0.5 - from.y) / (to.y - from.y);
    visit(row, Crossing{from.x + share * (to.x - from.x), winding});
  }
}

/// The first pixel whose centre does not lie left of x.
int first_pixel(double x, int width) {
  return static_cast<int>(std::clamp(std::ceil(x - 0.5), 0.0, double(width)));
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
        if (covered(x, y) && !covered(x, y - 1) && !passed_[index(x, y)]) {
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

Outline outline_of_parts(std::vector<std::vector<Point>> parts) {
  Outline outline;
  for (Ring& ring : parts) {
    const double area = twice_area(ring);
    if (ring.size() < kLeastCorners || area == 0) continue;
    if (area < 0) std::reverse(ring.begin(), ring.end());
    outline.rings.push_back(std::move(ring));
  }
  return outline;
}

Outline outline_of(const GreyImage& mask) { return EdgeTracer(mask).trace(); }

GreyImage mask_of(const Outline& outline, ImageSize size) {
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
      if (winding == 0) continue;
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
  const std::size_t count = size.pixel_count();
  GreyImage mask{size, std::vector<std::uint8_t>(count)};
  std::size_t done = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i] > count - done) return std::nullopt;
    const std::size_t end = done + runs[i];
    for (; done < end; ++done) {
      const std::size_t x = done / std::size_t(size.height), y = done % std::size_t(size.height);
      mask.pixels[y * std::size_t(size.width) + x] = i % 2;
    }
  }
  return done == count ? std::optional(std::move(mask)) : std::nullopt;
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
