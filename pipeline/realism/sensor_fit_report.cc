#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "manifests/values/sensor_input.h"
#include "manifests/values/text.h"
#include "pipeline/realism/sensor_fit.h"

namespace eventgan {
namespace {

std::string number_text(double number, const Bounds& bounds) {
  std::string text = fmt::format("{:.3g}", number);
  const double half = (bounds.high - bounds.low) / 2;
  if (!std::isnan(half)) text += fmt::format(" ± {:.2g}", half);
  return text;
}

std::string threshold_text(const FittedThreshold& fitted) {
  return number_text(fitted.threshold.mean, fitted.mean);
}

std::string range_text(const std::array<double, 2>& range) {
  if (range[0] == range[1]) return fmt::format("{:.3g}", range[0]);
  return fmt::format("{:.3g}..{:.3g}", range[0], range[1]);
}

std::string noise_text(const NoiseFit& fit) {
  return fmt::format(
      "noise of pixels that stay still: shot_hz {}, leak_hz {}, hot_pixels {:.3g} ({} of them)\n"
      "  {:.3g} positive and {:.3g} negative events per pixel and second, from {} pixels, {:.3g} s "
      "each, of {}\n",
      range_text(fit.noise.shot_hz), range_text(fit.noise.leak_hz), fit.noise.hot_pixels[0],
      fit.hot_pixels, fit.positive_hz, fit.negative_hz, fit.pixels,
      fit.pixel_seconds / static_cast<double>(fit.pixels), count_text(fit.pairs, "pair"));
}

}  // namespace

std::string to_text(const SensorFit& fit) {
  std::string text = fmt::format(
      "pairs of frames: {} fitted, {} kept aside; mean grey level {:.3g}, {:.3g}..{:.3g}\n",
      fit.fitted_pairs, fit.kept_pairs, fit.grey_level, fit.grey_levels[0], fit.grey_levels[1]);
  if (fit.difference || fit.network) {
    text += fmt::format(
        "contrast threshold of ln(u/255 + {}), with which as many events are made "
        "as the camera's, less its noise:\n",
        kFrameLogEpsilon);
  }
  if (fit.difference) {
    text += "  difference: " + threshold_text(*fit.difference);
    if (fit.difference_anew) {
      text +=
          fmt::format("; {:.3g} if each pair begins anew, as with convert", *fit.difference_anew);
    }
    text += "\n";
  }
  if (fit.network) {
    text += fmt::format("  network: {}, negative ÷ positive {}\n", threshold_text(*fit.network),
                        number_text(fit.network->threshold.ratio, fit.network->ratio));
  }
  if (fit.noise) text += noise_text(*fit.noise);
  if (fit.rows.empty()) return text;
  text +=
      fmt::format("{:22} {:>16} {:>12}\n", "pairs kept aside", "events per pixel", "÷ camera's");
  for (const EventRow& row : fit.rows) {
    const double camera = fit.rows.front().events_per_pixel;
    text += fmt::format("{:22} {:16.4f} {:>12}\n", row.name, row.events_per_pixel,
                        camera > 0 ? fmt::format("{:.2f}", row.events_per_pixel / camera) : "-");
  }
  return text;
}

std::string verdict_text(const SensorFit& fit, const std::string& document,
                         const std::string& weights) {
  std::string text;
  const auto judge = [&](const std::string& method, const std::string& key) {
    const std::optional<bool> is_better = fit.is_better(method);
    if (!is_better) {
      text += fmt::format(
          "{}: no verdict on the threshold: too few pairs are kept aside (a quarter of four or "
          "more)\n",
          method);
      return;
    }
    const auto share = [&](const char* which) {
      const auto row = std::ranges::find(fit.rows, method + which, &EventRow::name);
      return row->events_per_pixel / fit.rows.front().events_per_pixel;
    };
    const std::string shares =
        fmt::format("{:.2f} times the camera's events on the pairs kept aside, by default {:.2f}",
                    share(", fitted"), share(", default"));
    text += *is_better ? fmt::format(
                             "{}: the fitted threshold is better than the default ({}). "
                             "Put this line into the manifest:\n"
                             "  \"generator\": {{ {}, \"sensor\": \"{}\" }}\n",
                             method, shares, key, document)
                       : fmt::format("{}: keep the default: the fitted threshold is worse ({})\n",
                                     method, shares);
  };
  if (fit.network) judge("network", fmt::format("\"weights\": \"{}\"", weights));
  if (fit.difference_anew) judge("difference", "\"kind\": \"difference\"");
  return text;
}

std::string origin_text(const SensorFit& fit, const std::string& weights) {
  std::string text = fmt::format("{} of frames of mean grey level {:.3g} ({:.3g}..{:.3g})",
                                 count_text(fit.fitted_pairs, "pair"), fit.grey_level,
                                 fit.grey_levels[0], fit.grey_levels[1]);
  if (fit.network) {
    text += fmt::format("; threshold {} through {}", threshold_text(*fit.network), weights);
  }
  if (fit.difference_anew) {
    text += fmt::format("; threshold {:.3g} of difference, of pairs that begin anew",
                        *fit.difference_anew);
  }
  if (fit.noise) {
    text += fmt::format("; noise of {:.3g} pixel seconds", fit.noise->pixel_seconds);
  }
  return text;
}

}  // namespace eventgan
