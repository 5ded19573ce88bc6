#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// Images and videos of one's own. ROOT is one of
///   a folder of images: the sequences that their names tell (name_sequences), named so; the only
///     one is named as the folder. sample_id is the file name without extension;
///   a folder of such folders, perhaps two deep: each a sequence, or as many as its names tell;
///     sample_id is "FOLDER/NAME"; with MOT's labels the images may lie in FOLDER/img1;
///   a video (is_video_name): one sequence named as the file without extension; sample_id is
///     "NAME/000012", counted from 0;
///   a folder of videos: each a sequence. One that cannot be read is left out, with a note.
/// How images are numbered, NamedSequence says. Images that are taken as stills are sequences by
/// their folders alone, and of none right in ROOT. time_s is the frame's count through
/// `frames_per_second`, one step of the sequence being one frame; else its number through the rate
/// of the labels (seqinfo.ini); else the time that its name is, or the video's own
/// (VideoClip::time_s), since the first; else NaN.
///
/// With SourceSpec::labels (stages/frames/own_labels/label_readers.h) the frames that have a label
/// are the samples, and all others serve as paired frames. A frame that the labels name and ROOT
/// does not have is a sample, too, whose frames are missing; its FrameRef::index is -1.
///
/// Without, each frame is a sample. A label is any JSON then: NAME.json (the extension in small or
/// capital letters) beside an image, unchanged byte for byte; for a video NAME.json beside it, an
/// object from frame number to the label, whose text is made compact; a manifest of this program is
/// not taken for one. It is passed through as Annotation::original, which is empty for a frame
/// without label; there are no boxes and no persons.
///
/// Where several of these lie in one folder, images count before videos, and videos before
/// folders, of these none that is called as one of labels (drop_label_folders); what is left out,
/// the notes name. A video is decoded once at opening, to count and time its frames. Relative paths
/// start at `base`. Throws InputError if ROOT is none of these or labels as a whole are malformed.
std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base);

/// Whether there are images or videos that such a dataset may have, as far as names tell.
bool is_frames_root(const std::filesystem::path& root);

struct ImageFolder;

/// open_frames_dataset for folders of images; `top`: ROOT's listing. Without SourceSpec::labels the
/// label_key is the sidecar's path below ROOT; the image's if there is none.
std::unique_ptr<Dataset> open_images_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base, ImageFolder top);

/// Labels by frame number.
using VideoLabels = std::map<std::int64_t, std::string>;

/// Reads a video's labels: a JSON object (comments allowed) from frame number ("12", leading zeros
/// allowed) to any JSON value, given here as compact text, object keys in their order. Nothing if
/// the file is a manifest of this program, which a user may well name as the video. Throws
/// InputError naming the file and `video` if it cannot be read, is no such object, or names a frame
/// twice.
std::optional<VideoLabels> read_video_labels(const std::filesystem::path& file,
                                             const std::string& video);

/// open_frames_dataset for a video or a folder of them. Without SourceSpec::labels the label_key is
/// "NAME/12"; "NAME/" if frame 12 has no label.
std::unique_ptr<Dataset> open_videos_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base);

extern const DatasetReader kFramesReader;

}  // namespace eventgan
