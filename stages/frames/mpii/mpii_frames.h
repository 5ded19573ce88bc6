#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/listing/numbered_sequence.h"

namespace eventgan {

/// Where the parts of an MPII download lie, each path as the manifest writes its beginning.
struct MpiiPlaces {
  std::string annotations;  ///< mpii_human_pose_v1_u12_1.mat
  std::string keyframes;    ///< mpii_human_pose_v1_sequences_keyframes.mat; empty if absent
  std::vector<std::string> image_folders;
  std::vector<std::string> sequence_folders;
};

/// Finds them; see open_mpii_dataset for where it looks. Throws InputError, saying where it looked,
/// if a .mat file, the root, or a folder that the manifest names is missing. The keyframes may be,
/// where no pair comes of sequences: without them, or of stills.
MpiiPlaces find_mpii_places(const SourceSpec& spec, const std::filesystem::path& base);

/// mpii_human_pose_v1_u12_1.mat in a root, or in its mpii_human_pose_v1_u12_2; empty if it is in
/// neither.
std::filesystem::path find_mpii_annotations(const std::filesystem::path& root);

/// The keyframes' file in the first of `folders` that has it; empty if none has.
std::string find_mpii_keyframes(const std::vector<std::string>& folders,
                                const std::filesystem::path& base);

/// True if both files can be read and hold the same bytes. Sizes are compared first.
bool same_bytes(const std::filesystem::path& a, const std::filesystem::path& b);

/// How the folders that MPII's sequences are downloaded as begin; each holds many sequences.
inline constexpr std::string_view kMpiiBatchPrefix = "mpii_human_pose_v1_sequences";

/// What manifests of MPII say, but for a kind's own.
inline constexpr DraftHabits kMpiiHabits{
    .side = PairSide::kAround,
    .gaps = {2, 4},
    .size_comment =
        "Images come in many shapes; letterboxing keeps each one's shape and adds borders.",
    .size = R"("width": 640, "height": 480, "fit": "letterbox")"};

/// What the note says of labelled frames of which is_without_image is true, after their number.
inline constexpr const char* kWithoutImage =
    " of a sequence whose image is not in images: labels are taken to be in pixels of the frame";

/// How many pixels of the labelled frame one of the annotated image is.
struct LabelScale {
  double x = 1;
  double y = 1;
};

/// Where MPII's images lie: single ones in folders of images, and the videos around them as one
/// folder of numbered frames each. All paths are as the manifest writes them; relative ones start
/// at `base`.
///
/// A labelled frame with a sequence *is* its keyframe, FrameRef::index being the keyframe's number;
/// one without is the single image and has no paired frames. Times are unknown: the rate differs
/// from video to video.
///
/// Thread safety: const methods may be called from several threads; a sequence is listed when its
/// first paired frame is asked for.
class MpiiFrames {
 public:
  /// An image is looked for in `image_folders` in turn. `sequence_folders` hold folders named as
  /// the sequences, directly or inside the download's mpii_human_pose_v1_sequences_batchN. Absent
  /// folders count as empty. Throws InputError if a folder cannot be read.
  MpiiFrames(std::filesystem::path base, std::vector<std::string> image_folders,
             const std::vector<std::string>& sequence_folders);

  /// The frame labelled through `image` ("037454012.jpg"), whose name without extension is its
  /// sample_id. It lies in its video if `keyframe` ("037454012/00000053.jpg") has a folder here. No
  /// label_key.
  LabelledFrame labelled(const std::string& image, const std::string& keyframe) const;

  /// As Dataset::paired_frame. InputError if the sequence's folder cannot be read.
  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const;

  /// MPII was annotated on the images in `images`; a frame of its video may be stored in another
  /// size. The ratio of the sizes of `frame` and of the image `image`: 1 where they are one file,
  /// or no image of that name is there to tell. A fault if the sizes are not of one shape (with
  /// one side made equal, the other differs by more than one pixel of the smaller of the two), or
  /// the image is there and cannot be read. A frame that cannot be read is left to its decoder.
  Outcome<LabelScale> label_scale(const std::string& image, const std::string& frame) const;

  /// True if `labelled` is a frame of a video, and the image `image` is not there to compare.
  bool is_without_image(const LabelledFrame& labelled, const std::string& image) const;

  /// "NAME/00000053.jpg": the frame of sequence NAME whose file is byte for byte that of `image`;
  /// empty if there is none. For lists that do not say which frame was labelled. Reads files.
  std::string find_keyframe(const std::string& image) const;

 private:
  struct Sequence {
    explicit Sequence(std::string written) : folder(std::move(written)) {}
    std::string folder;
    mutable std::once_flag listed;
    mutable NumberedSequence frames;
  };

  const NumberedSequence& frames_of(const Sequence& sequence) const;

  std::filesystem::path base_;
  std::vector<std::string> image_folders_;
  std::unordered_map<std::string, std::string> images_;  ///< name to path as written
  std::map<std::string, Sequence, std::less<>> sequences_;
};

/// Moves labels from the annotated image into the frame: a point as x' = (x + 0.5) s - 0.5, an
/// edge as x' = x s, Person::scale with the root of the two factors' product.
void scale_labels(const LabelScale& scale, std::vector<Person>& persons);

/// `name` without its last extension.
std::string without_extension(std::string_view name);

/// Sorts by sample_id. Throws InputError naming `file` if two samples have one.
void sort_samples(std::vector<LabelledFrame>& frames, const std::filesystem::path& file);

}  // namespace eventgan
