#include "pipeline/report/report_page.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "pipeline/runtime/progress.h"
#include "stages/base/charts/svg_chart.h"

namespace eventgan {

namespace fs = std::filesystem;

namespace {

// ---- Numbers

/// 1234567 as 1 234 567, with narrow spaces that do not break.
std::string grouped(std::int64_t number) {
  std::string digits = std::to_string(number);
  for (std::ptrdiff_t at = std::ssize(digits) - 3; at > 0; at -= 3) {
    digits.insert(static_cast<std::size_t>(at), "\u202F");
  }
  return digits;
}

std::string percent(std::int64_t part, std::int64_t whole) {
  if (whole == 0) return "–";
  return fmt::format("{:.3g} %", 100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

std::string seconds_text(double seconds) {
  return seconds < 60 ? fmt::format("{:.3g} s", seconds) : duration_text(seconds, "dhms");
}

/// A cell with a number that a program can read.
std::string cell(const std::string& key, std::int64_t number) {
  return fmt::format("<td class=n data-key=\"{}\" data-value=\"{}\">{}</td>", escaped(key), number,
                     grouped(number));
}

std::string text_cell(const std::string& html) { return "<td>" + html + "</td>"; }
std::string right_cell(const std::string& html) { return "<td class=n>" + html + "</td>"; }

/// A table that scrolls by itself where the page is too narrow; a glow at an edge says that there
/// is more beyond it. `columns`: headings; those that begin with '#' are of numbers. At most
/// `kMostRows` rows.
constexpr std::size_t kMostRows = 60;

std::string table(const std::vector<std::string>& columns, const std::vector<std::string>& rows) {
  std::string html = "<div class=scroll><table><thead><tr>";
  for (const std::string& column : columns) {
    html += column.starts_with('#') ? "<th class=n>" + column.substr(1) : "<th>" + column;
    html += "</th>";
  }
  html += "</tr></thead><tbody>";
  for (std::size_t i = 0; i < std::min(rows.size(), kMostRows); ++i) {
    html += "<tr>" + rows[i] + "</tr>";
  }
  html += "</tbody></table></div>";
  if (rows.size() > kMostRows) {
    html += fmt::format("<p class=note>… and {} more</p>", grouped(std::ssize(rows) - kMostRows));
  }
  return html;
}

// ---- Charts

std::string figure(const std::string& key, const Chart& chart) {
  return fmt::format("<figure data-key=\"{}\"><figcaption>{}</figcaption>", key,
                     escaped(chart.title)) +
         chart_svg(chart) + "</figure>";
}

/// The bins that are occupied by any of the histograms, as labels of edges and series.
void fill(Chart& chart, const std::vector<std::pair<std::string, const LogHistogram*>>& of) {
  const int bins = static_cast<int>(std::size(LogHistogram().counts));
  int first = bins, last = -1;
  for (const auto& [name, histogram] : of) {
    for (int bin = 0; bin < bins; ++bin) {
      if (histogram->counts[static_cast<std::size_t>(bin)] == 0) continue;
      first = std::min(first, bin);
      last = std::max(last, bin);
    }
  }
  if (last < 0) return;
  for (int bin = first; bin <= last + 1; ++bin) {
    const double edge = LogHistogram::edge(bin);
    chart.labels.push_back(edge < 100 ? fmt::format("{:.2g}", edge) : fmt::format("{:.0f}", edge));
  }
  for (const auto& [name, histogram] : of) {
    const auto begin = histogram->counts.begin();
    chart.series.push_back({name, {begin + first, begin + last + 1}});
  }
}

// ---- The page's parts

std::string base64(const std::string& bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

/// A path as a link: every byte but letters, digits and "-._~/" as %XX.
std::string url_of(const fs::path& path) {
  std::string url;
  for (const char c : path.generic_string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("-._~/").find(c) != std::string_view::npos;
    url += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return url;
}

std::string shard_link(const PageContext& context, const std::string& shard) {
  std::error_code error;
  const fs::path page = fs::absolute(context.file, error).parent_path();
  const fs::path target = fs::absolute(context.folder, error) / shard;
  const fs::path link = target.lexically_normal().lexically_relative(page.lexically_normal());
  return fmt::format("<a href=\"{}\">{}</a>", url_of(link.empty() ? target : link), escaped(shard));
}

std::string source_name(const Survey& survey, std::size_t source) {
  const SourceSpec& spec = survey.parts.manifest.sources[source];
  std::string name(to_string(spec.dataset));
  const auto same = std::ranges::count_if(survey.parts.manifest.sources, [&](const auto& other) {
    return other.dataset == spec.dataset && other.split == spec.split;
  });
  name += " " + spec.split;
  return same > 1 ? fmt::format("{} ({})", name, source + 1) : name;
}

std::string tile(const std::string& key, std::int64_t number, const std::string& name,
                 const std::string& shown = "") {
  return fmt::format("<div class=tile><b data-key=\"{}\" data-value=\"{}\">{}</b>{}</div>", key,
                     number, shown.empty() ? grouped(number) : shown, name);
}

std::string head(const Survey& survey, const PageContext& context) {
  const DatasetParts& parts = survey.parts;
  const std::size_t missing = parts.missing.size();
  std::string html = fmt::format(
      "<header><h1>{}</h1><p>Event volumes (voxel grids of events) of labelled frames, made by {}. "
      "{}</p></header>",
      escaped(parts.frozen.plan.name), escaped(survey.header.program_version),
      missing == 0 ? "All shards are done."
                   : fmt::format("<strong class=bad>Missing or damaged: {} of {} "
                                 "shards</strong>, the numbers cover the rest.",
                                 grouped(std::ssize(parts.missing)),
                                 grouped(std::ssize(parts.frozen.plan.shards))));
  if (!context.warning.empty()) {
    html += "<p class=warning data-key=warning>Warning: " + escaped(context.warning, 1000) + "</p>";
  }
  for (std::size_t i = 0; i < std::min(survey.sources.size(), kMostRows); ++i) {
    const SourceSurvey& source = survey.sources[i];
    if (source.counts.valid == 0 || source.events_per_pixel.zeros < source.counts.valid) continue;
    html += fmt::format(
        "<p class=warning data-key=source.{}.warning>Warning: all {} volumes of {} contain no "
        "events.</p>",
        i, grouped(source.counts.valid), escaped(source_name(survey, i)));
  }
  const DatasetCounts& counts = survey.counts;
  html += "<div class=tiles>" + tile("samples", counts.samples, "samples") +
          tile("quarantined", counts.quarantined(), "of them quarantined") +
          tile("boxes", counts.boxes, "boxes") +
          tile("persons", counts.persons, "persons with joints") +
          tile("shards", counts.shards, "shards") +
          tile("size_bytes", counts.size_bytes, "on disk", bytes_text(counts.size_bytes)) +
          "</div>";
  return html;
}

std::string fact(const std::string& name, const std::string& html) {
  return "<tr><th>" + name + "</th><td>" + html + "</td></tr>";
}

std::string origin(const Survey& survey, const PageContext& context) {
  constexpr std::size_t kMostText = 40'000;
  const DatasetParts& parts = survey.parts;
  const JobManifest& manifest = parts.manifest;
  const ShardHeader& header = survey.header;
  std::string html = "<section><h2>Inputs and settings</h2><div class=scroll><table class=facts>";
  for (std::size_t i = 0; i < std::min(manifest.sources.size(), kMostRows); ++i) {
    const SourceSpec& source = manifest.sources[i];
    if (has_events(source.dataset)) {
      html += fact("source", fmt::format("windows of events of {} from <code>{}</code>",
                                         escaped(source_name(survey, i)), escaped(source.root)));
      continue;
    }
    if (const auto& stills = source.pairs.stills) {
      html +=
          fact("source",
               fmt::format("stills of {} from <code>{}</code>, moved {} the labelled image: {:g} "
                           "to {:g} px, up to {:g} degrees, scale 1 &plusmn; {:g}, gap {}{}",
                           escaped(source_name(survey, i)), escaped(source.root),
                           to_string(source.pairs.side), stills->translation_px[0],
                           stills->translation_px[1], stills->rotation_deg, stills->scale,
                           stills->frames, stills->objects ? "; objects move on their own" : ""));
      continue;
    }
    html += fact("source",
                 fmt::format("{} from <code>{}</code>, gaps {} {} the labelled frame, {} of them",
                             escaped(source_name(survey, i)), escaped(source.root),
                             fmt::join(source.pairs.gaps, ", "), to_string(source.pairs.side),
                             to_string(source.pairs.choose)));
  }
  html += fact("generator", escaped(header.generator));
  if (!header.weights.empty()) {
    html += fact("weights", fmt::format("<code>{}</code>, SHA-256 <code>{}</code>",
                                        escaped(header.weights), escaped(header.weights_hash)));
  }
  html += fact(
      "volumes",
      fmt::format(
          "2 polarities × {} bins, {} pixels{}, {}{}, values {}", header.volume.bins,
          to_string(header.volume.size),
          manifest.image.size ? "" : " (of the first shard, each image has its own)",
          to_string(header.dtype), header.scope.empty() ? "" : ", scope " + escaped(header.scope),
          header.unit == VolumeUnit::kLearned ? "are dimensionless, about 0–1" : "count events"));
  if (!manifest.image.preset.empty()) {
    html += fact("preset", "<code>" + escaped(manifest.image.preset) + "</code>");
  }
  html += fact("preprocessing", "<code>" + escaped(header.preprocessing) + "</code>");
  html += fact("plan", "<code>" + escaped(header.plan_hash) + "</code>, seed " +
                           std::to_string(manifest.seed));
  html +=
      fact("folder", "<code>" + escaped(fs::absolute(context.folder).lexically_normal().string()) +
                         "</code>");
  html += "</table></div><details><summary>The manifest</summary><pre>" +
          escaped(parts.frozen.plan.manifest_text, kMostText) + "</pre></details>";
  const auto fields = amended(parts.frozen.plan.fingerprint, parts.amendments);
  html += "<details><summary>Inputs, libraries and processor that decided the bytes</summary>";
  std::vector<std::string> rows;
  for (const auto& [field, value] : fields) {
    if (!field.starts_with("manifest ")) {
      rows.push_back(text_cell(escaped(field)) + text_cell("<code>" + escaped(value) + "</code>"));
    }
  }
  return html + table({"field", "value"}, rows) + "</details></section>";
}

std::string counts_cells(const std::string& key, const DatasetCounts& counts) {
  return cell(key + ".samples", counts.samples) + cell(key + ".quarantined", counts.quarantined()) +
         cell(key + ".boxes", counts.boxes) + cell(key + ".persons", counts.persons) +
         cell(key + ".shards", counts.shards) + right_cell(bytes_text(counts.size_bytes));
}

std::string counts_of(const std::map<std::string, DatasetCounts>& by_name,
                      const std::string& what) {
  std::vector<std::string> rows;
  for (const auto& [name, counts] : by_name) {
    rows.push_back(text_cell(escaped(name)) + counts_cells(what + "." + name, counts));
  }
  return "<h3>By " + what + "</h3>" +
         table({what, "#samples", "#quarantined", "#boxes", "#persons with joints", "#shards",
                "#size"},
               rows);
}

std::string counts(const Survey& survey) {
  std::string html = "<section><h2>Contents</h2>";
  std::vector<std::string> rows;
  for (std::size_t i = 0; i < survey.sources.size(); ++i) {
    const SourceSummary& summary = survey.parts.frozen.plan.sources.at(i);
    rows.push_back(
        text_cell(escaped(source_name(survey, i))) +
        cell(fmt::format("source.{}.labelled_frames", i), summary.labelled_frames) +
        cell(fmt::format("source.{}.unpaired", i), summary.unpaired) +
        cell(fmt::format("source.{}.empty", i), survey.sources[i].events_per_pixel.zeros) +
        counts_cells(fmt::format("source.{}", i), survey.sources[i].counts));
  }
  html += "<h3>By source</h3>" +
          table({"source", "#labelled frames", "#without paired frame", "#volumes without events",
                 "#samples", "#quarantined", "#boxes", "#persons with joints", "#shards", "#size"},
                rows);
  if (survey.datasets.size() > 1) html += counts_of(survey.datasets, "dataset");
  if (survey.splits.size() > 1) html += counts_of(survey.splits, "split");

  html += "<div class=columns>";
  rows.clear();
  for (const auto& [number, gap] : survey.gaps) {
    rows.push_back(right_cell(std::to_string(number)) +
                   cell(fmt::format("gap.{}", number), gap.samples) +
                   cell(fmt::format("gap.{}.extrapolated", number), gap.extrapolated) +
                   right_cell(!gap.least_s ? "unknown"
                              : *gap.most_s - *gap.least_s < 5e-4
                                  ? fmt::format("{:.3g}", *gap.least_s)
                                  : fmt::format("{:.3g} – {:.3g}", *gap.least_s, *gap.most_s)));
  }
  html += "<div><h3>By gap</h3>" + table({"#gap", "#samples", "#extrapolated", "#seconds"}, rows) +
          "</div>";
  std::vector<std::pair<std::string, std::int64_t>> classes(survey.counts.classes.begin(),
                                                            survey.counts.classes.end());
  std::ranges::stable_sort(classes, std::greater(), &std::pair<std::string, std::int64_t>::second);
  rows.clear();
  for (const auto& [name, boxes] : classes) {
    const auto found = survey.narrow_boxes.find(name);
    const std::int64_t narrow = found == survey.narrow_boxes.end() ? 0 : found->second;
    rows.push_back(text_cell(escaped(name)) + cell("class." + name, boxes) +
                   right_cell(percent(boxes, survey.counts.boxes)) +
                   cell("class." + name + ".narrow", narrow));
  }
  if (!rows.empty()) {
    html += "<div><h3>Boxes by class</h3>" + table({"class", "#boxes", "#share", "#narrow"}, rows) +
            fmt::format(
                "<p class=note>Narrow: not to be ignored, and with a shorter side of less "
                "than {:g} volume pixels. Detectors learn few of these: enlarge their "
                "input, or make larger volumes.</p></div>",
                Survey::kNarrowPx);
  }
  rows.clear();
  for (const auto& [flag, samples] : survey.flags) {
    rows.push_back(text_cell(escaped(flag)) + cell("flag." + flag, samples) +
                   right_cell(percent(samples, survey.counts.valid)));
  }
  html += "<div><h3>Flags</h3>" +
          (rows.empty() ? "<p class=note>No volume is empty, extrapolated or saturated.</p>"
                        : table({"flag", "#volumes", "#share"}, rows)) +
          "</div></div></section>";
  return html;
}

/// Said where a number is of some of the volumes.
std::string of_volumes(const Survey& survey) {
  return survey.volumes == survey.counts.valid
             ? fmt::format("all {} volumes", grouped(survey.volumes))
             : fmt::format("{} of {} volumes, drawn with the manifest's seed",
                           grouped(survey.volumes), grouped(survey.counts.valid));
}

std::string histograms(const Survey& survey) {
  const bool is_counted = survey.header.unit != VolumeUnit::kLearned;
  const std::string unit = is_counted ? "events per pixel, mean over the volume"
                                      : "sum of a pixel's values, mean over the volume";
  std::string html = "<section><h2>Distributions</h2><div class=charts>";

  Chart density{"Events per pixel", unit, "samples"};
  density.stacked = true;
  std::vector<std::pair<std::string, const LogHistogram*>> of;
  LogHistogram rest;
  std::int64_t zeros = 0;
  constexpr std::size_t kMostSeries = 6;
  for (std::size_t i = 0; i < survey.sources.size(); ++i) {
    const LogHistogram& histogram = survey.sources[i].events_per_pixel;
    zeros += histogram.zeros;
    if (survey.sources.size() <= kMostSeries || i + 1 < kMostSeries) {
      of.emplace_back(source_name(survey, i), &histogram);
      continue;
    }
    for (std::size_t bin = 0; bin < rest.counts.size(); ++bin)
      rest.counts[bin] += histogram.counts[bin];
  }
  if (survey.sources.size() > kMostSeries) of.emplace_back("others", &rest);
  fill(density, of);
  if (zeros > 0)
    density.title += fmt::format(" ({} volumes without events are left out)", grouped(zeros));
  html += figure("events_per_pixel", density);

  Chart gaps{"Gaps", "frames from the pair's first frame to its second", "samples", {{"", {}}}};
  for (const auto& [number, gap] : survey.gaps) {
    gaps.labels.push_back(std::to_string(number));
    gaps.series[0].y.push_back(static_cast<double>(gap.samples));
  }
  html += figure("gaps", gaps);

  Chart bins{
      "Time bins by polarity, " + of_volumes(survey),
      "time bin, first to last",
      "mean pixel value",
      {{"brighter (positive)", survey.positive_bins}, {"darker (negative)", survey.negative_bins}}};
  for (std::size_t bin = 0; bin < survey.positive_bins.size(); ++bin) {
    bins.labels.push_back(std::to_string(bin + 1));
  }
  html += figure("time_bins", bins);

  if (survey.counts.boxes > 0) {
    Chart sides{"Box sizes", "√(width × height) in volume pixels", "boxes"};
    fill(sides, {{"", &survey.box_sides}});
    if (survey.box_sides.zeros > 0) {
      sides.title +=
          fmt::format(" ({} without area are left out)", grouped(survey.box_sides.zeros));
    }
    html += figure("box_sides", sides);
  }
  return html + "</div></section>";
}

std::string label_table(const std::string& what, const std::map<std::string, LabelSurvey>& labels) {
  if (labels.empty()) return "";
  std::vector<std::pair<std::string, LabelSurvey>> sorted(labels.begin(), labels.end());
  const auto share = [](const LabelSurvey& label) {
    return static_cast<double>(label.without_events) / static_cast<double>(label.looked_at);
  };
  std::ranges::stable_sort(sorted, [&](const auto& one, const auto& other) {
    return share(one.second) > share(other.second);
  });
  std::vector<std::string> rows;
  for (const auto& [name, label] : sorted) {
    rows.push_back(text_cell(escaped(name)) +
                   cell(what + "." + name + ".looked_at", label.looked_at) +
                   cell(what + "." + name + ".without_events", label.without_events) +
                   right_cell(percent(label.without_events, label.looked_at)));
  }
  return "<div class=tall>" + table({what, "#checked", "#without events", "#share"}, rows) +
         "</div>";
}

std::string labels_without_events(const Survey& survey) {
  if (survey.classes.empty() && survey.joints.empty()) return "";
  return fmt::format(
      "<section><h2>Labels without events</h2><p class=note>Based on {}. A pixel has events if its "
      "values sum to at least {:g}. A box is without events if less than {:g} % of its pixels have "
      "any, a joint if no pixel within {} px has any.</p><div class=columns>{}{}</div></section>",
      of_volumes(survey), Survey::kEventSum, 100 * Survey::kBoxShare, Survey::kJointRadius,
      label_table("class", survey.classes), label_table("joint", survey.joints));
}

std::string images(const Survey& survey, const PageContext& context) {
  std::string html =
      "<section><h2>Samples</h2><p class=note>The labelled frame and the events between the pair's "
      "two frames: blue is early, red is late, bright is many. Random samples are drawn with the "
      "manifest's seed.</p>";
  for (std::size_t i = 0; i < survey.sources.size(); ++i) {
    if (survey.sources[i].picked.empty()) continue;
    html += "<h3>" + escaped(source_name(survey, i)) + "</h3><div class=images>";
    for (const PickedSample& sample : survey.sources[i].picked) {
      html += fmt::format(
          "<figure data-key=image><img alt=\"{}\" src=\"data:image/jpeg;base64,{}\"><figcaption>"
          "<b>{}</b> {} · slot {} of {}</figcaption></figure>",
          escaped(sample.sample_id), base64(context.image(sample)), escaped(sample.why),
          escaped(sample.sample_id), sample.slot, shard_link(context, sample.shard));
    }
    html += "</div>";
  }
  return html + "</section>";
}

std::string quarantine(const Survey& survey, const PageContext& context) {
  std::string html = "<section><h2>Quarantined samples</h2>";
  if (survey.faults.empty()) return html + "<p class=note>None.</p></section>";
  std::vector<std::pair<std::string, FaultSurvey>> faults(survey.faults.begin(),
                                                          survey.faults.end());
  std::ranges::stable_sort(faults, [](const auto& one, const auto& other) {
    return one.second.samples > other.second.samples;
  });
  std::vector<std::string> rows;
  for (const auto& [kind, fault] : faults) {
    rows.push_back(right_cell(grouped(fault.samples)) + text_cell(escaped(kind)) +
                   text_cell(escaped(fault.first.sample_id)));
  }
  html += table({"#samples", "reason", "first"}, rows);
  rows.clear();
  for (const QuarantinedSlot& sample : survey.quarantined) {
    rows.push_back(text_cell(escaped(sample.sample_id)) +
                   text_cell(shard_link(context, sample.shard)) +
                   right_cell(std::to_string(sample.slot)) + text_cell(escaped(sample.reason)));
  }
  html += fmt::format("<details><summary>The first {}</summary>", survey.quarantined.size()) +
          table({"sample", "shard", "#slot", "reason"}, rows) + "</details>";
  return html +
         "<p class=note><code>eventgan retry</code> makes them once their inputs are "
         "fixed.</p></section>";
}

std::string time(const Survey& survey) {
  double busy = 0;
  for (const auto& [stage, seconds] : survey.stage_seconds) busy += seconds;
  std::vector<std::string> rows;
  const auto samples = static_cast<double>(std::max<std::int64_t>(survey.counts.samples, 1));
  for (const auto& [stage, seconds] : survey.stage_seconds) {
    rows.push_back(text_cell(escaped(stage)) + right_cell(seconds_text(seconds)) +
                   right_cell(busy > 0 ? fmt::format("{:.3g} %", 100 * seconds / busy) : "–") +
                   right_cell(fmt::format("{:.3g} ms", 1e3 * seconds / samples)));
  }
  rows.push_back(text_cell("<b>all stages</b>") + right_cell(seconds_text(busy)) + right_cell("") +
                 right_cell(fmt::format("{:.3g} ms", 1e3 * busy / samples)));
  std::string html = "<section><h2>Time and memory</h2>" +
                     table({"stage", "#busy", "#share", "#per sample"}, rows);
  html += fmt::format(
      "<p class=note>Busy time of all threads in the runs that committed the shards. From commit "
      "to commit the workers took {} in total, {:.3g} samples per second and worker. All stages "
      "run in one process: {}.</p></section>",
      seconds_text(survey.wall_seconds),
      survey.wall_seconds > 0 ? samples / survey.wall_seconds : 0.0,
      survey.peak_bytes > 0 ? fmt::format("the largest worker had <span data-key=peak_bytes "
                                          "data-value={}>{}</span> of resident memory",
                                          survey.peak_bytes, bytes_text(survey.peak_bytes))
                            : "its memory was not recorded");
  return html;
}

std::string shards(const Survey& survey, const PageContext& context) {
  const DatasetParts& parts = survey.parts;
  std::vector<std::string> rows;
  for (const ShardState& shard : parts.missing) {
    rows.push_back(
        text_cell(escaped(shard.outline.name)) +
        text_cell("<strong class=bad>" + std::string(to_string(shard.condition)) + "</strong>") +
        right_cell(grouped(shard.outline.samples)) + right_cell("") + right_cell(""));
    if (rows.size() > kMostRows / 2) break;
  }
  for (const ShardState& shard : parts.done) {
    if (rows.size() > kMostRows) break;
    rows.push_back(text_cell(shard_link(context, shard.outline.name)) + text_cell("done") +
                   right_cell(grouped(shard.record->samples)) +
                   right_cell(grouped(shard.record->samples - shard.record->valid)) +
                   right_cell(bytes_text(shard.record->size_bytes)));
  }
  const auto all = std::ssize(parts.missing) + std::ssize(parts.done);
  const auto shown = std::min<std::ptrdiff_t>(std::ssize(rows), kMostRows);
  rows.resize(static_cast<std::size_t>(shown));
  std::string html =
      "<section><h2>Shards</h2>" + table({"shard", "", "#samples", "#quarantined", "#size"}, rows);
  if (shown < all) html += fmt::format("<p class=note>… and {} more</p>", grouped(all - shown));
  const std::vector<std::string> notes = notes_of(parts.frozen.plan, parts.done);
  if (!notes.empty()) {
    html += "<h3>Notes on the inputs</h3><ul>";
    for (std::size_t i = 0; i < std::min(notes.size(), kMostRows); ++i) {
      html += "<li>" + escaped(notes[i]) + "</li>";
    }
    html += "</ul>";
    if (notes.size() > kMostRows) {
      html +=
          fmt::format("<p class=note>… and {} more</p>", grouped(std::ssize(notes) - kMostRows));
    }
  }
  return html + "</section>";
}

constexpr char kStyle[] = R"css(
:root{color-scheme:light dark;--paper:#fbfaf8;--card:#fff;--ink:#1d2327;--soft:#5c666d;--line:#dcdfe1;--bad:#b3261e;--bad-paper:#fdecea;
--link:#0b5fa5;--more:#0b5fa566}
@media (prefers-color-scheme:dark){:root{--paper:#14181b;--card:#1c2226;--ink:#e6e9eb;--soft:#9aa5ac;--line:#343c42;--bad:#ffb4ab;
--bad-paper:#4a1410;--link:#8cc4ff;--more:#8cc4ff66}}
*{box-sizing:border-box}
body{margin:0 auto;padding:1.5rem clamp(.75rem,3vw,2.5rem) 4rem;max-width:1240px;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif;overflow-wrap:anywhere}
h1{font-size:1.9rem;margin:0;line-height:1.2}header p{margin:.25rem 0 1rem;color:var(--soft)}
h2{font-size:1.25rem;margin:2.5rem 0 .75rem;padding-top:1rem;border-top:1px solid var(--line)}h3{font-size:1rem;margin:1.25rem 0 .5rem}
a{color:var(--link)}code,pre{font:.86em/1.45 ui-monospace,"DejaVu Sans Mono",monospace}
pre{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:1rem;overflow:auto;max-height:30rem;overflow-wrap:normal}
.bad{color:var(--bad)}.warning{color:var(--bad);background:var(--bad-paper);border:1px solid var(--bad);border-radius:8px;padding:.75rem 1rem;font-weight:600}
.note{color:var(--soft);font-size:.9rem;max-width:52rem}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,9rem),1fr));gap:.75rem}
.tile{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:.7rem 1rem;color:var(--soft);font-size:.9rem}
.tile b{display:block;font-size:1.5rem;line-height:1.25;color:var(--ink);font-variant-numeric:tabular-nums}
.scroll{overflow-x:auto;border:1px solid var(--line);border-radius:8px;width:fit-content;max-width:100%;background:
linear-gradient(90deg,var(--card) 50%,transparent) 0 0/3rem 100% no-repeat local,
linear-gradient(270deg,var(--card) 50%,transparent) 100% 0/3rem 100% no-repeat local,
linear-gradient(90deg,var(--more),transparent) 0 0/1.25rem 100% no-repeat,
linear-gradient(270deg,var(--more),transparent) 100% 0/1.25rem 100% no-repeat,
linear-gradient(0deg,var(--card) 50%,transparent) 0 100%/100% 3rem no-repeat local,
linear-gradient(0deg,var(--more),transparent) 0 100%/100% 1.25rem no-repeat var(--card)}
.tall{margin-bottom:.75rem}.tall .scroll{max-height:28rem;overflow:auto}.tall thead{position:sticky;top:0;background:var(--card)}
@media (max-width:36rem){.scroll table:not(.facts){font-size:.8rem}.scroll table:not(.facts) :is(th,td){padding:.35rem .5rem;min-width:0}}
table{border-collapse:collapse;font-size:.9rem}th,td{padding:.4rem .8rem;text-align:left;vertical-align:top;overflow-wrap:normal}
td{min-width:4rem}thead th{color:var(--soft);font-weight:600;vertical-align:bottom}tbody tr,.facts tr+tr{border-top:1px solid var(--line)}
.facts{width:100%}.facts th{color:var(--soft);font-weight:600;white-space:nowrap}.facts td,td code{overflow-wrap:anywhere}
.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}thead th.n{white-space:normal}
.columns{display:flex;flex-wrap:wrap;gap:0 2rem;align-items:flex-start}.columns>div{max-width:100%}
.charts,.images{display:grid;gap:1rem;grid-template-columns:repeat(auto-fill,minmax(min(100%,26rem),1fr));align-items:start}
.images{grid-template-columns:repeat(auto-fill,minmax(min(100%,21rem),1fr))}
figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:8px;padding:.75rem;min-width:0}
.charts figcaption{font-weight:600;font-size:.95rem;margin-bottom:.4rem}
.images figure{padding:0;overflow:hidden}.images figcaption{padding:.5rem .75rem;font-size:.85rem;color:var(--soft)}
.images figcaption b{color:var(--ink)}img{display:block;width:100%;height:auto}svg{display:block;width:100%;height:auto}
details{margin:.75rem 0}summary{cursor:pointer;color:var(--link)}details>.scroll,details>pre{margin-top:.5rem}
)css";

}  // namespace

std::string report_page(const Survey& survey, const PageContext& context) {
  return fmt::format(
             "<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8>"
             "<meta name=viewport content=\"width=device-width,initial-scale=1\">"
             "<meta http-equiv=Content-Security-Policy content=\"default-src 'none'; img-src "
             "data:; "
             "style-src 'unsafe-inline'\"><title>{} – eventgan report</title><style>",
             escaped(survey.parts.frozen.plan.name)) +
         kStyle + chart_style() + "</style></head><body>\n" + head(survey, context) + "\n" +
         origin(survey, context) + "\n" + counts(survey) + "\n" + histograms(survey) + "\n" +
         labels_without_events(survey) + "\n" + images(survey, context) + "\n" +
         quarantine(survey, context) + "\n" + time(survey) + "\n" + shards(survey, context) +
         "\n</body></html>\n";
}

}  // namespace eventgan
