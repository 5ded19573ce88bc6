// How well objects are cut out of their boxes, and what one takes: of persons whose outlines people
// drew (IoU of what is cut, and of the ellipse in the box), by the reduced copy's side, iterations
// and core. Folders of images and index masks of the same names, 0 background, k the k-th object:
//   EVENTGAN_CUT_OUT_IMAGES=pennfudan/images EVENTGAN_CUT_OUT_MASKS=pennfudan/masks \
//   build/release/tests/eventgan_cut_out_benchmark

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "manifests/values/outlines.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/cut_out.h"
