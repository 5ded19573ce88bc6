#pragma once

#include <string>

#include "manifests/values/faults.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {

/// The annotation of one image as Pascal VOC has it, an XML file an image
/// (host.robots.ox.ac.uk/pascal/VOC/voc2012, its development kit's "Annotations"). Which image it
/// is of, the file's own name tells; <filename> and <path> name those of who made it.
///
/// From <annotation> are read: <size> with <width> and <height>, if they are there and above 0; of
/// each <object> <name>, and <bndbox> with <xmin>, <ymin>, <xmax>, <ymax>, perhaps with decimals.
/// VOC's count pixels from 1 and lie within the box: left = xmin - 1, top = ymin - 1, right = xmax,
/// bottom = ymax. Those of CVAT, VoTT and Roboflow are edges that count from 0: `edges_from` is
/// what xmin of the image's left edge is. Of an object may be there besides, each 0 or 1:
///   <difficult>  1: ignore, as VOC's scores leave it out
///   <truncated>  1: truncation 1 (cut by the image's border, how far is not told); 0: truncation
///   0;
///                a share between them: that
///   <occluded>   1: occlusion 1; 0: occlusion 0
///   <trackid>    (ImageNet VID) a whole number from 0: the track, unless two objects have it
/// Anything else in these is unknown, with a remark. What else there is, as <part>, <pose>,
/// <segmented>, is kept in the original alone.
///
/// A fault, as "expected X, got Y, in PATH (object 3)", where a name or an edge is missing, one of
/// all these is there twice, a number is none or not finite, a name is empty or has control
/// characters, or the text is no XML, has a DOCTYPE (none is needed, and entities come of it), an
/// unknown entity in a name, or a NUL. Thread safe.
Outcome<ImageLabels> parse_voc_labels(std::string xml, int edges_from, const std::string& path);

}  // namespace eventgan
