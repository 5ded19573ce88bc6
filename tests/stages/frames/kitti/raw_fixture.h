#pragma once

#include <string>

namespace eventgan::testing {

/// A scanner in the camera's place, looking the same way, and a camera of focal length 100 px whose
/// middle is (50, 20) in an image of 100 x 40 pixels. So the scanner's (x, y, z) is the camera's
/// (-y, -z, x) and is seen at (50 - 100 y/x, 20 - 100 z/x).
inline constexpr const char* kVeloToCam =
    "calib_time: 15-Mar-2012 11:37:16\n"
    "R: 0 -1 0 0 0 -1 1 0 0\n"
    "T: 0 0 0\n";
inline constexpr const char* kCamToCam =
    "S_rect_02: 1.000000e+02 4.000000e+01\n"
    "R_rect_00: 1 0 0 0 1 0 0 0 1\n"
    "P_rect_02: 100 0 50 0 0 100 20 0 0 0 1 0\n";

/// A pose of a tracklet as boost writes it.
inline std::string pose_xml(const std::string& x, const std::string& rz = "0") {
  return "<item><tx>" + x + "</tx><ty>0</ty><tz>-1</tz><rx>0</rx><ry>0</ry><rz>" + rz +
         "</rz><state>2</state><occlusion>1</occlusion><occlusion_kf>0</occlusion_kf>"
         "<truncation>0</truncation><amt_occlusion>-1</amt_occlusion></item>";
}

/// A tracklet, 2 m high, 1 m wide and 4 m long.
inline std::string tracklet_xml(const std::string& type, const std::string& first_frame,
                                const std::string& poses) {
  // Each of the poses has one "tx".
  std::size_t count = 0;
  for (auto at = poses.find("<tx>"); at != std::string::npos; at = poses.find("<tx>", at + 1)) {
    ++count;
  }
  return "<item><objectType>" + type + "</objectType><h>2.0</h><w>1</w><l>4</l><first_frame>" +
         first_frame + "</first_frame><poses><count>" + std::to_string(count) +
         "</count><item_version>2</item_version>" + poses + "</poses><finished>1</finished></item>";
}

inline std::string tracklets_xml(const std::string& tracklets) {
  std::size_t count = 0;
  for (auto at = tracklets.find("<objectType>"); at != std::string::npos;
       at = tracklets.find("<objectType>", at + 1)) {
    ++count;
  }
  return "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\" ?>\n"
         "<!DOCTYPE boost_serialization>\n<boost_serialization version=\"9\"><tracklets>"
         "<count>" +
         std::to_string(count) + "</count><item_version>1</item_version>" + tracklets +
         "</tracklets></boost_serialization>\n";
}

}  // namespace eventgan::testing
