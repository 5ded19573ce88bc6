#pragma once

#include "manifests/documents/detail/fields.h"
#include "manifests/values/events.h"
#include "manifests/values/job.h"
#include "manifests/values/simulation.h"
#include "manifests/values/training.h"

namespace eventgan {

// The tables of the documents' fields (fields.h).

void list_job(Fields& fields, JobManifest& manifest);
void list_training(Fields& fields, TrainingManifest& manifest);
void list_simulation(Fields& fields, SimulationManifest& manifest);
void list_camera_sensor(Fields& fields, CameraSensor& sensor);

/// A job's `generator`.
void list_generator(Fields& fields, GeneratorSpec& spec);

/// A simulated sensor's settings; of any object, or of some kinds of it.
void list_sensor(Fields& fields, SensorSpec& spec);
void list_sensor(Fields::Only fields, SensorSpec& spec);

/// A contrast threshold, `what` says of what, and its ratio.
void list_threshold(Fields& fields, std::optional<ThresholdSpec>& threshold, std::string_view what);

void list_noise(Fields& fields, NoiseSpec& spec);

inline constexpr char kSeedField[] =
    "Decides everything that is drawn at random: the same seed draws the same.";
inline constexpr char kNoiseField[] =
    "Noise events that are added to finished volumes, +1 in one voxel each: a Poisson process of "
    "each pixel over the pair's gap_s, or where that is unknown over duration_s. A range is drawn "
    "from uniformly for each pair.";

}  // namespace eventgan
