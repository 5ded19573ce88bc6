#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

class FrameNames;  // stages/frames/naming/frame_names.h
class ImageSizes;  // stages/frames/decoding/frame_decoder.h

/// A frame of a source of images or videos, as labels may name it.
struct SourceFrame {
  /// Of an image its path below ROOT, with forward slashes ("clip/000012.jpg"); of frame 12 of
  /// clip.mp4, "clip/12".
  std::string name;
  std::string sequence;
  std::int64_t number = 0;        ///< FrameRef::index
  std::optional<ImageSize> size;  ///< of a video's frames; an image is asked when it is needed
  bool is_numbered = true;        ///< the name has the number; else images are counted from 0
};

/// What a source is that has labels of its own.
struct LabelledSource {
  SourceRoot root;
  std::vector<SourceFrame> frames;  ///< by sequence, in each ascending by number
  bool is_video = false;            ///< its frames are of videos
};

/// What the labels say of one frame of the source.
struct FrameLabel {
  std::string key;    ///< LabelledFrame::label_key; empty: the frame has no label
  std::string fault;  ///< LabelledFrame::fault
};

/// A frame that the labels name and the source does not have.
struct AbsentFrame {
  std::string name;  ///< as SourceFrame::name; of a video perhaps with zeros
  std::string key;
  std::string fault = {};  ///< LabelledFrame::fault
};

/// A label of a file that names its images, and which name that is.
struct NamedLabel {
  std::string image;
  std::string key;
};

/// Labels of one's own for the frames of a source. What `label_key`s are, and where each format's
/// labels lie, the readers of own_labels/label_readers.h say. Coordinates are in pixels of the
/// image turned upright as its EXIF orientation says. A box that is nowhere within its image is
/// left out (add_box); one that reaches beyond an edge is kept as it is.
///
/// Thread safety: all methods may be called from several threads at once.
class OwnLabels {
 public:
  virtual ~OwnLabels();
  OwnLabels(const OwnLabels&) = delete;
  OwnLabels& operator=(const OwnLabels&) = delete;

  const LabelledSource& source() const { return source_; }
  const LabelSchema& schema() const { return schema_; }
  /// One for each of the source's frames.
  const std::vector<FrameLabel>& labels() const { return labels_; }
  const std::vector<AbsentFrame>& absent() const { return absent_; }
  /// As that of Dataset.
  ImageSizes* image_sizes() const { return image_sizes_.get(); }

  /// As those of Dataset.
  const std::vector<std::string>& annotation_files() const { return annotation_files_; }
  const std::map<std::string, std::string>& meanings() const { return meanings_; }
  const std::vector<std::string>& notes() const { return notes_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  virtual Outcome<Annotation> annotation(const std::string& label_key) const = 0;
  virtual std::string label_place(const std::string& label_key) const = 0;

  /// What the labels say about a sequence's rate; none if they do not.
  virtual std::optional<double> frames_per_second(const std::string& /*sequence*/) const {
    return std::nullopt;
  }

 protected:
  explicit OwnLabels(LabelledSource source);

  /// Gives a frame its label. A second one is a fault of the sample, which names both places.
  void give(std::size_t frame, const std::string& key);

  /// Adds a frame that the source does not have.
  void give_absent(const std::string& name, const std::string& key);

  /// Gives frames the labels of a file by the names that it has for them (FrameNames). What it
  /// names and the source does not have is absent; but where that is ten or more and over a quarter
  /// of all, the file is of a larger set, and a note tells how many. Throws InputError for names
  /// that several folders of ROOT have, and for names that fit only without their folders where
  /// these are several.
  void give_named(const std::vector<NamedLabel>& named, const std::string& labels_path);

  /// Warns where a video's labels are of frames 1 to COUNT, since it has 0 to COUNT - 1; called
  /// once all are given. `absent`: what the labels name and the source does not have.
  void warn_of_counts_from_1(const std::vector<AbsentFrame>& absent, FrameNames& names,
                             const std::string& labels_path);

  /// Tells how many frames have no label; called once all are given.
  void note_without_label(const std::string& labels_path);

  /// The size of the image that the key is of, upright; a fault if it cannot be read or is another
  /// than the labels claim.
  Outcome<ImageSize> image_size(const std::string& label_key,
                                std::optional<ImageSize> claimed = std::nullopt) const;

  LabelSchema schema_;
  std::vector<std::string> annotation_files_;
  std::map<std::string, std::string> meanings_;  ///< Dataset::label_meanings
  std::vector<std::string> notes_, warnings_;

 private:
  LabelledSource source_;
  std::vector<FrameLabel> labels_;
  std::vector<AbsentFrame> absent_;
  std::unordered_map<std::string, std::size_t> frame_of_key_;
  std::unique_ptr<ImageSizes> image_sizes_;
};

}  // namespace eventgan
