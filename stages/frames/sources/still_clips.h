#pragma once

#include <memory>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// Makes the datasets of sources with PairSpec::clip_frames datasets of clips: of each labelled
/// frame of the source, a sequence "ID" of so many labelled frames "ID/0001", and one frame more
/// before or after them, for the first or last pair. The frames are made of the image when they are
/// read, SourceSpec::frames_per_second apart (20 unless given), and show its clip_window.
///
/// With StillsSpec::objects each object moves on its own that has an outline or, without one, can
/// be cut out of its box (cut_out.h), once for all frames of its clip.
///
/// Their labels are those of the image where they have moved: an object that moves on its own has
/// the outline of what can be seen of it and the box around that (one that was cut out has no
/// outline, and its box keeps its distance from it), its own track, an occlusion of at
/// least 1 or 2 where others cover more than 5 % or half of it (else the still's, known or not),
/// and a truncation of what lies outside (of kitti_tracking at least its level 1). KITTI object's
/// difficulty is that of the box as it is then. A box of which less than 5 % can be seen is left
/// out. Joints move with the object whose box is the person's, and are hidden (visible 0) where a
/// nearer object covers them. What is said of three dimensions is unknown.
///
/// `datasets`: one for each source; null ones are passed over. To be called once, before
/// number_classes.
void make_clips(const JobManifest& manifest, std::vector<std::unique_ptr<Dataset>>& datasets);

}  // namespace eventgan
