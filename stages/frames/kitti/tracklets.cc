#include "stages/frames/kitti/tracklets.h"

#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/strict_json/json_text_internal.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/kitti/text_table.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMaxFrame = 999'999'999;

using Json = nlohmann::ordered_json;

/// Thrown by number(), caught at the borders of this file.
struct BadField : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <class Number>
Number number(const pugi::xml_node& parent, const char* name) {
  const std::string_view text = parent.child_value(name);
  if (const auto parsed = parse_number<Number>(text)) return *parsed;
  throw BadField(std::string("expected a ") + (std::is_integral_v<Number> ? "whole" : "finite") +
                 " number for " + name + ", got " + in_quotes(text));
}

double size(const pugi::xml_node& tracklet, const char* name) {
  const auto metres = number<double>(tracklet, name);
  if (metres > 0) return metres;
  throw BadField(std::string("expected a size above 0 for ") + name + ", got " +
                 in_quotes(tracklet.child_value(name)));
}

/// The writers' "unset" is -1 kept in eight bits.
int occlusion(const pugi::xml_node& pose) {
  constexpr int kUnset = 255;
  const int level = number<int>(pose, "occlusion");
  if (level == kUnset) return -1;
  if (level >= -1 && level <= 3) return level;
  throw BadField("expected a number from -1 to 3 for occlusion, got " + std::to_string(level));
}

/// boost writes beside the items how many there are.
void check_count(const pugi::xml_node& list, std::string_view what) {
  const auto count = number<std::int64_t>(list, "count");
  const auto items = list.children("item");
  const auto found = std::distance(items.begin(), items.end());
  if (count == found) return;
  throw BadField("expected " + std::to_string(count) + " " + std::string(what) +
                 " as <count> says, got " + std::to_string(found));
}

/// The field's text as the JSON value that holds it without loss of meaning.
Json json_value(std::string_view text) {
  if (const auto whole = parse_number<std::int64_t>(text)) return *whole;
  if (const auto real = parse_number<double>(text)) return *real;
  return std::string(text);
}

/// boost's bookkeeping, which stands beside the data.
bool is_bookkeeping(std::string_view name) { return name == "count" || name == "item_version"; }

void add_fields(const pugi::xml_node& parent, Json& object) {
  for (const pugi::xml_node& field : parent.children()) {
    const std::string_view name = field.name();
    if (field.type() != pugi::node_element || name == "poses" || is_bookkeeping(name)) continue;
    object[std::string(name)] = json_value(field.child_value());
  }
}

TrackletPose read_pose(const pugi::xml_node& tracklet, const pugi::xml_node& pose) {
  TrackletPose read;
  const std::string_view type = tracklet.child_value("objectType");
  read.class_id = kitti_class_id(type);
  if (read.class_id < 0) throw BadField("expected one of KITTI's classes, got " + in_quotes(type));
  read.height = size(tracklet, "h");
  read.width = size(tracklet, "w");
  read.length = size(tracklet, "l");
  read.x = number<double>(pose, "tx");
  read.y = number<double>(pose, "ty");
  read.z = number<double>(pose, "tz");
  read.rotation_z = number<double>(pose, "rz");
  read.occlusion = occlusion(pose);
  read.truncation = number<int>(pose, "truncation");
  return read;
}

}  // namespace

struct Tracklets::Document {
  struct Entry {
    std::int64_t track;
    pugi::xml_node tracklet;
    pugi::xml_node pose;
  };

  pugi::xml_document xml;
  std::string path;
  std::map<std::int64_t, std::vector<Entry>> entries;  ///< by frame

  std::string where(std::int64_t track) const {
    return ", in " + path + " (tracklet " + std::to_string(track) + ")";
  }
};

Tracklets::Tracklets(const std::string& xml, std::string path)
    : document_(std::make_unique<Document>()) {
  document_->path = std::move(path);
  const auto result = document_->xml.load_buffer(xml.data(), xml.size());
  const pugi::xml_node tracklets = document_->xml.child("boost_serialization").child("tracklets");
  if (!result || !tracklets) {
    throw InputError("expected an XML file of tracklets, got '" +
                     std::string(result ? "another root" : result.description()) + "', in " +
                     document_->path);
  }
  try {
    check_count(tracklets, "tracklets");
  } catch (const BadField& error) {
    throw InputError(error.what() + (", in " + document_->path));
  }
  std::int64_t track = 0;
  for (const pugi::xml_node& tracklet : tracklets.children("item")) {
    try {
      auto frame = number<std::int64_t>(tracklet, "first_frame");
      if (frame < 0 || frame > kMaxFrame) {
        throw BadField("expected a first_frame from 0 to " + std::to_string(kMaxFrame) + ", got " +
                       std::to_string(frame));
      }
      check_count(tracklet.child("poses"), "poses");
      for (const pugi::xml_node& pose : tracklet.child("poses").children("item")) {
        document_->entries[frame++].push_back({track, tracklet, pose});
      }
    } catch (const BadField& error) {
      throw InputError(error.what() + document_->where(track));
    }
    ++track;
  }
}

Tracklets::~Tracklets() = default;
Tracklets::Tracklets(Tracklets&&) noexcept = default;

std::vector<std::int64_t> Tracklets::frames() const {
  std::vector<std::int64_t> frames;
  for (const auto& [frame, entries] : document_->entries) frames.push_back(frame);
  return frames;
}

Outcome<TrackletFrame> Tracklets::frame(std::int64_t frame_number) const {
  TrackletFrame frame;
  Json array = Json::array();
  const auto found = document_->entries.find(frame_number);
  if (found != document_->entries.end()) {
    for (const auto& [track, tracklet, pose] : found->second) {
      try {
        frame.poses.push_back(read_pose(tracklet, pose));
      } catch (const BadField& error) {
        return SampleFault{error.what() + document_->where(track)};
      }
      frame.poses.back().track = track;
      Json object{{"track", track}};
      add_fields(tracklet, object);
      object["pose"] = {{"frame", frame_number}};
      add_fields(pose, object["pose"]);
      array.push_back(std::move(object));
    }
  }
  // Bytes that are not UTF-8 must not stop a run: they become U+FFFD.
  frame.json = dump_json(array);
  return frame;
}

}  // namespace eventgan
