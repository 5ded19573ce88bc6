#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// DHP19 (Calabrese et al., "DHP19: Dynamic Vision Sensor 3D Human Pose Dataset", 2019): four event
/// cameras around a person with markers. Below the root, as the dataset is downloaded,
///   DVS_movies/S1/session1/mov1.h5   events (Dhp19Events), or .hdf5;
///   Vicon_data/S1_1_1.mat            XYZPOS: a struct of 13 joints, each [T, 3] in mm at 100 Hz,
///                                    NaN where a marker was lost;
///   P_matrices/P1.npy .. P4.npy      [3, 4].
///
/// A sample is a window of WindowSpec::events events of one camera; they follow one another from
/// the recording's first event, and those that last longer than the poses are left out. Its label
/// is the mean, without NaN, of the poses from that of its first to that of its last event, row
/// floor(t / 10 ms), projected by the camera's matrix (cam0..cam3 have P4, P1, P3, P2): w [u, v, 1]
/// = P [X, Y, Z, 1], x = u, y = 260 - v, since v counts from the bottom. A joint outside the
/// image is not visible; of the others it is not known. Centre, scale and box as derive_frame
/// gives them. Annotation::original is the mean pose in mm and its rows.
///
/// Names: subject S1, action SESSION_MOVEMENT, camera 0..3; sequence S1/1_1/2, sample_id
/// S1/1_1/2/000012. FrameRef::index is a window's number, of the paired frames -1 and 1 that of its
/// first and last event. The manifest's `subjects` default to S1-S12 for split train, S13-S17 for
/// test; its `cameras` to 2 and 3.
///
/// Relative paths start at `base`. Throws InputError if a folder or matrix is missing, or a
/// recording cannot be opened or has no poses.
std::unique_ptr<Dataset> open_dhp19_dataset(const SourceSpec& spec,
                                            const std::filesystem::path& base);

extern const DatasetReader kDhp19Reader;

}  // namespace eventgan
