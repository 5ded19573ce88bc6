#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/outlines.h"

namespace eventgan {

/// A frame that has an annotation, and so becomes a sample.
struct LabelledFrame {
  /// Unique within its source and the same on every machine, whatever the order of the file system;
  /// what a user of the dataset would call the frame ("001497", "S1/Directions-1/54138969/000006").
  std::string sample_id;
  std::string sequence;   ///< the sequence it belongs to; empty if none is known
  FrameRef frame;         ///< the frame itself; its file may be absent (see Dataset::paired_frame)
  std::string label_key;  ///< what Dataset::annotation takes; stands alone in a frozen plan
  /// Why no pair of it can be trusted, if opening the dataset told so already (damaged timestamps);
  /// empty otherwise.
  std::string fault = {};
};

/// A frame some steps away from a labelled one.
struct PairedFrame {
  enum class State {
    kPresent,  ///< `frame` exists
    kMissing,  ///< the sequence goes on beyond it, but its file is absent: damage; `frame` names it
    kBeyond    ///< the sequence does not reach that far (or there is none): nothing is wrong
  };
  State state = State::kBeyond;
  FrameRef frame;
};

/// The events that a sample of real events is made of.
struct EventWindow {
  ImageSize sensor;           ///< the source image that coordinates and labels are in
  std::vector<Event> events;  ///< in time order; none: nothing happened

  /// Gives a pair without times those of the first and the last event, if there are any: they alone
  /// tell when a window of so many events begins and ends.
  void tell_times(FramePair& pair) const;
};

/// What the frames of a pair are made of, if they are not stored: of a clip made of a still.
struct MadePair {
  std::vector<Box> boxes = {};        ///< of the still, with outlines of all that moves on its own
  std::vector<StillPose> poses = {};  ///< as FramePair::poses; empty: the frames are stored
  OutlineCounts outlines = {};        ///< of `boxes`, in the first pair of a clip
};

/// The motion of each pixel of an image that somebody measured, to the image that follows it.
struct SourceFlow {
  std::string place;  ///< where it comes from, for messages
  ImageSize size;
  /// As of a volume of this size, in any numbers; known pixels that the other image does not show
  /// have their motion, unknown ones 0, and both are not valid. Empty: there is none.
  PixelFlow flow;
};

class ImageSizes;  // stages/frames/decoding/frame_decoder.h

/// A labelled frame dataset on disk: which frames are labelled, which lie beside them, and what
/// their labels say. Opening one lists files and reads annotation files; it decodes no image, but
/// for KITTI object with its raw drives, an image of each drive, and videos.
///
/// Steps between frames are counted in *stored* frames: where a sequence stores every fifth frame
/// of a video (or takes them, SourceSpec::every), one step is five frames of that video, and
/// FrameRef::index and time_s tell so.
///
/// Thread safety: all methods may be called from several threads at once.
class Dataset {
 public:
  virtual ~Dataset() = default;

  /// What class and joint numbers mean in this source.
  virtual const LabelSchema& label_schema() const = 0;

  /// Every labelled frame, sorted by sample_id.
  virtual const std::vector<LabelledFrame>& labelled_frames() const = 0;

  /// The frame `steps` after the labelled one (before it, if negative; itself, if 0).
  virtual PairedFrame paired_frame(const LabelledFrame& frame, int steps) const = 0;

  /// Reads one annotation. A fault if it is malformed ("expected X, got Y, in PATH:LINE").
  virtual Outcome<Annotation> annotation(const std::string& label_key) const = 0;

  /// Of a frame that is made of a still, the still's own annotation; else as `annotation`.
  virtual Outcome<Annotation> still_annotation(const std::string& label_key) const {
    return annotation(label_key);
  }

  /// Of the pair of a labelled frame, what its frames are made of. A fault if it cannot be told.
  virtual Outcome<MadePair> made_pair(const std::string& /*label_key*/) const { return MadePair(); }

  /// Of a labelled frame, the ground truth of optical flow to the next image of its pair, where
  /// SourceSpec::flow asks for it. A fault if it cannot be read.
  virtual Outcome<SourceFlow> flow(const std::string& /*label_key*/) const { return SourceFlow(); }

  /// The size of a labelled frame that is made; none: it is stored, and that of its file.
  virtual std::optional<ImageSize> made_size(const std::string& /*label_key*/) const {
    return std::nullopt;
  }

  /// Of a dataset of events (has_events), in which every "labelled frame" is a window: its
  /// paired frames -1 and 1 are the window's begin and end, always present, and no other is. Their
  /// times are NaN where the window is of so many events, which tell. `pairs` of these datasets is
  /// not looked at. Both throw std::logic_error for a dataset of frames.
  virtual ImageSize sensor_size(const std::string& label_key) const;
  /// A fault if what is stored is malformed.
  virtual Outcome<EventWindow> events(const std::string& label_key) const;

  /// The sizes that `annotation` asks for, of a source whose labels are measured by their images:
  /// who asks these learns them for both. Null: it asks for none.
  virtual ImageSizes* image_sizes() const { return nullptr; }

  /// Where a person finds that annotation: the file's path as FrameRef::path is written, and the
  /// place in it (`kitti/training/label_2/001497.txt`, `h36m/S1/Directions-1/annot.h5#5`,
  /// `mpii/mpii_human_pose_v1_u12_1.mat:annolist[0]`, `instances.json#images/17`); for messages.
  virtual std::string label_place(const std::string& label_key) const = 0;

  /// Every file the annotations come from, those with one frame each as well, written as
  /// FrameRef::path is, sorted; part of the plan's fingerprint.
  virtual std::vector<std::string> annotation_files() const = 0;

  /// What the labels' numbers mean, where files tell that may change: "class 2" is "person",
  /// "edges_from" is "0". What is stored was read so: the plan's fingerprint has each, and an
  /// input that was mended may add some, but change none.
  virtual std::map<std::string, std::string> label_meanings() const { return {}; }

  /// What the user should know about the source and no sample tells ("3 images without labels in
  /// kitti/training/image_2"); one line each.
  virtual std::vector<std::string> notes() const { return {}; }

  /// Those of the notes that had better be read before anything is converted: what was found makes
  /// the source of little use, though no sample is at fault.
  virtual std::vector<std::string> warnings() const { return {}; }

  /// What is in the source and cannot be read, a line each with the reason, and how many such
  /// things there are, read or not: the job's error policy says whether they may be left out.
  struct Unreadable {
    std::vector<std::string> reasons;
    std::int64_t of = 0;
  };
  virtual Unreadable unreadable() const { return {}; }
};

}  // namespace eventgan
