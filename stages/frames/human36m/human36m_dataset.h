#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// Opens a Human3.6M source; `spec.layout` says how it lies on disk below `spec.root`:
///
/// - fetch (h36m-fetch): S1/Directions-1/imageSequence/54138969/img_000001.jpg with
/// S1/Directions-1/annot.h5,
///   whose rows give `pose/2d` [M, J, 2] px, `camera` and `frame` [M], and joints in the camera
///   frame [M, J, 3] mm with cameras [fx, cx, fy, cy]: `pose/3d` with `intrinsics/CAMERA`, or
///   `pose/3d-univ` with `intrinsics-univ/CAMERA` (in a file without `pose/3d` and those, with
///   `intrinsics/CAMERA`). Sample "S1/Directions-1/54138969/000001", label key
///   "S1/Directions-1/annot.h5#0".
/// - extracted: S1/S1_Directions_1.54138969/S1_Directions_1.54138969_000001.jpg with one .npz of
/// `imgname`,
///   `center` [N, 2] px, `scale` [N], `part` [N, J, 3] (x, y, confidence) and `S` [N, J, 4] (x, y,
///   z in metres, confidence): `spec.annotations`, or else the only such file of 17 joints in the
///   root. `imgname` is a path below the root, or a bare file name. Sample
///   "S1_Directions_1.54138969_000001", label key "FILE.npz#0".
/// - official (as it is downloaded): S1/Videos/Directions 1.54138969.mp4 with
///   S1/MyPoseFeatures/D2_Positions/Directions 1.54138969.cdf, whose `Pose` [M, 64] (x, y) px are
///   32 joints, and, if it is there, D3_Positions_mono/Directions 1.54138969.cdf [M, 96] (x, y, z)
///   mm in the camera's frame. Of the frames 1 to M those numbered 1 + a multiple of `spec.every`
///   are taken. Sample "S1/Directions 1/54138969/000001", label key
///   "S1/MyPoseFeatures/D2_Positions/Directions 1.54138969.cdf#0".
///
/// Of the last two, intrinsics and distortion come from cameras.pkl in the root, if it is there.
///
/// Every row is a sample of one person. Frame numbers are the official ones, from 1 at 50 frames a
/// second, so time_s = (number - 1) / 50; one step is one frame of those stored or labelled, or
/// taken of a video. A row whose image is absent stays a labelled frame, a missing one. A video
/// tells how many frames it has; rows beyond that are no labelled frames, and notes() count them,
/// as they do videos and files of poses without the other. A video that cannot be read, or is not
/// one of 50 frames a second, is a fault of its frames. Visibility is not annotated: Joint::visible
/// is -1. In an .npz a joint at (0, 0) without confidence is one without annotation, kMissingPoint;
/// elsewhere it stays, with visible 0; a joint in 3-D without confidence is unknown. A person whose
/// camera does not project the joints in 3-D onto those in the image (kProjectionTolerance_px) has
/// no camera; notes() tell how many. Values that are not finite are a fault of their row; in fields
/// that this program does not use, JSON makes them null. Annotation::original is an object with
/// every field of the row, and the camera's.
///
/// The annotations of all frames taken are read into memory here (about 1-2 kB each), so that
/// nothing uses HDF5 later: it is not thread safe, and open_human36m_dataset must not run while
/// another thread is in HDF5. Of a video the first frame is decoded.
///
/// Throws InputError if a folder or file is missing or malformed or a frame is annotated twice,
/// UsageError if there is not exactly one .npz to choose.
std::unique_ptr<Dataset> open_human36m_dataset(const SourceSpec& spec,
                                               const std::filesystem::path& base);

/// What the name of a sequence tells: SUBJECT, separator, ACTION, last separator, CAMERA, with "/"
/// or "_" and "." as separators.
FrameOrigin human36m_origin(const std::string& sequence);

extern const DatasetReader kHuman36mReader;

}  // namespace eventgan
