#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// Frames without labels of a known form, each of them a sample. ROOT is one of
///   a folder of pictures: one sequence, named ""; sample_id is the file name without extension;
///   a folder of such folders: each a sequence; sample_id is "FOLDER/NAME";
///   a video (mp4, avi, mov, mkv): one sequence named as the file without extension; sample_id is
///     "NAME/000012", counted from 0.
/// How pictures are numbered, PictureFolder says. time_s is the frame's number through
/// `frames_per_second`, else the video's own (VideoClip::time_s), else NaN.
///
/// A label is any JSON: NAME.json (the extension in small or capital letters) beside a picture,
/// unchanged byte for byte; for a video NAME.json beside it, an object from frame number to the
/// label, whose text is made compact; a manifest of this program is not taken for one. It is passed
/// through as Annotation::original, which is empty for a frame without label; there are no boxes
/// and no persons.
///
/// A video is decoded once at opening, to count and time its frames. Relative paths start at
/// `base`. Throws InputError if ROOT is none of these or a video's labels are malformed.
std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base);

}  // namespace eventgan
