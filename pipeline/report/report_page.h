#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "pipeline/report/survey.h"

namespace eventgan {

/// The page's name beside the shards.
inline constexpr char kReportName[] = "report.html";

/// What a page shows besides the numbers.
struct PageContext {
  std::filesystem::path folder;  ///< of the shards
  std::filesystem::path file;    ///< where the page will be: links to shards start there
  std::string warning;           ///< of the weights, shown in red; empty: there is none
  /// The bytes of a JPEG that shows a sample; at most kMostImageBytes.
  std::function<std::string(const PickedSample&)> image;

  static constexpr std::size_t kMostImageBytes = 60'000;
};

/// The survey as one HTML page that needs nothing else: no network, no script. Below 5 MB for any
/// survey: lists and texts are cut, images are few. Numbers are in elements with `data-key`, as
/// `data-value` without ornament. Text that comes from outside is escaped.
std::string report_page(const Survey& survey, const PageContext& context);

}  // namespace eventgan
