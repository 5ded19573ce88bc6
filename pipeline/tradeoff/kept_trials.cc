#include "pipeline/tradeoff/kept_trials.h"

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "manifests/documents/detail/json_text.h"
#include "pipeline/realism/realism_report.h"
#include "stages/base/files/atomic_file.h"
#include "stages/base/files/input_file.h"
#include "stages/base/files/sha256.h"

namespace eventgan {
namespace {

constexpr std::array<std::pair<const char*, double PairLoss::*>, 5> kLossFields{
    {{"relative_l2", &PairLoss::relative_l2},
     {"largest", &PairLoss::largest},
     {"f1_raw", &PairLoss::f1_raw},
     {"f1_time", &PairLoss::f1_time},
     {"time_correlation", &PairLoss::time_correlation}}};
constexpr std::array<std::pair<const char*, std::int64_t PairLoss::*>, 2> kLossCounts{
    {{"labelled_events", &PairLoss::labelled_events}, {"lost_events", &PairLoss::lost_events}}};
constexpr std::array<std::pair<const char*, double RoundCost::*>, 6> kCostFields{
    {{"generator_s", &RoundCost::generator_s},
     {"conversion_s", &RoundCost::conversion_s},
     {"reference_s", &RoundCost::reference_s},
     {"pairs_per_s", &RoundCost::pairs_per_s},
     {"peak_bytes", &RoundCost::peak_bytes},
     {"stored_bytes", &RoundCost::stored_bytes}}};

constexpr char kHashKey[] = "sha256";  ///< of the line without it

nlohmann::json json_of(const PairLoss& loss) {
  nlohmann::json json;
  for (const auto& [key, field] : kLossFields) json[key] = loss.*field;
  for (const auto& [key, field] : kLossCounts) json[key] = loss.*field;
  return json;
}

/// JSON has null for what is no finite number.
double number(const nlohmann::json& json, double if_null) {
  return json.is_null() ? if_null : json.get<double>();
}

PairLoss loss_of(const nlohmann::json& json) {
  PairLoss loss;
  for (const auto& [key, field] : kLossFields) {
    loss.*field = number(json.at(key), field == &PairLoss::relative_l2
                                           ? std::numeric_limits<double>::infinity()
                                           : std::numeric_limits<double>::quiet_NaN());
  }
  for (const auto& [key, field] : kLossCounts) loss.*field = json.at(key).get<std::int64_t>();
  return loss;
}

nlohmann::json json_of(const RoundCost& cost) {
  nlohmann::json json;
  for (const auto& [key, field] : kCostFields) json[key] = cost.*field;
  return json;
}

RoundCost cost_of(const nlohmann::json& json) {
  RoundCost cost;
  for (const auto& [key, field] : kCostFields) cost.*field = json.at(key).get<double>();
  return cost;
}

nlohmann::json json_of(const RealismScores& scores) {
  nlohmann::json json = nlohmann::json::object();
  for (const ScoreRow& row : kScoreRows) json[row.key] = scores.*row.member;
  return json;
}

RealismScores scores_of(const nlohmann::json& json) {
  RealismScores scores;
  for (const ScoreRow& row : kScoreRows) {
    scores.*row.member = number(json.at(row.key), std::numeric_limits<double>::quiet_NaN());
  }
  return scores;
}

std::filesystem::path file_of(const std::filesystem::path& folder, const std::string& key) {
  constexpr std::size_t kDigits = 24;  // enough to tell files apart; the whole key is in them
  return folder / (key.substr(0, kDigits) + ".json");
}

}  // namespace

KeptTrials::KeptTrials(const std::filesystem::path& folder) : folder_(folder / "kept") {
  require_no_link(folder, "kept");
  std::filesystem::create_directories(folder_);
}

void KeptTrials::load(Trial& trial, const std::string& key) {
  keys_[name_of(trial.configuration)] = key;
  std::string reason;
  const auto text = try_read_file(file_of(folder_, key), reason);
  if (!text) return;
  FaultList damage("kept");
  std::optional<nlohmann::json> parsed = parse_json_text(*text, damage);
  if (!parsed || !damage.empty()) return;
  nlohmann::json& json = *parsed;
  try {
    const auto hash = json.at(kHashKey).get<std::string>();
    json.erase(kHashKey);
    if (json.at("key") != key || sha256_hex(dump_json(json)) != hash) return;
    Trial kept = trial;
    for (const nlohmann::json& loss : json.at("losses")) kept.losses.push_back(loss_of(loss));
    for (const nlohmann::json& cost : json.at("rounds")) kept.rounds.push_back(cost_of(cost));
    for (const auto& [content, scores] : json.at("real").items()) {
      kept.real[content] = scores_of(scores);
    }
    kept.quarantined = json.at("quarantined").get<std::int64_t>();
    trial = std::move(kept);
  } catch (const nlohmann::json::exception&) {  // damaged: measured again
  }
}

void KeptTrials::save(const Trial& trial) const {
  const std::string name = name_of(trial.configuration);
  const std::string& key = keys_.at(name);
  nlohmann::json json = {{"key", key},
                         {"configuration", name},
                         {"quarantined", trial.quarantined},
                         {"losses", nlohmann::json::array()},
                         {"rounds", nlohmann::json::array()},
                         {"real", nlohmann::json::object()}};
  for (const PairLoss& loss : trial.losses) json["losses"].push_back(json_of(loss));
  for (const RoundCost& cost : trial.rounds) json["rounds"].push_back(json_of(cost));
  for (const auto& [content, scores] : trial.real) json["real"][content] = json_of(scores);
  json[kHashKey] = sha256_hex(dump_json(json));
  write_file_atomically(file_of(folder_, key), dump_json(json) + "\n");
}

}  // namespace eventgan
