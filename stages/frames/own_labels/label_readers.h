#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/rows.h"
#include "stages/frames/naming/own_labels.h"

namespace eventgan {

struct FoundFrames;  // stages/frames/naming/found_frames.h

/// Where a format's labels of some frames lie.
struct LabelSearch {
  /// LabelSpec::path of them, and behind it files that label other images of the same folders;
  /// empty: there are none.
  std::vector<std::filesystem::path> paths = {};
  std::vector<std::string> remarks = {};  ///< on what is there and left out
  std::vector<std::string> unread = {};   ///< of a file that labels the same images once more
};

/// What finds and reads a format of labels. Each format has its own file, which defines its reader.
struct LabelReader {
  LabelFormat format;
  /// As the function open_own_labels.
  std::unique_ptr<OwnLabels> (*open)(const LabelSpec& spec, const std::filesystem::path& base,
                                     LabelledSource source);
  /// As far as names and beginnings of files tell. Cannot fail: what cannot be read is not found.
  LabelSearch (*find)(const FoundFrames& frames);
  std::string_view image_folder = {};  ///< in which a sequence's images may lie, in its own folder
  std::string_view extension = {};     ///< of its texts, where it has one an image or a sequence
};

/// MOT's gt.txt (parse_mot_labels): `path` is the file of the only sequence, or a folder that has
/// SEQUENCE/gt/gt.txt, SEQUENCE/gt.txt or SEQUENCE.txt, where SEQUENCE is a folder of images or a
/// video without its extension; of images right in ROOT gt/gt.txt or gt.txt. labels.txt beside it
/// names the classes, and then edges count from 0; the columns tell VisDrone's tables, from 0 too.
/// Notes tell which these are, and which sequences have the same labels. Frame 1 is the image
/// numbered 1, or the first where images are numbered from 0 (which a note tells), or a video's
/// frame 0. Images without numbers are counted in their order, and must be all of the sequence
/// (seqLength, or the last frame with labels), else InputError. seqinfo.ini beside it, or above its
/// folder gt, gives the sequence's rate and the images' size. The label_key is "GT_FILE#FRAME",
/// GT_FILE below `path`.
extern const LabelReader kMotReader;

/// COCO's instances and person keypoints: `path` is the JSON file. `file_name` is the image's path
/// below ROOT; or begins with the folders that ROOT ends in ("val2017/1.jpg" of ROOT/1.jpg in
/// .../val2017); or is a bare name that is in one folder of ROOT alone; or another way to write one
/// of these (FrameNames), which a note tells. Of a video's frame it is "STEM/NUMBER", perhaps with
/// an extension, counted from 0. The label_key is the image's id, its place is "FILE#images/ID".
///
/// Classes are numbered by ascending category id. `iscrowd` and `ignore` become Box::ignore. An
/// annotation with keypoints is a Box, and a Person with it if a joint is annotated; `bbox`,
/// `segmentation` (the outline) and `keypoints` are all measured from the image's left and upper
/// edge, as exports have them, so that a joint lies half a pixel less in Joint::at.
/// Annotation::original is {"image": ENTRY, "annotations": [ENTRY, ...]}, each entry byte for byte
/// as in the file.
///
/// PoseTrack's images with `is_labeled` false and no annotation have no label; the regions that it
/// ignores are boxes to ignore, and `bbox_head` is Person::head_box.
/// COCO-WholeBody's feet, face and hands are joints behind those that the category names.
///
/// The file is read through once, whatever its size, and of each entry its place is kept: about 20
/// bytes an annotation and 200 an image. An entry is read again, and strictly, when its annotation
/// is asked for. Throws InputError where the file is no COCO file: broken JSON, an id twice, an
/// annotation of no image, a bare name that several images have.
extern const LabelReader kCocoReader;

/// YOLO's text files: `path` is their folder, or one above it, and it or the folder above it has
/// data.yaml or the only YAML file with `names` (a list or a map from number; `kpt_shape`), or
/// classes.txt, obj.names or _darknet.labels (a name a line); without one the classes' names are
/// their numbers, which a note tells. An
/// image's text is at the image's own path with the last folder "images" replaced by "labels" if
/// that is below `path`, else at the image's path below ROOT, below `path`/labels,
/// `path`/obj_train_data (CVAT's) or `path`. Of frame 12 of clip.mp4 it is clip_000012.txt or
/// clip/000012.txt, of the only video frame_000012.txt or 000012.txt, too, with any number of
/// zeros, counted from 0. The label_key is the text's path below `path`. An empty text is an image
/// without objects; an image without text is no sample.
///
/// A line is "class xc yc w h", shares of the image's width and height from its left and upper
/// edge; with kpt_shape [J, 2 or 3] "class xc yc w h" and J times "px py [v]", v as COCO's; a joint
/// at 0, 0 without v is not annotated. Joints are named by data.yaml's kpt_names, by COCO's names
/// (with a note) if there are 17 and flip_idx mirrors no others, else "0", "1", ... A line
/// "class x1 y1 x2 y2 ..." is an outline (segmentation), and the box is what is around it; it may
/// stand among others. Where joints without kpt_shape may be meant (PoseEvidence), opening is an
/// InputError with both readings; kpt_shape: [0, 0] says that there are none.
extern const LabelReader kYoloReader;

/// Pascal VOC's XML files (parse_voc_labels): found as YOLO's texts are, with the last folder
/// "JPEGImages" or "images" replaced by "Annotations", or in annotations/xmls, labels, xml. All are
/// read at opening, since classes are numbered by their names' order, as with MOT's and tables'
/// labels; an image without boxes has a file without <object>. Edges count from
/// LabelSpec::edges_from; else from 0 where a box of the source begins there, as none of VOC's own
/// can, or Roboflow has written all, and from 1 where not. A note tells. Of a file in a folder
/// beside SegmentationObject the mask there of its name, if there is one, has the outlines, number
/// k that of the k-th <object> (give_outlines).
extern const LabelReader kVocReader;

/// A table (parse_csv_labels): `path` is the file; images are named as by COCO's file_name. The
/// label_key is the image as the table writes it.
extern const LabelReader kCsvReader;

/// Index masks alone (IndexMask), as Penn-Fudan's masks, DAVIS' Annotations and MOTS' instances:
/// found as YOLO's texts are, with the last folder "images", "JPEGImages", "img1", "imgs" or
/// "image_02" replaced by "masks", "instances" or "Annotations". Each object is a box, the bounds
/// of its outline, of the class "object". In folders of images, which are a sequence each, and in
/// videos the number is the track. Masks of 16 bits, of which the first with objects has numbers of
/// MOTS alone, are MOTS': 1000 class + instance, where class 1 is car and 2 pedestrian; 10000 is a
/// region to ignore. In others of 16 bits a number from 1000 on is a fault. Annotation::original is
/// {"mask": FILE, "objects": [NUMBER, ...], "sha256": OF THE FILE}.
extern const LabelReader kMasksReader;

/// Every format's, in the order of kLabelFormats.
inline constexpr auto kLabelReaders =
    parts_of<LabelReader>(kLabelFormats, {{LabelFormat::kMot, &kMotReader},
                                          {LabelFormat::kCoco, &kCocoReader},
                                          {LabelFormat::kYolo, &kYoloReader},
                                          {LabelFormat::kVoc, &kVocReader},
                                          {LabelFormat::kCsv, &kCsvReader},
                                          {LabelFormat::kMasks, &kMasksReader}});

const LabelReader& label_reader(LabelFormat format);

/// A file with labels of many images, and what it calls these.
struct ManyLabels {
  std::filesystem::path path;
  std::vector<std::string> images;
};

/// Takes the first of the files, if there is one, and each that labels none of the images of those
/// taken before it; the others are LabelSearch::unread, as are all behind the first if they are
/// many.
LabelSearch take_files(const FoundFrames& frames, const std::vector<ManyLabels>& files);

/// LabelReader::open of a class of labels.
template <class Labels>
std::unique_ptr<OwnLabels> open_labels(const LabelSpec& spec, const std::filesystem::path& base,
                                       LabelledSource source) {
  return std::make_unique<Labels>(spec, base, std::move(source));
}

/// Opens the labels that `spec` tells of; its path starts at `base`, the manifest's folder. Throws
/// InputError if a file of them is missing or broken as a whole.
std::unique_ptr<OwnLabels> open_own_labels(const LabelSpec& spec, const std::filesystem::path& base,
                                           LabelledSource source);

}  // namespace eventgan
