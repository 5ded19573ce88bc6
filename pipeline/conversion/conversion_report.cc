#include "pipeline/conversion/conversion_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/report.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"

namespace eventgan {
namespace {

double ratio(const ConversionReport& report) {
  return report.stored_bytes == 0 ? 0.0 : double(report.volume_bytes) / double(report.stored_bytes);
}

/// "part 3 of 7 (--shards): " in front; nothing for the whole plan.
std::string part_text(const ConversionReport& report) {
  return report.shards_planned == report.plan_shards ? "" : report.part + ": ";
}

std::string shards_text(const ConversionReport& report) {
  const std::string text =
      fmt::format("{} of {} written, {} quarantined, in {} of {}", report.written,
                  count_text(report.planned, "pair"), report.quarantined.size(), report.shards_done,
                  count_text(report.shards_planned, "shard"));
  std::vector<std::string> how;
  const auto add = [&](int count, const char* what) {
    if (count > 0) how.push_back(fmt::format("{} done {}", count, what));
  };
  add(report.shards_done_before, "before");
  add(report.shards_done_by_others, "by others");
  return how.empty() ? text : fmt::format("{} ({})", text, fmt::join(how, ", "));
}

/// "1,204".
std::string grouped(std::int64_t count) {
  std::string text = std::to_string(count);
  for (auto place = std::ssize(text) - 3; place > 0; place -= 3) {
    text.insert(static_cast<std::size_t>(place), ",");
  }
  return text;
}

/// What labels the pairs have: who gave some and reads of none has lost them.
std::string labels_text(const ConversionReport& report) {
  if (report.written == 0) return "";
  std::vector<std::string> parts;
  if (!report.boxes.empty()) {
    parts.push_back("boxes: " + joined(report.boxes, ", ", [](const auto& of_class) {
                      const auto& [name, count] = of_class;
                      const bool is_number = name.find_first_not_of("0123456789") == name.npos;
                      return grouped(count) + (is_number ? " of class " : " ") +
                             escape_controls(name);
                    }));
  }
  if (report.persons > 0) {
    parts.push_back(grouped(report.persons) + (report.persons == 1 ? " person" : " persons") +
                    " with joints");
  }
  if (report.has_flow) parts.push_back("optical flow");
  if (parts.empty()) {
    parts.push_back((report.is_labelled ? "EMPTY LABELS" : "NO LABELS") +
                    std::string(": no boxes and no persons with joints"));
  }
  return fmt::format("{}", fmt::join(parts, "; "));
}

std::string size_text(const ConversionReport& report) {
  std::string text =
      fmt::format("{}, volumes compressed {:.1f}x, {:.1f} s", bytes_text(report.stored_bytes),
                  ratio(report), report.wall_seconds);
  if (report.stage_seconds.empty()) return text;
  return text + "; busy seconds: " + joined(report.stage_seconds, " ", [](const auto& stage) {
           return fmt::format("{} {:.1f}", stage.first, stage.second);
         });
}

std::string unpaired_text(const ConversionReport& report) {
  const char* const noun = report.is_labelled ? "labelled frame" : "frame";
  return count_text(report.unpaired_frames, noun, " without a paired frame") +
         (report.unpaired_frames == report.unpaired
              ? ""
              : " for at least one of their gaps, " + count_text(report.unpaired, "pair") +
                    " in total") +
         " (listed in plan.json)";
}

Report table_of(const ConversionReport& report) {
  constexpr std::ptrdiff_t kListed = 20;
  return {{"event", "report"},
          {"part", report.part},
          part_text(report) + shards_text(report),
          {"planned", report.planned},
          {"written", report.written},
          {"shards_planned", report.shards_planned},
          {"shards_done", report.shards_done},
          {"shards_done_before", report.shards_done_before},
          {"shards_done_by_others", report.shards_done_by_others},
          {"plan_pairs", report.plan_pairs},
          {"plan_shards", report.plan_shards},
          size_text(report),
          {"stored_bytes", report.stored_bytes},
          {"volume_bytes", report.volume_bytes},
          {"compression_ratio", ratio(report)},
          {"stage_seconds", report.stage_seconds},
          {"wall_seconds", report.wall_seconds},
          labels_text(report),
          {"boxes", report.boxes},
          {"persons", report.persons},
          {"unpaired", report.unpaired, unpaired_text(report)},
          {"unpaired_frames", report.unpaired_frames},
          {"quarantined",
           json_list(report.quarantined,
                     [](const QuarantinedSample& sample) -> nlohmann::json {
                       return {{"sample_id", sample.sample_id}, {"reason", sample.reason}};
                     }),
           listed(report.quarantined, kListed, " (in the shards' commit records)",
                  [](const QuarantinedSample& sample) { return "quarantined: " + sample.reason; })},
          {"quarantined_elsewhere", report.quarantined_elsewhere},
          {"too_many_faults", report.too_many_faults},
          {"damaged", report.damaged},
          {"lost", report.lost},
          {"complete", report.complete()},
          {"stopped", report.stopped, "stopped on request; run the same command again to resume"},
          {"notes", report.notes, notes_text(report.notes)},
          {"folder", report.folder,
           report.folder + (report.finalized ? ": dataset.json, dataset.h5" : "")},
          {"finalized", report.finalized},
          report.quarantined.empty()
              ? ""
              : "next, once the inputs are fixed:  eventgan retry " + shell_word(report.folder)};
}

}  // namespace

void add_shard(const CommitRecord& record, std::int64_t volume_bytes, ConversionReport& report) {
  ++report.shards_done;
  report.written += record.valid;
  report.stored_bytes += record.size_bytes;
  report.volume_bytes += volume_bytes;
  for (const auto& [name, count] : record.contents.classes) report.boxes[name] += count;
  for (const std::int32_t count : record.contents.persons) report.persons += count;
  report.quarantined.insert(report.quarantined.end(), record.quarantined.begin(),
                            record.quarantined.end());
}

std::string to_text(const ConversionReport& report) { return text_of(table_of(report)); }
std::string to_json(const ConversionReport& report) { return json_text_of(table_of(report)); }

}  // namespace eventgan
